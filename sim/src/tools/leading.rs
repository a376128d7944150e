//! Tools that are led while the simulation runs.

use super::path::{Pose, ToolPath};
use super::tool::Tool;
use crate::error::SimError;
use crate::scene::checks::FARTHEST_M;

/// The path of a tool by its number.
/// # Errors
/// [`SimError::NoSuchTool`] if there is none of that number or it does not move.
pub(crate) fn path_of(tools: &mut [Box<dyn Tool>], tool: usize) -> Result<&mut ToolPath, SimError> {
    let count = tools.len();
    let refused = |reason| SimError::NoSuchTool { tool, reason, count };
    let found = tools.get_mut(tool).ok_or_else(|| refused("is missing"))?;
    found.path_mut().ok_or_else(|| refused("does not move"))
}

/// Refuses a pose that is not finite, or out of reach.
/// # Errors
/// [`SimError::Pose`].
pub(crate) fn check_pose(tool: usize, pose: &Pose) -> Result<(), SimError> {
    let far = pose.move_m.iter().find(|x| !(x.abs() <= FARTHEST_M));
    if let Some(&value) = far {
        return Err(SimError::Pose { tool, value, want: "at most 1000 m in each axis" });
    }
    match pose.turn_deg.is_finite() {
        true => Ok(()),
        false => Err(SimError::Pose { tool, value: pose.turn_deg, want: "a finite turn" }),
    }
}
