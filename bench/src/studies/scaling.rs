//! `scaling`: how the operations grow with the mesh, up to 30 000 vertices where a method can.

use serde::Serialize;

use super::arguments::{Arguments, Defaults};
use super::markdown::table;
use super::race::{self, FAMILIES, LeftOut, Ratio, Row};
use super::{json, race_tables};
use crate::direct::Direct;
use crate::error::BenchError;
use crate::machine::Machine;
use crate::output::Output;
use crate::plot::{log_log, slope};
use crate::progress::Progress;

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

#[derive(Debug, Serialize)]
struct Report {
    schema: &'static str,
    machine: Machine,
    rows: Vec<Row>,
    fits: Vec<Fit>,
    ratios: Vec<Ratio>,
    left_out: Vec<LeftOut>,
}

/// Runs the study, writes its files and returns its tables.
///
/// # Errors
/// [`BenchError`] for bad arguments (nothing is written then) or a method that fails.
pub fn run(arguments: &Arguments) -> Result<String, BenchError> {
    let machine = Machine::here();
    let settings = arguments.settings(&DEFAULTS, &machine)?;
    let mut output = Output::create(&arguments.common.out, arguments.common.force)?;
    let mut progress = Progress::new(settings.vertices.iter().map(|&n| race::work(n)).sum());
    let fields = crate::direct::in_one_thread(|| race::run(&settings, &mut progress))?;
    drop(progress);
    let rows: Vec<Row> = fields.iter().flat_map(|field| field.rows.iter().cloned()).collect();
    let report = Report {
        schema: SCHEMA,
        machine,
        fits: fits(&rows),
        ratios: fields.iter().flat_map(race::ratios).collect(),
        left_out: fields.iter().flat_map(|field| field.left_out.iter().cloned()).collect(),
        rows,
    };
    let text = report.markdown(&settings.vertices);
    output.write("scaling.json", &json(&report, &arguments.common.out, "scaling.json")?)?;
    output.write("scaling.csv", &race::csv(&report.rows, ("", |_: &Row| String::new())))?;
    output.write("scaling.md", &text)?;
    for family in FAMILIES {
        for (operation, value) in [OPERATIONS[0], OPERATIONS[3]] {
            let lines = race_tables::lines(&report.rows, family.name, value);
            let title = format!("{operation}, {}", family.name);
            if let Some(svg) = log_log(&title, ["free vertices", "ms"], &lines) {
                output.write(&format!("scaling_{operation}_{}.svg", family.name), &svg)?;
            }
        }
    }
    Ok(text)
}

/// Of all methods in both families, where at least two sizes were measured.
fn fits(rows: &[Row]) -> Vec<Fit> {
    let mut fits = Vec::new();
    for family in FAMILIES.map(|family| family.name) {
        for (operation, value) in OPERATIONS {
            for line in race_tables::lines(rows, family, value) {
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

impl Report {
    fn markdown(&self, sizes: &[usize]) -> String {
        let mut text = race_tables::head(&self.machine);
        for family in FAMILIES {
            text += &race_tables::family(&self.rows, family.name, sizes, &[]);
            text += &self.exponents(family.name);
        }
        text += &race_tables::ratios(&self.ratios, sizes);
        text += &race_tables::left_out(&self.left_out);
        text
    }

    fn exponents(&self, family: &str) -> String {
        let mut methods: Vec<&str> = Vec::new();
        for fit in self.fits.iter().filter(|fit| fit.family == family) {
            if !methods.contains(&fit.method) {
                methods.push(fit.method);
            }
        }
        let cell = |method: &str, operation: &str| {
            let is = |f: &&Fit| (f.method, f.family, f.operation) == (method, family, operation);
            self.fits.iter().find(is).map_or_else(String::new, |fit| format!("{:.2}", fit.exponent))
        };
        let lines: Vec<_> = methods
            .iter()
            .map(|m| (m.to_string(), OPERATIONS.map(|(operation, _)| cell(m, operation)).to_vec()))
            .collect();
        let heads = OPERATIONS.map(|(operation, _)| operation.to_owned());
        table("exponent of time over vertices", &heads, &lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::Common;
    use serde_json::Value;

    #[test]
    fn every_maintainer_has_exponents_and_large_ones_are_left_out() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("study");
        let arguments = Arguments {
            common: Common { out: out.clone(), quick: true, force: false },
            vertices: vec![160, 240, 2200],
            pairs: Some(5),
            cap_s: 60,
            // Three times 6600² numbers are 1.05 GB.
            memory_gb: Some(1),
            seed: 2,
        };
        let text = run(&arguments).unwrap();
        assert_eq!(std::fs::read_to_string(out.join("scaling.md")).unwrap(), text);
        let json = std::fs::read_to_string(out.join("scaling.json")).unwrap();
        assert!(!json.contains("null"), "{json}");
        let value: Value = serde_json::from_str(&json).unwrap();
        let fits = value["fits"].as_array().unwrap();
        for method in race::maintainers() {
            for family in FAMILIES {
                let splits: Vec<&Value> = fits
                    .iter()
                    .filter(|f| f["method"] == method && f["family"] == family.name)
                    .filter(|f| f["operation"] == "split")
                    .collect();
                assert_eq!(splits.len(), 1, "{method}");
                assert_eq!(splits[0]["sizes"], if method.starts_with("sparse") { 3 } else { 2 });
            }
        }
        let left_out = value["left_out"].as_array().unwrap();
        let dense = race::maintainers().filter(|name| !name.starts_with("sparse")).count();
        assert_eq!(left_out.len(), 2 * dense);
        assert!(left_out.iter().all(|l| l["vertices"] == 2200));
        assert!(text.contains("left out, needs 1.05 GB, limit 1.00 GB"), "{text}");
        let large: Vec<&Value> = value["rows"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|row| row["vertices"] == 2200)
            .collect();
        assert!(large.iter().any(|row| row["method"] == "sparse"));
        for row in large {
            assert!(row["error_vs_lu"].as_f64().unwrap() < 1e-10, "{row}");
            assert_eq!(row["reference"], "sparse_refactor_amd");
        }
    }
}
