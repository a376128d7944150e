//! A run that was interrupted, found again and cut back to its last checkpoint.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use yawara_mesh::atomic_file::PARTIAL;

use super::checkpoint::{self, Written};
use super::fields;
use super::partial;
use super::resume_error::ResumeError;
use super::run_directory::{FRAMES, RunDirectory, SCENE, STEPS, SUMMARY, at, is_frame};
use crate::error::SimError;
use crate::scene::{Scene, file};
use crate::step::Checkpoint;

/// A run that was interrupted, to be gone on with: what has been written, the scene, and where the
/// simulation was.
pub struct Interrupted {
    /// The output up to the checkpoint.
    pub directory: RunDirectory,
    /// The scene that the run began with.
    pub scene: Scene,
    /// For [`Simulation::resume`](crate::Simulation::resume).
    pub checkpoint: Checkpoint,
}

impl Interrupted {
    /// Takes over the run of the directory `path`, or of the partial directory `path` itself: gives it this process's
    /// number, and takes away what was written after its last checkpoint.
    ///
    /// On a processor of another class than that of the run, of which last digits depend, it warns.
    ///
    /// Cost: reads all files that the scene names, to see that they are what they were.
    /// # Errors
    /// [`SimError::Resume`], those of [`scene_file::load`](file::load), [`SimError::Io`]; all is as it was then,
    /// unless the system failed while it was cut back.
    pub fn take(path: &Path) -> Result<Self, SimError> {
        let left = find(path)?;
        let steps = left.join(STEPS);
        if is_being_written(&left, &steps)? {
            return Err(ResumeError::BeingWritten(left).into());
        }
        let (origin, written, checkpoint) = checkpoint::read(&left)?;
        let scene_file = left.join(SCENE);
        origin.check(&scene_file)?;
        let (scene, _) = file::load(&scene_file.to_string_lossy(), &[])?;
        let length = fs::metadata(&steps).map_err(at(&steps))?.len();
        if length < written.steps_bytes {
            return Err(
                ResumeError::Damaged(steps, "rows before the checkpoint are missing").into()
            );
        }
        let files = || files(&written).map(|file| left.join(file));
        if let Some(missing) = files().find(|file| !file.is_file()) {
            return Err(
                ResumeError::Damaged(missing, "it was written before the checkpoint").into()
            );
        }
        let target = match left.parent() {
            Some(parent) if written.is_inside => parent.to_path_buf(),
            _ => left.with_file_name(&written.name),
        };
        if !written.is_inside && target.exists() {
            return Err(ResumeError::InTheWay(target).into());
        }
        if !origin.is_of_this_machine() {
            let unit = &origin.vector_unit;
            tracing::warn!("the run began on a processor of class {unit}: last digits will differ");
        }
        // Whoever renames it has it.
        let aside = left.with_file_name(partial::name(&written.name.to_string_lossy()));
        fs::rename(&left, &aside).map_err(at(&left))?;
        let steps = cut_back(&aside, &written)?;
        let directory = RunDirectory::resumed(target, aside, steps, origin, written)?;
        Ok(Self { directory, scene, checkpoint })
    }
}

/// The partial directory of the run at `path`.
fn find(path: &Path) -> Result<PathBuf, SimError> {
    let whole = match path.file_name() {
        Some(_) => path.to_path_buf(),
        None => path.canonicalize().map_err(at(path))?,
    };
    let name = whole.file_name().unwrap_or_default().to_string_lossy();
    let beside = match whole.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if partial::process(&name).is_some() {
        let is_there = whole.is_dir();
        let here = beside.join(name.as_ref());
        return if is_there { Ok(here) } else { Err(ResumeError::Nothing(path.into()).into()) };
    }
    let mut found = Vec::new();
    for folder in [&whole, beside] {
        let entries = match fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(error)
                if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()) =>
            {
                continue;
            }
            Err(source) => return Err(SimError::Io(folder.into(), source)),
        };
        for entry in entries {
            let entry = entry.map_err(at(folder))?;
            if partial::is_of(&entry.file_name().to_string_lossy(), &name) {
                found.push(entry.path());
            }
        }
    }
    found.sort();
    match found.len() {
        0 if whole.join(SUMMARY).exists() => Err(ResumeError::Complete(path.into()).into()),
        0 => Err(ResumeError::Nothing(path.into()).into()),
        1 => Ok(found.remove(0)),
        _ => Err(ResumeError::Several(path.into(), found).into()),
    }
}

/// Whether a process has the table of steps locked, or is there where files can't be locked.
fn is_being_written(left: &Path, steps: &Path) -> Result<bool, SimError> {
    match File::open(steps).map_err(at(steps))?.try_lock() {
        Ok(()) => Ok(false),
        Err(TryLockError::WouldBlock) => Ok(true),
        Err(TryLockError::Error(_)) => {
            Ok(partial::is_alive(&left.file_name().unwrap_or_default().to_string_lossy()))
        }
    }
}

/// All files of frames.
fn files(written: &Written) -> impl Iterator<Item = &String> {
    let Written { frames, outlines, others, .. } = written;
    frames.iter().chain(outlines).flat_map(|(_, files)| files).chain(others)
}

/// Takes away what was written later than the checkpoint, and whatever was half written; the table of steps, to be
/// gone on with.
fn cut_back(aside: &Path, written: &Written) -> Result<BufWriter<File>, SimError> {
    let frames = aside.join(FRAMES);
    let kept: Vec<PathBuf> = files(written).map(|file| aside.join(file)).collect();
    for folder in [aside, &frames] {
        for entry in fs::read_dir(folder).map_err(at(folder))? {
            let path = entry.map_err(at(folder))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let is_half = name.starts_with('.') && name.ends_with(PARTIAL);
            let is_later = folder == frames && is_frame(&path) && !kept.contains(&path);
            if path.is_file() && (is_half || is_later || name == SUMMARY) {
                fs::remove_file(&path).map_err(at(&path))?;
            }
        }
    }
    let fields = aside.join(fields::FOLDER);
    if fields.is_dir() {
        fs::remove_dir_all(&fields).map_err(at(&fields))?;
    }
    let path = aside.join(STEPS);
    let mut steps = OpenOptions::new().read(true).write(true).open(&path).map_err(at(&path))?;
    steps.set_len(written.steps_bytes).map_err(at(&path))?;
    steps.seek(SeekFrom::End(0)).map_err(at(&path))?;
    Ok(BufWriter::new(steps))
}
