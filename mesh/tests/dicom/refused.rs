//! Series and headers that make no volume, each refused by file, element, value and limit.

use dicom_core::{Tag, VR};
use yawara_mesh::ImageError;
use yawara_mesh::image::{DicomError, read_dicom};

use super::writer::*;
use super::{SMALL, assert_says, dicom, error, error_at, mesh_error, small, values};

/// The error of the small series with its second slice changed.
fn changed(change: impl Fn(File) -> File) -> ImageError {
    let [a, b, c] = small();
    // Of three slices, the second has the third name.
    let folder = Folder::of(&[a, change(b), c]);
    error(&folder)
}

/// The error of the small series with every slice changed.
fn all_changed(change: impl Fn(File) -> File) -> ImageError {
    error(&Folder::of(&small().map(change)))
}

#[test]
fn several_series_are_listed_and_one_file_chooses() {
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for (i, file) in small().iter().enumerate() {
        let description = Tag(0x0008, 0x103e);
        let thin = file.clone().series("1.2.9").text(description, VR::LO, "thin");
        files.push((format!("a{i}"), file.bytes()));
        files.push((format!("b{i}"), thin.bytes()));
    }
    files.pop();
    let files: Vec<(&str, Vec<u8>)> =
        files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
    let folder = Folder::new(&files);
    let several = error(&folder);
    assert!(matches!(dicom(&several), DicomError::SeveralSeries { count: 2, .. }));
    assert_says(
        &several,
        &["2 series", "1.2.3 (CT \"\", 3 files, as a0)", "1.2.9 (CT \"thin\", 2 files, as b0)"],
    );
    assert_says(&several, &["SeriesInstanceUID", "give one file"]);
    assert_eq!(values(&folder.file("a1")), SMALL);
    assert_eq!(values(&folder.file("b1")), SMALL[..8]);
    // Only the first of very many.
    let files: Vec<(String, Vec<u8>)> = (0..12)
        .map(|i| (format!("{i}"), small()[0].clone().series(&format!("1.{i}")).bytes()))
        .collect();
    let files: Vec<(&str, Vec<u8>)> =
        files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
    assert_says(&error(&Folder::new(&files)), &["12 series", "4 others"]);
}

#[test]
fn what_is_no_image_is_left_out() {
    let report = File::slice(0, 1, 1, &[0])
        .text(SOP_CLASS, VR::UI, "1.2.840.10008.5.1.4.1.1.88.22")
        .without(ROWS)
        .without(PIXELS)
        .series("1.2.77");
    let [a, b, c] = small().map(|file| file.bytes());
    let folder = Folder::new(&[
        ("a", a.clone()),
        ("b", b),
        ("c", c),
        ("report", report.bytes()),
        ("DICOMDIR.txt", b"notes".to_vec()),
        ("empty", vec![]),
        (".hidden.dcm", b"no image".to_vec()),
    ]);
    std::fs::create_dir(folder.file("d.dcm")).unwrap();
    assert_eq!(values(folder.path()), SMALL);
    // By their names these would be slices.
    for bytes in [vec![], b"notes".to_vec(), vec![7; 300]] {
        let folder = Folder::new(&[("a", a.clone()), ("z.DCM", bytes)]);
        let error = error(&folder);
        assert!(matches!(dicom(&error), DicomError::NotDicom(_)));
        assert_says(&error, &["z.DCM", "\"DICM\""]);
    }
    // A slice without pixels is cut short.
    let folder = Folder::new(&[("a", small()[0].clone().without(PIXELS).without(ROWS).bytes())]);
    assert!(matches!(dicom(&error(&folder)), DicomError::MissingTag(_)));
    let nothing = Folder::new(&[("report", report.bytes()), ("notes", b"x".to_vec())]);
    let error = error(&nothing);
    assert!(matches!(dicom(&error), DicomError::NoImages { files: 2, other: 1, .. }), "{error}");
    let error = read_dicom(&nothing.file("notes")).unwrap_err();
    assert_says(&error, &["notes", "not a DICOM file", "missing (1 bytes in all)"]);
    let error = error_at(&nothing, &nothing.file("report"));
    assert_says(&error, &["no PixelData (7FE0,0010)"]);
}

#[test]
fn uneven_stacks_are_refused() {
    let at = |z: [f64; 5]| {
        let slices =
            z.map(|z| File::slice(0, 1, 1, &[1]).text(POSITION, VR::DS, &decimals(&[0.0, 0.0, z])));
        error(&Folder::of(&slices))
    };
    let gap = at([0.0, 2.0, 4.0, 10.0, 12.0]);
    assert!(
        matches!(dicom(&gap), DicomError::MissingSlices { missing: 2, gap_mm: 6.0, .. }),
        "{gap}"
    );
    // The third and the fourth slice in order, by names that say nothing.
    assert_says(&gap, &["IM0004", "IM0001", "6.0000 mm", "2.0000 mm"]);
    let twice = at([0.0, 2.0, 4.0, 4.005, 6.0]);
    assert!(matches!(dicom(&twice), DicomError::SamePosition { .. }), "{twice}");
    assert_says(&twice, &["IM0004", "IM0001", "0.0050 mm", "0.0100 mm"]);
    let uneven = at([0.0, 2.0, 4.5, 6.0, 8.0]);
    assert!(matches!(dicom(&uneven), DicomError::UnevenSlices { .. }), "{uneven}");
    assert_says(&uneven, &["IM0004", "0.5000 mm", "0.0300 mm"]);
    let one = error(&Folder::of(&small()[..1]));
    assert_says(&one, &["1.2.3", "1 slice", "at least 2"]);
    let aside = changed(|file| file.text(POSITION, VR::DS, "0.5\\0\\2"));
    assert!(matches!(dicom(&aside), DicomError::ShiftedSlice { .. }), "{aside}");
    assert_says(&aside, &["IM0001", "0.5000 mm", "0.0300 mm"]);
}

#[test]
fn a_tilted_gantry_is_refused() {
    // tan 20° = 0.36397: slices go 0.72794 mm to the back per 2 mm up.
    let tilted = |part: f64| {
        let slices = [0, 1, 2].map(|z| {
            let z = f64::from(z);
            let position = decimals(&[0.0, part * 2.0 * 0.363_970_234 * z, 2.0 * z]);
            File::slice(0, 1, 1, &[1]).text(POSITION, VR::DS, &position)
        });
        Folder::of(&slices)
    };
    let error = error(&tilted(1.0));
    assert!(matches!(dicom(&error), DicomError::GantryTilt { .. }), "{error}");
    assert_says(&error, &["20.000°", "0.057°", "gantry tilt"]);
    let tilted_little = tilted(0.0027);
    assert_eq!(values(tilted_little.path()), [1.0; 3]);
    assert!(matches!(dicom(&super::error(&tilted(0.0028))), DicomError::GantryTilt { .. }));
}

#[test]
fn slices_that_differ_are_refused() {
    let cases = [
        changed(|file| file.number(ROWS, 1).words(&[1, 2])),
        changed(|file| file.number(COLUMNS, 1).words(&[1, 2])),
        changed(|file| file.text(ORIENTATION, VR::DS, "0.999\\0.0447\\0\\-0.0447\\0.999\\0")),
        changed(|file| file.text(SPACING, VR::DS, "2\\2.001")),
    ];
    let names = ["Rows", "Columns", "ImageOrientationPatient", "PixelSpacing"];
    let values = ["is 1, but 2", "is 1, but 2", "0.0447", "2\\2.001, but 2\\2"];
    for ((error, name), value) in cases.iter().zip(names).zip(values) {
        assert!(matches!(dicom(error), DicomError::Differs { .. }), "{error}");
        assert_says(error, &["IM0001", "IM0000", name, value]);
    }
}

#[test]
fn headers_out_of_range_are_refused() {
    let number = |tag, value| changed(move |file| file.number(tag, value));
    let text = |tag, value| changed(move |file| file.text(tag, VR::DS, value));
    for (error, words) in [
        (number(ROWS, 0), ["Rows (0028,0010) is 0", "1 to 65535"]),
        (number(COLUMNS, 0), ["Columns (0028,0011) is 0", "1 to 65535"]),
        (number(ALLOCATED, 12), ["BitsAllocated (0028,0100) is 12", "8, 16 or 32"]),
        (number(ALLOCATED, 1), ["BitsAllocated (0028,0100) is 1", "8, 16 or 32"]),
        (number(STORED, 0), ["BitsStored (0028,0101) is 0", "1 to"]),
        (number(STORED, 17), ["BitsStored (0028,0101) is 17", "1 to"]),
        (number(HIGH_BIT, 16), ["HighBit (0028,0102) is 16", "BitsStored"]),
        (number(HIGH_BIT, 14), ["HighBit (0028,0102) is 14", "BitsStored"]),
        (number(SIGNED, 2), ["PixelRepresentation (0028,0103) is 2", "0 or 1"]),
        (number(SAMPLES, 3), ["SamplesPerPixel (0028,0002) is 3", "colour"]),
        (text(PHOTOMETRIC, "PALETTE COLOR"), ["PALETTE COLOR", "MONOCHROME2"]),
        (text(POSITION, "0\\0"), ["(0020,0032) is \"0\\0\"", "three numbers"]),
        (text(POSITION, "0\\0\\nan"), ["(0020,0032) is \"0\\0\\nan\"", "three numbers"]),
        (text(POSITION, "0\\0\\inf"), ["(0020,0032) is \"0\\0\\inf\"", "three numbers"]),
        (text(POSITION, "0\\0\\2e6"), ["(0020,0032) is 2000000", "1e6"]),
        (text(ORIENTATION, "1\\0\\0\\0\\2\\0"), ["(0020,0037) is 1\\0\\0\\0\\2\\0", "length 1"]),
        (text(ORIENTATION, "1\\0\\0\\1\\0\\0"), ["(0020,0037)", "right angles"]),
        (text(ORIENTATION, "0\\0\\0\\0\\0\\0"), ["(0020,0037)", "length 1"]),
        (text(SPACING, "2\\0"), ["PixelSpacing (0028,0030) is 0", "> 0"]),
        (text(SPACING, "2\\-2"), ["PixelSpacing (0028,0030) is -2", "> 0"]),
        (text(SPACING, "2\\2\\2"), ["PixelSpacing (0028,0030) is \"2\\2\\2\"", "two numbers"]),
        (text(SLOPE, "0"), ["RescaleSlope (0028,1053) is 0", "other than 0"]),
        (text(SLOPE, "NaN"), ["RescaleSlope (0028,1053) is \"NaN\"", "finite"]),
        (text(INTERCEPT, "1e999"), ["RescaleIntercept (0028,1052) is \"1e999\"", "finite"]),
    ] {
        assert_says(&error, &words);
        assert_says(&error, &["IM0001"]);
    }
    let long = changed(|file| file.text(ROWS, VR::LO, "2222"));
    assert_says(&long, &["Rows (0028,0010) is 4 bytes long", "2 bytes"]);
}

#[test]
fn missing_elements_are_named() {
    for (tag, name) in [
        (SERIES, "SeriesInstanceUID (0020,000E)"),
        (POSITION, "ImagePositionPatient (0020,0032)"),
        (ORIENTATION, "ImageOrientationPatient (0020,0037)"),
        (SPACING, "PixelSpacing (0028,0030)"),
        (ROWS, "Rows (0028,0010)"),
        (COLUMNS, "Columns (0028,0011)"),
        (SAMPLES, "SamplesPerPixel (0028,0002)"),
        (ALLOCATED, "BitsAllocated (0028,0100)"),
        (STORED, "BitsStored (0028,0101)"),
        (SIGNED, "PixelRepresentation (0028,0103)"),
        (PIXELS, "PixelData (7FE0,0010)"),
    ] {
        let error = changed(|file| file.without(tag));
        assert!(matches!(dicom(&error), DicomError::MissingTag(_)), "{error}");
        assert_says(&error, &["IM0001", name]);
        // An empty value is none.
        let error = changed(|file| file.put(tag, VR::LO, dicom_core::PrimitiveValue::Empty));
        assert_says(&error, &["IM0001", name]);
    }
    let implied = Folder::of(&small().map(|file| file.without(HIGH_BIT)));
    assert_eq!(values(implied.path()), SMALL);
}

#[test]
fn other_kinds_of_images_are_refused_by_name() {
    let segmentation = "1.2.840.10008.5.1.4.1.1.66.4";
    let error = all_changed(|file| file.text(SOP_CLASS, VR::UI, segmentation));
    assert_says(&error, &["SOPClassUID (0008,0016)", "segmentation", "NIfTI"]);
    let floats = Tag(0x7fe0, 0x0008);
    let error = all_changed(|file| {
        let pixels = dicom_core::PrimitiveValue::F32(vec![1.0; 4].into());
        file.without(PIXELS).put(floats, VR::OF, pixels)
    });
    assert_says(&error, &["FloatPixelData (7FE0,0008)", "integers"]);
    let table = item(vec![(SPACING, "1")]);
    let error = all_changed(|file| file.sequence(Tag(0x0028, 0x3000), vec![table.clone()]));
    assert_says(&error, &["ModalityLUTSequence (0028,3000)", "slope"]);
    let error = all_changed(|file| {
        let pixels = vec![0; 16];
        file.bits(32, 32, 31, true).bytes_of_pixels(VR::OW, pixels).syntax(BIG_ENDIAN)
    });
    assert_says(&error, &["BitsAllocated (0028,0100) is 32", "big endian"]);
}

/// A slice whose header names another transfer syntax.
fn with_syntax(file: &File, uid: &str) -> Vec<u8> {
    let mut bytes = file.bytes();
    let at = bytes.windows(EXPLICIT.len()).position(|w| w == EXPLICIT.as_bytes()).unwrap();
    let [old, new] = [EXPLICIT, uid].map(|uid| uid.len().next_multiple_of(2));
    let padded: Vec<u8> = uid.bytes().chain([0]).take(new).collect();
    bytes.splice(at..at + old, padded);
    bytes[at - 2] = new as u8;
    // The group's length.
    bytes[140] = (usize::from(bytes[140]) + new - old) as u8;
    bytes
}

#[test]
fn transfer_syntaxes_that_are_not_read_are_named() {
    let [a, b, c] = small().map(|file| file.bytes());
    for (uid, name) in [
        ("1.2.840.10008.1.2.1.98", "encapsulated uncompressed"),
        ("1.2.840.10008.1.2.4.80", "JPEG-LS"),
        ("1.2.840.10008.1.2.4.81", "JPEG-LS"),
        ("1.2.840.10008.1.2.4.110", "JPEG XL"),
        ("1.2.840.10008.1.2.4.201", "High-Throughput JPEG 2000"),
        ("1.2.840.10008.1.2.4.102", "video"),
        ("1.2.840.10008.1.2.77", "unknown"),
        ("1.2.8", "unknown"),
    ] {
        let bytes = with_syntax(&small()[0].clone().series("1.2.4"), uid);
        let folder = Folder::new(&[("x", bytes.clone())]);
        let error = error(&folder);
        assert!(matches!(dicom(&error), DicomError::TransferSyntax { .. }), "{error}");
        assert_says(&error, &[uid, name, "gdcmconv"]);
        // Beside a series that can be read it does no harm.
        let files = [("a", a.clone()), ("b", b.clone()), ("c", c.clone()), ("x", bytes)];
        if name != "unknown" {
            assert_eq!(values(&Folder::new(&files).file("b")), SMALL);
        }
    }
}

#[test]
fn shears_within_a_slice_are_left_to_the_header_check() {
    // 0.05° is within the 0.001 of both checks.
    let turned = "1\\0\\0\\0.0008\\0.99999968\\0";
    let slices = small().map(|file| file.text(ORIENTATION, VR::DS, turned));
    assert_eq!(values(Folder::of(&slices).path()), SMALL);
}

#[test]
fn forged_counts_are_refused_before_allocation() {
    let folder = |file: File| Folder::new(&[("a", file.bytes())]);
    let one = || small()[0].clone();
    let forged = folder(one().number(ROWS, 65_535).number(COLUMNS, 65_535));
    let error = mesh_error(&forged, forged.path());
    assert!(matches!(error.problem(), ImageError::TooManyVoxels { .. }), "{error}");
    let forged = folder(one().number(ROWS, 30_000).number(COLUMNS, 60_000));
    assert_says(&super::error(&forged), &["has 8 bytes", "want 3600000000"]);
    let forged = folder(one().text(FRAMES, VR::IS, "2000000000"));
    let error = mesh_error(&forged, forged.path());
    assert!(matches!(error.problem(), ImageError::TooManyVoxels { .. }), "{error}");
    let forged = folder(one().text(FRAMES, VR::IS, "500000000"));
    assert_says(&super::error(&forged), &["has 8 bytes", "want 4000000000"]);
    for syntax in [RLE, JPEG_LOSSLESS, JPEG_2000] {
        let file = one().number(ROWS, 30_000).number(COLUMNS, 60_000);
        let forged = folder(file.fragments(syntax, vec![vec![0; 100]]));
        let error = super::error(&forged);
        assert!(matches!(dicom(&error), DicomError::FrameClaim { .. }), "{error}");
        assert_says(&error, &["1800000000 pixels", "100 compressed bytes", "4194304"]);
        let file = one().text(FRAMES, VR::IS, "500000000");
        let forged = folder(file.fragments(syntax, vec![vec![0; 100]]));
        assert_says(&super::error(&forged), &["1 fragments for 500000000 frames"]);
        let forged = folder(one().fragments(syntax, vec![]));
        assert_says(&super::error(&forged), &["0 fragments for 1 frames"]);
    }
}
