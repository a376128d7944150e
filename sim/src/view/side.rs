//! A simulation that is shown, with the hands on it; and one that goes beside it, in a thread of its own.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use nalgebra::Vector3;
use serde_json::{Value, json};
use yawara_mesh::BisectionForest;

use super::hand::Hand;
use super::painter::{Outlines, Snapshot};
use super::state::{of_step, warnings};
use super::voxels::{Voxels, scan};
use crate::SimError;
use crate::report::{BodyOutline, StepReport};
use crate::scene::{AblationEntry, GrabEntry, ProbeEntry, ScalpelEntry, Scene, ToolEntry, file};
use crate::step::Simulation;

/// The most tools that hands may take in one simulation.
const MOST_TOOLS: usize = 200;

/// After so many steps in which nothing moved a body without inertia is at rest.
pub(super) const STILL_STEPS: usize = 3;

/// A page, and which of its hands.
pub(super) type HandKey = (u64, u8);

/// Where tools of hands go in a step, from where each took hold, m.
pub(super) type Led = BTreeMap<HandKey, Vector3<f64>>;

/// A simulation that is shown.
pub(super) struct Side {
    pub simulation: Simulation,
    pub report: StepReport,
    pub hands: BTreeMap<HandKey, Hand>,
    /// Of the surfaces, in their order.
    pub labels: Vec<i64>,
    /// For how many steps nothing has moved.
    pub still: usize,
    forest: Option<Arc<BisectionForest>>,
    is_remeshed: bool,
    outlines: Option<Outlines>,
    quantum_mm: f64,
}

impl Side {
    /// Builds the simulation of a scene with `changes`, and after them those of `--beside`; on a cut it shows the scan
    /// `grey`, or that of the scene.
    ///
    /// # Errors
    /// Those of the scene and of the scan.
    pub fn new(
        scene: &str,
        changes: &[String],
        beside: &[String],
        grey: Option<&Path>,
    ) -> Result<Self, SimError> {
        let (scene, _) = file::load_beside(scene, changes, beside)?;
        let scan = scan(&scene, grey)?;
        let mut simulation = Simulation::builder(&scene).outlines_all().build()?;
        let is_unloaded = scene.tools.is_empty() && scene.gravity_m_s2 == [0.0; 3];
        let is_at_rest = is_unloaded && scene.dynamics.is_none();
        let (vertices, tets) = (simulation.body().vertex_count(), simulation.body().tet_count());
        let (skin, inner) = simulation.take_outlines();
        let of_skin = skin.iter().map(|_| 0);
        let labels: Vec<i64> =
            of_skin.chain(inner.iter().flat_map(|inner| inner.labels())).collect();
        let volume = skin.as_ref().and_then(BodyOutline::labels);
        if let (None, Some(path)) = (&volume, grey) {
            let want = "a body from an image: one of a mesh file has no voxels to show them on";
            return Err(SimError::value("yawara view", "--grey", path.display(), want));
        }
        let voxels =
            volume.map(|volume| Voxels::of(&volume, &labels, scan.as_ref())).transpose()?;
        let voxels = voxels.flatten().map(Arc::new);
        let frame = simulation.frame()?;
        let side = (0..3).map(|axis| {
            let along = frame.points_mm.iter().map(|x| x[axis]);
            let ends = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            });
            ends[1] - ends[0]
        });
        Ok(Self {
            report: StepReport { vertices, tets, converged: true, ..StepReport::default() },
            hands: BTreeMap::new(),
            labels,
            still: if is_at_rest { STILL_STEPS } else { 0 },
            forest: None,
            is_remeshed: true,
            outlines: Some(Outlines { skin, inner, voxels, axes: simulation.axes() }),
            // Twice the longest side either way.
            quantum_mm: 2.0 * side.fold(1e-3, f64::max) / f64::from(i16::MAX),
            simulation,
        })
    }

    /// Puts a tool into a hand that is free.
    ///
    /// # Errors
    /// [`SimError::Value`] after [`MOST_TOOLS`]; as [`Simulation::add_tool`].
    pub fn take(&mut self, key: HandKey, entry: ToolEntry) -> Result<(), SimError> {
        let taken = self.simulation.scene().tools.len();
        if taken >= MOST_TOOLS {
            let want = format!("at most {MOST_TOOLS} in one simulation: reset to go on");
            return Err(SimError::value(self.simulation.name(), "tools", taken, want));
        }
        let tool = self.simulation.add_tool(entry)?;
        let (time_s, step_s) = (self.report.time_s, self.simulation.scene().time.step_s);
        let hand = Hand::new(&mut self.simulation, tool, time_s, step_s)?;
        self.hands.insert(key, hand);
        Ok(())
    }

    /// Has a hand let go, if it is there.
    ///
    /// # Errors
    /// As [`Simulation::release_tool`].
    pub fn release(&mut self, key: HandKey) -> Result<(), SimError> {
        let Some(hand) = self.hands.remove(&key) else { return Ok(()) };
        self.still = 0;
        self.simulation.release_tool(hand.tool)
    }

    /// Where the hands have their tools at the end of the next step.
    pub fn lead(&mut self) -> Led {
        self.hands.iter_mut().map(|(key, hand)| (*key, hand.next())).collect()
    }

    /// Makes a step in which tools go where they are `led`; for how many steps nothing has moved.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn step(&mut self, led: &Led) -> Result<usize, SimError> {
        for (key, hand) in &mut self.hands {
            if let Some(at) = led.get(key) {
                hand.lead(&mut self.simulation, *at)?;
            }
        }
        self.report = self.simulation.step()?;
        for hand in self.hands.values_mut() {
            hand.feel(&self.simulation, &self.report)?;
        }
        let StepReport { splits, merges, edits, .. } = &self.report;
        let has_changed = splits + merges + edits > 0;
        self.is_remeshed |= has_changed;
        let scene = self.simulation.scene();
        let is_over = self.report.time_s > ends_s(scene);
        let stands = scene.dynamics.is_none() && is_over && self.report.converged;
        let is_still = stands && !has_changed && self.report.iterations == 0;
        self.still = if is_still { self.still + 1 } else { 0 };
        Ok(self.still)
    }

    /// What a picture is made of, and what is said of the step with `more`.
    ///
    /// # Errors
    /// As [`Simulation::frame`].
    pub fn snapshot(&mut self, generation: u64, mut more: Value) -> Result<Snapshot, SimError> {
        if self.is_remeshed || self.forest.is_none() {
            self.forest = self.simulation.forest().map(|forest| Arc::new(forest.clone()));
        }
        more["generation"] = generation.into();
        more["quantum_mm"] = self.quantum_mm.into();
        let hands: Vec<(u64, u8, &Hand)> =
            self.hands.iter().map(|((page, number), hand)| (*page, *number, hand)).collect();
        Ok(Snapshot {
            generation,
            text: of_step(&self.report, &hands, more),
            frame: self.simulation.frame()?,
            is_remeshed: std::mem::take(&mut self.is_remeshed),
            forest: self.forest.clone(),
            positions: self.simulation.body().positions().to_vec(),
            outlines: self.outlines.take(),
            quantum_mm: self.quantum_mm,
            beside: None,
        })
    }
}

/// When the scene's own tools have done all that they do, s.
fn ends_s(scene: &Scene) -> f64 {
    let of = |tool: &ToolEntry| match tool {
        // Of a hand's tools the paths are not here.
        ToolEntry::Grab(GrabEntry { path, release_s, .. })
        | ToolEntry::Probe(ProbeEntry { path, release_s, .. }) => {
            path.last().map(|key| key.time_s).into_iter().chain(*release_s).fold(0.0, f64::max)
        }
        ToolEntry::Resect(AblationEntry { path, release_s, .. })
        | ToolEntry::Coagulate(AblationEntry { path, release_s, .. })
        | ToolEntry::Suture(AblationEntry { path, release_s, .. })
        | ToolEntry::Scalpel(ScalpelEntry { path, release_s, .. }) => {
            path.last().map(|key| key.time_s).into_iter().chain(*release_s).fold(0.0, f64::max)
        }
        ToolEntry::Pressure(pressure) => pressure.pressure.last().map_or(0.0, |key| key.time_s),
        ToolEntry::Load(load) => load.load.last().map_or(0.0, |key| key.time_s),
    };
    scene.tools.iter().map(of).fold(0.0, f64::max)
}

type Task = Box<dyn FnOnce(&mut Side) + Send>;

/// The second simulation. It stays in the thread that it was made in, and works while the first does.
pub(super) struct Beside {
    tasks: Sender<Task>,
    /// What pages are told of it, whichever step it is at.
    pub standing: Value,
}

/// What a thread answers when it is done.
pub(super) struct Answer<T>(Receiver<Result<T, SimError>>);

impl<T> Answer<T> {
    /// Waits for it.
    ///
    /// # Errors
    /// Those of the work.
    pub fn wait(self) -> Result<T, SimError> {
        let gone = || std::io::Error::other("its thread has ended");
        self.0.recv().unwrap_or_else(|_| Err(SimError::Io("the simulation beside".into(), gone())))
    }
}

impl Beside {
    /// Begins to build the simulation, as [`Side::new`].
    pub fn build(
        scene: &str,
        changes: &[String],
        beside: &[String],
        grey: Option<&Path>,
    ) -> Answer<Self> {
        let (scene, changes, beside) = (scene.to_owned(), changes.to_vec(), beside.to_vec());
        let grey = grey.map(Path::to_path_buf);
        let (tasks, waiting) = channel::<Task>();
        let (built, answer) = channel();
        thread::spawn(move || match Side::new(&scene, &changes, &beside, grey.as_deref()) {
            Ok(mut side) => {
                let (plan, warnings) = (side.simulation.plan(), warnings(&side.simulation));
                let standing = json!({ "changes": beside, "plan": plan, "warnings": warnings });
                // Whoever asked may have given up; then there are no tasks either.
                let _ = built.send(Ok(Self { tasks, standing }));
                waiting.into_iter().for_each(|task| task(&mut side));
            }
            Err(error) => drop(built.send(Err(error))),
        });
        Answer(answer)
    }

    /// Has its thread do something.
    pub fn ask<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Side) -> Result<T, SimError> + Send + 'static,
    ) -> Answer<T> {
        let (done, answer) = channel();
        let task = move |side: &mut Side| drop(done.send(work(side)));
        // Of a thread that has ended the answer tells.
        let _ = self.tasks.send(Box::new(task));
        Answer(answer)
    }
}
