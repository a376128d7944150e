//! Where a file's voxels lie in the scanner, and how to turn them to RAS+.

use nalgebra::{Matrix3, Vector3};

use crate::image::ImageError;

/// The map from voxel indices to scanner RAS: position of voxel (i, j, k)'s centre =
/// first_centre + i·columns\[0\] + j·columns\[1\] + k·columns\[2\], mm.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelAffine {
    /// Where it stands, for messages: `sform`, `space directions`, `TransformMatrix`.
    pub form: &'static str,
    /// Steps along the three voxel axes, mm, at right angles to one another.
    pub columns: [Vector3<f64>; 3],
    /// Centre of voxel (0, 0, 0), mm.
    pub first_centre: Vector3<f64>,
}

/// Largest cosine between two voxel axes that still counts as a right angle.
const MAX_COSINE: f64 = 1e-3;

/// Below this determinant the unit axes span no volume.
const MIN_DETERMINANT: f64 = 1e-6;

/// The box of stored voxels in RAS+ and how its axes follow from the file's.
#[derive(Debug, Clone)]
pub(crate) struct Placement {
    /// Voxels along right, anterior, superior.
    pub dims: [usize; 3],
    /// Their spacings, mm.
    pub spacing_mm: [f64; 3],
    /// Columns: directions of the three axes.
    pub rotation: Matrix3<f64>,
    /// Centre of the first voxel in RAS+ order, mm.
    pub first_centre: Vector3<f64>,
    /// Voxels along the file's axes.
    pub file_dims: [usize; 3],
    /// RAS+ axis i runs along file axis `axes[i].0`, backwards if `axes[i].1`.
    pub axes: [(usize, bool); 3],
}

impl Placement {
    /// The signed permutation of the axes that comes closest to RAS+.
    pub fn new(dims: [usize; 3], affine: &VoxelAffine) -> Result<Self, ImageError> {
        let VoxelAffine { form, columns, mut first_centre } = affine.clone();
        let directions = directions(form, columns)?;
        let axes = closest_axes(&directions);
        let rotation =
            Matrix3::from_columns(&axes.map(|(axis, backwards)| {
                directions.column(axis) * if backwards { -1.0 } else { 1.0 }
            }));
        for (axis, backwards) in axes {
            if backwards {
                first_centre += columns[axis] * (dims[axis] - 1) as f64;
            }
        }
        Ok(Self {
            dims: axes.map(|(axis, _)| dims[axis]),
            spacing_mm: axes.map(|(axis, _)| columns[axis].norm()),
            rotation,
            first_centre,
            file_dims: dims,
            axes,
        })
    }

    /// Position in the file's list of voxel i along a RAS+ axis, the others being 0 in RAS+:
    /// the sum of three is the position of a voxel.
    pub fn file_offset(&self, ras_axis: usize, i: usize) -> usize {
        let strides = [1, self.file_dims[0], self.file_dims[0] * self.file_dims[1]];
        let (axis, backwards) = self.axes[ras_axis];
        strides[axis] * if backwards { self.file_dims[axis] - 1 - i } else { i }
    }

    /// Whether the file's list is in RAS+ order already.
    pub fn in_file_order(&self) -> bool {
        self.axes == [(0, false), (1, false), (2, false)]
    }
}

/// The orthonormal matrix closest to the unit axes (polar decomposition), after checking that
/// they are nearly so.
fn directions(form: &'static str, columns: [Vector3<f64>; 3]) -> Result<Matrix3<f64>, ImageError> {
    let singular = |determinant| ImageError::SingularAffine { form, determinant };
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
            return Err(ImageError::ShearedAffine { form, axes, cosine, limit: MAX_COSINE });
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
