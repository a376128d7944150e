//! A clamped unit cube under tension and shear, on its finest mesh and on coarse ones.

use std::sync::Arc;

use faer::Mat;
use nalgebra::{Matrix3, Vector3};
use yawara::inverse::Assembly;
use yawara_embed::{DetailMesh, Embedding, P1, SparseCholesky};
use yawara_inverse_update::elimination_order;
use yawara_mesh::{BisectionForest, Domain, Lattice, Placement, VertexId};

use super::mixture::{Block, VOXELS, VOXELS_PER_CELL};
use crate::bodies::organ::elements_of;
use crate::error::BenchError;
use crate::solvers::direct::lower_half;

/// Tractions on the face z = 1: tension and shear.
const TRACTIONS: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];

/// Displacements under the two loads, by vertex number, and the work of each load.
pub(crate) struct Solution {
    pub displacements: [Vec<Vector3<f64>>; 2],
    pub compliances: [f64; 2],
}

/// A uniform mesh of the cube.
pub(crate) struct CubeMesh {
    pub forest: BisectionForest,
    placement: Placement,
}

impl CubeMesh {
    /// The mesh `levels` above the finest one.
    pub fn new(block: &Block, levels: u8) -> Result<Self, BenchError> {
        let level = block.tree.grid().embed_level() - levels;
        let cells = block.tree.grid().cells;
        let lattice = Lattice::new(cells, level);
        let unit = VOXELS_PER_CELL as f64 / (VOXELS as f64 * f64::from(lattice.units));
        let forest =
            BisectionForest::new(Domain::full(lattice), Arc::clone(&block.tree), level, level)?;
        Ok(Self { forest, placement: Placement { origin: Vector3::zeros(), unit } })
    }

    pub fn rest(&self, v: VertexId) -> Vector3<f64> {
        self.placement.position(self.forest.point(v))
    }

    /// Solves with the materials that `embedding` gives the tetrahedra.
    ///
    /// # Errors
    /// [`BenchError::NotFactored`], [`BenchError::Inverse`].
    pub fn solve(&self, embedding: &Embedding) -> Result<Solution, BenchError> {
        let is_fixed = |v| self.forest.point(v)[2] == 0;
        let order_key = |v| Lattice::key(self.forest.point(v));
        let assembly = Assembly::new(&P1, &is_fixed, &order_key);
        let slots = assembly.slots(self.forest.vertices());
        let elements = elements_of(&self.forest, &self.placement, embedding);
        let k = assembly.assemble(elements, &slots)?;
        let rows = k.dofs();
        let factor = SparseCholesky::new(&lower_half(&k), Some(&elimination_order(&k)), 3);
        let factor =
            factor.ok_or(BenchError::NotFactored { method: "sparse_refactor_nd", rows })?;
        let areas = self.loaded_areas();
        let load = |row: usize, which: usize| {
            areas[slots.vertices()[row / 3].index()] * TRACTIONS[which][row % 3]
        };
        let loads = Mat::from_fn(rows, 2, load);
        let mut u = loads.clone();
        factor.solve_in_place(&mut u);
        let displacement = |which: usize| {
            let mut by_vertex = vec![0.0; 3 * self.forest.vertex_capacity()];
            slots.scatter(3, u.col_as_slice(which), &mut by_vertex);
            by_vertex.chunks_exact(3).map(Vector3::from_column_slice).collect()
        };
        let work = |which: usize| (0..rows).map(|i| loads[(i, which)] * u[(i, which)]).sum();
        Ok(Solution { displacements: [0, 1].map(displacement), compliances: [0, 1].map(work) })
    }

    /// A third of the area of every loaded face around each vertex.
    fn loaded_areas(&self) -> Vec<f64> {
        let lattice = self.forest.domain().lattice();
        let top = lattice.cells[2] as i32 * lattice.units;
        let mut areas = vec![0.0; self.forest.vertex_capacity()];
        for face in self.forest.boundary_faces() {
            if face.iter().all(|&v| self.forest.point(v)[2] == top) {
                let [a, b, c] = face.map(|v| self.rest(v));
                let area = 0.5 * (b - a).cross(&(c - a)).norm();
                face.iter().for_each(|v| areas[v.index()] += area / 3.0);
            }
        }
        areas
    }

    /// Displacements of this mesh's vertices under the loads, from those of a coarser one.
    ///
    /// # Errors
    /// [`BenchError::Embed`] if the meshes do not belong together.
    pub fn carried(
        &self,
        detail: &DetailMesh,
        coarse: &Self,
        solution: &Solution,
    ) -> Result<[Vec<Vector3<f64>>; 2], BenchError> {
        let mut carried = [Vec::new(), Vec::new()];
        for (carried, u) in carried.iter_mut().zip(&solution.displacements) {
            let mut x = u.clone();
            coarse.forest.vertices().for_each(|v| x[v.index()] += coarse.rest(v));
            // Displacements are small: no frame turns.
            let mut x = detail.positions(&coarse.forest, &x, &|_| Matrix3::identity())?;
            self.forest.vertices().for_each(|v| x[v.index()] -= self.rest(v));
            *carried = x;
        }
        Ok(carried)
    }

    /// Materials of its lattice, for a detail mesh.
    pub fn unit(&self) -> f64 {
        self.placement.unit
    }

    /// ‖u − v‖ / ‖v‖ in L2, exact for fields that are linear in each tetrahedron.
    pub fn relative_error(&self, u: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let (mut error, mut norm) = (0.0, 0.0);
        // All tetrahedra have the same volume V: ∫ |Σ w_i λ_i|² = V/20 (Σ |w_i|² + |Σ w_i|²).
        let square = |w: [Vector3<f64>; 4]| {
            w.iter().map(Vector3::norm_squared).sum::<f64>()
                + w.iter().sum::<Vector3<f64>>().norm_squared()
        };
        for tet in self.forest.leaves() {
            let at = tet.vertices.map(VertexId::index);
            error += square(at.map(|i| u[i] - v[i]));
            norm += square(at.map(|i| v[i]));
        }
        (error / norm).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::super::mixture::Inside;
    use super::*;
    use yawara_embed::by_name;

    #[test]
    fn a_uniform_rod_of_no_lateral_strain_is_solved_exactly() {
        // ν = 0 under tension: u_z = z t / E, no corner effect, compliance t² V / E.
        let block = Block::new(Inside::Homogeneous).unwrap();
        let (tree, materials) = (Arc::clone(&block.tree), block.materials(0.0).unwrap());
        let stage = by_name("laminate").unwrap();
        let embedding =
            Embedding::with_materials(tree, materials, stage, &mut |_| ControlFlow::Continue(()))
                .unwrap();
        let mesh = CubeMesh::new(&block, 6).unwrap();
        let solution = mesh.solve(&embedding).unwrap();
        for v in mesh.forest.vertices() {
            let want = Vector3::new(0.0, 0.0, mesh.rest(v).z);
            assert!((solution.displacements[0][v.index()] - want).norm() < 1e-12);
        }
        assert!((solution.compliances[0] - 1.0).abs() < 1e-12);
        // Carried to the finest mesh it is still exact, and 1 % more is an error of 1 %.
        let fine = CubeMesh::new(&block, 0).unwrap();
        let detail = DetailMesh::new(fine.forest.clone());
        let [u, _] = fine.carried(&detail, &mesh, &solution).unwrap();
        let exact: Vec<Vector3<f64>> = u.iter().map(|u| u / 1.01).collect();
        assert!((fine.relative_error(&u, &exact) - 0.01).abs() < 1e-12);
    }
}
