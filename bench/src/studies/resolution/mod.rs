//! `resolution`: bodies at the resolution of their image, as many processes as mpirun starts, by PETSc.
//!
//! `bodies.rs` makes them, `measured.rs` has them come to rest and says what it took; both need the feature `petsc`.

mod arguments;
#[cfg(feature = "petsc")]
mod bodies;
#[cfg(feature = "petsc")]
mod measured;

pub use arguments::Arguments;
#[cfg(feature = "petsc")]
pub use measured::run;

/// Runs the study.
/// # Errors
/// [`BenchError::FeatureMissing`](crate::BenchError::FeatureMissing).
#[cfg(not(feature = "petsc"))]
pub fn run(_: &Arguments) -> crate::Result<String> {
    Err(crate::BenchError::FeatureMissing("resolution", "petsc"))
}
