//! One line of a table: a method in a family at a size.

use std::fmt::Write;

use serde::Serialize;

use super::{Lane, Samples};
use crate::error::BenchError;
use crate::statistics::{median, percentile};

/// Median and 99th percentile by nearest rank, ms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Quantiles {
    pub p50: f64,
    pub p99: f64,
}

impl Quantiles {
    /// None without samples.
    pub fn of(samples: &Samples) -> Option<Self> {
        let all = samples.all();
        let some = !all.is_empty();
        some.then(|| Self { p50: median(&all), p99: percentile(&all, 99.0) })
    }
}

/// What was measured, or extrapolated from smaller sizes: then there are only times.
#[derive(Clone, Debug, Serialize)]
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
    pub merge_ms: Quantiles,
    /// Splits that begin a burst, before the caches hold what they need.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cold_split_ms: Option<f64>,
    /// Merges of vertices that are not the newest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub old_merge_ms: Option<Quantiles>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solve_ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns_ms: Option<f64>,
    /// Of the solutions of `solve`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_vs_lu: Option<f64>,
    /// Of `columns`, which no refinement mends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns_error_vs_lu: Option<f64>,
    /// The factor that the errors were taken against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rebuilds: Option<usize>,
    /// One pass over half of C in this precision.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_ms: Option<f64>,
    /// The same pass before the caches hold what it needs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cold_bound_ms: Option<f64>,
    /// The start, from K alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub build_ms: Option<f64>,
    /// Rank of the change on old vertices: median and largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rank_p50: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rank_max: Option<f64>,
}

impl Row {
    /// What a lane has measured.
    ///
    /// # Errors
    /// [`BenchError::NotFinite`] for a figure that nobody can read.
    pub fn measured(
        lane: &Lane,
        family: &'static str,
        vertices: usize,
        [bound, cold_bound]: [&Samples; 2],
        ranks: &[f64],
    ) -> Result<Self, BenchError> {
        let finite = |value: f64, what: &str| {
            let what = format!("{what} of {} in {family} at {vertices} vertices", lane.name);
            if value.is_finite() { Ok(value) } else { Err(BenchError::NotFinite { what, value }) }
        };
        let median_of = |samples: &Samples| Quantiles::of(samples).map(|q| q.p50);
        let nothing = Quantiles { p50: f64::NAN, p99: f64::NAN };
        let split_ms = Quantiles::of(&lane.split).unwrap_or(nothing);
        let merge_ms = Quantiles::of(&lane.merge).unwrap_or(split_ms);
        finite(split_ms.p50, "the time of a split")?;
        let errors = lane.errors.as_ref();
        let error = errors.map(|e| finite(e.solve, "the error")).transpose()?;
        let columns_error =
            errors.map(|e| finite(e.columns, "the error of columns")).transpose()?;
        let drift = errors.and_then(|e| e.drift).map(|d| finite(d, "the drift")).transpose()?;
        let count = |samples: &Samples| samples.all().len();
        Ok(Self {
            vertices,
            dofs: 3 * vertices,
            method: lane.name,
            family,
            precision: lane.precision(),
            updates: count(&lane.split) + count(&lane.merge) + count(&lane.old_merge),
            extrapolated: false,
            split_ms,
            merge_ms,
            cold_split_ms: median_of(&lane.cold_split),
            old_merge_ms: Quantiles::of(&lane.old_merge),
            solve_ms: median_of(&lane.solve),
            columns_ms: median_of(&lane.columns),
            error_vs_lu: error,
            columns_error_vs_lu: columns_error,
            reference: errors.map(|e| e.reference),
            drift,
            rebuilds: errors.and_then(|e| e.rebuilds),
            bound_ms: median_of(bound),
            cold_bound_ms: median_of(cold_bound),
            build_ms: lane.build_ms,
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
            updates: 0,
            extrapolated: true,
            split_ms: time,
            merge_ms: time,
            cold_split_ms: None,
            old_merge_ms: None,
            solve_ms: None,
            columns_ms: None,
            error_vs_lu: None,
            columns_error_vs_lu: None,
            reference: None,
            drift: None,
            rebuilds: None,
            bound_ms: None,
            cold_bound_ms: None,
            build_ms: None,
            rank_p50: None,
            rank_max: None,
        }
    }
}

const HEADER: &str = "vertices,dofs,method,family,precision,updates,extrapolated,split_p50_ms,\
                      split_p99_ms,cold_split_ms,merge_p50_ms,merge_p99_ms,old_merge_p50_ms,old_merge_p99_ms,\
                      solve_ms,columns_ms,error_vs_lu,columns_error_vs_lu,reference,drift,\
                      rebuilds,bound_ms,cold_bound_ms,build_ms,rank_p50,rank_max";

/// One line per row; what a row has not is empty. `more` adds columns: their names, and their
/// values by row.
pub(crate) fn csv(rows: &[Row], more: (&str, impl Fn(&Row) -> String)) -> String {
    let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
    let mut text = format!("{HEADER}{}\n", more.0);
    for r in rows {
        let old = r.old_merge_ms;
        let fields = [
            format!("{},{},{},{},{}", r.vertices, r.dofs, r.method, r.family, r.precision),
            format!("{},{}", r.updates, r.extrapolated),
            format!("{:e},{:e}", r.split_ms.p50, r.split_ms.p99),
            number(r.cold_split_ms),
            format!("{:e},{:e}", r.merge_ms.p50, r.merge_ms.p99),
            number(old.map(|q| q.p50)),
            number(old.map(|q| q.p99)),
            number(r.solve_ms),
            number(r.columns_ms),
            number(r.error_vs_lu),
            number(r.columns_error_vs_lu),
            r.reference.unwrap_or_default().to_owned(),
            number(r.drift),
            r.rebuilds.map_or_else(String::new, |count| count.to_string()),
            number(r.bound_ms),
            number(r.cold_bound_ms),
            number(r.build_ms),
            number(r.rank_p50),
            number(r.rank_max),
        ];
        _ = writeln!(text, "{}{}", fields.join(","), more.1(r));
    }
    text
}
