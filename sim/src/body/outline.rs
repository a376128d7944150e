//! The fine mesh on which outlines of labels are cut.

use yawara_mesh::isosurface::{Outline, Outlines};
use yawara_mesh::lattice::MAX_LEVEL;
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{BisectionForest, Domain, Lattice};

use super::image_body::ImageBody;
use crate::error::SimError;
use crate::scene::Scene;

/// Cuts the blurred labels of `volume`, which has the grid of `setup`, at level ½.
pub(crate) fn cut(
    scene: &Scene,
    setup: &ImageBody,
    volume: &LabelVolume,
    outlines: &[Outline],
) -> Result<Outlines, SimError> {
    let level = surface_level(scene, setup);
    let domain = same_cells(&setup.forest, level);
    Ok(Outlines::new(volume, &setup.tree, domain, level, outlines)?)
}

/// The root cubes of a mesh on a lattice of `level`.
pub(crate) fn same_cells(coarse: &BisectionForest, level: u8) -> Domain {
    let lattice = Lattice::new(coarse.domain().lattice().cells, level);
    let mut domain = Domain::of_labels(lattice, coarse.tree());
    let is_dropped = |&cell: &usize| !coarse.domain().has_cell(cell);
    let dropped: Vec<usize> = domain.cells().filter(is_dropped).collect();
    domain.exclude(&dropped);
    domain
}

/// The finest level of the surfaces' mesh: one voxel, unless the scene says otherwise, and never
/// coarser than what the simulation may refine to.
pub(crate) fn surface_level(scene: &Scene, setup: &ImageBody) -> u8 {
    let voxel = setup.tree.grid().embed_level();
    let asked = scene.output.surface_level.unwrap_or(voxel);
    // A whole lattice unit of the coarse mesh must be one of the fine mesh.
    asked.max(scene.mesh.finest_level()).min(MAX_LEVEL)
}
