//! Which forces and solver find the equilibrium of a bent beam, and up to which rotation.

use serde::Serialize;
use yawara_corot::{Tolerance, equilibrium_by_name, forces_by_name};

use crate::bodies::beams::{Beam, BeamLoad};
use crate::error::Result;
use crate::harness::plot::log_log;
use crate::harness::report::curves;

/// Co-rotation and solver, the paper's own first.
const CHOICES: [(&str, &str); 5] = [
    ("paper", "direct"),
    ("paper", "anderson"),
    ("element", "direct"),
    ("row", "anderson"),
    ("element", "anderson"),
];

/// Iterations granted.
const MOST: usize = 300;

/// One beam bent in one jump.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    corotation: &'static str,
    equilibrium: &'static str,
    degrees: u32,
    iterations: usize,
    residual: f64,
    converged: bool,
}

/// Bends the beam of the iteration counts from rest by each angle at once.
pub(super) fn rows(quick: bool) -> Result<Vec<Row>> {
    let angles: &[u32] =
        if quick { &[1, 3, 9, 30, 90] } else { &[1, 2, 3, 5, 7, 9, 12, 16, 22, 30, 45, 65, 90] };
    let tolerance = Tolerance::new(1e-8, MOST);
    let mut rows = Vec::new();
    for (corotation, equilibrium) in CHOICES {
        for &degrees in angles {
            let mut beam = Beam::new(BeamLoad::Bend, 0.3, None)?;
            let stage = forces_by_name(corotation)?;
            let mut solver = equilibrium_by_name(equilibrium)?;
            let part = f64::from(degrees) / 90.0;
            let outcome = beam.step(part, stage.as_ref(), solver.as_mut(), &tolerance).outcome;
            rows.push(Row {
                corotation,
                equilibrium,
                degrees,
                iterations: outcome.iterations,
                residual: outcome.residual,
                converged: outcome.converged,
            });
        }
    }
    Ok(rows)
}

pub(super) fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| co-rotation | solver | converges up to | fails from |\n| --- | --- | --: | --: |\n",
    );
    for (corotation, equilibrium) in CHOICES {
        let of = |row: &&Row| (row.corotation, row.equilibrium) == (corotation, equilibrium);
        let angle = |row: &Row| format!("{}°", row.degrees);
        let fails = rows.iter().filter(of).find(|row| !row.converged);
        let first = fails.map_or(u32::MAX, |row| row.degrees);
        let good = rows.iter().filter(of).rfind(|row| row.degrees < first);
        let cells = [good.map(angle), fails.map(angle)].map(Option::unwrap_or_default);
        text += &format!("| {corotation} | {equilibrium} | {} | {} |\n", cells[0], cells[1]);
    }
    text
}

pub(super) fn plot(rows: &[Row]) -> Option<String> {
    let curves = curves(rows, |row| {
        let name = format!("{}, {}", row.corotation, row.equilibrium);
        Some((name, (f64::from(row.degrees), row.residual.max(1e-12))))
    });
    let title = "Relative residual reached when a beam is bent at once";
    log_log(title, ["rotation of the end (degrees)", "residual"], &curves)
}
