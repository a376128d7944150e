//! The finest tetrahedra of a whole body: what a homogenisation sees that asks for more than two
//! halves.

mod cholesky;
mod conjugate_gradients;
mod grid;
mod multilevel;
mod stiffness;

use std::ops::ControlFlow;

use nalgebra::{Matrix6, SMatrix, Vector3};
use yawara_mesh::kuhn::{Point, ROOTS_PER_CELL, bisect, midpoint, root_corners};
use yawara_mesh::{Content, Domain, LabelTree, Lattice, NodeRef};

use crate::element::LinearTet;
use crate::error::EmbedError;
use crate::materials::Materials;

pub use cholesky::{DIRECT_VERTICES, SparseCholesky};
pub(crate) use grid::FineGrid;
pub(crate) use stiffness::FineStiffness;

/// Six displacements of a vertex, one per load: 3×6.
pub type SixFields = SMatrix<f64, 3, 6>;

/// A body as its finest tetrahedra, before anything is homogenised. Lengths are in voxels.
pub struct FineBody<'a> {
    tree: &'a LabelTree,
    materials: &'a Materials,
}

impl<'a> FineBody<'a> {
    pub(crate) fn new(tree: &'a LabelTree, materials: &'a Materials) -> Self {
        Self { tree, materials }
    }

    /// The labels.
    pub fn tree(&self) -> &LabelTree {
        self.tree
    }

    /// What the labels stand for.
    pub fn materials(&self) -> &Materials {
        self.materials
    }

    /// Face-connected groups of root cubes that hold anything but void. Groups that share only an
    /// edge or a vertex are bodies of their own: such a joint is a mechanism.
    pub fn components(&self) -> Vec<Vec<usize>> {
        let lattice = Lattice::new(self.tree.grid().cells, 0);
        Domain::of_labels(lattice, self.tree).components()
    }

    /// Corners of a root tetrahedron, in voxels from the corner of the first cube.
    pub fn root_corners(&self, cell: usize, order: usize) -> [Point; 4] {
        let [nx, ny, _] = self.tree.grid().cells;
        let coordinates = [cell % nx, cell / nx % ny, cell / (nx * ny)];
        root_corners(coordinates, order, self.tree.grid().voxels_per_cell as i32)
    }

    /// The corner of a root cube with the smallest coordinates.
    fn root_low(&self, cell: usize) -> Point {
        let corners = self.root_corners(cell, 0);
        // x0 and x3 are opposite corners of the cube.
        std::array::from_fn(|axis| corners[0][axis].min(corners[3][axis]))
    }

    /// Elasticity of a finest tetrahedron with this content, Pa.
    ///
    /// # Errors
    /// Those of the function behind [`Materials::with_voxels`].
    pub fn elasticity(
        &self,
        of: NodeRef,
        corners: &[Point; 4],
    ) -> Result<Matrix6<f64>, EmbedError> {
        match of.open() {
            Content::Label(label) => {
                Ok(*self.materials.by_label()[usize::from(label)].elasticity())
            }
            Content::Node(_) => {
                let voxel = voxel(self.tree, corners);
                let material = self.materials.of_voxel(voxel, self.tree.majority(of))?;
                Ok(*material.elasticity())
            }
        }
    }

    /// Calls `visit` with the corners and the elasticity of every finest tetrahedron of a root
    /// cube, in a fixed order.
    ///
    /// # Errors
    /// As [`elasticity`](Self::elasticity).
    pub fn visit(
        &self,
        cell: usize,
        visit: &mut dyn FnMut(&[Point; 4], &Matrix6<f64>),
    ) -> Result<(), EmbedError> {
        for order in 0..ROOTS_PER_CELL {
            let corners = self.root_corners(cell, order);
            self.descend(self.tree.root(cell, order), &corners, 0, visit)?;
        }
        Ok(())
    }

    fn descend(
        &self,
        of: NodeRef,
        corners: &[Point; 4],
        level: u8,
        visit: &mut dyn FnMut(&[Point; 4], &Matrix6<f64>),
    ) -> Result<(), EmbedError> {
        if level == self.tree.grid().embed_level() {
            visit(corners, &self.elasticity(of, corners)?);
            return Ok(());
        }
        let halved = bisect(corners, level, midpoint(corners, level));
        for (half, corners) in self.tree.children(of).iter().zip(&halved) {
            self.descend(*half, corners, level + 1, visit)?;
        }
        Ok(())
    }

    /// The displacements h_k of the finest vertices of a component under the six uniform boundary
    /// tractions σ = e_k (Pa, Voigt order), the body free otherwise: ∫ ε(v)ᵀDε(h_k) = ∮ vᵀσ_k n.
    ///
    /// Up to [`DIRECT_VERTICES`] vertices by a sparse Cholesky factorisation, beyond by conjugate
    /// gradients; the same whatever the number of threads. `progress` is told the fraction done
    /// and may stop the work.
    ///
    /// # Errors
    /// [`EmbedError::FineFactor`], [`EmbedError::FineSolve`], [`EmbedError::Stopped`]; those of [`Self::elasticity`].
    pub fn unit_tractions(
        &self,
        cells: &[usize],
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<FineFields, EmbedError> {
        let grid = FineGrid::new(self.tree, cells);
        let stiffness = FineStiffness::new(self, cells, &grid)?;
        let loads = self.traction_loads(cells, &grid)?;
        let values = if grid.len() > DIRECT_VERTICES {
            let multilevel = multilevel::Multilevel::new(self, cells, &grid)?;
            stiffness.conjugate_gradients(&multilevel, &loads, progress)?
        } else {
            let solution = stiffness.cholesky(&grid.elimination_order(), &loads)?;
            if progress(1.0).is_break() {
                return Err(EmbedError::Stopped { done: 1.0 });
            }
            solution
        };
        Ok(FineFields { grid, values })
    }

    /// ∮ N_i σ_k n dA = Σ_tets V G(∇λ_i)ᵀ σ_k, for the σ_k are the same everywhere.
    fn traction_loads(
        &self,
        cells: &[usize],
        grid: &FineGrid,
    ) -> Result<Vec<SixFields>, EmbedError> {
        let mut loads = vec![SixFields::zeros(); grid.len()];
        for &cell in cells {
            self.visit(cell, &mut |corners, _| {
                let geometry = lattice_tet(corners);
                for (p, g) in corners.iter().zip(&geometry.gradients) {
                    loads[grid.vertex(*p)] +=
                        geometry.volume * crate::element::strain_operator(g).transpose();
                }
            })?;
        }
        Ok(loads)
    }
}

/// Displacements of all finest vertices of a component under six loads.
pub struct FineFields {
    grid: FineGrid,
    values: Vec<SixFields>,
}

impl FineFields {
    /// The displacements of the vertex at a lattice point of the component, in voxels.
    pub fn at(&self, p: Point) -> &SixFields {
        &self.values[self.grid.vertex(p)]
    }

    /// E: the strains of the linear interpolation between a tetrahedron's corners, a column per
    /// load.
    pub fn strains(&self, corners: &[Point; 4], geometry: &LinearTet) -> Matrix6<f64> {
        let mut strains = Matrix6::zeros();
        for (p, g) in corners.iter().zip(&geometry.gradients) {
            strains += crate::element::strain_operator(g) * self.at(*p);
        }
        strains
    }
}

/// Rest geometry of lattice corners, in voxels.
pub(crate) fn lattice_tet(corners: &[Point; 4]) -> LinearTet {
    LinearTet::new(&corners.map(|p| Vector3::new(p[0].into(), p[1].into(), p[2].into())))
}

/// The voxel of the image that a finest tetrahedron lies in.
pub(crate) fn voxel(tree: &LabelTree, corners: &[Point; 4]) -> [i64; 3] {
    std::array::from_fn(|axis| {
        let low = corners.iter().map(|p| p[axis]).min().unwrap_or(0);
        tree.grid().first_voxel[axis] + i64::from(low)
    })
}
