//! Tools: what holds or moves which vertices, and where to.

use nalgebra::{Rotation3, Unit, Vector3};
use yawara_mesh::VertexId;

use crate::error::SimError;
use crate::scene::{Key, Region, Scene, Tool};
use crate::start::{ScannerAxes, Start};

/// A grab in solver coordinates.
pub(crate) struct Grab {
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    path: Vec<Key>,
    axes: ScannerAxes,
    release_s: Option<f64>,
}

/// What a vertex is held by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    Free,
    Fixed,
    Grabbed(usize),
}

impl Grab {
    /// All tools of a scene, and what each start vertex is held by (by vertex number).
    pub fn all(scene: &Scene, start: &Start) -> Result<(Vec<Self>, Vec<Hold>), SimError> {
        let mut holds = vec![Hold::Free; start.rest.len()];
        for &v in &start.vertices {
            if start.is_fixed(scene, v) {
                holds[v.index()] = Hold::Fixed;
            }
        }
        let mut grabs = Vec::new();
        for (number, tool) in scene.tools.iter().enumerate() {
            let Tool::Grab { region, path, turn_axis, release_s } = tool;
            for v in reach(number, region, start, &holds)? {
                holds[v.index()] = Hold::Grabbed(number);
            }
            grabs.push(Self {
                centre: region.centre(&start.organ),
                axis: start.axes.to_solver_direction(&Vector3::from(*turn_axis)),
                path: path.clone(),
                axes: start.axes,
                release_s: *release_s,
            });
        }
        Ok((grabs, holds))
    }

    /// True where the tool holds on at time `t`.
    pub fn holds_at(&self, t: f64) -> bool {
        // A step that ends at the release, up to rounding of the time, still holds.
        self.release_s.is_none_or(|release| t <= release * (1.0 + 1e-12))
    }

    /// Where a point that was at `rest` is held at time `t`, solver coordinates, m.
    pub fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        let (shift, angle) = self.pose(t);
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(self.axis), angle);
        self.centre + turn * (rest - self.centre) + self.axes.to_solver_direction(&shift)
    }

    /// Displacement (scanner axes, m) and turn (rad) at time `t`: linear between keys.
    fn pose(&self, t: f64) -> (Vector3<f64>, f64) {
        let value = |key: &Key| (Vector3::from(key.move_m), key.turn_deg.to_radians());
        let after = self.path.partition_point(|key| key.time_s <= t);
        match (after.checked_sub(1).map(|i| &self.path[i]), self.path.get(after)) {
            (Some(a), Some(b)) => {
                let s = (t - a.time_s) / (b.time_s - a.time_s);
                let ((move_a, turn_a), (move_b, turn_b)) = (value(a), value(b));
                (move_a.lerp(&move_b, s), turn_a + s * (turn_b - turn_a))
            }
            (Some(key), None) | (None, Some(key)) => value(key),
            (None, None) => (Vector3::zeros(), 0.0),
        }
    }
}

/// The start vertices in or on the organ that a tool takes hold of: those in its region, else
/// the nearest one within an element's edge of the region's centre.
fn reach(
    number: usize,
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
            key: format!("tools[{number}].region"),
            image: start.name.clone(),
            distance_mm: nearest.map_or(f64::INFINITY, |v| distance(v) * 1e3),
            limit_mm: start.edge_m * 1e3,
        }),
    }
}
