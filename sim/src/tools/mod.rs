//! Tools: what holds, pushes or loads the body, a file each.

mod grab;
mod path;
mod path_csv;
mod pressure;
mod probe;
mod regions;
mod surface_points;
mod surface_source;
mod tool;

use crate::body::{Hold, Start};
use crate::error::SimError;
use crate::scene::{self, Scene};

pub use path::Pose;

pub(crate) use path::Path;
pub(crate) use regions::Regions;
pub(crate) use tool::Tool;

use grab::Grab;
use pressure::Pressure;
use probe::Probe;
use surface_source::SurfaceSource;

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
    let mut source = SurfaceSource::new(scene, start);
    let mut tools: Vec<Box<dyn Tool>> = Vec::with_capacity(scene.tools.len());
    for (number, tool) in scene.tools.iter().enumerate() {
        let key = format!("tools[{number}]");
        tools.push(match tool {
            scene::ToolEntry::Grab { region, path, path_csv, turn_axis, release_s } => {
                for v in grab::reach(&key, region, start, &holds)? {
                    holds[v.index()] = Hold::Grabbed(number);
                }
                let path = Path::new(path, path_csv.as_deref(), start.axes)?;
                Box::new(Grab::new(start, region, *turn_axis, path, *release_s))
            }
            scene::ToolEntry::Probe { centre, radius_m, path, path_csv, spacing_m, release_s } => {
                let path = Path::new(path, path_csv.as_deref(), start.axes)?;
                let points = source.points(spacing_m.unwrap_or(0.25 * radius_m))?;
                Box::new(Probe::new(start.organ.at(*centre), *radius_m, path, *release_s, points))
            }
            scene::ToolEntry::Pressure { region, pressure, normal } => {
                let points = source.patch(&key, region)?;
                Box::new(Pressure::new(region.centre(&start.organ), pressure, *normal, points))
            }
        });
    }
    Ok((tools, holds))
}
