//! Affines, units and spacing: where the voxels lie.

use nalgebra::{Matrix3, Rotation3, Vector3};
use yawara_mesh::ImageError;
use yawara_mesh::image::read_labels_with;

use crate::file::{File, assert_says, scratch};

/// All 48 ways to store a volume: `order[file axis]` is the RAS axis it runs along.
fn stored_in_every_way() -> impl Iterator<Item = ([usize; 3], [bool; 3])> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    orders.into_iter().flat_map(|order| {
        (0..8).map(move |bits| (order, [bits & 1 != 0, bits & 2 != 0, bits & 4 != 0]))
    })
}

/// The volume of 2 × 3 × 4 voxels numbered in RAS order, stored along the given axes, with
/// `turn` the direction of the RAS grid's axes and `corner` its first voxel's centre.
fn stored(order: [usize; 3], flip: [bool; 3], turn: &Matrix3<f64>, corner: Vector3<f64>) -> File {
    let ras = [2usize, 3, 4];
    let dims = order.map(|axis| ras[axis]);
    let mut voxels = Vec::new();
    for k in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                let mut at = [0; 3];
                for (file_axis, index) in [i, j, k].into_iter().enumerate() {
                    let last = dims[file_axis] - 1;
                    at[order[file_axis]] = if flip[file_axis] { last - index } else { index };
                }
                voxels.push((at[0] + 2 * (at[1] + 3 * at[2])) as i16);
            }
        }
    }
    let mut matrix = Matrix3::zeros();
    let mut first = corner;
    for file_axis in 0..3 {
        let step: Vector3<f64> = turn.column(order[file_axis]) * 2.0;
        matrix.set_column(file_axis, &if flip[file_axis] { -step } else { step });
        if flip[file_axis] {
            first += step * (dims[file_axis] - 1) as f64;
        }
    }
    let mut file = File::new(dims.map(|d| d as i16), &voxels);
    file.sform(&matrix, first);
    file
}

#[test]
fn all_48_orientations_give_the_same_volume() {
    let corner = Vector3::new(-7.0, 11.0, 5.0);
    let expected: Vec<u16> = (0..24).collect();
    let mut seen = 0;
    for (order, flip) in stored_in_every_way() {
        let volume = stored(order, flip, &Matrix3::identity(), corner).labels().unwrap();
        assert_eq!(volume.grid().dims, [2, 3, 4], "{order:?} {flip:?}");
        assert_eq!(volume.labels(), expected, "{order:?} {flip:?}");
        assert!((volume.grid().rotation - Matrix3::identity()).norm() < 1e-12);
        assert!((volume.grid().origin_mm - corner + Vector3::repeat(1.0)).norm() < 1e-6);
        seen += 1;
    }
    assert_eq!(seen, 48);
}

#[test]
fn an_oblique_scan_keeps_its_rotation() {
    let turn = *Rotation3::from_euler_angles(0.3, -0.2, 0.4).matrix();
    let corner = Vector3::new(1.0, 2.0, 3.0);
    for (order, flip) in stored_in_every_way() {
        let volume = stored(order, flip, &turn, corner).labels().unwrap();
        let grid = volume.grid();
        assert_eq!(volume.labels(), (0..24).collect::<Vec<u16>>());
        // The file holds f32: 24 bits, lost once in each of some sums.
        assert!((grid.rotation - turn).norm() < 1e-6, "{order:?} {flip:?}");
        assert!((grid.rotation.transpose() * grid.rotation - Matrix3::identity()).norm() < 1e-14);
        // Centres of voxels, 1 mm in on each axis, are where the file says.
        let centre = grid.to_ras_mm(Vector3::new(0.003, 0.001, 0.005));
        let want = corner + turn * Vector3::new(2.0, 0.0, 4.0);
        assert!((centre - want).norm() < 1e-5, "{order:?} {flip:?}: {centre} {want}");
    }
}

#[test]
fn qform_places_the_voxels_where_no_sform_does() {
    // Half a turn about z: x and y point to left and posterior. qfac −1: z points down.
    let voxels: Vec<i16> = (0..24).collect();
    let mut file = File::new([2, 3, 4], &voxels);
    file.i16(254, 0).i16(252, 1).f32(264, 1.0).f32(76, -1.0);
    file.f32(268, 10.0).f32(272, 20.0).f32(276, 30.0);
    let volume = file.labels().unwrap();
    assert_eq!(volume.labels(), (0..24).rev().collect::<Vec<u16>>());
    // The last voxel comes first: 1, 2, 3 steps of 2 mm down each axis.
    let origin = Vector3::new(10.0 - 2.0 - 1.0, 20.0 - 4.0 - 1.0, 30.0 - 6.0 - 1.0);
    assert!((volume.grid().origin_mm - origin).norm() < 1e-9);
    // A turn by 0.5 rad about x: b = sin(0.25).
    file.f32(264, 0.0).f32(76, 1.0).f32(256, 0.25f32.sin());
    let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.5);
    assert!((file.labels().unwrap().grid().rotation - turn.matrix()).norm() < 1e-6);
    file.f32(256, 1.5);
    assert_says(&file.error(), &["quatern_b", "2.25"]);
    file.f32(256, f32::NAN);
    assert_says(&file.error(), &["quatern_b", "NaN"]);
    file.f32(256, 0.0).f32(272, f32::INFINITY);
    assert_says(&file.error(), &["qoffset_y", "inf"]);
}

#[test]
fn sform_goes_before_qform_and_neither_is_needed() {
    let mut file = File::small();
    file.i16(252, 1).f32(264, 1.0);
    assert_eq!(file.labels().unwrap().labels(), [0, 1, 2, 1]);
    file.i16(252, 0).i16(254, 0).f32(80, 3.0).f32(84, 3.0).f32(88, 3.0);
    let volume = file.labels().unwrap();
    assert!((volume.grid().spacing_mm - 3.0).abs() < 1e-12);
    assert!((volume.grid().origin_mm + Vector3::repeat(1.5)).norm() < 1e-12);
}

#[test]
fn units_are_converted() {
    for (unit, factor) in [(0u8, 1.0), (2, 1.0), (1, 1000.0), (3, 0.001), (2 | 8, 1.0)] {
        let mut file = File::small();
        file.header[123] = unit;
        file.sform(&(Matrix3::identity() * 2.0), Vector3::new(5.0, 5.0, 5.0));
        let grid = file.labels().unwrap().grid().clone();
        assert!((grid.spacing_mm / (2.0 * factor) - 1.0).abs() < 1e-12, "unit {unit}");
        assert!((grid.origin_mm.x / (4.0 * factor) - 1.0).abs() < 1e-12, "unit {unit}");
        file.i16(254, 0);
        let spacing = file.labels().unwrap().grid().spacing_mm;
        assert!((spacing / (2.0 * factor) - 1.0).abs() < 1e-12, "unit {unit}");
    }
    let mut file = File::small();
    file.header[123] = 5;
    assert_says(&file.error(), &["xyzt_units", "5"]);
}

#[test]
fn nearly_cubic_voxels_stay_and_others_are_resampled() {
    let mut file = File::small();
    file.sform(&Matrix3::from_diagonal(&Vector3::new(2.0, 2.0, 2.019)), Vector3::zeros());
    let grid = file.labels().unwrap().grid().clone();
    assert_eq!(grid.dims, [2, 2, 1]);
    assert!((grid.spacing_mm.powi(3) / (4.0 * 2.019) - 1.0).abs() < 1e-6);
    file.sform(&Matrix3::from_diagonal(&Vector3::new(2.0, 2.0, 5.0)), Vector3::zeros());
    let (volume, report) = scratch(&file.bytes(), |path| read_labels_with(path, None)).unwrap();
    // 5 mm are closest to three voxels of 2 mm (2.5 rounds away from 0).
    assert_eq!((volume.grid().dims, volume.grid().spacing_mm), ([2, 2, 3], 2.0));
    assert_eq!(volume.labels(), [0, 1, 2, 1, 0, 1, 2, 1, 0, 1, 2, 1]);
    assert_eq!(report.format, "NIfTI");
    let text = report.resampling.unwrap().to_string();
    for word in ["2×2×1", "2.0000 × 2.0000 × 5.0000", "2×2×3", "nearest"] {
        assert!(text.contains(word), "{text}");
    }
    let (kept, report) =
        scratch(&File::small().bytes(), |path| read_labels_with(path, None)).unwrap();
    assert_eq!((report.resampling, kept.grid().dims), (None, [2, 2, 1]));
    // Spacings so unequal that one voxel would become thousands.
    file.sform(&Matrix3::from_diagonal(&Vector3::new(1e-4, 2.0, 2.0)), Vector3::zeros());
    assert!(matches!(file.error().problem(), ImageError::ResampledVoxels { limit: 1024, .. }));
}

#[test]
fn impossible_sforms_are_refused() {
    let mut file = File::small();
    let identity = Matrix3::identity() * 2.0;
    file.sform(&Matrix3::from_diagonal(&Vector3::new(2.0, 0.0, 2.0)), Vector3::zeros());
    assert!(matches!(file.error().problem(), ImageError::SingularAffine { form: "sform", .. }));
    file.sform(&Matrix3::repeat(1.0), Vector3::zeros());
    assert!(matches!(file.error().problem(), ImageError::SingularAffine { .. }));
    let mut sheared = identity;
    sheared[(0, 2)] = 0.01;
    file.sform(&sheared, Vector3::zeros());
    let error = file.error();
    assert!(matches!(error.problem(), ImageError::ShearedAffine { axes: [0, 2], .. }), "{error}");
    assert_says(&error, &["sform", "sheared", "resample"]);
    sheared[(0, 2)] = 0.001;
    assert!(file.sform(&sheared, Vector3::zeros()).labels().is_ok());
    for bad in [f32::NAN, f32::NEG_INFINITY] {
        for (at, name) in [(280, "srow_x"), (308, "srow_y"), (320, "srow_z")] {
            let mut file = File::small();
            assert_says(&file.f32(at, bad).error(), &[name, &bad.to_string()]);
        }
    }
}
