//! Paths from tables: one line per key.

use std::path::Path;

use crate::error::SimError;
use crate::scene::checks::FARTHEST_M;
use crate::scene::{Key, Table};

/// The last of its columns may be missing.
const TABLE: Table<'_> =
    Table { key: "path_csv", columns: &["time_s", "x_m", "y_m", "z_m", "turn_deg"], needed: 4 };

/// Reads a path: time (ascending), displacement from the start in scanner axes and, if there, turn.
/// # Errors
/// As [`Table::read`].
pub(super) fn read(file: &Path) -> Result<Vec<Key>, SimError> {
    let mut keys = Vec::new();
    TABLE.read(file, &mut |values, place| add(values, place, &mut keys))?;
    Ok(keys)
}

#[cfg(test)]
fn parse(name: &str, lines: &mut impl std::io::BufRead) -> Result<Vec<Key>, SimError> {
    let mut keys = Vec::new();
    TABLE.parse(name, lines, &mut |values, place| add(values, place, &mut keys))?;
    Ok(keys)
}

fn add(values: &[Option<f64>], place: &str, keys: &mut Vec<Key>) -> Result<(), SimError> {
    let [time_s, x, y, z, turn_deg] = [0, 1, 2, 3, 4].map(|at| values[at].unwrap_or_default());
    for (at, value) in [x, y, z].into_iter().enumerate() {
        if value.abs() > FARTHEST_M {
            let want = format!("a finite number, at most {FARTHEST_M} m either way");
            return Err(SimError::value(place, TABLE.columns[1 + at], format!("{value:?}"), want));
        }
    }
    match keys.last().map(|key| key.time_s).filter(|last| !(time_s > *last)) {
        Some(last) => {
            let want = format!("more than the time before it, {last:?}");
            return Err(SimError::value(place, TABLE.columns[0], format!("{time_s:?}"), want));
        }
        None => keys.push(Key { time_s, move_m: [x, y, z], turn_deg }),
    }
    Ok(())
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
            (&format!("{head}0,2e3,0,0"), "p.csv, line 2: x_m is 2000.0, want a finite number, at"),
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
