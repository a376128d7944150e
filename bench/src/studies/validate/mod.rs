//! `validate`: cases with a known solution, and how the error falls under refinement.
//!
//! `beams.rs`, `spheres.rs`, `shells.rs` and `corotated.rs` hold the cases (`figure.rs`: how one is solved, and
//! what it says), `paper_failure.rs` says where the paper's forces fail.

mod beams;
mod corotated;
mod figure;
mod paper_failure;
mod shells;
mod spheres;

use clap::Args;
use serde::Serialize;

use crate::error::Result;
use crate::harness::arguments::Common;
use crate::harness::plot::log_log;
use crate::harness::report::{self, Claim, Limit, Summary, curves};
use crate::solvers::ReferenceBy;

pub use figure::Row;

/// The whole study.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The figures, cases together, refinement ascending.
    pub rows: Vec<Row>,
}

impl Report {
    /// Runs all cases.
    /// # Errors
    /// `BenchError::NotConverged` if a solve does not reach its tolerance;
    /// `BenchError::Inverse`.
    pub fn new(quick: bool) -> Result<Self> {
        let sizes: &[usize] = if quick { &[4, 8] } else { &[4, 8, 16] };
        let mut rows = Vec::new();
        rows.extend(beams::patch()?);
        for &n in sizes {
            rows.push(beams::timoshenko(n)?);
            rows.push(beams::torsion(n)?);
            rows.push(spheres::lame(n)?);
            rows.push(spheres::coated(n)?);
            rows.push(spheres::eshelby(n)?);
            rows.push(shells::hill(n)?);
            rows.push(shells::inflation(n)?);
        }
        for &n in if quick { &[2, 4, 8] } else { &[2, 4, 8, 16][..] } {
            rows.extend(beams::elastica(n)?);
        }
        rows.extend(corotated::stretch()?);
        rows.extend(corotated::invariance()?);
        let order = |row: &Row| {
            let cases = [
                "patch",
                "timoshenko",
                "torsion",
                "lame",
                "coated",
                "eshelby",
                "hill",
                "inflation",
                "elastica",
            ];
            cases.iter().position(|case| *case == row.case).unwrap_or(cases.len())
        };
        rows.sort_by(|a, b| {
            let key = |row: &Row| (order(row), row.case, row.quantity.clone(), row.refinement);
            key(a).cmp(&key(b))
        });
        Ok(Self { rows })
    }

    /// The convergence order from the row before, of the same quantity at a coarser mesh.
    pub fn slope(&self, row: usize) -> Option<f64> {
        let (here, before) = (&self.rows[row], self.rows.get(row.checked_sub(1)?)?);
        let same = here.case == before.case && here.quantity == before.quantity;
        (same && here.refinement > before.refinement).then(|| {
            (before.relative_error / here.relative_error).ln()
                / (here.refinement as f64 / before.refinement as f64).ln()
        })
    }
}

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// What the cases are solved by; by petsc they are by both, and compared.
    #[arg(long, value_enum, default_value_t)]
    reference: ReferenceBy,
}

/// How far the same figure may be apart by two factors, relative to what it should be.
const APART: f64 = 1e-8;

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, reference } = arguments;
    reference.check()?;
    let folder = common.folder()?;
    let report = reference.solve(|| Report::new(common.quick))?;
    let failure = paper_failure::rows(common.quick)?;
    let mut text = format!("{}\n{}", report.table(), paper_failure::table(&failure));
    let mut claims = Vec::new();
    if *reference != ReferenceBy::BuiltIn {
        let apart = report.apart(&Report::new(common.quick)?);
        let name = "largest difference of a figure to the built-in factor's, of what it should be, over 1e-8";
        claims.push(Claim::new(name, apart / APART, Limit::AtMost(1.0)));
        text.extend(claims.iter().map(Claim::text));
        text += &format!("\nThe largest difference is {apart:.1e}.\n");
    }
    let summary = Summary::new(text)
        .with("claims", claims)
        .with_file("paper_failure.csv", Some(report::csv(&report::objects(&failure))))
        .with_file("validate.svg", report.plot())
        .with_file("paper_failure.svg", paper_failure::plot(&failure));
    report::write(&folder, "validate", &report.rows, summary)
}

impl Report {
    /// The largest difference of a figure to that of another report of the same cases, relative to what it should be.
    fn apart(&self, other: &Self) -> f64 {
        let pairs = self.rows.iter().zip(&other.rows);
        pairs.map(|(a, b)| (a.computed - b.computed).abs() / a.scale).fold(0.0, f64::max)
    }

    fn table(&self) -> String {
        let mut text = String::from(
            "| case | quantity | refinement | vertices | computed | expected | error | slope |\n\
             | --- | --- | --: | --: | --: | --: | --: | --: |\n",
        );
        for (number, r) in self.rows.iter().enumerate() {
            let slope = self.slope(number).map_or_else(String::new, |s| format!("{s:.2}"));
            // Below rounding there is no order to speak of.
            let slope = if r.relative_error < 1e-9 { String::new() } else { slope };
            let figures = [r.computed, r.expected].map(shown);
            text += &format!(
                "| {} | {} | {} | {} | {} | {} | {:.1e} | {slope} |\n",
                r.case,
                r.quantity,
                r.refinement,
                r.vertices,
                figures[0],
                figures[1],
                r.relative_error
            );
        }
        text
    }

    /// Errors over refinement, a line per case with more than one mesh.
    fn plot(&self) -> Option<String> {
        let mut curves = curves(&self.rows, |row| {
            let name = format!("{}: {}", row.case, row.quantity);
            Some((name, (row.refinement as f64, row.relative_error)))
        });
        curves.retain(|curve| curve.points.len() > 1 && curve.points.iter().all(|p| p.1 > 1e-9));
        let titles = ["elements along the case's length", "relative error"];
        log_log("Errors under refinement", titles, &curves)
    }
}

fn shown(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) {
        format!("{value:.5}")
    } else {
        format!("{value:.3e}")
    }
}
