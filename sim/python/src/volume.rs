//! Label volumes from arrays of NumPy.

use std::path::Path;

use nalgebra::Vector3;
use numpy::{AllowTypeChange, PyArrayLike3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use yawara_mesh::image::{RawVolume, VoxelAffine, Voxels};
use yawara_mesh::volume::LabelVolume;

use crate::arrays::to_matrix;
use crate::error::refused;

/// Labels, as [x, y, z], with the 4 × 4 `affine` from voxel indices to scanner RAS, mm, as of an image of nibabel: cubes of
/// them in RAS order.
pub fn label_volume(labels: &Bound<'_, PyAny>, affine: &Bound<'_, PyAny>) -> PyResult<LabelVolume> {
    let labels: PyArrayLike3<'_, i64, AllowTypeChange> = labels.extract()?;
    let dims = [0, 1, 2].map(|axis| labels.shape()[axis]);
    let (entries, shape) = to_matrix(affine)?;
    if shape != [4, 4] {
        return Err(refused(format!("affine is {} x {}, want 4 x 4", shape[0], shape[1])));
    }
    let column = |j: usize| Vector3::new(entries[j], entries[4 + j], entries[8 + j]);
    let affine =
        VoxelAffine { form: "affine", columns: [0, 1, 2].map(column), first_centre: column(3) };
    // First axis fastest.
    let voxels = Voxels::I64(labels.as_array().t().iter().copied().collect());
    let raw = RawVolume::new(Path::new("labels"), dims, &affine, None, voxels).map_err(refused)?;
    Ok(raw.labels(None).map_err(refused)?.0)
}
