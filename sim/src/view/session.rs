//! The thread that owns the simulation and makes steps, paced by the clock.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use serde_json::json;

use super::hand::Hand;
use super::inbox::{Inbox, News, Voices};
use super::painter::Easel;
use super::protocol::{Request, scene_with};
use super::recording::Recording;
use super::side::{Answer, Beside, HandKey, STILL_STEPS, Side};
use super::state::{Standing, quoted};
use crate::SimError;
use crate::scene::{
    AblationEntry, GrabEntry, GrabHold, ProbeEntry, Region, ScalpelEntry, ToolEntry,
};

/// The most steps of a simulation that hands are on: their paths are kept.
const MOST_STEPS: usize = 200_000;

/// By so many levels what a blade meets is finer than the start mesh at least: edges half as long.
const FINER: u8 = 3;

/// Steps that a rate is the mean of.
const RATE_STEPS: usize = 30;

/// What a session is told to do.
#[derive(Clone, Debug)]
pub(super) struct Orders {
    /// A scene's name or file.
    pub scene: String,
    /// `KEY=VALUE`.
    pub set: Vec<String>,
    /// What another simulation beside it has besides, `KEY=VALUE`; nothing for none.
    pub beside: Vec<String>,
    /// A scan to be shown on cuts.
    pub grey: Option<PathBuf>,
    /// Whether the scene's own grabs and probes stay.
    pub play: bool,
    /// Whether steps go on while no page is there.
    pub keep_going: bool,
    /// Where recordings go.
    pub out: PathBuf,
    /// The program whose `run` makes recordings again.
    pub program: PathBuf,
}

/// The simulations at work.
pub(super) struct Session {
    orders: Orders,
    inbox: Arc<Inbox>,
    easel: Arc<Easel>,
    voices: Arc<Voices>,
    /// All that was set, by the command line and by pages.
    changes: Vec<String>,
    first: Side,
    /// Led by the same hands: its tools go where those of the first do.
    beside: Option<Beside>,
    generation: u64,
    is_paused: bool,
    /// For how many steps nothing has moved in any of them.
    still: usize,
    /// The step of the last picture.
    painted: Option<usize>,
    /// When the last steps ended.
    ends: VecDeque<Instant>,
    is_running: Arc<AtomicBool>,
}

impl Session {
    /// Builds the simulations.
    ///
    /// # Errors
    /// Those of the scene; [`SimError::Value`] where `time` is to be another beside it.
    pub fn new(
        orders: Orders,
        inbox: Arc<Inbox>,
        easel: Arc<Easel>,
        voices: Arc<Voices>,
    ) -> Result<Self, SimError> {
        let changes = changes(&orders)?;
        let (first, beside) = build(&orders, &changes)?;
        let mut session = Self {
            orders,
            inbox,
            easel,
            voices,
            changes,
            first,
            beside,
            generation: 0,
            is_paused: false,
            still: 0,
            painted: None,
            ends: VecDeque::new(),
            is_running: Arc::default(),
        };
        session.begin()?;
        Ok(session)
    }

    /// Builds the simulations anew, with other changes; if they can't be had, all stays.
    fn renew(&mut self, changes: Vec<String>) -> Result<(), SimError> {
        (self.first, self.beside) = build(&self.orders, &changes)?;
        self.changes = changes;
        self.begin()
    }

    /// Begins with the simulations as they were built.
    fn begin(&mut self) -> Result<(), SimError> {
        self.generation += 1;
        self.still = self.first.still;
        if let Some(beside) = &self.beside {
            self.still = self.still.min(beside.ask(|side| Ok(side.still)).wait()?);
        }
        self.painted = None;
        self.ends.clear();
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
                if let Some(hand) = self.first.hands.get_mut(&key) {
                    (hand.target, hand.stamp) = (target, stamp);
                }
            }
            left.into_iter().for_each(|page| self.let_go_of(page));
            if wants_picture {
                self.painted = None;
            }
            if self.goes_on(has_page) {
                self.step();
                let step =
                    Duration::from_secs_f64(self.first.simulation.scene().time.step_s.min(1.0));
                due = (due + step).max(Instant::now());
                if has_page && self.easel.is_free() {
                    self.paint();
                }
                self.wait_until(due);
            } else {
                due = Instant::now();
                if has_page && self.painted != Some(self.first.report.step) {
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
        let rests = self.still >= STILL_STEPS && !self.first.hands.values().any(has_moved);
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
                self.take((page, hand), entry)
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
                self.take((page, hand), entry)
            }
            Request::Cut { hand, tip_mm, edge_mm } => {
                let mesh = &self.first.simulation.scene().mesh;
                let entry = ToolEntry::Scalpel(ScalpelEntry {
                    centre: None,
                    centre_mm: Some(tip_mm),
                    centre_voxel: None,
                    edge_m: edge_mm.map(|x| 1e-3 * x),
                    level: Some(mesh.finest_level().min(mesh.start_level + FINER)),
                    toughness_j_m2: None,
                    path: Vec::new(),
                    path_csv: None,
                    begin_s: None,
                    release_s: None,
                });
                self.take((page, hand), entry)
            }
            Request::Sew { hand, centre_mm, radius_mm } => {
                let entry = ToolEntry::Suture(AblationEntry {
                    centre: None,
                    centre_mm: Some(centre_mm),
                    centre_voxel: None,
                    radius_m: radius_mm * 1e-3,
                    labels: Vec::new(),
                    becomes: None,
                    path: Vec::new(),
                    path_csv: None,
                    begin_s: None,
                    release_s: None,
                });
                self.take((page, hand), entry)
            }
            // Kept by the inbox, and by the server.
            Request::Move { .. } | Request::Drawn { .. } => Ok(()),
            Request::Release { hand } => self.release((page, hand)),
            Request::Pause { on } => {
                self.is_paused = on;
                self.tell();
                Ok(())
            }
            Request::Step {} => {
                self.step();
                Ok(())
            }
            Request::Reset {} => self.renew(self.changes.clone()),
            Request::Set { changes } => {
                // A later change of a key takes the place of an earlier one.
                let key =
                    |change: &str| change.split('=').next().unwrap_or_default().trim().to_owned();
                let mut all = self.changes.clone();
                all.retain(|old| !changes.iter().any(|new| key(new) == key(old)));
                all.extend(changes);
                self.renew(all)
            }
            Request::Save {} => self.save(),
            Request::Seek { .. } => {
                let want = "a run that is over: `yawara view RUN_DIR`";
                Err(SimError::value(self.first.simulation.name(), "seek", "asked for", want))
            }
        }
    }

    /// Puts a tool into a hand, in each simulation or in none.
    fn take(&mut self, key: HandKey, entry: ToolEntry) -> Result<(), SimError> {
        self.release(key)?;
        let same = entry.clone();
        let beside = self.ask_beside(move |side| side.take(key, same));
        let first = self.first.take(key, entry);
        let outcome = first.and(beside.map_or(Ok(()), Answer::wait));
        if outcome.is_err() {
            self.release(key)?;
        }
        outcome
    }

    fn release(&mut self, key: HandKey) -> Result<(), SimError> {
        if self.first.hands.contains_key(&key) {
            self.still = 0;
        }
        let beside = self.ask_beside(move |side| side.release(key));
        self.first.release(key).and(beside.map_or(Ok(()), Answer::wait))
    }

    fn let_go_of(&mut self, page: u64) {
        let of_page: Vec<HandKey> =
            self.first.hands.range((page, 0)..=(page, u8::MAX)).map(|x| *x.0).collect();
        for key in of_page {
            // A tool of a hand is there.
            let _ = self.release(key);
        }
    }

    /// Has the simulation beside do something meanwhile, if there is one.
    fn ask_beside<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Side) -> Result<T, SimError> + Send + 'static,
    ) -> Option<Answer<T>> {
        self.beside.as_ref().map(|beside| beside.ask(work))
    }

    fn step(&mut self) {
        if self.first.report.step >= MOST_STEPS {
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
            if let Err(error) = self.renew(self.changes.clone()) {
                self.voices.say(None, "error", &error.to_string());
            }
        }
    }

    fn try_step(&mut self) -> Result<(), SimError> {
        let led = self.first.lead();
        let same = led.clone();
        let beside = self.ask_beside(move |side| side.step(&same));
        let still = self.first.step(&led)?;
        self.still = still.min(beside.map_or(Ok(usize::MAX), Answer::wait)?);
        self.ends.push_back(Instant::now());
        if self.ends.len() > RATE_STEPS + 1 {
            self.ends.pop_front();
        }
        Ok(())
    }

    fn paint(&mut self) {
        if let Err(error) = self.show() {
            self.voices.say(None, "error", &format!("no picture: {error}"));
            self.painted = Some(self.first.report.step);
        }
    }

    /// Puts up a snapshot of where the simulations are, after the same step.
    fn show(&mut self) -> Result<(), SimError> {
        let rate = match (self.ends.front(), self.ends.back()) {
            (Some(first), Some(last)) if last > first => {
                (self.ends.len() - 1) as f64 / (*last - *first).as_secs_f64()
            }
            _ => 0.0,
        };
        let more = json!({
            "steps_per_s": rate,
            "at_rest": self.first.hands.is_empty() && self.still >= STILL_STEPS,
        });
        let (generation, same) = (self.generation, more.clone());
        let beside = self.ask_beside(move |side| side.snapshot(generation, same));
        let mut snapshot = self.first.snapshot(generation, more)?;
        snapshot.beside = beside.map(Answer::wait).transpose()?.map(Box::new);
        self.easel.put(snapshot);
        self.painted = Some(self.first.report.step);
        Ok(())
    }

    /// Tells all pages how the session stands.
    fn tell(&self) {
        let shown: Vec<String> =
            self.changes.iter().filter(|one| !one.starts_with("time.steps=")).cloned().collect();
        let standing = Standing {
            simulation: &self.first.simulation,
            name: &self.orders.scene,
            changes: &shown,
            generation: self.generation,
            is_paused: self.is_paused,
            labels: &self.first.labels,
            most_steps: MOST_STEPS,
            beside: self.beside.as_ref().map(|beside| &beside.standing),
        };
        self.voices.state.send_replace(standing.json().to_string().into());
    }

    /// Keeps what the hands did in each simulation and runs it again, one after the other in processes of their own.
    fn save(&self) -> Result<(), SimError> {
        if self.first.report.step == 0 {
            let want = "at least one: take hold of something first";
            return Err(SimError::value(self.first.simulation.name(), "steps to keep", 0, want));
        }
        if self.is_running.swap(true, Ordering::SeqCst) {
            let want = "the end of the recording that is being run";
            return Err(SimError::value(
                self.first.simulation.name(),
                "a recording",
                "early",
                want,
            ));
        }
        let recordings = match self.write() {
            Ok(recordings) => recordings,
            Err(error) => {
                self.is_running.store(false, Ordering::SeqCst);
                return Err(error);
            }
        };
        let (voices, program) = (Arc::clone(&self.voices), self.orders.program.clone());
        let running = Arc::clone(&self.is_running);
        thread::spawn(move || {
            let (mut level, mut texts, mut lines) = ("info", Vec::new(), Vec::new());
            for Recording { scene, run } in recordings {
                let mut command = Command::new(&program);
                command.arg("run").arg(&scene).arg("--out").arg(&run).stdin(Stdio::null());
                let outcome = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
                let line = format!("yawara run {}", quoted(&scene.display().to_string()));
                match outcome {
                    // 1: all is written, but a step did not converge.
                    Ok(status) if matches!(status.code(), Some(0 | 1)) => {
                        texts.push(format!("kept in {}", run.display()));
                    }
                    Ok(status) => (level, _) = ("error", texts.push(format!("{line}: {status}"))),
                    Err(error) => (level, _) = ("error", texts.push(format!("{line}: {error}"))),
                }
                lines.push(line);
            }
            running.store(false, Ordering::SeqCst);
            let (text, command) = (texts.join("; "), lines.join("\n"));
            let notice =
                json!({ "kind": "kept", "level": level, "text": text, "command": command });
            let _ = voices.notices.send((None, notice.to_string().into()));
        });
        Ok(())
    }

    /// A recording of each simulation.
    fn write(&self) -> Result<Vec<Recording>, SimError> {
        let beside = self.ask_beside(|side| Ok(side.simulation.scene_as_led()));
        let mut scenes = vec![self.first.simulation.scene_as_led()];
        scenes.extend(beside.map(Answer::wait).transpose()?);
        scenes.into_iter().map(|scene| Recording::write(&self.orders.out, scene)).collect()
    }
}

/// What is set of a scene to have hands on it, after what the user sets.
fn changes(orders: &Orders) -> Result<Vec<String>, SimError> {
    let scene = scene_with(&orders.scene, &orders.set)?;
    if let Some(one) = orders.beside.iter().find(|one| one.trim_start().starts_with("time")) {
        let want = "a key that is not of `time`: both simulations make the same steps";
        return Err(SimError::value("yawara view", "--beside", one, want));
    }
    if let Some(tool) = scene.tools.iter().find(|tool| tool.ablation().is_some()) {
        let want = "no tool that changes labels: the page shows the start; take `yawara run`";
        return Err(SimError::value(&scene.name, "tools", tool.kind(), want));
    }
    let mut changes = orders.set.clone();
    let is_set = |key: &str| orders.set.iter().any(|one| one.trim_start().starts_with(key));
    let is_hand = |tool: &ToolEntry| {
        matches!(
            tool,
            ToolEntry::Grab(_) | ToolEntry::Probe(_) | ToolEntry::Scalpel(_) | ToolEntry::Suture(_)
        )
    };
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

/// The simulations, built at the same time.
fn build(orders: &Orders, changes: &[String]) -> Result<(Side, Option<Beside>), SimError> {
    let Orders { scene, beside, grey, .. } = orders;
    let grey = grey.as_deref();
    let is_asked = !beside.is_empty();
    let answer = is_asked.then(|| Beside::build(scene, changes, beside, grey));
    // What is wrong with both is said of the first.
    let first = Side::new(scene, changes, &[], grey)?;
    Ok((first, answer.map(Answer::wait).transpose()?))
}
