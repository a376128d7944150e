//! Procedural organs: label volumes without a scanner.
//!
//! Only additions, products, quotients and square roots enter, each rounded by IEEE 754: the
//! same parameters give the same voxels on every machine.

mod random;
mod shape;
mod vessels;

use std::ops::RangeInclusive;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::MeshError;
use crate::volume::{Grid, LabelVolume};
use random::SplitMix64;
use shape::{HALF_EXTENT, RIGHT_LOBE, gallbladder, liver_field};

pub use vessels::{VesselSegment, vessel_tree};

/// Label of the liver tissue of [`liver`], and of all of [`block`].
pub const PARENCHYMA: i64 = 1;
/// Label of the portal vessels of [`liver`].
pub const VESSELS: i64 = 2;
/// Label of the gallbladder of [`liver`].
pub const GALLBLADDER_LABEL: i64 = 3;
/// Label of the tumour of [`liver`].
pub const TUMOUR: i64 = 4;

/// Voxels across the organ: fewer resolve no gallbladder, more exceed memory.
const VOXELS_ACROSS: RangeInclusive<f64> = 16.0..=640.0;

/// Lengths that are accepted, mm: from a tenth of a mouse's liver to no animal's.
const LENGTHS_MM: RangeInclusive<f64> = 1.0..=10_000.0;

/// Radius of the tumour, in lengths of the organ.
const TUMOUR_RADIUS: f64 = 0.06;

/// Size and seed of the procedural liver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiverPhantom {
    /// From the right end of the organ to the left one, mm; 1 to 10 000.
    pub length_mm: f64,
    /// Edge of a voxel, mm; 1/640 to 1/16 of the length.
    pub voxel_mm: f64,
    /// Picks the vessel tree and the place of the tumour; the outline stays.
    pub seed: u64,
}

impl Default for LiverPhantom {
    /// A grown-up's liver, 200 mm long, in voxels of 2 mm.
    fn default() -> Self {
        Self { length_mm: 200.0, voxel_mm: 2.0, seed: 1 }
    }
}

impl LiverPhantom {
    fn check(&self) -> Result<(), MeshError> {
        // Ranges contain no NaN.
        if !LENGTHS_MM.contains(&self.length_mm) {
            let want = "1 to 10000 mm";
            return Err(MeshError::Phantom { field: "length_mm", value: self.length_mm, want });
        }
        if !VOXELS_ACROSS.contains(&(self.length_mm / self.voxel_mm)) {
            let want = "1/640 to 1/16 of length_mm";
            return Err(MeshError::Phantom { field: "voxel_mm", value: self.voxel_mm, want });
        }
        Ok(())
    }

    /// The grid that holds the organ with a voxel of background around it.
    fn grid(&self) -> Grid {
        let dims = HALF_EXTENT.map(|half| {
            let voxels = (half * self.length_mm / self.voxel_mm).ceil() as usize;
            2 * (voxels + 1)
        });
        Grid::centred(dims, self.voxel_mm)
    }
}

/// A liver: parenchyma 1, portal vessels 2, gallbladder 3, one spherical tumour 4.
///
/// A big right lobe tapers into a thin left one; the underside is hollow and bears the
/// gallbladder; the vessels branch from the hilum by Murray's law ([`vessel_tree`]). All labels
/// together are one face-connected body with background around it. Vessels thinner than a voxel
/// come out broken or not at all.
///
/// Shapes: axes are right, anterior, superior; the grid's middle lies at the origin.
/// Cost: O(voxels), in parallel over slices.
///
/// # Errors
/// [`MeshError::Phantom`] if a size is not finite or out of range.
pub fn liver(size: LiverPhantom) -> Result<LabelVolume, MeshError> {
    size.check()?;
    let grid = size.grid();
    let [nx, ny, nz] = grid.dims;
    let tree = vessel_tree(size)?;
    let tumour = tumour_centre(size.seed);
    let mut labels = vec![0u16; nx * ny * nz];
    labels.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slice)| {
        label_slice(&grid, size.length_mm, tumour, z, slice);
        vessels::paint(&tree, &grid, z, slice);
    });
    let middle = [0, 1, 2].map(|axis| {
        let position = RIGHT_LOBE[axis] * size.length_mm - grid.origin_mm[axis];
        (position / size.voxel_mm) as usize
    });
    keep_connected(&grid, middle, &mut labels);
    LabelVolume::new(grid, labels, vec![0, PARENCHYMA, VESSELS, GALLBLADDER_LABEL, TUMOUR])
}

/// A box of `cells` voxels, all label 1, without background: beams and blocks.
///
/// Units: mm. The grid's middle lies at the origin. Cost: O(voxels).
///
/// # Errors
/// [`MeshError::Phantom`] if there are no cells or more than 2³¹, or if `voxel_mm` is not
/// finite and positive.
pub fn block(cells: [usize; 3], voxel_mm: f64) -> Result<LabelVolume, MeshError> {
    if !(voxel_mm > 0.0 && voxel_mm.is_finite()) {
        let (value, want) = (voxel_mm, "finite and > 0");
        return Err(MeshError::Phantom { field: "voxel_mm", value, want });
    }
    let grid = Grid::centred(cells, voxel_mm);
    let count = grid.voxel_count().unwrap_or(usize::MAX);
    if count == 0 || count > 1 << 31 {
        let (value, want) = (count as f64, "1 to 2^31 in all");
        return Err(MeshError::Phantom { field: "number of cells", value, want });
    }
    LabelVolume::new(grid, vec![1; count], vec![0, PARENCHYMA])
}

/// All labels of a slice but the vessels, and void where the organ is not.
fn label_slice(grid: &Grid, length_mm: f64, tumour: Vector3<f64>, z: usize, slice: &mut [u16]) {
    let [nx, ny, nz] = grid.dims;
    let coordinate = |axis: usize, i: usize| {
        (grid.origin_mm[axis] + (i as f64 + 0.5) * grid.spacing_mm) / length_mm
    };
    let inner = |i: usize, n: usize| i > 0 && i + 1 < n;
    for y in (0..ny).filter(|&y| inner(y, ny) && inner(z, nz)) {
        for x in 1..nx - 1 {
            let p = Vector3::new(coordinate(0, x), coordinate(1, y), coordinate(2, z));
            slice[y * nx + x] = if gallbladder(p) < 0.0 {
                GALLBLADDER_LABEL as u16
            } else if liver_field(p) >= 0.0 {
                0
            } else if (p - tumour).norm_squared() < TUMOUR_RADIUS * TUMOUR_RADIUS {
                TUMOUR as u16
            } else {
                PARENCHYMA as u16
            };
        }
    }
}

/// A place for the tumour, in lengths: all of it inside the liver, off hilum and gallbladder.
fn tumour_centre(seed: u64) -> Vector3<f64> {
    // Another stream than the vessels', so that both may change alone.
    let mut random = SplitMix64::new(seed ^ 0x7475_6d6f_7572);
    for _ in 0..10_000 {
        let p = random.in_box(HALF_EXTENT);
        let deep = liver_field(p) < -TUMOUR_RADIUS - 0.01;
        if deep && gallbladder(p) > TUMOUR_RADIUS && (p - shape::HILUM).norm() > 0.2 {
            return p;
        }
    }
    RIGHT_LOBE
}

/// Turns what no path over voxel faces joins to `start` into background.
fn keep_connected(grid: &Grid, start: [usize; 3], labels: &mut [u16]) {
    let [nx, ny, _] = grid.dims;
    let strides = [1, nx, nx * ny];
    let start = start[0] + nx * (start[1] + ny * start[2]);
    let mut reached = vec![false; labels.len()];
    let mut open = vec![start];
    reached[start] = labels[start] != 0;
    while let Some(voxel) = open.pop() {
        // The outermost voxels are background, so that neighbours always exist.
        for stride in strides {
            for next in [voxel - stride, voxel + stride] {
                if labels[next] != 0 && !reached[next] {
                    reached[next] = true;
                    open.push(next);
                }
            }
        }
    }
    for (label, reached) in labels.iter_mut().zip(reached) {
        if !reached {
            *label = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::shape::GALLBLADDER;
    use super::*;

    #[test]
    fn the_tumour_lies_inside_for_every_seed() {
        for seed in 0..200 {
            let centre = tumour_centre(seed);
            assert_ne!(centre, RIGHT_LOBE, "seed {seed}: no place was found");
            for direction in [Vector3::x(), Vector3::y(), Vector3::z()] {
                for sign in [-1.0, 1.0] {
                    let p = centre + direction * (sign * TUMOUR_RADIUS);
                    assert!(liver_field(p) < 0.0, "seed {seed} leaves the liver");
                }
            }
        }
    }

    #[test]
    fn the_gallbladder_is_half_embedded() {
        // Both ends touch the liver's underside or lie in it, and its fundus hangs out below.
        let (neck, fundus) = (GALLBLADDER.0, GALLBLADDER.1);
        assert!(liver_field(neck.0) < neck.1);
        assert!(liver_field(fundus.0 - Vector3::z() * fundus.1) > 0.0);
        assert!(liver_field(fundus.0 + Vector3::z() * fundus.1) < 0.0);
    }
    #[test]
    fn loose_voxels_become_background() {
        let grid = Grid::centred([6, 4, 4], 1.0);
        let mut labels = vec![0u16; 96];
        let at = |x, y, z| grid.index(x, y, z).unwrap();
        // Two neighbours, one voxel that touches them in an edge only, one apart.
        for (x, y) in [(1, 1), (2, 1), (3, 2), (4, 2)] {
            labels[at(x, y, 1)] = 2;
        }
        keep_connected(&grid, [1, 1, 1], &mut labels);
        let kept: Vec<usize> = (0..96).filter(|&i| labels[i] != 0).collect();
        assert_eq!(kept, [at(1, 1, 1), at(2, 1, 1)]);
    }
}
