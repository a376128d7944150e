//! The thread that shows a run that is over, frame by frame as pages ask for them.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::inbox::{Inbox, News, Voices};
use super::painter::{Easel, Snapshot};
use super::protocol::Request;
use super::state::{of_step, quoted};
use crate::SimError;
use crate::playback::Run;

/// Shows the frames of a run.
pub(super) struct Player {
    run: Arc<Run>,
    inbox: Arc<Inbox>,
    easel: Arc<Easel>,
    voices: Arc<Voices>,
    /// The frame that is shown.
    at: usize,
    cells: Vec<[u32; 4]>,
}

impl Player {
    /// Opens the run.
    ///
    /// # Errors
    /// As [`Run::open`].
    pub fn new(
        folder: &Path,
        inbox: Arc<Inbox>,
        easel: Arc<Easel>,
        voices: Arc<Voices>,
    ) -> Result<Self, SimError> {
        let run = Arc::new(Run::open(folder)?);
        voices.state.send_replace(standing(&run).to_string().into());
        let mut player = Self { run, inbox, easel, voices, at: 0, cells: Vec::new() };
        player.show()?;
        Ok(player)
    }

    /// Works until the inbox ends.
    pub fn run(mut self) {
        loop {
            let News { requests, wants_picture, ended, .. } = self.inbox.take();
            if ended {
                break;
            }
            let mut wanted = None;
            for (page, request) in requests {
                match request {
                    Request::Seek { frame } if frame < self.run.frame_count() => {
                        wanted = Some(frame)
                    }
                    Request::Seek { frame } => {
                        let text =
                            format!("frame is {frame}, want one below {}", self.run.frame_count());
                        self.voices.say(Some(page), "error", &text);
                    }
                    Request::Release { .. } => {}
                    _ => self.voices.say(
                        Some(page),
                        "error",
                        "this run is over: it can be looked at only",
                    ),
                }
            }
            // Of all that were asked for meanwhile the last.
            self.at = wanted.unwrap_or(self.at);
            if (wanted.is_some() || wants_picture)
                && let Err(error) = self.show()
            {
                self.voices.say(None, "error", &format!("no picture: {error}"));
            }
            self.inbox.nap();
        }
        self.easel.close();
    }

    fn show(&mut self) -> Result<(), SimError> {
        let mut snapshot = snapshot(&self.run, self.at)?;
        snapshot.is_remeshed = snapshot.frame.tets != self.cells;
        self.cells.clone_from(&snapshot.frame.tets);
        self.easel.put(snapshot);
        Ok(())
    }
}

/// What a picture of a frame is made of, as of another mesh than before.
///
/// # Errors
/// As [`Run::frame`].
pub(super) fn snapshot(run: &Run, number: usize) -> Result<Snapshot, SimError> {
    let frame = run.frame(number)?;
    // Rounded by at most half of that.
    let quantum_mm = run.displacement_max_mm().max(1e-3) / f64::from(i16::MAX);
    let more = json!({
        "generation": 1,
        "quantum_mm": quantum_mm,
        "frame": number,
        "steps_per_s": 0.0,
        "at_rest": false,
    });
    Ok(Snapshot {
        generation: 1,
        text: of_step(&run.report(number, &frame), &[], more),
        frame,
        is_remeshed: true,
        forest: None,
        positions: Vec::new(),
        outlines: None,
        quantum_mm,
        beside: None,
    })
}

/// What a page needs to know of a run, whichever frame it shows.
pub(super) fn standing(run: &Run) -> Value {
    let name_of = |label: i64| if label == 0 { "skin" } else { run.name_of(label) };
    let moments = (0..run.frame_count()).map(|frame| {
        let (step, time_s) = run.moment(frame);
        json!({ "step": step, "time_s": time_s })
    });
    let rows = run.steps().iter().map(|step| {
        let times = &step.times;
        json!({
            "step": step.step,
            "force_n": step.force_n,
            "error_estimate": step.error_estimate,
            "vertices": step.vertices,
            "iterations": step.iterations,
            "residual": step.residual,
            "times_ms": {
                "tool": times.tool_ms, "solve": times.solve_ms, "indicator": times.indicator_ms,
                "remesh": times.remesh_ms, "inverse": times.inverse_ms,
            },
        })
    });
    let words = run.summary()["made_by"]["command"].as_array().into_iter().flatten();
    let words: Vec<String> = words.filter_map(Value::as_str).map(quoted).collect();
    json!({
        "kind": "state",
        "version": env!("CARGO_PKG_VERSION"),
        "scene": run.scene(),
        "description": run.description(),
        "generation": 1,
        "paused": true,
        "step_s": run.step_s(),
        "labels": run.labels().iter().map(|&label| json!({
            "label": label, "name": name_of(label),
        })).collect::<Vec<_>>(),
        "plan": run.summary()["plan"].as_array().cloned().unwrap_or_default(),
        "warnings": run.warnings(),
        "stages": [],
        "numbers": [],
        "materials": [],
        "command": words.join(" "),
        "playback": { "frames": moments.collect::<Vec<_>>(), "rows": rows.collect::<Vec<_>>() },
    })
}
