//! One line of a table: a method in a family at a size.

use serde::Serialize;

use super::competitor::Competitor;
use super::samples::{Quantiles, Samples};
use crate::error::{BenchError, Result};
use crate::harness::statistics::{median, percentile};

/// What was measured, or extrapolated from smaller sizes: then there are only times. README.md says
/// what the columns mean.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Row {
    pub vertices: usize,
    pub dofs: usize,
    pub method: &'static str,
    pub family: &'static str,
    pub precision: &'static str,
    pub updates: usize,
    pub extrapolated: bool,
    pub split_ms: Quantiles,
    pub cold_split_ms: Option<f64>,
    pub merge_ms: Quantiles,
    pub old_merge_ms: Option<Quantiles>,
    pub solve_ms: Option<f64>,
    pub columns_ms: Option<f64>,
    pub error_vs_lu: Option<f64>,
    pub columns_error_vs_lu: Option<f64>,
    pub reference: Option<&'static str>,
    pub drift: Option<f64>,
    pub rebuilds: Option<usize>,
    pub bound_ms: Option<f64>,
    pub cold_bound_ms: Option<f64>,
    pub build_ms: Option<f64>,
    pub rank_p50: Option<f64>,
    pub rank_max: Option<f64>,
}

impl Row {
    /// What a competitor has measured.
    pub fn measured(
        competitor: &Competitor,
        vertices: usize,
        [bound, cold_bound]: [&Samples; 2],
        ranks: &[f64],
    ) -> Result<Self> {
        let family = competitor.family();
        let finite = |value: f64, what: &str| {
            let what = format!("{what} of {} in {family} at {vertices} vertices", competitor.name);
            if value.is_finite() { Ok(value) } else { Err(BenchError::NotFinite(what, value)) }
        };
        let maybe = |value: Option<f64>, what| value.map(|value| finite(value, what)).transpose();
        let median_of = |samples: &Samples| Quantiles::of(samples).map(|q| q.p50);
        let nothing = Quantiles { p50: f64::NAN, p99: f64::NAN };
        let split_ms = Quantiles::of(&competitor.split).unwrap_or(nothing);
        finite(split_ms.p50, "the time of a split")?;
        let errors = competitor.errors.as_ref();
        let updates = [&competitor.split, &competitor.merge, &competitor.old_merge];
        Ok(Self {
            vertices,
            dofs: 3 * vertices,
            method: competitor.name,
            family,
            precision: competitor.precision(),
            updates: updates.map(|samples| samples.all().len()).iter().sum(),
            extrapolated: false,
            split_ms,
            merge_ms: Quantiles::of(&competitor.merge).unwrap_or(split_ms),
            cold_split_ms: median_of(&competitor.cold_split),
            old_merge_ms: Quantiles::of(&competitor.old_merge),
            solve_ms: median_of(&competitor.solve),
            columns_ms: median_of(&competitor.columns),
            error_vs_lu: maybe(errors.map(|e| e.solve), "the error")?,
            columns_error_vs_lu: maybe(errors.map(|e| e.columns), "the error of columns")?,
            reference: errors.map(|e| e.reference),
            drift: maybe(errors.and_then(|e| e.drift), "the drift")?,
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
