//! Rows of cases as tables.

use serde_json::{Map, Value};

use super::case::{Case, Measured, run};
use super::row::Row;
use super::selection::Shard;
use crate::error::BenchError;
use crate::harness::folder::Folder;
use crate::harness::machine::Machine;
use crate::harness::report::{self, Summary, each_once, markdown};

/// Runs the cases and writes the tables of a study that has nothing else to say than a remark; the
/// table has the columns `names`. Returns what is printed.
///
/// # Errors
/// Those of [`run`]; [`BenchError::Io`].
pub(crate) fn write(
    folder: &Folder,
    study: &str,
    (cases, shard): (&[Case<'_>], Shard),
    remark: &str,
    names: &[&str],
) -> Result<String, BenchError> {
    let rows = match run(folder, cases, shard)? {
        Measured::All(rows) => rows,
        Measured::Waiting(message) => return Ok(message),
    };
    let machine = Machine::here();
    let text = format!(
        "# {study}\n\n{}, {} threads.{remark}\n\n{}",
        machine.cpu,
        machine.threads_available,
        markdown(&rows, names)
    );
    let summary = Summary { table: Some(lines(&rows)), ..Summary::new(text) };
    let summary = summary.with("study", study).with("machine", machine);
    report::write(folder, study, &rows, summary)
}

/// Rows as lines of CSV: group, case, every figure and then every measurement that a row has, in
/// order of first appearance, and why a row has none.
pub(crate) fn lines(rows: &[Row]) -> Vec<Map<String, Value>> {
    let columns = columns(rows);
    let line = |row: &Row| {
        let own = [("group", &row.group), ("case", &row.case)];
        let mut line: Map<String, Value> =
            own.into_iter().map(|(name, text)| (name.to_owned(), text.as_str().into())).collect();
        let value = |name: &String| row.value(name).cloned().unwrap_or_default();
        line.extend(columns.iter().map(|name| (name.clone(), value(name))));
        line.insert("failure".into(), row.failure.clone().into());
        line
    };
    rows.iter().map(line).collect()
}

/// The columns `names` of all rows in Markdown, numbers to three digits; a row without figures has
/// its reason below the table.
pub(crate) fn markdown(rows: &[Row], names: &[&str]) -> String {
    let heads: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
    let line = |row: &Row| {
        let cells = names.iter().map(|name| rounded(row, name)).collect();
        (format!("{}: {}", row.group, row.case), cells)
    };
    let lines: Vec<_> = rows.iter().map(line).collect();
    let mut text = markdown::table("case", &heads, &lines);
    for row in rows {
        if let Some(reason) = &row.failure {
            text += &format!("- {}: {}: {reason}\n", row.group, row.case);
        }
    }
    text
}

/// Names of all figures, then of all measurements.
fn columns(rows: &[Row]) -> Vec<String> {
    let figures = rows.iter().flat_map(|row| row.figures.names());
    let names = figures.chain(rows.iter().flat_map(|row| row.measured.names()));
    each_once(names.map(str::to_owned))
}

/// A cell for people: three digits of what is not a whole number.
pub(crate) fn rounded(row: &Row, name: &str) -> String {
    match row.number(name) {
        Some(value) if value.fract() == 0.0 && value.abs() < 1e6 => format!("{value}"),
        Some(value) if (0.01..1e4).contains(&value.abs()) => {
            let digits = 2 - value.abs().log10().floor() as i32;
            format!("{value:.*}", digits.max(0) as usize)
        }
        Some(value) => format!("{value:.2e}"),
        None => row.cell(name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::report::csv;

    fn rows() -> Vec<Row> {
        let mut one = Row::new("inverse", "lu, dense");
        one.figures.put("error", 0.012345);
        one.measured.put("ms", 12.0);
        let mut two = Row::new("inverse", "none");
        two.failure = Some("has \"no\" inverse".into());
        two.figures.put("drift", 1.25e-9);
        vec![one, two]
    }

    #[test]
    fn csv_holds_every_figure_and_quotes_what_needs_it() {
        let want = "group,case,error,drift,ms,failure\n\
                    inverse,\"lu, dense\",0.012345,,12.0,\n\
                    inverse,none,,1.25e-9,,\"has \"\"no\"\" inverse\"\n";
        assert_eq!(csv(&lines(&rows())), want);
    }

    #[test]
    fn markdown_rounds_and_gives_reasons() {
        let text = markdown(&rows(), &["error", "drift", "ms"]);
        assert!(text.contains("| inverse: lu, dense | 0.0123 |"), "{text}");
        assert!(text.contains("| 1.25e-9 |"), "{text}");
        assert!(text.ends_with("- inverse: none: has \"no\" inverse\n"), "{text}");
    }
}
