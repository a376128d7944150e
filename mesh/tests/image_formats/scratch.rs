//! Files of a test, in a folder of their own.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use tempfile::TempDir;
use yawara_mesh::ImageError;
use yawara_mesh::image::read_labels;
use yawara_mesh::volume::LabelVolume;

/// Writes files, given by name and bytes, and reads the first one; errors must name a file.
pub fn read_files<T>(
    files: &[(&str, &[u8])],
    read: impl Fn(&Path) -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let result = read(&folder.path().join(files[0].0));
    if let Err(error) = &result {
        let text = error.to_string();
        let unnamed = matches!(error.problem(), ImageError::TooManyLabels { .. });
        let folder = folder.path().display().to_string();
        assert!(unnamed || text.contains(&folder), "names no file: {text}");
    }
    result
}

pub fn labels(name: &str, bytes: &[u8]) -> Result<LabelVolume, ImageError> {
    read_files(&[(name, bytes)], read_labels)
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[allow(dead_code)] // Not every suite has zlib data.
pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[allow(dead_code)] // Not every suite reads messages.
pub fn assert_says(error: &ImageError, words: &[&str]) {
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "\"{word}\" is missing in: {text}");
    }
}
