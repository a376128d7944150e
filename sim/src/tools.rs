//! Tools: what holds or moves which vertices, and where to.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use yawara_mesh::VertexId;

use crate::error::SimError;
use crate::scene::{Key, Region, Scene, Tool};
use crate::setup::Setup;

/// A grab in solver coordinates.
pub(crate) struct Grab {
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    path: Vec<Key>,
    /// Scanner axes → solver axes.
    to_solver: Matrix3<f64>,
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
    pub fn all(scene: &Scene, setup: &Setup) -> Result<(Vec<Self>, Vec<Hold>), SimError> {
        let mut holds = vec![Hold::Free; setup.forest.vertex_capacity()];
        for v in setup.forest.vertices() {
            if setup.is_fixed(scene, v) {
                holds[v.index()] = Hold::Fixed;
            }
        }
        let mut grabs = Vec::new();
        for (number, tool) in scene.tools.iter().enumerate() {
            let Tool::Grab { region, path, turn_axis, release_s } = tool;
            for v in reach(number, region, setup, &holds)? {
                holds[v.index()] = Hold::Grabbed(number);
            }
            let to_solver = setup.grid.rotation.transpose();
            grabs.push(Self {
                centre: region.centre(&setup.organ),
                axis: to_solver * Vector3::from(*turn_axis),
                path: path.clone(),
                to_solver,
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
        self.centre + turn * (rest - self.centre) + self.to_solver * shift
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
    setup: &Setup,
    holds: &[Hold],
) -> Result<Vec<VertexId>, SimError> {
    let available: Vec<VertexId> = setup
        .forest
        .vertices()
        .filter(|v| setup.solid[v.index()] && holds[v.index()] == Hold::Free)
        .collect();
    let inside: Vec<VertexId> = available
        .iter()
        .copied()
        .filter(|&v| region.contains(&setup.organ, &setup.rest(v)))
        .collect();
    if !inside.is_empty() {
        return Ok(inside);
    }
    let centre = region.centre(&setup.organ);
    let distance = |v: &VertexId| (setup.rest(*v) - centre).norm();
    let nearest = available.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    match nearest {
        Some(&v) if distance(&v) <= setup.start_edge_m() => Ok(vec![v]),
        _ => Err(SimError::ToolOutside {
            key: format!("tools[{number}].region"),
            image: setup.image_name().into(),
            distance_mm: nearest.map_or(f64::INFINITY, |v| distance(v) * 1e3),
            limit_mm: setup.start_edge_m() * 1e3,
        }),
    }
}
