//! `compare A B`: two results of a study, figure by figure; `result.rs` reads any study's.

mod result;

use std::path::PathBuf;

use clap::Args;
use serde_json::Value;

use crate::error::{BenchError, Result};
use crate::harness::report::markdown::{self, Column};
use crate::harness::statistics::median;
use result::Entry;

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The result to compare with: a study's folder, or its JSON file.
    pub a: PathBuf,
    /// The result that may be better or worse.
    pub b: PathBuf,
    /// How much larger a count or an error may be, as a fraction of what it was.
    #[arg(long, value_name = "F", default_value_t = 0.05)]
    pub tolerance: f64,
}

/// What two results differ in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Figures that are worse, rows that are gone or have failed.
    pub worse: Vec<Change>,
    /// Figures that are better by more than the tolerance, rows that are new or fail no more.
    pub better: Vec<Change>,
    /// Figures that are neither good nor bad and differ by more than the tolerance.
    pub other: Vec<Change>,
    /// Per measured column, B over A of every row that has both.
    pub times: Vec<(String, Vec<f64>)>,
    /// Figures that were compared.
    pub compared: usize,
}

/// A figure of a row in both results.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The row.
    pub row: String,
    /// The figure; empty where the row itself came or went.
    pub figure: String,
    /// What it was, and is.
    pub values: [String; 2],
}

/// Below this a difference is rounding, whatever the figure.
const FLOOR: f64 = 1e-12;

/// Parts of names of figures of which less is better.
const LESS: &str =
    "error drift residual iterations fallbacks halvings rebuilds failed vertices updates";

/// Parts of names of figures of which more is better; they go before [`LESS`].
const MORE: &str = "converged holds";

/// Compares two results.
/// # Errors
/// [`BenchError::NoResult`] if a file holds no rows, [`BenchError::Io`];
/// [`BenchError::Tolerance`].
pub fn compare(arguments: &Arguments) -> Result<Comparison> {
    let tolerance = arguments.tolerance;
    if !(tolerance >= 0.0 && tolerance.is_finite()) {
        return Err(BenchError::Tolerance(tolerance));
    }
    let (a, b) = (result::read(&arguments.a)?, result::read(&arguments.b)?);
    let mut found = Comparison::default();
    for old in &a {
        match b.iter().find(|new| new.key == old.key) {
            Some(new) => found.add(old, new, tolerance),
            None => found.worse.push(row_change(&old.key, ["there", "gone"])),
        }
    }
    let known = |entry: &&Entry| a.iter().any(|old| old.key == entry.key);
    let new = b.iter().filter(|entry| !known(entry));
    found.better.extend(new.map(|entry| row_change(&entry.key, ["not there", "new"])));
    Ok(found)
}

fn row_change(row: &str, values: [&str; 2]) -> Change {
    Change { row: row.into(), figure: String::new(), values: values.map(str::to_owned) }
}

impl Comparison {
    fn add(&mut self, old: &Entry, new: &Entry, tolerance: f64) {
        let both = [old.failure.as_deref(), new.failure.as_deref()];
        match both {
            [None, Some(reason)] => self.worse.push(row_change(&old.key, ["made", reason])),
            [Some(reason), None] => self.better.push(row_change(&old.key, [reason, "made"])),
            _ => {}
        }
        if both.iter().any(Option::is_some) {
            return;
        }
        for (name, a) in &old.figures {
            let b = new.figures.get(name).unwrap_or(&Value::Null);
            if result::is_measured(name) {
                self.time(name, a, b);
            } else {
                self.figure(&old.key, name, [a, b], tolerance);
            }
        }
    }

    fn time(&mut self, name: &str, a: &Value, b: &Value) {
        let (Some(a), Some(b)) = (a.as_f64(), b.as_f64()) else { return };
        let at = self.times.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.times.push((name.to_owned(), Vec::new()));
            self.times.len() - 1
        });
        self.times[at].1.push(b / a);
    }

    fn figure(&mut self, row: &str, name: &str, [a, b]: [&Value; 2], tolerance: f64) {
        self.compared += 1;
        let values = [a, b].map(Value::to_string);
        let change = Change { row: row.into(), figure: name.into(), values };
        let has = |words: &str| words.split(' ').any(|word| name.contains(word));
        let (more, less) = (has(MORE), has(LESS));
        let number = |value: &Value| value.as_f64().or(value.as_bool().map(f64::from));
        let (larger, smaller) = match (number(a), number(b)) {
            (Some(a), Some(b)) => {
                let room = tolerance * a.abs() + FLOOR;
                (b > a + room, b < a - room)
            }
            // What was a number and is none has got worse, and the other way round.
            (Some(_), None) => (!more, more),
            (None, Some(_)) => (more, !more),
            (None, None) if a == b => (false, false),
            (None, None) => return self.other.push(change),
        };
        match larger == more {
            _ if !larger && !smaller => {}
            _ if !more && !less => self.other.push(change),
            true => self.better.push(change),
            false => self.worse.push(change),
        }
    }

    /// As tables in Markdown.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        for (what, changes) in
            [("Worse", &self.worse), ("Better", &self.better), ("Other", &self.other)]
        {
            let columns: [Column<Change>; 4] = [
                (what, |one| one.row.clone()),
                ("A", |one| one.values[0].clone()),
                ("B", |one| one.values[1].clone()),
                ("figure", |one| one.figure.clone()),
            ];
            text += &markdown::rows(changes, &columns);
        }
        let columns: [Column<(String, Vec<f64>)>; 5] = [
            ("not judged", |(name, _)| name.clone()),
            ("median B/A", |(_, of)| format!("{:.3}", median(of))),
            ("smallest", |(_, of)| format!("{:.3}", of.iter().copied().fold(f64::MAX, f64::min))),
            ("largest", |(_, of)| format!("{:.3}", of.iter().copied().fold(0.0, f64::max))),
            ("rows", |(_, of)| of.len().to_string()),
        ];
        text += &markdown::rows(&self.times, &columns);
        let [worse, better, other] = [&self.worse, &self.better, &self.other].map(Vec::len);
        let compared = self.compared;
        text + &format!(
            "{compared} figures compared: {worse} worse, {better} better, {other} other.\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn compared(a: Value, b: Value, tolerance: f64) -> Comparison {
        let root = tempfile::tempdir().unwrap();
        let paths = [("a", a), ("b", b)].map(|(name, value)| {
            let path = root.path().join(format!("{name}.json"));
            std::fs::write(&path, value.to_string()).unwrap();
            path
        });
        let [a, b] = paths;
        compare(&Arguments { a, b, tolerance }).unwrap()
    }

    fn one(figures: Value) -> Value {
        json!({ "rows": [{ "group": "g", "case": "c", "figures": figures,
                           "measured": { "ms": 2.0 }, "on": { "cpu": "x" } }] })
    }

    #[test]
    fn errors_and_counts_are_judged_by_the_tolerance() {
        for (name, a, b, worse, better) in [
            ("error_force", 0.1, 0.104, 0, 0),
            ("error_force", 0.1, 0.106, 1, 0),
            ("error_force", 0.1, 0.09, 0, 1),
            ("iterations", 100.0, 106.0, 1, 0),
            ("drift_max", 0.0, 1e-13, 0, 0),
            ("drift_max", 0.0, 1e-9, 1, 0),
            ("converged", 20.0, 18.0, 1, 0),
            ("converged", 18.0, 20.0, 0, 1),
        ] {
            let found = compared(one(json!({ name: a })), one(json!({ name: b })), 0.05);
            assert_eq!((found.worse.len(), found.better.len()), (worse, better), "{name} {a} {b}");
            assert_eq!((found.compared, &found.times[0].1[..]), (1, &[1.0][..]));
        }
        let found = |a, b| compared(one(a), one(b), 0.05);
        assert_eq!(found(json!({ "error": 1.0 }), json!({ "error": null })).worse.len(), 1);
        let other = found(json!({ "computed": 1.0 }), json!({ "computed": 2.0 }));
        assert_eq!((other.worse.len(), other.other.len()), (0, 1));
    }

    #[test]
    fn rows_that_go_or_fail_are_worse() {
        let good = one(json!({ "error": 1.0 }));
        let failed = json!({ "rows": [{ "group": "g", "case": "c", "failure": "no" }] });
        assert_eq!(compared(good.clone(), failed.clone(), 0.05).worse.len(), 1);
        assert_eq!(compared(failed, good.clone(), 0.05).better.len(), 1);
        let found = compared(good.clone(), json!({ "rows": [] }), 0.05);
        assert_eq!(found.worse[0].row, "g, c");
        assert!(found.markdown().contains("gone"));
        let times = vec![("measured.ms".into(), vec![1.0])];
        let same = Comparison { compared: 1, times, ..Comparison::default() };
        assert_eq!(compared(good.clone(), good, 0.0), same);
    }

    #[test]
    fn rows_of_any_study_are_told_apart_and_times_are_not_judged() {
        let row = |vertices: usize, split_ms: f64, error: f64| {
            json!({ "method": "sparse", "vertices": vertices, "split_ms": { "p50": split_ms },
                    "error_vs_lu": error })
        };
        let a = json!({ "rows": [row(512, 1.0, 1e-3), row(1024, 2.0, 1e-3)] });
        let b = json!({ "rows": [row(1024, 9.0, 2e-3), row(512, 9.0, 1e-3)] });
        let found = compared(a, b, 0.05);
        let worse: Vec<&str> = found.worse.iter().map(|one| &one.row[..]).collect();
        assert_eq!(worse, ["sparse, vertices 1024"]);
        assert_eq!(found.times, [("split_ms.p50".to_owned(), vec![9.0, 4.5])]);
    }
}
