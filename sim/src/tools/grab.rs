//! `grab`: takes hold of vertices and moves them rigidly.

use nalgebra::{Rotation3, Unit, Vector3};
use yawara_mesh::VertexId;

use super::path::Path;
use super::tool::Tool;
use crate::body::{Hold, Start};
use crate::error::SimError;
use crate::scene::Region;

/// Held vertices follow x = c + R(t)(X − c) + d(t), c the centre of the region at rest.
pub(super) struct Grab {
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    path: Path,
    release_s: Option<f64>,
}

impl Grab {
    pub fn new(
        start: &Start,
        region: &Region,
        turn_axis: [f64; 3],
        path: Path,
        release_s: Option<f64>,
    ) -> Self {
        Self {
            centre: region.centre(&start.organ),
            axis: start.axes.to_solver_direction(&Vector3::from(turn_axis)),
            path,
            release_s,
        }
    }
}

impl Tool for Grab {
    fn kind(&self) -> &'static str {
        "grab"
    }

    fn acts_at(&self, t: f64) -> bool {
        acts(self.release_s, t)
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        self.target(&self.centre, t)
    }

    fn path_mut(&mut self) -> Option<&mut Path> {
        Some(&mut self.path)
    }

    fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        let (shift, angle) = self.path.motion(t);
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(self.axis), angle);
        self.centre + turn * (rest - self.centre) + shift
    }
}

/// Whether a tool that is taken away at `release_s` acts at `t`.
pub(super) fn acts(release_s: Option<f64>, t: f64) -> bool {
    // A step that ends at the release, up to rounding of the time, still holds.
    release_s.is_none_or(|release| t <= release * (1.0 + 1e-12))
}

/// The start vertices in or on the organ that a tool takes hold of: those in its region, else
/// the nearest one within an element's edge of the region's centre.
pub(super) fn reach(
    key: &str,
    region: &Region,
    start: &Start,
    holds: &[Hold],
) -> Result<Vec<VertexId>, SimError> {
    let available: Vec<VertexId> = start
        .vertices
        .iter()
        .copied()
        .filter(|v| start.solid[v.index()] && holds[v.index()] == Hold::Free)
        .collect();
    let inside: Vec<VertexId> = available
        .iter()
        .copied()
        .filter(|&v| region.contains(&start.organ, &start.rest[v.index()]))
        .collect();
    if !inside.is_empty() {
        return Ok(inside);
    }
    let centre = region.centre(&start.organ);
    let distance = |v: &VertexId| (start.rest[v.index()] - centre).norm();
    let nearest = available.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    match nearest {
        Some(&v) if distance(&v) <= start.edge_m => Ok(vec![v]),
        _ => Err(SimError::ToolOutside {
            key: format!("{key}.region"),
            image: start.name.clone(),
            distance_mm: nearest.map_or(f64::INFINITY, |v| distance(v) * 1e3),
            limit_mm: start.edge_m * 1e3,
        }),
    }
}
