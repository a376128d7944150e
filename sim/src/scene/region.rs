//! Places on a body.

use serde::{Deserialize, Serialize};

/// A region in fractions of the organ's bounding box (right, anterior, superior): 0 is the low
/// side, 1 the high side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// All points between two corners.
    Box {
        /// Low corner, fractions.
        min: [f64; 3],
        /// High corner, fractions.
        max: [f64; 3],
    },
    /// All points near a centre.
    Sphere {
        /// Centre, fractions.
        centre: [f64; 3],
        /// Radius, m.
        radius_m: f64,
    },
}
