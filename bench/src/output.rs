//! Where a study writes: whole files, in a directory that nothing else was in.

use std::fs;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use yawara_mesh::atomic_file;

use crate::error::BenchError;

/// A directory for a study's files, checked before anything is measured.
///
/// Dropped without a file written, it removes the directories that it made.
#[derive(Debug)]
pub struct Output {
    directory: PathBuf,
    /// Directories that were not there before, outermost first.
    made: Vec<PathBuf>,
}

impl Output {
    /// Takes `directory`, which must be new or empty unless `force` is set, and tries that it can
    /// be written to. Missing parents are made.
    ///
    /// # Errors
    /// [`BenchError::NotEmpty`], [`BenchError::NotADirectory`], [`BenchError::Io`]; then nothing
    /// is left behind.
    pub fn create(directory: &Path, force: bool) -> Result<Self, BenchError> {
        check(directory, force)?;
        let missing = directory
            .ancestors()
            .take_while(|path| !path.as_os_str().is_empty() && !path.exists())
            .map(Path::to_owned);
        let mut output = Self { directory: directory.into(), made: Vec::new() };
        for path in missing.collect::<Vec<_>>().into_iter().rev() {
            fs::create_dir(&path).map_err(at(&path))?;
            output.made.push(path);
        }
        let probe = output.aside("probe");
        fs::write(&probe, "").map_err(at(&probe))?;
        fs::remove_file(&probe).map_err(at(&probe))?;
        Ok(output)
    }

    /// Writes a file, or replaces it: a reader finds the old one or the whole new one.
    ///
    /// # Errors
    /// [`BenchError::Io`]; an old file of that name then stays.
    pub fn write(&mut self, name: &str, text: &str) -> Result<PathBuf, BenchError> {
        let path = self.directory.join(name);
        atomic_file::write(&path, text).map_err(at(&path))?;
        self.made.clear();
        Ok(path)
    }

    fn aside(&self, name: &str) -> PathBuf {
        self.directory.join(format!(".{name}.{}.partial", std::process::id()))
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        for path in self.made.iter().rev() {
            // Only an empty directory goes; one that someone else has filled meanwhile stays.
            let _ = fs::remove_dir(path);
        }
    }
}

fn check(directory: &Path, force: bool) -> Result<(), BenchError> {
    match fs::metadata(directory) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(at(directory)(error)),
        Ok(found) if !found.is_dir() => Err(BenchError::NotADirectory { path: directory.into() }),
        Ok(_) => {
            let mut entries = fs::read_dir(directory).map_err(at(directory))?;
            match entries.next() {
                Some(_) if !force => Err(BenchError::NotEmpty { path: directory.into() }),
                _ => Ok(()),
            }
        }
    }
}

fn at(path: &Path) -> impl FnOnce(Error) -> BenchError {
    let path = path.to_owned();
    move |source| BenchError::Io { path, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(path: &Path) -> Vec<String> {
        let entries = fs::read_dir(path).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_left_of_a_study_that_wrote_nothing() {
        let root = tempfile::tempdir().unwrap();
        let output = Output::create(&root.path().join("new/deep"), false).unwrap();
        assert!(names(&root.path().join("new/deep")).is_empty());
        drop(output);
        assert!(names(root.path()).is_empty());
    }

    #[test]
    fn files_arrive_whole_and_replace_older_ones() {
        let root = tempfile::tempdir().unwrap();
        let mut output = Output::create(&root.path().join("new"), false).unwrap();
        output.write("a.csv", "one").unwrap();
        let path = output.write("a.csv", "two").unwrap();
        drop(output);
        assert_eq!(names(&root.path().join("new")), ["a.csv"]);
        assert_eq!(fs::read_to_string(path).unwrap(), "two");
    }

    #[test]
    fn foreign_files_are_refused_unless_forced_and_then_kept() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("notes.txt"), "x").unwrap();
        let error = Output::create(root.path(), false).unwrap_err();
        assert!(matches!(error, BenchError::NotEmpty { .. }), "{error}");
        Output::create(root.path(), true).unwrap().write("a.csv", "one").unwrap();
        assert_eq!(names(root.path()), ["a.csv", "notes.txt"]);
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("notes.txt");
        fs::write(&file, "x").unwrap();
        let error = Output::create(&file, true).unwrap_err();
        assert!(matches!(error, BenchError::NotADirectory { .. }), "{error}");
        let error = Output::create(&file.join("below"), true).unwrap_err();
        assert!(error.to_string().contains("notes.txt"), "{error}");
        assert_eq!(names(root.path()), ["notes.txt"]);
    }
}
