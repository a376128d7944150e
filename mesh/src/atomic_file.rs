//! Files that are there whole or not at all.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::Builder;

/// How the names of files end that are still being written; they start with a dot.
pub const PARTIAL: &str = ".partial";

/// Writes `bytes` to `path`, replacing what stands there only once the file is whole.
///
/// # Errors
/// As [`write_with`].
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> io::Result<()> {
    write_with(path, |file| file.write_all(bytes.as_ref()))
}

/// Writes what `fill` writes to `path`, replacing what stands there only once the file is whole.
///
/// The file is written under a temporary name in the same folder (`.NAME.XXXXXX.partial`), brought
/// to the disk and renamed: whoever reads `path` finds the old file or the whole new one, also
/// after a crash. Several processes may write the same file.
///
/// # Errors
/// What `fill` or the system says; what stood at `path` is still there then, and nothing beside it.
pub fn write_with(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    // Created as any other file: its permissions are those that the user's mask leaves.
    let mut file = Builder::new()
        .prefix(&prefix)
        .suffix(PARTIAL)
        .make_in(folder.unwrap_or(Path::new(".")), |aside| File::create_new(aside))?;
    let mut buffer = BufWriter::new(file.as_file_mut());
    fill(&mut buffer)?;
    buffer.flush()?;
    drop(buffer);
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_is_replaced_whole_or_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file.txt");
        write(&path, "old").unwrap();
        let failed = write_with(&path, |file| {
            file.write_all(b"half of the new")?;
            Err(io::ErrorKind::StorageFull.into())
        });
        assert_eq!(failed.unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        write(&path, "new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing stays beside it");
    }

    #[test]
    fn a_written_file_has_the_permissions_of_any_other() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        write(&one, "1").unwrap();
        fs::write(&other, "1").unwrap();
        let permissions = |path| fs::metadata(path).unwrap().permissions();
        assert_eq!(permissions(&one), permissions(&other));
    }

    #[test]
    fn what_is_no_place_for_a_file_is_refused_as_by_the_system() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write(folder.path(), "").is_err(), "a directory can't be replaced by a file");
        let nowhere = folder.path().join("none/file");
        let own = write(&nowhere, "").unwrap_err();
        assert_eq!(own.to_string(), fs::write(&nowhere, "").unwrap_err().to_string());
        assert_eq!(write(Path::new(".."), "").unwrap_err().kind(), io::ErrorKind::InvalidFilename);
    }
}
