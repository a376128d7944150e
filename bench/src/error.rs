//! What can go wrong while a bench is set up or a study is written.

use std::path::PathBuf;

use thiserror::Error;
use yawara_corot::CorotError;
use yawara_embed::EmbedError;
use yawara_inverse_update::InverseError;
use yawara_mesh::MeshError;

/// Everything that the benches and studies refuse.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The mesh stage refused.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The embedding stage refused.
    #[error(transparent)]
    Embed(#[from] EmbedError),
    /// The co-rotation stage refused.
    #[error(transparent)]
    Corot(#[from] CorotError),
    /// An equilibrium that was not found.
    #[error("`{case}`: `{method}` ended at a relative residual of {reached:e}, want {limit:e}")]
    NotConverged {
        /// The case.
        case: &'static str,
        /// The method that ran last.
        method: &'static str,
        /// The relative residual.
        reached: f64,
        /// The limit.
        limit: f64,
    },
    /// The inverse stage refused.
    #[error(transparent)]
    Inverse(#[from] InverseError),
    /// The device refused.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] yawara_gpu::GpuError),
    /// A part that this program was built without.
    #[error("{what} needs the feature `gpu`: build with --features gpu")]
    FeatureMissing {
        /// What was asked for.
        what: &'static str,
    },
    /// A maintainer put a vertex into another slot than the contract says.
    #[error("`{maintainer}` put the new vertex into slot {got}, want {want}")]
    WrongSlot {
        /// Its scene name.
        maintainer: &'static str,
        /// The slot it returned.
        got: usize,
        /// The slot by the contract: the last one.
        want: usize,
    },
    /// No split and no merge is possible.
    #[error(
        "no ring left to split or merge among {vertices} vertices, want a deeper max_level \
         or a larger body"
    )]
    NoRing {
        /// Active vertices.
        vertices: usize,
    },
    /// A number on the command line is out of range.
    #[error("{option} is {value}, want {low} to {high}", low = .limits.0, high = .limits.1)]
    OutOfRange {
        /// The option.
        option: &'static str,
        /// The number given.
        value: usize,
        /// Smallest and largest number that make sense.
        limits: (usize, usize),
    },
    /// A start mesh is larger than the mesh asked for.
    #[error("{value} free vertices are fewer than the {low} of the start mesh, want {low} or more")]
    TooFewVertices {
        /// The number asked for.
        value: usize,
        /// Free vertices of the start mesh.
        low: usize,
    },
    /// A matrix that a fresh factorisation refuses.
    #[error(
        "`{method}` can't factor the stiffness of {rows} rows: it is not positive definite to \
         working precision, want a body that is held"
    )]
    NotFactored {
        /// The direct method.
        method: &'static str,
        /// Rows of K.
        rows: usize,
    },
    /// A reference solution that refinement does not settle.
    #[error(
        "the reference solution of {rows} rows changes by {change:e} when refined, want {limit:e}"
    )]
    Unsettled {
        /// Rows of K.
        rows: usize,
        /// Relative size of the last correction.
        change: f64,
        /// The limit.
        limit: f64,
    },
    /// A measured quantity is not a number.
    #[error("{what} is {value}, want a finite number")]
    NotFinite {
        /// Which quantity, of which row.
        what: String,
        /// The value.
        value: f64,
    },
    /// The output directory holds something.
    #[error("{} is not empty; name another directory or give --force", path.display())]
    NotEmpty {
        /// The directory.
        path: PathBuf,
    },
    /// The output path is there and no directory.
    #[error("{} is not a directory; name a directory for --out", path.display())]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// The system refused to read or write.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}
