//! Builds NIfTI-1 files byte by byte and reads them back.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::{Matrix3, Vector3};
use tempfile::TempDir;
use yawara_mesh::ImageError;
use yawara_mesh::image::read_labels;
use yawara_mesh::volume::LabelVolume;

/// A NIfTI-1 file under construction: int16 voxels and a plain 2 mm sform unless changed.
#[derive(Clone)]
pub struct File {
    pub big: bool,
    pub header: [u8; 348],
    pub gap: usize,
    pub data: Vec<u8>,
}

impl File {
    pub fn new(dims: [i16; 3], voxels: &[i16]) -> Self {
        Self::ordered(dims, voxels, false)
    }

    pub fn ordered(dims: [i16; 3], voxels: &[i16], big: bool) -> Self {
        let mut file = Self { big, header: [0; 348], gap: 4, data: Vec::new() };
        file.data = voxels
            .iter()
            .flat_map(|&v| if big { v.to_be_bytes() } else { v.to_le_bytes() })
            .collect();
        let size = 348i32;
        file.put(0, if big { size.to_be_bytes() } else { size.to_le_bytes() });
        let [nx, ny, nz] = dims;
        for (i, d) in [3, nx, ny, nz, 1, 1, 1, 1].into_iter().enumerate() {
            file.i16(40 + 2 * i, d);
        }
        file.typed(4, 16).f32(76, 1.0).f32(80, 2.0).f32(84, 2.0).f32(88, 2.0).f32(108, 352.0);
        file.header[123] = 2;
        file.put(344, *b"n+1\0");
        file.sform(&(Matrix3::identity() * 2.0), Vector3::zeros());
        file
    }

    /// 2 × 2 × 1 voxels 0, 1, 2, 1.
    pub fn small() -> Self {
        Self::new([2, 2, 1], &[0, 1, 2, 1])
    }

    pub fn put<const N: usize>(&mut self, at: usize, bytes: [u8; N]) -> &mut Self {
        self.header[at..at + N].copy_from_slice(&bytes);
        self
    }

    pub fn i16(&mut self, at: usize, value: i16) -> &mut Self {
        self.put(at, if self.big { value.to_be_bytes() } else { value.to_le_bytes() })
    }

    pub fn f32(&mut self, at: usize, value: f32) -> &mut Self {
        self.put(at, if self.big { value.to_be_bytes() } else { value.to_le_bytes() })
    }

    pub fn typed(&mut self, datatype: i16, bitpix: i16) -> &mut Self {
        self.i16(70, datatype).i16(72, bitpix)
    }

    pub fn sform(&mut self, matrix: &Matrix3<f64>, offset: Vector3<f64>) -> &mut Self {
        self.i16(254, 1);
        for i in 0..3 {
            for j in 0..3 {
                self.f32(280 + 16 * i + 4 * j, matrix[(i, j)] as f32);
            }
            self.f32(292 + 16 * i, offset[i] as f32);
        }
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        let gap = vec![0xab; self.gap];
        [&self.header[..], &gap, &self.data].concat()
    }

    pub fn labels(&self) -> Result<LabelVolume, ImageError> {
        scratch(&self.bytes(), read_labels)
    }

    pub fn error(&self) -> ImageError {
        self.labels().unwrap_err()
    }
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Writes the bytes to a scratch file and reads that; an error must name the file.
pub fn scratch<T>(
    bytes: &[u8],
    read: impl Fn(&Path) -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("organ.nii");
    std::fs::write(&path, bytes).unwrap();
    let result = read(&path);
    if let Err(error) = &result {
        let text = error.to_string();
        let unnamed = matches!(error.problem(), ImageError::TooManyLabels { .. });
        assert!(unnamed || text.contains("organ.nii"), "names no file: {text}");
    }
    result
}

pub fn assert_says(error: &ImageError, words: &[&str]) {
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "\"{word}\" is missing in: {text}");
    }
}
