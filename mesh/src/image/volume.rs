//! Label and intensity volumes on an isotropic grid, in scanner RAS+ orientation.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use crate::image::ImageError;

/// The most labels a volume may have besides the background: what a dense u16 id tells apart.
pub const MAX_LABELS: usize = u16::MAX as usize;

/// How far RᵀR may be from 1, entry by entry, for R to count as a rotation.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// Where the voxels of a volume lie: cubes of one size, their axes close to right, anterior
/// and superior.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Voxels along x (right), y (anterior), z (superior); each at least 1.
    pub dims: [usize; 3],
    /// Edge of a voxel, mm.
    pub spacing_mm: f64,
    /// Column i is the direction of voxel axis i in scanner RAS: orthonormal, determinant +1,
    /// the identity unless the scan was oblique.
    pub rotation: Matrix3<f64>,
    /// Scanner RAS position, mm, of the *corner* of voxel (0, 0, 0): its centre less half a
    /// voxel along each of the three voxel axes.
    pub origin_mm: Vector3<f64>,
}

impl Grid {
    /// A grid with axes along R, A, S whose middle lies at the scanner's origin.
    ///
    /// Units: mm. The grid is checked when a volume is made of it.
    pub fn centred(dims: [usize; 3], spacing_mm: f64) -> Self {
        let origin_mm = Vector3::from(dims.map(|d| -0.5 * spacing_mm * d as f64));
        Self { dims, spacing_mm, rotation: Matrix3::identity(), origin_mm }
    }

    /// The same voxels with all lengths multiplied by `factor`.
    fn scaled(mut self, factor: f64) -> Result<Self, ImageError> {
        self.spacing_mm *= factor;
        self.origin_mm *= factor;
        let voxels = self.voxel_count().unwrap_or(0);
        self.check(voxels)?;
        Ok(self)
    }

    /// From solver coordinates (metres along the voxel axes, 0 at the corner of voxel
    /// (0, 0, 0)) to scanner RAS in mm: origin + 1000 · rotation · local.
    pub fn to_ras_mm(&self, local_m: Vector3<f64>) -> Vector3<f64> {
        self.origin_mm + self.rotation * (local_m * 1000.0)
    }

    /// Number of voxels, or `None` if it overflows.
    pub fn voxel_count(&self) -> Option<usize> {
        self.dims.iter().try_fold(1usize, |product, &d| product.checked_mul(d))
    }

    /// Position of voxel (x, y, z) in lists of voxels, x fastest, or `None` outside.
    pub fn index(&self, x: usize, y: usize, z: usize) -> Option<usize> {
        let [nx, ny, nz] = self.dims;
        (x < nx && y < ny && z < nz).then(|| x + nx * (y + ny * z))
    }

    fn check(&self, values: usize) -> Result<(), ImageError> {
        let wrong = |field, value, want| Err(ImageError::Parameter { field, value, want });
        if self.dims.contains(&0) {
            return wrong("grid: dims", 0.0, "at least 1 voxel");
        }
        // Negated comparisons, so that NaN fails too.
        if !(self.spacing_mm > 0.0 && self.spacing_mm.is_finite()) {
            return wrong("grid: spacing_mm", self.spacing_mm, "finite and > 0");
        }
        if let Some(&value) = self.origin_mm.iter().find(|v| !v.is_finite()) {
            return wrong("grid: origin_mm", value, "finite");
        }
        let deviation = self.rotation.transpose() * self.rotation - Matrix3::identity();
        if let Some(&value) = deviation.iter().find(|d| !(d.abs() <= ROTATION_TOLERANCE)) {
            return wrong("grid: RᵀR - 1 of the rotation", value, "at most 1e-6");
        }
        let determinant = self.rotation.determinant();
        if determinant < 0.0 {
            return wrong("grid: determinant of the rotation", determinant, "+1");
        }
        if self.voxel_count() != Some(values) {
            return Err(ImageError::VoxelCount { found: values, dims: self.dims });
        }
        Ok(())
    }
}

/// What each voxel is: one dense id per voxel, and the label that each id stands for.
///
/// Id 0 is the background (void, label 0) and always in the table, even when no voxel has it.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelVolume {
    grid: Grid,
    labels: Vec<u16>,
    values: Vec<i64>,
}

impl LabelVolume {
    /// A volume from dense ids (x fastest) and the table id → label (0, then ascending).
    ///
    /// # Errors
    /// [`ImageError::Parameter`], [`ImageError::VoxelCount`], [`ImageError::TooManyLabels`] above
    /// [`MAX_LABELS`], [`ImageError::LabelTable`] if the table is not 0 followed by ascending
    /// labels, [`ImageError::UnknownId`] if a voxel has an id beyond the table.
    pub fn new(grid: Grid, labels: Vec<u16>, values: Vec<i64>) -> Result<Self, ImageError> {
        grid.check(labels.len())?;
        if values.first() != Some(&0) {
            let value = values.first().copied().unwrap_or(0);
            return Err(ImageError::LabelTable { index: 0, value });
        }
        for index in 1..values.len() {
            let ascends = index == 1 || values[index] > values[index - 1];
            if values[index] == 0 || !ascends {
                return Err(ImageError::LabelTable { index, value: values[index] });
            }
        }
        if values.len() - 1 > MAX_LABELS {
            return Err(ImageError::TooManyLabels { found: values.len() - 1, limit: MAX_LABELS });
        }
        let count = values.len();
        if let Some(index) = labels.iter().position(|&id| usize::from(id) >= count) {
            return Err(ImageError::UnknownId { index, id: labels[index], count });
        }
        Ok(Self { grid, labels, values })
    }

    /// The same voxels with all lengths multiplied by `factor`.
    ///
    /// # Errors
    /// [`ImageError::Parameter`] if the lengths are no longer finite and more than 0.
    pub fn scaled(mut self, factor: f64) -> Result<Self, ImageError> {
        self.grid = self.grid.scaled(factor)?;
        Ok(self)
    }

    /// A volume from the original labels of the voxels (x fastest, any integers): they are
    /// numbered densely in ascending order, the background 0 first.
    ///
    /// Cost: two passes over the voxels. Time O(n log l) for n voxels of l labels, O(n) where
    /// neighbours are mostly alike.
    ///
    /// # Errors
    /// [`ImageError::Parameter`], [`ImageError::VoxelCount`], [`ImageError::TooManyLabels`].
    pub fn from_original<I>(grid: Grid, original: I) -> Result<Self, ImageError>
    where
        I: Iterator<Item = i64> + Clone,
    {
        let mut found = BTreeSet::new();
        let mut last = 0;
        for label in original.clone() {
            if label != last {
                found.insert(label);
                last = label;
            }
            // Stop early: a float image given as labels has millions of them.
            if found.len() > MAX_LABELS + 1 {
                break;
            }
        }
        found.remove(&0);
        if found.len() > MAX_LABELS {
            return Err(ImageError::TooManyLabels { found: found.len(), limit: MAX_LABELS });
        }
        let others: Vec<i64> = found.into_iter().collect();
        let mut last = (0i64, 0u16);
        let labels = original
            .map(|label| {
                if label != last.0 {
                    let id = match label {
                        0 => 0,
                        _ => others.partition_point(|&other| other < label) as u16 + 1,
                    };
                    last = (label, id);
                }
                last.1
            })
            .collect();
        let values = std::iter::once(0).chain(others).collect();
        Self::new(grid, labels, values)
    }

    /// Where the voxels lie.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The dense ids of all voxels, x fastest.
    pub fn labels(&self) -> &[u16] {
        &self.labels
    }

    /// The original label of each dense id; `values()[0]` is 0.
    pub fn values(&self) -> &[i64] {
        &self.values
    }

    /// The dense id of voxel (x, y, z); 0, the background, outside the volume.
    pub fn get(&self, x: usize, y: usize, z: usize) -> u16 {
        self.grid.index(x, y, z).map_or(0, |index| self.labels[index])
    }

    /// The same voxels, with a label in the table that none of them has yet.
    ///
    /// # Errors
    /// [`ImageError::TooManyLabels`] above [`MAX_LABELS`].
    pub fn with_label(mut self, label: i64) -> Result<Self, ImageError> {
        if self.values.contains(&label) {
            return Ok(self);
        }
        if self.values.len() > MAX_LABELS {
            return Err(ImageError::TooManyLabels { found: self.values.len(), limit: MAX_LABELS });
        }
        let id = 1 + self.values[1..].partition_point(|&other| other < label);
        self.values.insert(id, label);
        let moved = self.labels.iter_mut().filter(|other| usize::from(**other) >= id);
        moved.for_each(|other| *other += 1);
        Ok(self)
    }

    /// Gives a voxel, by its position in [`labels`](Self::labels), another dense id; returns the one that it had.
    ///
    /// # Errors
    /// [`ImageError::UnknownId`] if the table has no such id; then it keeps its own.
    ///
    /// # Panics
    /// If there is no such voxel.
    pub fn set(&mut self, index: usize, id: u16) -> Result<u16, ImageError> {
        let count = self.values.len();
        match usize::from(id) < count {
            true => Ok(std::mem::replace(&mut self.labels[index], id)),
            false => Err(ImageError::UnknownId { index, id, count }),
        }
    }

    /// Number of voxels of each dense id. Cost: O(voxels).
    pub fn counts(&self) -> Vec<u64> {
        let mut counts = vec![0; self.values.len()];
        for &id in &self.labels {
            counts[usize::from(id)] += 1;
        }
        counts
    }

    /// The smallest box around all voxels that are not background, as its first voxel and its
    /// last one (inclusive), or `None` if there is nothing but background. Cost: O(voxels).
    pub fn bounding_box(&self) -> Option<[[usize; 3]; 2]> {
        self.box_where(|id| id != 0)
    }

    /// The same around the voxels whose dense id is `wanted`.
    pub(crate) fn box_where(&self, wanted: impl Fn(u16) -> bool) -> Option<[[usize; 3]; 2]> {
        let [nx, ny, _] = self.grid.dims;
        let mut bounds: Option<[[usize; 3]; 2]> = None;
        for (row, ids) in self.labels.chunks_exact(nx).enumerate() {
            let Some(first) = ids.iter().position(|&id| wanted(id)) else { continue };
            let last = ids.iter().rposition(|&id| wanted(id)).unwrap_or(first);
            let (y, z) = (row % ny, row / ny);
            let [low, high] = bounds.get_or_insert([[first, y, z], [last, y, z]]);
            for (axis, (a, b)) in [(first, last), (y, y), (z, z)].into_iter().enumerate() {
                low[axis] = low[axis].min(a);
                high[axis] = high[axis].max(b);
            }
        }
        bounds
    }
}

/// A measured quantity per voxel, e.g. Hounsfield units.
#[derive(Debug, Clone, PartialEq)]
pub struct IntensityVolume {
    grid: Grid,
    values: Vec<f32>,
}

impl IntensityVolume {
    /// A volume from one finite value per voxel, x fastest.
    ///
    /// # Errors
    /// [`ImageError::Parameter`], [`ImageError::VoxelCount`], [`ImageError::NotFinite`].
    pub fn new(grid: Grid, values: Vec<f32>) -> Result<Self, ImageError> {
        grid.check(values.len())?;
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(ImageError::NotFinite { index, value: values[index] });
        }
        Ok(Self { grid, values })
    }

    /// The same voxels with all lengths multiplied by `factor`.
    ///
    /// # Errors
    /// [`ImageError::Parameter`] if the lengths are no longer finite and more than 0.
    pub fn scaled(mut self, factor: f64) -> Result<Self, ImageError> {
        self.grid = self.grid.scaled(factor)?;
        Ok(self)
    }

    /// Where the voxels lie.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The values of all voxels, x fastest, in the image's own unit.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The value of voxel (x, y, z), or `None` outside the volume.
    pub fn get(&self, x: usize, y: usize, z: usize) -> Option<f32> {
        self.grid.index(x, y, z).map(|index| self.values[index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_numbered_densely_background_first() {
        let grid = Grid::centred([5, 1, 1], 1.0);
        let original = [900, -4, 0, 7, 900];
        let volume = LabelVolume::from_original(grid, original.into_iter()).unwrap();
        assert_eq!(volume.values(), [0, -4, 7, 900]);
        assert_eq!(volume.labels(), [3, 1, 0, 2, 3]);
        assert_eq!(volume.counts(), [1, 1, 1, 2]);
        // The background stays in the table of a volume that has none.
        let full = LabelVolume::from_original(Grid::centred([1, 1, 1], 1.0), [5].into_iter());
        assert_eq!(full.unwrap().values(), [0, 5]);
    }

    #[test]
    fn as_many_labels_as_ids_and_not_one_more() {
        let labelled = |last: usize| {
            let grid = Grid::centred([last + 1, 1, 1], 1.0);
            LabelVolume::from_original(grid, 0..=last as i64)
        };
        let volume = labelled(MAX_LABELS).unwrap();
        assert_eq!(volume.get(MAX_LABELS, 0, 0), u16::MAX);
        assert_eq!(volume.values()[MAX_LABELS], MAX_LABELS as i64);
        let error = labelled(MAX_LABELS + 1).unwrap_err();
        assert!(matches!(error, ImageError::TooManyLabels { limit: 65535, .. }));
    }

    #[test]
    fn bounding_box_is_tight() {
        let grid = Grid::centred([4, 5, 6], 1.0);
        let mut labels = vec![0u16; 120];
        let empty = LabelVolume::new(grid.clone(), labels.clone(), vec![0, 1]).unwrap();
        assert_eq!(empty.bounding_box(), None);
        for (x, y, z) in [(2, 3, 1), (1, 4, 1), (1, 1, 5)] {
            labels[grid.index(x, y, z).unwrap()] = 1;
        }
        let volume = LabelVolume::new(grid, labels, vec![0, 1]).unwrap();
        assert_eq!(volume.bounding_box(), Some([[1, 1, 1], [2, 4, 5]]));
        assert_eq!((volume.get(2, 3, 1), volume.get(0, 0, 0), volume.get(2, 3, 9)), (1, 0, 0));
    }

    #[test]
    fn solver_coordinates_start_at_the_corner() {
        let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let origin_mm = Vector3::new(10.0, 20.0, 30.0);
        let grid = Grid { dims: [2, 2, 2], spacing_mm: 2.0, rotation: quarter, origin_mm };
        assert_eq!(grid.to_ras_mm(Vector3::zeros()), origin_mm);
        // 3 mm along the first voxel axis, which points to anterior here.
        let moved = grid.to_ras_mm(Vector3::new(0.003, 0.0, 0.0));
        assert!((moved - Vector3::new(10.0, 23.0, 30.0)).norm() < 1e-12);
    }

    #[test]
    fn invalid_volumes_are_refused() {
        let grid = || Grid::centred([2, 1, 1], 1.0);
        let refused = |grid: Grid| LabelVolume::new(grid, vec![0, 1], vec![0, 1]).unwrap_err();
        for spacing_mm in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = refused(Grid { spacing_mm, ..grid() });
            assert!(
                matches!(error, ImageError::Parameter { field: "grid: spacing_mm", .. }),
                "{error}"
            );
        }
        let origin_mm = Vector3::new(0.0, f64::NAN, 0.0);
        assert!(matches!(refused(Grid { origin_mm, ..grid() }), ImageError::Parameter { .. }));
        for rotation in [Matrix3::zeros(), Matrix3::repeat(f64::NAN), -Matrix3::identity()] {
            assert!(matches!(refused(Grid { rotation, ..grid() }), ImageError::Parameter { .. }));
        }
        let huge = [usize::MAX, 2, 1];
        assert!(matches!(refused(Grid { dims: huge, ..grid() }), ImageError::VoxelCount { .. }));
        assert!(matches!(
            refused(Grid { dims: [0, 1, 1], ..grid() }),
            ImageError::Parameter { .. }
        ));
        for values in [vec![], vec![1], vec![0, 2, 2], vec![0, 3, 1], vec![0, -1, 0]] {
            let error = LabelVolume::new(grid(), vec![0, 0], values).unwrap_err();
            assert!(matches!(error, ImageError::LabelTable { .. }), "{error}");
        }
        let error = LabelVolume::new(grid(), vec![0, 2], vec![0, 1]).unwrap_err();
        assert!(matches!(error, ImageError::UnknownId { index: 1, id: 2, count: 2 }), "{error}");
        for bad in [f32::NAN, f32::INFINITY] {
            let error = IntensityVolume::new(grid(), vec![0.0, bad]).unwrap_err();
            assert!(matches!(error, ImageError::NotFinite { index: 1, .. }), "{error}");
        }
    }
}
