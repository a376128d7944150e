//! A checkpoint in a file: what a run goes on from, what it was made from, and what was written by then.
//!
//! A line with the version of this layout, a line with the SHA-256 of the rest, and then [`Origin`],
//! [`Written`] and [`Checkpoint`] one after the other as CBOR, which has every float to its last bit.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::resume_error::ResumeError;
use super::write_file;
use crate::error::SimError;
use crate::scene::{Scene, input_files, sha256, sha256_of};
use crate::step::Checkpoint;

/// Its name in a run's directory.
pub(super) const FILE: &str = "checkpoint";

/// What the first line begins with, and the version of the layout that follows it.
const NAME: &str = "yawara checkpoint ";
const LAYOUT: &str = "2";

/// Hexadecimal digits of a SHA-256.
const DIGITS: usize = 64;

/// What a run is made from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Origin {
    /// The program's version.
    pub version: String,
    /// The class of the processor's vector unit, on which last digits depend.
    pub vector_unit: String,
    /// Hash of `scene.toml`.
    pub scene: String,
    /// Files that the scene names, and their hashes.
    inputs: Vec<(PathBuf, String)>,
    /// The working directory, from which relative ones of them start.
    from: PathBuf,
}

/// What there is of a run's output.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Written {
    /// The name of the run's directory, and whether the partial one is in it or beside it.
    pub name: OsString,
    pub is_inside: bool,
    /// The length of the table of steps.
    pub steps_bytes: u64,
    /// Times, s, and files of the frames; files that no collection lists.
    pub frames: Vec<(f64, Vec<String>)>,
    pub outlines: Vec<(f64, Vec<String>)>,
    pub others: Vec<String>,
}

impl Origin {
    /// That of a run of `scene`, which `text` is the file of, by this program.
    ///
    /// Cost: reads all files that the scene names.
    /// # Errors
    /// [`SimError::Io`].
    pub fn of(scene: &Scene, text: &str) -> Result<Self, SimError> {
        let hashed = |path: PathBuf| match sha256(&path) {
            Ok(hash) => Ok((path, hash)),
            Err(source) => Err(SimError::Io(path, source)),
        };
        Ok(Self {
            version: env!("CARGO_PKG_VERSION").into(),
            vector_unit: vector_unit().into(),
            scene: sha256_of(text.as_bytes()),
            inputs: input_files(scene).into_iter().map(hashed).collect::<Result<_, _>>()?,
            from: std::env::current_dir().unwrap_or_default(),
        })
    }

    /// Refuses what a run can't go on with: another scene at `scene`, or another file that it names.
    pub fn check(&self, scene: &Path) -> Result<(), ResumeError> {
        if sha256(scene).ok().as_ref() != Some(&self.scene) {
            return Err(ResumeError::SceneChanged(scene.into()));
        }
        for (path, hash) in &self.inputs {
            match sha256(path) {
                Ok(now) if now == *hash => {}
                Ok(_) => return Err(ResumeError::InputChanged(path.clone())),
                Err(why) => {
                    return Err(ResumeError::InputGone(path.clone(), why, self.from.clone()));
                }
            }
        }
        Ok(())
    }

    /// Whether this machine makes the same last digits.
    pub fn is_of_this_machine(&self) -> bool {
        self.vector_unit == vector_unit()
    }
}

/// The class of the vector unit for which kernels are chosen when the program starts.
fn vector_unit() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            return "x86-v4";
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return "x86-v3";
        }
    }
    std::env::consts::ARCH
}

/// Writes a checkpoint into `folder`, in the place of the one before once it is whole.
/// # Errors
/// [`SimError::Io`]; the one before is there then.
pub(super) fn write(
    folder: &Path,
    origin: &Origin,
    written: &Written,
    checkpoint: &Checkpoint,
) -> Result<(), SimError> {
    let path = folder.join(FILE);
    let mut rest = Vec::new();
    ciborium::into_writer(origin, &mut rest)
        .and_then(|()| ciborium::into_writer(written, &mut rest))
        .and_then(|()| ciborium::into_writer(checkpoint, &mut rest))
        .map_err(|error| SimError::Io(path.clone(), io::Error::other(error.to_string())))?;
    let mut bytes = format!("{NAME}{LAYOUT}\n{}\n", sha256_of(&rest)).into_bytes();
    bytes.append(&mut rest);
    write_file(&path, bytes)
}

/// Reads the checkpoint in `folder`.
/// # Errors
/// [`ResumeError::NoCheckpoint`], [`ResumeError::Damaged`], [`ResumeError::OtherVersion`]; [`SimError::Io`].
pub(super) fn read(folder: &Path) -> Result<(Origin, Written, Checkpoint), SimError> {
    let path = folder.join(FILE);
    let bytes = match fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(ResumeError::NoCheckpoint(folder.into()).into());
        }
        Err(source) => return Err(SimError::Io(path, source)),
    };
    let damaged = |what| ResumeError::Damaged(path.clone(), what);
    let cut = || damaged("it does not begin as a checkpoint");
    let rest = bytes.strip_prefix(NAME.as_bytes()).ok_or_else(cut)?;
    let (layout, rest) = line(rest).ok_or_else(cut)?;
    if layout != LAYOUT {
        let by = format!("with the layout {layout} of checkpoints");
        return Err(ResumeError::OtherVersion(path, by, format!("layout {LAYOUT}")).into());
    }
    let (hash, mut rest) = line(rest).filter(|(hash, _)| hash.len() == DIGITS).ok_or_else(cut)?;
    if sha256_of(rest) != hash {
        return Err(damaged("it has not the checksum that it was written with").into());
    }
    let (this, rest) = (env!("CARGO_PKG_VERSION"), &mut rest);
    let origin: Option<Origin> = ciborium::from_reader(&mut *rest).ok();
    let other = |version: String| ResumeError::OtherVersion(path.clone(), version, this.into());
    let origin = origin.ok_or_else(|| other("of another build".into()))?;
    if origin.version != this {
        return Err(other(origin.version).into());
    }
    let written = ciborium::from_reader(&mut *rest).ok();
    let checkpoint = ciborium::from_reader(&mut *rest).ok();
    match written.zip(checkpoint) {
        Some((written, checkpoint)) if rest.is_empty() => Ok((origin, written, checkpoint)),
        _ => Err(other(format!("{this} of another build")).into()),
    }
}

/// The first line as text, and what follows it.
fn line(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let end = bytes.iter().position(|&byte| byte == b'\n')?;
    Some((std::str::from_utf8(&bytes[..end]).ok()?, &bytes[end + 1..]))
}
