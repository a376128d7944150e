//! The beam as a scene: at rest, and let go.

use nalgebra::Vector3;
use yawara::identify::{Measured, Measurement, Options, identify};
use yawara::scene::{Image, LawEntry, PronyEntry, RelaxingPart, Scene};
use yawara::{Simulation, scene_file};
use yawara_corot::{ElementPoint, locate};
use yawara_mesh::volume::{Grid, LabelVolume};

use super::ladder::Ladder;
use super::recording::Recording;
use crate::error::{BenchError, Result};

/// Voxels of 5 mm along each axis: 100 × 30 × 30 mm.
const DIMS: [usize; 3] = [20, 6, 6];
const VOXEL_MM: f64 = 5.0;

/// Where the marker is at rest, off the lowest corner of the clamp's face, m: its stalk stands off the side, which
/// moves as the middle does.
const MARKER_M: [f64; 3] = [0.1, 0.015, 0.024];

const DENSITY_KG_M3: f64 = 1070.0;
const GRAVITY_M_S2: f64 = 9.81;

/// Length of a step of a swing, s: a hundredth of the faster period, whose error is then a thousandth.
const STEP_S: f64 = 0.002;

/// How many steps there are to a sample.
const SAMPLED: usize = 5;

/// What resists motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Damping {
    /// Nothing.
    None,
    /// A ladder of relaxation times.
    Prony(Ladder),
    /// Damping proportional to stiffness, s.
    Rayleigh(f64),
}

/// The beam on one mesh.
#[derive(Clone, Debug)]
pub struct Beam {
    /// After a long time, Pa.
    pub young_modulus_pa: f64,
    pub poisson_ratio: f64,
    /// Of the uniform mesh; three halve its edges, which are 10 mm at level 0.
    pub level: u8,
    /// Hung from the upper edge of the tip, N.
    pub load_n: f64,
}

impl Beam {
    /// Its scene: a weight is as heavy material along the tip's upper edge, so that it has inertia too.
    fn scene(&self) -> Result<(Scene, LabelVolume)> {
        let places =
            (0..DIMS.iter().product()).map(|i: usize| [i % DIMS[0], i / DIMS[0] / DIMS[1]]);
        let is_weight =
            |[x, z]: [usize; 2]| self.load_n > 0.0 && x + 1 == DIMS[0] && z + 1 == DIMS[2];
        let labels = places.map(|place| if is_weight(place) { 2 } else { 1 });
        let volume = LabelVolume::from_original(Grid::centred(DIMS, VOXEL_MM), labels)?;
        let set = [
            "mesh={ base_mm = 10.0, max_vertices = 1000000 }".into(),
            format!("mesh.start_level={}", self.level),
            "tools=[]".into(),
            "support.hold=vertices".into(),
            format!("gravity_m_s2=[0.0, 0.0, -{GRAVITY_M_S2}]"),
            "time={ steps = 4, step_s = 1.0 }".into(),
            format!("materials.0.young_modulus_pa={:e}", self.young_modulus_pa),
            format!("materials.0.poisson_ratio={}", self.poisson_ratio),
            format!("materials.0.density_kg_m3={DENSITY_KG_M3}"),
        ];
        let (mut scene, _) = scene_file::load("beam", &set)?;
        scene.image = Image::default();
        if self.load_n > 0.0 {
            let voxels = DIMS[1] as f64 * (VOXEL_MM * 1e-3).powi(3);
            let mut weight = scene.materials[0].clone();
            weight.label = Some(2);
            weight.density_kg_m3 += self.load_n / GRAVITY_M_S2 / voxels;
            scene.materials.push(weight);
        }
        Ok((scene, volume))
    }

    /// With the modulus with which the bare beam's marker drops as far as measured, and the standard deviation of its
    /// logarithm, where that of the drop is known, mm.
    /// # Errors
    /// [`BenchError::Sim`].
    pub fn fitted(mut self, drop_mm: f64, sd_mm: f64) -> Result<(Self, f64)> {
        let (scene, volume) = self.scene()?;
        let low = DIMS.map(|cells| -0.5 * cells as f64 * VOXEL_MM);
        let rest_mm = [0, 1, 2].map(|axis| low[axis] + 1e3 * MARKER_M[axis]);
        let measured = Measurement {
            time_s: scene.time.step_s * scene.time.steps as f64,
            of: Measured::Move(rest_mm),
            values: [None, None, Some(-drop_mm)],
            sd: Some(sd_mm),
            place: "the bare beam".into(),
        };
        let found =
            identify(&scene, Some(&volume), &[measured], &Options::default(), &mut |_, _| {})?;
        let modulus = &found.moduli[0];
        self.young_modulus_pa = modulus.young_modulus_pa;
        Ok((self, modulus.relative_sd))
    }

    /// How far the marker drops until the beam rests, mm.
    /// # Errors
    /// [`BenchError::Sim`]; [`BenchError::NotConverged`].
    pub fn drop_mm(&self) -> Result<f64> {
        let (scene, volume) = self.scene()?;
        let mut run = Run::new(&scene, volume)?;
        while run.simulation.steps_left() > 0 {
            run.step("rest")?;
        }
        Ok(-run.height_mm())
    }

    /// How high the marker is over `seconds` after the beam is let go where it is straight.
    /// # Errors
    /// As [`drop_mm`](Self::drop_mm).
    pub fn swing(&self, damping: &Damping, seconds: f64) -> Result<Recording> {
        let (mut scene, volume) = self.scene()?;
        scene.dynamics = Some(yawara::scene::Dynamics::default());
        scene.stages.integrator = "newmark".into();
        scene.time.step_s = STEP_S;
        scene.time.steps = (seconds / STEP_S).round() as usize;
        match damping {
            Damping::None => {}
            Damping::Rayleigh(beta_s) => {
                if let Some(dynamics) = &mut scene.dynamics {
                    dynamics.damping_stiffness_s = *beta_s;
                }
            }
            Damping::Prony(Ladder { stiffer, terms, .. }) => {
                let terms = terms.iter();
                let terms =
                    terms.map(|term| PronyEntry { fraction: term.fraction, time_s: term.time_s });
                let law = LawEntry::Prony {
                    terms: terms.collect(),
                    power_law: None,
                    relaxing: RelaxingPart::Whole,
                };
                for material in &mut scene.materials {
                    material.young_modulus_pa *= stiffer;
                    material.law = Some(law.clone());
                }
            }
        }
        let mut run = Run::new(&scene, volume)?;
        let mut heights_mm = vec![0.0];
        while run.simulation.steps_left() > 0 {
            run.step("swing")?;
            heights_mm.push(run.height_mm());
        }
        let heights_mm = heights_mm.into_iter().step_by(SAMPLED).collect();
        Ok(Recording { interval_s: SAMPLED as f64 * STEP_S, heights_mm })
    }
}

/// A simulation with its marker.
struct Run {
    simulation: Simulation,
    marker: ElementPoint,
    at_rest: f64,
    limit: f64,
}

impl Run {
    fn new(scene: &Scene, volume: LabelVolume) -> Result<Self> {
        let simulation = Simulation::builder(scene).volume(volume).build()?;
        let body = simulation.body();
        let rest = body.rest_positions();
        let low = body
            .vertices()
            .map(|v| rest[v.index()])
            .fold(Vector3::repeat(f64::MAX), |a, b| a.inf(&b));
        let place = low + Vector3::from(MARKER_M);
        let found = locate(&[place], body.elements().iter(), rest, 1e-6, |_, _| true);
        let Some((_, marker)) = found[0] else {
            return Err(BenchError::NoRing(body.vertex_count()));
        };
        let at_rest = marker.position(rest).z;
        Ok(Self { marker, at_rest, limit: scene.solver.residual, simulation })
    }

    fn step(&mut self, case: &'static str) -> Result<()> {
        let report = self.simulation.step()?;
        if report.converged {
            return Ok(());
        }
        let (reached, limit) = (report.residual, self.limit);
        Err(BenchError::NotConverged { case, method: "fallback", reached, limit })
    }

    fn height_mm(&self) -> f64 {
        1e3 * (self.marker.position(self.simulation.body().positions()).z - self.at_rest)
    }
}
