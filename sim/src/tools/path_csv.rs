//! Paths from tables: one line per key, comma-separated, with a line of column names.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::error::SimError;
use crate::scene::Key;
use crate::scene::checks::FARTHEST_M;

/// The columns, in any order; the last may be missing.
const COLUMNS: [&str; 5] = ["time_s", "x_m", "y_m", "z_m", "turn_deg"];

/// Columns that must be there.
const NEEDED: usize = 4;

/// The longest file read: more than an hour at 1 kHz.
const MOST_BYTES: u64 = 512 << 20;

/// The longest line read.
const LONGEST_LINE: u64 = 4096;

/// Reads a path: time (ascending), displacement from the start in scanner axes and, if there, turn.
///
/// Empty lines and lines that begin with # are passed over.
/// # Errors
/// [`SimError::Io`]; [`SimError::Value`] with the file, the line, the value and what it has to be.
pub(super) fn read(file: &Path) -> Result<Vec<Key>, SimError> {
    let io = |source| SimError::Io(file.into(), source);
    let bytes = File::open(file).map_err(io)?;
    let length = bytes.metadata().map_err(io)?.len();
    let name = file.display().to_string();
    if length > MOST_BYTES {
        let want = format!("at most {MOST_BYTES} bytes");
        return Err(SimError::value(&name, "path_csv", format!("{length} bytes"), want));
    }
    parse(&name, &mut BufReader::new(bytes.take(MOST_BYTES)))
}

fn parse(name: &str, lines: &mut impl BufRead) -> Result<Vec<Key>, SimError> {
    let mut order: Option<Vec<usize>> = None;
    let mut keys: Vec<Key> = Vec::new();
    let mut line = String::new();
    for number in 1.. {
        line.clear();
        let read = lines.by_ref().take(LONGEST_LINE).read_line(&mut line);
        let read = read.map_err(|source| SimError::Io(name.into(), source))?;
        let place = format!("{name}, line {number}");
        if read as u64 == LONGEST_LINE {
            let want = format!("fewer than {LONGEST_LINE} bytes");
            return Err(SimError::value(&place, "its length", "longer", want));
        }
        let text = line.trim().trim_start_matches('\u{feff}');
        match &order {
            _ if read == 0 => break,
            _ if text.is_empty() || text.starts_with('#') => {}
            None => order = Some(columns(text, &place)?),
            Some(order) => {
                let last = keys.last().map(|key| key.time_s);
                keys.push(key(text, order, &place, last)?);
            }
        }
    }
    if keys.is_empty() {
        let want = "a line of column names and at least one line of numbers";
        return Err(SimError::value(name, "path_csv", "empty", want));
    }
    Ok(keys)
}

/// Which of [`COLUMNS`] each column of the file is.
fn columns(text: &str, place: &str) -> Result<Vec<usize>, SimError> {
    let mut order = Vec::new();
    for name in text.split(',').map(str::trim) {
        let known = COLUMNS.iter().position(|column| *column == name);
        match known.filter(|at| !order.contains(at)) {
            Some(at) => order.push(at),
            None => {
                let want = format!("each of {} once", COLUMNS.join(", "));
                return Err(SimError::value(place, "a column", format!("{name:?}"), want));
            }
        }
    }
    match COLUMNS[..NEEDED].iter().enumerate().find(|(at, _)| !order.contains(at)) {
        Some((_, missing)) => {
            Err(SimError::value(place, missing, "missing", "a column of that name"))
        }
        None => Ok(order),
    }
}

fn key(text: &str, order: &[usize], place: &str, last: Option<f64>) -> Result<Key, SimError> {
    let fields: Vec<&str> = text.split(',').map(str::trim).collect();
    if fields.len() != order.len() {
        let want = format!("{} values, as in the line of names", order.len());
        return Err(SimError::value(place, "the line", format!("{} values", fields.len()), want));
    }
    let mut values = [0.0; COLUMNS.len()];
    for (field, &at) in fields.iter().zip(order) {
        let wrong = |want: String| SimError::value(place, COLUMNS[at], format!("{field:?}"), want);
        let value: f64 = field.parse().map_err(|_| wrong("a number".into()))?;
        let limit = if (1..NEEDED).contains(&at) { FARTHEST_M } else { f64::MAX };
        if !(value.abs() <= limit) {
            return Err(wrong(if limit < f64::MAX {
                format!("a finite number, at most {limit} m either way")
            } else {
                "a finite number".into()
            }));
        }
        values[at] = value;
    }
    let [time_s, x, y, z, turn_deg] = values;
    match last.filter(|last| !(time_s > *last)) {
        Some(last) => {
            let want = format!("more than the time before it, {last:?}");
            Err(SimError::value(place, COLUMNS[0], format!("{time_s:?}"), want))
        }
        None => Ok(Key { time_s, move_m: [x, y, z], turn_deg }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn try_parse(text: &str) -> Result<Vec<Key>, String> {
        parse("p.csv", &mut text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_come_in_any_order_and_turns_may_be_missing() {
        let keys = try_parse("# a pull\ntime_s, z_m,x_m,y_m\r\n0,3,1,2\n\n0.5,6,4,5").unwrap();
        assert_eq!(keys[0], Key { time_s: 0.0, move_m: [1.0, 2.0, 3.0], turn_deg: 0.0 });
        assert_eq!(keys[1], Key { time_s: 0.5, move_m: [4.0, 5.0, 6.0], turn_deg: 0.0 });
        let keys = try_parse("time_s,x_m,y_m,z_m,turn_deg\n1e-3,0,0,0,-90").unwrap();
        assert_eq!(keys[0].turn_deg, -90.0);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let head = "time_s,x_m,y_m,z_m\n";
        let cases = [
            ("", "p.csv: path_csv is empty, want a line of column names"),
            (head, "p.csv: path_csv is empty"),
            ("time_s,x_m,y_m\n", "p.csv, line 1: z_m is missing, want a column"),
            ("time_s,x_m,x_m\n", "p.csv, line 1: a column is \"x_m\", want each of time_s"),
            ("t,x\n", "p.csv, line 1: a column is \"t\""),
            (&format!("{head}0,0,0\n"), "p.csv, line 2: the line is 3 values, want 4 values"),
            (&format!("{head}0,0,0,0\n0,1,1,1"), "p.csv, line 3: time_s is 0.0, want more than"),
            (&format!("{head}0,0,nan,0"), "p.csv, line 2: y_m is \"nan\", want a finite number"),
            (&format!("{head}0,0,inf,0"), "p.csv, line 2: y_m is \"inf\""),
            (
                &format!("{head}0,2e3,0,0"),
                "p.csv, line 2: x_m is \"2e3\", want a finite number, at",
            ),
            (&format!("{head}nan,0,0,0"), "p.csv, line 2: time_s is \"nan\""),
            (&format!("{head}0,one,0,0"), "p.csv, line 2: x_m is \"one\", want a number"),
            (&format!("{head}{}", "1".repeat(5000)), "p.csv, line 2: its length is longer"),
        ];
        for (text, want) in cases {
            let message = try_parse(text).unwrap_err();
            assert!(message.starts_with(want), "{message}\nwant {want}");
        }
    }
}
