//! Motion with inertia: what a step starts from and what it ends in.

use nalgebra::Vector3;
use yawara_corot::{
    ConstitutiveLaw, Inertia, TimeIntegrator, TimeStep, VertexMotion, forces_with_inertia,
};
use yawara_embed::{ElementFormulation, Mass, StepWeights, dynamic_by_name, formulation_by_name};

use super::equilibrium::Span;
use super::simulation::Simulation;
use crate::body::{BodyState, Hold, ScannerAxes};
use crate::error::SimError;
use crate::report::Momentum;
use crate::scene::{MassModel, Scene};

/// The inertia of a body.
pub(crate) struct Motion {
    integrator: Box<dyn TimeIntegrator>,
    mass: Mass,
    step: TimeStep,
    /// While a step is under way.
    under_way: Option<UnderWay>,
}

/// A step whose end is being looked for.
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
        integrator.weights(&step)?;
        let mass = match dynamics.mass {
            MassModel::Consistent => Mass::Consistent,
            MassModel::Lumped => Mass::Lumped,
        };
        let velocity = axes.to_solver_direction(&Vector3::from(dynamics.velocity_m_s));
        let spin = axes.to_solver_direction(&Vector3::from(dynamics.spin_rad_s));
        state.set_moving(velocity, spin);
        Some(Self { integrator, mass, step, under_way: None })
    }

    /// The inertia of the step under way.
    pub fn inertia(&self) -> Option<&Inertia> {
        Some(&self.under_way.as_ref()?.inertia)
    }
}

/// The element of a scene's steps: with the mass that the integrator and the stiffness that the law
/// gives it.
///
/// # Errors
/// [`SimError::Embed`] for weights out of range.
pub(crate) fn formulation(
    scene: &Scene,
    element: &str,
    law: &dyn ConstitutiveLaw,
    motion: Option<&Motion>,
) -> Result<Box<dyn ElementFormulation>, SimError> {
    let stiffness = if law.is_linear() { 1.0 } else { law.stiffening(scene.time.step_s) };
    let inertia = motion.and_then(|motion| motion.integrator.weights(&motion.step));
    if inertia.is_none() && stiffness == 1.0 {
        return Ok(formulation_by_name(element)?);
    }
    let mass = motion.map_or_else(Mass::default, |motion| motion.mass);
    let mass_per_s2 = inertia.map_or(0.0, |inertia| inertia.mass_per_s2);
    Ok(dynamic_by_name(element, StepWeights::new(mass, mass_per_s2, stiffness)?)?)
}

impl Simulation {
    /// Begins a step where the body stands.
    pub(crate) fn set_off(&mut self, step: Span) {
        self.state.body.begin_step(self.scene.time.step_s);
        if self.motion.is_none() {
            return;
        }
        self.evaluate_forces();
        let loads = self.weights(step.to);
        let Some(motion) = &mut self.motion else { return };
        let state = &self.state;
        let from: Vec<VertexMotion> = (0..state.positions.len())
            .map(|v| VertexMotion {
                position: state.positions[v],
                velocity: state.velocities[v],
                acceleration: state.accelerations[v],
            })
            .collect();
        let (integrator, start) = (&*motion.integrator, from.iter().copied());
        let density = |tet| state.cell(tet).density_kg_m3;
        let inertia =
            Inertia::new(integrator, &motion.step, motion.mass, &state.body, start, density);
        let Some(inertia) = inertia else { return };
        // Forces at the start with the inertia of the step.
        let Self { forces, internal, state: BodyState { body, positions, .. }, .. } = self;
        forces_with_inertia(&**forces, Some(&inertia), body, positions, internal);
        let unbalanced = loads.iter().zip(&*internal).map(|(l, f)| l - f).collect();
        motion.under_way = Some(UnderWay { inertia, from, loads, unbalanced });
    }

    /// Ends a step: the law keeps its states, a dynamic body its velocities.
    pub(crate) fn arrive(&mut self) {
        let state = &mut self.state;
        state.body.commit();
        let Some(motion) = &mut self.motion else { return };
        let Some(UnderWay { from, .. }) = motion.under_way.take() else { return };
        let keeps = motion.integrator.uses_accelerations();
        for (v, from) in from.iter().enumerate() {
            let end = motion.integrator.finish(&motion.step, from, state.positions[v]);
            state.velocities[v] = end.velocity;
            if keeps {
                state.accelerations[v] = end.acceleration;
            }
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
        for (v, x) in under_way.inertia.predicted().iter().enumerate() {
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
            let m = motion.mass.matrix(kg);
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
