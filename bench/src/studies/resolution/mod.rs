//! `resolution`: bodies at the resolution of their image, as many processes as mpirun starts, by PETSc.
//!
//! `bodies.rs` makes them, `measured.rs` has them come to rest and says what it took; both need the feature `petsc`.

#[cfg(feature = "petsc")]
mod bodies;
#[cfg(feature = "petsc")]
mod measured;

use clap::Args;

use crate::harness::Common;

/// What is solved, and how well.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Voxels along unit cubes with a stiff ball, powers of two, comma-separated; quick: 8,16,32.
    #[arg(long, value_delimiter = ',', value_name = "N", default_value = "16,32,64")]
    cubes: Vec<usize>,
    /// How many times as stiff the ball is as what is around it.
    #[arg(long, value_name = "RATIO", default_value_t = 1e6)]
    ratio: f64,
    /// Voxels of the liver phantom, mm, comma-separated; without it no liver is solved.
    #[arg(long, value_delimiter = ',', value_name = "MM")]
    liver_mm: Vec<f64>,
    /// Residual over load at which a body counts as at rest.
    #[arg(long, value_name = "R", default_value_t = 1e-10)]
    residual: f64,
}

#[cfg(feature = "petsc")]
pub use measured::run;

/// Runs the study.
/// # Errors
/// [`BenchError::FeatureMissing`](crate::BenchError::FeatureMissing).
#[cfg(not(feature = "petsc"))]
pub fn run(_: &Arguments) -> crate::Result<String> {
    Err(crate::BenchError::FeatureMissing("resolution", "petsc"))
}
