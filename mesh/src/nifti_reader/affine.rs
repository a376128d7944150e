//! Where a file's voxels lie in the scanner, and how to turn them to RAS+.

use std::path::Path;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::header::Header;
use crate::MeshError;
use crate::volume::Grid;

/// Largest ratio between two spacings that still counts as isotropic.
const MAX_SPACING_RATIO: f64 = 1.01;

/// Largest cosine between two voxel axes that still counts as a right angle.
const MAX_COSINE: f64 = 1e-3;

/// Below this determinant the unit axes span no volume.
const MIN_DETERMINANT: f64 = 1e-6;

/// b² + c² + d² of a unit quaternion may exceed 1 by rounding only.
const MAX_QUATERNION: f64 = 1.0 + 1e-3;

/// The grid in RAS+ and how its axes follow from the file's.
pub(super) struct Placement {
    pub grid: Grid,
    /// RAS+ axis i runs along file axis `axes[i].0`, backwards if `axes[i].1`.
    axes: [(usize, bool); 3],
    file_dims: [usize; 3],
}

impl Placement {
    /// By the sform, else the qform, else the spacings alone.
    pub fn new(path: &Path, header: &Header) -> Result<Self, MeshError> {
        let Affine { form, columns, first_centre } = Affine::of(path, header)?;
        let spacings = columns.map(|c| c.norm());
        let directions = directions(path, form, columns)?;
        let largest = spacings.iter().copied().fold(f64::MIN, f64::max);
        let smallest = spacings.iter().copied().fold(f64::MAX, f64::min);
        if largest > MAX_SPACING_RATIO * smallest {
            let (spacing_mm, limit) = (spacings, MAX_SPACING_RATIO);
            return Err(MeshError::Anisotropic { path: path.into(), spacing_mm, limit });
        }
        let axes = closest_axes(&directions);
        let rotation =
            Matrix3::from_columns(&axes.map(|(axis, backwards)| {
                directions.column(axis) * if backwards { -1.0 } else { 1.0 }
            }));
        // The geometric mean keeps the volume.
        let spacing_mm = spacings.iter().product::<f64>().cbrt();
        let mut centre = first_centre;
        for (axis, backwards) in axes {
            if backwards {
                centre += columns[axis] * (header.dims[axis] - 1) as f64;
            }
        }
        let origin_mm = centre - rotation * Vector3::repeat(0.5 * spacing_mm);
        let dims = axes.map(|(axis, _)| header.dims[axis]);
        let grid = Grid { dims, spacing_mm, rotation, origin_mm };
        Ok(Self { grid, axes, file_dims: header.dims })
    }

    /// Brings voxels from the file's order (first axis fastest) to RAS+ order (x fastest).
    pub fn reorient<T: Copy>(&self, voxels: Vec<T>) -> Vec<T> {
        if self.axes == [(0, false), (1, false), (2, false)] {
            return voxels;
        }
        let strides = [1, self.file_dims[0], self.file_dims[0] * self.file_dims[1]];
        let along = |ras_axis: usize, i: usize| {
            let (axis, backwards) = self.axes[ras_axis];
            strides[axis] * if backwards { self.file_dims[axis] - 1 - i } else { i }
        };
        let [nx, ny, nz] = self.grid.dims;
        let mut turned = Vec::with_capacity(voxels.len());
        for z in 0..nz {
            for y in 0..ny {
                let row = along(1, y) + along(2, z);
                turned.extend((0..nx).map(|x| voxels[row + along(0, x)]));
            }
        }
        turned
    }
}

/// The file's own map from voxel indices to scanner RAS, mm.
struct Affine {
    /// Where it stands: `sform`, `qform` or `pixdim`.
    form: &'static str,
    /// Steps along the three voxel axes.
    columns: [Vector3<f64>; 3],
    /// Centre of voxel (0, 0, 0).
    first_centre: Vector3<f64>,
}

impl Affine {
    fn of(path: &Path, header: &Header) -> Result<Self, MeshError> {
        if let Some(rows) = header.sform_mm {
            let column = |j: usize| Vector3::new(rows[0][j], rows[1][j], rows[2][j]);
            let columns = [column(0), column(1), column(2)];
            return Ok(Self { form: "sform", columns, first_centre: column(3) });
        }
        let [sx, sy, sz] = header.spacing_mm;
        let Some([b, c, d]) = header.quaternion else {
            let columns = [Vector3::x() * sx, Vector3::y() * sy, Vector3::z() * sz];
            return Ok(Self { form: "pixdim", columns, first_centre: Vector3::zeros() });
        };
        let squared = b * b + c * c + d * d;
        if squared > MAX_QUATERNION {
            return Err(MeshError::Header {
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
        Ok(Self { form: "qform", columns, first_centre })
    }
}

/// The orthonormal matrix closest to the unit axes (polar decomposition), after checking that
/// they are nearly so.
fn directions(
    path: &Path,
    form: &'static str,
    columns: [Vector3<f64>; 3],
) -> Result<Matrix3<f64>, MeshError> {
    let singular = |determinant| MeshError::SingularAffine { path: path.into(), form, determinant };
    // A zero column has no direction; a huge or tiny one no norm in f64.
    if columns.iter().any(|c| !(c.norm() > 0.0 && c.norm().is_finite())) {
        return Err(singular(0.0));
    }
    let unit = columns.map(|c| c / c.norm());
    let matrix = Matrix3::from_columns(&unit);
    let determinant = matrix.determinant();
    if determinant.abs() < MIN_DETERMINANT {
        return Err(singular(determinant));
    }
    for axes in [[0, 1], [0, 2], [1, 2]] {
        let cosine = unit[axes[0]].dot(&unit[axes[1]]);
        if cosine.abs() > MAX_COSINE {
            let limit = MAX_COSINE;
            return Err(MeshError::ShearedAffine { path: path.into(), form, axes, cosine, limit });
        }
    }
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => Ok(u * v_t),
        _ => Err(singular(determinant)),
    }
}

/// Which voxel axis, and in which sense, is closest to right, to anterior and to superior.
///
/// Of the 48 signed permutations P the one with the largest trace(R P), so that R P is the
/// rotation closest to 1. Its trace is above 1, which no improper rotation reaches: the result
/// is right-handed even where the file is not.
fn closest_axes(directions: &Matrix3<f64>) -> [(usize, bool); 3] {
    const ORDERS: [[usize; 3]; 6] =
        [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let trace =
        |order: [usize; 3]| -> f64 { (0..3).map(|ras| directions[(ras, order[ras])].abs()).sum() };
    let mut best = ORDERS[0];
    for order in ORDERS {
        if trace(order) > trace(best) {
            best = order;
        }
    }
    std::array::from_fn(|ras| (best[ras], directions[(ras, best[ras])] < 0.0))
}
