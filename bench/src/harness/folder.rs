//! A study's folder: whole files, and for a study of cases its options and finished cases.

use std::fs;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use yawara_mesh::atomic_file::{self, PARTIAL};

use super::cases::Row;
use super::ranks;
use crate::error::{BenchError, Result};

/// What a study was asked for; a folder belongs to one set of options.
const OPTIONS: &str = "options.json";

/// Where the finished cases are.
const CASES: &str = "cases";

/// The folder that a study writes to.
///
/// Every file is written under another name and then renamed: a process that ends at any moment
/// leaves whole files. A folder that stays empty is removed again, with the parents made for it.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Directories that were not there before, outermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Takes `path`, which must be new or empty unless `force` is set, and checks that it can be
    /// written to. Missing parents are made.
    /// # Errors
    /// [`BenchError::NotEmpty`], [`BenchError::NotADirectory`], [`BenchError::Io`]; then nothing
    /// is left behind.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        let mut folder = Self { path: path.into(), made: Vec::new() };
        if folder.names()?.iter().any(|_| !force) {
            return Err(BenchError::NotEmpty(path.into()));
        }
        let missing = path.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists());
        for path in missing.map(Path::to_owned).collect::<Vec<_>>().into_iter().rev() {
            fs::create_dir(&path).map_err(BenchError::at(&path))?;
            folder.made.push(path);
        }
        let probe = folder.at(&format!(".probe.{}{PARTIAL}", std::process::id()));
        let written = fs::write(&probe, "").and_then(|()| fs::remove_file(&probe));
        written.map_err(BenchError::at(&probe))?;
        Ok(folder)
    }

    /// Opens `path` for a study with these `options`: a new or empty folder, or one that an earlier
    /// run with the same options left, whose finished cases count. With `force` these are dropped.
    /// Of processes that share it the first goes first.
    /// # Errors
    /// [`BenchError::OptionsDiffer`] if an earlier run had others; [`BenchError::NotEmpty`] if the
    /// folder holds something else; [`BenchError::NotADirectory`], [`BenchError::Io`]; those of
    /// [`ranks`] where other processes were started with this one.
    pub fn open(path: &Path, options: &Value, force: bool) -> Result<Self> {
        // What the first has dropped and begun anew is what the others find.
        ranks::in_turn(|is_first| Self::open_here(path, options, force && is_first))
    }

    fn open_here(path: &Path, options: &Value, force: bool) -> Result<Self> {
        let folder = Self { path: path.into(), made: Vec::new() };
        // Options that a process was writing when it ended, and cases without options, are nothing.
        let left =
            |name: &String| (name.contains(OPTIONS) && name.ends_with(PARTIAL)) || name == CASES;
        let names = folder.names()?;
        match folder.read(OPTIONS)? {
            Some(found) if !force => folder.compare(&found, options)?,
            None if !force && !names.iter().all(left) => {
                return Err(BenchError::NotEmpty(path.into()));
            }
            _ => folder.start(options)?,
        }
        Ok(folder)
    }

    /// Names of what is in it; none if it is not there.
    fn names(&self) -> Result<Vec<String>> {
        if self.path.exists() && !self.path.is_dir() {
            return Err(BenchError::NotADirectory(self.path.clone()));
        }
        let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
        let entries = if_there(&self.path, fs::read_dir(&self.path))?;
        Ok(entries.into_iter().flat_map(Iterator::flatten).map(name).collect())
    }

    /// Where a file of that name is.
    pub fn at(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The bytes of a file, if it is there.
    /// # Errors
    /// [`BenchError::Io`].
    pub fn read(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let path = self.at(name);
        if_there(&path, fs::read(&path))
    }

    /// Writes a file, or replaces it: a reader finds the old one or the whole new one. Folders within the
    /// name are made.
    /// # Errors
    /// [`BenchError::Io`].
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<()> {
        let path = self.at(name);
        if let Some(above) = path.parent() {
            fs::create_dir_all(above).map_err(BenchError::at(above))?;
        }
        atomic_file::write(&path, bytes).map_err(BenchError::at(&path))
    }

    /// The row of a finished case; its number counts from 0.
    /// # Errors
    /// [`BenchError::Damaged`] if its file is no row of that case; [`BenchError::Io`].
    pub fn row(&self, number: usize, case: &str) -> Result<Option<Row>> {
        let name = file_name(number, case);
        let Some(bytes) = self.read(&name)? else { return Ok(None) };
        let row: Row = self.parse(&name, &bytes)?;
        if row.case != case {
            let reason = format!("it is of the case {:?}, want {case:?}", row.case);
            return Err(BenchError::Damaged(self.at(&name), reason));
        }
        Ok(Some(row))
    }

    /// Keeps the row of a finished case.
    /// # Errors
    /// [`BenchError::Io`].
    pub fn keep(&self, number: usize, row: &Row) -> Result<()> {
        let name = file_name(number, &row.case);
        self.write(&name, format!("{:#}\n", json!(row)))
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

    fn start(&self, options: &Value) -> Result<()> {
        let cases = self.at(CASES);
        for name in [OPTIONS, "reference.bin", "picture.svg"] {
            if_there(&self.at(name), fs::remove_file(self.at(name)))?;
        }
        if_there(&cases, fs::remove_dir_all(&cases))?;
        fs::create_dir_all(&cases).map_err(BenchError::at(&cases))?;
        self.write(OPTIONS, format!("{options:#}\n"))
    }

    fn compare(&self, found: &[u8], options: &Value) -> Result<()> {
        let found = self.parse(OPTIONS, found)?;
        let Some((key, old, new)) = difference("", &found, options) else { return Ok(()) };
        let (path, old, new) = (self.at(OPTIONS), shown(&old), shown(&new));
        Err(BenchError::OptionsDiffer { path, key, old, new })
    }

    fn parse<T: DeserializeOwned>(&self, name: &str, bytes: &[u8]) -> Result<T> {
        let damaged =
            |error: serde_json::Error| BenchError::Damaged(self.at(name), error.to_string());
        serde_json::from_slice(bytes).map_err(damaged)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        for path in self.made.iter().rev() {
            // Only an empty directory goes.
            let _ = fs::remove_dir(path);
        }
    }
}

/// What was done at `path`; none if nothing is there.
fn if_there<T>(path: &Path, done: Result<T, Error>) -> Result<Option<T>> {
    match done {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        done => done.map(Some).map_err(BenchError::at(path)),
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
        anew.write("of/a/case.toml", "x = 1").unwrap();
        assert_eq!(anew.read("of/a/case.toml").unwrap().as_deref(), Some(&b"x = 1"[..]));
    }

    #[test]
    fn what_is_no_study_is_refused_and_kept_and_damage_is_named() {
        let root = tempfile::tempdir().unwrap();
        let (file, options) = (root.path().join("notes.txt"), json!({}));
        fs::write(&file, "x").unwrap();
        let error = Folder::open(root.path(), &options, false).unwrap_err();
        assert!(matches!(error, BenchError::NotEmpty(_)), "{error}");
        let folder = Folder::open(root.path(), &options, true).unwrap();
        assert!(file.exists());
        folder.write("cases/000-a.json", "{\"group\": ").unwrap();
        let error = folder.row(0, "a").unwrap_err().to_string();
        assert!(error.contains("000-a.json") && error.contains("EOF"), "{error}");
        folder.keep(1, &Row::new("g", "b?")).unwrap();
        let error = folder.row(1, "b!").unwrap_err().to_string();
        assert!(error.contains("b?"), "{error}");
        let error = Folder::open(&file, &options, true).unwrap_err();
        assert!(matches!(error, BenchError::NotADirectory(_)), "{error}");
        // What an ended process left is no row, and goes in the end.
        let left = root.path().join("cases/002-a.json.99.partial");
        fs::write(&left, "{").unwrap();
        assert_eq!(folder.row(2, "a").unwrap(), None);
        folder.tidy();
        assert!(!left.exists());
    }

    fn names(path: &Path) -> Vec<String> {
        let entries = fs::read_dir(path).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn files_arrive_whole_and_a_study_that_wrote_none_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::create(&root.path().join("new/deep"), false).unwrap();
        assert!(names(&root.path().join("new/deep")).is_empty());
        drop(folder);
        assert!(names(root.path()).is_empty());
        let folder = Folder::create(&root.path().join("new"), false).unwrap();
        folder.write("a.csv", "one").unwrap();
        folder.write("a.csv", "two").unwrap();
        drop(folder);
        assert_eq!(names(&root.path().join("new")), ["a.csv"]);
        assert_eq!(fs::read_to_string(root.path().join("new/a.csv")).unwrap(), "two");
    }

    #[test]
    fn foreign_files_are_refused_unless_forced_and_then_kept() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("notes.txt");
        fs::write(&file, "x").unwrap();
        let error = Folder::create(root.path(), false).unwrap_err();
        assert!(matches!(error, BenchError::NotEmpty(_)), "{error}");
        let error = Folder::create(&file, true).unwrap_err();
        assert!(matches!(error, BenchError::NotADirectory(_)), "{error}");
        let error = Folder::create(&file.join("below"), true).unwrap_err();
        assert!(error.to_string().contains("notes.txt"), "{error}");
        assert_eq!(names(root.path()), ["notes.txt"]);
        Folder::create(root.path(), true).unwrap().write("a.csv", "one").unwrap();
        assert_eq!(names(root.path()), ["a.csv", "notes.txt"]);
    }
}
