//! The start mesh refined towards the boundaries of labels, which merging then keeps.

use yawara_mesh::{BisectionForest, Placement};

use super::organ_box::{OrganBox, Zone};
use super::places::Places;
use super::summary::LabelRefinementSummary;
use crate::error::SimError;
use crate::scene::Scene;

/// How far beyond a region a lattice point may be and count as on its edge, in lattice units.
const SLACK: f64 = 1e-6;

/// Refines to `label_level` under `max_vertices` and makes the result the floor of merging.
/// Nothing happens unless the scene asks for more than the start level.
pub(crate) fn refine(
    forest: &mut BisectionForest,
    scene: &Scene,
    places: &Places,
    placement: &Placement,
) -> Result<Option<LabelRefinementSummary>, SimError> {
    let mesh = &scene.mesh;
    let Some(level) = mesh.label_level.filter(|&level| level > mesh.start_level) else {
        return Ok(None);
    };
    let region = match &mesh.label_region {
        Some(region) => {
            let zone = places.zone(region, "mesh.label_region")?;
            in_lattice(&zone, &places.organ, placement)
        }
        None => yawara_mesh::Region::Everywhere,
    };
    let done = forest.refine_to_labels(level, mesh.max_vertices, region)?;
    forest.make_floor();
    Ok(Some(LabelRefinementSummary { level, vertices: done.added, tets_left: done.left }))
}

/// A zone of the organ's box in lattice units.
fn in_lattice(
    zone: &Zone,
    organ: &OrganBox,
    placement: &Placement,
) -> yawara_mesh::Region<'static> {
    let at = |fraction| (organ.at(fraction) - placement.origin) / placement.unit;
    match zone {
        // Corners of tetrahedra are integers: the closed box may shrink to them.
        Zone::Box { min, max } => yawara_mesh::Region::Box(
            at(*min).map(|x| (x - SLACK).ceil() as i32).into(),
            at(*max).map(|x| (x + SLACK).floor() as i32).into(),
        ),
        Zone::Sphere { centre, radius_m } => {
            yawara_mesh::Region::Ball(at(*centre).into(), radius_m / placement.unit + SLACK)
        }
    }
}
