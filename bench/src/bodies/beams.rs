//! Beams under large rotation, and how many iterations their equilibria take.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use nalgebra::{Rotation3, Vector3};
use yawara_corot::{Body, Equilibrium, InternalForces, Outcome, TangentOf, Tolerance};
use yawara_embed::{P1P1, isotropic};

use crate::bodies::solid::Solid;
use crate::bodies::statics::Statics;
use crate::error::Result;

/// Beam and load of an iteration count: 4 × 1 × 1 m, E 1 Pa, held at one end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeamLoad {
    /// The other end is turned by 90° along a circle's arc.
    Bend,
    /// The other end is turned by 180° about the beam's axis.
    Twist,
    /// The other end is pulled across by a dead force, P L²/(E I) = 3.
    TipForce,
}

/// All loads.
pub const BEAM_LOADS: [BeamLoad; 3] = [BeamLoad::Bend, BeamLoad::Twist, BeamLoad::TipForce];

/// Length of the beam; its section is a unit square.
const LENGTH: f64 = 4.0;

/// Cubes along the beam's edges.
const CELLS: [usize; 3] = [16, 4, 4];

impl BeamLoad {
    /// Where the far end is held at `part` (0 to 1) of the load.
    fn target(self, rest: &Vector3<f64>, part: f64) -> Vector3<f64> {
        match self {
            Self::Bend => bent(rest, part * PI / 2.0),
            Self::Twist => {
                let centre = Vector3::new(0.0, 0.5, 0.5);
                Rotation3::from_axis_angle(&Vector3::x_axis(), part * PI) * (rest - centre) + centre
            }
            Self::TipForce => *rest,
        }
    }
}

/// The cross-section at the beam's end after bending it about the y axis by `angle`.
fn bent(rest: &Vector3<f64>, angle: f64) -> Vector3<f64> {
    if angle == 0.0 {
        return *rest;
    }
    let radius = LENGTH / angle;
    let axis = Vector3::new(radius * angle.sin(), rest.y, 0.5 + radius * (1.0 - angle.cos()));
    axis + Vector3::new(-angle.sin(), 0.0, angle.cos()) * (rest.z - 0.5)
}

/// The beam on its way.
pub struct Beam {
    /// Its state.
    pub statics: Statics,
    load: BeamLoad,
    force: Vec<Vector3<f64>>,
}

/// How one step went.
#[derive(Clone, Copy, Debug)]
pub struct StepCount {
    /// Iterations to relative position errors of 10⁻³ and 10⁻⁶; those made if it never got there.
    pub iterations: [usize; 2],
    /// How the solver ended.
    pub outcome: Outcome,
}

impl Beam {
    /// The beam of 425 vertices at rest, with pressures beside displacements if `mixed` is there.
    /// # Errors
    /// `BenchError::Inverse` for a Poisson ratio that leaves no definite stiffness.
    pub fn new(load: BeamLoad, poisson_ratio: f64, mixed: Option<P1P1>) -> Result<Self> {
        let solid = Solid::block(CELLS, [LENGTH, 1.0, 1.0], isotropic(1.0, poisson_ratio));
        let near = |x: f64, to: f64| (x - to).abs() < 1e-9;
        let pulled = load == BeamLoad::TipForce;
        let held = |x: &Vector3<f64>| near(x.x, 0.0) || (!pulled && near(x.x, LENGTH));
        let statics = Statics::with_element(&solid, held, mixed)?;
        let total = 3.0 / (12.0 * LENGTH * LENGTH);
        let traction = Vector3::new(0.0, 0.0, if pulled { total } else { 0.0 });
        let force = solid.traction(|x| near(x.x, LENGTH), |_| traction);
        Ok(Self { statics, load, force })
    }

    /// Puts the load at `part` of its end value and solves to `residual`.
    pub fn step(
        &mut self,
        part: f64,
        corotation: &dyn InternalForces,
        equilibrium: &mut dyn Equilibrium,
        tolerance: &Tolerance,
    ) -> StepCount {
        let (load, rest) = (self.load, self.statics.rest.clone());
        let end =
            |v: usize| if rest[v].x < 0.5 * LENGTH { rest[v] } else { load.target(&rest[v], part) };
        self.statics.drag(corotation, end);
        let external: Vec<Vector3<f64>> = self.force.iter().map(|f| part * f).collect();
        let count = AtomicUsize::new(0);
        let recorded = Recorded { inner: corotation, count: &count, path: Mutex::default() };
        let outcome = self.statics.solve(&recorded, equilibrium, &external, tolerance, &|| {
            count.fetch_add(1, Relaxed);
        });
        let goal = &self.statics.positions;
        let distance = |x: &[Vector3<f64>]| {
            x.iter().zip(goal).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
        };
        let displacement = distance(&rest);
        let path = recorded.path.into_inner().unwrap_or_else(PoisonError::into_inner);
        let reached = |error: f64| {
            let there = path.iter().find(|(_, x)| distance(x) <= error * displacement);
            there.map_or(outcome.iterations, |(count, _)| *count)
        };
        StepCount { iterations: [reached(1e-3), reached(1e-6)], outcome }
    }

    /// All of the load in equal steps, each solved to a residual of 10⁻¹².
    pub fn all(
        mut self,
        steps: usize,
        corotation: &dyn InternalForces,
        equilibrium: &mut dyn Equilibrium,
    ) -> Vec<StepCount> {
        let tolerance = Tolerance::new(1e-12, 200);
        let part = |step: usize| step as f64 / steps as f64;
        (1..=steps).map(|step| self.step(part(step), corotation, equilibrium, &tolerance)).collect()
    }
}

/// Mean iterations to 10⁻³ and 10⁻⁶ over the steps.
pub fn mean_iterations(steps: &[StepCount]) -> [f64; 2] {
    [0, 1].map(|i| {
        steps.iter().map(|step| step.iterations[i] as f64).sum::<f64>() / steps.len() as f64
    })
}

/// A co-rotation that remembers where it was asked, after how many applications of the inverse.
struct Recorded<'a> {
    inner: &'a dyn InternalForces,
    count: &'a AtomicUsize,
    path: Mutex<Vec<(usize, Vec<Vector3<f64>>)>>,
}

impl InternalForces for Recorded<'_> {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let mut path = self.path.lock().unwrap_or_else(PoisonError::into_inner);
        path.push((self.count.load(Relaxed), positions.to_vec()));
        drop(path);
        self.inner.internal_forces(body, positions, forces)
    }

    fn tangent(&self) -> Option<TangentOf<'_>> {
        self.inner.tangent()
    }
}
