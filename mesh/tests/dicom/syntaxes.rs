//! The same voxels in every transfer syntax.

use dicom_core::VR;

use super::encoders::{jpeg_lossless, rle, rle_literal};
use super::writer::*;
use super::{SMALL, small, values};

/// Reads [`small`], each slice changed by its number.
fn changed(change: impl Fn(File, i16) -> File) -> Vec<f32> {
    let slices = [0, 1, 2].map(|z| change(small()[z].clone(), 4 * z as i16));
    values(Folder::of(&slices).path())
}

fn words(first: i16) -> Vec<u32> {
    (first..first + 4).map(|value| u32::from(value as u16)).collect()
}

#[test]
fn uncompressed_syntaxes_are_read() {
    for syntax in [IMPLICIT, EXPLICIT, BIG_ENDIAN, DEFLATED] {
        assert_eq!(changed(|file, _| file.syntax(syntax)), SMALL, "{syntax}");
    }
}

#[test]
fn numbers_of_8_and_32_bits_are_read_in_their_byte_order() {
    for signed in [false, true] {
        for syntax in [IMPLICIT, EXPLICIT, DEFLATED] {
            let bytes = changed(|file, first| {
                let pixels = (first..first + 4).map(|value| value as u8).collect();
                file.bits(8, 8, 7, signed).bytes_of_pixels(VR::OW, pixels).syntax(syntax)
            });
            assert_eq!(bytes, SMALL, "{syntax}");
            let long = changed(|file, first| {
                let pixels = words(first).iter().flat_map(|word| word.to_le_bytes()).collect();
                file.bits(32, 32, 31, signed).bytes_of_pixels(VR::OW, pixels).syntax(syntax)
            });
            assert_eq!(long, SMALL, "{syntax}");
        }
    }
    // Bytes stand in words whose second byte comes first, or as bytes.
    let big = |vr, order: [i16; 4]| {
        changed(|file, first| {
            let pixels = order.iter().map(|value| (first + value) as u8).collect();
            file.bits(8, 8, 7, false).bytes_of_pixels(vr, pixels).syntax(BIG_ENDIAN)
        })
    };
    assert_eq!(big(VR::OW, [1, 0, 3, 2]), SMALL);
    assert_eq!(big(VR::OB, [0, 1, 2, 3]), SMALL);
}

#[test]
fn run_lengths_are_read() {
    type Encoder = fn(&[u32], usize) -> Vec<u8>;
    for encode in [rle as Encoder, rle_literal as Encoder] {
        for (allocated, bytes) in [(8, 1), (16, 2), (32, 4)] {
            let read = changed(|file, first| {
                file.bits(allocated, allocated, allocated - 1, true)
                    .fragments(RLE, vec![encode(&words(first), bytes)])
            });
            assert_eq!(read, SMALL, "{allocated}");
        }
    }
    // Long runs, literals and negative numbers.
    let pixels: Vec<i16> = (0..20 * 30).map(|i| if i < 400 { -3 } else { 50 * i as i16 }).collect();
    let stored: Vec<u32> = pixels.iter().map(|&pixel| u32::from(pixel as u16)).collect();
    for encode in [rle as Encoder, rle_literal as Encoder] {
        let slices = [0, 1]
            .map(|z| File::slice(z, 20, 30, &pixels).fragments(RLE, vec![encode(&stored, 2)]));
        let read = values(Folder::of(&slices).path());
        let mut want: Vec<f32> = pixels.iter().map(|&pixel| f32::from(pixel)).collect();
        want.reverse();
        assert_eq!(read, [want.clone(), want].concat());
    }
}

#[test]
fn jpeg_lossless_is_read() {
    for (precision, signed) in [(16, true), (16, false), (12, false), (8, false)] {
        let read = changed(|file, first| {
            let pixels: Vec<u16> = words(first).iter().map(|&word| word as u16).collect();
            file.bits(16, precision, precision - 1, signed)
                .fragments(JPEG_LOSSLESS, vec![jpeg_lossless(&pixels, 2, 2, precision as u8)])
        });
        assert_eq!(read, SMALL, "{precision}");
    }
    // All differences that 16 bits allow, and signs.
    let pixels: Vec<i16> = (0..40 * 30).map(|i| (i * i * 37 - 20_000) as i16).collect();
    let stored: Vec<u16> = pixels.iter().map(|&pixel| pixel as u16).collect();
    let fragment = jpeg_lossless(&stored, 40, 30, 16);
    // A frame may go over several fragments.
    let (a, b) = fragment.split_at(fragment.len() / 4 * 2);
    let slices = [0, 1].map(|z| {
        File::slice(z, 40, 30, &pixels).fragments(JPEG_LOSSLESS, vec![a.into(), b.into()])
    });
    let mut want: Vec<f32> = pixels.iter().map(|&pixel| f32::from(pixel)).collect();
    want.reverse();
    assert_eq!(values(Folder::of(&slices).path()), [want.clone(), want].concat());
}

#[test]
fn jpeg_baseline_is_read() {
    // Blocks of one value have a constant term alone, which quality 100 keeps exactly.
    let pixels: Vec<u8> = (0..16 * 8).map(|i| if i % 16 < 8 { 40 } else { 200 }).collect();
    let mut stream = Vec::new();
    jpeg_encoder::Encoder::new(&mut stream, 100)
        .encode(&pixels, 16, 8, jpeg_encoder::ColorType::Luma)
        .unwrap();
    stream.resize(stream.len().next_multiple_of(2), 0);
    let slices = [0, 1].map(|z| {
        let file = File::slice(z, 16, 8, &[0; 128]).bits(8, 8, 7, false);
        file.fragments(JPEG_BASELINE, vec![stream.clone()])
    });
    let mut want: Vec<f32> = pixels.iter().map(|&pixel| f32::from(pixel)).collect();
    want.reverse();
    assert_eq!(values(Folder::of(&slices).path()), [want.clone(), want].concat());
}

/// 40 × 36 pixels of 37 column + 11 row² − 1000 as signed 16 bits, written by OpenJPEG 2.5
/// without loss.
pub const RAMP: &[u8] = include_bytes!("data/ramp_40x36_i16.j2k");

fn ramp() -> Vec<f32> {
    (0..40 * 36).map(|i| (37 * (i % 40) + 11 * (i / 40) * (i / 40) - 1000) as f32).collect()
}

#[test]
fn jpeg_2000_is_read() {
    let mut want = ramp();
    want.reverse();
    let want = [want.clone(), want].concat();
    let file = |z| File::slice(z, 40, 36, &[0; 1440]);
    let slices = [0, 1].map(|z| file(z).fragments(JPEG_2000, vec![RAMP.into()]));
    assert_eq!(values(Folder::of(&slices).path()), want);
    // Some writers wrap the codestream in a JP2 file.
    let wrapped = [b"\0\0\0\x0cjP  \r\n\x87\n\0\0\0\0jp2c", RAMP].concat();
    let slices = [0, 1].map(|z| file(z).fragments(JPEG_2000, vec![wrapped.clone()]));
    assert_eq!(values(Folder::of(&slices).path()), want);
}
