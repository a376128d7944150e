//! An image as its file holds it: any axes, any spacings, any type; and how labels and
//! intensities in RAS+ orientation and cubic voxels are made of it.

mod placement;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use crate::MeshError;
use crate::resample::{Interpolation, Resampling, Sampling};
use crate::volume::{Grid, IntensityVolume, LabelVolume};
use crate::voxels::{Sample, each_voxel_type};

pub(crate) use placement::Placement;

pub use crate::voxels::{VoxelType, Voxels};

/// Voxels that are accepted at most, stored or resampled.
pub(crate) const MAX_VOXELS: u64 = 1 << 31;

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

/// A stored image that has been checked: as many voxels as the grid has, right-angled axes.
///
/// What every reader makes of its file; make one of your own data to bring it to a grid of
/// cubes.
#[derive(Debug, Clone)]
pub struct RawVolume {
    source: PathBuf,
    placement: Placement,
    scale: Option<[f64; 2]>,
    voxels: Voxels,
}

impl RawVolume {
    /// A volume from its voxels, first axis fastest.
    ///
    /// `source` names the image in messages. `scale` is slope and intercept: a voxel's value is
    /// slope · stored + intercept, or the stored number where it is `None`.
    ///
    /// # Errors
    /// [`MeshError::Grid`] for an axis without voxels, [`MeshError::TooManyVoxels`] above 2³¹,
    /// [`MeshError::VoxelCount`], [`MeshError::SingularAffine`], [`MeshError::ShearedAffine`]
    /// if two axes are more than 0.06° from a right angle.
    pub fn new(
        source: &Path,
        dims: [usize; 3],
        affine: &VoxelAffine,
        scale: Option<[f64; 2]>,
        voxels: Voxels,
    ) -> Result<Self, MeshError> {
        if dims.contains(&0) {
            return Err(MeshError::Grid { field: "dims", value: 0.0, want: "at least 1 voxel" });
        }
        check_count(source, dims.map(|d| d as u64))?;
        let placement = Placement::new(source, dims, affine)?;
        if voxels.count() != dims.iter().product() {
            return Err(MeshError::VoxelCount { found: voxels.count(), dims });
        }
        Ok(Self { source: source.into(), placement, scale, voxels })
    }

    /// The voxels as labels, in RAS+ orientation and cubes.
    ///
    /// Spacings that differ by less than 1 % count as one, their geometric mean; others are
    /// resampled to the smallest of the three, or to `spacing_mm`, by nearest neighbour, and the
    /// [`Resampling`] says so. Cost: O(stored + resampled voxels).
    ///
    /// # Errors
    /// [`MeshError::LabelValue`] for a voxel that is no integer, [`MeshError::TooManyLabels`],
    /// [`MeshError::ResampledVoxels`], [`MeshError::LengthValue`] for a `spacing_mm` that is
    /// not finite and positive.
    pub fn labels(
        self,
        spacing_mm: Option<f64>,
    ) -> Result<(LabelVolume, Option<Resampling>), MeshError> {
        let sampling = self.sampling(spacing_mm)?;
        let grid = sampling.grid.clone();
        let volume = each_voxel_type!(&self.voxels, stored => {
            let label = self.checked_label();
            for (index, &value) in stored.iter().enumerate() {
                label(index, value.into())?;
            }
            let scale = self.scale;
            let labels = sampling
                .nearest_offsets()
                .map(|at| Sample::from(stored[at]).scaled(scale).label().unwrap_or(0));
            LabelVolume::from_original(grid, labels)?
        });
        Ok((volume, sampling.report(Interpolation::Nearest)))
    }

    /// The voxels as finite f32, in RAS+ orientation and cubes.
    ///
    /// As [`Self::labels`], but resampled trilinearly: exact on linear fields between the
    /// outermost voxel centres, constant beyond them. A `spacing_mm` above the stored ones
    /// skips voxels: blur first ([`crate::blur::gaussian_blur`]).
    ///
    /// # Errors
    /// [`MeshError::IntensityValue`] for a voxel that is NaN, infinite or beyond f32,
    /// [`MeshError::ResampledVoxels`], [`MeshError::LengthValue`].
    pub fn intensities(
        self,
        spacing_mm: Option<f64>,
    ) -> Result<(IntensityVolume, Option<Resampling>), MeshError> {
        let sampling = self.sampling(spacing_mm)?;
        let stored = each_voxel_type!(&self.voxels, stored => self.finite(stored)?);
        let values = sampling.trilinear(stored);
        let volume = IntensityVolume::new(sampling.grid.clone(), values)?;
        Ok((volume, sampling.report(Interpolation::Trilinear)))
    }

    /// The grid that [`Self::labels`] and [`Self::intensities`] give.
    ///
    /// # Errors
    /// [`MeshError::ResampledVoxels`], [`MeshError::LengthValue`].
    pub fn grid(&self, spacing_mm: Option<f64>) -> Result<Grid, MeshError> {
        Ok(self.sampling(spacing_mm)?.grid)
    }

    fn sampling(&self, spacing_mm: Option<f64>) -> Result<Sampling, MeshError> {
        Sampling::new(&self.source, &self.placement, spacing_mm)
    }

    fn checked_label(&self) -> impl Fn(usize, Sample) -> Result<i64, MeshError> {
        |index, sample| {
            let sample = sample.scaled(self.scale);
            sample.label().ok_or_else(|| MeshError::LabelValue {
                path: self.source.clone(),
                voxel: self.voxel(index),
                value: sample.value(),
            })
        }
    }

    fn finite<T: Copy + Into<Sample>>(&self, stored: &[T]) -> Result<Vec<f32>, MeshError> {
        let mut values = Vec::with_capacity(stored.len());
        for (index, &stored) in stored.iter().enumerate() {
            let value = stored.into().scaled(self.scale).value();
            if !(value as f32).is_finite() {
                let (path, voxel) = (self.source.clone(), self.voxel(index));
                return Err(MeshError::IntensityValue { path, voxel, value });
            }
            values.push(value as f32);
        }
        Ok(values)
    }

    fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.placement.file_dims;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }
}

/// The number of voxels, unless it is more than can be handled.
pub(crate) fn check_count(path: &Path, dims: [u64; 3]) -> Result<u64, MeshError> {
    let voxels = dims.iter().fold(1u64, |product, &d| product.saturating_mul(d));
    if voxels > MAX_VOXELS {
        let limit = MAX_VOXELS;
        return Err(MeshError::TooManyVoxels { path: path.into(), dims, voxels, limit });
    }
    Ok(voxels)
}
