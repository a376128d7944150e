//! `validate`: cases with a known solution, and how the error falls under refinement.

mod beams;
mod corotated;
mod paper_failure;
mod spheres;

use std::fmt::Write;

use nalgebra::Vector3;
use serde::Serialize;
use yawara_corot::{Direct, Equilibrium, InternalForces, NoCorotation, Tolerance};

use super::arguments::Common;
use crate::error::BenchError;
use crate::output::Output;
use crate::plot::{Line, log_log};
use crate::statics::Statics;

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
    fn new(
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

/// The whole study.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The figures, cases together, refinement ascending.
    pub rows: Vec<Row>,
}

impl Report {
    /// Runs all cases.
    ///
    /// # Errors
    /// [`BenchError::NotConverged`] if a solve does not reach its tolerance;
    /// [`BenchError::Inverse`].
    pub fn new(quick: bool) -> Result<Self, BenchError> {
        let sizes: &[usize] = if quick { &[4, 8] } else { &[4, 8, 16] };
        let mut rows = Vec::new();
        rows.extend(beams::patch()?);
        for &n in sizes {
            rows.push(beams::timoshenko(n)?);
            rows.push(beams::torsion(n)?);
            rows.push(spheres::lame(n)?);
            rows.push(spheres::coated(n)?);
            rows.push(spheres::eshelby(n)?);
        }
        for &n in if quick { &[2, 4, 8] } else { &[2, 4, 8, 16][..] } {
            rows.extend(beams::elastica(n)?);
        }
        rows.extend(corotated::stretch()?);
        rows.extend(corotated::invariance()?);
        let order = |row: &Row| {
            let cases = ["patch", "timoshenko", "torsion", "lame", "coated", "eshelby", "elastica"];
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

    fn table(&self) -> String {
        let mut text = String::from(
            "| case | quantity | refinement | vertices | computed | expected | error | slope |\n\
             | --- | --- | --: | --: | --: | --: | --: | --: |\n",
        );
        for (number, r) in self.rows.iter().enumerate() {
            let slope = self.slope(number).map_or_else(String::new, |s| format!("{s:.2}"));
            // Below rounding there is no order to speak of.
            let slope = if r.relative_error < 1e-9 { String::new() } else { slope };
            let figures = [r.computed, r.expected].map(figure);
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {:.1e} | {slope} |",
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

    fn csv(&self) -> String {
        let mut text = String::from(
            "case,refinement,vertices,quantity,computed,expected,scale,relative_error\n",
        );
        for r in &self.rows {
            let _ = writeln!(
                text,
                "{},{},{},{},{:?},{:?},{:?},{:?}",
                r.case,
                r.refinement,
                r.vertices,
                r.quantity,
                r.computed,
                r.expected,
                r.scale,
                r.relative_error
            );
        }
        text
    }

    /// Errors over refinement, a line per case with more than one mesh.
    fn plot(&self) -> Option<String> {
        let mut lines: Vec<Line> = Vec::new();
        for (number, row) in self.rows.iter().enumerate() {
            let name = format!("{}: {}", row.case, row.quantity);
            let point = (row.refinement as f64, row.relative_error);
            if self.slope(number).is_some()
                && let Some(line) = lines.iter_mut().find(|line| line.name == name)
            {
                line.points.push(point);
            } else {
                lines.push(Line { name, points: vec![point] });
            }
        }
        lines.retain(|line| line.points.len() > 1 && line.points.iter().all(|p| p.1 > 1e-9));
        log_log(
            "Errors under refinement",
            ["elements along the case's length", "relative error"],
            &lines,
        )
    }
}

fn figure(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) {
        format!("{value:.5}")
    } else {
        format!("{value:.3e}")
    }
}

/// Runs the study, writes its files and returns its table.
///
/// # Errors
/// [`BenchError`]; for bad arguments nothing is written.
pub fn run(arguments: &Common) -> Result<String, BenchError> {
    let mut output = Output::create(&arguments.out, arguments.force)?;
    let report = Report::new(arguments.quick)?;
    let failure = paper_failure::Report::new(arguments.quick)?;
    let table = report.table() + "\n" + &failure.table();
    output.write("validate.json", &super::json(&report, &arguments.out, "validate.json")?)?;
    output.write("validate.csv", &report.csv())?;
    output.write("paper_failure.csv", &failure.csv())?;
    for (name, svg) in [("validate.svg", report.plot()), ("paper_failure.svg", failure.plot())] {
        if let Some(svg) = svg {
            output.write(name, &svg)?;
        }
    }
    output.write("validate.md", &table)?;
    Ok(table)
}

/// Linear statics: the held vertices where they are, the free ones by the inverse.
fn solve_linear(
    case: &'static str,
    statics: &mut Statics,
    load: &[Vector3<f64>],
) -> Result<(), BenchError> {
    match solve(case, statics, &NoCorotation, &mut Direct, load, 1e-10) {
        // A hundred thousand tetrahedra round their forces to about that; no error here is near it.
        Err(BenchError::NotConverged { reached, .. }) if reached <= 1e-9 => Ok(()),
        other => other,
    }
}

fn solve(
    case: &'static str,
    statics: &mut Statics,
    corotation: &dyn InternalForces,
    equilibrium: &mut dyn Equilibrium,
    load: &[Vector3<f64>],
    residual: f64,
) -> Result<(), BenchError> {
    let tolerance = Tolerance { residual, max_iterations: 300 };
    let outcome = statics.solve(corotation, equilibrium, load, &tolerance, &|| ());
    if outcome.converged {
        return Ok(());
    }
    let (method, reached) = (outcome.method, outcome.residual);
    Err(BenchError::NotConverged { case, method, reached, limit: residual })
}
