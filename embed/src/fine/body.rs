//! A body as its finest tetrahedra.

use nalgebra::{Matrix6, SMatrix, Vector3};
use yawara_mesh::kuhn::{Point, ROOTS_PER_CELL, bisect, midpoint, root_corners};
use yawara_mesh::{Content, Domain, LabelTree, Lattice, NodeRef};

use crate::error::EmbedError;
use crate::linear_tet::LinearTet;
use crate::material::Materials;

/// Six displacements of a vertex, one per load: 3×6.
pub type SixFields = SMatrix<f64, 3, 6>;

/// Makes a value of a tetrahedron from its content, its corners, its level and, unless it is a finest
/// one, the values of its halves.
pub(crate) type Node<'a, T> =
    dyn FnMut(NodeRef, &[Point; 4], u8, Option<[T; 2]>) -> Result<T, EmbedError> + 'a;

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
    pub(super) fn root_low(&self, cell: usize) -> Point {
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
            Content::Label(label) => Ok(*self.materials.of_label(label).elasticity()),
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
            self.fold(cell, order, &mut |of, corners, _, halves: Option<[(); 2]>| {
                if halves.is_none() {
                    visit(corners, &self.elasticity(of, corners)?);
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Goes through a root tetrahedron and all inside it, halves before wholes; what `node` makes of
    /// the root is returned.
    pub(crate) fn fold<T>(
        &self,
        cell: usize,
        order: usize,
        node: &mut Node<'_, T>,
    ) -> Result<T, EmbedError> {
        self.fold_at(self.tree.root(cell, order), &self.root_corners(cell, order), 0, node)
    }

    /// [`fold`](Self::fold) from a tetrahedron of any level.
    pub(crate) fn fold_at<T>(
        &self,
        of: NodeRef,
        corners: &[Point; 4],
        level: u8,
        node: &mut Node<'_, T>,
    ) -> Result<T, EmbedError> {
        if level == self.tree.grid().embed_level() {
            return node(of, corners, level, None);
        }
        let [first, second] = self.tree.children(of);
        let halved = bisect(corners, level, midpoint(corners, level));
        let first = self.fold_at(first, &halved[0], level + 1, node)?;
        let second = self.fold_at(second, &halved[1], level + 1, node)?;
        node(of, corners, level, Some([first, second]))
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
