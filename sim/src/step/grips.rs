//! What tools and supports hold of the material, in a step.

use std::sync::Arc;

use nalgebra::{DVector, Matrix3, Point3, Vector3};
use yawara_corot::{Constraints, Loads, Responses};
use yawara_mesh::VertexId;

use super::checkpoint::{KeptForces, KeptGrips, Numbers};
use crate::body::BodyState;
use crate::error::SimError;
use crate::inverse::{Constrained, Elements, InverseLink};
use crate::tools::Tool;

/// Forces on vertices, N.
type Forces = Vec<(VertexId, Vector3<f64>)>;

/// The constraints of tools that hold the mean of their material, and their forces.
#[derive(Default)]
pub(crate) struct Grips {
    /// The grips, by number, that constraints hold, with the first of their rows.
    held: Vec<(usize, usize)>,
    /// Those that have let go.
    free: Vec<usize>,
    /// The forces at the last equilibrium of each of `held`.
    forces: Vec<Forces>,
    constraints: Constraints,
    answer: Option<Answer>,
}

/// What the body answers to the constraints, until the mesh or what is held changes.
struct Answer {
    updates: usize,
    vertices: Vec<usize>,
    grips: Vec<usize>,
    responses: Arc<Responses>,
}

impl Grips {
    /// What is held and what has let go.
    pub fn kept(&self, numbers: &Numbers) -> KeptGrips {
        let kept = |forces: &Forces| numbers.forces(forces.iter().map(|(v, f)| (v.index(), f)));
        let forces = self.forces.iter().map(kept).collect();
        KeptGrips { held: self.held.clone(), forces, free: self.free.clone() }
    }

    /// Of what was kept; answers and constraints come with the next equilibrium. What has let go lets go of `state`.
    pub fn resumed(kept: &KeptGrips, state: &mut BodyState) -> Self {
        let forces = |kept: &KeptForces| {
            kept.iter().map(|(v, f)| (VertexId(*v as u32), Vector3::from(*f))).collect()
        };
        for &number in &kept.free {
            state.body.grips_mut()[number].release();
        }
        Self {
            held: kept.held.clone(),
            free: kept.free.clone(),
            forces: kept.forces.iter().map(forces).collect(),
            ..Self::default()
        }
    }

    /// Leads all grips to where their tools have them at time `t`; the constraints of those that
    /// hold a mean.
    ///
    /// # Errors
    /// Those of a solve with `constrained`, the inverse with the vertices of `held` fixed.
    pub fn lead(
        &mut self,
        t: f64,
        state: &mut BodyState,
        inverse: &InverseLink,
        tools: &[Box<dyn Tool>],
        constrained: &Constrained<'_>,
    ) -> Result<Option<Constraints>, SimError> {
        let (mut constraints, mut at_rest) = (Constraints::default(), Constraints::default());
        self.held.clear();
        for number in 0..state.grip_tools.len() {
            let grip = &mut state.body.grips_mut()[number];
            let Some(tool) = state.grip_tools[number] else { continue };
            grip.set_pose(tools[tool].pose(t));
            if grip.stiffness().is_none() && !self.free.contains(&number) {
                self.held.push((number, constraints.len()));
                constraints.extend(grip.constraints());
                at_rest.extend(grip.constraints_at_rest());
            }
        }
        if self.held.is_empty() {
            return Ok(None);
        }
        let grips: Vec<usize> = self.held.iter().map(|held| held.0).collect();
        let is_current = |answer: &&Answer| {
            let Answer { updates, vertices, grips: of, .. } = answer;
            *updates == inverse.updates && *vertices == constrained.slots() && *of == grips
        };
        if self.answer.as_ref().filter(is_current).is_none() {
            let m = state.body.unknowns_per_vertex();
            let rows = m * state.positions.len();
            let responses = at_rest.answer(m, rows, |f, y| constrained.precondition(f, y))?;
            let responses = Arc::new(responses);
            let (updates, vertices) = (inverse.updates, constrained.slots().to_vec());
            self.answer = Some(Answer { updates, vertices, grips, responses });
        }
        if let Some(Answer { responses, .. }) = &self.answer {
            self.constraints = constraints.with_responses(Arc::clone(responses));
        }
        Ok(Some(self.constraints.clone()))
    }

    /// Notes the forces of tools in an equilibrium that leaves the residual f_ext − f_int without
    /// them, by vertex number, N.
    pub fn note_forces(
        &mut self,
        left: impl Fn(usize) -> Vector3<f64>,
        free: &[bool],
        state: &BodyState,
    ) {
        if self.held.is_empty() {
            self.forces.clear();
            return;
        }
        let m = state.body.unknowns_per_vertex();
        let mut residual = vec![0.0; m * free.len()];
        for v in (0..free.len()).filter(|&v| free[v]) {
            residual[m * v..m * v + 3].copy_from_slice(left(v).as_slice());
        }
        self.forces = self.by_grip(self.constraints.forces(&state.body, &residual));
    }

    /// The forces of constraints by the grip that they are of.
    fn by_grip(&self, rows: Vec<Vec<(usize, Vector3<f64>)>>) -> Vec<Forces> {
        let mut rows = rows.into_iter();
        let firsts = self.held.iter().map(|held| held.1).chain([self.constraints.len()]);
        let firsts: Vec<usize> = firsts.collect();
        let of = |ends: &[usize]| {
            let forces = rows.by_ref().take(ends[1] - ends[0]).flatten();
            forces.map(|(v, f)| (VertexId(v as u32), f)).collect()
        };
        firsts.windows(2).map(of).collect()
    }

    /// The constraints of the last equilibrium, if there are any.
    pub fn constraints(&self) -> Option<&Constraints> {
        (!self.held.is_empty()).then_some(&self.constraints)
    }

    /// By how much the targets of the constraints change where a tool moves by `lead`, m.
    pub fn leads(&self, tool: usize, lead: &Vector3<f64>, state: &BodyState) -> DVector<f64> {
        let mut leads = DVector::zeros(self.constraints.len());
        for (number, first) in &self.held {
            if state.grip_tools[*number] == Some(tool) {
                leads.fixed_rows_mut::<3>(*first).copy_from(lead);
            }
        }
        leads
    }

    /// Adds by how much the pads of a tool that moves by `lead` (m) pull more to `forces`, by vertex
    /// number, N.
    pub fn add_pads(
        &self,
        tool: usize,
        lead: &Vector3<f64>,
        state: &BodyState,
        forces: &mut [Vector3<f64>],
    ) {
        for (grip, of) in state.body.grips().iter().zip(&state.grip_tools) {
            let Some(stiffness) = grip.stiffness().filter(|_| *of == Some(tool)) else { continue };
            let whole = stiffness * grip.weight();
            grip.mean_weights().iter().for_each(|(v, weight)| forces[*v] += whole * weight * lead);
        }
    }

    /// Adds to `loads` by how much grips do something else to the body where it moves by `moves` (by vertex
    /// number) and the tool of `lead` by that, m, while constraints take the forces of `rows`.
    pub fn add_changes(
        &self,
        moves: &[Vector3<f64>],
        lead: Option<(usize, Vector3<f64>)>,
        rows: Vec<Vec<(usize, Vector3<f64>)>>,
        state: &BodyState,
        loads: &mut Loads,
    ) {
        for (grip, tool) in state.body.grips().iter().zip(&state.grip_tools) {
            let mine = lead.filter(|lead| *tool == Some(lead.0));
            grip.add_change(moves, &mine.map_or_else(Vector3::zeros, |lead| lead.1), loads);
        }
        self.share(&self.by_grip(rows), state, loads);
    }

    /// The forces of a tool on the body at the last equilibrium, N.
    pub fn of_tool(&self, tool: usize, state: &BodyState) -> Forces {
        let is_mine = |number: usize| state.grip_tools[number] == Some(tool);
        let means = self.held.iter().zip(&self.forces).filter(|(held, _)| is_mine(held.0));
        let mut forces: Forces = means.flat_map(|(_, forces)| forces.clone()).collect();
        let pads = (0..state.grip_tools.len()).filter(|&number| is_mine(number));
        pads.for_each(|number| forces.extend(pull(number, state)));
        forces
    }

    /// What grips do to the body at the last equilibrium.
    pub fn loads(&self, state: &BodyState) -> Loads {
        let mut loads = Loads::default();
        for grip in state.body.grips() {
            grip.add_loads(&state.positions, &mut loads);
        }
        self.share(&self.forces, state, &mut loads);
        loads
    }

    /// Adds the forces of tools that hold means to `forces`, N by vertex number.
    pub fn add_means(&self, state: &BodyState, forces: &mut [Vector3<f64>]) {
        let mut loads = Loads::default();
        self.share(&self.forces, state, &mut loads);
        forces.iter_mut().zip(loads.vertices()).for_each(|(force, more)| *force += more);
    }

    /// Adds forces of constraints, by grip, to `loads`, shared among the points of each.
    fn share(&self, forces: &[Forces], state: &BodyState, loads: &mut Loads) {
        for ((number, _), forces) in self.held.iter().zip(forces) {
            let grip = &state.body.grips()[*number];
            let centre = grip.pose() * Point3::from(grip.centre());
            let force: Vector3<f64> = forces.iter().map(|(_, f)| f).sum();
            let arm = |v: &VertexId| state.positions[v.index()] - centre.coords;
            let torque: Vector3<f64> = forces.iter().map(|(v, f)| arm(v).cross(f)).sum();
            grip.add_shares(&force, &torque, loads);
        }
    }

    /// The forces of all supports on the body, N.
    pub fn of_supports(&self, state: &BodyState) -> Forces {
        let supports = (0..state.grip_tools.len()).filter(|&i| state.grip_tools[i].is_none());
        supports.flat_map(|number| pull(number, state)).collect()
    }

    /// How the force of a tool grows with its displacement while it does not turn, and what it
    /// holds moves with it, N/m.
    ///
    /// A mean's is (G Ĉ Gᵀ)⁻¹, a pad's κW I − A Ĉ Aᵀ with A = κ Σ w λ_v of its vertices.
    /// # Errors
    /// Those of three solves with `constrained`.
    pub fn stiffness(
        &self,
        tool: usize,
        state: &BodyState,
        constrained: &Constrained<'_>,
    ) -> Result<Matrix3<f64>, SimError> {
        let mut stiffness = Matrix3::zeros();
        for number in (0..state.grip_tools.len()).filter(|&i| state.grip_tools[i] == Some(tool)) {
            if let Some((_, first)) = self.held.iter().find(|held| held.0 == number) {
                stiffness += self.constraints.stiffness(&state.body, *first);
            }
            let grip = &state.body.grips()[number];
            let Some(by_weight) = grip.stiffness() else { continue };
            let whole = by_weight * grip.weight();
            let m = state.body.unknowns_per_vertex();
            let turns = state.body.vertex_rotations();
            let weights = grip.mean_weights();
            for axis in 0..3 {
                let mut force = vec![0.0; m * state.positions.len()];
                let mut answer = force.clone();
                for (v, weight) in &weights {
                    let local = whole * weight * turns[*v].row(axis).transpose();
                    force[m * v..m * v + 3].copy_from_slice(local.as_slice());
                }
                constrained.apply(&force, &mut answer)?;
                let mut column = whole * Vector3::ith(axis, 1.0);
                for (v, weight) in &weights {
                    let local = Vector3::from_column_slice(&answer[m * v..m * v + 3]);
                    column -= whole * *weight * turns[*v] * local;
                }
                stiffness.set_column(axis, &(stiffness.column(axis) + column));
            }
        }
        Ok(stiffness)
    }

    /// Lets go what tools no longer hold at time `t`, and calls `fade` with the forces that they had.
    ///
    /// # Errors
    /// [`SimError::Inverse`] if the inverse refuses to lose the stiffness of a pad.
    pub fn let_go(
        &mut self,
        t: f64,
        state: &mut BodyState,
        inverse: &mut InverseLink,
        tools: &[Box<dyn Tool>],
        mut fade: impl FnMut((VertexId, Vector3<f64>)),
    ) -> Result<(), SimError> {
        for number in 0..state.grip_tools.len() {
            let Some(tool) = state.grip_tools[number].filter(|&tool| !tools[tool].acts_at(t))
            else {
                continue;
            };
            if self.free.contains(&number) {
                continue;
            }
            self.of_tool(tool, state).into_iter().for_each(&mut fade);
            self.free.push(number);
            if let Some(at) = self.held.iter().position(|held| held.0 == number) {
                self.held.remove(at);
                // Without an equilibrium so far there are none.
                if at < self.forces.len() {
                    self.forces.remove(at);
                }
            }
            let springs = state.body.grips_mut()[number].release();
            let elements = Elements { body: &state.body, density: &|tet| state.density(tet) };
            inverse.remove_springs(&springs, &elements)?;
        }
        Ok(())
    }
}

/// The forces of an elastic grip on the body where it is, N.
fn pull(number: usize, state: &BodyState) -> Forces {
    let mut forces = Vec::new();
    let grip = &state.body.grips()[number];
    grip.each_force(&state.positions, |v, force| forces.push((VertexId(v as u32), force)));
    forces
}
