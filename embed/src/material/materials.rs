//! What the finest tetrahedra are made of: a material per label, or one per voxel.

use super::elasticity::{FineMaterial, Material};
use crate::error::EmbedError;

/// The material of a voxel, from its place in the image and its dense label.
pub type MaterialOfVoxel = dyn Fn([i64; 3], u16) -> Result<FineMaterial, EmbedError> + Send + Sync;

/// Materials by dense label; entry 0 is what stands for void, a soft ersatz material (a thousandth
/// of the softest tissue, say).
///
/// Labels that [`yawara_mesh::LabelTree::per_voxel`] keeps apart may ask a function instead: for
/// moduli from intensities, random fields or fibres whose direction changes from voxel to voxel.
pub struct Materials {
    by_label: Vec<FineMaterial>,
    by_voxel: Option<Box<MaterialOfVoxel>>,
    void: VoidRule,
}

/// What homogenisation makes of void beside material.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VoidRule {
    /// Void is a soft material like any other.
    #[default]
    Material,
    /// Void takes away stiffness by its volume; what is material is homogenised by itself.
    Volume,
}

impl Materials {
    /// One material per dense label, void first.
    pub fn new(by_label: impl IntoIterator<Item = FineMaterial>) -> Self {
        Self { by_label: by_label.into_iter().collect(), by_voxel: None, void: VoidRule::default() }
    }

    /// Asks `of_voxel` for every voxel of the labels that the tree keeps per voxel. It is called
    /// from several threads, with voxel indices of the image (outside of it too where root cubes
    /// stick out), a few times per voxel.
    pub fn with_voxels(
        mut self,
        of_voxel: impl Fn([i64; 3], u16) -> Result<FineMaterial, EmbedError> + Send + Sync + 'static,
    ) -> Self {
        self.by_voxel = Some(Box::new(of_voxel));
        self
    }

    /// Sets what becomes of void; a global homogenisation has a rule of its own.
    pub fn with_void(self, void: VoidRule) -> Self {
        Self { void, ..self }
    }

    /// What becomes of void.
    pub fn void(&self) -> VoidRule {
        self.void
    }

    /// The materials by dense label.
    pub fn by_label(&self) -> &[FineMaterial] {
        &self.by_label
    }

    /// The material of a dense label.
    ///
    /// # Panics
    /// If there is none.
    pub fn of_label(&self, label: u16) -> &FineMaterial {
        &self.by_label[usize::from(label)]
    }

    /// The material of a voxel of a label that the tree keeps per voxel.
    ///
    /// # Errors
    /// Those of the function that was given.
    pub fn of_voxel(&self, voxel: [i64; 3], label: u16) -> Result<FineMaterial, EmbedError> {
        match &self.by_voxel {
            Some(of_voxel) => of_voxel(voxel, label),
            None => Ok(*self.of_label(label)),
        }
    }
}

impl From<Vec<Material>> for Materials {
    fn from(by_label: Vec<Material>) -> Self {
        Self::new(by_label.into_iter().map(FineMaterial::from))
    }
}
