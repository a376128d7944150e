//! Files whose structure or streams are broken.

use yawara_mesh::ImageError;
use yawara_mesh::image::{DicomError, read_dicom};

use super::encoders::{jpeg_lossless, rle};
use super::syntaxes::RAMP;
use super::writer::*;
use super::{SMALL, assert_says, dicom, error, small, values};

/// The error of a file of these bytes.
fn of(bytes: Vec<u8>) -> ImageError {
    error(&Folder::new(&[("slice.dcm", bytes)]))
}

/// Where the bytes occur first.
fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|window| window == what).unwrap()
}

#[test]
fn every_truncation_is_an_error() {
    for syntax in [IMPLICIT, EXPLICIT, BIG_ENDIAN, DEFLATED] {
        let [a, b, c] = small().map(|file| file.syntax(syntax).bytes());
        for length in 0..b.len() {
            let folder = Folder::new(&[
                ("a.dcm", a.clone()),
                ("b.dcm", b[..length].to_vec()),
                ("c.dcm", c.clone()),
            ]);
            // Two slices of three would make a series, wherever the cut lies.
            let Err(error) = read_dicom(folder.path()) else {
                panic!("{syntax}: read with {length} of {} bytes", b.len());
            };
            assert_says(&error, &["b.dcm"]);
        }
        assert_eq!(values(Folder::new(&[("a", a), ("b", b), ("c", c)]).path()), SMALL);
    }
}

#[test]
fn every_truncation_of_a_stream_is_an_error() {
    let file = small()[0].clone();
    let pixels: [u16; 4] = [0, 1, 2, 3];
    let streams = [
        (RLE, rle(&[0, 1, 2, 3], 2), "RLE", file.clone()),
        (JPEG_LOSSLESS, jpeg_lossless(&pixels, 2, 2, 16), "JPEG", file),
        (JPEG_2000, RAMP.to_vec(), "JPEG 2000", File::slice(0, 40, 36, &[0; 1440])),
    ];
    for (syntax, stream, name, file) in streams {
        let read = |length: usize| {
            let second = file.clone().text(POSITION, dicom_core::VR::DS, "0\\0\\2");
            let slices = [&file, &second]
                .map(|f| f.clone().fragments(syntax, vec![stream[..length].into()]));
            read_dicom(Folder::of(&slices).path())
        };
        assert!(read(stream.len()).is_ok(), "{name}");
        // The last bytes are padding or end markers, which decoders may do without.
        for length in (2..stream.len() - 4).step_by(2) {
            match read(length) {
                Err(error) => assert_says(&error, &["frame 1", name]),
                Ok(_) => panic!("{name}: read from {length} of {} bytes", stream.len()),
            }
        }
    }
}

#[test]
fn elements_beyond_the_end_are_refused_by_place() {
    let whole = small()[0].bytes();
    let cut = of(whole[..whole.len() - 2].to_vec());
    assert!(matches!(dicom(&cut), DicomError::Structure { .. }), "{cut}");
    assert_says(&cut, &["slice.dcm", "(7FE0,0010)", "8 bytes announced, 6 left"]);
    // A length of 4 GiB.
    let mut forged = whole.clone();
    let at = find(&forged, &[0xe0, 0x7f, 0x10, 0, b'O', b'W']) + 8;
    forged[at..at + 4].copy_from_slice(&0xffff_fff0u32.to_le_bytes());
    assert_says(&of(forged), &["(7FE0,0010)", "4294967280 bytes announced, 8 left"]);
    let mut forged = whole.clone();
    let at = find(&forged, &[0x28, 0, 0x10, 0, b'U', b'S']) + 4;
    forged[at] = b'u';
    let error = of(forged);
    assert_says(&error, &["(0028,0010)", "\"uS\"", "capital letters"]);
    assert_says(&error, &[&format!("byte {at}")]);
    // No transfer syntax.
    let mut forged = whole;
    let at = find(&forged, &[2, 0, 0x10, 0, b'U', b'I']);
    forged[at + 2] = 0x11;
    assert_says(&of(forged), &["no TransferSyntaxUID (0002,0010)"]);
}

#[test]
fn deep_nesting_takes_no_stack() {
    let mut bytes = small()[0].bytes();
    let at = find(&bytes, &[0x28, 0, 2, 0, b'U', b'S']);
    // A sequence of undefined length, and an item of undefined length in it.
    let level = [
        [0x20, 0, 0x13, 0x91].as_slice(),
        b"SQ\0\0\xff\xff\xff\xff",
        &[0xfe, 0xff, 0, 0xe0, 0xff, 0xff, 0xff, 0xff],
    ]
    .concat();
    bytes.splice(at..at, level.repeat(100_000));
    assert_says(&of(bytes), &["(0020,9113)", "33 deep", "at most 32"]);
}

#[test]
fn deflated_data_that_are_damaged_are_refused() {
    let mut bytes = small()[0].clone().syntax(DEFLATED).bytes();
    let last = bytes.len() - 1;
    let start = last - 20;
    bytes[start..last].fill(0xff);
    let error = of(bytes);
    assert_says(&error, &["slice.dcm"]);
}

#[test]
fn streams_of_another_size_are_refused() {
    let refused = |syntax, stream: Vec<u8>, words: &[&str]| {
        let slices = [0, 1].map(|z| small()[z].clone().fragments(syntax, vec![stream.clone()]));
        let error = error(&Folder::of(&slices));
        assert!(matches!(dicom(&error), DicomError::Frame { frame: 1, .. }), "{error}");
        assert_says(&error, words);
    };
    refused(RLE, rle(&[0, 1, 2], 2), &["RLE", "3 pixels in segment 1", "want 4"]);
    refused(RLE, rle(&[0; 4], 1), &["RLE", "1 segments", "want 2"]);
    let mut bad = rle(&[0; 4], 2);
    bad[8] = 200;
    refused(RLE, bad, &["RLE", "segment 1", "offsets"]);
    refused(RLE, vec![2, 0, 0, 0], &["4 bytes", "at least 64"]);
    refused(JPEG_LOSSLESS, jpeg_lossless(&[7; 6], 3, 2, 16), &["JPEG", "3×2 pixels", "2×2"]);
    refused(JPEG_LOSSLESS, vec![0; 40], &["JPEG"]);
    refused(JPEG_2000, RAMP.into(), &["JPEG 2000", "40×36 pixels", "2×2"]);
    refused(JPEG_2000, vec![0; 40], &["FF4F"]);
    // Two pixels of a colour image have as many bytes.
    let mut colour = Vec::new();
    jpeg_encoder::Encoder::new(&mut colour, 90)
        .encode(&[0; 12], 2, 2, jpeg_encoder::ColorType::Rgb)
        .unwrap();
    colour.resize(colour.len().next_multiple_of(2), 0);
    refused(JPEG_BASELINE, colour, &["JPEG", "RGB24", "one component"]);
}

#[test]
fn codestreams_that_announce_too_much_are_refused() {
    let refused = |at: usize, bytes: &[u8], words: &[&str]| {
        let mut stream = RAMP.to_vec();
        stream[at..at + bytes.len()].copy_from_slice(bytes);
        let slices = [0, 1]
            .map(|z| File::slice(z, 40, 36, &[0; 1440]).fragments(JPEG_2000, vec![stream.clone()]));
        assert_says(&error(&Folder::of(&slices)), words);
    };
    // Tiles of one pixel each: as many tiles as pixels.
    refused(24, &[0, 0, 0, 1, 0, 0, 0, 1], &["1440 tiles", "1 to 22"]);
    refused(24, &[0, 0, 0, 0], &["0 tiles"]);
    refused(40, &[0, 3], &["3 components"]);
    refused(42, &[31], &["32 bits", "up to 16"]);
    // 65 535 layers of quality.
    let coding = find(RAMP, &[0xff, 0x52]);
    refused(coding + 6, &[0xff, 0xff], &["393210 packets", "at most"]);
    refused(coding + 9, &[33], &["33 decompositions"]);
    // Precincts of 2 × 2 pixels in place of the next marker: 20 · 18 of them in the last
    // resolution, and in those before 10 · 9, 5 · 5, 3 · 3, 2 · 2, 1.
    let mut small = RAMP[coding..coding + 14].to_vec();
    small[3] += 6;
    small[4] = 1;
    small.extend([0x11; 6]);
    refused(coding, &small, &["489 packets", "at most 314"]);
}

/// Whatever its name. Of an empty file only the name can tell that it was a slice.
#[test]
fn one_damaged_slice_of_a_series_is_named() {
    let [a, b, c] = small().map(|slice| slice.bytes());
    let cases = [("slice", b.len() - 1), ("slice", b.len() / 2), ("slice", 132), ("slice.dcm", 0)];
    for (name, length) in cases {
        let cut = b[..length].to_vec();
        let folder = Folder::new(&[("1", a.clone()), (name, cut), ("3", c.clone())]);
        assert_says(&error(&folder), &[&format!("/{name}: ")]);
    }
}
