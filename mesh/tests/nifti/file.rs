//! Builds NIfTI files byte by byte and reads them back.

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

    /// The same file in version 2: every field as wide and where nifti2.h has it.
    pub fn second(&self) -> Vec<u8> {
        let mut header = [0u8; 540];
        let mut put = |at: usize, mut bytes: Vec<u8>| {
            if self.big {
                bytes.reverse();
            }
            header[at..at + bytes.len()].copy_from_slice(&bytes);
        };
        let low = |at: usize, count: usize| {
            let mut bytes = self.header[at..at + count].to_vec();
            if self.big {
                bytes.reverse();
            }
            bytes
        };
        let i16 = |at: usize| i16::from_le_bytes(low(at, 2).try_into().unwrap());
        let f64 = |at: usize| f64::from(f32::from_le_bytes(low(at, 4).try_into().unwrap()));
        put(0, 540i32.to_le_bytes().to_vec());
        (0..8).for_each(|i| put(16 + 8 * i, i64::from(i16(40 + 2 * i)).to_le_bytes().to_vec()));
        (0..8).for_each(|i| put(104 + 8 * i, f64(76 + 4 * i).to_le_bytes().to_vec()));
        put(12, low(70, 2));
        put(14, low(72, 2));
        put(168, (f64(108) as i64).saturating_add(192).to_le_bytes().to_vec());
        for (from, to) in [(112, 176), (116, 184)] {
            put(to, f64(from).to_le_bytes().to_vec());
        }
        for (from, to) in [(252, 344), (254, 348)] {
            put(to, i32::from(i16(from)).to_le_bytes().to_vec());
        }
        (0..18).for_each(|i| put(352 + 8 * i, f64(256 + 4 * i).to_le_bytes().to_vec()));
        put(500, i32::from(self.header[123]).to_le_bytes().to_vec());
        header[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
        let gap = vec![0xab; self.gap];
        [&header[..], &gap, &self.data].concat()
    }

    /// What is read; if the file is one of version 1, the same from version 2, where an offset is whole.
    pub fn labels(&self) -> Result<LabelVolume, ImageError> {
        let read = scratch(&self.bytes(), read_labels);
        let is_first = self.header[344..] == *b"n+1\0" && self.header[..4].contains(&0x5c);
        let offset: [u8; 4] = self.header[108..112].try_into().unwrap();
        let offset = if self.big { f32::from_be_bytes(offset) } else { f32::from_le_bytes(offset) };
        if is_first && offset.fract() == 0.0 {
            match (&read, scratch(&self.second(), read_labels)) {
                (Ok(one), Ok(two)) => assert_eq!(*one, two),
                (Err(_), Err(_)) => (),
                (one, two) => panic!("version 1: {one:?}, version 2: {two:?}"),
            }
        }
        read
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
