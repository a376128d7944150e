//! `probe`: a ball that pushes the surface and never pulls it.

use nalgebra::Vector3;
use yawara_corot::Sphere;

use super::grab::acts;
use super::path::Path;
use super::surface_points::SurfacePoints;
use super::tool::Tool;

/// A ball of radius R at c + d(t), which points of the surface may touch but not enter.
pub(super) struct Probe {
    centre: Vector3<f64>,
    radius: f64,
    path: Path,
    release_s: Option<f64>,
    surface_points: SurfacePoints,
}

impl Probe {
    pub fn new(
        centre: Vector3<f64>,
        radius: f64,
        path: Path,
        release_s: Option<f64>,
        surface_points: SurfacePoints,
    ) -> Self {
        Self { centre, radius, path, release_s, surface_points }
    }
}

impl Tool for Probe {
    fn kind(&self) -> &'static str {
        "probe"
    }

    fn acts_at(&self, t: f64) -> bool {
        acts(self.release_s, t)
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        self.centre + self.path.motion(t).0
    }

    fn path_mut(&mut self) -> Option<&mut Path> {
        Some(&mut self.path)
    }

    fn obstacle(&self, t: f64) -> Option<Sphere> {
        self.acts_at(t).then(|| Sphere { centre: self.reference(t), radius: self.radius })
    }

    fn surface_points(&self) -> Option<&SurfacePoints> {
        Some(&self.surface_points)
    }

    fn surface_points_mut(&mut self) -> Option<&mut SurfacePoints> {
        Some(&mut self.surface_points)
    }
}
