//! Names of run directories in the making, and those that runs have left behind.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::checkpoint;
use crate::SimError;

/// The most bytes of a run's name in that of its directory aside: systems allow 255 in all.
const MOST_BYTES: usize = 100;

/// `.NAME.PID.partial`, NAME cut short where it is long.
pub(super) fn name(run: &str) -> String {
    format!(".{}.{}.partial", cut(run), std::process::id())
}

/// As much of a run's name as there is in that of its directory aside.
fn cut(run: &str) -> &str {
    let end = (0..=MOST_BYTES.min(run.len())).rev().find(|&end| run.is_char_boundary(end));
    &run[..end.unwrap_or(0)]
}

/// The run and the process that such a name is of.
fn parts(name: &str) -> Option<(&str, u32)> {
    let (run, pid) = name.strip_prefix('.')?.strip_suffix(".partial")?.rsplit_once('.')?;
    Some((run, pid.parse().ok()?))
}

/// The process that such a name is of.
pub(super) fn process(name: &str) -> Option<u32> {
    parts(name).map(|(_, pid)| pid)
}

/// Whether such a name is of that run.
pub(super) fn is_of(name: &str, run: &str) -> bool {
    parts(name).is_some_and(|(of, _)| of == cut(run))
}

/// Whether the process of such a name is there, on a system that tells which there are.
pub(super) fn is_alive(name: &str) -> bool {
    process(name).is_some_and(|pid| Path::new(&format!("/proc/{pid}")).exists())
}

/// What was done about runs that were interrupted.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Cleaned {
    /// What was removed.
    pub removed: Vec<PathBuf>,
    /// Runs that can be gone on with, and the steps that they had made at their last checkpoint.
    pub kept: Vec<(PathBuf, usize)>,
}

/// Removes what interrupted runs have left in `folder` and in the run directories there, but those that can be
/// gone on with only if `all` are to go. Runs that go on keep theirs: only a system that tells which processes
/// there are (`/proc`) has anything removed.
/// # Errors
/// [`SimError::Io`].
pub fn clean(folder: &Path, all: bool) -> Result<Cleaned, SimError> {
    let mut found = Vec::new();
    if Path::new("/proc/self").exists() {
        find(folder, true, &mut found)?;
    }
    found.sort();
    let mut cleaned = Cleaned::default();
    for path in found {
        match checkpoint::read(&path) {
            Ok((.., checkpoint)) if !all => cleaned.kept.push((path, checkpoint.steps())),
            _ => {
                fs::remove_dir_all(&path).map_err(|source| SimError::Io(path.clone(), source))?;
                cleaned.removed.push(path);
            }
        }
    }
    Ok(cleaned)
}

fn find(folder: &Path, deeper: bool, found: &mut Vec<PathBuf>) -> Result<(), SimError> {
    let io = |source: io::Error| SimError::Io(folder.into(), source);
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        if !entry.file_type().map_err(io)?.is_dir() {
            continue;
        }
        let name = entry.file_name().to_string_lossy().into_owned();
        match process(&name) {
            Some(_) if !is_alive(&name) => found.push(entry.path()),
            None if deeper => find(&entry.path(), false, found)?,
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_runs_that_are_no_more_is_removed() {
        let root = tempfile::tempdir().unwrap();
        // No process has so high a number.
        let left =
            [".liver.4194999999.partial".to_owned(), "liver/.liver.4194999998.partial".into()];
        let kept = [name("liver"), ".liver.x.partial".into(), "liver/frames".into()];
        for path in left.iter().chain(&kept) {
            fs::create_dir_all(root.path().join(path).join("frames")).unwrap();
        }
        let expected: Vec<PathBuf> = left.iter().map(|path| root.path().join(path)).collect();
        let removed = Cleaned { removed: expected, kept: Vec::new() };
        assert_eq!(clean(root.path(), false).unwrap(), removed);
        assert!(left.iter().all(|path| !root.path().join(path).exists()));
        assert!(kept.iter().all(|path| root.path().join(path).exists()));
        assert_eq!(clean(root.path(), false).unwrap(), Cleaned::default());
        assert!(clean(&root.path().join("nowhere"), true).is_err());
    }

    #[test]
    fn names_are_cut_between_letters() {
        assert!(name(&"柔".repeat(80)).starts_with(&format!(".{}.", "柔".repeat(33))));
    }
}
