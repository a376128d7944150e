//! A preconditioner from the hierarchy of bisections itself.

use nalgebra::{Matrix3, Matrix6};
use yawara_mesh::Lattice;
use yawara_mesh::kuhn::ROOTS_PER_CELL;

use super::body::{FineBody, SixFields, lattice_tet};
use super::grid::FineGrid;
use crate::error::EmbedError;
use crate::linear_tet::strain_operator;

/// z = Σ_L P_L diag(P_LᵀKP_L)⁻¹ P_Lᵀ r over the meshes of all levels L, P_L linear interpolation.
///
/// A hat function of a coarse mesh feels the mean elasticity of each of its tetrahedra, so that
/// the diagonal blocks are exact. Cost: a few sweeps over the vertices. Source: Bramble, Pasciak,
/// Xu, Mathematics of Computation 55(191), 1990.
pub(crate) struct Multilevel {
    /// Vertices by ascending generation.
    order: Vec<u32>,
    /// Ends of the edge that each bisects, as places in `order`; those of root vertices unused.
    ends: Vec<[u32; 2]>,
    /// Vertices of each level's mesh: the first so many of `order`.
    counts: Vec<usize>,
    /// Per level, the inverse diagonal blocks of those vertices.
    inverse: Vec<Vec<Matrix3<f64>>>,
}

impl Multilevel {
    pub fn new(body: &FineBody, cells: &[usize], grid: &FineGrid) -> Result<Self, EmbedError> {
        let tree_grid = body.tree().grid();
        let levels = tree_grid.embed_level();
        let lattice = Lattice { cells: tree_grid.cells, units: tree_grid.voxels_per_cell as i32 };
        let generation = |v: u32| lattice.generation(grid.point(v as usize));
        let mut order: Vec<u32> = (0..grid.len() as u32).collect();
        order.sort_by_key(|&v| generation(v));
        let mut place = vec![0u32; order.len()];
        order.iter().enumerate().for_each(|(at, &v)| place[v as usize] = at as u32);
        let ends = |&v: &u32| match lattice.edge_ends(grid.point(v as usize)) {
            Some(ends) => ends.map(|p| place[grid.vertex(p)]),
            None => [0; 2],
        };
        let ends = order.iter().map(ends).collect();
        let counts: Vec<usize> =
            (0..=levels).map(|level| order.partition_point(|&v| generation(v) <= level)).collect();
        let mut blocks: Vec<Vec<Matrix3<f64>>> =
            counts.iter().map(|&n| vec![Matrix3::zeros(); n]).collect();
        for (&cell, root) in cells.iter().flat_map(|c| (0..ROOTS_PER_CELL).map(move |r| (c, r))) {
            body.fold(cell, root, &mut |of, corners, level, halves: Option<[Matrix6<f64>; 2]>| {
                let geometry = lattice_tet(corners);
                // ∫ D inside.
                let sum = match halves {
                    Some([first, second]) => first + second,
                    None => geometry.volume * body.elasticity(of, corners)?,
                };
                for (p, g) in corners.iter().zip(&geometry.gradients) {
                    let (g, at) = (strain_operator(g), place[grid.vertex(*p)] as usize);
                    blocks[usize::from(level)][at] += g.transpose() * sum * g;
                }
                Ok(sum)
            })?;
        }
        for block in blocks.iter_mut().flatten() {
            // A block of a positive definite matrix has an inverse; what rounding made singular
            // is left to the other levels.
            *block = block.try_inverse().unwrap_or_else(Matrix3::zeros);
        }
        Ok(Self { order, ends, counts, inverse: blocks })
    }

    /// z from r; `scratch` is for its use.
    pub fn apply(&self, r: &[SixFields], z: &mut [SixFields], scratch: &mut Vec<SixFields>) {
        scratch.clear();
        scratch.extend(self.order.iter().map(|&v| r[v as usize]));
        let mut parts: Vec<Vec<SixFields>> = Vec::with_capacity(self.counts.len());
        for level in (0..self.counts.len()).rev() {
            let blocks = self.inverse[level].iter().zip(scratch.iter());
            parts.push(blocks.map(|(inverse, r)| inverse * r).collect());
            let coarser = if level == 0 { self.counts[0] } else { self.counts[level - 1] };
            for v in coarser..self.counts[level] {
                let half = 0.5 * scratch[v];
                self.ends[v].iter().for_each(|&end| scratch[end as usize] += half);
            }
        }
        scratch.clear();
        for part in parts.iter().rev() {
            for v in scratch.len()..part.len() {
                let [a, b] = self.ends[v].map(|end| end as usize);
                // Root vertices have no ends and start from nothing.
                let middle = if scratch.len() < self.counts[0] {
                    SixFields::zeros()
                } else {
                    0.5 * (scratch[a] + scratch[b])
                };
                scratch.push(middle);
            }
            for (z, part) in scratch.iter_mut().zip(part) {
                *z += part;
            }
        }
        for (&v, value) in self.order.iter().zip(scratch.iter()) {
            z[v as usize] = *value;
        }
    }
}
