//! Written NIfTI files, read back here and by another decoder.
#![cfg(feature = "nifti")]

use nalgebra::{Matrix3, Rotation3, Vector3};
use nifti::{NiftiObject, NiftiVolume, RandomAccessNiftiVolume, ReaderOptions};
use tempfile::TempDir;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels, write_field, write_labels};
use yawara_mesh::volume::{Grid, IntensityVolume, LabelVolume};

fn oblique(dims: [usize; 3]) -> Grid {
    let rotation: Matrix3<f64> = *Rotation3::from_euler_angles(0.3, -0.2, 0.4).matrix();
    Grid { dims, spacing_mm: 0.7, rotation, origin_mm: Vector3::new(-31.0, 17.0, 250.0) }
}

fn assert_grid(found: &Grid, want: &Grid) {
    assert_eq!(found.dims, want.dims);
    // The header holds f32, here of numbers up to 256: 2⁻²⁴ of them, some times.
    assert!((found.spacing_mm - want.spacing_mm).abs() < 1e-7);
    assert!((found.rotation - want.rotation).norm() < 1e-6);
    assert!((found.origin_mm - want.origin_mm).norm() < 4.0 * 256.0 * 6e-8);
}

#[test]
fn labels_of_every_size_come_back_equal() {
    let folder = TempDir::new().unwrap();
    let tables: [(&[i64], i16); 8] = [
        (&[0, 5, 255], 2),
        (&[0, 5, 256], 4),
        (&[0, -1, 2], 4),
        (&[0, -32768, 32767], 4),
        (&[0, 5, 32768], 8),
        (&[0, i32::MIN as i64, 9], 8),
        (&[0, 5, 1 << 31], 1024),
        (&[0, i64::MIN, i64::MAX], 1024),
    ];
    // Exact in f32, so that the grid comes back equal too.
    let mut grid = Grid::centred([3, 2, 2], 0.75);
    grid.origin_mm = Vector3::new(-30.0, 16.5, 250.0);
    for (values, code) in tables {
        let labels = vec![0, 1, 2, 2, 1, 0, 0, 0, 1, 1, 2, 2];
        let volume = LabelVolume::new(grid.clone(), labels, values.to_vec()).unwrap();
        for name in ["a.nii", "a.nii.gz"] {
            let path = folder.path().join(name);
            write_labels(&path, &volume).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            assert_eq!(bytes.starts_with(&[0x1f, 0x8b]), name.ends_with("gz"));
            if name.ends_with("nii") {
                assert_eq!(i16::from_le_bytes([bytes[70], bytes[71]]), code, "{values:?}");
            }
            let back = read_labels(&path).unwrap();
            assert!((back.grid().spacing_mm - 0.75).abs() < 1e-15);
            assert_grid(back.grid(), volume.grid());
            assert_eq!((back.labels(), back.values()), (volume.labels(), volume.values()));
        }
    }
}

#[test]
fn fields_come_back_equal_by_sform_and_by_qform() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("stress.nii");
    // A half turn has a zero real part, which a quaternion's other parts alone must tell.
    let half_turn = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
    for rotation in [oblique([1; 3]).rotation, half_turn * oblique([1; 3]).rotation] {
        let grid = Grid { rotation, ..oblique([2, 3, 4]) };
        let values = (0..24).map(|v| 1.1f32.powi(v) - 3.0).collect();
        let field = IntensityVolume::new(grid, values).unwrap();
        write_field(&path, &field).unwrap();
        let by_sform = read_intensities(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[254] = 0; // sform_code
        let other = folder.path().join("qform.nii");
        std::fs::write(&other, bytes).unwrap();
        let by_qform = read_intensities(&other).unwrap();
        assert_grid(by_qform.grid(), by_sform.grid());
        // The reader turns axes to RAS where they are closer so; positions tell them apart.
        if by_sform.grid().rotation[(0, 0)] * rotation[(0, 0)] > 0.0 {
            assert_eq!(by_sform.values(), field.values());
            assert_grid(by_sform.grid(), field.grid());
        } else {
            assert_eq!(by_sform.get(1, 2, 0), field.get(0, 0, 0));
        }
    }
}

#[test]
fn another_decoder_reads_the_same() {
    let folder = TempDir::new().unwrap();
    for name in ["a.nii", "a.nii.gz"] {
        let path = folder.path().join(name);
        let values: Vec<f32> = (0..24).map(|v| v as f32 * 0.5 - 3.0).collect();
        let field = IntensityVolume::new(oblique([2, 3, 4]), values).unwrap();
        write_field(&path, &field).unwrap();
        let object = ReaderOptions::new().read_file(&path).unwrap();
        let header = object.header();
        assert_eq!((header.sform_code, header.qform_code, header.dim[3]), (1, 1, 4));
        let rows = [header.srow_x, header.srow_y, header.srow_z];
        for (i, j, k) in [(0, 0, 0), (1, 2, 3), (1, 0, 2)] {
            let at = [i as f64, j as f64, k as f64, 1.0];
            let centre = rows.map(|row| (0..4).map(|c| f64::from(row[c]) * at[c]).sum());
            let local = Vector3::new(at[0] + 0.5, at[1] + 0.5, at[2] + 0.5) * 0.7e-3;
            assert!((Vector3::from(centre) - field.grid().to_ras_mm(local)).norm() < 1e-4);
            let value = object.volume().get_f32(&[i, j, k]).unwrap();
            assert_eq!(Some(value), field.get(i.into(), j.into(), k.into()));
        }
        assert_eq!(object.volume().dim(), [2, 3, 4]);
    }
}

#[test]
fn a_file_is_replaced_whole_or_not_at_all() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.nii");
    std::fs::write(&path, "older").unwrap();
    let volume = LabelVolume::new(oblique([1, 1, 1]), vec![1], vec![0, 9]).unwrap();
    write_labels(&path, &volume).unwrap();
    assert_eq!(read_labels(&path).unwrap().values(), [0, 9]);
    for name in ["a.nrrd", "nii", "a.gz", ""] {
        let error = write_labels(&folder.path().join(name), &volume).unwrap_err();
        assert!(
            matches!(error.problem(), ImageError::Unwritable { field: "the name", .. }),
            "{error}"
        );
    }
    let long = LabelVolume::new(oblique([32768, 1, 1]), vec![0; 32768], vec![0]).unwrap();
    let error = write_labels(&path, &long).unwrap_err();
    assert!(error.to_string().contains("32768"), "{error}");
    let missing = folder.path().join("none").join("a.nii");
    assert!(matches!(write_labels(&missing, &volume).unwrap_err().problem(), ImageError::Io(_)));
    // A folder of that name stops the renaming; nothing half-written stays.
    let taken = folder.path().join("taken.nii");
    std::fs::create_dir(&taken).unwrap();
    assert!(matches!(write_labels(&taken, &volume).unwrap_err().problem(), ImageError::Io(_)));
    let mut left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["a.nii", "taken.nii"]);
}
