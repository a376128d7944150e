//! Figures of a run whose error is estimated by their duals: the scene's goal and forces of tools.

use nalgebra::Vector3;
use yawara_corot::{Loads, WeightedPoint};

use super::equilibrium::{Acting, StepSolver};
use super::indicator::Dual;
use crate::body::{BodyState, ScannerAxes};
use crate::error::SimError;
use crate::report::ToolReport;
use crate::scene::{GoalEntry, Scene};
use crate::tools::Tool;

/// A figure of a body in equilibrium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Figure {
    /// The size of a tool's force, N.
    Force(usize),
    /// The mean move of a grip's points in a direction (solver axes, unit length), m.
    Displacement(usize, Vector3<f64>),
    /// The volume of a grip's points, m³.
    Volume(usize),
}

impl Figure {
    /// That of a scene. `points` of its region become a grip of `state` that holds nothing.
    ///
    /// # Errors
    /// [`SimError::Value`] for a tool whose force is not felt by material, [`SimError::NoMaterial`] for a
    /// region without any.
    pub fn new(
        entry: &GoalEntry,
        points: Vec<WeightedPoint>,
        scene: &Scene,
        axes: &ScannerAxes,
        state: &mut BodyState,
        tools: &[Box<dyn Tool>],
    ) -> Result<Self, SimError> {
        if let GoalEntry::Force { tool } = *entry {
            if tool < tools.len() && is_felt(tool, state, tools, 0.0) {
                return Ok(Self::Force(tool));
            }
            let want = "the number of a probe or of a grab that holds material";
            return Err(SimError::value(&scene.name, "refinement.goal.tool", tool, want));
        }
        let found = state.grip(points, None);
        let (key, image) = ("refinement.goal.region".into(), scene.name.clone());
        let number = state.body.add_grip(found.ok_or(SimError::NoMaterial { key, image })?);
        state.grip_tools.push(None);
        match entry {
            GoalEntry::Displacement { direction, .. } => {
                let along = axes.to_solver_direction(&Vector3::from(*direction));
                Ok(Self::Displacement(number, along.normalize()))
            }
            _ => Ok(Self::Volume(number)),
        }
    }

    /// What it is called in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Force(_) => "force_n",
            Self::Displacement(..) => "displacement_m",
            Self::Volume(_) => "volume_m3",
        }
    }

    /// Its dual at the last equilibrium, at which tools feel `felt` (scanner axes).
    ///
    /// # Errors
    /// [`SimError::Inverse`] if the inverse fails.
    pub fn dual(
        self,
        solver: &StepSolver,
        acting: &mut Acting<'_>,
        felt: &[Vector3<f64>],
    ) -> Result<Dual, SimError> {
        let mut loads = Loads::default();
        let BodyState { body, positions, rest, .. } = &*acting.state;
        let (value, lead) = match self {
            Self::Force(tool) => {
                let force = felt[tool];
                let along = force.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                (force.norm(), Some((tool, along)))
            }
            Self::Displacement(number, along) => {
                let grip = &body.grips()[number];
                grip.add_shares(&along, &Vector3::zeros(), &mut loads);
                ((grip.mean(positions) - grip.mean(rest)).dot(&along), None)
            }
            Self::Volume(number) => (body.grips()[number].add_volume(positions, &mut loads), None),
        };
        solver.answer(value, lead, loads, acting)
    }
}

/// Whether a tool holds material or probes at time `t`, so that its force has a dual.
fn is_felt(tool: usize, state: &BodyState, tools: &[Box<dyn Tool>], t: f64) -> bool {
    state.grip_tools.contains(&Some(tool)) || tools[tool].obstacle(t).is_some()
}

/// The tools that act on the body at the last equilibrium.
fn acting_tools(solver: &StepSolver, acting: &Acting<'_>, felt: &[ToolReport]) -> Vec<usize> {
    let t = solver.reached_s();
    let acts = |tool: &usize| acting.tools[*tool].acts_at(t) && felt[*tool].force_n != [0.0; 3];
    (0..felt.len()).filter(acts).collect()
}

/// The tool that acts alone, whose force is off by as much as the energy is.
pub(crate) fn alone(
    solver: &StepSolver,
    acting: &Acting<'_>,
    felt: &[ToolReport],
) -> Option<usize> {
    match acting_tools(solver, acting, felt)[..] {
        [tool] if solver.is_left_to_tools() => Some(tool),
        _ => None,
    }
}

/// The figures that need a dual: the goal first, then the forces of tools that hold material or probe and do not
/// act alone. None of a body with inertia.
pub(crate) fn asked(
    goal: Option<Figure>,
    solver: &StepSolver,
    acting: &Acting<'_>,
    felt: &[ToolReport],
) -> Vec<Figure> {
    let beside_others = match alone(solver, acting, felt) {
        None if !acting.state.is_dynamic => acting_tools(solver, acting, felt),
        _ => Vec::new(),
    };
    let t = solver.reached_s();
    let felt =
        beside_others.into_iter().filter(|&tool| is_felt(tool, acting.state, acting.tools, t));
    let forces = felt.map(Figure::Force);
    goal.into_iter().chain(forces.filter(|force| Some(*force) != goal)).collect()
}
