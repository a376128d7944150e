//! How stiff a body feels all over its skin, and where a nodule in it can be felt.
//!
//! A fingertip of some radius presses along the normal, with its force spread evenly: what it feels is the inverse of
//! C = wᵀ K⁻¹ w, w the unit force on the mesh's vertices. With K = L D Lᵀ that is half a solve, ‖D^(−½) L⁻¹ w‖². The body is at rest and
//! linear.

use std::collections::HashMap;
use std::time::Instant;

use nalgebra::Vector3;
use serde::Serialize;
use yawara_corot::ElementPoint;
use yawara_mesh::volume::LabelVolume;

use crate::body::Start;
use crate::error::SimError;
use crate::preview::{Picture, Shade, skin};
use crate::report::milliseconds;
use crate::scene::{Region, Scene, SupportHold};
use crate::step::Simulation;
use crate::tools::BodyAtRest;

/// Points farther outside the mesh, m, feel nothing.
const REACH_M: f64 = 3e-3;

/// What is felt, and with what.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Points of the skin at most.
    pub points: usize,
    /// Radius of the fingertip, mm.
    pub radius_mm: f64,
    /// How deep it presses where forces are compared, mm.
    pub depth_mm: f64,
    /// The least difference of force that is felt, N.
    pub threshold_n: f64,
    /// Entries of the scene's materials: a nodule, and what would be there without it.
    pub nodule: Option<[usize; 2]>,
}

impl Default for Options {
    fn default() -> Self {
        Self { points: 10_000, radius_mm: 5.0, depth_mm: 2.0, threshold_n: 0.05, nodule: None }
    }
}

/// A point of the skin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Felt {
    /// Where it rests, scanner RAS, mm.
    pub rest_mm: [f64; 3],
    /// Outward, scanner axes.
    pub normal: [f64; 3],
    /// What the fingertip feels, N/m.
    pub stiffness_n_m: f64,
    /// The same without the nodule, N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_n_m: Option<f64>,
}

impl Felt {
    /// By how much the force at the depth of `options` is larger for the nodule, N.
    pub fn difference_n(&self, options: &Options) -> Option<f64> {
        Some(1e-3 * options.depth_mm * (self.stiffness_n_m - self.without_n_m?))
    }
}

/// A body's skin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Skin {
    /// The scene.
    pub scene: String,
    /// Of the mesh.
    pub vertices: usize,
    /// Those that the mesh carries.
    pub points: Vec<Felt>,
    /// The share of them where the nodule is felt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub felt_share: Option<f64>,
    /// What the solves took, ms, of one body.
    pub solves_ms: f64,
}

/// A fingertip: where it presses, which way, and the unit force that it spreads on points of the body.
struct Fingertip {
    middle: Vector3<f64>,
    inward: Vector3<f64>,
    /// Numbers of points, and their shares.
    shares: Vec<(usize, f64)>,
}

/// Feels the skin of a scene's body on its start mesh, without its tools.
///
/// `volume` takes the place of the scene's image. Cost: that of building the scene, twice with a nodule, and half a solve a
/// point.
/// # Errors
/// [`SimError::Value`] for options out of range; those of a scene that can't be simulated.
pub fn feel(
    scene: &Scene,
    volume: Option<&LabelVolume>,
    options: &Options,
) -> Result<Skin, SimError> {
    check(scene, options)?;
    let mut scene = Scene { tools: Vec::new(), ..scene.clone() };
    // Nothing is refined, and a tool that a goal names is not there.
    (scene.refinement.goal, scene.stages.indicator) = (None, "residual".into());
    let start = Start::new(&scene, volume.cloned())?;
    if scene.support.hold == SupportHold::Elastic {
        // It goes with the softest material otherwise, with a nodule or without.
        let usual = start.holding_stiffness(&scene);
        scene.support.stiffness_n_m4.get_or_insert(usual);
    }
    let scene = &scene;
    let everywhere = Region::between([-1.0; 3], [2.0; 3]);
    let patches = BodyAtRest::new(scene, &start).surface_patch("the skin", &everywhere)?;
    let rest = patches.rest().to_vec();
    let areas: Vec<Vector3<f64>> = (0..rest.len()).map(|i| patches.area(i)).collect();
    let tips = fingertips(&rest, &areas, options);
    let with = stiffnesses(scene, volume, &rest, &tips)?;
    let solves_ms = with.solves_ms;
    let without = match options.nodule {
        None => None,
        Some([nodule, like]) => {
            let mut scene = scene.clone();
            let like = scene.materials[like].clone();
            let it = &mut scene.materials[nodule];
            (it.young_modulus_pa, it.poisson_ratio) = (like.young_modulus_pa, like.poisson_ratio);
            Some(stiffnesses(&scene, volume, &rest, &tips)?)
        }
    };
    let axes = start.places.axes;
    let mut points = Vec::new();
    for (i, tip) in tips.iter().enumerate() {
        let Some(stiffness_n_m) = with.by_tip[i] else { continue };
        points.push(Felt {
            rest_mm: axes.to_ras_mm(&tip.middle).into(),
            normal: axes.to_ras_direction(&-tip.inward).into(),
            stiffness_n_m,
            without_n_m: without.as_ref().and_then(|without| without.by_tip[i]),
        });
    }
    let differences = points.iter().filter_map(|point| point.difference_n(options));
    let felt = differences.filter(|difference| *difference >= options.threshold_n).count();
    let felt_share = options.nodule.map(|_| felt as f64 / points.len().max(1) as f64);
    Ok(Skin { scene: scene.name.clone(), vertices: with.vertices, points, felt_share, solves_ms })
}

fn check(scene: &Scene, options: &Options) -> Result<(), SimError> {
    let refused = |key: &str, value: String, want: String| {
        Err(SimError::value("yawara feel", key, value, want))
    };
    let Options { points, radius_mm, depth_mm, threshold_n, nodule } = options;
    if !(1..=1_000_000).contains(points) {
        return refused("the number of points", points.to_string(), "1 to 1000000".into());
    }
    for (key, value) in [("the radius (mm)", radius_mm), ("the depth (mm)", depth_mm)] {
        if !(*value > 0.0 && *value <= 1e3) {
            return refused(key, value.to_string(), "above 0, at most 1000".into());
        }
    }
    if !(*threshold_n >= 0.0 && threshold_n.is_finite()) {
        return refused("the threshold (N)", threshold_n.to_string(), "0 or more".into());
    }
    let count = scene.materials.len();
    if let Some(entry) = nodule.iter().flatten().find(|entry| **entry >= count) {
        let want = format!("an entry of the scene's materials, below {count}");
        return refused("a material", entry.to_string(), want);
    }
    Ok(())
}

/// Fingertips at some of the patches, evenly among all, that press on those around them which face the same way.
fn fingertips(rest: &[Vector3<f64>], areas: &[Vector3<f64>], options: &Options) -> Vec<Fingertip> {
    let radius = 1e-3 * options.radius_mm;
    let cell = |x: &Vector3<f64>| [0, 1, 2].map(|axis| (x[axis] / radius).floor() as i64);
    let mut cells = HashMap::<[i64; 3], Vec<usize>>::new();
    for (i, x) in rest.iter().enumerate() {
        cells.entry(cell(x)).or_default().push(i);
    }
    let every = rest.len().div_ceil(options.points).max(1);
    let mut tips = Vec::new();
    for i in (0..rest.len()).step_by(every) {
        let (middle, inward) = (rest[i], -areas[i].normalize());
        let [x, y, z] = cell(&middle);
        let mut shares = Vec::new();
        for around in (0..27).map(|n| [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]) {
            let near = cells.get(&around).into_iter().flatten();
            shares.extend(near.filter_map(|&j| {
                let faces = -areas[j].dot(&inward);
                let is_under = faces > 0.0 && (rest[j] - middle).norm() <= radius;
                is_under.then_some((j, faces))
            }));
        }
        let whole: f64 = shares.iter().map(|(_, share)| share).sum();
        shares.iter_mut().for_each(|(_, share)| *share /= whole);
        tips.push(Fingertip { middle, inward, shares });
    }
    tips
}

struct Stiffnesses {
    by_tip: Vec<Option<f64>>,
    vertices: usize,
    solves_ms: f64,
}

fn stiffnesses(
    scene: &Scene,
    volume: Option<&LabelVolume>,
    rest: &[Vector3<f64>],
    tips: &[Fingertip],
) -> Result<Stiffnesses, SimError> {
    let builder = Simulation::builder(scene);
    let simulation = match volume {
        Some(volume) => builder.volume(volume.clone()).build()?,
        None => builder.build()?,
    };
    let carried = simulation.points(rest, REACH_M);
    let load = |tip: &Fingertip| -> Vec<(ElementPoint, Vector3<f64>)> {
        let on = tip.shares.iter().filter_map(|(j, share)| Some((carried[*j]?, *share)));
        on.map(|(point, share)| (point, share * tip.inward)).collect()
    };
    let loads: Vec<_> = tips.iter().map(load).collect();
    let begin = Instant::now();
    let compliances = simulation.softness(&loads)?;
    let solves_ms = milliseconds(begin);
    let by_tip = compliances.into_iter().map(|c| (c > 0.0).then(|| 1.0 / c)).collect();
    Ok(Stiffnesses { by_tip, vertices: simulation.body().vertex_count(), solves_ms })
}

impl Skin {
    /// The skin in three views: how stiff it feels, or with a nodule what difference that makes at the depth of `options`.
    pub fn picture(&self, options: &Options) -> Picture {
        let value = |point: &Felt| match point.difference_n(options) {
            Some(difference) => difference,
            None => point.stiffness_n_m,
        };
        let (what, floor) = match self.felt_share {
            Some(_) => {
                let depth = options.depth_mm;
                (format!("difference of force at {depth} mm, N"), Some(options.threshold_n))
            }
            None => ("stiffness, N/m".into(), None),
        };
        let title = format!("{}: a fingertip of {} mm, {what}", self.scene, options.radius_mm);
        let shades = self.points.iter().map(|point| Shade {
            at: 1e-3 * Vector3::from(point.rest_mm),
            normal: Vector3::from(point.normal),
            value: value(point),
        });
        skin(&title, &shades.collect::<Vec<_>>(), floor)
    }
}
