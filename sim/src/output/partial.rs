//! Names of run directories in the making, and those that runs have left behind.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::SimError;

/// The most bytes of a run's name in that of its directory aside: systems allow 255 in all.
const MOST_BYTES: usize = 100;

/// `.NAME.PID.partial`, NAME cut short where it is long.
pub(super) fn name(run: &str) -> String {
    let end = (0..=MOST_BYTES.min(run.len())).rev().find(|&end| run.is_char_boundary(end));
    format!(".{}.{}.partial", &run[..end.unwrap_or(0)], std::process::id())
}

/// The process that such a name is of.
fn process(name: &str) -> Option<u32> {
    let (_, pid) = name.strip_prefix('.')?.strip_suffix(".partial")?.rsplit_once('.')?;
    pid.parse().ok()
}

/// Removes what interrupted runs have left in `folder` and in the run directories there; returns what
/// was removed. Runs that go on keep theirs: only a system that tells which processes there are
/// (`/proc`) has anything removed.
/// # Errors
/// [`SimError::Io`].
pub fn clean(folder: &Path) -> Result<Vec<PathBuf>, SimError> {
    let mut found = Vec::new();
    if Path::new("/proc/self").exists() {
        find(folder, true, &mut found)?;
    }
    found.sort();
    for path in &found {
        fs::remove_dir_all(path).map_err(|source| SimError::Io(path.clone(), source))?;
    }
    Ok(found)
}

fn find(folder: &Path, deeper: bool, found: &mut Vec<PathBuf>) -> Result<(), SimError> {
    let io = |source: io::Error| SimError::Io(folder.into(), source);
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        if !entry.file_type().map_err(io)?.is_dir() {
            continue;
        }
        match process(&entry.file_name().to_string_lossy()) {
            Some(pid) if !Path::new(&format!("/proc/{pid}")).exists() => found.push(entry.path()),
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
        assert_eq!(clean(root.path()).unwrap(), expected);
        assert!(left.iter().all(|path| !root.path().join(path).exists()));
        assert!(kept.iter().all(|path| root.path().join(path).exists()));
        assert!(clean(root.path()).unwrap().is_empty());
        assert!(clean(&root.path().join("nowhere")).is_err());
    }

    #[test]
    fn names_are_cut_between_letters() {
        assert!(name(&"柔".repeat(80)).starts_with(&format!(".{}.", "柔".repeat(33))));
    }
}
