//! The fine meshes on which outlines are cut.

use yawara_mesh::isosurface::{Outline, Outlines};
use yawara_mesh::lattice::MAX_LEVEL;
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{BisectionForest, Domain, Lattice};

use crate::error::SimError;
use crate::scene::Scene;
#[cfg(feature = "view")]
use crate::scene::{Output, SurfaceEntry};

/// How many edges of the mesh of an outline for the eye fit into the body's longest side at least.
const EDGES_FOR_THE_EYE: f64 = 48.0;

/// Cuts the blurred labels of `volume`, which has the grid of the labels of `coarse`, at level ½ on
/// a mesh of `level`.
pub(crate) fn cut(
    coarse: &BisectionForest,
    volume: &LabelVolume,
    level: u8,
    outlines: &[Outline],
) -> Result<Outlines, SimError> {
    let domain = same_cells(coarse, level);
    Ok(Outlines::new(volume, coarse.tree(), domain, level, outlines)?)
}

/// The same labels with 1 for all that is not void.
pub(crate) fn solid(volume: &LabelVolume) -> Result<LabelVolume, SimError> {
    let solid = volume.labels().iter().map(|&label| u16::from(label > 0)).collect();
    Ok(LabelVolume::new(volume.grid().clone(), solid, vec![0, 1])?)
}

/// Cuts the outline of all that is not void as fine as eyes want it: edges of two voxels or a 48th of
/// the body's longest side, whichever is longer, unless the simulation may refine beyond that.
pub(crate) fn cut_for_the_eye(
    coarse: &BisectionForest,
    volume: &LabelVolume,
) -> Result<Outlines, SimError> {
    let grid = coarse.tree().grid();
    let cells = grid.cells.into_iter().max().unwrap_or(1) as f64;
    // Three levels halve the edges.
    let wanted = 3.0 * (EDGES_FOR_THE_EYE / cells).log2().ceil().max(0.0);
    let of_two_voxels = grid.embed_level().saturating_sub(3);
    let level = (wanted as u8).min(of_two_voxels).max(coarse.max_level()).min(MAX_LEVEL);
    // Without a blur of half an edge the surface has stairs.
    let edge = grid.voxels_per_cell as f64 / f64::from(level / 3).exp2();
    let outline = Outline { label: 1, sigma_voxels: (0.5 * edge).clamp(1.0, 16.0) };
    cut(coarse, &solid(volume)?, level, &[outline])
}

/// Has `output` name the outlines of all labels but that of most voxels, which looks like the body's.
#[cfg(feature = "view")]
pub(crate) fn outline_inner(output: &mut Output, volume: &LabelVolume) {
    let mut counts = vec![0usize; volume.values().len()];
    volume.labels().iter().for_each(|&dense| counts[dense as usize] += 1);
    let most = (1..counts.len()).max_by_key(|&dense| counts[dense]);
    let inner = (1..counts.len()).filter(|&dense| Some(dense) != most && counts[dense] > 0);
    let entry = |dense: usize| SurfaceEntry { label: volume.values()[dense], sigma_voxels: 1.0 };
    output.surfaces = inner.map(entry).collect();
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
pub(crate) fn surface_level(scene: &Scene, forest: &BisectionForest) -> u8 {
    let voxel = forest.tree().grid().embed_level();
    let asked = scene.output.surface_level.unwrap_or(voxel);
    // A whole lattice unit of the coarse mesh must be one of the fine mesh.
    asked.max(scene.mesh.finest_level()).min(MAX_LEVEL)
}
