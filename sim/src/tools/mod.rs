//! Tools: what holds, pushes or loads the body, a file each.
//!
//! `tool` is the file to open first: the trait [`Tool`]. A new kind of tool is a file here, its keys
//! in `scene/tool.rs`, and a line in [`by_name`]; one of your own needs none of that and goes to
//! [`SimulationBuilder::tool`](crate::SimulationBuilder::tool). `at_rest` is what a tool is made
//! from, `surface_points` the points of the surface that it acts on, `path` where it goes.

mod ablation;
mod at_rest;
mod grab;
mod holding;
mod idle;
mod load;
mod path;
mod path_csv;
mod pressure;
mod probe;
mod regions;
mod scalpel;
mod surface_points;
mod surface_source;
mod tool;

use crate::error::SimError;
use crate::scene::ToolEntry;

pub use at_rest::BodyAtRest;
pub use holding::Holding;
pub use path::{Pose, ToolPath};
pub use surface_points::SurfacePoints;
pub use tool::{Blade, Edit, MaterialHold, Tool};

pub(crate) use holding::holdings;
pub(crate) use idle::warnings;
pub(crate) use regions::Regions;
pub(crate) use surface_source::points_of;

use ablation::Ablation;
use grab::Grab;
use load::Load;
use pressure::Pressure;
use probe::Probe;
use scalpel::Scalpel;

/// The tool of a scene's entry, whose kind names it; `key` is the entry's, for messages.
pub(crate) fn by_name(
    entry: &ToolEntry,
    key: &str,
    body: &mut BodyAtRest<'_>,
) -> Result<Box<dyn Tool>, SimError> {
    Ok(match entry {
        ToolEntry::Grab(grab) => {
            body.grab(key, grab)?;
            Box::new(Grab::new(grab, key, body)?)
        }
        ToolEntry::Probe(probe) => Box::new(Probe::new(probe, key, body)?),
        ToolEntry::Pressure(pressure) => Box::new(Pressure::new(pressure, key, body)?),
        ToolEntry::Load(load) => Box::new(Load::new(load, key, body)?),
        ToolEntry::Scalpel(scalpel) => Box::new(Scalpel::new(scalpel, key, body)?),
        ToolEntry::Resect(one) | ToolEntry::Coagulate(one) | ToolEntry::Suture(one) => {
            Box::new(Ablation::new(one, entry.kind(), key, body)?)
        }
    })
}

/// The path of a tool by its number.
/// # Errors
/// [`SimError::NoSuchTool`] if there is none of that number or it does not move.
pub(crate) fn path_of(tools: &mut [Box<dyn Tool>], tool: usize) -> Result<&mut ToolPath, SimError> {
    let count = tools.len();
    let refused = |reason| SimError::NoSuchTool { tool, reason, count };
    let found = tools.get_mut(tool).ok_or_else(|| refused("is missing"))?;
    found.path_mut().ok_or_else(|| refused("does not move"))
}
