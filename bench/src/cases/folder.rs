//! A study's folder: its options, its finished cases, and what they were made from.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde_json::Value;
use yawara_mesh::atomic_file::{self, PARTIAL};

use super::Row;
use crate::error::BenchError;
use crate::machine::Place;
use crate::ranks;

/// What a study was asked for; a folder belongs to one set of options.
const OPTIONS: &str = "options.json";

/// Where the finished cases are.
const CASES: &str = "cases";

/// The folder of a study of cases.
///
/// Every file is written aside and renamed: a process that ends at any moment leaves whole files.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    place: Place,
}

impl Folder {
    /// Opens `path` for a study with these `options`: a new or empty folder, or one that an earlier
    /// run with the same options left, whose finished cases count. With `force` these are dropped.
    /// Of processes that share it the first goes first.
    ///
    /// # Errors
    /// [`BenchError::OptionsDiffer`] if an earlier run had others; [`BenchError::NotEmpty`] if the
    /// folder holds something else; [`BenchError::NotADirectory`], [`BenchError::Io`]; those of
    /// [`ranks`] where other processes were started with this one.
    pub fn open(path: &Path, options: &Value, force: bool) -> Result<Self, BenchError> {
        // What the first has dropped and begun anew is what the others find.
        ranks::in_turn(|is_first| Self::open_here(path, options, force && is_first))
    }

    fn open_here(path: &Path, options: &Value, force: bool) -> Result<Self, BenchError> {
        let folder = Self { path: path.into(), place: Place::here() };
        if path.exists() && !path.is_dir() {
            return Err(BenchError::NotADirectory { path: path.into() });
        }
        let found = folder.read(OPTIONS)?;
        match found {
            Some(found) if !force => folder.compare(&found, options)?,
            None if !force && folder.holds_something()? => {
                return Err(BenchError::NotEmpty { path: path.into() });
            }
            _ => folder.start(options)?,
        }
        Ok(folder)
    }

    /// The machine and the commit that rows of this process are from.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// Where a file of that name is.
    pub fn at(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The bytes of a file, if it is there.
    ///
    /// # Errors
    /// [`BenchError::Io`].
    pub fn read(&self, name: &str) -> Result<Option<Vec<u8>>, BenchError> {
        match fs::read(self.at(name)) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(source) => Err(BenchError::Io { path: self.at(name), source }),
        }
    }

    /// Writes a file, or replaces it: a reader finds the old one or the whole new one.
    ///
    /// # Errors
    /// [`BenchError::Io`].
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(), BenchError> {
        let path = self.at(name);
        atomic_file::write(&path, bytes).map_err(|source| BenchError::Io { path, source })
    }

    /// The row of a finished case; its number counts from 0.
    ///
    /// # Errors
    /// [`BenchError::Damaged`] if its file is no row of that case; [`BenchError::Io`].
    pub fn row(&self, number: usize, case: &str) -> Result<Option<Row>, BenchError> {
        let name = file_name(number, case);
        let Some(bytes) = self.read(&name)? else { return Ok(None) };
        let damaged = |reason: String| BenchError::Damaged { path: self.at(&name), reason };
        let row: Row =
            serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
        if row.case != case {
            return Err(damaged(format!("it is of the case {:?}, want {case:?}", row.case)));
        }
        Ok(Some(row))
    }

    /// Keeps the row of a finished case.
    ///
    /// # Errors
    /// [`BenchError::Io`].
    pub fn keep(&self, number: usize, row: &Row) -> Result<(), BenchError> {
        let name = file_name(number, &row.case);
        let text = serde_json::to_string_pretty(row)
            .map_err(|error| BenchError::Io { path: self.at(&name), source: error.into() })?;
        self.write(&name, text + "\n")
    }

    /// Removes what ended processes have left half written; to be called when all is done.
    pub fn tidy(&self) {
        for directory in [self.path.clone(), self.at(CASES)] {
            let Ok(entries) = fs::read_dir(directory) else { continue };
            for path in entries.flatten().map(|entry| entry.path()) {
                if path.to_string_lossy().ends_with(PARTIAL) {
                    // Nothing depends on it: a file that can't go may stay.
                    let _ = fs::remove_file(path);
                }
            }
        }
    }

    fn holds_something(&self) -> Result<bool, BenchError> {
        match fs::read_dir(&self.path) {
            // What an ended process has left of its options is nothing.
            Ok(entries) => Ok(entries.flatten().any(|entry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                !(name.contains(OPTIONS) && name.ends_with(PARTIAL)) && name != CASES
            })),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
            Err(source) => Err(BenchError::Io { path: self.path.clone(), source }),
        }
    }

    fn start(&self, options: &Value) -> Result<(), BenchError> {
        let cases = self.at(CASES);
        let io = |source| BenchError::Io { path: cases.clone(), source };
        for name in [OPTIONS, "reference.bin", "picture.svg"] {
            match fs::remove_file(self.at(name)) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(io(error)),
                _ => {}
            }
        }
        match fs::remove_dir_all(&cases) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(io(error)),
            _ => fs::create_dir_all(&cases).map_err(io)?,
        }
        self.write(OPTIONS, format!("{options:#}\n"))
    }

    fn compare(&self, found: &[u8], options: &Value) -> Result<(), BenchError> {
        let path = self.at(OPTIONS);
        let found: Value = serde_json::from_slice(found).map_err(|error| BenchError::Damaged {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        let Some((key, old, new)) = difference("", &found, options) else { return Ok(()) };
        Err(BenchError::OptionsDiffer { path, key, old: shown(&old), new: shown(&new) })
    }
}

fn file_name(number: usize, case: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let name: String = case.chars().map(plain).take(60).collect();
    format!("{CASES}/{number:03}-{name}.json")
}

/// The first place where two values differ, and what stands there.
fn difference(at: &str, a: &Value, b: &Value) -> Option<(String, Value, Value)> {
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            x.keys().chain(y.keys().filter(|key| !x.contains_key(*key))).find_map(|key| {
                let place = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
                let (x, y) = (x.get(key), y.get(key));
                difference(&place, x.unwrap_or(&Value::Null), y.unwrap_or(&Value::Null))
            })
        }
        (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
            (0..x.len()).find_map(|i| difference(&format!("{at}[{i}]"), &x[i], &y[i]))
        }
        _ => (a != b).then(|| (at.to_owned(), a.clone(), b.clone())),
    }
}

fn shown(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(80) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_folder_belongs_to_one_set_of_options() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("new/study");
        let options = json!({ "study": "pareto", "scene": { "steps": 3, "name": "x" } });
        let row = Row::new("group", "a case: x=1");
        Folder::open(&path, &options, false).unwrap().keep(4, &row).unwrap();
        let again = Folder::open(&path, &options, false).unwrap();
        assert_eq!(again.row(4, &row.case).unwrap(), Some(row.clone()));
        assert_eq!(again.row(3, &row.case).unwrap(), None);
        let other = json!({ "study": "pareto", "scene": { "steps": 4, "name": "x" } });
        let error = Folder::open(&path, &other, false).unwrap_err().to_string();
        assert!(error.contains("scene.steps") && error.contains("3") && error.contains("4"));
        assert!(error.contains("--force"), "{error}");
        assert_eq!(again.row(4, &row.case).unwrap(), Some(row.clone()), "nothing is lost");
        let anew = Folder::open(&path, &other, true).unwrap();
        assert_eq!(anew.row(4, &row.case).unwrap(), None);
    }

    #[test]
    fn what_is_no_study_is_refused_and_kept_and_damage_is_named() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("notes.txt"), "x").unwrap();
        let options = json!({});
        let error = Folder::open(root.path(), &options, false).unwrap_err();
        assert!(matches!(error, BenchError::NotEmpty { .. }), "{error}");
        let folder = Folder::open(root.path(), &options, true).unwrap();
        assert!(root.path().join("notes.txt").exists());
        folder.write("cases/000-a.json", "{\"group\": ").unwrap();
        let error = folder.row(0, "a").unwrap_err().to_string();
        assert!(error.contains("000-a.json") && error.contains("EOF"), "{error}");
        folder.keep(1, &Row::new("g", "b?")).unwrap();
        let error = folder.row(1, "b!").unwrap_err().to_string();
        assert!(error.contains("b?"), "{error}");
        let error = Folder::open(&root.path().join("notes.txt"), &options, true).unwrap_err();
        assert!(matches!(error, BenchError::NotADirectory { .. }), "{error}");
    }

    #[test]
    fn what_an_ended_process_left_is_no_row_and_goes_in_the_end() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), &json!({}), false).unwrap();
        let left = root.path().join("cases/000-a.json.99.partial");
        fs::write(&left, "{").unwrap();
        assert_eq!(folder.row(0, "a").unwrap(), None);
        folder.tidy();
        assert!(!left.exists());
    }
}
