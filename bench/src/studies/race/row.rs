//! One line of a table: a method in a family at a size.

use serde::Serialize;

use super::competitor::Competitor;
use super::samples::{Quantiles, Samples};
use crate::error::BenchError;
use crate::harness::statistics::{median, percentile};

/// What was measured, or extrapolated from smaller sizes: then there are only times.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Row {
    /// Free vertices.
    pub vertices: usize,
    /// Rows of K.
    pub dofs: usize,
    pub method: &'static str,
    pub family: &'static str,
    pub precision: &'static str,
    /// Splits and merges timed; rebuilds of a direct method.
    pub updates: usize,
    pub extrapolated: bool,
    /// Of a direct method, a rebuild.
    pub split_ms: Quantiles,
    /// Splits that begin a burst, before the caches hold what they need.
    pub cold_split_ms: Option<f64>,
    pub merge_ms: Quantiles,
    /// Merges of vertices that are not the newest.
    pub old_merge_ms: Option<Quantiles>,
    pub solve_ms: Option<f64>,
    pub columns_ms: Option<f64>,
    /// Of the solutions of `solve`.
    pub error_vs_lu: Option<f64>,
    /// Of `columns`, which no refinement mends.
    pub columns_error_vs_lu: Option<f64>,
    /// The factor that the errors were taken against.
    pub reference: Option<&'static str>,
    pub drift: Option<f64>,
    pub rebuilds: Option<usize>,
    /// One pass over half of C in this precision.
    pub bound_ms: Option<f64>,
    /// The same pass before the caches hold what it needs.
    pub cold_bound_ms: Option<f64>,
    /// The start, from K alone.
    pub build_ms: Option<f64>,
    /// Rank of the change on old vertices: median and largest.
    pub rank_p50: Option<f64>,
    pub rank_max: Option<f64>,
}

impl Row {
    /// What a competitor has measured.
    pub fn measured(
        competitor: &Competitor,
        family: &'static str,
        vertices: usize,
        [bound, cold_bound]: [&Samples; 2],
        ranks: &[f64],
    ) -> Result<Self, BenchError> {
        let finite = |value: f64, what: &str| {
            let what = format!("{what} of {} in {family} at {vertices} vertices", competitor.name);
            if value.is_finite() { Ok(value) } else { Err(BenchError::NotFinite(what, value)) }
        };
        let median_of = |samples: &Samples| Quantiles::of(samples).map(|q| q.p50);
        let nothing = Quantiles { p50: f64::NAN, p99: f64::NAN };
        let split_ms = Quantiles::of(&competitor.split).unwrap_or(nothing);
        let merge_ms = Quantiles::of(&competitor.merge).unwrap_or(split_ms);
        finite(split_ms.p50, "the time of a split")?;
        let errors = competitor.errors.as_ref();
        let error = errors.map(|e| finite(e.solve, "the error")).transpose()?;
        let columns_error =
            errors.map(|e| finite(e.columns, "the error of columns")).transpose()?;
        let drift = errors.and_then(|e| e.drift).map(|d| finite(d, "the drift")).transpose()?;
        let count = |samples: &Samples| samples.all().len();
        Ok(Self {
            vertices,
            dofs: 3 * vertices,
            method: competitor.name,
            family,
            precision: competitor.precision(),
            updates: count(&competitor.split)
                + count(&competitor.merge)
                + count(&competitor.old_merge),
            extrapolated: false,
            split_ms,
            merge_ms,
            cold_split_ms: median_of(&competitor.cold_split),
            old_merge_ms: Quantiles::of(&competitor.old_merge),
            solve_ms: median_of(&competitor.solve),
            columns_ms: median_of(&competitor.columns),
            error_vs_lu: error,
            columns_error_vs_lu: columns_error,
            reference: errors.map(|e| e.reference),
            drift,
            rebuilds: errors.and_then(|e| e.rebuilds),
            bound_ms: median_of(bound),
            cold_bound_ms: median_of(cold_bound),
            build_ms: competitor.build_ms,
            rank_p50: Some(median(ranks)),
            rank_max: Some(percentile(ranks, 100.0)),
        })
    }

    /// A direct method's rebuild beyond the time cap.
    pub fn extrapolated(
        method: &'static str,
        family: &'static str,
        vertices: usize,
        milliseconds: f64,
    ) -> Self {
        let time = Quantiles { p50: milliseconds, p99: milliseconds };
        Self {
            vertices,
            dofs: 3 * vertices,
            method,
            family,
            precision: "f64",
            extrapolated: true,
            split_ms: time,
            merge_ms: time,
            ..Self::default()
        }
    }
}
