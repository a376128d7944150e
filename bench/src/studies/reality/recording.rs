//! A marker's height over time, from a file.

use std::path::Path;

use crate::error::{BenchError, Result};

/// The columns that are read; others may stand beside them.
const COLUMNS: [&str; 2] = ["time_s", "m1_x_mm"];

/// The fewest rows of which a swing can be made.
const FEWEST: usize = 50;

/// A recording at even times.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// From one row to the next, s.
    pub interval_s: f64,
    /// mm, up positive.
    pub heights_mm: Vec<f64>,
}

impl Recording {
    /// Reads a file with a head and the columns `time_s` and `m1_x_mm`.
    /// # Errors
    /// [`BenchError::Io`]; [`BenchError::Recording`] with the line and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(BenchError::at(path))?;
        Self::parse(&path.display().to_string(), &text)
    }

    /// The same of a text; `place` begins messages.
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(place: &str, text: &str) -> Result<Self> {
        let refuse = |line: usize, what: String| BenchError::Recording(place.into(), line, what);
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let head = reader.headers().map_err(|error| refuse(1, error.to_string()))?.clone();
        let at = |name: &str| {
            let found = head.iter().position(|column| column.trim() == name);
            found.ok_or_else(|| {
                refuse(1, format!("no column `{name}`, want {}", COLUMNS.join(" and ")))
            })
        };
        let columns = [at(COLUMNS[0])?, at(COLUMNS[1])?];
        let (mut times, mut heights_mm) = (Vec::new(), Vec::new());
        for (row, record) in reader.records().enumerate() {
            let record = record.map_err(|error| refuse(row + 2, error.to_string()))?;
            let number = |i: usize| {
                let text = record.get(columns[i]).unwrap_or_default().trim();
                let number = text.parse().ok().filter(|x: &f64| x.is_finite());
                let want =
                    || refuse(row + 2, format!("{} is {text:?}, want a finite number", COLUMNS[i]));
                number.ok_or_else(want)
            };
            times.push(number(0)?);
            heights_mm.push(number(1)?);
        }
        if times.len() < FEWEST {
            return Err(refuse(
                times.len() + 1,
                format!("{} rows, want at least {FEWEST}", times.len()),
            ));
        }
        let interval_s = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
        for (row, pair) in times.windows(2).enumerate() {
            let step = pair[1] - pair[0];
            if !(step > 0.0 && (step / interval_s - 1.0).abs() < 0.1) {
                let what = format!("time_s grows by {step:e}, want even steps of {interval_s:.4}");
                return Err(refuse(row + 3, what));
            }
        }
        Ok(Self { interval_s, heights_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_recording_is_refused_with_its_line() {
        let rows: String = (0..60).map(|i| format!("{},{}\n", 0.01 * f64::from(i), i)).collect();
        let good = format!("time_s,m1_x_mm\n{rows}");
        let read = Recording::parse("x.csv", &good).unwrap();
        assert!((read.interval_s - 0.01).abs() < 1e-12 && read.heights_mm.len() == 60);
        for (bad, words) in [
            (good.replace("m1_x_mm", "height"), "line 1: no column `m1_x_mm`"),
            (good.replace("0.05,5\n", "0.05,nan\n"), "line 7: m1_x_mm is \"nan\""),
            (good.replace("0.05,5\n", "0.15,5\n"), "line 7: time_s grows by"),
            (good[..40].into(), "rows, want at least 50"),
        ] {
            let message = Recording::parse("x.csv", &bad).unwrap_err().to_string();
            assert!(message.starts_with("x.csv") && message.contains(words), "{message}");
        }
    }
}
