//! VTK image data: what VTK 9 writes, refused and damaged files.
#![cfg(feature = "vtu")]

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels, read_labels_with, read_vti};

/// Files of 2 × 3 × 4 voxels of 2 mm, numbered, turned about z, with other values beside them.
const FILES: [&str; 3] = ["text.vti", "zlib.vti", "cells_raw.vti"];

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vti/data").join(name)
}

#[test]
fn what_vtk_writes_is_read() {
    let turn = Matrix3::new(0.8, -0.6, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0);
    let corner = Vector3::new(-17.0, 31.0, 5.0);
    // In voxels from the origin: where the extent begins, and a cell's centre.
    let first = [[3.0, -2.0, 0.0], [0.0; 3], [0.5; 3]];
    for (name, first) in FILES.into_iter().zip(first) {
        let (volume, report) = read_labels_with(&data(name), None).unwrap();
        assert_eq!((report.format, report.resampling), ("VTK", None));
        let grid = volume.grid();
        assert_eq!((grid.dims, grid.spacing_mm), ([2, 3, 4], 2.0), "{name}");
        assert!((grid.rotation - turn).norm() < 1e-12, "{name}");
        let centre = grid.to_ras_mm(Vector3::repeat(0.001));
        let want = corner + turn * Vector3::from(first) * 2.0;
        assert!((centre - want).norm() < 1e-12, "{name}: {centre}");
        let found: Vec<i64> =
            volume.labels().iter().map(|&id| volume.values()[usize::from(id)]).collect();
        assert_eq!(found, (0..24).collect::<Vec<i64>>(), "{name}");
    }
}

#[test]
fn intensities_may_have_fractions() {
    let text = std::fs::read_to_string(data("text.vti")).unwrap();
    let (_folder, path) = file(text.replace("Scalars=\"labels\"", "Scalars=\"other\""));
    assert_eq!(read_intensities(&path).unwrap().values()[5], 7.5);
    let error = read_labels(&path).unwrap_err().to_string();
    assert!(error.contains("voxel (1, 0, 0) has the value 1.5"), "{error}");
}

fn file(bytes: impl AsRef<[u8]>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("organ.vti");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// From, to, and what the message says.
const WRONG: [(&str, &str, &str); 15] = [
    (
        "type=\"ImageData\"",
        "type=\"RectilinearGrid\"",
        "found type \"RectilinearGrid\", want ImageData",
    ),
    (
        "WholeExtent=\"3 4 ",
        "WholeExtent=\"4 3 ",
        "WholeExtent \"4 3 -2 0 0 3\", want the first and last",
    ),
    (
        "WholeExtent=\"3 4 ",
        "WholeExtent=\"4 ",
        "WholeExtent \"4 -2 0 0 3\", want the first and last",
    ),
    ("<Piece Extent=\"3 4 -2 0 0 3\"", "<Piece Extent=\"3 4 -2 0 0 1\"", "save it as one piece"),
    ("Origin=\"-17", "Origin=\"nan", "Origin \"nan 31 5\", want 3 finite numbers"),
    ("Spacing=\"2 2 2\"", "Spacing=\"2 2\"", "Spacing \"2 2\", want 3 finite numbers"),
    ("Spacing=\"2 2 2\"", "Spacing=\"2 2 0\"", "the Spacing and Direction is singular"),
    ("Direction=\"0.8 ", "Direction=\"0.8 x", "want 9 finite numbers, row by row"),
    ("Direction=\"0.8 -0.6", "Direction=\"0.8 0.6", "the Spacing and Direction is sheared"),
    ("Scalars=\"labels\"", "", "found 2 arrays for voxels: labels, other, want one"),
    (
        "Name=\"labels\"",
        "Name=\"labels\" NumberOfComponents=\"3\"",
        "array \"labels\": found 3 components",
    ),
    ("type=\"Int16\"", "type=\"String\"", "array \"labels\": its type is not supported"),
    ("18 19 20 21 22 23\n", "18 19 20 21 22\n", "found 23 numbers, want 24"),
    ("18 19 20 21 22 23\n", "18 19 20 21 22 23a\n", "found \"23a\", want numbers"),
    ("</VTKFile>", "", "want </VTKFile>"),
];

#[test]
fn what_is_wrong_is_named_with_its_place() {
    let text = std::fs::read_to_string(data("text.vti")).unwrap();
    for (from, to, want) in WRONG {
        assert!(text.contains(from), "{from}");
        let (_folder, path) = file(text.replacen(from, to, 1));
        let error = read_vti(&path).unwrap_err().to_string();
        assert!(error.starts_with(&path.display().to_string()), "names no file: {error}");
        assert!(error.contains(want), "{error}\nwant {want}");
    }
    let error = read_vti(&data("lz4.vti")).unwrap_err().to_string();
    assert!(error.contains("vtkLZ4DataCompressor is not supported; save it"), "{error}");
}

/// What the header claims takes no memory.
#[test]
fn announced_voxels_are_those_of_the_file() {
    let raw = std::fs::read(data("cells_raw.vti")).unwrap();
    let text = String::from_utf8_lossy(&raw).into_owned();
    let head = text.find("<AppendedData").unwrap();
    let many = text[..head].replace("0 2 0 3 0 4", "0 900 0 900 0 900");
    let (_folder, path) = file([many.as_bytes(), &raw[head..]].concat());
    let error = read_vti(&path).unwrap_err().to_string();
    assert!(error.contains("announces 729000000 numbers, but"), "{error}");
    let (_folder, path) = file(text.replace("0 2 0 3 0 4", "0 2000 0 2000 0 2000"));
    let error = read_vti(&path).unwrap_err();
    assert!(matches!(error.problem(), ImageError::TooManyVoxels { .. }), "{error}");
}

#[derive(Debug, Clone)]
struct Damage {
    file: &'static str,
    flips: Vec<(Index, u8)>,
    digits: Vec<(Index, u8)>,
    keep: f64,
}

fn damage() -> impl Strategy<Value = Damage> {
    let flips = prop::collection::vec((any::<Index>(), 0u8..8), 0..6);
    let digits = prop::collection::vec((any::<Index>(), b'0'..=b'9'), 0..6);
    let file = prop::sample::select(&FILES[..]);
    (file, flips, digits, prop_oneof![3 => Just(1.0), 1 => 0.0..1.0])
        .prop_map(|(file, flips, digits, keep)| Damage { file, flips, digits, keep })
}

/// An answer or an error that names the file, never a panic.
fn survives(damage: &Damage) -> Result<(), TestCaseError> {
    let mut bytes = std::fs::read(data(damage.file)).unwrap();
    for (index, bit) in &damage.flips {
        let at = index.index(bytes.len());
        bytes[at] ^= 1 << bit;
    }
    // Numbers of the head.
    for (index, digit) in &damage.digits {
        let at = index.index(400);
        if bytes[at].is_ascii_digit() {
            bytes[at] = *digit;
        }
    }
    bytes.truncate((bytes.len() as f64 * damage.keep) as usize);
    let (folder, path) = file(&bytes);
    match read_labels(&path) {
        Ok(volume) => {
            prop_assert_eq!(Some(volume.labels().len()), volume.grid().voxel_count());
        }
        Err(error) => {
            let folder = folder.path().display().to_string();
            let text = error.to_string();
            prop_assert!(text.contains(&folder) && text.len() < 1000, "{}", text);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn damaged_files_never_panic(damage in damage()) {
        survives(&damage)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100_000) })]

    #[test]
    #[ignore = "slow: 1e5 cases"]
    fn many_damaged_files_never_panic(damage in damage()) {
        survives(&damage)?;
    }
}
