//! A run directory, opened and checked.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde_json::Value;

use super::description::Description;
use super::frame::{FrameFiles, list};
use super::tool_place::ToolPlace;
use super::wrong;
use crate::SimError;
use crate::output::read_steps;
use crate::report::{Frame, StepReport, SurfaceFrame};

/// The version of `summary.json` that is understood.
const SCHEMA: u64 = 1;

/// A run that has finished, as its directory has it.
///
/// Every file of it has been read once: frames belong to one body, and the steps are whole.
pub struct Run {
    folder: PathBuf,
    description: Description,
    summary: Value,
    steps: Vec<StepReport>,
    frames: Vec<FrameFiles>,
    labels: Vec<i64>,
    displacement_max_mm: f64,
    box_mm: [Vector3<f64>; 2],
    /// Whether the triangles of every surface are those of the first frame.
    has_one_surface: bool,
    warnings: Vec<String>,
}

/// The box of nothing.
const NOTHING: [Vector3<f64>; 2] = [
    Vector3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    Vector3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
];

impl Run {
    /// Opens a run directory, as `yawara run` writes it. Cost: reads all of it.
    ///
    /// # Errors
    /// [`SimError::Io`], [`SimError::Syntax`] or [`SimError::TetMesh`] naming the file that is missing,
    /// damaged, or of another run than the rest.
    pub fn open(folder: &Path) -> Result<Self, SimError> {
        for name in ["summary.json", "scene.toml", "steps.csv", "frames.pvd"] {
            let path = folder.join(name);
            if !path.is_file() {
                let reason = "there is no such file; want the directory of a run that has finished";
                return Err(wrong(&path, reason));
            }
        }
        let summary = summary(&folder.join("summary.json"))?;
        let description = Description::read(&folder.join("scene.toml"))?;
        let kinds: Vec<&'static str> = description.tools.iter().map(|tool| tool.kind()).collect();
        let steps = read_steps(&folder.join("steps.csv"), &kinds)?;
        if summary["steps"]["count"].as_u64() != Some(steps.len() as u64) {
            let said = &summary["steps"]["count"];
            let reason = format!("has {} steps, summary.json says {said}", steps.len());
            return Err(wrong(&folder.join("steps.csv"), &reason));
        }
        let frames = list(folder)?;
        let mut run = Self {
            folder: folder.into(),
            description,
            summary,
            steps,
            frames,
            labels: Vec::new(),
            has_one_surface: true,
            displacement_max_mm: 0.0,
            box_mm: NOTHING,
            warnings: Vec::new(),
        };
        run.look_through()?;
        Ok(run)
    }

    /// Reads every frame once.
    fn look_through(&mut self) -> Result<(), SimError> {
        let first = self.frame(0)?;
        self.labels = surfaces(&first).map(|surface| surface.label).collect();
        for (number, files) in self.frames.iter().enumerate() {
            let frame = files.read()?;
            if files.step > self.steps.len() {
                let reason = format!("lists step {}, there are {}", files.step, self.steps.len());
                return Err(wrong(&self.folder.join("frames.pvd"), &reason));
            }
            if surfaces(&frame).count() != self.labels.len() {
                let reason = format!("lists other surfaces in frame {number} than in the first");
                return Err(wrong(&self.folder.join("frames.pvd"), &reason));
            }
            for (at, (surface, rest)) in surfaces(&frame).zip(surfaces(&first)).enumerate() {
                if surface.label != rest.label {
                    let reason = "is of another surface than the first frame";
                    return Err(wrong(files.surface(at), reason));
                }
                self.has_one_surface &= surface.triangles == rest.triangles
                    && surface.points_mm.len() == rest.points_mm.len();
                let moved = surface.displacement_mm.iter().map(|u| u.amax());
                self.displacement_max_mm = moved.fold(self.displacement_max_mm, f64::max);
            }
            self.box_mm = shown(&frame).fold(self.box_mm, |ends, (x, _)| with(ends, x));
        }
        let at_rest = shown(&first).fold(NOTHING, |ends, (x, u)| with(ends, x - u));
        for (i, tool) in self.description.tools.iter().enumerate() {
            let key = format!("tools[{i}]");
            match ToolPlace::of(tool, &key, at_rest) {
                Ok(Some(place)) => {
                    for step in &mut self.steps {
                        if let Some(tool) = step.tools.get_mut(i) {
                            tool.reference_mm = place.at(step.time_s);
                        }
                    }
                }
                Ok(None) => {}
                Err(error) => self.warnings.push(format!("{key} has no arrow: {error}")),
            }
        }
        Ok(())
    }

    /// The directory.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The scene's name.
    pub fn scene(&self) -> &str {
        &self.description.name
    }

    /// What the scene says of itself.
    pub fn description(&self) -> &str {
        &self.description.description
    }

    /// Length of a step, s.
    pub fn step_s(&self) -> f64 {
        self.description.time.step_s
    }

    /// `summary.json`.
    pub fn summary(&self) -> &Value {
        &self.summary
    }

    /// What is odd about the run, or about what it kept.
    pub fn warnings(&self) -> Vec<String> {
        let of_run = self.summary["warnings"].as_array().into_iter().flatten();
        let of_run = of_run.filter_map(Value::as_str).map(str::to_owned);
        of_run.chain(self.warnings.iter().cloned()).collect()
    }

    /// All steps. Where a tool was is NaN if the run does not say; it is as near as a voxel for a place in
    /// fractions of the body's box.
    pub fn steps(&self) -> &[StepReport] {
        &self.steps
    }

    /// How many frames were written.
    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// The step after which a frame was written, 0 for the start, and when that was, s.
    pub fn moment(&self, frame: usize) -> (usize, f64) {
        (self.frames[frame].step, self.frames[frame].time_s)
    }

    /// A frame as it was written, without what is void. Cost: O(its files).
    ///
    /// # Errors
    /// As [`Self::open`], if the file has changed since.
    pub fn frame(&self, number: usize) -> Result<Frame, SimError> {
        self.frames[number].read()
    }

    /// The step of a frame; of the start the counts of its mesh.
    pub fn report(&self, number: usize, frame: &Frame) -> StepReport {
        let step = self.frames[number].step;
        let (vertices, tets) = (frame.points_mm.len(), frame.tets.len());
        let start = || StepReport { vertices, tets, converged: true, ..StepReport::default() };
        step.checked_sub(1).map_or_else(start, |at| self.steps[at].clone())
    }

    /// The labels of the surfaces of a frame: 0 of the body's outline, which comes first.
    pub fn labels(&self) -> &[i64] {
        &self.labels
    }

    /// Whether the triangles of every surface are the same in all frames: nothing was cut, no label changed.
    pub fn has_one_surface(&self) -> bool {
        self.has_one_surface
    }

    /// The name of a label's material, empty if it has none.
    pub fn name_of(&self, label: i64) -> &str {
        let found = self.description.materials.iter().find(|one| one.label == Some(label));
        found.map_or("", |one| &one.name[..])
    }

    /// The box of all that any frame shows, scanner RAS, mm.
    pub fn box_mm(&self) -> [Vector3<f64>; 2] {
        self.box_mm
    }

    /// The largest component of a displacement of any surface, mm.
    pub fn displacement_max_mm(&self) -> f64 {
        self.displacement_max_mm
    }
}

/// The surfaces of a frame, the outline of the body first.
pub(crate) fn surfaces(frame: &Frame) -> impl Iterator<Item = &SurfaceFrame> {
    frame.outline.iter().chain(&frame.surfaces)
}

/// What is seen of a frame, its surfaces or else its tetrahedra: points and displacements, mm.
fn shown<'a>(frame: &'a Frame) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + 'a {
    let has_surfaces = surfaces(frame).next().is_some();
    let of_surface = |one: &'a SurfaceFrame| {
        one.points_mm.iter().zip(&one.displacement_mm).map(|(x, u)| (*x, *u))
    };
    let tets = frame.points_mm.iter().zip(&frame.displacement_mm);
    let tets = tets.filter(move |_| !has_surfaces).map(|(x, u)| ((*x).into(), (*u).into()));
    surfaces(frame).flat_map(of_surface).chain(tets)
}

fn with([low, high]: [Vector3<f64>; 2], x: Vector3<f64>) -> [Vector3<f64>; 2] {
    [low.inf(&x), high.sup(&x)]
}

fn summary(path: &Path) -> Result<Value, SimError> {
    let text = std::fs::read_to_string(path).map_err(|source| SimError::Io(path.into(), source))?;
    let summary: Value =
        serde_json::from_str(&text).map_err(|error| wrong(path, &error.to_string()))?;
    match summary["schema"].as_u64() {
        Some(SCHEMA) => Ok(summary),
        _ => Err(wrong(path, &format!("schema is {}, want {SCHEMA}", summary["schema"]))),
    }
}
