//! Outlines of labels on a mesh that is fine where they run.

use std::sync::Arc;

use nalgebra::Vector3;

use super::error::SurfaceError;
use super::label_boundary::LabelBoundary;
use super::label_field::LabelField;
use super::surface::{IsoSurface, SurfaceOptions};
use crate::bisection::{BisectionForest, Domain, LabelTree, Placement, Region};
use crate::image::volume::LabelVolume;

/// How far around a label's voxels its mesh is fine, voxels: the field between centres of voxels
/// ends half a voxel beyond them.
const MARGIN: f64 = 0.5;

/// What outline is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Dense label, not 0.
    pub label: u16,
    /// Standard deviation of the blur that rounds off the stairs of voxels, 0 to 16 voxels.
    pub sigma_voxels: f64,
}

/// Surfaces of labels and the forest to whose edges they are bound.
#[derive(Clone, Debug)]
pub struct Outlines {
    /// Refined down to the level asked for wherever one of the outlines runs.
    pub forest: BisectionForest,
    /// Where its lattice lies in the axes of the volume, m.
    pub placement: Placement,
    /// Rest positions by vertex number, m.
    pub rest: Vec<Vector3<f64>>,
    /// One per label asked for, in that order; empty where a blur has taken the label below ½.
    pub surfaces: Vec<IsoSurface>,
}

impl Outlines {
    /// Refines `domain`, which lies on a lattice of `level`, and cuts it at level ½ of each
    /// blurred label.
    ///
    /// Cost: O(tetrahedra that an outline passes through, per level) and O(voxels) per label.
    ///
    /// # Errors
    /// As [`BisectionForest::new`], [`LabelBoundary::new`] and [`LabelField::blurred`].
    pub fn new(
        volume: &LabelVolume,
        tree: &Arc<LabelTree>,
        domain: Domain,
        level: u8,
        asked: &[Outline],
    ) -> Result<Self, SurfaceError> {
        let boundaries: Vec<LabelBoundary> = asked
            .iter()
            .map(|outline| LabelBoundary::new(volume, outline.label))
            .collect::<Result<_, _>>()?;
        let voxel_m = volume.grid().spacing_mm * 1e-3;
        let placement = tree.grid().placement(voxel_m, domain.lattice());
        let mut forest = BisectionForest::new(domain, Arc::clone(tree), 0, level)?;
        forest.refine_where(level, usize::MAX, Region::Everywhere, &|forest, tet| {
            boundaries.iter().any(|boundary| boundary.crosses(forest, tet, MARGIN))
        })?;
        let surfaces = asked
            .iter()
            .map(|outline| {
                let field = LabelField::blurred(volume, outline.label, outline.sigma_voxels)?;
                let values = field.on_vertices(&forest);
                IsoSurface::of_forest(&forest, &values, SurfaceOptions::of_label(outline.label))
            })
            .collect::<Result<_, _>>()?;
        let mut rest = vec![Vector3::zeros(); forest.vertex_capacity()];
        for v in forest.vertices() {
            rest[v.index()] = placement.position(forest.point(v));
        }
        Ok(Self { forest, placement, rest, surfaces })
    }
}
