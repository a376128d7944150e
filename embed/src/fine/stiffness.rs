//! The stiffness of the finest tetrahedra as sparse rows of 3×3 blocks.

use nalgebra::{Matrix3, Matrix6};
use rayon::prelude::*;

use super::body::{SixFields, lattice_tet};
use super::grid::FineGrid;
use super::multigrid::BlockRows;
use super::region::Region;
use crate::error::EmbedError;
use crate::linear_tet::strain_operator;
use yawara_mesh::kuhn::Point;

/// K of a region's vertices. Neighbours lie at most one voxel away along each axis, so a row
/// has up to 27 blocks, ascending.
pub(crate) struct FineStiffness {
    /// Which of the 27 places around a vertex hold a neighbour.
    masks: Vec<u32>,
    pub(super) rows: BlockRows<3, 3>,
    /// Smallest and largest diagonal entry of the elasticity matrices, Pa, for messages.
    pub(super) moduli: [f64; 2],
}

/// The place of `q` among the 27 around `p`, in the order of vertex numbers.
fn place(p: Point, q: Point) -> u32 {
    ((q[0] - p[0] + 1) + 3 * (q[1] - p[1] + 1) + 9 * (q[2] - p[2] + 1)) as u32
}

impl FineStiffness {
    /// Assembles K, N/m for voxels of edge 1 m, and ties it to the ground by six springs where its
    /// first cube has corners: they keep a free body from moving, and loads that balance do not
    /// strain them.
    pub fn new(region: &Region<'_>, grid: &FineGrid) -> Result<Self, EmbedError> {
        let mut stiffness = Self::pattern(region, grid)?;
        (region.visit)(&mut |corners, d| stiffness.add(grid, corners, d))?;
        let low = region.cubes[0];
        let [x, y] = [0, 1].map(|axis| {
            let mut p = low;
            p[axis] += region.units;
            p
        });
        for (p, axes) in [(low, &[0usize, 1, 2][..]), (x, &[1, 2]), (y, &[2])] {
            let v = grid.vertex(p);
            let at = stiffness.at(v, place(p, p));
            for &axis in axes {
                stiffness.rows.blocks[at][(axis, axis)] *= 2.0;
            }
        }
        Ok(stiffness)
    }

    fn pattern(region: &Region<'_>, grid: &FineGrid) -> Result<Self, EmbedError> {
        let mut masks = vec![0u32; grid.len()];
        let mut moduli = [f64::INFINITY, 0.0f64];
        (region.visit)(&mut |corners, d| {
            for p in corners {
                let mask = &mut masks[grid.vertex(*p)];
                corners.iter().for_each(|q| *mask |= 1 << place(*p, *q));
            }
            let diagonal = d.diagonal();
            moduli = [moduli[0].min(diagonal.min()), moduli[1].max(diagonal.max())];
        })?;
        let mut starts = Vec::with_capacity(masks.len() + 1);
        let mut columns = Vec::new();
        for (v, &mask) in masks.iter().enumerate() {
            starts.push(columns.len());
            let p = grid.point(v);
            for around in (0..27i32).filter(|around| mask & (1 << around) != 0) {
                let q = [p[0] + around % 3 - 1, p[1] + around / 3 % 3 - 1, p[2] + around / 9 - 1];
                columns.push(grid.vertex(q) as u32);
            }
        }
        starts.push(columns.len());
        let blocks = vec![Matrix3::zeros(); columns.len()];
        Ok(Self { masks, rows: BlockRows { starts, columns, blocks }, moduli })
    }

    /// Index of a row's block at one of the 27 places.
    fn at(&self, row: usize, place: u32) -> usize {
        let before = self.masks[row] & ((1 << place) - 1);
        self.rows.starts[row] + before.count_ones() as usize
    }

    fn add(&mut self, grid: &FineGrid, corners: &[Point; 4], d: &Matrix6<f64>) {
        let geometry = lattice_tet(corners);
        let g = geometry.gradients.map(|g| strain_operator(&g));
        let stress = g.map(|g| geometry.volume * d * g);
        for i in 0..4 {
            let row = grid.vertex(corners[i]);
            for j in 0..4 {
                let at = self.at(row, place(corners[i], corners[j]));
                self.rows.blocks[at] += g[i].transpose() * stress[j];
            }
        }
    }

    pub fn vertices(&self) -> usize {
        self.masks.len()
    }

    /// K x, row by row.
    pub(super) fn apply(&self, x: &[SixFields], y: &mut [SixFields]) {
        y.par_iter_mut().with_min_len(512).enumerate().for_each(|(v, y)| {
            let mut sum = SixFields::zeros();
            for at in self.rows.row(v) {
                sum += self.rows.blocks[at] * x[self.rows.columns[at] as usize];
            }
            *y = sum;
        });
    }
}
