//! Damaged files of every format and encoding: an error or a valid volume, never a panic.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use tempfile::TempDir;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};

use super::Stored;
use super::scratch::{gzip, read_files, zlib};

/// What headers are written with: a change to one of these reaches deeper than a random bit.
const HEADER_BYTES: &[u8] = b"0123456789-.e ,()\"=:\nnaif%/";

#[derive(Debug, Clone)]
struct Damage {
    flips: Vec<(Index, u8)>,
    words: Vec<(Index, Index)>,
    keep: f64,
    repeat: Option<(Index, u8)>,
}

impl Damage {
    fn to(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        for (index, bit) in &self.flips {
            let at = index.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        // The text of the headers stands in the first 300 bytes.
        for (index, word) in &self.words {
            let at = index.index(bytes.len().min(300));
            bytes[at] = HEADER_BYTES[word.index(HEADER_BYTES.len())];
        }
        // Digits written many times make large numbers.
        if let Some((index, times)) = &self.repeat {
            let at = index.index(bytes.len().min(300));
            let byte = bytes[at];
            bytes.splice(at..at, std::iter::repeat_n(byte, usize::from(*times)));
        }
        bytes.truncate((bytes.len() as f64 * self.keep) as usize);
        bytes
    }
}

fn damage() -> impl Strategy<Value = Damage> {
    let flips = prop::collection::vec((any::<Index>(), 0u8..8), 0..6);
    let words = prop::collection::vec((any::<Index>(), any::<Index>()), 0..4);
    let keep = prop_oneof![3 => Just(1.0), 1 => 0.0..1.0];
    let repeat = prop::option::of((any::<Index>(), 1u8..24));
    (flips, words, keep, repeat).prop_map(|(flips, words, keep, repeat)| Damage {
        flips,
        words,
        keep,
        repeat,
    })
}

fn stored() -> Stored {
    let spacing = Vector3::new(1.0, 2.0, 2.0);
    Stored::new([1, 2, 0], [true, false, true], &Matrix3::identity(), spacing, Vector3::zeros())
}

/// The header with `old` replaced, and other data.
fn with_data(image: &[u8], data: &[u8], old: &str, new: &str) -> Vec<u8> {
    let header = String::from_utf8(image[..image.len() - 48].to_vec()).unwrap();
    assert!(header.contains(old));
    [header.replace(old, new).as_bytes(), data].concat()
}

fn nifti_files() -> Vec<Vec<u8>> {
    vec![stored().nifti(), gzip(&stored().nifti())]
}

fn nrrd_files() -> Vec<Vec<u8>> {
    let raw = stored().nrrd("LPS", [-1.0, -1.0, 1.0]);
    let zipped = with_data(&raw, &gzip(&stored().data()), "encoding: raw", "encoding: gzip");
    let text = text();
    let text = with_data(&raw, text.as_bytes(), "encoding: raw", "encoding: text");
    vec![raw, zipped, text]
}

fn metaimage_files() -> Vec<Vec<u8>> {
    let raw = stored().metaimage();
    let flag = "CompressedData = True\nElementDataFile";
    let zipped = with_data(&raw, &zlib(&stored().data()), "ElementDataFile", flag);
    let text = with_data(&raw, text().as_bytes(), "BinaryData = True", "BinaryData = False");
    vec![raw, zipped, text]
}

fn text() -> String {
    stored().voxels.iter().map(|voxel| format!("{voxel} ")).collect()
}

fn survives(path: &Path, bytes: &[u8]) -> Result<(), TestCaseError> {
    std::fs::write(path, bytes).unwrap();
    match read_labels(path) {
        Ok(volume) => {
            prop_assert_eq!(Some(volume.labels().len()), volume.grid().voxel_count());
            // Deflate packs 1032 bytes in one at most; a voxel is made 256 at most.
            prop_assert!(volume.labels().len() <= 256 * 1032 * bytes.len());
        }
        Err(ImageError::TooManyLabels { .. }) => {}
        Err(error) => {
            let folder = path.parent().unwrap().display().to_string();
            prop_assert!(error.to_string().contains(&folder), "names no file: {}", error);
        }
    }
    if let Ok(image) = read_intensities(path) {
        prop_assert!(image.values().iter().all(|v| v.is_finite()));
    }
    Ok(())
}

macro_rules! fuzz {
    ($($reader:ident: $files:ident, $name:literal;)*) => {$(
        mod $reader {
            use super::*;

            fn run(cases: u32) {
                let files = $files();
                // Undamaged files are read: the damage starts from something that works.
                for file in &files {
                    assert!(read_files(&[($name, file)], read_labels).is_ok());
                }
                let folder = TempDir::new().unwrap();
                let path = folder.path().join($name);
                let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) };
                proptest!(config, |(file in any::<Index>(), damage in damage())| {
                    survives(&path, &damage.to(files[file.index(files.len())].clone()))?;
                });
            }

            #[test]
            fn damaged_files_never_panic() {
                run(1_000);
            }

            #[test]
            #[ignore = "slow: 1e5 cases"]
            fn many_damaged_files_never_panic() {
                run(100_000);
            }
        }
    )*};
}
fuzz! {
    nifti: nifti_files, "organ.nii";
    nrrd: nrrd_files, "organ.nrrd";
    metaimage: metaimage_files, "organ.mha";
}
