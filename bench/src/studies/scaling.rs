//! `scaling`: how the operations grow with the mesh, up to 30 000 vertices where a method can.

use serde::Serialize;

use super::race::{self, Arguments, AtSize, Defaults, FAMILIES, Row};
use crate::error::Result;
use crate::harness::machine::Machine;
use crate::harness::plot::{log_log, slope};
use crate::harness::report::markdown::table;
use crate::harness::report::{self, Summary, spread};
use crate::solvers::direct::{Direct, in_one_thread};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-scaling-1";

const DEFAULTS: Defaults = Defaults {
    vertices: [&[512, 1024, 2048, 4096, 8192, 16_384, 30_000], &[192, 384, 768]],
    pairs: [40, 10],
    direct: &[Direct::SparseAmd, Direct::SparseDissection],
};

/// A time of a row, ms.
type Figure = fn(&Row) -> Option<f64>;

/// The operations that have an exponent.
const OPERATIONS: [(&str, Figure); 6] = [
    ("split", |row| Some(row.split_ms.p50)),
    ("merge", |row| row.build_ms.map(|_| row.merge_ms.p50)),
    ("old_merge", |row| row.old_merge_ms.map(|q| q.p50)),
    ("solve", |row| row.solve_ms),
    ("columns", |row| row.columns_ms),
    ("build", |row| row.build_ms),
];

/// time ∝ vertices^exponent, by the median slope of all pairs of sizes.
#[derive(Clone, Debug, Serialize)]
struct Fit {
    method: &'static str,
    family: &'static str,
    operation: &'static str,
    /// Sizes measured.
    sizes: usize,
    exponent: f64,
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let machine = Machine::here();
    let settings = arguments.settings(&DEFAULTS, &machine)?;
    let folder = arguments.common.folder()?;
    let sizes = in_one_thread(|| race::run(&settings))?;
    let rows = race::rows(&sizes);
    let summary = summary(&rows, &sizes, &settings.vertices, &machine);
    report::write(&folder, "scaling", &rows, summary)
}

fn summary(rows: &[Row], found: &[AtSize], sizes: &[usize], machine: &Machine) -> Summary {
    let fits = fits(rows);
    let mut text = race::head(machine);
    text += &race::families(rows, sizes, &[], |family| exponents(&fits, family));
    let (ratios, left_out) = race::beside(found);
    text += &race::ratio_table(&ratios, sizes);
    text += &race::left_out(&left_out);
    let mut summary = Summary::new(text)
        .with("schema", SCHEMA)
        .with("machine", machine)
        .with("fits", fits)
        .with("ratios", ratios)
        .with("left_out", left_out);
    for family in FAMILIES.map(|family| family.name) {
        for (operation, value) in [OPERATIONS[0], OPERATIONS[3]] {
            let curves = race::lines(rows, family, value);
            let title = format!("{operation}, {family}");
            let svg = log_log(&title, ["free vertices", "ms"], &curves);
            summary = summary.with_file(format!("scaling_{operation}_{family}.svg"), svg);
        }
    }
    summary
}

/// Of all methods in both families, where at least two sizes were measured.
fn fits(rows: &[Row]) -> Vec<Fit> {
    let mut fits = Vec::new();
    for family in FAMILIES.map(|family| family.name) {
        for (operation, value) in OPERATIONS {
            for line in race::lines(rows, family, value) {
                let exponent = slope(&line.points);
                let is = |row: &&Row| row.method == line.name;
                let Some(method) = rows.iter().find(is).map(|row| row.method) else { continue };
                if exponent.is_finite() {
                    let sizes = line.points.len();
                    fits.push(Fit { method, family, operation, sizes, exponent });
                }
            }
        }
    }
    fits
}

fn exponents(fits: &[Fit], family: &str) -> String {
    let heads = OPERATIONS.map(|(operation, _)| operation.to_owned());
    let fits = fits.iter().filter(|fit| fit.family == family);
    let place = |fit: &&Fit| (fit.method.to_owned(), fit.operation.to_owned());
    let lines = spread(&heads, fits, place, |fit| format!("{:.2}", fit.exponent));
    table("exponent of time over vertices", &heads, &lines)
}
