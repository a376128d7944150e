//! The forces on tools and on the support at the last equilibrium.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::VertexId;

use super::contact::ContactState;
use super::equilibrium::StepSolver;
use crate::body::{BodyState, Hold, ScannerAxes};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::report::ToolReport;
use crate::tools::Tool;

/// A body and its tools at the last equilibrium.
pub(crate) struct ToolForces<'a> {
    pub state: &'a BodyState,
    pub solver: &'a StepSolver,
    pub contact: &'a ContactState,
    pub axes: ScannerAxes,
}

impl ToolForces<'_> {
    /// The report of every tool.
    pub fn reports(&self, tools: &[Box<dyn Tool>]) -> Vec<ToolReport> {
        tools.iter().enumerate().map(|(number, tool)| self.report(number, tool.as_ref())).collect()
    }

    fn report(&self, number: usize, tool: &dyn Tool) -> ToolReport {
        let (t, positions) = (self.solver.reached_s(), &self.state.positions);
        let reference = tool.reference(t);
        let obstacle = tool.obstacle(t);
        let (mut force, mut torque, mut contacts, penetration_m) =
            self.contact.of_tool(number, &reference, positions);
        let mut add = |at: &Vector3<f64>, f: &Vector3<f64>| {
            force += f;
            torque += (at - reference).cross(f);
            contacts += 1;
        };
        let held = self.held_by(|hold| hold == Hold::Grabbed(number));
        for (v, f) in held.iter().zip(self.solver.reaction(self.state, &held, t)) {
            add(&positions[v.index()], &f);
        }
        for (v, f) in self.solver.grips.of_tool(number, self.state) {
            add(&positions[v.index()], &f);
        }
        if tool.acts_at(t) {
            let mut loads = vec![Vector3::zeros(); positions.len()];
            tool.add_loads(self.state, t, &mut loads);
            for (v, f) in loads.iter().enumerate().filter(|(_, f)| f.norm_squared() > 0.0) {
                add(&positions[v], f);
            }
            if let (Some(points), None) = (tool.surface_points(), obstacle) {
                contacts = points.order().len();
            }
        }
        let grips = self.state.grip_tools.iter().zip(self.state.body.grips());
        let mine = grips.filter(|(of, _)| **of == Some(number));
        if let Some(points) = mine.map(|(_, grip)| grip.point_count()).reduce(|a, b| a + b) {
            contacts = points;
        }
        ToolReport {
            kind: tool.kind(),
            force_n: self.axes.to_ras_direction(&force).into(),
            force_error_n: None,
            work_j: 0.0,
            torque_n_m: self.axes.to_ras_direction(&torque).into(),
            reference_mm: self.axes.to_ras_mm(&reference).into(),
            contacts,
            penetration_m: if obstacle.is_some() { penetration_m } else { 0.0 },
            is_unilateral: obstacle.is_some(),
        }
    }

    /// How the force of a tool grows with its displacement, N/m, rows by scanner axis.
    pub fn stiffness(&self, tool: usize, inverse: &InverseLink) -> Result<[[f64; 3]; 3], SimError> {
        let mut stiffness = self.contact.stiffness(tool);
        let held = self.held_by(|hold| matches!(hold, Hold::Grabbed(_)));
        let held: Vec<usize> = held.into_iter().map(VertexId::index).collect();
        if !held.is_empty() {
            let inverse = inverse.constrained(&held)?.stiffness();
            let rotations = self.state.body.vertex_rotations();
            // Vertices that have come in since the last solve have none yet.
            let rotation = |v: usize| rotations.get(v).copied().unwrap_or_else(Matrix3::identity);
            let mine = |v: usize| self.state.holds[v] == Hold::Grabbed(tool);
            for (i, &v) in held.iter().enumerate().filter(|(_, v)| mine(**v)) {
                for (j, &w) in held.iter().enumerate().filter(|(_, w)| mine(**w)) {
                    let block = inverse.fixed_view::<3, 3>(3 * i, 3 * j);
                    stiffness += rotation(v) * block * rotation(w).transpose();
                }
            }
        }
        if self.state.grip_tools.contains(&Some(tool)) {
            let constrained = inverse.constrained(&held)?;
            stiffness += self.solver.grips.stiffness(tool, self.state, &constrained)?;
        }
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
            let local = self.axes.to_solver_direction(&axis);
            self.axes.to_ras_direction(&(stiffness * local))
        });
        Ok([0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (columns[j][i] + columns[i][j]))))
    }

    /// Σ (f_int − f_ext) over all fixed vertices, solver axes, N.
    pub fn support(&self) -> Vector3<f64> {
        let fixed = self.held_by(|hold| hold == Hold::Fixed);
        let reactions = self.solver.reaction(self.state, &fixed, self.solver.reached_s());
        let supports = self.solver.grips.of_supports(self.state);
        reactions.into_iter().chain(supports.into_iter().map(|(_, force)| force)).sum()
    }

    fn held_by(&self, is_held: impl Fn(Hold) -> bool) -> Vec<VertexId> {
        self.state.vertices().filter(|v| is_held(self.state.holds[v.index()])).collect()
    }
}
