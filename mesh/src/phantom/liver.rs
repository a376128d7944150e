//! A liver with vessels, gallbladder and tumour.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::random::SplitMix64;
use super::shape::{HALF_EXTENT, HILUM, RIGHT_LOBE, gallbladder, liver_field};
use super::size::{GALLBLADDER_LABEL, LiverPhantom, PARENCHYMA, TUMOUR, VESSELS};
use super::vessels::{paint, vessel_tree};
use crate::image::ImageError;
use crate::image::volume::{Grid, LabelVolume};

/// Radius of the tumour, in lengths of the organ.
const TUMOUR_RADIUS: f64 = 0.06;

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
/// [`ImageError::Parameter`] if a size is not finite or out of range.
pub fn liver(size: LiverPhantom) -> Result<LabelVolume, ImageError> {
    size.check()?;
    let grid = size.grid();
    let [nx, ny, nz] = grid.dims;
    let tree = vessel_tree(size)?;
    let tumour = tumour_centre(size.seed);
    let mut labels = vec![0u16; nx * ny * nz];
    labels.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slice)| {
        label_slice(&grid, size.length_mm, tumour, z, slice);
        paint(&tree, &grid, z, slice);
    });
    let middle = [0, 1, 2].map(|axis| {
        let position = RIGHT_LOBE[axis] * size.length_mm - grid.origin_mm[axis];
        (position / size.voxel_mm) as usize
    });
    keep_connected(&grid, middle, &mut labels);
    LabelVolume::new(grid, labels, vec![0, PARENCHYMA, VESSELS, GALLBLADDER_LABEL, TUMOUR])
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
        if deep && gallbladder(p) > TUMOUR_RADIUS && (p - HILUM).norm() > 0.2 {
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
    use super::*;
    use crate::phantom::shape::GALLBLADDER;

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
