//! Byte order, compression, offset, types, scale and labels.

use nalgebra::Vector3;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};

use crate::file::{File, assert_says, gzip, scratch};

#[test]
fn plain_file_is_read() {
    let volume = File::small().labels().unwrap();
    assert_eq!(volume.grid().dims, [2, 2, 1]);
    assert_eq!(volume.labels(), [0, 1, 2, 1]);
    assert_eq!(volume.values(), [0, 1, 2]);
    assert_eq!(volume.grid().spacing_mm, 2.0);
    // Centre of voxel (0, 0, 0) at the origin, its corner half a voxel before.
    assert_eq!(volume.grid().origin_mm, Vector3::repeat(-1.0));
}

#[test]
fn gzip_is_known_by_its_magic_not_its_name() {
    let bytes = gzip(&File::small().bytes());
    let expected = File::small().labels().unwrap();
    assert_eq!(scratch(&bytes, read_labels).unwrap(), expected);
    // Concatenated members are one stream, as of block gzip.
    let plain = File::small().bytes();
    let members = [gzip(&plain[..100]), gzip(&plain[100..])].concat();
    assert_eq!(scratch(&members, read_labels).unwrap(), expected);
}

#[test]
fn big_endian_is_read() {
    let big = File::ordered([2, 2, 1], &[0, 300, -2, 300], true).labels().unwrap();
    let little = File::new([2, 2, 1], &[0, 300, -2, 300]).labels().unwrap();
    assert_eq!(big, little);
    assert_eq!(big.values(), [0, -2, 300]);
}

#[test]
fn vox_offset_is_honoured() {
    let mut file = File::small();
    file.gap = 416 - 348;
    file.f32(108, 416.0);
    let expected = File::small().labels().unwrap();
    assert_eq!(file.labels().unwrap(), expected);
    assert_eq!(scratch(&gzip(&file.bytes()), read_labels).unwrap(), expected);
}

/// Stores a value in a type.
type Encoder = fn(i16) -> Vec<u8>;

#[test]
fn every_real_type_is_read() {
    let voxels = [0i16, 1, 120, 7];
    let cases: [(i16, i16, Encoder); 10] = [
        (2, 8, |v| vec![v as u8]),
        (256, 8, |v| (v as i8).to_le_bytes().into()),
        (4, 16, |v| v.to_le_bytes().into()),
        (512, 16, |v| (v as u16).to_le_bytes().into()),
        (8, 32, |v| i32::from(v).to_le_bytes().into()),
        (768, 32, |v| (v as u32).to_le_bytes().into()),
        (1024, 64, |v| i64::from(v).to_le_bytes().into()),
        (1280, 64, |v| (v as u64).to_le_bytes().into()),
        (16, 32, |v| f32::from(v).to_le_bytes().into()),
        (64, 64, |v| f64::from(v).to_le_bytes().into()),
    ];
    for (datatype, bitpix, encode) in cases {
        let mut file = File::small();
        file.typed(datatype, bitpix).data = voxels.into_iter().flat_map(encode).collect();
        let volume = file.labels().unwrap();
        assert_eq!(volume.values(), [0, 1, 7, 120], "datatype {datatype}");
        assert_eq!(volume.labels(), [0, 1, 3, 2], "datatype {datatype}");
        let image = scratch(&file.bytes(), read_intensities).unwrap();
        assert_eq!(image.values(), [0.0, 1.0, 120.0, 7.0], "datatype {datatype}");
    }
}

#[test]
fn large_integers_stay_exact() {
    let mut file = File::small();
    let odd = (1i64 << 53) + 1;
    let voxels = [0, odd, odd - 1, i64::MIN];
    file.typed(1024, 64).data = voxels.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(file.labels().unwrap().values(), [0, i64::MIN, odd - 1, odd]);
    file.typed(1280, 64).data =
        [0, 0, u64::MAX, 0].iter().flat_map(|v: &u64| v.to_le_bytes()).collect();
    assert!(matches!(file.error().problem(), ImageError::VoxelValue { voxel: [0, 1, 0], .. }));
}

#[test]
fn scale_is_applied_to_intensities() {
    let mut file = File::small();
    file.f32(112, 0.5).f32(116, -10.0);
    let image = scratch(&file.bytes(), read_intensities).unwrap();
    assert_eq!(image.values(), [-10.0, -9.5, -9.0, -9.5]);
    assert_eq!(image.get(0, 1, 0), Some(-9.0));
    for unset in [0.0, f32::NAN, f32::INFINITY] {
        file.f32(112, unset);
        let image = scratch(&file.bytes(), read_intensities).unwrap();
        assert_eq!(image.values(), [0.0, 1.0, 2.0, 1.0]);
    }
    file.f32(112, 2.0).f32(116, f32::NAN);
    assert_says(&file.error(), &["scl_inter", "NaN"]);
}

#[test]
fn scaled_labels_must_stay_integers() {
    let mut file = File::small();
    file.f32(112, 3.0).f32(116, -3.0);
    let volume = file.labels().unwrap();
    // −3, 0, 3, 0.
    assert_eq!((volume.values(), volume.labels()), (&[0, -3, 3][..], &[1, 0, 2, 0][..]));
    file.f32(112, 0.5).f32(116, 0.0);
    let error = file.error();
    assert!(matches!(error.problem(), ImageError::VoxelValue { voxel: [1, 0, 0], .. }));
    assert_says(&error, &["(1, 0, 0)", "0.5", "integer"]);
}

#[test]
fn nothing_but_background_is_read() {
    let volume = File::new([2, 1, 1], &[0, 0]).labels().unwrap();
    assert_eq!((volume.bounding_box(), volume.values()), (None, &[0][..]));
}

#[test]
fn trailing_dimensions_of_one_are_fine_others_not() {
    for rank in 3..=7 {
        let mut file = File::small();
        assert_eq!(file.i16(40, rank).labels().unwrap().labels(), [0, 1, 2, 1]);
    }
    let mut file = File::small();
    file.i16(40, 5).i16(48, 4).i16(50, 3);
    let error = file.error();
    assert!(matches!(error.problem(), ImageError::NotThreeDimensional { rank: 5, count: 12, .. }));
    assert_says(&error, &["12 volumes"]);
}
