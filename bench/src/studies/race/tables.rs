//! What the studies over many sizes print and draw.

use super::ratios::Ratio;
use super::row::Row;
use super::settings::{FAMILIES, LeftOut};
use crate::harness::machine::Machine;
use crate::harness::plot::Curve;
use crate::harness::report::markdown::{Line, milliseconds, table};
use crate::harness::report::{curves, spread};

/// The machine and what the columns mean.
pub(crate) fn head(machine: &Machine) -> String {
    let Machine { cpu, system, threads_available, memcpy_gb_s, .. } = machine;
    format!(
        "{cpu}, {system}, {threads_available} threads, of which one is used; memcpy {memcpy_gb_s:.1} \
         GB/s.\nColumns: free vertices of the liver phantom, E ratio 100. Medians, ms; in brackets: \
         extrapolated from smaller sizes.\n\n"
    )
}

fn heads(sizes: &[usize]) -> Vec<String> {
    sizes.iter().map(usize::to_string).collect()
}

/// The tables of all families, a line for each method and a column for each size; `more` are lines
/// below the splits, `after` is a text below a family's tables.
pub(crate) fn families(
    rows: &[Row],
    sizes: &[usize],
    more: &[Line],
    after: impl Fn(&str) -> String,
) -> String {
    let mut text = String::new();
    for family in FAMILIES.map(|family| family.name) {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.family == family).collect();
        text += &format!("### Family {family}\n\n");
        text += &one_family(&rows, &heads(sizes), more);
        text += &after(family);
    }
    text
}

fn one_family(rows: &[&Row], heads: &[String], more: &[Line]) -> String {
    let place = |row: &&&Row| (row.method.to_owned(), row.vertices.to_string());
    let lines = |cell: &dyn Fn(&Row) -> String| spread(heads, rows, place, |row| cell(row));
    let time = |value: Option<f64>| value.map_or_else(String::new, milliseconds);
    let error = |value: Option<f64>| value.map_or_else(String::new, |e| format!("{e:.0e}"));
    // A direct method starts anew each time: it has no merges and no slow updates.
    let kept = |row: &Row, value: f64| row.build_ms.map(|_| value);
    let mut splits = lines(&|row| {
        let split = milliseconds(row.split_ms.p50);
        if row.extrapolated { format!("({split})") } else { split }
    });
    let bound = rows.iter().filter(|row| row.precision == "f64" && row.bound_ms.is_some()).rev();
    let name = "(one pass over half of C)";
    let place = |row: &&&Row| (name.to_owned(), row.vertices.to_string());
    splits.extend(spread(heads, bound, place, |row| time(row.bound_ms)));
    splits.extend_from_slice(more);
    let tables = [
        ("split, or rebuild", splits),
        ("split, p99", lines(&|row| time(kept(row, row.split_ms.p99)))),
        ("split that begins a burst", lines(&|row| time(row.cold_split_ms))),
        ("merge of the newest", lines(&|row| time(kept(row, row.merge_ms.p50)))),
        ("merge of another", lines(&|row| time(row.old_merge_ms.map(|q| q.p50)))),
        ("solve", lines(&|row| time(row.solve_ms))),
        ("columns of 3 vertices", lines(&|row| time(row.columns_ms))),
        ("error of solutions", lines(&|row| error(row.error_vs_lu))),
        ("error of columns", lines(&|row| error(row.columns_error_vs_lu))),
    ];
    tables.iter().map(|(corner, lines)| table(corner, heads, lines)).collect()
}

/// The ratios with what is claimed of them.
pub(crate) fn ratio_table(ratios: &[Ratio], sizes: &[usize]) -> String {
    let place = |ratio: &&Ratio| {
        let same = |other: &&Ratio| other.name == ratio.name && other.family == ratio.family;
        let claim = ratios.iter().filter(same).find_map(|other| other.claim.as_deref());
        let claim = claim.map_or_else(String::new, |claim| format!(", claimed {claim}"));
        (format!("{}, {}{claim}", ratio.name, ratio.family), ratio.vertices.to_string())
    };
    let lines = spread(&heads(sizes), ratios, place, |ratio| {
        let digits = if ratio.value < 10.0 { 2 } else { 0 };
        let value = format!("{:.digits$}", ratio.value);
        let value = if ratio.extrapolated { format!("({value})") } else { value };
        if ratio.holds == Some(false) { format!("{value} !") } else { value }
    });
    let mut text = String::from("### Ratios of splits\n\n");
    text += &table("ratio, family", &heads(sizes), &lines);
    if ratios.iter().any(|ratio| ratio.holds == Some(false)) {
        text += "An exclamation mark: not as claimed.\n\n";
    }
    text
}

/// Methods that are missing, and why.
pub(crate) fn left_out(left_out: &[LeftOut]) -> String {
    let line = |LeftOut { vertices, method, family, reason }: &LeftOut| {
        format!("- {method} ({family}) at {vertices} vertices: left out, {reason}\n")
    };
    left_out.iter().map(line).collect()
}

/// A curve for each method of a family, measured points only.
pub(crate) fn lines(rows: &[Row], family: &str, value: impl Fn(&Row) -> Option<f64>) -> Vec<Curve> {
    let measured = rows.iter().filter(|row| row.family == family && !row.extrapolated);
    curves(measured, |row| Some((row.method.to_owned(), (row.vertices as f64, value(row)?))))
}
