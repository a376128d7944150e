//! Motion with inertia: what a step starts from and what it ends in.

use nalgebra::Vector3;
use yawara_corot::{
    ConstitutiveLaw, Inertia, InternalForces, TimeIntegrator, TimeStep, VertexMotion,
    forces_with_inertia,
};
use yawara_embed::{ElementFormulation, Mass, StepWeights, dynamic_by_name, formulation_by_name};

use super::span::Span;
use crate::body::{BodyState, Hold, ScannerAxes};
use crate::error::SimError;
use crate::report::Momentum;
use crate::scene::{MassModel, Scene};

/// The inertia of a body.
pub(crate) struct Motion {
    integrator: Box<dyn TimeIntegrator>,
    mass: Mass,
    step: TimeStep,
    axes: ScannerAxes,
    /// While a step is under way.
    under_way: Option<UnderWay>,
}

/// A step that has begun.
struct UnderWay {
    inertia: Inertia,
    /// The motion at its start by vertex number.
    from: Vec<VertexMotion>,
    /// Loads at its end by vertex number, N.
    loads: Vec<Vector3<f64>>,
    /// Loads at its end less all forces at its start, by vertex number, N.
    unbalanced: Vec<Vector3<f64>>,
}

impl Motion {
    /// Sets a body at rest in the motion that the scene starts with; none for a quasi-static scene.
    pub fn new(
        scene: &Scene,
        integrator: Box<dyn TimeIntegrator>,
        axes: &ScannerAxes,
        state: &mut BodyState,
    ) -> Option<Self> {
        let dynamics = scene.dynamics.as_ref()?;
        let step = TimeStep {
            length_s: scene.time.step_s,
            damping_mass_per_s: dynamics.damping_mass_per_s,
        };
        integrator.mass_per_s2(&step)?;
        let mass = match dynamics.mass {
            MassModel::Consistent => Mass::Consistent,
            MassModel::Lumped => Mass::Lumped,
        };
        let velocity = axes.to_solver_direction(&Vector3::from(dynamics.velocity_m_s));
        let spin = axes.to_solver_direction(&Vector3::from(dynamics.spin_rad_s));
        state.set_moving(velocity, spin);
        Some(Self { integrator, mass, step, axes: *axes, under_way: None })
    }

    /// The inertia of the step under way.
    pub fn inertia(&self) -> Option<&Inertia> {
        Some(&self.under_way.as_ref()?.inertia)
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
        let from: Vec<VertexMotion> = (0..state.positions.len())
            .map(|v| VertexMotion {
                position: state.positions[v],
                velocity: state.velocities[v],
                acceleration: state.accelerations[v],
            })
            .collect();
        let (integrator, start) = (&*self.integrator, from.iter().copied());
        let density = |tet| state.cell(tet).density_kg_m3;
        let inertia = Inertia::new(integrator, &self.step, self.mass, &state.body, start, density);
        let Some(inertia) = inertia else { return };
        let BodyState { body, positions, .. } = state;
        forces_with_inertia(forces, Some(&inertia), body, positions, internal);
        let unbalanced = loads.iter().zip(&*internal).map(|(l, f)| l - f).collect();
        self.under_way = Some(UnderWay { inertia, from, loads, unbalanced });
    }

    /// Ends a step: velocities, and accelerations if the integrator uses them, are those at its end.
    pub fn finish(&mut self, state: &mut BodyState) {
        let Some(UnderWay { from, .. }) = self.under_way.take() else { return };
        let keeps = self.integrator.uses_accelerations();
        for (v, from) in from.iter().enumerate() {
            let end = self.integrator.finish(&self.step, from, state.positions[v]);
            state.velocities[v] = end.velocity;
            if keeps {
                state.accelerations[v] = end.acceleration;
            }
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

    /// Moves the free vertices to where inertia alone would take them, unless they are closer to balance where they
    /// are: in a step that is long beside the body's oscillations inertia alone would tear it apart. Cost: one or two
    /// evaluations of internal forces.
    pub fn coast(
        &self,
        forces: &dyn InternalForces,
        state: &mut BodyState,
        internal: &mut [Vector3<f64>],
    ) {
        let Some(UnderWay { inertia, loads, unbalanced, .. }) = &self.under_way else { return };
        let free = |v: &usize| state.holds[*v] == Hold::Free;
        let free: Vec<usize> = (0..state.positions.len()).filter(free).collect();
        let stays = state.positions.clone();
        let BodyState { body, positions, .. } = state;
        free.iter().for_each(|v| positions[*v] = inertia.predicted()[*v]);
        forces_with_inertia(forces, Some(inertia), body, positions, internal);
        let missing = |v: &usize| (loads[*v] - internal[*v]).norm_squared();
        let after: f64 = free.iter().map(missing).sum();
        let before: f64 = free.iter().map(|v| unbalanced[*v].norm_squared()).sum();
        // A body torn apart may have forces that are no numbers.
        if !(after <= before) {
            *positions = stays;
            forces_with_inertia(forces, Some(inertia), body, positions, internal);
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
            let m = self.mass.matrix(kg);
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

/// The element of a scene's steps: with the mass that the integrator and the stiffness that the law
/// gives it.
/// # Errors
/// [`SimError::Embed`] for weights out of range.
pub(crate) fn formulation(
    scene: &Scene,
    element: &str,
    law: &dyn ConstitutiveLaw,
    motion: Option<&Motion>,
) -> Result<Box<dyn ElementFormulation>, SimError> {
    let stiffness = if law.is_linear() { 1.0 } else { law.stiffening(scene.time.step_s) };
    let mass_per_s2 = motion.and_then(|motion| motion.integrator.mass_per_s2(&motion.step));
    if mass_per_s2.is_none() && stiffness == 1.0 {
        return Ok(formulation_by_name(element)?);
    }
    let mass = motion.map_or_else(Mass::default, |motion| motion.mass);
    let weights = StepWeights::new(mass, mass_per_s2.unwrap_or(0.0), stiffness)?;
    Ok(dynamic_by_name(element, weights)?)
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
        let is_free = |v: &usize| self.holds[*v] == Hold::Free;
        let free: Vec<usize> = vertices.iter().copied().filter(is_free).collect();
        let mass: f64 = free.iter().map(|&v| self.masses[v]).sum();
        if mass > 0.0 {
            free.into_iter().for_each(|v| self.velocities[v] += lack / mass);
        }
    }
}
