//! What tools and supports hold of the material, put into the body.

use crate::body::BodyState;
use crate::error::SimError;
use crate::tools::MaterialHold;

/// What is held of the material, by a tool or by a support.
pub(super) type Grips = Vec<(Option<usize>, MaterialHold)>;

/// Tools by number that begin later, with what they are going to hold.
pub(super) type Coming = Vec<(usize, Option<MaterialHold>)>;

/// Puts what is held into the elements of `state` that are not void.
///
/// # Errors
/// [`SimError::Value`] for a tool that holds nothing of them.
pub(super) fn hold_material(
    grips: Grips,
    image: &str,
    state: &mut BodyState,
) -> Result<(), SimError> {
    for (tool, MaterialHold { points, stiffness }) in grips {
        match (state.grip(points, stiffness), tool) {
            (Some(grip), _) => {
                state.body.add_grip(grip);
                state.grip_tools.push(tool);
            }
            // A region may hold only parts that are left out.
            (None, None) => {}
            (None, Some(tool)) => {
                let (key, want) =
                    (format!("tools[{tool}].region"), "material of a part that is kept");
                return Err(SimError::value(image, &key, "in parts that are left out", want));
            }
        }
    }
    Ok(())
}
