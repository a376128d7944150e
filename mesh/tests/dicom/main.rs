//! DICOM series written in all transfer syntaxes: what is read, where it lies, what is refused.
#![cfg(feature = "dicom")]

mod damaged;
mod encoders;
mod frames;
mod fuzz;
mod order;
mod refused;
mod syntaxes;
mod values;
mod writer;

use std::path::Path;

use yawara_mesh::ImageError;
use yawara_mesh::image::DicomError;
use yawara_mesh::image::{read_intensities_with, read_labels};

use writer::{File, Folder};

/// The values of a volume of cubes in the order of RAS+.
fn values(path: &Path) -> Vec<f32> {
    let (volume, report) = read_intensities_with(path, None).unwrap();
    assert_eq!((report.format, report.resampling), ("DICOM", None));
    volume.values().to_vec()
}

/// The error of a directory, which must name it.
fn error(folder: &Folder) -> ImageError {
    error_at(folder, folder.path())
}

fn error_at(folder: &Folder, path: &Path) -> ImageError {
    let error = mesh_error(folder, path);
    dicom(&error);
    error
}

/// What the DICOM reader refused.
fn dicom(error: &ImageError) -> &DicomError {
    match error.problem() {
        ImageError::Dicom(error) => error,
        other => panic!("not by the DICOM reader: {other}"),
    }
}

fn mesh_error(folder: &Folder, path: &Path) -> ImageError {
    let error = read_labels(path).unwrap_err();
    let text = error.to_string();
    assert!(text.contains(&folder.path().display().to_string()), "names no file: {text}");
    error
}

fn assert_says(error: &impl std::fmt::Display, words: &[&str]) {
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "\"{word}\" is missing in: {text}");
    }
}

/// Three slices of 2 × 2 voxels with the numbers column + 2 row + 4 slice.
fn small() -> [File; 3] {
    [0, 1, 2].map(|z| {
        let first = 4 * z as i16;
        File::slice(z, 2, 2, &[first, first + 1, first + 2, first + 3])
    })
}

/// The numbers of [`small`] in RAS+: columns run to the left, rows to the back.
const SMALL: [f32; 12] = [3., 2., 1., 0., 7., 6., 5., 4., 11., 10., 9., 8.];
