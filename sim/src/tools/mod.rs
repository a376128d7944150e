//! Tools: what holds, pushes or loads the body, a file each.

mod grab;
mod path;
mod path_csv;
mod pressure;
mod probe;
mod regions;
mod skin;
mod skin_source;

use nalgebra::Vector3;
use yawara_corot::Sphere;

use crate::error::SimError;
use crate::scene::{self, Scene};
use crate::start::Start;
use crate::state::State;

pub use path::Pose;

pub(crate) use path::Path;
pub(crate) use regions::Regions;
pub(crate) use skin::Skin;

use grab::Grab;
use pressure::Pressure;
use probe::Probe;
use skin_source::SkinSource;

/// What a vertex is held by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    Free,
    Fixed,
    Grabbed(usize),
}

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
    fn skin(&self) -> Option<&Skin> {
        None
    }

    /// The same, to bind them anew when the mesh has changed.
    fn skin_mut(&mut self) -> Option<&mut Skin> {
        None
    }

    /// Whether it loads vertices at all.
    fn loads(&self) -> bool {
        false
    }

    /// Adds its forces on vertices at time `t` to `loads`, by vertex number, N.
    fn add_loads(&self, state: &State, t: f64, loads: &mut [Vector3<f64>]) {
        let _ = (state, t, loads);
    }
}

/// Tools, and what each start vertex is held by (by vertex number).
type Equipment = (Vec<Box<dyn Tool>>, Vec<Hold>);

/// All tools of a scene.
pub(crate) fn all(scene: &Scene, start: &Start) -> Result<Equipment, SimError> {
    let mut holds = vec![Hold::Free; start.rest.len()];
    for &v in &start.vertices {
        if start.is_fixed(scene, v) {
            holds[v.index()] = Hold::Fixed;
        }
    }
    let mut source = SkinSource::new(scene, start);
    let mut tools: Vec<Box<dyn Tool>> = Vec::with_capacity(scene.tools.len());
    for (number, tool) in scene.tools.iter().enumerate() {
        let key = format!("tools[{number}]");
        tools.push(match tool {
            scene::Tool::Grab { region, path, path_csv, turn_axis, release_s } => {
                for v in grab::reach(&key, region, start, &holds)? {
                    holds[v.index()] = Hold::Grabbed(number);
                }
                let path = Path::new(path, path_csv.as_deref(), start.axes)?;
                Box::new(Grab::new(start, region, *turn_axis, path, *release_s))
            }
            scene::Tool::Probe { centre, radius_m, path, path_csv, spacing_m, release_s } => {
                let path = Path::new(path, path_csv.as_deref(), start.axes)?;
                let skin = source.points(spacing_m.unwrap_or(0.25 * radius_m))?;
                Box::new(Probe::new(start.organ.at(*centre), *radius_m, path, *release_s, skin))
            }
            scene::Tool::Pressure { region, pressure, normal } => {
                let skin = source.patch(&key, region)?;
                Box::new(Pressure::new(region.centre(&start.organ), pressure, *normal, skin))
            }
        });
    }
    Ok((tools, holds))
}
