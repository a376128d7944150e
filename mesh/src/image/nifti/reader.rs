//! Reads NIfTI images: the header is checked field by field before the voxels are read.

use std::path::Path;

use super::header::{Header, LEAST_BYTES, Start};
use crate::image::ImageError;
use crate::image::bytes::{ByteStream, GZIP_MAGIC};
use crate::image::raw::RawVolume;
use crate::image::voxels::Voxels;

/// Reads a single-file NIfTI-1 or NIfTI-2 image.
///
/// Compression is recognised by the gzip magic, not by the name. The sform places the voxels,
/// else the qform, else the spacings alone. An unknown unit counts as millimetre. The scale
/// (`scl_slope`, `scl_inter`) is applied unless the slope is 0 or not finite.
///
/// Cost: O(voxels); at most two copies of the stored bytes.
///
/// # Errors
/// [`ImageError`] that names the file and the field: no readable file, no NIfTI image, a
/// header that contradicts the file's length (bytes after the voxels too), a damaged gzip stream, more than one volume, more than 2³¹ voxels, a
/// complex or colour datatype, spacings ≤ 0 or not finite, a singular or sheared affine.
/// # Source
/// nifti1.h, <https://nifti.nimh.nih.gov/nifti-1>; nifti2.h, <https://nifti.nimh.nih.gov/nifti-2>.
pub fn read_nifti(path: &Path) -> Result<RawVolume, ImageError> {
    read(path).map_err(ImageError::in_file(path))
}

fn read(path: &Path) -> Result<RawVolume, ImageError> {
    let mut stream = ByteStream::open(path)?;
    if stream.starts_with(&GZIP_MAGIC)? {
        stream = stream.inflate_gzip();
    }
    let mut bytes = stream.take(LEAST_BYTES as u64)?;
    let start = Start::of(&bytes)?;
    let length = start.header_bytes();
    bytes.extend(stream.take((length - LEAST_BYTES) as u64)?);
    if bytes.len() < length {
        return Err(stream.length_error("header", bytes.len() as u64, length as u64));
    }
    let header = Header::parse(&bytes, start)?;
    let gap = header.vox_offset - length as u64;
    stream.check_length(gap, header.voxel_bytes)?;
    stream.skip(gap, "extensions before vox_offset")?;
    let bytes = stream.voxel_bytes(header.voxel_bytes)?;
    let voxels = Voxels::decode(header.datatype, header.big_endian, &bytes);
    RawVolume::new(path, header.dims, &header.affine, header.scale, voxels)
}
