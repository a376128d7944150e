//! `grab`: takes hold of vertices and moves them rigidly.

use nalgebra::{Rotation3, Unit, Vector3};
use yawara_mesh::VertexId;

use super::at_rest::BodyAtRest;
use super::path::{ToolPath, acts};
use super::tool::Tool;
use crate::body::OrganBox;
use crate::error::SimError;
use crate::scene::{GrabEntry, Region};

/// Held vertices follow x = c + R(t)(X − c) + d(t), c the centre of the region at rest.
pub(super) struct Grab {
    /// Key of the region, for messages.
    key: String,
    organ: OrganBox,
    region: Region,
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    path: ToolPath,
    release_s: Option<f64>,
}

impl Grab {
    pub fn new(entry: &GrabEntry, key: &str, body: &BodyAtRest<'_>) -> Result<Self, SimError> {
        let organ = body.organ();
        Ok(Self {
            key: format!("{key}.region"),
            organ,
            region: entry.region.clone(),
            centre: entry.region.centre(&organ),
            axis: body.axes().to_solver_direction(&Vector3::from(entry.turn_axis)),
            path: ToolPath::read(&entry.path, entry.path_csv.as_deref(), body.axes())?,
            release_s: entry.release_s,
        })
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

    fn path_mut(&mut self) -> Option<&mut ToolPath> {
        Some(&mut self.path)
    }

    /// The vertices in the region, else the nearest one within an element's edge of its centre.
    fn grasp(&self, body: &BodyAtRest<'_>) -> Result<Vec<VertexId>, SimError> {
        let inside: Vec<VertexId> =
            body.available().filter(|&v| self.takes(&body.position(v))).collect();
        if !inside.is_empty() {
            return Ok(inside);
        }
        let distance = |v: &VertexId| (body.position(*v) - self.centre).norm();
        let nearest = body.available().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        match nearest {
            Some(v) if distance(&v) <= body.edge_m() => Ok(vec![v]),
            _ => Err(SimError::ToolOutside {
                key: self.key.clone(),
                image: body.name().into(),
                distance_mm: nearest.map_or(f64::INFINITY, |v| distance(&v) * 1e3),
                limit_mm: body.edge_m() * 1e3,
            }),
        }
    }

    fn takes(&self, rest: &Vector3<f64>) -> bool {
        self.region.contains(&self.organ, rest)
    }

    fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        let (shift, angle) = self.path.motion(t);
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(self.axis), angle);
        self.centre + turn * (rest - self.centre) + shift
    }
}
