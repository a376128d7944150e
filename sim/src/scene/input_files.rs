//! The files that a scene reads, and what is in them.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::description::Scene;
use super::tool::ToolEntry;

/// Image, mesh and paths of tools, as the scene names them.
pub(crate) fn input_files(scene: &Scene) -> Vec<PathBuf> {
    let paths = scene.tools.iter().filter_map(|tool| match tool {
        ToolEntry::Grab(grab) => grab.path_csv.as_ref(),
        ToolEntry::Probe(probe) => probe.path_csv.as_ref(),
        ToolEntry::Resect(one) | ToolEntry::Coagulate(one) | ToolEntry::Suture(one) => {
            one.path_csv.as_ref()
        }
        ToolEntry::Scalpel(one) => one.path_csv.as_ref(),
        ToolEntry::Pressure(_) | ToolEntry::Load(_) => None,
    });
    scene.image.path.iter().chain(&scene.mesh.path).chain(paths).cloned().collect()
}

/// The SHA-256 of a file as hexadecimal digits; of a folder that of its files' hashes, by name.
pub(crate) fn sha256(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    if path.is_dir() {
        let entries: io::Result<Vec<_>> = fs::read_dir(path)?.collect();
        let mut files: Vec<PathBuf> = entries?.iter().map(fs::DirEntry::path).collect();
        files.retain(|file| file.is_file());
        files.sort();
        for file in files {
            hash.update(sha256(&file)?);
        }
        return Ok(digits(hash));
    }
    let mut file = File::open(path)?;
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(digits(hash)),
            read => hash.update(&buffer[..read]),
        }
    }
}

/// The SHA-256 of bytes as hexadecimal digits.
pub(crate) fn sha256_of(bytes: &[u8]) -> String {
    digits(Sha256::new_with_prefix(bytes))
}

fn digits(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_the_hash_of_what_is_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("slice");
        let mut hashes = Vec::new();
        for bytes in ["abc", "abd", "abc"] {
            fs::write(&file, bytes).unwrap();
            hashes.push([sha256(folder.path()).unwrap(), sha256(&file).unwrap()]);
        }
        assert_eq!(hashes[0], hashes[2]);
        assert!(hashes[0][0] != hashes[1][0] && hashes[0][0] != hashes[0][1]);
        // As of any other program.
        assert!(hashes[0][1].starts_with("ba7816bf8f01cfea"), "{}", hashes[0][1]);
        assert_eq!(hashes[0][1], sha256_of(b"abc"));
    }
}
