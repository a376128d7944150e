//! The homogenised material of every tetrahedron, computed once, bottom-up.

use std::sync::Arc;

use nalgebra::{Matrix6, Vector3};
use rayon::prelude::*;
use yawara_mesh::kuhn::{Point, ROOTS_PER_CELL, bisect, bisected_corner, midpoint, root_corners};
use yawara_mesh::{Content, LabelTree, NodeRef};

use crate::elasticity::Material;
use crate::element::LinearTet;
use crate::error::EmbedError;
use crate::homogenisation::{ChildPair, Homogenisation, ParentMaterial};

/// Entries of a symmetric 6×6 matrix.
const PACKED: usize = 21;

/// Elasticity and density of every tetrahedron of a [`LabelTree`].
///
/// Memory: 21 numbers and a density per heterogeneous tetrahedron; a homogeneous subtree is one
/// label whose material is looked up.
pub struct Embedding {
    tree: Arc<LabelTree>,
    homogenisation: Box<dyn Homogenisation>,
    materials: Vec<Material>,
    elasticity_of_label: Vec<Matrix6<f64>>,
    elasticity_of_node: Vec<[f64; PACKED]>,
    density_of_node: Vec<f64>,
}

impl Embedding {
    /// Homogenises all levels of `tree`, in parallel over root cubes; deterministic.
    ///
    /// `materials` holds one material per dense label; entry 0 is what stands for void.
    /// Cost: one [`Homogenisation::combine`] per heterogeneous tetrahedron.
    ///
    /// # Errors
    /// [`EmbedError::MissingMaterial`]; [`EmbedError::NotPositiveDefinite`] if the
    /// homogenisation gives a matrix that is not symmetric positive definite.
    pub fn new(
        tree: Arc<LabelTree>,
        materials: Vec<Material>,
        homogenisation: Box<dyn Homogenisation>,
    ) -> Result<Self, EmbedError> {
        let cell_count: usize = tree.grid().cells.iter().product();
        for cell in 0..cell_count {
            for order in 0..ROOTS_PER_CELL {
                for &label in tree.labels(tree.root(cell, order)).as_slice() {
                    if usize::from(label) >= materials.len() {
                        let given = materials.len();
                        return Err(EmbedError::MissingMaterial { label, given });
                    }
                }
            }
        }
        let mut embedding = Self {
            elasticity_of_label: materials.iter().map(Material::elasticity).collect(),
            materials,
            homogenisation,
            elasticity_of_node: Vec::with_capacity(tree.node_count()),
            density_of_node: Vec::with_capacity(tree.node_count()),
            tree,
        };
        let parts: Vec<(Vec<_>, Vec<_>)> = (0..cell_count)
            .into_par_iter()
            .map(|cell| CellPart::build(&embedding, cell).map(|p| (p.elasticity, p.density)))
            .collect::<Result<_, _>>()?;
        for (elasticity, density) in parts {
            embedding.elasticity_of_node.extend(elasticity);
            embedding.density_of_node.extend(density);
        }
        Ok(embedding)
    }

    /// The labels behind it.
    pub fn tree(&self) -> &Arc<LabelTree> {
        &self.tree
    }

    /// The stage that made it.
    pub fn homogenisation(&self) -> &dyn Homogenisation {
        self.homogenisation.as_ref()
    }

    /// Elasticity D of a tetrahedron's content, Pa.
    pub fn elasticity(&self, of: NodeRef) -> Matrix6<f64> {
        match of.open() {
            Content::Label(label) => self.elasticity_of_label[usize::from(label)],
            Content::Node(i) => unpack(&self.elasticity_of_node[i]),
        }
    }

    /// Mean density of a tetrahedron's content, kg/m³.
    pub fn density(&self, of: NodeRef) -> f64 {
        match of.open() {
            Content::Label(label) => self.materials[usize::from(label)].density_kg_m3(),
            Content::Node(i) => self.density_of_node[i],
        }
    }

    /// The materials, by dense label.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The halves of a tetrahedron with this rest geometry, and what the homogenisation makes of
    /// them. A tetrahedron of one label keeps its own material under every homogenisation.
    pub fn combine(
        &self,
        parent: NodeRef,
        geometry: &LinearTet,
        level: u8,
    ) -> (ChildPair, ParentMaterial) {
        let elasticity = self.tree.children(parent).map(|half| self.elasticity(half));
        let pair = ChildPair::new(geometry, 0, bisected_corner(level), elasticity);
        let combined = match parent.open() {
            Content::Label(_) => ParentMaterial::uniform(elasticity[0]),
            Content::Node(_) => self.homogenisation.combine(&pair),
        };
        (pair, combined)
    }

    /// Bytes held, without the label tree.
    pub fn bytes(&self) -> usize {
        self.elasticity_of_node.len() * (PACKED + 1) * size_of::<f64>()
    }
}

/// One root cube's share, in the tree's order: children before parents.
struct CellPart<'a> {
    embedding: &'a Embedding,
    cell: usize,
    first: usize,
    elasticity: Vec<[f64; PACKED]>,
    density: Vec<f64>,
}

impl<'a> CellPart<'a> {
    fn build(embedding: &'a Embedding, cell: usize) -> Result<Self, EmbedError> {
        let tree = &embedding.tree;
        let nodes = tree.cell_nodes(cell);
        let mut part = Self {
            embedding,
            cell,
            first: nodes.start,
            elasticity: Vec::with_capacity(nodes.len()),
            density: Vec::with_capacity(nodes.len()),
        };
        let [nx, ny, _] = tree.grid().cells;
        let coordinates = [cell % nx, cell / nx % ny, cell / (nx * ny)];
        let units = tree.grid().voxels_per_cell as i32;
        for order in 0..ROOTS_PER_CELL {
            part.descend(tree.root(cell, order), root_corners(coordinates, order, units), 0)?;
        }
        Ok(part)
    }

    /// Homogenises below and at `of`; visits nodes in the order in which the tree numbers them.
    fn descend(&mut self, of: NodeRef, corners: [Point; 4], level: u8) -> Result<(), EmbedError> {
        let Content::Node(index) = of.open() else {
            return Ok(());
        };
        let tree = &self.embedding.tree;
        let halves = tree.children(of);
        let halved = bisect(&corners, level, midpoint(&corners, level));
        self.descend(halves[0], halved[0], level + 1)?;
        self.descend(halves[1], halved[1], level + 1)?;
        debug_assert_eq!(index, self.first + self.elasticity.len());

        let geometry =
            LinearTet::new(&corners.map(|p| Vector3::new(p[0].into(), p[1].into(), p[2].into())));
        let elasticity = halves.map(|half| self.elasticity(half));
        let pair = ChildPair::new(&geometry, 0, bisected_corner(level), elasticity);
        let parent = self.embedding.homogenisation.combine(&pair).elasticity;
        self.check(&parent, level)?;
        self.elasticity.push(pack(&parent));
        self.density.push(0.5 * (self.density(halves[0]) + self.density(halves[1])));
        Ok(())
    }

    fn elasticity(&self, of: NodeRef) -> Matrix6<f64> {
        match of.open() {
            Content::Label(label) => self.embedding.elasticity_of_label[usize::from(label)],
            Content::Node(i) => unpack(&self.elasticity[i - self.first]),
        }
    }

    fn density(&self, of: NodeRef) -> f64 {
        match of.open() {
            Content::Label(label) => self.embedding.materials[usize::from(label)].density_kg_m3(),
            Content::Node(i) => self.density[i - self.first],
        }
    }

    fn check(&self, elasticity: &Matrix6<f64>, level: u8) -> Result<(), EmbedError> {
        let scale = elasticity.amax();
        let symmetric = (elasticity - elasticity.transpose()).amax() <= 1e-12 * scale;
        if symmetric && elasticity.cholesky().is_some() {
            return Ok(());
        }
        let eigenvalue = elasticity.symmetric_eigenvalues().min();
        let name = self.embedding.homogenisation.name().to_owned();
        Err(EmbedError::NotPositiveDefinite { name, eigenvalue, level, cell: self.cell })
    }
}

fn pack(matrix: &Matrix6<f64>) -> [f64; PACKED] {
    let mut packed = [0.0; PACKED];
    let lower = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
    for (slot, (i, j)) in packed.iter_mut().zip(lower) {
        *slot = matrix[(i, j)];
    }
    packed
}

fn unpack(packed: &[f64; PACKED]) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| packed[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)])
}
