//! An image as its file holds it: any axes, any spacings, any type; and how labels and
//! intensities in RAS+ orientation and cubic voxels are made of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::image::ImageError;
use crate::image::placement::{Placement, VoxelAffine};
use crate::image::resample::{Interpolation, Resampling, Sampling};
use crate::image::volume::{Grid, IntensityVolume, LabelVolume};
use crate::image::voxels::{Sample, Voxels, check_count, each_voxel_type};

const LABEL: &str = "but a label must be an integer (of at most 2^53 where it is a float or \
                     scaled, 2^63 - 1 else)";
const INTENSITY: &str = "want a finite number of magnitude below 3.4e38";

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
    label_names: BTreeMap<i64, String>,
}

impl RawVolume {
    /// A volume from its voxels, first axis fastest.
    ///
    /// `source` names the image in messages. `scale` is slope and intercept: a voxel's value is
    /// slope · stored + intercept, or the stored number where it is `None`.
    ///
    /// # Errors
    /// [`ImageError::Parameter`] for an axis without voxels, [`ImageError::TooManyVoxels`] above 2³¹,
    /// [`ImageError::VoxelCount`], [`ImageError::SingularAffine`], [`ImageError::ShearedAffine`]
    /// if two axes are more than 0.06° from a right angle.
    pub fn new(
        source: &Path,
        dims: [usize; 3],
        affine: &VoxelAffine,
        scale: Option<[f64; 2]>,
        voxels: Voxels,
    ) -> Result<Self, ImageError> {
        if dims.contains(&0) {
            let (field, want) = ("grid: dims", "at least 1 voxel");
            return Err(ImageError::Parameter { field, value: 0.0, want });
        }
        let placement = check_count(dims.map(|d| d as u64))
            .and_then(|_| Placement::new(dims, affine))
            .map_err(ImageError::in_file(source))?;
        if voxels.count() != dims.iter().product() {
            return Err(ImageError::VoxelCount { found: voxels.count(), dims });
        }
        let label_names = BTreeMap::new();
        Ok(Self { source: source.into(), placement, scale, voxels, label_names })
    }

    /// The same with names of labels, which need not occur.
    pub fn with_label_names(self, label_names: BTreeMap<i64, String>) -> Self {
        Self { label_names, ..self }
    }

    /// The names that its file gives labels.
    pub fn label_names(&self) -> &BTreeMap<i64, String> {
        &self.label_names
    }

    /// RAS+ axis i runs along the file's axis `axes()[i].0`, backwards if `axes()[i].1`.
    pub fn axes(&self) -> [(usize, bool); 3] {
        self.placement.axes
    }

    /// The voxels as labels, in RAS+ orientation and cubes.
    ///
    /// Spacings that differ by less than 1 % count as one, their geometric mean; others are
    /// resampled to the smallest of the three, or to `spacing_mm`, by nearest neighbour, and the
    /// [`Resampling`] says so. Cost: O(stored + resampled voxels).
    ///
    /// # Errors
    /// [`ImageError::VoxelValue`] for a voxel that is no integer, [`ImageError::TooManyLabels`],
    /// [`ImageError::ResampledVoxels`], [`ImageError::Parameter`] for a `spacing_mm` that is not
    /// finite and positive.
    pub fn labels(
        self,
        spacing_mm: Option<f64>,
    ) -> Result<(LabelVolume, Option<Resampling>), ImageError> {
        let sampling = self.sampling(spacing_mm)?;
        let grid = sampling.grid.clone();
        let volume = each_voxel_type!(&self.voxels, stored => {
            let scale = self.scale;
            for (index, &stored) in stored.iter().enumerate() {
                let sample = Sample::from(stored).scaled(scale);
                sample.label().ok_or_else(|| self.wrong(index, sample.value(), LABEL))?;
            }
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
    /// skips voxels: blur first ([`crate::image::gaussian_blur`]).
    ///
    /// # Errors
    /// [`ImageError::VoxelValue`] for a voxel that is NaN, infinite or beyond f32,
    /// [`ImageError::ResampledVoxels`], [`ImageError::Parameter`].
    pub fn intensities(
        self,
        spacing_mm: Option<f64>,
    ) -> Result<(IntensityVolume, Option<Resampling>), ImageError> {
        let sampling = self.sampling(spacing_mm)?;
        let stored = each_voxel_type!(&self.voxels, stored => self.finite(stored)?);
        let values = sampling.trilinear(stored);
        let volume = IntensityVolume::new(sampling.grid.clone(), values)?;
        Ok((volume, sampling.report(Interpolation::Trilinear)))
    }

    /// The grid that [`Self::labels`] and [`Self::intensities`] give.
    ///
    /// # Errors
    /// [`ImageError::ResampledVoxels`], [`ImageError::Parameter`].
    pub fn grid(&self, spacing_mm: Option<f64>) -> Result<Grid, ImageError> {
        Ok(self.sampling(spacing_mm)?.grid)
    }

    fn sampling(&self, spacing_mm: Option<f64>) -> Result<Sampling, ImageError> {
        Sampling::new(&self.placement, spacing_mm).map_err(ImageError::in_file(&self.source))
    }

    fn finite<T: Copy + Into<Sample>>(&self, stored: &[T]) -> Result<Vec<f32>, ImageError> {
        let mut values = Vec::with_capacity(stored.len());
        for (index, &stored) in stored.iter().enumerate() {
            let value = stored.into().scaled(self.scale).value();
            if !(value as f32).is_finite() {
                return Err(self.wrong(index, value, INTENSITY));
            }
            values.push(value as f32);
        }
        Ok(values)
    }

    fn wrong(&self, index: usize, value: f64, want: &'static str) -> ImageError {
        let [nx, ny, _] = self.placement.file_dims;
        let voxel = [index % nx, index / nx % ny, index / (nx * ny)];
        ImageError::in_file(&self.source)(ImageError::VoxelValue { voxel, value, want })
    }
}
