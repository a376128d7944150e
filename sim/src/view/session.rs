//! The thread that owns the simulation and makes steps, paced by the clock.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use serde_json::json;
use yawara_mesh::BisectionForest;

use super::hand::Hand;
use super::inbox::{Inbox, News, Voices};
use super::painter::{Easel, Outlines, Snapshot};
use super::protocol::{Request, scene_with};
use super::recording::Recording;
use super::state::{Standing, of_step, quoted};
use crate::SimError;
use crate::report::StepReport;
use crate::scene::{GrabEntry, GrabHold, ProbeEntry, Region, Scene, ToolEntry};
use crate::step::Simulation;

/// The most steps of a simulation that hands are on: their paths are kept.
const MOST_STEPS: usize = 200_000;

/// The most tools that hands may take in one simulation.
const MOST_TOOLS: usize = 200;

/// After so many steps in which nothing moved a body without inertia is at rest.
const STILL_STEPS: usize = 3;

/// Steps that a rate is the mean of.
const RATE_STEPS: usize = 30;

/// What a session is told to do.
#[derive(Clone, Debug)]
pub(super) struct Orders {
    /// A scene's name or file.
    pub scene: String,
    /// `KEY=VALUE`.
    pub set: Vec<String>,
    /// Whether the scene's own grabs and probes stay.
    pub play: bool,
    /// Whether steps go on while no page is there.
    pub keep_going: bool,
    /// Where recordings go.
    pub out: PathBuf,
    /// The program whose `run` makes recordings again.
    pub program: PathBuf,
}

/// The simulation in the making or at work.
pub(super) struct Session {
    orders: Orders,
    inbox: Arc<Inbox>,
    easel: Arc<Easel>,
    voices: Arc<Voices>,
    /// All that was set, by the command line and by pages.
    changes: Vec<String>,
    simulation: Simulation,
    report: StepReport,
    hands: BTreeMap<(u64, u8), Hand>,
    generation: u64,
    is_paused: bool,
    still: usize,
    forest: Option<Arc<BisectionForest>>,
    is_remeshed: bool,
    outlines: Option<Outlines>,
    labels: Vec<i64>,
    quantum_mm: f64,
    /// The step of the last picture.
    painted: Option<usize>,
    /// When the last steps ended.
    ends: VecDeque<Instant>,
    is_running: Arc<AtomicBool>,
}

impl Session {
    /// Builds the simulation.
    ///
    /// # Errors
    /// Those of the scene.
    pub fn new(
        orders: Orders,
        inbox: Arc<Inbox>,
        easel: Arc<Easel>,
        voices: Arc<Voices>,
    ) -> Result<Self, SimError> {
        let changes = changes(&orders)?;
        let simulation = build(&orders.scene, &changes)?;
        let mut session = Self {
            orders,
            inbox,
            easel,
            voices,
            changes,
            simulation,
            report: StepReport::default(),
            hands: BTreeMap::new(),
            generation: 0,
            is_paused: false,
            still: 0,
            forest: None,
            is_remeshed: true,
            outlines: None,
            labels: Vec::new(),
            quantum_mm: 1.0,
            painted: None,
            ends: VecDeque::new(),
            is_running: Arc::default(),
        };
        session.begin()?;
        Ok(session)
    }

    /// Begins with the simulation as it was built.
    fn begin(&mut self) -> Result<(), SimError> {
        self.generation += 1;
        self.hands.clear();
        let scene = self.simulation.scene();
        let is_unloaded = scene.tools.is_empty() && scene.gravity_m_s2 == [0.0; 3];
        let is_at_rest = is_unloaded && scene.dynamics.is_none();
        self.still = if is_at_rest { STILL_STEPS } else { 0 };
        self.painted = None;
        self.is_remeshed = true;
        self.ends.clear();
        let (vertices, tets) =
            (self.simulation.body().vertex_count(), self.simulation.body().tet_count());
        self.report = StepReport { vertices, tets, converged: true, ..StepReport::default() };
        let (skin, inner) = self.simulation.take_outlines();
        let of_skin = skin.iter().map(|_| 0);
        self.labels = of_skin.chain(inner.iter().flat_map(|inner| inner.labels())).collect();
        let frame = self.simulation.frame()?;
        let side = (0..3).map(|axis| {
            let along = frame.points_mm.iter().map(|x| x[axis]);
            let ends = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            });
            ends[1] - ends[0]
        });
        // Twice the longest side either way.
        self.quantum_mm = 2.0 * side.fold(1e-3, f64::max) / f64::from(i16::MAX);
        self.outlines = Some(Outlines { skin, inner, axes: self.simulation.axes() });
        self.show()?;
        self.tell();
        Ok(())
    }

    /// Works until the inbox ends.
    pub fn run(mut self) {
        let mut due = Instant::now();
        loop {
            let News { requests, moves, left, has_page, wants_picture, ended } = self.inbox.take();
            if ended {
                break;
            }
            for (page, request) in requests {
                if let Err(error) = self.answer(page, request) {
                    self.voices.say(Some(page), "error", &error.to_string());
                }
            }
            for (key, (target, stamp)) in moves {
                if let Some(hand) = self.hands.get_mut(&key) {
                    (hand.target, hand.stamp) = (target, stamp);
                }
            }
            left.into_iter().for_each(|page| self.let_go_of(page));
            if wants_picture {
                self.painted = None;
            }
            if self.goes_on(has_page) {
                self.step();
                let step = Duration::from_secs_f64(self.simulation.scene().time.step_s.min(1.0));
                due = (due + step).max(Instant::now());
                if has_page && self.easel.is_free() {
                    self.paint();
                }
                self.wait_until(due);
            } else {
                due = Instant::now();
                if has_page && self.painted != Some(self.report.step) {
                    self.paint();
                }
                self.inbox.nap();
            }
        }
        self.easel.close();
    }

    fn wait_until(&self, due: Instant) {
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }

    fn goes_on(&self, has_page: bool) -> bool {
        // A hand that has not moved yet changes nothing either.
        let has_moved = |hand: &Hand| hand.target != Vector3::zeros();
        let rests = self.still >= STILL_STEPS && !self.hands.values().any(has_moved);
        !self.is_paused && !rests && (has_page || self.orders.keep_going)
    }

    fn answer(&mut self, page: u64, request: Request) -> Result<(), SimError> {
        match request {
            Request::Grab { hand, rest_mm, radius_mm } => {
                let entry = ToolEntry::Grab(GrabEntry {
                    region: Region::Sphere {
                        centre: None,
                        centre_mm: Some(rest_mm),
                        centre_voxel: None,
                        radius_m: radius_mm * 1e-3,
                    },
                    hold: GrabHold::Mean,
                    stiffness_n_m4: None,
                    path: Vec::new(),
                    path_csv: None,
                    turn_axis: [0.0, 0.0, 1.0],
                    begin_s: None,
                    release_s: None,
                });
                self.take((page, hand), entry, radius_mm)
            }
            Request::Press { hand, centre_mm, radius_mm } => {
                let entry = ToolEntry::Probe(ProbeEntry {
                    centre: None,
                    centre_mm: Some(centre_mm),
                    centre_voxel: None,
                    radius_m: radius_mm * 1e-3,
                    path: Vec::new(),
                    path_csv: None,
                    spacing_m: None,
                    begin_s: None,
                    release_s: None,
                });
                self.take((page, hand), entry, radius_mm)
            }
            // Kept by the inbox, and by the server.
            Request::Move { .. } | Request::Drawn { .. } => Ok(()),
            Request::Release { hand } => {
                if let Some(hand) = self.hands.remove(&(page, hand)) {
                    self.release(hand.tool)?;
                }
                Ok(())
            }
            Request::Pause { on } => {
                self.is_paused = on;
                self.tell();
                Ok(())
            }
            Request::Step {} => {
                self.step();
                Ok(())
            }
            Request::Reset {} => {
                self.simulation = build(&self.orders.scene, &self.changes)?;
                self.begin()
            }
            Request::Set { changes } => {
                // A later change of a key takes the place of an earlier one.
                let key =
                    |change: &str| change.split('=').next().unwrap_or_default().trim().to_owned();
                let mut all = self.changes.clone();
                all.retain(|old| !changes.iter().any(|new| key(new) == key(old)));
                all.extend(changes);
                self.simulation = build(&self.orders.scene, &all)?;
                self.changes = all;
                self.begin()
            }
            Request::Save {} => self.save(),
            Request::Seek { .. } => {
                let want = "a run that is over: `yawara view RUN_DIR`";
                Err(SimError::value(self.simulation.name(), "seek", "asked for", want))
            }
        }
    }

    /// Puts a tool into a hand.
    fn take(&mut self, key: (u64, u8), entry: ToolEntry, radius_mm: f64) -> Result<(), SimError> {
        if let Some(before) = self.hands.remove(&key) {
            self.release(before.tool)?;
        }
        let taken = self.simulation.scene().tools.len();
        if taken >= MOST_TOOLS {
            let want = format!("at most {MOST_TOOLS} in one simulation: reset to go on");
            return Err(SimError::value(self.simulation.name(), "tools", taken, want));
        }
        let tool = self.simulation.add_tool(entry)?;
        let (time_s, step_s) = (self.report.time_s, self.simulation.scene().time.step_s);
        let hand = Hand::new(&mut self.simulation, tool, radius_mm, time_s, step_s)?;
        self.hands.insert(key, hand);
        Ok(())
    }

    fn release(&mut self, tool: usize) -> Result<(), SimError> {
        self.still = 0;
        self.simulation.release_tool(tool)
    }

    fn let_go_of(&mut self, page: u64) {
        let of_page: Vec<(u64, u8)> =
            self.hands.range((page, 0)..=(page, u8::MAX)).map(|x| *x.0).collect();
        for key in of_page {
            if let Some(hand) = self.hands.remove(&key) {
                // A tool of a hand is there.
                let _ = self.release(hand.tool);
            }
        }
    }

    fn step(&mut self) {
        if self.report.step >= MOST_STEPS {
            if !self.is_paused {
                self.is_paused = true;
                let text =
                    format!("{MOST_STEPS} steps are made, more are not kept: reset to go on");
                self.voices.say(None, "error", &text);
                self.tell();
            }
            return;
        }
        if let Err(error) = self.try_step() {
            self.voices.say(None, "error", &format!("the step failed: {error}; begun anew"));
            self.is_paused = true;
            let built = build(&self.orders.scene, &self.changes);
            match built.map(|simulation| self.simulation = simulation).and_then(|()| self.begin()) {
                Ok(()) => {}
                Err(error) => self.voices.say(None, "error", &error.to_string()),
            }
        }
    }

    fn try_step(&mut self) -> Result<(), SimError> {
        for hand in self.hands.values_mut() {
            hand.lead(&mut self.simulation)?;
        }
        self.report = self.simulation.step()?;
        for hand in self.hands.values_mut() {
            hand.feel(&self.simulation, &self.report)?;
        }
        let has_changed = self.report.splits + self.report.merges > 0;
        self.is_remeshed |= has_changed;
        let scene = self.simulation.scene();
        let is_over = self.report.time_s > ends_s(scene);
        let stands = scene.dynamics.is_none() && is_over && self.report.converged;
        let is_still = stands && !has_changed && self.report.iterations == 0;
        self.still = if is_still { self.still + 1 } else { 0 };
        self.ends.push_back(Instant::now());
        if self.ends.len() > RATE_STEPS + 1 {
            self.ends.pop_front();
        }
        Ok(())
    }

    fn paint(&mut self) {
        if let Err(error) = self.show() {
            self.voices.say(None, "error", &format!("no picture: {error}"));
            self.painted = Some(self.report.step);
        }
    }

    /// Puts up a snapshot of where the simulation is.
    fn show(&mut self) -> Result<(), SimError> {
        if self.is_remeshed || self.forest.is_none() {
            self.forest = self.simulation.forest().map(|forest| Arc::new(forest.clone()));
        }
        let hands: Vec<(u64, u8, &Hand)> =
            self.hands.iter().map(|((page, number), hand)| (*page, *number, hand)).collect();
        let rate = match (self.ends.front(), self.ends.back()) {
            (Some(first), Some(last)) if last > first => {
                (self.ends.len() - 1) as f64 / (*last - *first).as_secs_f64()
            }
            _ => 0.0,
        };
        let more = json!({
            "generation": self.generation,
            "quantum_mm": self.quantum_mm,
            "steps_per_s": rate,
            "at_rest": self.hands.is_empty() && self.still >= STILL_STEPS,
        });
        self.easel.put(Snapshot {
            generation: self.generation,
            text: of_step(&self.report, &hands, more),
            frame: self.simulation.frame()?,
            is_remeshed: std::mem::take(&mut self.is_remeshed),
            forest: self.forest.clone(),
            positions: self.simulation.body().positions().to_vec(),
            outlines: self.outlines.take(),
            quantum_mm: self.quantum_mm,
        });
        self.painted = Some(self.report.step);
        Ok(())
    }

    /// Tells all pages how the session stands.
    fn tell(&self) {
        let shown: Vec<String> =
            self.changes.iter().filter(|one| !one.starts_with("time.steps=")).cloned().collect();
        let standing = Standing {
            simulation: &self.simulation,
            name: &self.orders.scene,
            changes: &shown,
            generation: self.generation,
            is_paused: self.is_paused,
            labels: &self.labels,
            most_steps: MOST_STEPS,
        };
        self.voices.state.send_replace(standing.json().to_string().into());
    }

    /// Keeps what the hands did and runs it again, in a process of its own.
    fn save(&self) -> Result<(), SimError> {
        if self.report.step == 0 {
            let want = "at least one: take hold of something first";
            return Err(SimError::value(self.simulation.name(), "steps to keep", 0, want));
        }
        if self.is_running.swap(true, Ordering::SeqCst) {
            let want = "the end of the recording that is being run";
            return Err(SimError::value(self.simulation.name(), "a recording", "early", want));
        }
        let running = Arc::clone(&self.is_running);
        let written = Recording::write(&self.orders.out, self.simulation.scene_as_led());
        let recording = match written {
            Ok(recording) => recording,
            Err(error) => {
                running.store(false, Ordering::SeqCst);
                return Err(error);
            }
        };
        let (voices, program) = (Arc::clone(&self.voices), self.orders.program.clone());
        thread::spawn(move || {
            let Recording { scene, run } = recording;
            let mut command = Command::new(program);
            command.arg("run").arg(&scene).arg("--out").arg(&run).stdin(Stdio::null());
            let outcome = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
            running.store(false, Ordering::SeqCst);
            let line = format!("yawara run {}", quoted(&scene.display().to_string()));
            let (level, text) = match outcome {
                // 1: all is written, but a step did not converge.
                Ok(status) if matches!(status.code(), Some(0 | 1)) => {
                    ("info", format!("kept in {}", run.display()))
                }
                Ok(status) => ("error", format!("{line}: {status}")),
                Err(error) => ("error", format!("{line}: {error}")),
            };
            let notice = json!({ "kind": "kept", "level": level, "text": text, "command": line });
            let _ = voices.notices.send((None, notice.to_string().into()));
        });
        Ok(())
    }
}

/// What is set of a scene to have hands on it, after what the user sets.
fn changes(orders: &Orders) -> Result<Vec<String>, SimError> {
    let scene = scene_with(&orders.scene, &orders.set)?;
    let mut changes = orders.set.clone();
    let is_set = |key: &str| orders.set.iter().any(|one| one.trim_start().starts_with(key));
    let is_hand = |tool: &ToolEntry| matches!(tool, ToolEntry::Grab(_) | ToolEntry::Probe(_));
    let has_goal = scene.refinement.goal.is_some() || scene.stages.indicator == "goal";
    if !orders.play && !has_goal && scene.tools.iter().all(is_hand) && !is_set("tools") {
        changes.push("tools=[]".into());
    }
    if !orders.play && scene.dynamics.is_none() && !is_set("time.step_s") {
        // As often as a screen shows something.
        changes.push(format!("time.step_s={:?}", 1.0 / 60.0));
    }
    changes.push(format!("time.steps={MOST_STEPS}"));
    Ok(changes)
}

fn build(scene: &str, changes: &[String]) -> Result<Simulation, SimError> {
    let scene = scene_with(scene, changes)?;
    Simulation::builder(&scene).outlines_all().build()
}

/// When the scene's own tools have done all that they do, s.
fn ends_s(scene: &Scene) -> f64 {
    let of = |tool: &ToolEntry| match tool {
        // Of a hand's tools the paths are not here.
        ToolEntry::Grab(GrabEntry { path, release_s, .. })
        | ToolEntry::Probe(ProbeEntry { path, release_s, .. }) => {
            path.last().map(|key| key.time_s).into_iter().chain(*release_s).fold(0.0, f64::max)
        }
        ToolEntry::Pressure(pressure) => pressure.pressure.last().map_or(0.0, |key| key.time_s),
        ToolEntry::Load(load) => load.load.last().map_or(0.0, |key| key.time_s),
    };
    scene.tools.iter().map(of).fold(0.0, f64::max)
}
