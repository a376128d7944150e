//! The homogenised material of every tetrahedron, computed once, bottom-up.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Matrix6;
use rayon::prelude::*;
use yawara_mesh::kuhn::{Point, ROOTS_PER_CELL, bisect, bisected_corner, midpoint};
use yawara_mesh::{Content, LabelTree, NodeRef};

use crate::error::EmbedError;
use crate::fine::{FineBody, lattice_tet, voxel};
use crate::homogenisation::{ChildPair, Excess, Homogenisation, ParentMaterial, combine_solids};
use crate::linear_tet::LinearTet;
use crate::material::{Material, Materials, Packed6, VoidRule};

/// Elasticity and density of every tetrahedron of a [`LabelTree`].
///
/// Memory: 21 numbers and a density per heterogeneous tetrahedron, as many again beside a global
/// homogenisation; a homogeneous subtree is one label whose material is looked up.
pub struct Embedding {
    pub(crate) tree: Arc<LabelTree>,
    pub(crate) homogenisation: Box<dyn Homogenisation>,
    pub(crate) materials: Materials,
    pub(crate) elasticity_of_node: Vec<Packed6>,
    pub(crate) density_of_node: Vec<f64>,
    /// What the local rule makes of each node, beside a global one.
    local_of_node: Vec<Packed6>,
    left_to_local_rule: usize,
    /// The fraction of each node's volume that is not void; empty where void is a material.
    pub(crate) solid_of_node: Vec<f64>,
}

impl Embedding {
    /// Homogenises all levels of `tree`, in parallel over root cubes; deterministic.
    ///
    /// `materials` holds one material per dense label; entry 0 is what stands for void.
    /// Cost: one [`Homogenisation::combine`] per heterogeneous tetrahedron; a global homogenisation
    /// first solves the fine body.
    ///
    /// # Errors
    /// [`EmbedError::MissingMaterial`]; [`EmbedError::NotPositiveDefinite`] if the
    /// homogenisation gives a matrix that is not symmetric positive definite; those of a global
    /// homogenisation.
    pub fn new(
        tree: Arc<LabelTree>,
        materials: Vec<Material>,
        homogenisation: Box<dyn Homogenisation>,
    ) -> Result<Self, EmbedError> {
        Self::with_materials(tree, materials.into(), homogenisation, &mut |_| {
            ControlFlow::Continue(())
        })
    }

    /// As [`new`](Self::new), for materials of any symmetry and those that differ from voxel to
    /// voxel; a global homogenisation tells `progress` the fraction done, and stops where that
    /// says so.
    ///
    /// # Errors
    /// As [`new`](Self::new), and those of a function behind [`Materials::with_voxels`].
    pub fn with_materials(
        tree: Arc<LabelTree>,
        materials: Materials,
        homogenisation: Box<dyn Homogenisation>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, EmbedError> {
        let rule = Rule::new(&tree, &materials, homogenisation.as_ref(), progress)?;
        let parts = rule.parts()?;
        let nodes = tree.node_count();
        let mut embedding = Self {
            tree,
            homogenisation,
            materials,
            elasticity_of_node: Vec::new(),
            density_of_node: Vec::new(),
            local_of_node: Vec::new(),
            left_to_local_rule: 0,
            solid_of_node: Vec::new(),
        };
        embedding.take(&parts, nodes);
        Ok(embedding)
    }

    /// Enters what root cubes have found, of so many nodes in all.
    fn take(&mut self, parts: &[Found], nodes: usize) {
        let none = Packed6::ZERO;
        for part in parts {
            put(&mut self.elasticity_of_node, (nodes, none), part.first, &part.elasticity);
            put(&mut self.density_of_node, (nodes, 0.0), part.first, &part.density);
            put(&mut self.local_of_node, (nodes, none), part.first, &part.local);
            put(&mut self.solid_of_node, (nodes, 0.0), part.first, &part.solid);
            self.left_to_local_rule += part.left;
        }
    }

    /// Homogenises anew what is in `cells`, the root cubes in which `tree`, an
    /// [edited](LabelTree::edited) one on the same grid, differs from the tree before.
    ///
    /// Cost: one [`Homogenisation::combine`] per heterogeneous tetrahedron of these cubes.
    ///
    /// # Errors
    /// [`EmbedError::Edit`] under a global homogenisation; those of [`new`](Self::new). Then nothing has changed.
    pub fn relabel(&mut self, tree: Arc<LabelTree>, cells: &[usize]) -> Result<(), EmbedError> {
        let (homogenisation, materials) = (self.homogenisation.as_ref(), &self.materials);
        if homogenisation.global().is_some() {
            return Err(EmbedError::Edit { name: homogenisation.name().to_owned() });
        }
        check_labels(&tree, materials, cells.iter().copied())?;
        let body = FineBody::new(&tree, materials);
        let rule = Rule { body, homogenisation, given: None };
        let build = |&cell: &usize| CellPart::build(&rule, cell);
        let parts: Vec<Found> = cells.par_iter().map(build).collect::<Result<_, _>>()?;
        let nodes = tree.node_count();
        self.take(&parts, nodes);
        self.tree = tree;
        Ok(())
    }

    /// What the same homogenisation makes of the same labels with other materials: elasticities alone, 21
    /// numbers per heterogeneous tetrahedron.
    ///
    /// # Errors
    /// As [`with_materials`](Self::with_materials).
    pub fn of_others(
        &self,
        materials: &Materials,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Elasticities, EmbedError> {
        let rule = Rule::new(&self.tree, materials, self.homogenisation(), progress)?;
        let parts = rule.parts()?;
        let (mut of_node, none) = (Vec::new(), Packed6::ZERO);
        for part in &parts {
            put(&mut of_node, (self.tree.node_count(), none), part.first, &part.elasticity);
        }
        let of_label = materials.by_label().iter().map(|material| *material.elasticity()).collect();
        Ok(Elasticities { of_label, of_node })
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
            Content::Label(label) => *self.materials.of_label(label).elasticity(),
            Content::Node(i) => self.elasticity_of_node[i].matrix(),
        }
    }

    /// Mean density of a tetrahedron's content, kg/m³.
    pub fn density(&self, of: NodeRef) -> f64 {
        match of.open() {
            Content::Label(label) => self.materials.of_label(label).density_kg_m3(),
            Content::Node(i) => self.density_of_node[i],
        }
    }

    /// What the finest tetrahedra are made of.
    pub fn materials(&self) -> &Materials {
        &self.materials
    }

    /// Heterogeneous tetrahedra that a global homogenisation left to its local rule; 0 for a local
    /// homogenisation.
    pub fn left_to_local_rule(&self) -> usize {
        self.left_to_local_rule
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
            // A finest tetrahedron with a material of its own.
            Content::Node(_) if self.tree.children(parent)[0] == parent => {
                ParentMaterial::uniform(elasticity[0])
            }
            Content::Node(i) if self.homogenisation.global().is_some() => {
                let elasticity = self.tree.children(parent).map(|half| match half.open() {
                    Content::Label(_) => self.elasticity(half),
                    Content::Node(i) => self.local_of_node[i].matrix(),
                });
                let local = ChildPair { elasticity, ..pair };
                ParentMaterial {
                    elasticity: self.elasticity_of_node[i].matrix(),
                    excess: Excess::Unfactored,
                    ..self.homogenisation.combine(&local)
                }
            }
            Content::Node(_) => self.combine_halves(&pair, self.tree.children(parent)),
        };
        (pair, combined)
    }

    /// What the local rule makes of two halves.
    fn combine_halves(&self, pair: &ChildPair, halves: [NodeRef; 2]) -> ParentMaterial {
        let rule = self.homogenisation.as_ref();
        if self.materials.void() == VoidRule::Material {
            return rule.combine(pair);
        }
        let fraction = |half: NodeRef| match half.open() {
            Content::Label(label) => solid_fraction(label),
            Content::Node(i) => self.solid_of_node[i],
        };
        let void = self.materials.by_label()[0].elasticity();
        combine_solids(rule, pair, halves.map(fraction), void)
    }

    /// The mean D of every node's finest tetrahedra by its number, Pa, whatever the homogenisation.
    pub(crate) fn mean_elasticities(&self) -> MeanElasticities<'_> {
        let mut means = MeanElasticities { embedding: self, of_node: Vec::new() };
        for (i, own) in self.elasticity_of_node.iter().enumerate() {
            let [first, second] = self.tree.children(NodeRef::node(i));
            // A finest tetrahedron has itself for halves.
            let mean = match first == NodeRef::node(i) {
                true => *own,
                false => Packed6::new(&(0.5 * (means.of(first) + means.of(second)))),
            };
            means.of_node.push(mean);
        }
        means
    }

    /// Bytes held, without the label tree.
    pub fn bytes(&self) -> usize {
        (self.elasticity_of_node.len() + self.local_of_node.len()) * size_of::<Packed6>()
            + (self.density_of_node.len() + self.solid_of_node.len()) * size_of::<f64>()
    }
}

/// What [`Embedding::mean_elasticities`] gives.
pub(crate) struct MeanElasticities<'a> {
    embedding: &'a Embedding,
    of_node: Vec<Packed6>,
}

impl MeanElasticities<'_> {
    /// The mean D of a tetrahedron's content, Pa.
    pub fn of(&self, content: NodeRef) -> Matrix6<f64> {
        match content.open() {
            Content::Label(_) => self.embedding.elasticity(content),
            Content::Node(i) => self.of_node[i].matrix(),
        }
    }
}

/// Of a voxel's volume; label 0 is void.
pub(crate) fn solid_fraction(label: u16) -> f64 {
    if label == 0 { 0.0 } else { 1.0 }
}

fn check_labels(
    tree: &LabelTree,
    materials: &Materials,
    cells: impl Iterator<Item = usize>,
) -> Result<(), EmbedError> {
    let given = materials.by_label().len();
    for cell in cells {
        for order in 0..ROOTS_PER_CELL {
            for &label in tree.labels(tree.root(cell, order)).as_slice() {
                if usize::from(label) >= given {
                    return Err(EmbedError::MissingMaterial { label, given });
                }
            }
        }
    }
    Ok(())
}

/// Elasticities of every tetrahedron of a label tree with other materials than its [`Embedding`]'s.
pub struct Elasticities {
    of_label: Vec<Matrix6<f64>>,
    of_node: Vec<Packed6>,
}

impl Elasticities {
    /// D of a tetrahedron's content, Pa.
    pub fn of(&self, content: NodeRef) -> Matrix6<f64> {
        match content.open() {
            Content::Label(label) => self.of_label[usize::from(label)],
            Content::Node(i) => self.of_node[i].matrix(),
        }
    }
}

/// What every root cube is homogenised by.
struct Rule<'a> {
    body: FineBody<'a>,
    homogenisation: &'a dyn Homogenisation,
    /// By node, from a global homogenisation.
    given: Option<Vec<Option<Packed6>>>,
}

impl<'a> Rule<'a> {
    fn new(
        tree: &'a LabelTree,
        materials: &'a Materials,
        homogenisation: &'a dyn Homogenisation,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, EmbedError> {
        check_labels(tree, materials, 0..tree.grid().cells.iter().product())?;
        let body = FineBody::new(tree, materials);
        let global = homogenisation.global();
        let given = global.map(|global| global.homogenise(&body, progress)).transpose()?;
        if let Some(found) = given.as_ref().map(Vec::len).filter(|&n| n != tree.node_count()) {
            let (name, want) = (homogenisation.name().to_owned(), tree.node_count());
            return Err(EmbedError::NodeCount { name, found, want });
        }
        Ok(Self { body, homogenisation, given })
    }

    /// Each root cube's share.
    fn parts(&self) -> Result<Vec<Found>, EmbedError> {
        let cell_count: usize = self.body.tree().grid().cells.iter().product();
        (0..cell_count).into_par_iter().map(|cell| CellPart::build(self, cell)).collect()
    }
}

/// One root cube's share, in the tree's order: children before parents.
#[derive(Default)]
struct Found {
    /// The number of its first node.
    first: usize,
    elasticity: Vec<Packed6>,
    density: Vec<f64>,
    /// By the local rule alone; empty unless there is a global one.
    local: Vec<Packed6>,
    left: usize,
    /// Fractions that are not void; empty where void is a material.
    solid: Vec<f64>,
}

/// Enters the values of a root cube's nodes, the first of them of number `first`, among those of so many nodes;
/// what no root cube has is filled in.
pub(crate) fn put<T: Copy>(all: &mut Vec<T>, (nodes, fill): (usize, T), first: usize, own: &[T]) {
    if !own.is_empty() {
        all.resize(nodes, fill);
        all[first..first + own.len()].copy_from_slice(own);
    }
}

/// Finds one root cube's share.
struct CellPart<'a> {
    rule: &'a Rule<'a>,
    cell: usize,
    found: Found,
}

impl<'a> CellPart<'a> {
    fn build(rule: &'a Rule<'a>, cell: usize) -> Result<Found, EmbedError> {
        let nodes = rule.body.tree().cell_nodes(cell);
        let found = Found {
            first: nodes.start,
            elasticity: Vec::with_capacity(nodes.len()),
            density: Vec::with_capacity(nodes.len()),
            ..Found::default()
        };
        let mut part = Self { rule, cell, found };
        for order in 0..ROOTS_PER_CELL {
            let root = rule.body.tree().root(cell, order);
            part.descend(root, rule.body.root_corners(cell, order), 0)?;
        }
        Ok(part.found)
    }

    /// Homogenises below and at `of`; visits nodes in the order in which the tree numbers them.
    fn descend(&mut self, of: NodeRef, corners: [Point; 4], level: u8) -> Result<(), EmbedError> {
        let Content::Node(index) = of.open() else {
            return Ok(());
        };
        let tree = self.rule.body.tree();
        let halves = tree.children(of);
        if halves[0] == of {
            let materials = self.rule.body.materials();
            let material = materials.of_voxel(voxel(tree, &corners), tree.majority(of))?;
            let packed = Packed6::new(material.elasticity());
            self.found.elasticity.push(packed);
            self.found.local.extend(self.rule.given.as_ref().map(|_| packed));
            self.found.density.push(material.density_kg_m3());
            let fraction = solid_fraction(tree.majority(of));
            self.found.solid.extend(self.scales_by_volume().then_some(fraction));
            return Ok(());
        }
        let halved = bisect(&corners, level, midpoint(&corners, level));
        self.descend(halves[0], halved[0], level + 1)?;
        self.descend(halves[1], halved[1], level + 1)?;
        debug_assert_eq!(index, self.found.first + self.found.elasticity.len());

        let elasticity = halves.map(|half| self.local_elasticity(half));
        let geometry = lattice_tet(&corners);
        let pair = ChildPair::new(&geometry, 0, bisected_corner(level), elasticity);
        let rule = self.rule.homogenisation;
        let local = if self.scales_by_volume() {
            let fractions = halves.map(|half| self.solid_fraction(half));
            self.found.solid.push(0.5 * (fractions[0] + fractions[1]));
            let void = self.rule.body.materials().by_label()[0].elasticity();
            combine_solids(rule, &pair, fractions, void).elasticity
        } else {
            rule.combine(&pair).elasticity
        };
        self.check(&local, level)?;
        let local = Packed6::new(&local);
        match self.rule.given.as_ref().map(|given| given[index]) {
            None => self.found.elasticity.push(local),
            Some(given) => {
                if let Some(given) = given {
                    self.check(&given.matrix(), level)?;
                }
                self.found.left += usize::from(given.is_none());
                self.found.elasticity.push(given.unwrap_or(local));
                self.found.local.push(local);
            }
        }
        self.found.density.push(0.5 * (self.density(halves[0]) + self.density(halves[1])));
        Ok(())
    }

    /// Whether void takes away stiffness by its volume.
    fn scales_by_volume(&self) -> bool {
        let is_local = self.rule.given.is_none();
        is_local && self.rule.body.materials().void() == VoidRule::Volume
    }

    fn solid_fraction(&self, of: NodeRef) -> f64 {
        match of.open() {
            Content::Label(label) => solid_fraction(label),
            Content::Node(i) => self.found.solid[i - self.found.first],
        }
    }

    /// What the local rule makes of a half.
    fn local_elasticity(&self, of: NodeRef) -> Matrix6<f64> {
        let nodes =
            if self.rule.given.is_some() { &self.found.local } else { &self.found.elasticity };
        match of.open() {
            Content::Label(label) => *self.rule.body.materials().of_label(label).elasticity(),
            Content::Node(i) => nodes[i - self.found.first].matrix(),
        }
    }

    fn density(&self, of: NodeRef) -> f64 {
        match of.open() {
            Content::Label(label) => self.rule.body.materials().of_label(label).density_kg_m3(),
            Content::Node(i) => self.found.density[i - self.found.first],
        }
    }

    fn check(&self, elasticity: &Matrix6<f64>, level: u8) -> Result<(), EmbedError> {
        let scale = elasticity.amax();
        let symmetric = (elasticity - elasticity.transpose()).amax() <= 1e-12 * scale;
        if symmetric && elasticity.cholesky().is_some() {
            return Ok(());
        }
        let eigenvalue = elasticity.symmetric_eigenvalues().min();
        let name = self.rule.homogenisation.name().to_owned();
        Err(EmbedError::NotPositiveDefinite { name, eigenvalue, level, cell: self.cell })
    }
}
