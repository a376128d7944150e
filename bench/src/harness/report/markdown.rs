//! Tables of studies in Markdown: they read well on a terminal, and in a document.

use std::fmt::Write;

/// A row: its name and its cells; an empty one where there is nothing to say.
pub(crate) type Line = (String, Vec<String>);

/// A table with one column per size, columns padded to the same width. Lines without any cell
/// filled are left out; nothing is written without lines.
pub(crate) fn table(corner: &str, heads: &[String], lines: &[Line]) -> String {
    let lines: Vec<&Line> =
        lines.iter().filter(|(_, cells)| cells.iter().any(|cell| !cell.is_empty())).collect();
    if lines.is_empty() {
        return String::new();
    }
    let width = |text: &str| text.chars().count();
    let names = lines.iter().map(|(name, _)| width(name)).fold(width(corner), usize::max);
    let columns: Vec<usize> = (0..heads.len())
        .map(|j| lines.iter().map(|(_, c)| width(&c[j])).fold(width(&heads[j]).max(2), usize::max))
        .collect();
    let mut text = String::new();
    let mut row = |name: &str, cells: &[String]| {
        _ = write!(text, "| {name:<names$} |");
        for (cell, &width) in cells.iter().zip(&columns) {
            _ = write!(text, " {cell:>width$} |");
        }
        text.push('\n');
    };
    row(corner, heads);
    let rules: Vec<String> = columns.iter().map(|&width| "-".repeat(width - 1) + ":").collect();
    row(&"-".repeat(names), &rules);
    for (name, cells) in lines {
        row(name, cells);
    }
    text.push('\n');
    text
}

/// A column of a table: its head, and a row's cell in it.
pub(crate) type Column<R> = (&'static str, fn(&R) -> String);

/// A line for each row, named by the first column.
pub(crate) fn rows<R>(rows: &[R], columns: &[Column<R>]) -> String {
    let [(corner, name), columns @ ..] = columns else { return String::new() };
    let heads: Vec<String> = columns.iter().map(|(head, _)| (*head).to_owned()).collect();
    let line = |row| (name(row), columns.iter().map(|(_, cell)| cell(row)).collect());
    table(corner, &heads, &rows.iter().map(line).collect::<Vec<Line>>())
}

/// Three significant digits, in tables of times.
pub(crate) fn milliseconds(value: f64) -> String {
    match value {
        x if x >= 100.0 => format!("{x:.0}"),
        x if x >= 10.0 => format!("{x:.1}"),
        x if x >= 1.0 => format!("{x:.2}"),
        x if x >= 0.1 => format!("{x:.3}"),
        x => format!("{x:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_and_empty_lines_go() {
        let heads = ["512", "1024"].map(str::to_owned);
        let cells = |a: &str, b: &str| vec![a.to_owned(), b.to_owned()];
        let lines = [("x".to_owned(), cells("1.5", "")), ("none".to_owned(), cells("", ""))];
        let want = "| ms | 512 | 1024 |\n| -- | --: | ---: |\n| x  | 1.5 |      |\n\n";
        assert_eq!(table("ms", &heads, &lines), want);
        assert_eq!(table("ms", &heads, &lines[1..]), "");
    }

    #[test]
    fn three_digits() {
        let got = [38217.0, 34.84, 1.4541, 0.4712, 0.0712].map(milliseconds);
        assert_eq!(got, ["38217", "34.8", "1.45", "0.471", "0.0712"]);
    }
}
