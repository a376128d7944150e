//! Reads DICOM image series.

use std::path::Path;

use rayon::prelude::*;

use super::error::DicomError;
use super::file::DicomFile;
use super::format::Cells;
use super::frames::{Frames, append};
use super::image::Image;
use super::scan::{Series, series};
use super::stack::{Slice, stack};
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
    let (slices, affine) = stack(&images, &uid)?;
    let format = images[0].format;
    let dims = [format.columns.into(), format.rows.into(), slices.len()];
    check_count(dims.map(|d| d as u64)).map_err(ImageError::in_file(path))?;
    let scale = slices[0].plane.scale;
    let alike = slices.iter().all(|slice| slice.plane.scale == scale)
        && images.iter().all(|image| image.format.voxel_type() == format.voxel_type());
    let voxels = read_voxels(&slices, alike.then(|| format.voxel_type()))?;
    let scale = (alike && scale != [1.0, 0.0]).then_some(scale);
    RawVolume::new(&directory, dims, &affine, scale, voxels)
}

/// The voxels slice by slice: of their common type, or scaled here where they have none or are
/// not scaled alike.
fn read_voxels(slices: &[Slice], common: Option<VoxelType>) -> Result<Voxels, ImageError> {
    let mut voxels = Voxels::decode(common.unwrap_or(VoxelType::F64), false, &[]);
    for batch in slices.chunks(BATCH) {
        let runs: Vec<&[Slice]> = batch.chunk_by(|a, b| std::ptr::eq(a.image, b.image)).collect();
        let decoded: Vec<_> = runs.par_iter().map(|run| decode(run[0].image, run)).collect();
        for (run, cells) in runs.iter().zip(decoded) {
            // In the order of the slices, so that the first error is always the same.
            for (Slice { image, plane, .. }, cells) in run.iter().zip(cells?) {
                let start = voxels.count();
                append(&mut voxels, &image.format, &cells);
                let [slope, intercept] = plane.scale;
                if let Voxels::F64(voxels) = &mut voxels {
                    voxels[start..].iter_mut().for_each(|v| *v = *v * slope + intercept);
                }
            }
        }
    }
    Ok(voxels)
}

/// The pixels of slices that lie in one file.
fn decode(image: &Image, run: &[Slice]) -> Result<Vec<Cells>, ImageError> {
    let file = DicomFile::open(&image.path)?;
    let data = file.data_set()?;
    // Once more, for a file that changed meanwhile.
    let now = Image::of(&file, &data)?;
    let decode = || {
        if now.format != image.format || now.planes.len() != image.planes.len() {
            return Err(DicomError::Changed);
        }
        let frames = Frames::of(&data, file.codec, image.planes.len())?;
        let decode = |slice: &Slice| frames.decode(&image.format, slice.plane.frame);
        let cells: Vec<_> = run.par_iter().map(decode).collect();
        cells.into_iter().collect()
    };
    decode().map_err(ImageError::in_file(&image.path))
}
