//! `probe`: a ball that pushes the surface and never pulls it.

use nalgebra::Vector3;
use yawara_corot::Sphere;

use super::at_rest::BodyAtRest;
use super::path::{ToolPath, acts};
use super::surface_points::SurfacePoints;
use super::tool::Tool;
use crate::error::SimError;
use crate::scene::ProbeEntry;

/// How far apart points of the surface are at most that may touch a ball, relative to its radius.
const PART_OF_RADIUS: f64 = 0.25;

/// The same relative to the edges of the finest mesh. Farther apart, a ball sinks in between them once the mesh is fine, the
/// deeper the finer it is.
const PART_OF_EDGE: f64 = 0.75;

/// A ball of radius R at c + d(t), which points of the surface may touch but not enter.
pub(super) struct Probe {
    centre: Vector3<f64>,
    radius: f64,
    path: ToolPath,
    begin_s: Option<f64>,
    release_s: Option<f64>,
    spacing: f64,
    surface_points: SurfacePoints,
}

impl Probe {
    pub fn new(entry: &ProbeEntry, key: &str, body: &mut BodyAtRest<'_>) -> Result<Self, SimError> {
        let path = ToolPath::read(&entry.path, entry.path_csv.as_deref(), body.axes())?;
        let centre = body.places().start_of(entry.start(body.name(), key)?, key)?;
        if body.is_inside(&(centre + path.motion(0.0).0)) {
            let (way, at) = entry.start(body.name(), key)?;
            let (key, value) = (format!("{key}.centre{}", way.suffix()), format!("{at:?}"));
            let want = "a place from which the path begins outside of the body";
            return Err(SimError::value(body.name(), &key, value, want));
        }
        let spacing = entry.spacing_m.unwrap_or_else(|| {
            let finest = body.finest_edge_m().unwrap_or(f64::INFINITY);
            (PART_OF_RADIUS * entry.radius_m).min(PART_OF_EDGE * finest)
        });
        Ok(Self {
            centre,
            radius: entry.radius_m,
            path,
            begin_s: entry.begin_s,
            release_s: entry.release_s,
            spacing,
            surface_points: body.surface_points(spacing)?,
        })
    }
}

impl Tool for Probe {
    fn kind(&self) -> &'static str {
        "probe"
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
        self.centre + self.path.motion(t).0
    }

    fn path(&self) -> Option<&ToolPath> {
        Some(&self.path)
    }

    fn path_mut(&mut self) -> Option<&mut ToolPath> {
        Some(&mut self.path)
    }

    fn obstacle(&self, t: f64) -> Option<Sphere> {
        self.acts_at(t).then(|| Sphere { centre: self.reference(t), radius: self.radius })
    }

    fn resurface(
        &mut self,
        points: &mut dyn FnMut(f64) -> Result<SurfacePoints, SimError>,
    ) -> Result<(), SimError> {
        self.surface_points = points(self.spacing)?;
        Ok(())
    }

    fn surface_points(&self) -> Option<&SurfacePoints> {
        Some(&self.surface_points)
    }

    fn surface_points_mut(&mut self) -> Option<&mut SurfacePoints> {
        Some(&mut self.surface_points)
    }
}
