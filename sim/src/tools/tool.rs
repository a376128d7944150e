//! What a tool is.

use nalgebra::{Isometry3, Vector3};
use yawara_corot::{Following, Sphere, WeightedPoint};
use yawara_mesh::VertexId;

use super::at_rest::BodyAtRest;
use super::path::ToolPath;
use super::surface_points::SurfacePoints;
use crate::body::BodyState;
use crate::error::SimError;

/// Material that a tool holds.
#[derive(Clone)]
pub struct MaterialHold {
    /// Its points; only ratios of their weights matter for a mean.
    pub points: Vec<WeightedPoint>,
    /// κ of an elastic hold, ½ Σ κ w |x − y|², N/m per unit of weight; without it the mean of the
    /// points is held in place and turn.
    pub stiffness: Option<f64>,
}

/// What a tool makes of the body along a way.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Labels change in a ball.
    Labels {
        /// Where the ball's centre is at the beginning and at the end of the way, solver axes, m.
        sweep: [Vector3<f64>; 2],
        /// The ball's radius, m.
        radius_m: f64,
        /// The labels that change, as in the image; all but void if empty.
        labels: Vec<i64>,
        /// What they become; 0 is void.
        becomes: i64,
    },
    /// What a blade sweeps over is cut.
    Cut {
        /// The blade.
        blade: Blade,
        /// The least level of the tetrahedra that are cut; as they are if absent.
        level: Option<u8>,
        /// Energy that a new cut takes, J/m².
        toughness_j_m2: f64,
    },
    /// Cut faces in a ball are joined again.
    Close {
        /// As of `Labels`.
        sweep: [Vector3<f64>; 2],
        /// The ball's radius, m.
        radius_m: f64,
    },
}

/// A blade on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// The ends of its edge at the beginning and at the end of the way, solver axes, m.
    pub edges: [[Vector3<f64>; 2]; 2],
}

/// What acts on the body from outside. A tool does one or more of six things: it holds material or
/// vertices of the mesh, stands in the surface's way, loads vertices with forces, changes labels, or cuts. What it does not do,
/// it leaves at the default.
///
/// Positions are in solver axes, m; [`ScannerAxes`](crate::ScannerAxes) converts. Times are those
/// of the scene, s. Within a step a tool is asked again and again, for times that also go back, so
/// its answers have to follow from the time and the body alone.
///
/// # Example
/// A constant force, shared by all vertices that rest in a ball:
///
/// ```
/// use nalgebra::Vector3;
/// use yawara::{BodyState, Simulation, Tool, scene_file};
///
/// struct Pull {
///     centre: Vector3<f64>,
///     radius_m: f64,
///     force_n: Vector3<f64>,
/// }
///
/// impl Tool for Pull {
///     fn kind(&self) -> &'static str {
///         "pull"
///     }
///
///     fn reference(&self, _: f64) -> Vector3<f64> {
///         self.centre
///     }
///
///     fn add_loads(&self, body: &BodyState, _: f64, loads: &mut [Vector3<f64>]) {
///         let rest = body.rest_positions();
///         let is_inside = |v: &usize| (rest[*v] - self.centre).norm() <= self.radius_m;
///         let inside: Vec<usize> = body.vertices().map(|v| v.index()).filter(is_inside).collect();
///         for &v in &inside {
///             loads[v] += self.force_n / inside.len() as f64;
///         }
///     }
/// }
///
/// # fn main() -> Result<(), yawara::SimError> {
/// let (mut scene, _) = scene_file::load("beam", &["mesh.max_level=0".into()])?;
/// scene.tools.clear();
/// let mut simulation = Simulation::builder(&scene)
///     .tool(|body| {
///         let centre = body.at([1.0, 0.5, 0.5]);
///         Ok(Pull { centre, radius_m: 0.05, force_n: Vector3::new(0.0, 0.0, -0.01) })
///     })
///     .build()?;
/// let report = simulation.step()?;
/// assert!(report.converged && (report.force_n[2] + 0.01).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
pub trait Tool: Send {
    /// What reports call it.
    fn kind(&self) -> &'static str;

    /// The point about which its torque is reported, m.
    fn reference(&self, t: f64) -> Vector3<f64>;

    /// True while it acts. A tool that has begun lets go of what it holds for good when it is false.
    fn acts_at(&self, t: f64) -> bool {
        let _ = t;
        true
    }

    /// When it comes, s, if not at the start: what it [grips](Self::grip) is held from then on.
    fn begin_s(&self) -> Option<f64> {
        None
    }

    /// Has it let go after `at_s`, s. By default nothing happens.
    fn release(&mut self, at_s: f64) {
        let _ = at_s;
    }

    /// The path it follows, if it can be led by
    /// [`set_tool_pose`](crate::Simulation::set_tool_pose).
    fn path_mut(&mut self) -> Option<&mut ToolPath> {
        None
    }

    /// The same to read.
    fn path(&self) -> Option<&ToolPath> {
        None
    }

    /// The vertices of the start mesh that it holds, out of those that are
    /// [`available`](BodyAtRest::available).
    /// # Errors
    /// [`SimError`] if it finds nothing to hold; the simulation is not made then.
    fn grasp(&self, body: &BodyAtRest<'_>) -> Result<Vec<VertexId>, SimError> {
        let _ = body;
        Ok(Vec::new())
    }

    /// Whether it also holds a vertex that comes in at rest position `rest`, m, beside one that it
    /// holds.
    fn takes(&self, rest: &Vector3<f64>) -> bool {
        let _ = rest;
        false
    }

    /// Where a vertex that it holds and that was at `rest` is at time `t`, m.
    fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        let _ = t;
        *rest
    }

    /// The material that it holds, whatever the mesh is.
    ///
    /// # Errors
    /// [`SimError`] if it finds nothing to hold; the simulation is not made then.
    fn grip(&self, body: &BodyAtRest<'_>) -> Result<Option<MaterialHold>, SimError> {
        let _ = body;
        Ok(None)
    }

    /// Where the material of its [`grip`](Self::grip) is to be at time `t`: turned and moved from
    /// rest, m.
    fn pose(&self, t: f64) -> Isometry3<f64> {
        let _ = t;
        Isometry3::identity()
    }

    /// A ball that the [`surface_points`](Self::surface_points) may touch but not enter.
    fn obstacle(&self, t: f64) -> Option<Sphere> {
        let _ = t;
        None
    }

    /// The surface points that it acts on.
    fn surface_points(&self) -> Option<&SurfacePoints> {
        None
    }

    /// The same, to bind them again after the mesh has changed.
    fn surface_points_mut(&mut self) -> Option<&mut SurfacePoints> {
        None
    }

    /// What it makes of the body on its way from where it is at `from` to where it is at `to`, s: asked once, at the end
    /// of each step, for where the body is then.
    fn edit(&self, from: f64, to: f64) -> Option<Edit> {
        let _ = (from, to);
        None
    }

    /// The body's surface is another since labels have changed or something was cut: `points` gives points of it that lie so far (m) apart. A tool
    /// with [`surface_points`](Self::surface_points) takes new ones; by default it keeps what it has.
    ///
    /// # Errors
    /// Those of `points`.
    fn resurface(
        &mut self,
        points: &mut dyn FnMut(f64) -> Result<SurfacePoints, SimError>,
    ) -> Result<(), SimError> {
        let _ = points;
        Ok(())
    }

    /// The mesh of `body` is new or has changed: it carries what the tool acts on from now on. Called
    /// before the tool is asked for loads or contact there. By default [binds](SurfacePoints::bind) the
    /// [`surface_points`](Self::surface_points).
    ///
    /// # Errors
    /// [`SimError`] if nothing is left to act on.
    fn follow(&mut self, body: &BodyState) -> Result<(), SimError> {
        if let Some(points) = self.surface_points_mut() {
            points.bind(body);
        }
        Ok(())
    }

    /// Forgets which tetrahedra carry what it acts on: before [`follow`](Self::follow) on a body that has been made
    /// again with other numbers. By default [unbinds](SurfacePoints::unbind) the
    /// [`surface_points`](Self::surface_points).
    fn unbind(&mut self) {
        if let Some(points) = self.surface_points_mut() {
            points.unbind();
        }
    }

    /// Adds its forces on vertices at time `t` to `loads`, by vertex number, N; `body` is where the
    /// solver has it now. Forces that follow the body (a spring, a pressure) are renewed after every
    /// solve until they come to rest, so that they hold at the step's end. That converges where they
    /// are softer than the body; where they are not the step is halved, and at last does not converge.
    fn add_loads(&self, body: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        let _ = (body, t, loads);
    }

    /// The same forces with how they follow the body, element by element. A solver that
    /// [takes them](yawara_corot::Equilibrium::takes_following) solves for them as they are in its solution,
    /// however stiff they are; none where what [`add_loads`](Self::add_loads) adds is not all said by them.
    fn following(&self, body: &BodyState, t: f64) -> Vec<Following> {
        let _ = (body, t);
        Vec::new()
    }
}
