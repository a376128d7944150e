//! Where voxels come to lie, and in which order slices are taken.

use dicom_core::VR;
use nalgebra::{Matrix3, Rotation3, Vector3};
use yawara_mesh::image::read_dicom;
use yawara_mesh::image::{read_intensities_with, read_labels};

use super::writer::*;
use super::{SMALL, small, values};

/// Left, posterior, superior to right, anterior, superior.
fn lps(ras: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(-ras.x, -ras.y, ras.z)
}

/// 5 columns, 4 rows and 6 slices turned by `turn` in LPS, with value
/// 10 column + 100 row + 1000 slice.
fn oblique(turn: &Matrix3<f64>, spacing: Vector3<f64>, first: Vector3<f64>) -> Vec<File> {
    let [row, column, normal] = [0, 1, 2].map(|i| Vector3::from(turn.column(i)));
    let orientation = format!("{}\\{}", vector(row), vector(column));
    let mut slices = Vec::new();
    for z in 0..6 {
        let mut pixels = Vec::new();
        for y in 0..4 {
            pixels.extend((0..5).map(|x| (10 * x + 100 * y + 1000 * z) as i16));
        }
        let position = first + normal * (spacing.z * f64::from(z));
        slices.push(
            File::slice(z, 5, 4, &pixels)
                .text(POSITION, VR::DS, &vector(position))
                .text(ORIENTATION, VR::DS, &orientation)
                // Between rows, then between columns.
                .text(SPACING, VR::DS, &decimals(&[spacing.y, spacing.x])),
        );
    }
    slices
}

#[test]
fn an_oblique_anisotropic_series_lies_where_its_header_says() {
    let turn = *Rotation3::from_euler_angles(0.3, -0.2, 0.4).matrix();
    let (spacing, first) = (Vector3::new(1.25, 1.5, 2.5), Vector3::new(-20.0, 35.0, 7.0));
    let folder = Folder::of(&oblique(&turn, spacing, first));
    let (volume, report) = read_intensities_with(folder.path(), None).unwrap();
    let grid = volume.grid();
    assert!((grid.spacing_mm - 1.25).abs() < 1e-9);
    let mut from = report.resampling.unwrap().from_mm;
    from.sort_by(f64::total_cmp);
    assert!((Vector3::from(from) - spacing).norm() < 1e-7, "{from:?}");
    let mut inside = 0;
    let [nx, ny, nz] = grid.dims;
    for (x, y, z) in (0..nx * ny * nz).map(|i| (i % nx, i / nx % ny, i / (nx * ny))) {
        let centre = Vector3::new(x as f64, y as f64, z as f64) + Vector3::repeat(0.5);
        let ras = grid.origin_mm + grid.rotation * (centre * grid.spacing_mm);
        // In units of stored voxels, counted from the first one.
        let at = (turn.transpose() * (lps(ras) - first)).component_div(&spacing);
        let last = [4.0, 3.0, 5.0];
        if (0..3).any(|i| at[i] < -1e-6 || at[i] > last[i] + 1e-6) {
            continue;
        }
        inside += 1;
        let want = 10.0 * at.x + 100.0 * at.y + 1000.0 * at.z;
        let found = f64::from(volume.values()[grid.index(x, y, z).unwrap()]);
        // Positions and directions have 10 digits, f32 has 24 bits; values go to 5340.
        assert!((found - want).abs() < 5340.0 * 1.2e-7 + 1e-4, "{found} for {want} at {ras}");
    }
    // Of 5 × 5 × 12 cubes of 1.25 mm around the same middle, the centres of 5 × 3 × 10 lie
    // between the outermost stored ones, which span 5, 4.5 and 12.5 mm.
    assert_eq!(inside, 5 * 3 * 10);
}

#[test]
fn cubes_are_taken_as_they_are_in_24_directions() {
    // The third direction follows from the other two: no mirrored stacks.
    let tilt = *Rotation3::from_euler_angles(0.1, 0.2, -0.15).matrix();
    let mut turns = Vec::new();
    for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))).filter(|(a, b)| a != b) {
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let (mut u, mut v) = (Vector3::zeros(), Vector3::zeros());
            (u[a], v[b]) = (s, t);
            turns.push(tilt * Matrix3::from_columns(&[u, v, u.cross(&v)]));
        }
    }
    assert_eq!(turns.len(), 24);
    for turn in turns {
        let (spacing, first) = (Vector3::repeat(1.5), Vector3::new(4.0, -6.0, 100.0));
        let folder = Folder::of(&oblique(&turn, spacing, first));
        let volume = read_labels(folder.path()).unwrap();
        let grid = volume.grid();
        let at = |x: usize, y: usize, z: usize| {
            let indices = Vector3::new(x as f64, y as f64, z as f64);
            let ras = lps(first + turn * (indices * 1.5));
            let local = grid.rotation.transpose() * (ras - grid.origin_mm) / grid.spacing_mm;
            let centre = local.map(|c| c - 0.5);
            let index = centre.map(|c| c.round());
            assert!((centre - index).amax() < 1e-6, "{centre}");
            let id = volume.get(index.x as usize, index.y as usize, index.z as usize);
            volume.values()[usize::from(id)]
        };
        for (x, y, z) in [(0, 0, 0), (4, 0, 0), (0, 3, 0), (0, 0, 5), (1, 2, 3), (4, 3, 5)] {
            assert_eq!(at(x, y, z), (10 * x + 100 * y + 1000 * z) as i64, "{turn}");
        }
        // Upright rows and columns: less than half a turn is left.
        assert!(grid.rotation.trace() > 1.0);
    }
}

#[test]
fn one_file_stands_for_its_series() {
    let folder = Folder::of(&small());
    for name in ["IM0000", "IM0001", "IM0002"] {
        assert_eq!(values(&folder.file(name)), SMALL);
    }
    assert_eq!(values(folder.path()), SMALL);
    assert!(read_dicom(&folder.file("IM0003")).is_err());
    // Without a directory in its path it lies in the current one, where there is no series.
    assert!(read_dicom(std::path::Path::new("IM0000")).is_err());
}

#[test]
fn positions_count_whatever_their_common_offset() {
    // Positions may leave the grid by 0.01 mm and 1 % of the spacing of 2 mm.
    let moved = |offsets: [f64; 3]| {
        let slices = [0, 1, 2].map(|z| {
            let at = 2.0 * f64::from(z) + offsets[z as usize];
            small()[z as usize].clone().text(POSITION, VR::DS, &decimals(&[0.0, 0.0, at]))
        });
        read_labels(Folder::of(&slices).path())
    };
    assert_eq!(moved([-300.0; 3]).unwrap().grid().origin_mm.z, -301.0);
    assert!(moved([0.0, 0.029, 0.0]).is_ok());
    assert!(moved([0.0, -0.029, 0.0]).is_ok());
    assert!(moved([0.0, 0.031, 0.0]).is_err());
    assert!(moved([0.0, -0.031, 0.0]).is_err());
    // The spacing is the positions' mean, 2.01 mm here, which is a cube to 1 %.
    let volume = moved([0.0, 0.01, 0.02]).unwrap();
    assert!((volume.grid().spacing_mm - (2.0f64 * 2.0 * 2.01).cbrt()).abs() < 1e-12);
}
