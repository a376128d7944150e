//! What a maintainer had to do beyond its ordinary updates.

/// Safeguards that took effect since the maintainer was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Times that it started afresh from K by itself.
    pub rebuilds: usize,
    /// Updates whose small factor failed: a pivot lost, or of the wrong sign.
    pub failed_pivots: usize,
    /// Corrections of a solution by its residual, one per right-hand side and step.
    pub refinement_steps: usize,
}
