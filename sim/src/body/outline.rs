//! The fine mesh on which outlines of labels are cut.

use yawara_mesh::lattice::MAX_LEVEL;
use yawara_mesh::{Domain, Lattice};

use super::image_body::ImageBody;
use crate::scene::Scene;

/// The root cubes of the simulation on a lattice of `level`.
pub(crate) fn carrier(setup: &ImageBody, level: u8) -> Domain {
    let coarse = setup.forest.domain();
    let lattice = Lattice::new(setup.tree.grid().cells, level);
    let mut domain = Domain::of_labels(lattice, &setup.tree);
    let dropped: Vec<usize> = domain.cells().filter(|&cell| !coarse.has_cell(cell)).collect();
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
