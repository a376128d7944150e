//! What can go wrong while a bench is set up or a study is written.

use std::path::{Path, PathBuf};

use thiserror::Error;
use yawara::SimError;
use yawara_corot::CorotError;
use yawara_embed::EmbedError;
use yawara_inverse_update::InverseError;
use yawara_mesh::{BisectionError, ImageError};

/// What the benches and studies return.
pub type Result<T, E = BenchError> = std::result::Result<T, E>;

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
    /// The inverse stage refused.
    #[error(transparent)]
    Inverse(#[from] InverseError),
    /// The device refused.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] yawara_gpu::GpuError),
    /// PETSc refused.
    #[cfg(feature = "petsc")]
    #[error(transparent)]
    Petsc(#[from] yawara_petsc::PetscError),
    /// The simulation refused.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A combination of stages that can't be read.
    #[error(
        "--combination {0:?}: want \"NAME: KEY=VALUE, KEY=VALUE\", e.g. \"row only: \
         stages.corotation=row\""
    )]
    Combination(String),
    /// Two cases of one name.
    #[error("two cases are named {0:?}, want every name once")]
    SameName(String),
    /// A case took longer than so many seconds: in which step (0 before the first) of how many.
    #[error("stopped after {0} s in step {1} of {2}: a case has no more time")]
    TimeIsUp(f64, usize, usize),
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
    /// A kept file that can't be read, and why.
    #[error("{path}: {1}; remove it to have it made again", path = .0.display())]
    Damaged(PathBuf, String),
    /// A file or folder that is no result of a study, and why.
    #[error("{path}: {1}; want a study's JSON file with a list `rows`", path = .0.display())]
    NoResult(PathBuf, String),
    /// A recording, which line of it, and what is wrong there.
    #[error("{0}, line {1}: {2}")]
    Recording(String, usize, String),
    /// A recording or a simulation that does not swing.
    #[error(
        "{0}: fewer than three swings between the release and rest, want a beam that is let go and swings"
    )]
    NoSwing(String),
    /// A weight that none of these beams carries.
    #[error("--load-n is {0}, want more than 0 and at most 10 N")]
    Load(f64),
    /// A tolerance that is none.
    #[error("--tolerance is {0}, want a fraction that is finite and at least 0, e.g. 0.05")]
    Tolerance(f64),
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
    /// A part that this program was built without.
    #[error("{0} needs the feature `{1}`: build with --features {1}")]
    FeatureMissing(&'static str, &'static str),
    /// So many processes of a program that can't share a study.
    #[error(
        "mpirun has started {0} processes, and this program can't share a study among them: build \
         with --features mpi, or use --shard I/N, each part without mpirun"
    )]
    NoMpi(usize),
    /// So many processes of a study that runs in one.
    #[error(
        "mpirun has started {0} processes, and this runs in one: call it without mpirun \
         (`pareto`, `stiff`, `extremes` and `ablation` share their cases)"
    )]
    OneProcess(usize),
    /// So many processes of one reference.
    #[error(
        "mpirun has started {0} processes, and a reference of --reference petsc is made in one: call the study \
         without mpirun, in parts by --shard where it has some"
    )]
    OneReference(usize),
    /// A launcher of another MPI than the program's: how many processes each of them sees.
    #[error(
        "the launcher has started {0} processes, MPI finds {1}: start them by the mpirun of the \
         MPI that this program was built with"
    )]
    OtherMpi(usize, usize),
    /// MPI can't be started, or a second time.
    #[error("MPI is over: the processes of one mpirun share one study, start it again for another")]
    MpiOver,
    /// Processes that do different things.
    #[error("the processes of mpirun are out of step: give all of them the same arguments")]
    OutOfStep,
    /// A maintainer put a vertex into another slot than the last one, which the contract says.
    #[error("`{0}` put the new vertex into slot {1}, want {2}")]
    WrongSlot(&'static str, usize, usize),
    /// No split and no merge is possible among so many vertices.
    #[error(
        "no ring left to split or merge among {0} vertices, want a deeper max_level or a larger \
         body"
    )]
    NoRing(usize),
    /// An option with another value than it takes.
    #[error("{0} is {1}, want {2}")]
    Option(&'static str, String, &'static str),
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
    /// A start mesh has more free vertices than the mesh that is asked for.
    #[error("{0} free vertices are fewer than the {1} of the start mesh, want {1} or more")]
    TooFewVertices(usize, usize),
    /// A direct method refuses a matrix of so many rows.
    #[error(
        "`{0}` can't factor the stiffness of {1} rows: it is not positive definite to working \
         precision, want a body that is held"
    )]
    NotFactored(&'static str, usize),
    /// Refinement does not settle a reference solution: rows of K, the last correction's relative
    /// size, and the limit of that.
    #[error("the reference solution of {0} rows changes by {1:e} when refined, want {2:e}")]
    Unsettled(usize, f64, f64),
    /// A measured quantity, of which row, is not a number.
    #[error("{0} is {1}, want a finite number")]
    NotFinite(String, f64),
    /// The output directory holds something.
    #[error("{} is not empty; name another directory or give --force", .0.display())]
    NotEmpty(PathBuf),
    /// The output path is there and no directory.
    #[error("{} is not a directory; name a directory for --out", .0.display())]
    NotADirectory(PathBuf),
    /// A file or directory that the system refuses to read or write, or a library to make.
    #[error("{path}: {1}", path = .0.display())]
    Io(PathBuf, #[source] std::io::Error),
}

impl BenchError {
    /// Says at which file or directory the system's error came up.
    pub(crate) fn at(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |error| Self::Io(path, error)
    }
}
