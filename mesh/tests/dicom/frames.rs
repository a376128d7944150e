//! Files of several frames.

use dicom_core::{Tag, VR};
use dicom_object::InMemDicomObject;

use super::encoders::rle;
use super::writer::*;
use super::{SMALL, assert_says, error, values};

const SHARED: Tag = Tag(0x5200, 0x9229);
const PER_FRAME: Tag = Tag(0x5200, 0x9230);
const PLANE_POSITION: Tag = Tag(0x0020, 0x9113);
const PLANE_ORIENTATION: Tag = Tag(0x0020, 0x9116);
const MEASURES: Tag = Tag(0x0028, 0x9110);
const TRANSFORMATION: Tag = Tag(0x0028, 0x9145);

/// An enhanced image of the slices `order` of the small series, as its frames.
fn enhanced(order: &[i16], scale: impl Fn(i16) -> Option<[String; 2]>) -> File {
    let mut shared = InMemDicomObject::new_empty();
    // For frames without their own; the image's own counts for none that a group speaks of.
    shared.put(group(TRANSFORMATION, item(vec![(SLOPE, "1"), (INTERCEPT, "0")])));
    shared.put(group(PLANE_ORIENTATION, item(vec![(ORIENTATION, "1\\0\\0\\0\\1\\0")])));
    shared.put(group(MEASURES, item(vec![(SPACING, "2\\2")])));
    let frames = order.iter().map(|&z| {
        let mut frame = InMemDicomObject::new_empty();
        let position = format!("0\\0\\{}", 2 * z);
        frame.put(group(PLANE_POSITION, item(vec![(POSITION, &position)])));
        if let Some([slope, intercept]) = scale(z) {
            let values = item(vec![(SLOPE, &slope), (INTERCEPT, &intercept)]);
            frame.put(group(TRANSFORMATION, values));
        }
        frame
    });
    let pixels: Vec<i16> = order.iter().flat_map(|z| 4 * z..4 * z + 4).collect();
    let rows = 2 * order.len() as u16;
    File::slice(0, 2, rows, &pixels)
        .number(ROWS, 2)
        .text(SLOPE, VR::DS, "5")
        .without(POSITION)
        .without(ORIENTATION)
        .without(SPACING)
        .text(FRAMES, VR::IS, &order.len().to_string())
        .sequence(SHARED, vec![shared])
        .sequence(PER_FRAME, frames.collect())
}

fn plain(order: &[i16]) -> File {
    enhanced(order, |_| None)
}

#[test]
fn frames_are_slices_in_any_order() {
    for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
        for syntax in [IMPLICIT, EXPLICIT, BIG_ENDIAN, DEFLATED] {
            let folder = Folder::new(&[("enhanced", plain(&order).syntax(syntax).bytes())]);
            assert_eq!(values(folder.path()), SMALL, "{order:?} {syntax}");
            assert_eq!(values(&folder.file("enhanced")), SMALL);
        }
    }
    // Parts of a concatenation, interleaved, and a slice of its own.
    let parts = Folder::of(&[plain(&[2, 0]), plain(&[1])]);
    assert_eq!(values(parts.path()), SMALL);
}

#[test]
fn frames_are_scaled_one_by_one() {
    let scale = |z: i16| Some([format!("{}", z + 1), format!("{}", -100 * z)]);
    let folder = Folder::new(&[("enhanced", enhanced(&[1, 0, 2], scale).bytes())]);
    let mut want = SMALL;
    for (i, value) in want.iter_mut().enumerate() {
        let z = (i / 4) as f32;
        *value = (z + 1.0) * *value - 100.0 * z;
    }
    assert_eq!(values(folder.path()), want);
}

#[test]
fn compressed_frames_are_found_by_fragments_or_offsets() {
    let order = [1i16, 2, 0];
    let stored: Vec<Vec<u8>> = order
        .iter()
        .map(|z| rle(&(4 * z..4 * z + 4).map(|v| v as u32).collect::<Vec<_>>(), 2))
        .collect();
    let read = |file: File| values(Folder::new(&[("enhanced", file.bytes())]).path());
    assert_eq!(read(plain(&order).fragments(RLE, stored.clone())), SMALL);
    // The second frame in two fragments; each has a head of 8 bytes.
    let (a, b) = stored[1].split_at(66);
    let parts = vec![stored[0].clone(), a.into(), b.into(), stored[2].clone()];
    let first = 8 + stored[0].len() as u32;
    let table = vec![0, first, first + 16 + stored[1].len() as u32];
    assert_eq!(read(plain(&order).offsets(RLE, table.clone(), parts.clone())), SMALL);
    // The same by the extended table.
    let extended: Vec<u8> = table.iter().flat_map(|&at| u64::from(at).to_le_bytes()).collect();
    let file = plain(&order).offsets(RLE, vec![], parts.clone());
    let file =
        file.put(Tag(0x7fe0, 0x0001), VR::OV, dicom_core::PrimitiveValue::U8(extended.into()));
    assert_eq!(read(file), SMALL);
    for bad in [vec![], vec![0, first], vec![0, first, first + 2], vec![0, 0, first]] {
        let file = plain(&order).offsets(RLE, bad, parts.clone());
        let folder = Folder::new(&[("enhanced", file.bytes())]);
        assert_says(&error(&folder), &["PixelData (7FE0,0010)", "4 fragments for 3 frames"]);
    }
}

#[test]
fn frames_without_places_are_refused() {
    let refused = |file: File, words: &[&str]| {
        let folder = Folder::new(&[("enhanced", file.bytes())]);
        assert_says(&error(&folder), words);
    };
    let good = plain(&[0, 1, 2]);
    refused(good.clone().without(PER_FRAME), &["NumberOfFrames (0028,0008) is 3", "(5200,9230)"]);
    let fewer = good.clone().text(FRAMES, VR::IS, "2").words(&[0; 8]);
    refused(fewer, &["(5200,9230)", "3 items", "one per frame"]);
    refused(good.clone().text(FRAMES, VR::IS, "0"), &["(0028,0008) is 0", "≥ 1"]);
    refused(good.clone().text(FRAMES, VR::IS, "x"), &["(0028,0008)", "\"x\"", "≥ 1"]);
    refused(good.clone().without(SHARED), &["no ImageOrientationPatient (0020,0037)"]);
    refused(plain(&[0, 1, 1]), &["enhanced, frame 3", "enhanced, frame 2", "0.0000 mm"]);
    refused(plain(&[0, 1, 2, 4]), &["1 slices are missing", "frame 3", "frame 4", "4.0000 mm"]);
    // One frame more than there are pixels for.
    let short = good.clone().words(&[0; 8]);
    refused(short, &["PixelData (7FE0,0010) has 16 bytes, want 24"]);
}
