//! What a tool is.

use nalgebra::Vector3;
use yawara_corot::Sphere;

use super::path::Path;
use super::surface_points::SurfacePoints;
use crate::body::BodyState;

/// A tool in solver coordinates. It does one or more of three things: hold vertices, stand in the
/// surface's way, load vertices; what it does not do, it leaves at the default.
pub(crate) trait Tool {
    /// The scene name.
    fn kind(&self) -> &'static str;

    /// True while it acts.
    fn acts_at(&self, t: f64) -> bool;

    /// The point about which its torque is reported, m.
    fn reference(&self, t: f64) -> Vector3<f64>;

    /// Where it has been asked to be over time, if it moves.
    fn path_mut(&mut self) -> Option<&mut Path> {
        None
    }

    /// Where a vertex that it holds and that was at `rest` is at time `t`, m.
    fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        let _ = t;
        *rest
    }

    /// What stands in the surface's way.
    fn obstacle(&self, t: f64) -> Option<Sphere> {
        let _ = t;
        None
    }

    /// The surface points that it acts on.
    fn surface_points(&self) -> Option<&SurfacePoints> {
        None
    }

    /// The same, to bind them anew when the mesh has changed.
    fn surface_points_mut(&mut self) -> Option<&mut SurfacePoints> {
        None
    }

    /// Whether it loads vertices at all.
    fn loads(&self) -> bool {
        false
    }

    /// Adds its forces on vertices at time `t` to `loads`, by vertex number, N.
    fn add_loads(&self, state: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        let _ = (state, t, loads);
    }
}
