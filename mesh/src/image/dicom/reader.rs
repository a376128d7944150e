//! Reads DICOM image series: a directory of slices, or multi-frame files.

use std::path::Path;

use rayon::prelude::*;

use super::error::DicomError;
use super::file::DicomFile;
use super::format::{Cells, Format};
use super::frames::{Frames, append};
use super::image::{Image, Plane};
use super::scan::{Series, series};
use super::stack::{Member, Slice, stack};
use crate::image::ImageError;
use crate::image::raw::RawVolume;
use crate::image::voxels::{VoxelType, Voxels, check_count};

/// Slices that are decoded at a time, by all threads; a file of several frames is read once per
/// batch.
const BATCH: usize = 64;

/// Reads the one image series of a directory, or that series of a file's directory to which the
/// file belongs.
///
/// A slice per file or several (Enhanced CT and MR), 8, 16 or 32 bits, signed or not, one
/// component. Slices are ordered by ImagePositionPatient along the normal of the rows and columns,
/// never by name or instance number; their spacing is that of the positions. Positions may be off
/// an even grid by 0.01 mm plus 1 % of the spacing. Values are slope · stored + intercept by the
/// slice's own RescaleSlope and RescaleIntercept; pixels of PixelPaddingValue stay what they are,
/// and those of MONOCHROME1 are not inverted. Transfer syntaxes: implicit and explicit VR, little
/// and big endian, deflated, RLE, JPEG of 8 bits, JPEG lossless, JPEG 2000. In a directory, files
/// that are no DICOM images are left out, with a warning that counts them; folders in it are not
/// entered.
///
/// Cost: O(bytes of the directory), the series' files read twice, decoded in parallel; in memory
/// the voxels, up to 64 slices with 4 bytes a pixel and their files.
///
/// # Errors
/// [`ImageError::Dicom`] that names file and element: see [`DicomError`]; besides
/// [`ImageError::Io`], [`ImageError::TooManyVoxels`] and the errors of [`RawVolume::new`].
/// # Source
/// DICOM PS3.3 (C.7.6.2, C.7.6.16), PS3.5, PS3.10, <https://www.dicomstandard.org/current>.
pub fn read_dicom(path: &Path) -> Result<RawVolume, ImageError> {
    let Series { uid, directory, images } = series(path)?;
    let members: Vec<Member> = images.iter().map(|(path, image)| Member { path, image }).collect();
    let (slices, affine) = stack(&members, &uid)?;
    let format = images[0].1.format;
    let dims = [format.columns.into(), format.rows.into(), slices.len()];
    check_count(path, dims.map(|d| d as u64))?;
    let (voxels, scale) = read_voxels(&members, &slices, &format)?;
    RawVolume::new(&directory, dims, &affine, scale, voxels)
}

/// The voxels slice by slice, and their common slope and intercept.
///
/// They keep their stored type where all slices have it and are scaled alike, else they are
/// scaled here.
fn read_voxels(
    members: &[Member],
    slices: &[Slice],
    format: &Format,
) -> Result<(Voxels, Option<[f64; 2]>), ImageError> {
    let scale = slices[0].plane.scale;
    let alike = slices.iter().all(|slice| slice.plane.scale == scale)
        && members.iter().all(|m| m.image.format.voxel_type() == format.voxel_type());
    let kind = if alike { format.voxel_type() } else { VoxelType::F64 };
    let mut voxels = Voxels::decode(kind, false, &[]);
    for batch in slices.chunks(BATCH) {
        let runs: Vec<&[Slice]> = batch.chunk_by(|a, b| a.member == b.member).collect();
        let decoded: Vec<_> =
            runs.par_iter().map(|run| decode(&members[run[0].member], run)).collect();
        for (run, cells) in runs.iter().zip(decoded) {
            // In the order of the slices, so that the first error is always the same.
            for (Slice { member, plane, .. }, cells) in run.iter().zip(cells?) {
                let start = voxels.count();
                append(&mut voxels, &members[*member].image.format, &cells);
                rescale(&mut voxels, start, plane);
            }
        }
    }
    Ok((voxels, (alike && scale != [1.0, 0.0]).then_some(scale)))
}

/// The pixels of slices that lie in one file.
fn decode(member: &Member, run: &[Slice]) -> Result<Vec<Cells>, ImageError> {
    let Member { path, image } = member;
    let file = DicomFile::require(path)?;
    let data = file.data_set()?;
    // Once more, for a file that changed meanwhile.
    let now = Image::of(&file, &data)?;
    if now.format != image.format || now.planes.len() != image.planes.len() {
        return Err(DicomError::Changed { path: path.to_path_buf() }.into());
    }
    let frames = Frames::of(&data, file.codec, image.planes.len())?;
    let decode = |slice: &Slice| frames.decode(&data, &image.format, slice.plane.frame);
    let cells: Vec<_> = run.par_iter().map(decode).collect();
    Ok(cells.into_iter().collect::<Result<_, _>>()?)
}

/// Scales the voxels from `start` on where they are to be scaled one slice at a time.
fn rescale(voxels: &mut Voxels, start: usize, plane: &Plane) {
    let [slope, intercept] = plane.scale;
    if let Voxels::F64(voxels) = voxels {
        for voxel in &mut voxels[start..] {
            *voxel = *voxel * slope + intercept;
        }
    }
}
