//! What a finished study has found.

use yawara::report::PlanRow;
use yawara::scene::Scene;

use super::choices::uniform_name;
use super::converged::ReferenceSummary;
use crate::harness::cases::Row;

/// The x axis of the plots: a row's measurement.
pub(crate) const TIME: &str = "step_mean_ms";

/// The y axis of the plots: a row's figure.
pub(crate) const ERROR: &str = "error_displacement";

/// A finished study.
#[derive(Debug)]
pub struct Results {
    /// The study's own name for it.
    pub scene: Scene,
    /// What the default leaves out, and why.
    pub plan: Vec<PlanRow>,
    /// How the reference was made.
    pub reference: ReferenceSummary,
    /// A row per candidate.
    pub rows: Vec<Row>,
}

/// What the uniform levels say of the reference's own error: at half its elements' edge errors of
/// linear elements fall to a quarter, so it is a third of the distance of the mesh three levels
/// coarser; `None` without such a row.
pub(crate) fn own_error(results: &Results) -> Option<f64> {
    let coarser = results.reference.level.checked_sub(3)?;
    let name = uniform_name(coarser);
    let row = results.rows.iter().find(|row| row.case == name)?;
    Some(row.number(ERROR)? / 3.0)
}
