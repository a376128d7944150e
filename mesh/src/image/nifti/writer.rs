//! Writes volumes as single NIfTI-1 files (.nii, .nii.gz).

use std::io::{self, BufWriter, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::{Rotation3, UnitQuaternion};

use crate::atomic_file;
use crate::image::ImageError;
use crate::image::volume::{Grid, IntensityVolume, LabelVolume};

/// Voxels start after the 348 bytes of the header and 4 of extension flags.
const VOXEL_OFFSET: usize = 352;

/// Writes a label map with its original labels, in the smallest integer type that holds them.
///
/// Both sform and qform hold the grid (RAS, mm, as f32: positions are good to 6·10⁻⁸ of their
/// size). Labels read back are equal. The file is compressed if its name ends in `.gz`, and
/// appears under its name only when it is complete.
///
/// # Errors
/// [`ImageError::Unwritable`] if the name ends neither in `.nii` nor in `.nii.gz`, or an axis has
/// over 32 767 voxels; [`ImageError::Io`].
/// # Source
/// nifti1.h, <https://nifti.nimh.nih.gov/nifti-1>.
pub fn write_labels(path: &Path, volume: &LabelVolume) -> Result<(), ImageError> {
    let values = volume.values();
    let low = values.iter().copied().min().unwrap_or(0);
    let high = values.iter().copied().max().unwrap_or(0);
    let within = |a: i64, b: i64| low >= a && high <= b;
    let (code, bytes) = if within(0, u8::MAX.into()) {
        (2, 1)
    } else if within(i16::MIN.into(), i16::MAX.into()) {
        (4, 2)
    } else if within(i32::MIN.into(), i32::MAX.into()) {
        (8, 4)
    } else {
        (1024, 8)
    };
    // Little-endian two's complement: the low bytes are the smaller type.
    let voxels = volume.labels().iter().map(|&id| values[usize::from(id)].to_le_bytes());
    write(path, volume.grid(), (code, bytes), voxels)
}

/// Writes a field, one f32 per voxel; placement, compression and errors as [`write_labels`].
///
/// # Errors
/// As [`write_labels`].
/// # Source
/// nifti1.h, <https://nifti.nimh.nih.gov/nifti-1>.
pub fn write_field(path: &Path, volume: &IntensityVolume) -> Result<(), ImageError> {
    let voxels = volume.values().iter().map(|value| value.to_le_bytes());
    write(path, volume.grid(), (16, 4), voxels)
}

fn write<const N: usize>(
    path: &Path,
    grid: &Grid,
    (code, bytes): (i16, usize),
    voxels: impl Iterator<Item = [u8; N]>,
) -> Result<(), ImageError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let gzip = name.ends_with(".nii.gz");
    let header = if gzip || name.ends_with(".nii") {
        header(grid, code, bytes)
    } else {
        let (field, want) = ("the name", "a name that ends in .nii or .nii.gz");
        Err(ImageError::Unwritable { field, value: name.into(), want })
    };
    let header = header.map_err(ImageError::in_file(path))?;
    let write_all = |out: &mut dyn Write| -> io::Result<()> {
        out.write_all(&header)?;
        for voxel in voxels {
            out.write_all(&voxel[..bytes])?;
        }
        Ok(())
    };
    let written = atomic_file::write_with(path, |file| {
        if !gzip {
            return write_all(file);
        }
        let mut encoder = BufWriter::new(GzEncoder::new(file, Compression::default()));
        write_all(&mut encoder)?;
        encoder.into_inner().map_err(io::IntoInnerError::into_error)?.finish().map(|_| ())
    });
    written.map_err(ImageError::in_file(path))
}

fn header(grid: &Grid, code: i16, bytes: usize) -> Result<[u8; VOXEL_OFFSET], ImageError> {
    let mut header = Header([0; VOXEL_OFFSET]);
    header.put(0, 348i32.to_le_bytes());
    header.i16(40, 3);
    for axis in 0..3 {
        let count = i16::try_from(grid.dims[axis]).map_err(|_| {
            let (field, want) = ("the number of voxels along an axis", "at most 32767");
            ImageError::Unwritable { field, value: grid.dims[axis].to_string(), want }
        })?;
        header.i16(42 + 2 * axis, count);
        header.f32(80 + 4 * axis, grid.spacing_mm);
    }
    for axis in 4..8 {
        header.i16(40 + 2 * axis, 1);
    }
    header.i16(70, code);
    header.i16(72, 8 * bytes as i16);
    header.f32(76, 1.0); // qfac: the grid is right-handed
    header.f32(108, VOXEL_OFFSET as f64);
    header.f32(112, 1.0); // slope
    header.0[123] = 2; // mm
    header.place(grid);
    header.put(344, *b"n+1\0");
    Ok(header.0)
}

struct Header([u8; VOXEL_OFFSET]);

impl Header {
    fn put<const N: usize>(&mut self, at: usize, bytes: [u8; N]) {
        self.0[at..at + N].copy_from_slice(&bytes);
    }

    fn i16(&mut self, at: usize, value: i16) {
        self.put(at, value.to_le_bytes());
    }

    fn f32(&mut self, at: usize, value: f64) {
        self.put(at, (value as f32).to_le_bytes());
    }

    /// sform and qform, both in scanner coordinates (code 1).
    fn place(&mut self, grid: &Grid) {
        let centre = grid.to_ras_mm(nalgebra::Vector3::repeat(0.5e-3 * grid.spacing_mm));
        self.i16(252, 1);
        self.i16(254, 1);
        let turn =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(grid.rotation));
        // The header leaves out the real part, which counts as positive.
        let sign = if turn.w < 0.0 { -1.0 } else { 1.0 };
        for (i, part) in [turn.i, turn.j, turn.k].into_iter().enumerate() {
            self.f32(256 + 4 * i, sign * part);
            self.f32(268 + 4 * i, centre[i]);
            for j in 0..3 {
                self.f32(280 + 16 * i + 4 * j, grid.rotation[(i, j)] * grid.spacing_mm);
            }
            self.f32(292 + 16 * i, centre[i]);
        }
    }
}
