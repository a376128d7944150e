//! `grab`: takes hold of vertices and moves them rigidly.

use nalgebra::{Isometry3, Rotation3, Unit, UnitQuaternion, Vector3};
use yawara_mesh::VertexId;

use super::at_rest::BodyAtRest;
use super::path::{ToolPath, acts};
use super::tool::{MaterialHold, Tool};
use crate::body::{OrganBox, Zone};
use crate::error::SimError;
use crate::scene::{GrabEntry, GrabHold, Region};

/// What is held follows x = c + R(t)(X − c) + d(t), c the centre of the region at rest.
pub(super) struct Grab {
    /// Its key, for messages.
    key: String,
    hold: GrabHold,
    stiffness: Option<f64>,
    organ: OrganBox,
    region: Region,
    zone: Zone,
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    path: ToolPath,
    begin_s: Option<f64>,
    release_s: Option<f64>,
}

impl Grab {
    pub fn new(entry: &GrabEntry, key: &str, body: &BodyAtRest<'_>) -> Result<Self, SimError> {
        let organ = body.places().organ;
        let zone = body.places().zone(&entry.region, &format!("{key}.region"))?;
        Ok(Self {
            key: key.into(),
            hold: entry.hold,
            stiffness: entry.stiffness_n_m4,
            organ,
            centre: zone.centre(&organ),
            region: entry.region.clone(),
            zone,
            axis: body.axes().to_solver_direction(&Vector3::from(entry.turn_axis)),
            path: ToolPath::read(&entry.path, entry.path_csv.as_deref(), body.axes())?,
            begin_s: entry.begin_s,
            release_s: entry.release_s,
        })
    }
}

impl Tool for Grab {
    fn kind(&self) -> &'static str {
        "grab"
    }

    fn acts_at(&self, t: f64) -> bool {
        acts(self.begin_s, self.release_s, t)
    }

    fn begin_s(&self) -> Option<f64> {
        self.begin_s
    }

    fn release(&mut self, at_s: f64) {
        self.release_s = Some(at_s);
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        self.target(&self.centre, t)
    }

    fn path(&self) -> Option<&ToolPath> {
        Some(&self.path)
    }

    fn path_mut(&mut self) -> Option<&mut ToolPath> {
        Some(&mut self.path)
    }

    /// The vertices in the region, else the nearest one within an element's edge of its centre.
    fn grasp(&self, body: &BodyAtRest<'_>) -> Result<Vec<VertexId>, SimError> {
        if self.hold != GrabHold::Vertices {
            return Ok(Vec::new());
        }
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
                key: format!("{}.region", self.key),
                image: body.name().into(),
                distance_mm: nearest.map_or(f64::INFINITY, |v| distance(&v) * 1e3),
                limit_mm: body.edge_m() * 1e3,
            }),
        }
    }

    fn takes(&self, rest: &Vector3<f64>) -> bool {
        self.zone.contains(&self.organ, rest)
    }

    fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        let (shift, angle) = self.path.motion(t);
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(self.axis), angle);
        self.centre + turn * (rest - self.centre) + shift
    }

    /// The region's material; in a ball with the weights 1 − s²/R², s the distance to its centre.
    fn grip(&self, body: &BodyAtRest<'_>) -> Result<Option<MaterialHold>, SimError> {
        if self.hold == GrabHold::Vertices {
            return Ok(None);
        }
        let mut points = body.material_points(&self.key, &self.region)?;
        if let Zone::Sphere { radius_m, .. } = self.zone {
            for point in &mut points {
                let part = (point.rest - self.centre).norm() / radius_m;
                // One that lies outside is alone.
                point.weight *= if part < 1.0 { 1.0 - part * part } else { 1.0 };
            }
        }
        let given = || self.stiffness.unwrap_or_else(|| body.holding_stiffness_n_m4());
        let stiffness = (self.hold == GrabHold::Pad).then(given);
        Ok(Some(MaterialHold { points, stiffness }))
    }

    fn pose(&self, t: f64) -> Isometry3<f64> {
        let (_, angle) = self.path.motion(t);
        let turn = UnitQuaternion::from_axis_angle(&Unit::new_normalize(self.axis), angle);
        Isometry3::from_parts(self.target(&Vector3::zeros(), t).into(), turn)
    }
}
