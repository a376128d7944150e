//! The scenes: random grabs, pads and balls on the liver phantom, each from a seed of its own.

use std::f64::consts::FRAC_PI_3;

use nalgebra::Vector3;
use yawara::scene::{
    GrabEntry, GrabHold, Key, LawEntry, ProbeEntry, PronyEntry, Region, RelaxingPart, ScalpelEntry,
    Scene, ToolEntry,
};
use yawara::{Simulation, scene_file};
use yawara_embed::FORMULATIONS;

use crate::error::Result;
use crate::workloads::random::SplitMix64;

/// What is replaced in the scene `liver`: a mesh that refines by two orders of volume, and coarse enough
/// for a hundred thousand steps.
const LIVER: [&str; 7] = [
    "image.voxel_mm=3",
    "mesh.base_mm=24",
    "mesh.max_level=5",
    "mesh.max_vertices=900",
    "refinement.max_splits_per_step=40",
    "output.frames_every=0",
    "tools=[]",
];

/// What acts: two tools each, or a grab and a ball.
pub(super) const KINDS: [&str; 4] = ["grab", "pad", "probe", "grab and probe"];

/// Radius of what a grab holds, and how deep below the surface its centre is, m.
const GRAB_M: f64 = 0.018;
const GRAB_DEPTH_M: f64 = 0.012;

/// Farthest that a grab goes from rest (m) and turns (degrees), and how far in a step.
const REACH_M: f64 = 0.025;
const REACH_DEG: f64 = 30.0;
const STRIDE_M: f64 = 0.005;

/// Radius of a ball, the farthest that it presses, and how far off the outline it is out of touch, m.
const BALL_M: f64 = 0.015;
const DEEPEST_M: f64 = 0.008;
const CLEAR_M: f64 = 0.006;

/// Length of a blade's edge, m, and what a cut takes, J/m²: of the order of that of liver.
const BLADE_M: f64 = 0.03;
const TOUGHNESS_J_M2: f64 = 100.0;

/// Distance from the liver's middle at which a ball goes from place to place, m: it passes by a chord of a
/// sixth of the circle at most, 0.19 m off.
const AROUND_M: f64 = 0.22;

/// The liver at rest, for tools to find their places on.
pub(super) struct Liver {
    scene: Scene,
    /// Points of its outlines, m, scanner axes.
    outline: Vec<Vector3<f64>>,
    low: Vector3<f64>,
    high: Vector3<f64>,
    extras: Extras,
}

/// What scenes have besides tools that move the body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extras {
    /// Whether labels get laws by chance.
    pub laws: bool,
    /// Whether a blade cuts all the time.
    pub cuts: bool,
}

impl Liver {
    /// With what its scenes have besides.
    ///
    /// # Errors
    /// Those of the scene `liver`.
    pub fn new(extras: Extras) -> Result<Self> {
        let keys = LIVER.map(str::to_owned);
        let (scene, _) = scene_file::load("liver", &keys)?;
        let labels = "output.surfaces=[{label=1}, {label=2}, {label=3}, {label=4}]".to_owned();
        let (seen, _) = scene_file::load("liver", &[&keys[..], &[labels]].concat())?;
        let frame = Simulation::builder(&seen).build()?.frame()?;
        let points = frame.surfaces.iter().flat_map(|surface| &surface.points_mm);
        let outline: Vec<Vector3<f64>> = points.map(|x| x * 1e-3).collect();
        let low = outline.iter().fold(Vector3::repeat(f64::MAX), |low, x| low.inf(x));
        let high = outline.iter().fold(Vector3::repeat(f64::MIN), |high, x| high.sup(x));
        Ok(Self { scene, outline, low, high, extras })
    }

    fn middle(&self) -> Vector3<f64> {
        0.5 * (self.low + self.high)
    }

    /// A place in fractions of the box.
    fn fractions(&self, x: &Vector3<f64>) -> Vector3<f64> {
        (x - self.low).component_div(&(self.high - self.low))
    }

    /// Whether a place (m) is well off the part that the scene's support holds.
    fn is_loose(&self, x: &Vector3<f64>) -> bool {
        let at = self.fractions(x);
        at.x < 0.4 || at.y > 0.55
    }

    /// The point of the outline that lies farthest in a direction.
    fn farthest(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let height = |x: &&Vector3<f64>| x.dot(direction);
        let found = self.outline.iter().max_by(|a, b| height(a).total_cmp(&height(b)));
        found.copied().unwrap_or_else(|| self.middle())
    }

    /// Scene number `number` of a study, of `steps` steps: its kind and element go round, all else
    /// follows from `seed`.
    pub fn scene(&self, number: usize, steps: usize, seed: u64) -> (&'static str, Scene) {
        let kind = KINDS[number % KINDS.len()];
        let mut scene = self.scene.clone();
        scene.name = format!("endurance{number}");
        scene.description = format!("{kind}, from seed {seed}");
        // As it is for all scenes: another seed would be another liver.
        scene.stages.element = FORMULATIONS[number / KINDS.len() % FORMULATIONS.len()].into();
        scene.time.steps = steps;
        let mut random = SplitMix64(seed);
        let clock = Clock { steps, step_s: scene.time.step_s };
        let holds = match kind {
            "grab" => vec![GrabHold::Mean; 2],
            "pad" => vec![GrabHold::Pad; 2],
            "probe" => Vec::new(),
            _ => vec![GrabHold::Mean],
        };
        let balls = match kind {
            "probe" => 2,
            "grab and probe" => 1,
            _ => 0,
        };
        let mut centres = Vec::new();
        for hold in holds {
            let grab = self.grab(hold, &mut centres, clock, &mut random);
            scene.tools.push(ToolEntry::Grab(grab));
        }
        for _ in 0..balls {
            scene.tools.push(ToolEntry::Probe(self.probe(clock, &mut random)));
        }
        if self.extras.cuts {
            scene.tools.push(ToolEntry::Scalpel(self.blade(clock, &mut random)));
        }
        if self.extras.laws {
            let labels = scene.materials.iter_mut();
            labels.for_each(|one| one.law = Some(law(one.young_modulus_pa, &mut random)));
        }
        (kind, scene)
    }

    /// A blade that goes from place to place, each way a cut of its own in every step.
    fn blade(&self, clock: Clock, random: &mut SplitMix64) -> ScalpelEntry {
        let place = |random: &mut SplitMix64| {
            let part = [0, 1, 2].map(|_| random.between(0.0, 1.0));
            self.low + (self.high - self.low).component_mul(&Vector3::from(part))
        };
        let start = place(random);
        let mut path = vec![clock.key(0, Vector3::zeros(), 0.0)];
        let mut step = 0;
        while step < clock.steps {
            step += 2 + random.below(6);
            path.push(clock.key(step, place(random) - start, 0.0));
        }
        ScalpelEntry {
            centre: None,
            centre_mm: Some((start * 1e3).into()),
            centre_voxel: None,
            edge_m: (BLADE_M * random.direction()).into(),
            level: None,
            toughness_j_m2: Some(TOUGHNESS_J_M2),
            path,
            path_csv: None,
            begin_s: None,
            release_s: None,
        }
    }

    /// A grab that walks about where no other has its material, with a turn.
    fn grab(
        &self,
        hold: GrabHold,
        centres: &mut Vec<Vector3<f64>>,
        clock: Clock,
        random: &mut SplitMix64,
    ) -> GrabEntry {
        let centre = loop {
            let at = self.outline[random.below(self.outline.len())];
            let inwards = (self.middle() - at).normalize();
            let centre = at + GRAB_DEPTH_M * inwards;
            let is_apart = |other: &Vector3<f64>| (centre - other).norm() > 2.5 * GRAB_M;
            if self.is_loose(&centre) && centres.iter().all(is_apart) {
                break centre;
            }
        };
        centres.push(centre);
        let mut path = vec![clock.key(0, Vector3::zeros(), 0.0)];
        let (mut step, mut at) = (0, Vector3::zeros());
        while step < clock.steps {
            let to: Vector3<f64> = REACH_M * random.between(0.0, 1.0) * random.direction();
            let least = ((to - at).norm() / STRIDE_M).ceil() as usize;
            step += least.max(1) + random.below(6);
            at = to;
            path.push(clock.key(step, at, REACH_DEG * random.symmetric()));
            if random.below(4) == 0 {
                // It stays for a while: so do forces, but for what the mesh does.
                step += 1 + random.below(8);
                let turn = path.last().map_or(0.0, |key| key.turn_deg);
                path.push(clock.key(step, at, turn));
            }
        }
        GrabEntry {
            region: Region::around(self.fractions(&centre).into(), GRAB_M),
            hold,
            stiffness_n_m4: None,
            path,
            path_csv: None,
            turn_axis: random.direction().into(),
            begin_s: None,
            release_s: clock.release(random),
        }
    }

    /// A ball that presses here and there, slides, and now and then stays.
    fn probe(&self, clock: Clock, random: &mut SplitMix64) -> ProbeEntry {
        let middle = self.middle();
        let mut direction = self.away(None, random);
        let mut path = vec![clock.key(0, AROUND_M * direction, 0.0)];
        let mut step = 0;
        while step < clock.steps {
            let touch = self.farthest(&direction) - middle;
            let above = |height: f64| touch + (BALL_M + height) * direction;
            let depth = random.between(0.2, 1.0) * DEEPEST_M;
            let aside = random.direction().cross(&direction) * 2.0 * BALL_M;
            let mut go = |steps: usize, to: Vector3<f64>| {
                step += steps;
                path.push(clock.key(step, to, 0.0));
            };
            go(1, above(CLEAR_M));
            go(3 + random.below(8), above(-depth));
            match random.below(3) {
                0 => go(1 + random.below(8), above(-depth)),
                1 => {
                    go(6 + random.below(10), above(-depth) + aside);
                    go(1 + random.below(3), above(CLEAR_M) + aside);
                }
                _ => {}
            }
            go(1 + random.below(6), above(CLEAR_M));
            go(1, AROUND_M * direction);
            direction = self.away(Some(&direction), random);
            go(1, AROUND_M * direction);
        }
        ProbeEntry {
            centre: Some([0.5; 3]),
            centre_mm: None,
            centre_voxel: None,
            radius_m: BALL_M,
            path,
            path_csv: None,
            spacing_m: None,
            begin_s: None,
            release_s: clock.release(random),
        }
    }

    /// A direction in which the outline is loose, by no more than a sixth of a circle off `last`.
    fn away(&self, last: Option<&Vector3<f64>>, random: &mut SplitMix64) -> Vector3<f64> {
        loop {
            let one = random.direction();
            let is_near = last.is_none_or(|last| one.dot(last) > FRAC_PI_3.cos());
            if is_near && self.is_loose(&self.farthest(&one)) {
                return one;
            }
        }
    }
}

/// A law of a material of a modulus (Pa), by chance; strains of some percent yield and creep.
fn law(young_modulus_pa: f64, random: &mut SplitMix64) -> LawEntry {
    match random.below(4) {
        0 => LawEntry::Linear,
        1 => {
            let terms = (0..=random.below(3)).map(|_| PronyEntry {
                fraction: random.between(0.05, 0.3),
                time_s: 10f64.powf(random.between(-2.0, 1.0)),
            });
            LawEntry::Prony {
                terms: terms.collect(),
                power_law: None,
                relaxing: [RelaxingPart::Deviator, RelaxingPart::Whole][random.below(2)],
            }
        }
        2 => LawEntry::Plastic {
            yield_pa: young_modulus_pa * random.between(0.02, 0.2),
            hardening_pa: young_modulus_pa * random.between(0.05, 0.5),
        },
        _ => LawEntry::Creep {
            yield_strain: random.between(0.01, 0.1),
            rate_per_s: 10f64.powf(random.between(-1.0, 1.0)),
            max_strain: random.between(0.02, 0.2),
        },
    }
}

/// The steps of a scene.
#[derive(Clone, Copy)]
struct Clock {
    steps: usize,
    step_s: f64,
}

impl Clock {
    fn key(self, step: usize, to: Vector3<f64>, turn_deg: f64) -> Key {
        Key { time_s: step as f64 * self.step_s, move_m: to.into(), turn_deg }
    }

    /// Three of four let go, in the last two thirds of the scene.
    fn release(self, random: &mut SplitMix64) -> Option<f64> {
        let part = random.between(0.33, 1.0);
        (random.below(4) > 0)
            .then(|| ((part * self.steps as f64) as usize).max(1) as f64 * self.step_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_follows_from_its_seed_and_reads_back() {
        let root = tempfile::tempdir().unwrap();
        let extras = [(false, false), (true, false), (false, true)];
        let livers = extras.map(|(laws, cuts)| Liver::new(Extras { laws, cuts }).unwrap());
        for (liver, number) in
            livers.iter().flat_map(|one| (0..2 * KINDS.len()).map(move |n| (one, n)))
        {
            let (kind, scene) = liver.scene(number, 60, 5);
            assert_eq!(kind, KINDS[number % KINDS.len()]);
            assert_eq!(liver.scene(number, 60, 5).1, scene);
            assert_ne!(liver.scene(number, 60, 6).1.tools, scene.tools);
            let path = root.path().join("scene.toml");
            std::fs::write(&path, toml::to_string(&scene).unwrap()).unwrap();
            let (back, _) = scene_file::load(&path.to_string_lossy(), &[]).unwrap();
            assert_eq!(back, scene, "{kind}");
        }
    }

    #[test]
    fn balls_start_out_of_touch_and_grabs_apart() {
        let liver = Liver::new(Extras { laws: false, cuts: false }).unwrap();
        let far = liver.outline.iter().map(|x| (x - liver.middle()).norm()).fold(0.0, f64::max);
        // What is passed in a straight line a sixth of a circle apart.
        assert!(far + BALL_M < AROUND_M * (0.5 * FRAC_PI_3).cos(), "{far} m");
        for seed in 0..20 {
            let (_, scene) = liver.scene(0, 100, seed);
            let centres = scene.tools.iter().map(|tool| match tool {
                ToolEntry::Grab(GrabEntry { region: Region::Sphere { centre, .. }, .. }) => {
                    Vector3::from(centre.unwrap()).component_mul(&(liver.high - liver.low))
                }
                other => panic!("{other:?}"),
            });
            let centres: Vec<Vector3<f64>> = centres.collect();
            assert!((centres[0] - centres[1]).norm() > 2.0 * GRAB_M);
        }
    }
}
