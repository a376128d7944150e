//! `table1`: one vertex in and out at the sizes of the paper's Table 1, by every method: here on
//! the processor, in `gpu.rs` (feature `gpu`) on a graphics device.

#[cfg(feature = "gpu")]
pub mod gpu;

use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::error::Result;
use crate::harness::machine::Machine;
use crate::harness::plot::{Curve, log_log};
use crate::harness::report::{self, Summary};
use crate::solvers::direct::{DIRECT, in_one_thread};
use crate::studies::race::{self, Arguments, AtSize, Defaults, FAMILIES, Row, Speed};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-table1-1";

const DEFAULTS: Defaults = Defaults {
    vertices: [&[512, 728, 1024, 1536, 2048, 2560, 3072, 3456], &[192, 288, 432]],
    pairs: [100, 15],
    direct: &DIRECT,
};

/// A column of the paper's Table 1, ms.
#[derive(Clone, Copy, Debug, Serialize)]
struct Published {
    vertices: usize,
    split_ms: f64,
    merge_ms: f64,
    direct_ms: f64,
}

/// As printed: the direct method's 71.4 ms stands there twice.
const PUBLISHED: [Published; 8] = [
    published(512, 3.1, 2.5, 71.4),
    published(728, 4.4, 3.5, 71.4),
    published(1024, 7.3, 6.1, 141.9),
    published(1536, 13.0, 10.9, 384.6),
    published(2048, 20.1, 17.3, 735.6),
    published(2560, 29.5, 25.5, 1285.6),
    published(3072, 45.3, 30.4, 2177.5),
    published(3456, 54.7, 37.0, 2881.1),
];

/// A line of that table.
type Figure = fn(&Published) -> f64;

const FIGURES: [(&str, Figure); 3] =
    [("split", |p| p.split_ms), ("merge", |p| p.merge_ms), ("direct", |p| p.direct_ms)];

const PUBLISHED_ON: &str = "Intel Core i7 920 2.67 GHz, NVIDIA Quadro 5000 (CUBLAS, CULA), 8 GB";

const fn published(vertices: usize, split_ms: f64, merge_ms: f64, direct_ms: f64) -> Published {
    Published { vertices, split_ms, merge_ms, direct_ms }
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let machine = Machine::here();
    let settings = arguments.settings(&DEFAULTS, &machine)?;
    let folder = arguments.common.folder()?;
    let sizes = in_one_thread(|| race::run(&settings))?;
    let rows = race::rows(&sizes);
    let summary = summary(&rows, &sizes, &settings.vertices, &machine);
    report::write(&folder, "table1", &rows, summary)
}

fn summary(rows: &[Row], found: &[AtSize], sizes: &[usize], machine: &Machine) -> Summary {
    let speed = |size: &AtSize| size.memory.speed(size.vertices);
    let memory: Vec<Speed> = found.iter().filter_map(speed).collect();
    let mut text = race::head(machine);
    text += &format!("The paper's figures, as printed: {PUBLISHED_ON}.\n\n");
    let paper = FIGURES.map(|(name, value)| printed(name, sizes, value));
    text += &race::families(rows, sizes, &paper, |_| String::new());
    let (ratios, left_out) = race::beside(found);
    text += &race::ratio_table(&ratios, sizes);
    for speed in &memory {
        let Speed { vertices, bytes, cold_pass_gb_s, pass_gb_s, memcpy_gb_s } = speed;
        text += &format!(
            "- {vertices} vertices: one pass over {:.1} MB reads and writes {pass_gb_s:.1} \
             GB/s, the first of a burst {cold_pass_gb_s:.1} GB/s, a memcpy of them {memcpy_gb_s:.1} GB/s\n",
            *bytes as f64 / 1e6
        );
    }
    text += &race::left_out(&left_out);
    let summary = Summary { table: Some(table(rows)), ..Summary::new(text) }
        .with("schema", SCHEMA)
        .with("machine", machine)
        .with("published_on", PUBLISHED_ON)
        .with("published", PUBLISHED)
        .with("ratios", ratios)
        .with("memory", memory)
        .with("left_out", left_out);
    FAMILIES.into_iter().fold(summary, |summary, family| {
        let name = if family == FAMILIES[0] { "table1.svg" } else { "table1_laminate.svg" };
        summary.with_file(name, plot(rows, family.name))
    })
}

/// The rows with the paper's figures of the same size.
fn table(rows: &[Row]) -> Vec<Map<String, Value>> {
    let mut lines = report::objects(rows);
    for (line, row) in lines.iter_mut().zip(rows) {
        let paper = PUBLISHED.iter().find(|p| p.vertices == row.vertices);
        let figure = |(name, value)| (format!("paper_{name}_ms"), json!(paper.map(value)));
        line.extend(FIGURES.map(figure));
    }
    lines
}

/// A line of a table with the paper's figures.
fn printed(name: &str, sizes: &[usize], value: fn(&Published) -> f64) -> (String, Vec<String>) {
    let cell = |n: &usize| {
        let column = PUBLISHED.iter().find(|p| p.vertices == *n);
        column.map_or_else(String::new, |p| value(p).to_string())
    };
    (format!("(the paper, {name})"), sizes.iter().map(cell).collect())
}

fn plot(rows: &[Row], family: &str) -> Option<String> {
    let mut curves = race::lines(rows, family, |row| Some(row.split_ms.p50));
    let known = PUBLISHED.iter().filter(|p| rows.iter().any(|row| row.vertices == p.vertices));
    let points: Vec<_> = known.map(|p| (p.vertices as f64, p.split_ms)).collect();
    if !points.is_empty() {
        curves.push(Curve { name: "the paper (Quadro 5000)".into(), points });
    }
    log_log(&format!("One vertex in, {family}"), ["free vertices", "ms"], &curves)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_table_is_as_printed() {
        assert_eq!(PUBLISHED.map(|p| p.vertices), DEFAULTS.vertices[0]);
        assert_eq!(PUBLISHED[0].direct_ms, PUBLISHED[1].direct_ms);
        // The text of the paper: 3456 vertices, 54.7 ms for a split.
        assert_eq!(PUBLISHED[7].split_ms, 54.7);
    }
}
