//! Uniform meshes of a unit cube that is clamped at the bottom and pulled at the top.

use std::sync::Arc;

use faer::Mat;
use nalgebra::{Matrix3, Vector3};
use yawara::inverse::{Assembly, SlotMap};
use yawara_embed::{DetailMesh, ElementFormulation, Embedding, P1, SparseCholesky};
use yawara_inverse_update::{SparseStiffness, elimination_order};
use yawara_mesh::{BisectionForest, Domain, LabelTree, Lattice, Placement, VertexId};

use crate::bodies::organ::elements_of;
use crate::error::{BenchError, Result};
use crate::solvers::direct::lower_half;

/// Tractions on the face z = 1: tension and shear.
pub(crate) const TRACTIONS: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];

/// Displacements under the two loads, by vertex number, and the work of each load.
pub(crate) struct Solution {
    pub displacements: [Vec<Vector3<f64>>; 2],
    pub compliances: [f64; 2],
}

/// A uniform mesh of the cube.
#[derive(Clone)]
pub(crate) struct CubeMesh {
    pub forest: Arc<BisectionForest>,
    pub placement: Placement,
}

impl CubeMesh {
    /// The mesh of a level, on a lattice down to the level `finest`.
    pub fn new(tree: &Arc<LabelTree>, level: u8, finest: u8) -> Result<Self> {
        let lattice = Lattice::new(tree.grid().cells, finest);
        let unit = 1.0 / (lattice.cells[2] as f64 * f64::from(lattice.units));
        let forest = BisectionForest::new(Domain::full(lattice), Arc::clone(tree), level, finest)?;
        let placement = Placement { origin: Vector3::zeros(), unit };
        Ok(Self { forest: Arc::new(forest), placement })
    }

    pub fn rest(&self, v: VertexId) -> Vector3<f64> {
        self.placement.position(self.forest.point(v))
    }

    /// The stiffness with the materials that `embedding` gives the tetrahedra.
    pub fn assembled(
        &self,
        element: &dyn ElementFormulation,
        embedding: &Embedding,
    ) -> Result<(SlotMap, SparseStiffness)> {
        let is_fixed = |v| self.forest.point(v)[2] == 0;
        let order_key = |v| Lattice::key(self.forest.point(v));
        let assembly = Assembly::new(element, &is_fixed, &order_key);
        let slots = assembly.slots(self.forest.vertices());
        let elements = elements_of(&self.forest, &self.placement, embedding);
        let k = assembly.assemble(elements, &slots)?;
        Ok((slots, k))
    }

    /// Solves for linear tetrahedra with the materials that `embedding` gives them.
    pub fn solve(&self, embedding: &Embedding) -> Result<Solution> {
        let (slots, k) = self.assembled(&P1, embedding)?;
        let rows = k.dofs();
        let factor = SparseCholesky::new(&lower_half(&k), Some(&elimination_order(&k)), 3);
        let factor = factor.ok_or(BenchError::NotFactored("sparse_refactor_nd", rows))?;
        let loads = self.loads(3).map(|load| slots.gather(3, &load));
        let loads = Mat::from_fn(rows, 2, |row, which| loads[which][row]);
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

    /// The forces of the tractions by vertex number, `block` numbers each: a third of a loaded
    /// face's at each of its corners.
    pub fn loads(&self, block: usize) -> [Vec<f64>; 2] {
        let lattice = self.forest.domain().lattice();
        let top = lattice.cells[2] as i32 * lattice.units;
        let mut loads = TRACTIONS.map(|_| vec![0.0; block * self.forest.vertex_capacity()]);
        for face in self.forest.boundary_faces() {
            if face.iter().any(|&v| self.forest.point(v)[2] != top) {
                continue;
            }
            let [a, b, c] = face.map(|v| self.rest(v));
            let share = (b - a).cross(&(c - a)).norm() / 6.0;
            for (load, traction) in loads.iter_mut().zip(TRACTIONS) {
                for v in face {
                    let row = block * v.index();
                    (0..3).for_each(|axis| load[row + axis] += share * traction[axis]);
                }
            }
        }
        loads
    }

    /// Displacements of this mesh's vertices under the loads, from those of a coarser one.
    pub fn carried(
        &self,
        detail: &DetailMesh,
        coarse: &Self,
        solution: &Solution,
    ) -> Result<[Vec<Vector3<f64>>; 2]> {
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
