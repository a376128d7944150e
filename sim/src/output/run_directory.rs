//! The directory of one run, filled aside and moved into place when it is whole.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use yawara_mesh::isosurface::{SurfaceData, write_vtp};

use super::checkpoint::{self, Origin, Written};
use super::partial;
use super::resolved::resolved;
use crate::SimError;
#[cfg(feature = "gmsh")]
use crate::output::write_msh;
use crate::output::{fields, steps_csv, write_file, write_json, write_vtu};
use crate::report::{Fields, Frame, PlanRow, StepReport, Summary, SurfaceFrame};
use crate::scene::Scene;
use crate::step::Checkpoint;

pub(super) const SCENE: &str = "scene.toml";
pub(super) const STEPS: &str = "steps.csv";
const COLLECTION: &str = "frames.pvd";
const OUTLINES: &str = "outline.pvd";
pub(super) const SUMMARY: &str = "summary.json";
pub(super) const FRAMES: &str = "frames";

/// A run's output in the making: `scene.toml`, `steps.csv`, `frames.pvd`,
/// `frames/step_000000.vtu`…, `outline.pvd` with `frames/step_000000_outline.vtp`… and
/// `summary.json`.
///
/// Until [`finish`](Self::finish) everything lies in a hidden directory aside; dropped before
/// that, it removes all it made, unless it has a [checkpoint](Self::write_checkpoint). After each frame that
/// directory is whole up to there: what a process leaves that is killed opens in ParaView, and with a checkpoint is
/// an [`Interrupted`](super::Interrupted) run.
#[derive(Debug)]
pub struct RunDirectory {
    target: PathBuf,
    aside: PathBuf,
    steps: BufWriter<File>,
    has_header: bool,
    /// Times and files of the frames; files that no collection lists.
    frames: Vec<(f64, Vec<String>)>,
    outlines: Vec<(f64, Vec<String>)>,
    others: Vec<String>,
    /// What checkpoints are of; none in a run without.
    origin: Option<Origin>,
    made: Made,
}

impl RunDirectory {
    /// Begins a run directory at `target`, which must be new or empty unless `force` is set.
    /// With `force` the files of an earlier run there are replaced at the end and foreign files
    /// stay. Missing parents are made.
    /// # Errors
    /// [`SimError::NotEmpty`], [`SimError::NotADirectory`], [`SimError::Io`] if it can't be
    /// written there. Then nothing is left behind.
    pub fn create(target: &Path, force: bool) -> Result<Self, SimError> {
        let exists = inspect(target, force)?;
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let partial = partial::name(&name);
        // Inside a directory that exists (it may be a mount point), beside one that does not.
        let aside = if exists { target.join(partial) } else { target.with_file_name(partial) };
        let made = Made::new(&aside)?;
        if !exists {
            // A name that the system does not take is refused before the work, not after it.
            fs::create_dir(target).and_then(|()| fs::remove_dir(target)).map_err(at(target))?;
        }
        let path = aside.join(FRAMES);
        fs::create_dir(&path).map_err(at(&path))?;
        let path = aside.join(STEPS);
        let steps = File::create(&path).map_err(at(&path))?;
        lock(&steps);
        Ok(Self {
            target: target.into(),
            aside,
            steps: BufWriter::new(steps),
            has_header: false,
            frames: Vec::new(),
            outlines: Vec::new(),
            others: Vec::new(),
            origin: None,
            made,
        })
    }

    /// Goes on with one that was cut back to a checkpoint: `aside` has what was `written`, `steps` is its table.
    /// # Errors
    /// [`SimError::Io`].
    pub(super) fn resumed(
        target: PathBuf,
        aside: PathBuf,
        steps: BufWriter<File>,
        origin: Origin,
        written: Written,
    ) -> Result<Self, SimError> {
        lock(steps.get_ref());
        let Written { steps_bytes, frames, outlines, others, .. } = written;
        let (has_header, origin, made) = (steps_bytes > 0, Some(origin), Made(Vec::new()));
        let mut directory =
            Self { target, aside, steps, has_header, frames, outlines, others, origin, made };
        directory.write_lists()?;
        Ok(directory)
    }

    /// Writes the scene with all defaults and overrides filled in, and the names of stages that are
    /// not built in as its run's `plan` has them: such a scene is refused where they are missing. Reads all files
    /// that the scene names if it asks for checkpoints.
    /// # Errors
    /// [`SimError::Io`].
    pub fn write_scene(&mut self, scene: &Scene, plan: &[PlanRow]) -> Result<(), SimError> {
        let path = self.aside.join(SCENE);
        let text = toml::to_string(&resolved(scene, plan))
            .map_err(|error| at(&path)(io::Error::other(error)))?;
        if scene.output.checkpoint_steps > 0 {
            self.origin = Some(Origin::of(scene, &text)?);
        }
        write_file(&path, text)
    }

    /// Writes `checkpoint`, of the simulation whose steps and frames have been written, in the place of the one
    /// before. From then on the partial directory stays if the run ends before [`finish`](Self::finish).
    /// # Errors
    /// [`SimError::Value`] before [`write_scene`](Self::write_scene), or if that scene asked for no checkpoints;
    /// [`SimError::Io`]. The checkpoint before is there then.
    pub fn write_checkpoint(&mut self, checkpoint: &Checkpoint) -> Result<(), SimError> {
        self.write_lists()?;
        let path = self.aside.join(STEPS);
        let steps = self.steps.get_ref();
        steps.sync_data().map_err(at(&path))?;
        let written = Written {
            name: self.target.file_name().unwrap_or_default().into(),
            is_inside: self.aside.parent() == Some(&self.target),
            steps_bytes: steps.metadata().map_err(at(&path))?.len(),
            frames: self.frames.clone(),
            outlines: self.outlines.clone(),
            others: self.others.clone(),
        };
        let Some(origin) = &self.origin else {
            let (place, want) = (self.aside.join(SCENE), "at least 1 for a checkpoint");
            let place = place.to_string_lossy();
            return Err(SimError::value(&place, "output.checkpoint_steps", 0, want));
        };
        checkpoint::write(&self.aside, origin, &written, checkpoint)?;
        self.made.0.clear();
        Ok(())
    }

    /// The partial directory, if a checkpoint is in it.
    pub fn resumable(&self) -> Option<&Path> {
        self.aside.join(checkpoint::FILE).exists().then_some(&self.aside)
    }

    /// Appends a row to `steps.csv`, below a line of names if it is the first.
    /// # Errors
    /// [`SimError::Io`].
    pub fn write_step(&mut self, step: &StepReport) -> Result<(), SimError> {
        self.write_header(step)?;
        let line = steps_csv::line(step);
        self.steps.write_all(line.as_bytes()).map_err(at(&self.target.join(STEPS)))
    }

    fn write_header(&mut self, step: &StepReport) -> Result<(), SimError> {
        if std::mem::replace(&mut self.has_header, true) {
            return Ok(());
        }
        let header = steps_csv::header(step);
        self.steps.write_all(header.as_bytes()).map_err(at(&self.target.join(STEPS)))
    }

    /// Writes the frame after step number `step` (0 for the start): tetrahedra and one file per
    /// surface, listed in `frames.pvd`, the body's outline, listed in `outline.pvd`.
    /// # Errors
    /// As [`write_vtu`]; [`SimError::Surface`] for a surface.
    pub fn write_frame(&mut self, frame: &Frame, step: usize) -> Result<(), SimError> {
        let mut files = vec![format!("{FRAMES}/step_{step:06}.vtu")];
        write_vtu(&self.aside.join(&files[0]), frame)?;
        for surface in &frame.surfaces {
            let file = format!("{FRAMES}/step_{step:06}_label_{}.vtp", surface.label);
            self.write_surface(
                &file,
                surface,
                Some(&vec![surface.label; surface.points_mm.len()]),
            )?;
            files.push(file);
        }
        self.frames.push((frame.time_s, files));
        if let Some(outline) = &frame.outline {
            let file = format!("{FRAMES}/step_{step:06}_outline.vtp");
            self.write_surface(&file, outline, None)?;
            self.outlines.push((frame.time_s, vec![file]));
        }
        self.write_lists()
    }

    fn write_surface(
        &self,
        file: &str,
        surface: &SurfaceFrame,
        label: Option<&[i64]>,
    ) -> Result<(), SimError> {
        let data = SurfaceData {
            points_mm: &surface.points_mm,
            triangles: &surface.triangles,
            displacement_mm: Some(&surface.displacement_mm),
            label,
        };
        Ok(write_vtp(&self.aside.join(file), &data)?)
    }

    /// Completes the table of steps and the lists of frames as far as they go.
    fn write_lists(&mut self) -> Result<(), SimError> {
        self.steps.flush().map_err(at(&self.aside.join(STEPS)))?;
        write_file(&self.aside.join(COLLECTION), collection(&self.frames))?;
        if !self.outlines.is_empty() {
            write_file(&self.aside.join(OUTLINES), collection(&self.outlines))?;
        }
        Ok(())
    }

    /// Writes the frame after step number `step` as a Gmsh mesh, labels as groups.
    /// # Errors
    /// As [`write_msh`].
    #[cfg(feature = "gmsh")]
    pub fn write_msh(&mut self, frame: &Frame, step: usize) -> Result<(), SimError> {
        let file = format!("{FRAMES}/step_{step:06}.msh");
        write_msh(&self.aside.join(&file), frame)?;
        self.others.push(file);
        Ok(())
    }

    /// Writes the fields on the image's grid: `fields/displacement_mm.nii.gz`,
    /// `fields/von_mises_pa.nii.gz` and `fields/label.nii.gz`.
    /// # Errors
    /// [`SimError::Io`]; [`SimError::Image`], which names the file; [`SimError::FeatureMissing`] in
    /// a build without NIfTI.
    pub fn write_fields(&mut self, fields: &Fields) -> Result<(), SimError> {
        fields::write(&self.aside, fields)
    }

    /// Writes `summary.json`.
    /// # Errors
    /// [`SimError::Io`].
    pub fn write_summary(&mut self, summary: &Summary) -> Result<(), SimError> {
        write_json(&self.aside.join(SUMMARY), summary)
    }

    /// Completes the files and moves them to where they belong, `summary.json` last. Returns
    /// that directory.
    /// # Errors
    /// [`SimError::Io`]; [`SimError::NotEmpty`] if the directory came into being meanwhile.
    pub fn finish(mut self) -> Result<PathBuf, SimError> {
        self.write_header(&StepReport::default())?;
        self.write_lists()?;
        if self.aside.parent() == Some(&self.target) {
            self.move_files()?;
            fs::remove_dir(&self.aside).map_err(at(&self.aside))?;
        } else if inspect(&self.target, false)? {
            return Err(SimError::NotEmpty(self.target.clone()));
        } else {
            remove_if_there(&self.aside.join(checkpoint::FILE))?;
            fs::rename(&self.aside, &self.target).map_err(at(&self.target))?;
        }
        self.made.0.clear();
        Ok(self.target.clone())
    }

    /// Replaces the files of an earlier run in an existing directory.
    fn move_files(&self) -> Result<(), SimError> {
        // Removed first: a mixture of two runs without a summary is not mistaken for a finished run.
        for name in [SUMMARY, COLLECTION, OUTLINES, STEPS, SCENE].into_iter().chain(fields::FILES) {
            remove_if_there(&self.target.join(name))?;
        }
        let frames = self.target.join(FRAMES);
        if frames.is_dir() {
            for entry in fs::read_dir(&frames).map_err(at(&frames))? {
                let path = entry.map_err(at(&frames))?.path();
                if is_frame(&path) {
                    remove_if_there(&path)?;
                }
            }
        } else {
            fs::create_dir(&frames).map_err(at(&frames))?;
        }
        let folder = self.target.join(fields::FOLDER);
        if self.aside.join(fields::FOLDER).is_dir() {
            fs::create_dir_all(&folder).map_err(at(&folder))?;
        } else {
            // Of an earlier run; it stays if foreign files lie in it.
            let _ = fs::remove_dir(&folder);
        }
        let others = fields::FILES.into_iter().chain([STEPS, SCENE, COLLECTION, OUTLINES, SUMMARY]);
        let others = others.map(str::to_owned);
        let frames = self.frames.iter().chain(&self.outlines).flat_map(|(_, files)| files);
        let frames = frames.chain(&self.others);
        for name in frames.cloned().chain(others) {
            let (from, to) = (self.aside.join(&name), self.target.join(&name));
            if from.exists() {
                fs::rename(&from, &to).map_err(at(&to))?;
            }
        }
        remove_if_there(&self.aside.join(checkpoint::FILE))?;
        for left in [FRAMES, fields::FOLDER].map(|folder| self.aside.join(folder)) {
            if left.is_dir() {
                fs::remove_dir(&left).map_err(at(&left))?;
            }
        }
        Ok(())
    }
}

/// Directories made so far, each after the one it lies in. Dropped, it removes the last with all
/// that is in it, and the others if nothing is.
#[derive(Debug)]
struct Made(Vec<PathBuf>);

impl Made {
    /// Makes a directory and its missing ancestors.
    fn new(path: &Path) -> Result<Self, SimError> {
        let is_missing = |parent: &&Path| !parent.as_os_str().is_empty() && !parent.exists();
        let missing = path.ancestors().skip(1).take_while(is_missing).count();
        let directories: Vec<&Path> = path.ancestors().take(missing + 1).collect();
        let mut made = Self(Vec::new());
        for directory in directories.into_iter().rev() {
            fs::create_dir(directory).map_err(at(directory))?;
            made.0.push(directory.into());
        }
        Ok(made)
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        // A destructor can't report an error; the first one has been reported already.
        if let Some(last) = self.0.pop() {
            let _ = fs::remove_dir_all(last);
        }
        for parent in self.0.iter().rev() {
            let _ = fs::remove_dir(parent);
        }
    }
}

/// Says, as long as this process is there, that it writes this file. Where the system locks no files, the process's
/// number says it.
fn lock(steps: &File) {
    let _ = steps.try_lock();
}

pub(super) fn at(path: &Path) -> impl FnOnce(io::Error) -> SimError {
    let path = path.to_owned();
    move |source| SimError::Io(path, source)
}

/// Whether the directory exists; refuses what can't become a run directory.
fn inspect(target: &Path, force: bool) -> Result<bool, SimError> {
    match fs::metadata(target) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            if target.file_name().is_none() {
                return Err(SimError::NotADirectory(target.into()));
            }
            Ok(false)
        }
        Err(source) => Err(SimError::Io(target.into(), source)),
        Ok(found) if !found.is_dir() => Err(SimError::NotADirectory(target.into())),
        Ok(_) => {
            let mut entries = fs::read_dir(target).map_err(at(target))?;
            if !force && entries.next().is_some() {
                return Err(SimError::NotEmpty(target.into()));
            }
            Ok(true)
        }
    }
}

fn remove_if_there(path: &Path) -> Result<(), SimError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(at(path)(error)),
        _ => Ok(()),
    }
}

/// True for `step_<digits>.vtu`, `.msh`, `step_<digits>_outline.vtp` and
/// `step_<digits>_label_<number>.vtp`, the names that this module gives.
pub(super) fn is_frame(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let Some((stem, extension)) = name.rsplit_once('.') else { return false };
    let Some(rest) = stem.strip_prefix("step_") else { return false };
    let is_number = |d: &str| d.len() >= 6 && d.bytes().all(|b| b.is_ascii_digit());
    match (extension, rest.split_once("_label_")) {
        ("vtu" | "msh", None) => is_number(rest),
        ("vtp", None) => rest.strip_suffix("_outline").is_some_and(is_number),
        ("vtp", Some((digits, label))) => is_number(digits) && label.parse::<i64>().is_ok(),
        _ => false,
    }
}

/// The text of a ParaView collection of `(time, files)`, files relative to it; the files of one
/// time are its parts 0, 1, … Times in s.
fn collection(frames: &[(f64, Vec<String>)]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n",
    );
    for (time_s, files) in frames {
        for (part, file) in files.iter().enumerate() {
            let attributes = format!("timestep=\"{time_s:?}\" part=\"{part}\" file=\"{file}\"");
            text += &format!("    <DataSet {attributes}/>\n");
        }
    }
    text.push_str("  </Collection>\n</VTKFile>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(time_s: f64) -> Frame {
        Frame {
            time_s,
            points_mm: vec![[0.; 3], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]],
            tets: vec![[0, 1, 2, 3]],
            ..Frame::default()
        }
    }

    fn names(path: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(path)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_left_of_a_run_that_did_not_finish() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("runs/deep/liver");
        let mut run = RunDirectory::create(&target, false).unwrap();
        run.write_frame(&frame(0.0), 0).unwrap();
        assert!(!target.exists(), "only a whole run is at its place");
        drop(run);
        assert!(names(root.path()).is_empty());
    }

    #[test]
    fn a_finished_run_has_its_files_and_no_others() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("runs/liver");
        let mut run = RunDirectory::create(&target, false).unwrap();
        run.write_scene(&crate::scene_file::load("beam", &[]).unwrap().0, &[]).unwrap();
        run.write_frame(&frame(0.0), 0).unwrap();
        run.write_frame(&frame(0.1), 12).unwrap();
        assert_eq!(run.finish().unwrap(), target);
        assert_eq!(names(&root.path().join("runs")), ["liver"]);
        assert_eq!(names(&target), ["frames", "frames.pvd", "scene.toml", "steps.csv"]);
        assert_eq!(names(&target.join("frames")), ["step_000000.vtu", "step_000012.vtu"]);
        let list = fs::read_to_string(target.join("frames.pvd")).unwrap();
        assert!(list.contains("timestep=\"0.1\" part=\"0\" file=\"frames/step_000012.vtu\""));
        let steps = fs::read_to_string(target.join("steps.csv")).unwrap();
        assert!(steps.starts_with("step,time_s,"), "{steps}");
    }

    #[test]
    fn foreign_files_are_refused_or_kept() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path();
        fs::create_dir(target.join("frames")).unwrap();
        let earlier = [
            "step_000099.vtu",
            "step_000099.msh",
            "step_000099_label_-7.vtp",
            "step_000099_outline.vtp",
        ];
        for name in earlier.into_iter().chain(["step_a.vtu"]) {
            fs::write(target.join("frames").join(name), name).unwrap();
        }
        for name in ["notes.txt", "summary.json", "outline.pvd"] {
            fs::write(target.join(name), name).unwrap();
        }
        let error = RunDirectory::create(target, false).unwrap_err();
        assert!(matches!(error, SimError::NotEmpty(_)), "{error}");
        // Given up: all is as it was.
        drop(RunDirectory::create(target, true).unwrap());
        assert_eq!(names(target), ["frames", "notes.txt", "outline.pvd", "summary.json"]);
        let mut run = RunDirectory::create(target, true).unwrap();
        run.write_frame(&frame(0.0), 3).unwrap();
        run.finish().unwrap();
        assert_eq!(names(target), ["frames", "frames.pvd", "notes.txt", "steps.csv"]);
        assert_eq!(names(&target.join("frames")), ["step_000003.vtu", "step_a.vtu"]);
    }

    #[test]
    fn an_empty_directory_is_taken_and_given_back_empty() {
        let root = tempfile::tempdir().unwrap();
        drop(RunDirectory::create(root.path(), false).unwrap());
        assert!(names(root.path()).is_empty());
        let run = RunDirectory::create(root.path(), false).unwrap();
        run.finish().unwrap();
        assert_eq!(names(root.path()), ["frames", "frames.pvd", "steps.csv"]);
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        fs::write(&file, "x").unwrap();
        let error = RunDirectory::create(&file, true).unwrap_err();
        assert!(matches!(error, SimError::NotADirectory(_)), "{error}");
        let error = RunDirectory::create(&file.join("below/run"), true).unwrap_err();
        assert!(error.to_string().contains("file"), "{error}");
        assert_eq!(names(root.path()), ["file"]);
    }

    #[test]
    fn parents_made_for_a_run_that_can_not_begin_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("new/deep").join("n".repeat(250)).join("n".repeat(300));
        let error = RunDirectory::create(&target, false).unwrap_err();
        assert!(matches!(error, SimError::Io(..)), "{error}");
        assert!(names(root.path()).is_empty());
    }

    #[test]
    fn a_name_as_long_as_the_system_takes_is_taken() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("n".repeat(250));
        let run = RunDirectory::create(&target, false).unwrap();
        assert_eq!(run.finish().unwrap(), target);
    }

    #[test]
    fn a_directory_that_appeared_meanwhile_is_not_overwritten() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("run");
        let run = RunDirectory::create(&target, false).unwrap();
        fs::create_dir(&target).unwrap();
        fs::write(target.join("notes.txt"), "x").unwrap();
        assert!(matches!(run.finish().unwrap_err(), SimError::NotEmpty(_)));
        assert_eq!(names(root.path()), ["run"]);
        assert_eq!(names(&target), ["notes.txt"]);
    }
}
