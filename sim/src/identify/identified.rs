//! What was found.

use serde::Serialize;

/// The modulus of an entry of the scene's materials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Modulus {
    /// The entry, from 0.
    pub entry: usize,
    /// The label that it is of, if it is of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub label: Option<i64>,
    /// What the scene has, Pa.
    pub start_pa: f64,
    /// What was found, Pa.
    pub young_modulus_pa: f64,
    /// Standard deviation of ln E: that of E as a part of it.
    pub relative_sd: f64,
    /// Where E is with a probability of 95 %, Pa.
    pub band_pa: [f64; 2],
    /// Whether the measurements tell it; otherwise it is mostly what was believed before.
    pub is_told: bool,
    /// By which part of it E is off because the mesh is not as fine as the scene lets it become; none where that is no finer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_shift: Option<f64>,
}

/// A component that was measured, and what the scene says of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Where it comes from.
    pub place: String,
    /// When, s.
    pub time_s: f64,
    /// `move_mm` or `force_n`.
    pub kind: &'static str,
    /// Scanner axis, 0 to 2.
    pub axis: usize,
    /// mm or N.
    pub measured: f64,
    /// mm or N.
    pub predicted: f64,
    /// Standard deviation of the noise, mm or N.
    pub sd: f64,
}

/// What moduli were found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identified {
    /// The scene.
    pub scene: String,
    /// By entry.
    pub moduli: Vec<Modulus>,
    /// Correlations of ln E, by rows.
    pub correlation: Vec<Vec<f64>>,
    /// Σ ((predicted − measured)/sd)².
    pub chi_squared: f64,
    /// Components that were measured, less moduli that they tell.
    pub degrees_of_freedom: f64,
    /// Whether the noise's standard deviations were given; otherwise they are what makes the two before equal.
    pub sd_is_given: bool,
    /// Whether it ended because nothing changed any more.
    pub converged: bool,
    /// Runs of the scene with derivatives.
    pub runs: usize,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// What was not done, and why.
    pub left_out: Vec<String>,
    /// Of every component.
    pub residuals: Vec<Residual>,
}
