//! Motion with inertia: what a step of implicit Euler starts from and what it ends in.

use nalgebra::Vector3;
use yawara_corot::{EulerStep, ImplicitEuler, InternalForces};
use yawara_embed::{EulerWeights, Mass};

use super::equilibrium::Span;
use super::simulation::Simulation;
use crate::body::{BodyState, Hold, ScannerAxes};
use crate::error::SimError;
use crate::report::Momentum;
use crate::scene::{Dynamics, MassModel, Scene};

/// The inertia of a body.
pub(crate) struct Motion {
    weights: EulerWeights,
    step_s: f64,
    /// While a step is under way.
    under_way: Option<UnderWay>,
}

/// A step whose end is being looked for.
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
        Ok(Some(Self { weights, step_s: scene.time.step_s, under_way: None }))
    }

    /// `corotation` with the inertia of the step under way.
    pub fn forces<'a>(&'a self, corotation: &'a dyn InternalForces) -> Option<ImplicitEuler<'a>> {
        Some(ImplicitEuler::new(corotation, &self.under_way.as_ref()?.euler))
    }
}

impl Simulation {
    /// Begins the step of a dynamic body where it stands.
    pub(crate) fn set_off(&mut self, step: Span) {
        if self.motion.is_none() {
            return;
        }
        self.evaluate_forces();
        let loads = self.weights(step.to);
        let Some(motion) = &mut self.motion else { return };
        let state = &self.state;
        let euler = EulerStep::new(
            motion.weights,
            motion.step_s,
            &state.body,
            &state.positions,
            &state.velocities,
            |tet| state.cell(tet).density_kg_m3,
        );
        // Forces at the start with the inertia of the step.
        let corotation = ImplicitEuler::new(&*self.corotation, &euler);
        corotation.internal_forces(&mut self.state.body, &self.state.positions, &mut self.internal);
        let unbalanced = loads.iter().zip(&self.internal).map(|(l, f)| l - f).collect();
        let from = self.state.positions.clone();
        motion.under_way = Some(UnderWay { euler, from, loads, unbalanced });
    }

    /// Ends the step of a dynamic body: its velocities are v' = (x' − x)/h.
    pub(crate) fn arrive(&mut self) {
        let Some(motion) = &mut self.motion else { return };
        let Some(UnderWay { from, .. }) = motion.under_way.take() else { return };
        let state = &mut self.state;
        for (v, from) in from.iter().enumerate() {
            state.velocities[v] = (state.positions[v] - from) / motion.step_s;
        }
    }

    /// What a part of a step is solved for: all of its loads at its end; before, of a dynamic body,
    /// so much less as it takes for the start to be in balance at the beginning. Time does not
    /// pass in parts, because inertia knows one length of a step.
    pub(crate) fn ease_in(&self, step: Span, t: f64, loads: &mut [Vector3<f64>]) {
        let Some(under_way) = self.motion.as_ref().and_then(|m| m.under_way.as_ref()) else {
            return;
        };
        let left = (step.to - t) / (step.to - step.from);
        let UnderWay { loads: full, unbalanced, .. } = under_way;
        for ((load, full), lack) in loads.iter_mut().zip(full).zip(unbalanced) {
            *load = full - left * lack;
        }
    }

    /// Moves the free vertices of a dynamic body to where they would go by themselves.
    pub(crate) fn coast(&mut self) {
        let Some(under_way) = self.motion.as_ref().and_then(|m| m.under_way.as_ref()) else {
            return;
        };
        for (v, x) in under_way.euler.coasting().iter().enumerate() {
            if self.state.holds[v] == Hold::Free {
                self.state.positions[v] = *x;
            }
        }
    }

    /// Mass, momentum and kinetic energy of a dynamic body; none for a quasi-static one.
    pub fn momentum(&self) -> Option<Momentum> {
        let motion = self.motion.as_ref()?;
        let (mut mass, mut first) = (0.0, Vector3::zeros());
        let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
        let mut kinetic = 0.0;
        for element in self.state.body.elements() {
            let kg = element.geometry.volume * self.state.cell(element.tet).density_kg_m3;
            let x = element.vertices.map(|v| self.state.positions[v]);
            let v = element.vertices.map(|v| self.state.velocities[v]);
            let m = motion.weights.mass.matrix(kg);
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
        let axes = self.axes();
        Some(Momentum {
            mass_kg: mass,
            centre_m: (axes.to_ras_mm(&centre) * 1e-3).into(),
            linear_n_s: axes.to_ras_direction(&linear).into(),
            angular_n_m_s: axes.to_ras_direction(&(angular - centre.cross(&linear))).into(),
            kinetic_j: kinetic,
        })
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
    pub fn momentum_of(&self, vertices: &[usize]) -> Vector3<f64> {
        vertices.iter().map(|&v| self.masses[v] * self.velocities[v]).sum()
    }

    /// Gives the free ones of `vertices` one velocity more in common, so that together they have
    /// the momentum `before` again: the mass of tetrahedra that came in their ring lies elsewhere,
    /// and a vertex that went has taken its velocity along.
    pub fn pass_on(&mut self, vertices: &[usize], before: Vector3<f64>) {
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
