//! Why a run can't be gone on with.

use std::path::PathBuf;

/// Why a run that was interrupted was not gone on with. All is as it was then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResumeError {
    /// No interrupted run of that name.
    #[error(
        "{path}: no interrupted run is there, want the folder of a run that left .NAME.PID.partial in it or \
         beside it, or that folder itself", path = .0.display()
    )]
    Nothing(PathBuf),
    /// A run that has ended.
    #[error("{path}: the run is complete, nothing of it is left to be done", path = .0.display())]
    Complete(PathBuf),
    /// Several interrupted runs of the same name.
    #[error("{path}: several interrupted runs have this name, give one of {}", in_words(.1), path = .0.display())]
    Several(PathBuf, Vec<PathBuf>),
    /// The process that writes it is there.
    #[error("{path}: the run is still being written; end its process first", path = .0.display())]
    BeingWritten(PathBuf),
    /// A run without checkpoint.
    #[error(
        "{path}: the run has no checkpoint yet, begin it anew (output.checkpoint_steps in its scene asks for \
         checkpoints)", path = .0.display()
    )]
    NoCheckpoint(PathBuf),
    /// A file that is not what was written.
    #[error("{path}: damaged, {1}; begin the run anew", path = .0.display())]
    Damaged(PathBuf, &'static str),
    /// A checkpoint of another version: the file, the version that it has and that of this program.
    #[error("{path}: by yawara {1}, want {2}, this program's version", path = .0.display())]
    OtherVersion(PathBuf, String, String),
    /// The scene is not the one that the run began with.
    #[error(
        "{path}: the scene was edited since the checkpoint; undo that, or begin a run of the new scene",
        path = .0.display()
    )]
    SceneChanged(PathBuf),
    /// A file that the scene names is not what it was.
    #[error("{path}, which the scene names, has changed since the run began", path = .0.display())]
    InputChanged(PathBuf),
    /// A file that the scene names can't be read: the file, why, and where the run began.
    #[error(
        "{path}, which the scene names, can't be read ({1}); the run began in {from}",
        path = .0.display(), from = .2.display()
    )]
    InputGone(PathBuf, #[source] std::io::Error, PathBuf),
    /// Something stands where the run is to end.
    #[error("{path}: stands where the run is to end; move it away", path = .0.display())]
    InTheWay(PathBuf),
}

fn in_words(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
