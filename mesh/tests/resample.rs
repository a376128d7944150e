//! Stored grids of any shape made cubes.

use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;
use yawara_mesh::ImageError;
use yawara_mesh::image::Interpolation;
use yawara_mesh::image::{RawVolume, VoxelAffine, Voxels};
use yawara_mesh::volume::Grid;

/// Voxels along oblique axes, the second backwards.
struct Scan {
    dims: [usize; 3],
    affine: VoxelAffine,
}

impl Scan {
    fn new(dims: [usize; 3], spacing: [f64; 3]) -> Self {
        let turn: Matrix3<f64> = *Rotation3::from_euler_angles(0.2, -0.3, 0.1).matrix();
        let column = |axis: usize, sign: f64| turn.column(axis) * (sign * spacing[axis]);
        // File axes: superior, posterior, right.
        let columns = [column(2, 1.0), column(1, -1.0), column(0, 1.0)];
        let first_centre = Vector3::new(3.0, -40.0, 12.0);
        Self { dims, affine: VoxelAffine { form: "test", columns, first_centre } }
    }

    fn centres(&self) -> Vec<Vector3<f64>> {
        let [nx, ny, nz] = self.dims;
        let [a, b, c] = self.affine.columns;
        (0..nx * ny * nz)
            .map(|index| {
                let (i, j, k) = (index % nx, index / nx % ny, index / (nx * ny));
                self.affine.first_centre + a * i as f64 + b * j as f64 + c * k as f64
            })
            .collect()
    }

    fn volume(&self, voxels: Voxels) -> RawVolume {
        RawVolume::new(Path::new("scan"), self.dims, &self.affine, None, voxels).unwrap()
    }

    /// Coordinates in voxels along the file's axes.
    fn voxel_coordinates(&self, point: Vector3<f64>) -> Vector3<f64> {
        let matrix = Matrix3::from_columns(&self.affine.columns);
        matrix.try_inverse().unwrap() * (point - self.affine.first_centre)
    }

    /// The middle of the box of all voxels.
    fn middle(&self) -> Vector3<f64> {
        let steps = Vector3::from(self.dims.map(|d| 0.5 * (d as f64 - 1.0)));
        self.affine.first_centre + Matrix3::from_columns(&self.affine.columns) * steps
    }
}

fn grid_centres(grid: &Grid) -> Vec<Vector3<f64>> {
    let [nx, ny, _] = grid.dims;
    (0..grid.voxel_count().unwrap())
        .map(|index| {
            let at = [index % nx, index / nx % ny, index / (nx * ny)];
            let local = Vector3::from(at.map(|i| (i as f64 + 0.5) * grid.spacing_mm / 1000.0));
            grid.to_ras_mm(local)
        })
        .collect()
}

#[test]
fn a_linear_field_is_exact_between_the_outermost_centres() {
    for asked in [None, Some(1.3), Some(2.7)] {
        let scan = Scan::new([4, 7, 9], [1.0, 1.7, 4.0]);
        let field = |p: &Vector3<f64>| 3.0 + p.dot(&Vector3::new(0.5, -0.7, 1.1));
        let voxels = Voxels::F64(scan.centres().iter().map(field).collect());
        let (image, report) = scan.volume(voxels).intensities(asked).unwrap();
        let report = report.unwrap();
        assert_eq!(report.interpolation, Interpolation::Trilinear);
        assert_eq!((report.from_dims, report.to_mm), ([9, 7, 4], asked.unwrap_or(1.0)));
        let mut inside = 0;
        for (centre, value) in grid_centres(image.grid()).iter().zip(image.values()) {
            let at = scan.voxel_coordinates(*centre);
            if (0..3).all(|axis| at[axis] >= 0.0 && at[axis] <= scan.dims[axis] as f64 - 1.0) {
                // Values up to 64, stored and returned in f32: half an ulp each.
                assert!((f64::from(*value) - field(centre)).abs() < 2.0 * 64.0 * 6e-8);
                inside += 1;
            }
        }
        assert!(inside > 40, "{inside} voxels tell little");
    }
}

#[test]
fn labels_come_from_the_closest_centre() {
    for asked in [None, Some(1.3), Some(2.7)] {
        let scan = Scan::new([4, 5, 6], [1.0, 1.7, 3.9]);
        let count = 4 * 5 * 6;
        let (volume, report) =
            scan.volume(Voxels::I16((0..count).collect())).labels(asked).unwrap();
        assert_eq!(report.unwrap().interpolation, Interpolation::Nearest);
        let mut told = 0;
        for (centre, &id) in grid_centres(volume.grid()).iter().zip(volume.labels()) {
            let at = scan.voxel_coordinates(*centre);
            // A tie may go either way.
            if at.iter().any(|x| ((x - x.floor()) - 0.5).abs() < 1e-9) {
                continue;
            }
            let near = [0, 1, 2]
                .map(|axis| at[axis].round().clamp(0.0, scan.dims[axis] as f64 - 1.0) as i64);
            let want = near[0] + 4 * (near[1] + 5 * near[2]);
            assert_eq!(volume.values()[usize::from(id)], want);
            told += 1;
        }
        assert!(told > 30, "{told} voxels tell little");
    }
}

#[test]
fn cubes_are_kept_unless_another_spacing_is_asked_for() {
    let scan = Scan::new([3, 2, 2], [2.0; 3]);
    let voxels = || Voxels::U8((0..12).collect());
    for same in [None, Some(2.0)] {
        let (volume, report) = scan.volume(voxels()).labels(same).unwrap();
        assert_eq!((report, volume.grid().dims, volume.grid().spacing_mm), (None, [2, 2, 3], 2.0));
    }
    let (volume, report) = scan.volume(voxels()).labels(Some(1.0)).unwrap();
    assert_eq!((report.unwrap().to_dims, volume.grid().dims), ([4, 4, 6], [4, 4, 6]));
    // Each voxel becomes eight.
    assert!(volume.counts().iter().all(|&count| count == 8), "{:?}", volume.counts());
    let (volume, _) = scan.volume(voxels()).labels(Some(1e9)).unwrap();
    assert_eq!(volume.grid().dims, [1, 1, 1]);
}

#[test]
fn impossible_spacings_and_grids_are_refused() {
    let scan = Scan::new([3, 2, 2], [2.0; 3]);
    let volume = || scan.volume(Voxels::U8(vec![1; 12]));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = volume().labels(Some(bad)).unwrap_err();
        assert!(matches!(error.problem(), ImageError::Parameter { .. }), "{error}");
    }
    for tiny in [0.1, 1e-300] {
        let error = volume().intensities(Some(tiny)).unwrap_err();
        assert!(
            matches!(error.problem(), ImageError::ResampledVoxels { limit: 3072, .. }),
            "{error}"
        );
        assert!(error.to_string().contains("larger spacing"), "{error}");
    }
    let new = |dims, voxels| RawVolume::new(Path::new("scan"), dims, &scan.affine, None, voxels);
    let few = new([3, 2, 2], Voxels::U8(vec![1; 11]));
    assert!(matches!(few.unwrap_err().problem(), ImageError::VoxelCount { found: 11, .. }));
    let none = new([3, 0, 2], Voxels::U8(vec![]));
    assert!(matches!(
        none.unwrap_err().problem(),
        ImageError::Parameter { field: "grid: dims", .. }
    ));
    let many = new([usize::MAX, 2, 2], Voxels::U8(vec![]));
    assert!(matches!(many.unwrap_err().problem(), ImageError::TooManyVoxels { .. }));
    let mut affine = scan.affine.clone();
    affine.columns[1].x = f64::NAN;
    let error = RawVolume::new(Path::new("scan"), [1; 3], &affine, None, Voxels::U8(vec![1]));
    assert!(matches!(error.unwrap_err().problem(), ImageError::SingularAffine { .. }));
    let bad = scan.volume(Voxels::F32(vec![f32::NAN; 12])).intensities(None);
    assert!(matches!(bad.unwrap_err().problem(), ImageError::VoxelValue { .. }));
}

proptest! {
    #[test]
    fn the_box_keeps_its_middle_and_nearly_its_size(
        dims in [1usize..9, 1usize..9, 1usize..9],
        spacing in [0.5f64..4.0, 0.5f64..4.0, 0.5f64..4.0],
        value in -1000.0f32..1000.0,
    ) {
        let scan = Scan::new(dims, spacing);
        let count = dims.iter().product();
        let (image, report) =
            scan.volume(Voxels::F32(vec![value; count])).intensities(None).unwrap();
        // A constant stays the same number.
        prop_assert!(image.values().iter().all(|v| *v == value));
        let grid = image.grid();
        let half = Vector3::from(grid.dims.map(|d| 0.5 * d as f64 * grid.spacing_mm / 1000.0));
        // Isotropic within 1 %, spacings of one mean are up to 1 % off on each axis.
        let kept = report.is_none();
        let limit = if kept { 0.01 * 4.0 * 9.0 } else { 1e-9 };
        prop_assert!((grid.to_ras_mm(half) - scan.middle()).norm() < limit);
        if let Some(report) = report {
            for axis in 0..3 {
                let from = report.from_dims[axis] as f64 * report.from_mm[axis];
                let to = report.to_dims[axis] as f64 * report.to_mm;
                prop_assert!((from - to).abs() <= 0.5 * report.to_mm + 1e-9);
            }
        }
    }
}
