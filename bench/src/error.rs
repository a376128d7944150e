//! What can go wrong while a bench is set up or a study is written.

use std::path::PathBuf;

use thiserror::Error;
use yawara::SimError;
use yawara_corot::CorotError;
use yawara_embed::EmbedError;
use yawara_inverse_update::InverseError;
use yawara_mesh::{BisectionError, ImageError};

/// Everything that the benches and studies refuse.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The forest or its label tree refused.
    #[error(transparent)]
    Bisection(#[from] BisectionError),
    /// The image was refused.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The embedding stage refused.
    #[error(transparent)]
    Embed(#[from] EmbedError),
    /// The co-rotation stage refused.
    #[error(transparent)]
    Corot(#[from] CorotError),
    /// The simulation refused.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A combination of stages that can't be read.
    #[error(
        "--combination {text:?}: want \"NAME: KEY=VALUE, KEY=VALUE\", e.g. \"row only: \
         stages.corotation=row\""
    )]
    Combination {
        /// What was given.
        text: String,
    },
    /// Two cases of one name.
    #[error("two cases are named {name:?}, want every name once")]
    SameName {
        /// The name.
        name: String,
    },
    /// A case that takes too long.
    #[error("stopped after {seconds} s in step {step} of {steps}: a case has no more time")]
    TimeIsUp {
        /// The time that it was allowed.
        seconds: f64,
        /// The step it was in, 0 before the first.
        step: usize,
        /// Steps of the scene.
        steps: usize,
    },
    /// A run whose body has other points than the reference.
    #[error(
        "the body has {got} points at level {level}, the reference {want} or others: they are \
         different bodies (another image, other base cells or other parts held)"
    )]
    OtherPoints {
        /// Points of the run.
        got: usize,
        /// Points of the reference.
        want: usize,
        /// The level of the points.
        level: u8,
    },
    /// A folder of a study with other options.
    #[error(
        "{}: an earlier run had {key} = {old}, this one has {new}; give the same options to go on, \
         another --out, or --force to start anew",
        path.display()
    )]
    OptionsDiffer {
        /// The file of the options.
        path: PathBuf,
        /// The first that differs.
        key: String,
        /// Its value then.
        old: String,
        /// Its value now.
        new: String,
    },
    /// A kept file that can't be read.
    #[error("{}: {reason}; remove it to have it made again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file that is no result of a study.
    #[error("{}: {reason}; want a study's JSON file with a list `rows`", path.display())]
    NoResult {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A tolerance that is none.
    #[error("--tolerance is {value}, want a fraction that is finite and at least 0, e.g. 0.05")]
    Tolerance {
        /// The value.
        value: f64,
    },
    /// A picture that can't be drawn.
    #[error("{}: {reason}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What the drawing library says.
        reason: String,
    },
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
    /// Several processes of a program that can't share a study.
    #[error(
        "mpirun has started {processes} processes, and this program can't share a study among \
         them: build with --features mpi, or use --shard I/N, each part without mpirun"
    )]
    NoMpi {
        /// How many there are.
        processes: usize,
    },
    /// Several processes of a study that runs in one.
    #[error(
        "mpirun has started {processes} processes, and this runs in one: call it without mpirun \
         (`pareto`, `stiff`, `extremes` and `ablation` share their cases)"
    )]
    OneProcess {
        /// How many there are.
        processes: usize,
    },
    /// A launcher of another MPI than the program's.
    #[error(
        "the launcher has started {started} processes, MPI finds {found}: start them by the \
         mpirun of the MPI that this program was built with"
    )]
    OtherMpi {
        /// By the launcher's environment.
        started: usize,
        /// By MPI.
        found: usize,
    },
    /// MPI can't be started, or a second time.
    #[error("MPI is over: the processes of one mpirun share one study, start it again for another")]
    MpiOver,
    /// Processes that do different things.
    #[error("the processes of mpirun are out of step: give all of them the same arguments")]
    OutOfStep,
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
