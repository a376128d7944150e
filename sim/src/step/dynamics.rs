//! Motion with inertia: what a step of implicit Euler starts from and what it ends in.

use nalgebra::Vector3;
use yawara_corot::{EulerStep, ImplicitEuler, InternalForces};
use yawara_embed::{EulerWeights, Mass};

use super::span::Span;
use crate::body::{BodyState, Hold, ScannerAxes};
use crate::error::SimError;
use crate::report::Momentum;
use crate::scene::{Dynamics, MassModel, Scene};

/// The inertia of a body.
pub(crate) struct Motion {
    weights: EulerWeights,
    step_s: f64,
    axes: ScannerAxes,
    /// While a step is under way.
    under_way: Option<UnderWay>,
}

/// A step that has begun.
struct UnderWay {
    euler: EulerStep,
    /// Positions at its start.
    from: Vec<Vector3<f64>>,
    /// Loads at its end by vertex number, N.
    loads: Vec<Vector3<f64>>,
    /// Loads at its end less all forces at its start, by vertex number, N.
    unbalanced: Vec<Vector3<f64>>,
}

/// The weights of the scene's steps; none for a quasi-static scene.
///
/// # Errors
/// [`SimError::Embed`] for a step or a damping out of range.
pub(crate) fn weights(scene: &Scene) -> Result<Option<EulerWeights>, SimError> {
    let Some(dynamics) = &scene.dynamics else { return Ok(None) };
    let mass = match dynamics.mass {
        MassModel::Consistent => Mass::Consistent,
        MassModel::Lumped => Mass::Lumped,
    };
    let Dynamics { damping_mass_per_s: alpha, damping_stiffness_s: beta, .. } = *dynamics;
    Ok(Some(EulerWeights::new(mass, scene.time.step_s, alpha, beta)?))
}

impl Motion {
    /// Sets a body at rest in the motion that the scene starts with; none for a quasi-static scene.
    pub fn new(
        scene: &Scene,
        axes: &ScannerAxes,
        state: &mut BodyState,
    ) -> Result<Option<Self>, SimError> {
        let (Some(weights), Some(dynamics)) = (weights(scene)?, &scene.dynamics) else {
            return Ok(None);
        };
        let velocity = axes.to_solver_direction(&Vector3::from(dynamics.velocity_m_s));
        let spin = axes.to_solver_direction(&Vector3::from(dynamics.spin_rad_s));
        state.set_moving(velocity, spin);
        Ok(Some(Self { weights, step_s: scene.time.step_s, axes: *axes, under_way: None }))
    }

    /// `forces` with the inertia of the step under way.
    pub fn forces<'a>(&'a self, forces: &'a dyn InternalForces) -> Option<ImplicitEuler<'a>> {
        Some(ImplicitEuler::new(forces, &self.under_way.as_ref()?.euler))
    }

    /// Begins a step under `loads` at its end, by vertex number, N. `state` has the rotations of its
    /// positions; `internal` becomes the forces at the start with the inertia of the step.
    pub fn begin(
        &mut self,
        forces: &dyn InternalForces,
        state: &mut BodyState,
        loads: Vec<Vector3<f64>>,
        internal: &mut [Vector3<f64>],
    ) {
        let euler = EulerStep::new(
            self.weights,
            self.step_s,
            &state.body,
            &state.positions,
            &state.velocities,
            |tet| state.cell(tet).density_kg_m3,
        );
        let moving = ImplicitEuler::new(forces, &euler);
        moving.internal_forces(&mut state.body, &state.positions, internal);
        let unbalanced = loads.iter().zip(&*internal).map(|(l, f)| l - f).collect();
        let from = state.positions.clone();
        self.under_way = Some(UnderWay { euler, from, loads, unbalanced });
    }

    /// Ends a step: the velocities are v' = (x' − x)/h.
    pub fn finish(&mut self, state: &mut BodyState) {
        let Some(UnderWay { from, .. }) = self.under_way.take() else { return };
        for (v, from) in from.iter().enumerate() {
            state.velocities[v] = (state.positions[v] - from) / self.step_s;
        }
    }

    /// Sets the loads of a part of `step` that ends at `t`: all of them at the end of the step,
    /// and before so much less that its start is in balance. Inertia knows one length of a step, so
    /// halves of it are halves of the loads and not of the time.
    pub fn ease_in(&self, step: Span, t: f64, loads: &mut [Vector3<f64>]) {
        let Some(UnderWay { loads: full, unbalanced, .. }) = &self.under_way else { return };
        let left = step.left_at(t);
        for ((load, full), lack) in loads.iter_mut().zip(full).zip(unbalanced) {
            *load = full - left * lack;
        }
    }

    /// Moves the free vertices to where inertia alone would take them.
    pub fn coast(&self, state: &mut BodyState) {
        let Some(under_way) = &self.under_way else { return };
        for (v, x) in under_way.euler.coasting().iter().enumerate() {
            if state.holds[v] == Hold::Free {
                state.positions[v] = *x;
            }
        }
    }

    /// Mass, momentum and kinetic energy, scanner axes.
    pub fn momentum(&self, state: &BodyState) -> Momentum {
        let (mut mass, mut first) = (0.0, Vector3::zeros());
        let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
        let mut kinetic = 0.0;
        for element in state.body.elements() {
            let kg = element.geometry.volume * state.cell(element.tet).density_kg_m3;
            let x = element.vertices.map(|v| state.positions[v]);
            let v = element.vertices.map(|v| state.velocities[v]);
            let m = self.weights.mass.matrix(kg);
            for i in 0..4 {
                let p: Vector3<f64> = (0..4).map(|j| m[(i, j)] * v[j]).sum();
                linear += p;
                angular += x[i].cross(&p);
                kinetic += 0.5 * p.dot(&v[i]);
                first += 0.25 * kg * x[i];
            }
            mass += kg;
        }
        let centre = first / mass;
        let axes = self.axes;
        Momentum {
            mass_kg: mass,
            centre_m: (axes.to_ras_mm(&centre) * 1e-3).into(),
            linear_n_s: axes.to_ras_direction(&linear).into(),
            angular_n_m_s: axes.to_ras_direction(&(angular - centre.cross(&linear))).into(),
            kinetic_j: kinetic,
        }
    }
}

impl BodyState {
    /// Makes the body a dynamic one: free vertices get `velocity` and `spin` about the centre of
    /// mass, all others none.
    fn set_moving(&mut self, velocity: Vector3<f64>, spin: Vector3<f64>) {
        self.is_dynamic = true;
        let masses = self.masses.iter().zip(&self.positions);
        let first: Vector3<f64> = masses.map(|(m, x)| *m * x).sum();
        let centre = first / self.masses.iter().sum::<f64>();
        for v in 0..self.velocities.len() {
            if self.holds[v] == Hold::Free {
                self.velocities[v] = velocity + spin.cross(&(self.positions[v] - centre));
            }
        }
    }

    /// Σ m v over vertices, N s; with either mass the momentum that they carry.
    pub(super) fn momentum_of(&self, vertices: &[usize]) -> Vector3<f64> {
        vertices.iter().map(|&v| self.masses[v] * self.velocities[v]).sum()
    }

    /// Gives the free ones of `vertices` one velocity more in common, so that together they have
    /// the momentum `before` again: the mass of tetrahedra that came in their ring lies elsewhere,
    /// and a vertex that went has taken its velocity along.
    pub(super) fn pass_on(&mut self, vertices: &[usize], before: Vector3<f64>) {
        let lack = before - self.momentum_of(vertices);
        let free = |v: &&usize| self.holds[**v] == Hold::Free;
        let mass: f64 = vertices.iter().filter(free).map(|&v| self.masses[v]).sum();
        if !(mass > 0.0) {
            return;
        }
        for &v in vertices {
            if self.holds[v] == Hold::Free {
                self.velocities[v] += lack / mass;
            }
        }
    }
}
