//! What the stored bits stand for.

use dicom_core::VR;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};

use super::writer::*;
use super::{SMALL, assert_says, error, small, values};

#[test]
fn signs_and_spare_bits_are_taken_as_declared() {
    // 12 bits stored, at the bottom or at the top, the spare ones full of something else.
    let read = |high: u16, signed: bool, pixels: [u16; 4]| {
        let pixels = pixels.map(|pixel| pixel as i16);
        let slices = [0, 1].map(|z| File::slice(z, 2, 2, &pixels).bits(16, 12, high, signed));
        let mut read = values(Folder::of(&slices).path());
        read.truncate(4);
        read.reverse();
        read
    };
    let low = [0x0fff, 0xf800, 0x57ff, 0xa001];
    assert_eq!(read(11, true, low), [-1.0, -2048.0, 2047.0, 1.0]);
    assert_eq!(read(11, false, low), [4095.0, 2048.0, 2047.0, 1.0]);
    let high = [0xfff0, 0x800f, 0x7ff5, 0x001a];
    assert_eq!(read(15, true, high), [-1.0, -2048.0, 2047.0, 1.0]);
    assert_eq!(read(15, false, high), [4095.0, 2048.0, 2047.0, 1.0]);
    assert_eq!(read(13, false, [0x3ffc, 0xc003, 4, 0x0aa8]), [4095.0, 0.0, 1.0, 682.0]);
}

#[test]
fn extremes_of_every_type_are_read() {
    let cases: [(u16, bool, [i64; 2]); 6] = [
        (8, false, [0, 255]),
        (8, true, [-128, 127]),
        (16, false, [0, 65_535]),
        (16, true, [-32_768, 32_767]),
        (32, false, [0, 4_294_967_295]),
        (32, true, [-2_147_483_648, 2_147_483_647]),
    ];
    for (bits, signed, [low, high]) in cases {
        let bytes = usize::from(bits / 8);
        let pixels: Vec<u8> =
            [low, high].iter().flat_map(|value| value.to_le_bytes()[..bytes].to_vec()).collect();
        let slices = [0, 1].map(|z| {
            let file = File::slice(z, 1, 2, &[0; 2]).bits(bits, bits, bits - 1, signed);
            file.bytes_of_pixels(VR::OW, pixels.clone())
        });
        let mut want = vec![0, low, high];
        want.sort();
        want.dedup();
        want.retain(|&label| label != 0);
        want.insert(0, 0);
        let volume = read_labels(Folder::of(&slices).path()).unwrap();
        assert_eq!(volume.values(), want, "{bits} {signed}");
    }
}

#[test]
fn values_are_rescaled_to_hounsfield_units() {
    let scaled = |z: usize, slope: &str, intercept: &str| {
        small()[z].clone().text(SLOPE, VR::DS, slope).text(INTERCEPT, VR::DS, intercept)
    };
    let slices = [0, 1, 2].map(|z| scaled(z, "2.5", "-1024"));
    let want = SMALL.map(|value| 2.5 * value - 1024.0);
    assert_eq!(values(Folder::of(&slices).path()), want);
    // Each slice by its own.
    let slices = [scaled(0, "1", "-1024"), scaled(1, "0.5", "-10"), scaled(2, " -4 ", "+1.0E2")];
    let mut want = SMALL;
    for (i, value) in want.iter_mut().enumerate() {
        *value = match i / 4 {
            0 => *value - 1024.0,
            1 => 0.5 * *value - 10.0,
            _ => -4.0 * *value + 100.0,
        };
    }
    let folder = Folder::of(&slices);
    assert_eq!(values(folder.path()), want);
    // 5 · 0.5 − 10 is no label.
    let error = read_labels(folder.path()).unwrap_err();
    assert!(matches!(error.problem(), ImageError::VoxelValue { value: -7.5, .. }), "{error}");
    // An intercept alone.
    let slices = small().map(|file| file.text(INTERCEPT, VR::DS, "7"));
    assert_eq!(values(Folder::of(&slices).path()), SMALL.map(|value| value + 7.0));
    // Types may differ where the values do not.
    let mut slices = small();
    slices[1] = slices[1].clone().bits(16, 16, 15, false);
    assert_eq!(values(Folder::of(&slices).path()), SMALL);
}

#[test]
fn values_beyond_f32_are_refused() {
    let slices = small().map(|file| file.text(SLOPE, VR::DS, "1e300"));
    let error = read_intensities(Folder::of(&slices).path()).unwrap_err();
    assert!(matches!(error.problem(), ImageError::VoxelValue { .. }), "{error}");
}

#[test]
fn odd_lengths_and_padding_are_read() {
    let file = |z, vr, pixels: &[u8]| {
        let file = File::slice(z, 5, 1, &[0; 5]).bits(8, 8, 7, false);
        file.bytes_of_pixels(vr, pixels.into())
    };
    // 5 bytes of pixels, which the writer pads to 6, or with 2 bytes more.
    for pixels in [&[1, 2, 3, 4, 5][..], &[1, 2, 3, 4, 5, 99, 99]] {
        for syntax in [EXPLICIT, BIG_ENDIAN] {
            let slices = [0, 1].map(|z| file(z, VR::OB, pixels).syntax(syntax));
            let read = values(Folder::of(&slices).path());
            let want = [5.0, 4.0, 3.0, 2.0, 1.0];
            assert_eq!(read, [want, want].concat(), "{pixels:?} {syntax}");
        }
    }
    let words = [0, 1].map(|z| file(z, VR::OW, &[2, 1, 4, 3, 0, 5]).syntax(BIG_ENDIAN));
    assert_eq!(values(Folder::of(&words).path())[..5], [5.0, 4.0, 3.0, 2.0, 1.0]);
    // As many bytes as two frames contradict the header.
    let slices = [0, 1].map(|z| file(z, VR::OB, &[5; 10]));
    assert_says(&error(&Folder::of(&slices)), &["PixelData (7FE0,0010) has 10 bytes, want 5"]);
}
