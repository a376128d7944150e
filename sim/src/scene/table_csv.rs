//! Tables from files: one row per line, comma-separated, with a line of column names.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::error::SimError;

/// The longest file read: more than an hour at 1 kHz.
const MOST_BYTES: u64 = 512 << 20;

/// The longest line read.
const LONGEST_LINE: u64 = 4096;

/// What a table has to have.
pub(crate) struct Table<'a> {
    /// What names it: the key of a scene, an option.
    pub key: &'a str,
    /// Its columns, in any order.
    pub columns: &'a [&'a str],
    /// So many of the first have to be there.
    pub needed: usize,
}

/// What is called with the values of a row, in the order of the table's columns and finite, none where the column or the
/// value is missing; and with the file and line.
pub(crate) type Visit<'a> = dyn FnMut(&[Option<f64>], &str) -> Result<(), SimError> + 'a;

impl Table<'_> {
    /// Reads a file. Empty lines and lines that begin with # are passed over.
    /// # Errors
    /// [`SimError::Io`]; [`SimError::Value`] with the file, the line, the value and what it has to be; those of `visit`.
    pub fn read(&self, file: &Path, visit: &mut Visit<'_>) -> Result<(), SimError> {
        let io = |source| SimError::Io(file.into(), source);
        let bytes = File::open(file).map_err(io)?;
        let length = bytes.metadata().map_err(io)?.len();
        let name = file.display().to_string();
        if length > MOST_BYTES {
            let want = format!("at most {MOST_BYTES} bytes");
            return Err(SimError::value(&name, self.key, format!("{length} bytes"), want));
        }
        self.parse(&name, &mut BufReader::new(bytes.take(MOST_BYTES)), visit)
    }

    /// The same of lines that are there already.
    pub fn parse(
        &self,
        name: &str,
        lines: &mut impl BufRead,
        visit: &mut Visit<'_>,
    ) -> Result<(), SimError> {
        let mut order: Option<Vec<usize>> = None;
        let (mut line, mut is_empty) = (String::new(), true);
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
                None => order = Some(self.order(text, &place)?),
                Some(order) => {
                    visit(&self.values(text, order, &place)?, &place)?;
                    is_empty = false;
                }
            }
        }
        if is_empty {
            let want = "a line of column names and at least one line of numbers";
            return Err(SimError::value(name, self.key, "empty", want));
        }
        Ok(())
    }

    /// Which of the columns each column of the file is.
    fn order(&self, text: &str, place: &str) -> Result<Vec<usize>, SimError> {
        let mut order = Vec::new();
        for name in text.split(',').map(str::trim) {
            let known = self.columns.iter().position(|column| *column == name);
            match known.filter(|at| !order.contains(at)) {
                Some(at) => order.push(at),
                None => {
                    let want = format!("each of {} once", self.columns.join(", "));
                    return Err(SimError::value(place, "a column", format!("{name:?}"), want));
                }
            }
        }
        match self.columns[..self.needed].iter().enumerate().find(|(at, _)| !order.contains(at)) {
            Some((_, missing)) => {
                Err(SimError::value(place, missing, "missing", "a column of that name"))
            }
            None => Ok(order),
        }
    }

    fn values(
        &self,
        text: &str,
        order: &[usize],
        place: &str,
    ) -> Result<Vec<Option<f64>>, SimError> {
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        if fields.len() != order.len() {
            let (count, want) = (fields.len(), order.len());
            let want = format!("{want} values, as in the line of names");
            return Err(SimError::value(place, "the line", format!("{count} values"), want));
        }
        let mut values = vec![None; self.columns.len()];
        for (field, &at) in fields.iter().zip(order) {
            let wrong =
                |want: &str| SimError::value(place, self.columns[at], format!("{field:?}"), want);
            if field.is_empty() && at >= self.needed {
                continue;
            }
            let value: f64 = field.parse().map_err(|_| wrong("a number"))?;
            if !value.is_finite() {
                return Err(wrong("a finite number"));
            }
            values[at] = Some(value);
        }
        Ok(values)
    }
}
