//! The unit cubes whose material is homogenised: what every voxel is made of.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_embed::{FineMaterial, Material, Materials};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{CellGrid, LabelTree};

use crate::bodies::solid::places;
use crate::error::Result;
use crate::workloads::random::SplitMix64;

/// Finest cubes along an edge.
const VOXELS: usize = 16;

/// Finest cubes along a root cube: six levels.
const VOXELS_PER_CELL: usize = 4;

/// What the cube holds besides a matrix of E = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Inside {
    /// Nothing.
    Homogeneous,
    /// A ball of radius 0.3 around (0.53, 0.47, 0.51), so many times stiffer.
    Sphere(f64),
    /// An oblique rod of radius 0.12 through the middle, from side to side: its flank touches the
    /// clamp.
    Vessel(f64),
    /// A steeper rod, from the clamped face to the pulled one.
    Strut(f64),
    /// ln E of every voxel drawn from a normal distribution of this deviation.
    LogNormal(f64),
    /// Every second layer of 1/8 across z.
    Layers(f64),
    /// ln E a Gaussian random field, correlated over a voxel and a half, between these ratios.
    Field(f64),
    /// Twelve balls of random places and radii.
    Balls(f64),
    /// Half the voxels, drawn one by one.
    Noise(f64),
}

/// All of them, in the order of the tables.
pub(crate) const CASES: [Inside; 12] = [
    Inside::Homogeneous,
    Inside::Sphere(10.0),
    Inside::Sphere(1e3),
    Inside::Sphere(1e6),
    Inside::Vessel(10.0),
    Inside::Vessel(1e3),
    Inside::LogNormal(1.0),
    Inside::LogNormal(2.0),
    Inside::Layers(10.0),
    Inside::Layers(1e3),
    Inside::Vessel(1e6),
    Inside::Strut(1e3),
];

/// Further media with their Poisson's ratio, which count for a mean of their own: fields, voxels
/// without correlation, stiff balls and hollows.
pub(crate) const MEDIA: [(Inside, f64); 7] = [
    (Inside::Field(1e2), 0.3),
    (Inside::Field(1e3), 0.3),
    (Inside::Field(1e2), 0.45),
    (Inside::LogNormal(1.5), 0.3),
    (Inside::Balls(1e4), 0.3),
    (Inside::Balls(1e-3), 0.3),
    (Inside::Noise(1e2), 0.3),
];

/// A case with its label tree and one Young's modulus per voxel, x fastest.
pub(crate) struct Block {
    pub inside: Inside,
    pub tree: Arc<LabelTree>,
    young_moduli: Arc<Vec<f64>>,
}

impl Inside {
    pub fn name(self) -> &'static str {
        match self {
            Self::Homogeneous => "homogeneous",
            Self::Sphere(_) => "sphere",
            Self::Vessel(_) => "vessel",
            Self::Strut(_) => "strut",
            Self::LogNormal(1.0) => "lognormal1",
            Self::LogNormal(1.5) => "lognormal1.5",
            Self::LogNormal(_) => "lognormal2",
            Self::Layers(_) => "layers",
            Self::Field(_) => "field",
            Self::Balls(ratio) if ratio < 1.0 => "hollows",
            Self::Balls(_) => "balls",
            Self::Noise(_) => "noise",
        }
    }

    /// Whether the mean over the cases at so many levels counts it: layers are whole cubes at
    /// three levels, and a strut or a vessel of the largest ratio hangs on the clamp.
    pub fn counts(self, levels: u8) -> bool {
        match self {
            Self::Homogeneous | Self::Strut(_) => false,
            Self::Field(_) | Self::Balls(_) | Self::Noise(_) => false,
            Self::Vessel(ratio) => ratio < 1e6,
            Self::Layers(_) => levels > 3,
            Self::Sphere(_) => true,
            Self::LogNormal(sigma) => sigma != 1.5,
        }
    }

    fn young_moduli(self) -> Vec<f64> {
        let mut random = SplitMix64(7);
        let field = field(&mut SplitMix64(23));
        let balls = balls(&mut SplitMix64(17));
        let stiffer = |is: bool, ratio: f64| if is { ratio } else { 1.0 };
        let mut modulus = |voxel: [usize; 3]| {
            let x = Vector3::from(voxel.map(|c| (c as f64 + 0.5) / VOXELS as f64));
            match self {
                Self::Homogeneous => 1.0,
                Self::Sphere(ratio) => {
                    stiffer((x - Vector3::new(0.53, 0.47, 0.51)).norm() < 0.3, ratio)
                }
                Self::Vessel(ratio) => stiffer(in_rod(&x, [0.5; 3], [1.0, 0.6, 0.8]), ratio),
                Self::Strut(ratio) => stiffer(in_rod(&x, [0.2, 0.3, 0.0], [0.6, 0.4, 1.0]), ratio),
                Self::LogNormal(sigma) => (sigma * random.normal()).exp(),
                Self::Field(ratio) => {
                    let [x, y, z] = voxel;
                    ratio.powf(field[x + VOXELS * (y + VOXELS * z)])
                }
                Self::Balls(ratio) => stiffer(
                    balls.iter().any(|(centre, radius)| (x - centre).norm() < *radius),
                    ratio,
                ),
                Self::Noise(ratio) => stiffer(random.symmetric() > 0.0, ratio),
                Self::Layers(ratio) => stiffer(voxel[2] / (VOXELS / 8) % 2 == 1, ratio),
            }
        };
        places([VOXELS; 3]).map(&mut modulus).collect()
    }
}

/// A Gaussian random field on the voxels, from 0 to 1: normal numbers, smoothed along each axis by a
/// bell of deviation 1.5 that goes round the sides.
fn field(random: &mut SplitMix64) -> Vec<f64> {
    let mut values: Vec<f64> = places([VOXELS; 3]).map(|_| random.normal()).collect();
    for stride in [1, VOXELS, VOXELS * VOXELS] {
        let smooth = |i: usize| -> f64 {
            let at = i / stride % VOXELS;
            let value = |j: usize| values[i - at * stride + j % VOXELS * stride];
            (0..9)
                .map(|k| (-(k as f64 - 4.0).powi(2) / 4.5).exp() * value(at + VOXELS + k - 4))
                .sum()
        };
        values = (0..values.len()).map(smooth).collect();
    }
    let [low, high] = [f64::min, f64::max]
        .map(|pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).unwrap_or(0.0));
    values.iter().map(|value| (value - low) / (high - low)).collect()
}

/// Centres and radii.
fn balls(random: &mut SplitMix64) -> Vec<(Vector3<f64>, f64)> {
    let mut place = || 0.5 * (random.symmetric() + 1.0);
    (0..12).map(|_| (Vector3::new(place(), place(), place()), 0.08 + 0.1 * place())).collect()
}

/// Within 0.12 of the line through `foot`.
fn in_rod(x: &Vector3<f64>, foot: [f64; 3], along: [f64; 3]) -> bool {
    (x - Vector3::from(foot)).cross(&Vector3::from(along).normalize()).norm() < 0.12
}

impl Block {
    pub fn new(inside: Inside) -> Result<Self> {
        let young_moduli = inside.young_moduli();
        let many = |i: &Inside| matches!(i, Inside::LogNormal(_) | Inside::Field(_));
        let two = inside != Inside::Homogeneous && !many(&inside);
        let labels = young_moduli.iter().map(|&e| 1 + u16::from(two && e != 1.0)).collect();
        let values = (0..=1 + i64::from(two)).collect();
        let grid = Grid::centred([VOXELS; 3], 1e3 / VOXELS as f64);
        let volume = LabelVolume::new(grid, labels, values)?;
        let grid = CellGrid {
            cells: [VOXELS / VOXELS_PER_CELL; 3],
            voxels_per_cell: VOXELS_PER_CELL,
            first_voxel: [0; 3],
        };
        // One material everywhere is homogenised too, to show what that does.
        let tree = Arc::new(LabelTree::per_voxel(&volume, grid, &|_| !two)?);
        Ok(Self { inside, tree, young_moduli: Arc::new(young_moduli) })
    }

    /// Largest over smallest Young's modulus.
    pub fn ratio(&self) -> f64 {
        let extremes = |pick: fn(f64, f64) -> f64| self.young_moduli.iter().copied().reduce(pick);
        extremes(f64::max).unwrap_or(1.0) / extremes(f64::min).unwrap_or(1.0)
    }

    /// Materials by label and by voxel with this Poisson's ratio.
    pub fn materials(&self, poisson_ratio: f64) -> Result<Materials> {
        let material = move |e: f64| Material::new(e, poisson_ratio, 0.0).map(FineMaterial::from);
        // Void does not occur.
        let other = self.young_moduli.iter().copied().find(|&e| e != 1.0).unwrap_or(1.0);
        let by_label = [1.0, 1.0, other].map(material);
        let by_label = by_label.into_iter().collect::<Result<Vec<_>, _>>()?;
        let moduli = Arc::clone(&self.young_moduli);
        Ok(Materials::new(by_label).with_voxels(move |voxel, _| {
            let [x, y, z] = voxel.map(|c| c as usize);
            material(moduli[x + VOXELS * (y + VOXELS * z)])
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_are_what_they_are_called() {
        let share = |inside: Inside| {
            let moduli = inside.young_moduli();
            moduli.iter().filter(|&&e| e > 1.0).count() as f64 / moduli.len() as f64
        };
        // Volume of the ball 4π r³/3; of the strut π r² times the length between the faces.
        assert!((share(Inside::Sphere(10.0)) - 0.1131).abs() < 0.005);
        let strut = std::f64::consts::PI * 0.12f64.powi(2) * 1.52f64.sqrt();
        assert!((share(Inside::Strut(10.0)) - strut).abs() < 0.01);
        let touches = |inside: Inside| {
            let floor = &inside.young_moduli()[..VOXELS.pow(2)];
            floor.iter().filter(|&&e| e > 1.0).count()
        };
        assert!((1..40).contains(&touches(Inside::Vessel(10.0))));
        assert_eq!(share(Inside::Layers(10.0)), 0.5);
        let moduli = Inside::LogNormal(2.0).young_moduli();
        let (logs, n) = (moduli.iter().map(|e| e.ln() / 2.0), moduli.len() as f64);
        let mean = logs.clone().sum::<f64>() / n;
        let variance = logs.map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        // Four standard errors.
        assert!(mean.abs() < 4.0 / n.sqrt() && (variance - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
    }
}
