//! A random block of voxels with what holds it and what acts on it.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use yawara::scene::{
    GrabEntry, GrabHold, Image, Key, LoadEntry, LoadKey, MaterialEntry, ProbeEntry, Region, Scene,
    ToolEntry,
};
use yawara_mesh::volume::{Grid, LabelVolume};

use crate::bodies::solid::places;
use crate::error::Result;
use crate::workloads::random::SplitMix64;

/// Steps in which tools come to act in full.
pub(super) const RAMP: usize = 4;

/// Length of a step, s.
const STEP_S: f64 = 0.25;

/// Edge of a voxel, m.
const VOXEL: f64 = 2.5e-3;

/// Voxels along an edge of a base cell.
const PER_CELL: usize = 8;

/// The softest material that there may be, Pa, and how many times as stiff the stiffest.
const SOFTEST: f64 = 1e3;
const RATIO: f64 = 100.0;

pub(super) struct Sample {
    pub scene: Scene,
    pub volume: LabelVolume,
    pub body: &'static str,
    pub tool: &'static str,
    pub element: &'static str,
}

impl Sample {
    /// The one of `seed`: stages, solver and refinement as `given`.
    pub fn new(given: &Scene, seed: u64) -> Result<Self> {
        let mut random = SplitMix64(seed);
        let cells = [2, 2, 2].map(|least| least + random.below(2));
        let dims = cells.map(|cells| cells * PER_CELL);
        let count = 2 + random.below(2);
        let (body, labels) = match random.below(2) {
            0 => ("waves", waves(&mut random, dims, count)),
            _ => ("spots", spots(&mut random, dims, count)),
        };
        let volume =
            LabelVolume::from_original(Grid::centred(dims, 1e3 * VOXEL), labels.into_iter())?;
        let material = |&label: &i64| MaterialEntry {
            material: None,
            label: Some(label),
            range: None,
            other: false,
            name: String::new(),
            young_modulus_pa: SOFTEST * RATIO.powf(random.between(0.0, 1.0)),
            poisson_ratio: random.between(0.3, 0.45),
            density_kg_m3: 1000.0,
            law: None,
        };
        let materials: Vec<MaterialEntry> = volume.values()[1..].iter().map(material).collect();
        let element = ["p1", "p1p1"][random.below(2)];
        let mut scene =
            Scene { image: Image::default(), gravity_m_s2: [0.0; 3], materials, ..given.clone() };
        scene.mesh.max_vertices = 1_000_000;
        scene.time.step_s = STEP_S;
        scene.stages.element = element.into();
        let place = Place { axis: random.below(3), is_high: random.below(2) == 1, dims };
        scene.fixed = vec![place.slab([0.0; 2], [0.0, 1.0])];
        let softest = scene.materials.iter().map(|m| m.young_modulus_pa).fold(f64::MAX, f64::min);
        let (tool, entry) = place.tool(&mut random, softest);
        scene.tools = vec![entry];
        Ok(Self { scene, volume, body, tool, element })
    }

    /// The largest Young's modulus over the smallest.
    pub fn ratio(&self) -> f64 {
        let moduli = || self.scene.materials.iter().map(|material| material.young_modulus_pa);
        moduli().fold(0.0, f64::max) / moduli().fold(f64::MAX, f64::min)
    }
}

/// Labels 1 to `count` by the height of a sum of plane waves of lengths of 12 to 32 voxels.
fn waves(random: &mut SplitMix64, dims: [usize; 3], count: usize) -> Vec<i64> {
    let waves: Vec<(Vector3<f64>, f64)> = (0..8)
        .map(|_| (TAU / random.between(12.0, 32.0) * random.direction(), random.between(0.0, TAU)))
        .collect();
    let height = |voxel: [usize; 3]| -> f64 {
        let x = Vector3::from(voxel.map(|c| c as f64));
        waves.iter().map(|(along, phase)| (along.dot(&x) + phase).cos()).sum()
    };
    let step = random.between(0.5, 2.0);
    let label = |voxel| 1 + ((height(voxel) / step + 1.0).clamp(0.0, count as f64 - 0.5)) as i64;
    places(dims).map(label).collect()
}

/// Label 1 with balls of the others, of radii of 2.4 to 6 voxels.
fn spots(random: &mut SplitMix64, dims: [usize; 3], count: usize) -> Vec<i64> {
    let balls: Vec<(Vector3<f64>, f64, i64)> = (0..20)
        .map(|_| {
            let centre = Vector3::from(dims.map(|n| random.between(0.0, n as f64)));
            (centre, random.between(2.4, 6.0), 2 + random.below(count - 1) as i64)
        })
        .collect();
    let label = |voxel: [usize; 3]| {
        let x = Vector3::from(voxel.map(|c| c as f64 + 0.5));
        let around = balls.iter().find(|(centre, radius, _)| (x - centre).norm() < *radius);
        around.map_or(1, |(.., label)| *label)
    };
    places(dims).map(label).collect()
}

/// A face of a block.
struct Place {
    axis: usize,
    is_high: bool,
    /// Voxels.
    dims: [usize; 3],
}

impl Place {
    /// Lengths, m.
    fn size(&self) -> [f64; 3] {
        self.dims.map(|n| n as f64 * VOXEL)
    }

    /// The shortest length, m.
    fn least(&self) -> f64 {
        self.size().into_iter().fold(f64::MAX, f64::min)
    }

    /// A place by fractions, that along the axis counted from the opposite face.
    fn at(&self, mut fractions: [f64; 3]) -> [f64; 3] {
        if !self.is_high {
            fractions[self.axis] = 1.0 - fractions[self.axis];
        }
        fractions
    }

    /// What lies `along` the axis and `across` it.
    fn slab(&self, along: [f64; 2], across: [f64; 2]) -> Region {
        let corner = |i: usize| {
            let mut corner = [across[i]; 3];
            corner[self.axis] = along[i];
            corner
        };
        let [mut min, mut max] = [0, 1].map(|i| self.at(corner(i)));
        let axis = self.axis;
        (min[axis], max[axis]) = (min[axis].min(max[axis]), min[axis].max(max[axis]));
        Region::between(min, max)
    }

    /// The direction out of the face.
    fn outward(&self) -> Vector3<f64> {
        Vector3::ith(self.axis, if self.is_high { 1.0 } else { -1.0 })
    }

    /// A tool of any kind somewhere on the face or below, whose strains are moderate.
    fn tool(&self, random: &mut SplitMix64, softest: f64) -> (&'static str, ToolEntry) {
        let least = self.least();
        let mut fractions = [0; 3].map(|_| random.between(0.25, 0.75));
        fractions[self.axis] = random.between(0.7, 1.0);
        let radius_m = least * random.between(0.25, 0.4);
        let region = Region::around(self.at(fractions), radius_m);
        let across = [random.between(0.0, 0.3), random.between(0.7, 1.0)];
        let face = self.slab([0.9, 1.0], across);
        let moved = least * random.between(0.02, 0.08) * random.direction();
        let stress = softest * random.between(0.01, 0.05) * random.direction();
        match random.below(6) {
            0 => ("grab", grab(region, GrabHold::Mean, self.outward(), moved, 0.0)),
            1 => {
                let degrees = random.between(10.0, 40.0);
                let twist = grab(face, GrabHold::Mean, self.outward(), Vector3::zeros(), degrees);
                ("twist", twist)
            }
            2 => ("pad", grab(region, GrabHold::Pad, self.outward(), moved, 0.0)),
            3 => {
                let force = least.powi(2) * stress;
                ("load", load(region, LoadKey { force_n: Some(force.into()), ..still(1.0) }))
            }
            4 => {
                let traction_pa = Some(stress.into());
                ("traction", load(face, LoadKey { traction_pa, ..still(1.0) }))
            }
            _ => {
                fractions[self.axis] = 1.0 + radius_m / self.size()[self.axis];
                let depth = least * random.between(0.04, 0.1);
                let probe = ProbeEntry {
                    centre: Some(self.at(fractions)),
                    centre_mm: None,
                    centre_voxel: None,
                    radius_m,
                    path: path(-depth * self.outward(), 0.0),
                    path_csv: None,
                    // Closer than the finest mesh is, whose limit they would else not let it reach.
                    spacing_m: Some(VOXEL),
                    begin_s: None,
                    release_s: None,
                };
                ("probe", ToolEntry::Probe(probe))
            }
        }
    }
}

fn path(moved: Vector3<f64>, turn_deg: f64) -> Vec<Key> {
    let full_s = RAMP as f64 * STEP_S;
    vec![
        Key { time_s: 0.0, move_m: [0.0; 3], turn_deg: 0.0 },
        Key { time_s: full_s, move_m: moved.into(), turn_deg },
    ]
}

fn grab(
    region: Region,
    hold: GrabHold,
    axis: Vector3<f64>,
    moved: Vector3<f64>,
    turn_deg: f64,
) -> ToolEntry {
    ToolEntry::Grab(GrabEntry {
        region,
        hold,
        stiffness_n_m4: None,
        path: path(moved, turn_deg),
        path_csv: None,
        turn_axis: axis.into(),
        begin_s: None,
        release_s: None,
    })
}

fn still(share: f64) -> LoadKey {
    let time_s = share * RAMP as f64 * STEP_S;
    LoadKey { time_s, force_n: None, torque_n_m: None, traction_pa: None }
}

fn load(region: Region, full: LoadKey) -> ToolEntry {
    let load = vec![still(0.0), full];
    ToolEntry::Load(LoadEntry { region: Some(region), at_mm: None, load })
}
