//! The map from voxel indices to the scanner that a NIfTI-1 header holds.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::header::Header;
use crate::image::ImageError;
use crate::image::placement::VoxelAffine;

/// b² + c² + d² of a unit quaternion may exceed 1 by rounding only.
const MAX_QUATERNION: f64 = 1.0 + 1e-3;

/// By the sform, else the qform, else the spacings alone.
pub(super) fn of(path: &Path, header: &Header) -> Result<VoxelAffine, ImageError> {
    if let Some(rows) = header.sform_mm {
        let column = |j: usize| Vector3::new(rows[0][j], rows[1][j], rows[2][j]);
        let columns = [column(0), column(1), column(2)];
        return Ok(VoxelAffine { form: "sform", columns, first_centre: column(3) });
    }
    let [sx, sy, sz] = header.spacing_mm;
    let Some([b, c, d]) = header.quaternion else {
        let columns = [Vector3::x() * sx, Vector3::y() * sy, Vector3::z() * sz];
        return Ok(VoxelAffine { form: "pixdim", columns, first_centre: Vector3::zeros() });
    };
    let squared = b * b + c * c + d * d;
    if squared > MAX_QUATERNION {
        return Err(ImageError::Header {
            path: path.into(),
            field: "quatern_b² + quatern_c² + quatern_d²",
            value: squared,
            want: "at most 1, as of a unit quaternion",
        });
    }
    let a = (1.0 - squared).max(0.0).sqrt();
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(a, b, c, d));
    let columns = [
        turn * Vector3::x() * sx,
        turn * Vector3::y() * sy,
        turn * Vector3::z() * (sz * header.qfac),
    ];
    let first_centre = Vector3::from(header.quaternion_offset_mm);
    Ok(VoxelAffine { form: "qform", columns, first_centre })
}
