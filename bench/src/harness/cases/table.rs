//! Rows of cases as tables.

use serde_json::{Map, Value, json};

use super::case::{Case, Measured, run};
use super::row::Row;
use super::selection::Shard;
use crate::error::Result;
use crate::harness::folder::Folder;
use crate::harness::machine::Machine;
use crate::harness::report::{self, Summary, each_once, markdown};

/// Runs the cases and writes the tables of a study that has nothing else to say than a remark; the
/// table has the columns `names`, apart by blanks. Returns what is printed.
pub(crate) fn write(
    folder: &Folder,
    study: &str,
    (cases, shard): (&[Case<'_>], Shard),
    remark: &str,
    names: &str,
) -> Result<String> {
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
    let figures = rows.iter().flat_map(|row| row.figures.names());
    let columns = each_once(figures.chain(rows.iter().flat_map(|row| row.measured.names())));
    let line = |row: &Row| {
        let named = [("group", json!(row.group)), ("case", json!(row.case))];
        let values = columns.iter().map(|&name| (name, json!(row.value(name))));
        let all = named.into_iter().chain(values).chain([("failure", json!(row.failure))]);
        all.map(|(name, value)| (name.to_owned(), value)).collect()
    };
    rows.iter().map(line).collect()
}

/// The columns `names`, apart by blanks, of all rows in Markdown, numbers to three digits; a row
/// without figures has its reason below the table.
pub(crate) fn markdown(rows: &[Row], names: &str) -> String {
    let heads: Vec<String> = names.split(' ').map(str::to_owned).collect();
    let title = |row: &Row| format!("{}: {}", row.group, row.case);
    let line = |row| (title(row), heads.iter().map(|name| rounded(row, name)).collect());
    let lines: Vec<_> = rows.iter().map(line).collect();
    let failed = rows.iter().filter_map(|row| Some((title(row), row.failure.as_ref()?)));
    let reasons: String = failed.map(|(title, reason)| format!("- {title}: {reason}\n")).collect();
    markdown::table("case", &heads, &lines) + &reasons
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
        let text = markdown(&rows(), "error drift ms");
        assert!(text.contains("| inverse: lu, dense | 0.0123 |"), "{text}");
        assert!(text.contains("| 1.25e-9 |"), "{text}");
        assert!(text.ends_with("- inverse: none: has \"no\" inverse\n"), "{text}");
    }
}
