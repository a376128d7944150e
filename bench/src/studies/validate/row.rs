//! What the study finds.

use serde::Serialize;

/// One figure against what it should be.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The case.
    pub case: &'static str,
    /// Elements along the length that the case counts by.
    pub refinement: usize,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// What is measured, with its unit.
    pub quantity: String,
    /// The figure.
    pub computed: f64,
    /// What it converges to.
    pub expected: f64,
    /// What the error is relative to: the expected figure where that is not 0.
    pub scale: f64,
    /// |computed − expected| / scale.
    pub relative_error: f64,
}

impl Row {
    /// A row; `scale` counts where `expected` is 0.
    pub(super) fn new(
        case: &'static str,
        (refinement, vertices): (usize, usize),
        quantity: impl Into<String>,
        computed: f64,
        expected: f64,
        scale: f64,
    ) -> Self {
        let scale = if expected == 0.0 { scale } else { expected.abs() };
        let relative_error = (computed - expected).abs() / scale;
        let quantity = quantity.into();
        Self { case, refinement, vertices, quantity, computed, expected, scale, relative_error }
    }
}
