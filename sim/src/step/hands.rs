//! Tools that come while a simulation runs, go where they are led and let go: what a hand does.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::content::{EDITS, is_of_parts};
use super::holding::{Coming, hold_material};
use super::simulation::Simulation;
use crate::body::{Origin, Start};
use crate::error::SimError;
#[cfg(feature = "view")]
use crate::report::{BodyOutline, Surfaces};
use crate::scene::{AUTO, Course, GrabEntry, GrabHold, Key, Scene, ToolEntry};
use crate::tools::{self, BodyAtRest, MaterialHold, Pose, path_of};

/// A turn is known well enough when it changes by less, rad.
const SAME_TURN: f64 = 1e-12;

/// Most corrections of a turn: each leaves an error of third order.
const CORRECTIONS: usize = 50;

impl Simulation {
    /// Adds a tool that begins now, whatever its `begin_s` says, and stays where it is until it is led by
    /// [`extend_tool_path`](Self::extend_tool_path): a grab where its material is, a probe at its start.
    /// Returns its number. A scene that has it from the start ([`scene_as_led`](Self::scene_as_led)) is
    /// the same simulation, bit for bit.
    ///
    /// Cost: the first time that of reading the body again; for a probe its outline is cut, for a scalpel the labels
    /// are copied.
    /// # Errors
    /// Those of a scene with that tool; a grab has to hold a mean. Nothing has changed then.
    pub fn add_tool(&mut self, mut entry: ToolEntry) -> Result<usize, SimError> {
        let now = self.time_after(self.recorder.statistics.steps());
        let stays = vec![Key { time_s: now, move_m: [0.0; 3], turn_deg: 0.0 }];
        match &mut entry {
            ToolEntry::Grab(grab) => (grab.begin_s, grab.path) = (Some(now), stays),
            ToolEntry::Probe(probe) => (probe.begin_s, probe.path) = (Some(now), stays),
            ToolEntry::Scalpel(blade) => (blade.begin_s, blade.path) = (Some(now), stays),
            ToolEntry::Suture(ball) => (ball.begin_s, ball.path) = (Some(now), stays),
            _ => {
                let want = "grab, probe, scalpel or suture: only these begin while the body moves";
                return Err(SimError::value(self.name(), "kind", entry.kind(), want));
            }
        }
        let number = self.tools.len();
        let rest = match self.rest.take() {
            Some(rest) => rest,
            None => Box::new(Start::new(&self.scene, None)?),
        };
        let refiner = self.body.refiner.as_ref().filter(|_| entry.edits());
        let may = refiner.map_or(Ok(()), |refiner| {
            is_of_parts(&refiner.content.embedding, &self.scene.name, EDITS)
        });
        let made = may.and_then(|()| self.make(&rest, &mut entry));
        if let (true, Origin::Image(body), Some(refiner)) =
            (entry.edits() && made.is_ok(), &rest.origin, &mut self.body.refiner)
        {
            refiner.content.volume.get_or_insert_with(|| Arc::new(body.volume.clone()));
        }
        self.rest = Some(rest);
        let (mut tool, hold) = made?;
        self.resurface(tool.as_mut())?;
        tool.follow(&self.body.state)?;
        if let Some(hold) = hold.clone() {
            hold_material(vec![(Some(number), hold)], &self.scene.name, &mut self.body.state)?;
        }
        if let Some(beginning) = &mut self.beginning {
            beginning.take(number, hold.as_ref());
        }
        self.tools.push(tool);
        self.scene.tools.push(entry);
        self.ledger.add_tool();
        Ok(number)
    }

    /// The tool of `entry`, which is led to where its material is now, and that material.
    fn make(
        &self,
        rest: &Start,
        entry: &mut ToolEntry,
    ) -> Result<(Box<dyn tools::Tool>, Option<MaterialHold>), SimError> {
        let (number, name) = (self.tools.len(), &self.scene.name);
        let key = format!("tools[{number}]");
        let mut with_it = self.scene_as_led();
        with_it.tools.push(entry.clone());
        with_it.validate(name)?;
        let mut body = BodyAtRest::new(&with_it, rest);
        for (i, other) in with_it.tools[..number].iter().enumerate() {
            if let ToolEntry::Grab(other) = other {
                body.grab(&format!("tools[{i}]"), other)?;
            }
        }
        let made = tools::by_name(entry, &key, &mut body)?;
        let Some(hold) = made.grip(&body)? else { return Ok((made, None)) };
        if let ToolEntry::Grab(grab) = entry {
            let centre = made.reference(0.0);
            self.lead_to_material(grab, &hold, centre)?;
        }
        // Other than by its path the tool is the same.
        let mut again = BodyAtRest::new(&with_it, rest);
        Ok((tools::by_name(entry, &key, &mut again)?, Some(hold)))
    }

    /// Begins the path of a grab with the place and turn that its material has; it turns about `centre`.
    fn lead_to_material(
        &self,
        grab: &mut GrabEntry,
        hold: &MaterialHold,
        centre: Vector3<f64>,
    ) -> Result<(), SimError> {
        debug_assert!(grab.hold == GrabHold::Mean);
        let (state, axes) = (&self.body.state, self.recorder.axes);
        let Some(mut grip) = state.grip(hold.points.clone(), None) else {
            let want = "material of a part that is kept";
            return Err(SimError::value(&self.scene.name, "region", "in parts left out", want));
        };
        let mut turn = UnitQuaternion::identity();
        for _ in 0..CORRECTIONS {
            grip.set_pose(Isometry3::from_parts(Vector3::zeros().into(), turn));
            let correction = grip.placement(&state.positions).1;
            turn = UnitQuaternion::from_scaled_axis(correction) * turn;
            if correction.norm() < SAME_TURN {
                break;
            }
        }
        let mean = grip.mean(&state.positions);
        let arm = Point3::from(grip.centre() - centre);
        let moved = mean - centre - (turn * arm).coords;
        if let (Some((axis, angle)), [first]) = (turn.axis_angle(), &mut grab.path[..]) {
            grab.turn_axis = axes.to_ras_direction(&axis).into();
            first.turn_deg = angle.to_degrees();
        }
        if let [first] = &mut grab.path[..] {
            first.move_m = axes.to_ras_direction(&moved).into();
        }
        Ok(())
    }

    /// Leads a tool from where its path ends straight to `pose` at the end of the next step; unlike
    /// [`set_tool_pose`](Self::set_tool_pose) it keeps the path so far.
    /// # Errors
    /// As [`set_tool_pose`](Self::set_tool_pose).
    pub fn extend_tool_path(&mut self, tool: usize, pose: Pose) -> Result<(), SimError> {
        let to = self.time_after(self.recorder.statistics.steps() + 1);
        pose.check(tool)?;
        path_of(&mut self.tools, tool)?.extend(to, pose);
        Ok(())
    }

    /// Has a tool let go in the next step, for good.
    /// # Errors
    /// [`SimError::NoSuchTool`] if there is none of that number.
    pub fn release_tool(&mut self, tool: usize) -> Result<(), SimError> {
        let now = self.time_after(self.recorder.statistics.steps());
        let count = self.tools.len();
        let missing = SimError::NoSuchTool { tool, reason: "is missing", count };
        self.tools.get_mut(tool).ok_or(missing)?.release(now);
        if let Some(course) = self.scene.tools.get_mut(tool).and_then(ToolEntry::course_mut) {
            *course.release_s = Some(now);
        }
        Ok(())
    }

    /// The scene of all steps so far: with the tools that were added, and those of the scene on the paths on which
    /// [`extend_tool_path`](Self::extend_tool_path) led them. A simulation of it is this one again, bit for bit.
    pub fn scene_as_led(&self) -> Scene {
        let mut scene = self.scene.clone();
        scene.time.steps = self.recorder.statistics.steps().max(1);
        // These steps were made without.
        scene.output.checkpoint_steps = 0;
        // By how far its tools were led `auto` might choose another law.
        let law = self.body.state.body.law().name();
        if scene.stages.law == AUTO && yawara_corot::LAWS.contains(&law) {
            scene.stages.law = law.into();
        }
        for (entry, tool) in scene.tools.iter_mut().zip(&self.tools) {
            let Some(Course { path, path_csv, .. }) = entry.course_mut() else { continue };
            if let Some(keys) = tool.path().map(|path| path.keys()).filter(|keys| !keys.is_empty())
            {
                (*path, *path_csv) = (keys.to_vec(), None);
            }
        }
        scene
    }

    /// The scene, with the tools that have come.
    #[cfg(feature = "view")]
    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Takes the outlines of the body and of labels out of the simulation, whose frames have none from then on.
    #[cfg(feature = "view")]
    pub(crate) fn take_outlines(&mut self) -> (Option<BodyOutline>, Option<Surfaces>) {
        (self.recorder.outline.take(), self.recorder.surfaces.take())
    }

    /// Binds the tools that begin before `to`, s, to the body as it is now.
    ///
    /// # Errors
    /// Those of what a tool holds.
    pub(super) fn take_hold(&mut self, to: f64) -> Result<(), SimError> {
        let (begin, later): (Coming, Coming) = std::mem::take(&mut self.coming)
            .into_iter()
            .partition(|(n, _)| self.tools[*n].acts_at(to));
        self.coming = later;
        for (number, hold) in begin {
            self.tools[number].follow(&self.body.state)?;
            if let Some(beginning) = &mut self.beginning {
                beginning.take(number, hold.as_ref());
            }
            if let Some(hold) = hold {
                hold_material(vec![(Some(number), hold)], &self.scene.name, &mut self.body.state)?;
            }
        }
        Ok(())
    }

    /// Tells all tools that have begun of a new mesh.
    pub(super) fn follow(&mut self) -> Result<(), SimError> {
        self.solver.jolt();
        let waits = |number: usize| self.coming.iter().any(|(of, _)| *of == number);
        for (number, tool) in self.tools.iter_mut().enumerate() {
            if !waits(number) {
                tool.follow(&self.body.state)?;
            }
        }
        Ok(())
    }
}
