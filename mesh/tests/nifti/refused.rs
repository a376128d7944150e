//! Files that are no single, whole, real 3-D NIfTI-1 image.

use tempfile::TempDir;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};

use crate::file::{File, assert_says, gzip, scratch};

#[test]
fn voxels_that_are_no_label_or_not_finite_are_named() {
    for bad in [0.25f32, f32::NAN, f32::INFINITY, 1e30] {
        let mut file = File::small();
        file.typed(16, 32).data =
            [0.0, 1.0, 2.0, bad].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_says(&file.error(), &["(1, 1, 0)", &f64::from(bad).to_string()]);
        let image = scratch(&file.bytes(), read_intensities);
        match image {
            Ok(image) => assert!(bad.is_finite() && image.values()[3] == bad),
            Err(error) => {
                assert!(!bad.is_finite());
                assert_says(&error, &["(1, 1, 0)", "finite"]);
            }
        }
    }
    let mut file = File::small();
    file.typed(64, 64).data =
        [0.0, 1e300, 0.0, 0.0].iter().flat_map(|v: &f64| v.to_le_bytes()).collect();
    let error = scratch(&file.bytes(), read_intensities).unwrap_err();
    assert!(matches!(error.problem(), ImageError::VoxelValue { voxel: [1, 0, 0], .. }));
}

#[test]
fn too_many_labels_are_refused() {
    let side = 41i16; // 41³ = 68 921 different values
    let count = (side as usize).pow(3);
    let mut file = File::new([side; 3], &[]);
    file.typed(8, 32).data = (0..count as i32).flat_map(i32::to_le_bytes).collect();
    assert!(matches!(file.error().problem(), ImageError::TooManyLabels { limit: 65535, .. }));
}

#[test]
fn bad_spacings_are_refused_even_with_a_valid_sform() {
    for (at, name) in [(80, "pixdim[1]"), (84, "pixdim[2]"), (88, "pixdim[3]")] {
        for bad in [0.0, -2.0, f32::NAN, f32::INFINITY] {
            let mut file = File::small();
            assert_says(&file.f32(at, bad).error(), &[name, &bad.to_string()]);
        }
    }
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = TempDir::new().unwrap();
    let missing = folder.path().join("missing.nii");
    let error = read_labels(&missing).unwrap_err();
    assert!(matches!(error.problem(), ImageError::Io(_)));
    assert_says(&error, &["missing.nii", "No such file"]);
}

// With its reader a directory may be a DICOM series, and is refused as an empty one.
#[cfg(not(feature = "dicom"))]
#[test]
fn a_directory_is_refused() {
    let folder = TempDir::new().unwrap();
    let error = read_labels(folder.path()).unwrap_err();
    assert!(matches!(error.problem(), ImageError::NotAFile(_)));
    assert_says(&error, &["directory", ".nii"]);
}

#[test]
fn what_is_no_nifti_is_refused() {
    assert!(matches!(scratch(b"", read_labels).unwrap_err().problem(), ImageError::EmptyFile));
    let texts: [&[u8]; 3] = [b"x", b"# not an image\n", &[0x89; 5000]];
    for text in texts {
        let error = scratch(text, read_labels).unwrap_err();
        assert!(
            matches!(error.problem(), ImageError::NotNifti { field: "sizeof_hdr", .. }),
            "{error}"
        );
        let error = scratch(&gzip(text), read_labels).unwrap_err();
        assert!(
            matches!(error.problem(), ImageError::NotNifti { field: "sizeof_hdr", .. }),
            "{error}"
        );
    }
    let mut file = File::small();
    assert_says(&file.put(0, 540i32.to_le_bytes()).error(), &["header takes 540 bytes"]);
    let mut second = File::small().second();
    second[10] = b' ';
    let error = scratch(&second, read_labels).unwrap_err();
    assert_says(&error, &["magic is \"n+2\\x00\\r\\n \\n\", want \"n+2\\x00\\r\\n\\x1a\\n\""]);
    second[4..12].copy_from_slice(b"ni2\0\r\n\x1a\n");
    let error = scratch(&second, read_labels).unwrap_err();
    assert!(matches!(error.problem(), ImageError::HeaderPair));
    for dim in [-1, 0, 1 << 33, i64::MAX] {
        let mut second = File::small().second();
        second[24..32].copy_from_slice(&dim.to_le_bytes());
        assert_says(&scratch(&second, read_labels).unwrap_err(), &["organ.nii"]);
    }
    let mut file = File::small();
    let error = file.put(344, *b"\0\0\0\0").error();
    assert!(matches!(error.problem(), ImageError::NotNifti { field: "magic", .. }));
    let mut file = File::small();
    let error = file.put(344, *b"ni1\0").error();
    assert!(matches!(error.problem(), ImageError::HeaderPair));
    assert_says(&error, &[".hdr/.img", "convert"]);
}

#[test]
fn files_of_the_wrong_length_are_refused() {
    let whole = File::new([2, 2, 2], &[1; 8]).bytes();
    assert_eq!(whole.len(), 352 + 16);
    for length in [348, 351, 352, 367] {
        let error = scratch(&whole[..length], read_labels).unwrap_err();
        assert!(matches!(error.problem(), ImageError::Length { want: 16, .. }), "{length}");
        assert!(scratch(&gzip(&whole[..length]), read_labels).is_err(), "{length}");
    }
    let error = scratch(&whole[..200], read_labels).unwrap_err();
    assert!(
        matches!(error.problem(), ImageError::Length { part: "header", found: 200, .. }),
        "{error}"
    );
    let error = scratch(&gzip(&whole[..360]), read_labels).unwrap_err();
    assert!(matches!(error.problem(), ImageError::Length { found: 8, want: 16, .. }), "{error}");
    let long = [&whole[..], &[0]].concat();
    for bytes in [gzip(&long), long] {
        let error = scratch(&bytes, read_labels).unwrap_err();
        assert!(matches!(error.problem(), ImageError::TooLong { want: 16, .. }), "{error}");
    }
}

#[test]
fn damaged_gzip_streams_are_refused() {
    let intact = gzip(&File::new([2, 2, 2], &[1; 8]).bytes());
    for length in 2..intact.len() {
        assert!(scratch(&intact[..length], read_labels).is_err(), "cut at {length}");
    }
    // The checksum stands in the last 8 bytes.
    let mut damaged = intact.clone();
    damaged[intact.len() - 6] ^= 1;
    let error = scratch(&damaged, read_labels).unwrap_err();
    assert!(matches!(error.problem(), ImageError::Inflate(_)), "{error}");
    let followed = [&intact[..], b"more"].concat();
    let error = scratch(&followed, read_labels).unwrap_err();
    assert!(matches!(error.problem(), ImageError::Inflate(_)), "{error}");
}

#[test]
fn no_bit_of_a_gzip_stream_flips_unnoticed() {
    let voxels: Vec<i16> = (0..512).map(|v| (v / 7) % 5).collect();
    let file = File::new([8, 8, 8], &voxels);
    let (intact, volume) = (gzip(&file.bytes()), file.labels().unwrap());
    // Name, time and system of the packed file may be anything, and another way to say the same voxels,
    // such as a repetition that begins earlier, is no damage.
    let mut accepted = 0;
    for bit in 0..8 * intact.len() {
        let mut flipped = intact.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(other) = scratch(&flipped, read_labels) {
            assert_eq!(other, volume, "bit {bit}");
            assert!(bit / 8 < intact.len() - 8, "bit {bit} is in the sum or the length");
            accepted += usize::from(bit / 8 >= 10);
        }
    }
    assert!(accepted < 8 * intact.len() / 20, "{accepted} bits of the stream");
}

#[test]
fn absurd_dims_are_refused_before_allocation() {
    let mut file = File::small();
    file.i16(42, 30000).i16(44, 30000).i16(46, 30000).data = vec![0; 48];
    assert_eq!(file.bytes().len(), 400);
    let error = file.error();
    assert!(matches!(
        error.problem(),
        ImageError::TooManyVoxels { dims: [30000, 30000, 30000], .. }
    ));
    assert_says(&error, &["27000000000000", "2147483648"]);
    // Within the limit, but 16 GiB of float64 that are not there: neither form allocates them.
    file.i16(42, 32767).i16(44, 32767).i16(46, 2).typed(64, 64);
    assert!(matches!(file.error().problem(), ImageError::Length { found: 48, .. }));
    let error = scratch(&gzip(&file.bytes()), read_labels).unwrap_err();
    assert!(matches!(error.problem(), ImageError::Length { found: 48, .. }), "{error}");
    for (at, name) in [(42, "dim[1]"), (44, "dim[2]"), (46, "dim[3]")] {
        for bad in [0, -5, i16::MIN] {
            let mut file = File::small();
            assert_says(&file.i16(at, bad).error(), &[name, &bad.to_string()]);
        }
    }
    for bad in [-1, 0, 1, 2, 8, i16::MAX] {
        let mut file = File::small();
        assert_says(&file.i16(40, bad).error(), &["dim[0]", &bad.to_string()]);
    }
    let mut file = File::small();
    assert_says(&file.i16(40, 4).i16(48, 0).error(), &["dim[4]"]);
}

#[test]
fn bad_offsets_are_refused() {
    for bad in [0.0, 351.0, 352.5, -352.0, 1e30, f32::NAN, f32::INFINITY] {
        let mut file = File::small();
        assert_says(&file.f32(108, bad).error(), &["vox_offset", "352"]);
    }
    let mut file = File::small();
    file.f32(108, 100_000.0);
    assert!(matches!(file.error().problem(), ImageError::Length { found: 0, .. }));
    let error = scratch(&gzip(&file.bytes()), read_labels).unwrap_err();
    assert_says(&error, &["vox_offset"]);
}

#[test]
fn unsupported_types_are_refused_by_name() {
    let names = [
        (0, "unknown"),
        (1, "binary"),
        (32, "complex64"),
        (128, "RGB24"),
        (1536, "float128"),
        (1792, "complex128"),
        (2048, "complex256"),
        (2304, "RGBA32"),
        (77, "unknown"),
    ];
    for (datatype, name) in names {
        let mut file = File::small();
        let error = file.typed(datatype, 64).error();
        assert!(
            matches!(error.problem(), ImageError::Datatype { code, .. } if *code == i64::from(datatype))
        );
        assert_says(&error, &[name, &datatype.to_string()]);
    }
    let mut file = File::small();
    assert_says(&file.typed(4, 32).error(), &["bitpix", "32", "16", "int16"]);
}
