//! What tools feel, and where they are led.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::VertexId;

use super::simulation::Simulation;
use crate::body::Hold;
use crate::error::SimError;
use crate::report::ToolReport;
use crate::scene::checks::FARTHEST_M;
use crate::tools::Pose;

impl Simulation {
    /// Leads a tool from where it is to `pose` over the next step, in place of its path; it stays
    /// there until it is led elsewhere. Results are those of a path with the same poses.
    ///
    /// # Errors
    /// [`SimError::NoSuchTool`] if there is none of that number or it does not move (a pressure);
    /// [`SimError::Pose`] for values that are not finite or farther than 1000 m. Nothing has
    /// changed then.
    pub fn set_tool_pose(&mut self, tool: usize, pose: Pose) -> Result<(), SimError> {
        let (count, now) = (self.tools.len(), self.reached_s);
        let end = self.step_end();
        let refused = |reason| SimError::NoSuchTool { tool, reason, count };
        let far = pose.move_m.iter().find(|x| !(x.abs() <= FARTHEST_M));
        if let Some(&value) = far {
            return Err(SimError::Pose { tool, value, want: "at most 1000 m in each axis" });
        }
        if !pose.turn_deg.is_finite() {
            let value = pose.turn_deg;
            return Err(SimError::Pose { tool, value, want: "a finite turn" });
        }
        let tool = self.tools.get_mut(tool).ok_or_else(|| refused("is missing"))?;
        let path = tool.path_mut().ok_or_else(|| refused("does not move"))?;
        path.lead(now, end, pose);
        Ok(())
    }

    /// Where a tool is asked to be at time `t`, s: its path, or where it was last led.
    ///
    /// # Errors
    /// As [`set_tool_pose`](Self::set_tool_pose).
    pub fn tool_pose(&mut self, tool: usize, t: f64) -> Result<Pose, SimError> {
        let count = self.tools.len();
        let refused = |reason| SimError::NoSuchTool { tool, reason, count };
        let tool = self.tools.get_mut(tool).ok_or_else(|| refused("is missing"))?;
        Ok(tool.path_mut().ok_or_else(|| refused("does not move"))?.pose(t))
    }

    /// How the force of a tool on the body grows with its displacement while what it holds or
    /// pushes stays the same: the inverse of the 3 × 3 compliance that it feels, rows by scanner
    /// axis, N/m, symmetric positive semi-definite. Zero without contact, and for a pressure.
    ///
    /// Grab: Σ_ij (C_pp⁻¹)_ij over the held vertices; probe: N (N Ĉ Nᵀ)⁻¹ Nᵀ over the points it
    /// pushes, N their normals. Ĉ = T C Tᵀ of the last equilibrium. Cost: a block of compliance at
    /// what is held, unless nothing has changed since, and O(k³) for its k columns.
    /// # Errors
    /// [`SimError::NoSuchTool`], [`SimError::Inverse`].
    pub fn tool_stiffness(&self, tool: usize) -> Result<[[f64; 3]; 3], SimError> {
        let count = self.tools.len();
        if tool >= count {
            return Err(SimError::NoSuchTool { tool, reason: "is missing", count });
        }
        let mut stiffness = self.contact.stiffness(tool);
        let held = |v: &VertexId| matches!(self.state.holds[v.index()], Hold::Grabbed(_));
        let held: Vec<usize> = self.state.vertices().filter(held).map(VertexId::index).collect();
        if !held.is_empty() {
            let inverse = self.inverse.constrained(&held)?.stiffness();
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
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
            let local = self.axes.to_solver_direction(&axis);
            self.axes.to_ras_direction(&(stiffness * local))
        });
        Ok([0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (columns[j][i] + columns[i][j]))))
    }

    /// Σ (f_int − f_ext) over all fixed vertices at the last equilibrium: the force of the support
    /// on the body in scanner axes, N. With the tools' forces and the weight it sums up to nothing.
    pub fn support_force(&self) -> [f64; 3] {
        self.axes.to_ras_direction(&self.support).into()
    }

    /// The same now, before the mesh changes, solver axes.
    pub(crate) fn measured_support(&self) -> Vector3<f64> {
        let fixed = |v: &VertexId| self.state.holds[v.index()] == Hold::Fixed;
        let vertices: Vec<VertexId> = self.state.vertices().filter(fixed).collect();
        self.reaction(&vertices, self.reached_s).iter().sum()
    }

    fn held_by(&self, tool: usize) -> impl Iterator<Item = VertexId> + '_ {
        let is_held = move |v: &VertexId| self.state.holds[v.index()] == Hold::Grabbed(tool);
        self.state.vertices().filter(is_held)
    }

    /// What every tool feels at the last equilibrium.
    pub(crate) fn tool_reports(&self) -> Vec<ToolReport> {
        (0..self.tools.len()).map(|tool| self.tool_report(tool)).collect()
    }

    fn tool_report(&self, number: usize) -> ToolReport {
        let (t, positions) = (self.reached_s, &self.state.positions);
        let tool = self.tools[number].as_ref();
        let reference = tool.reference(t);
        let (mut force, mut torque, mut contacts, penetration_m) =
            self.contact.of_tool(number, &reference, positions);
        let mut add = |at: &Vector3<f64>, f: &Vector3<f64>| {
            force += f;
            torque += (at - reference).cross(f);
            contacts += 1;
        };
        let held: Vec<VertexId> = self.held_by(number).collect();
        for (v, f) in held.iter().zip(self.reaction(&held, t)) {
            add(&positions[v.index()], &f);
        }
        let mut loads = vec![Vector3::zeros(); if tool.loads() { positions.len() } else { 0 }];
        tool.add_loads(&self.state, t, &mut loads);
        for (v, f) in loads.iter().enumerate().filter(|(_, f)| f.norm_squared() > 0.0) {
            add(&positions[v], f);
        }
        if tool.loads() {
            contacts = tool.surface_points().map_or(0, |skin| skin.order().len());
        }
        ToolReport {
            kind: tool.kind(),
            force_n: self.axes.to_ras_direction(&force).into(),
            torque_n_m: self.axes.to_ras_direction(&torque).into(),
            reference_mm: self.axes.to_ras_mm(&reference).into(),
            contacts,
            penetration_m: if tool.obstacle(t).is_some() { penetration_m } else { 0.0 },
        }
    }
}
