//! The frames of a file's pixel data, and the numbers in them.

use super::cursor::Element;
use super::data_set::DataSet;
use super::error::DicomError;
use super::file::Codec;
use super::format::{Cells, Format, Refusal};
use super::tag::{OFFSETS, PIXELS};
use super::{jpeg, jpeg2000, rle};
use crate::image::voxels::Voxels;

/// Pixels that a compressed frame may have, however few bytes it takes.
const MIN_CLAIM: u64 = 1 << 22;

/// Pixels that one compressed byte may stand for beyond that: an even background takes next to
/// nothing in JPEG 2000.
const PIXELS_PER_BYTE: u64 = 4096;

/// The stored frames of a file.
pub(super) struct Frames<'a> {
    codec: Codec,
    pixels: Element<'a>,
    /// Of each frame, where they are compressed.
    fragments: Vec<Vec<&'a [u8]>>,
}

impl<'a> Frames<'a> {
    /// The frames of an image whose header was checked.
    pub fn of(data: &DataSet<'a>, codec: Codec, count: usize) -> Result<Self, DicomError> {
        let pixels = *data.require(PIXELS)?;
        let fragments = if codec == Codec::Raw { vec![] } else { fragments(data, count, &pixels)? };
        Ok(Self { codec, pixels, fragments })
    }

    /// Decodes one frame, counted from 0.
    pub fn decode(&self, format: &Format, frame: usize) -> Result<Cells, DicomError> {
        let decode = match self.codec {
            Codec::Raw => return Ok(self.raw(format, frame)),
            Codec::Jpeg => jpeg::decode,
            Codec::Jpeg2000 => jpeg2000::decode,
            Codec::Rle | Codec::Unread(_) => rle::decode,
        };
        decode(&self.fragments[frame].concat(), format).map_err(|Refusal { found, want }| {
            DicomError::Frame { frame: frame + 1, codec: self.codec.name(), found, want }
        })
    }

    /// An uncompressed frame; there are as many bytes as the header announces.
    fn raw(&self, format: &Format, frame: usize) -> Cells {
        let Element { bytes: all, encoding, vr, .. } = self.pixels;
        let length = format.frame_bytes();
        let start = frame * length;
        let bytes = &all[start..start + length];
        let cells = match format.allocated {
            // Bytes of pixels stand in words of two, in big endian the second one first.
            8 if encoding.big_endian && &vr == b"OW" => {
                (start..start + length).map(|at| u32::from(all[at ^ 1])).collect()
            }
            8 => bytes.iter().map(|&byte| u32::from(byte)).collect(),
            16 => bytes.as_chunks().0.iter().map(|&b| encoding.u16(b).into()).collect(),
            _ => bytes.as_chunks().0.iter().map(|&b| encoding.u32(b)).collect(),
        };
        Cells { cells, bits: format.stored, shift: format.shift }
    }
}

/// Checks that compressed frames are there, and large enough for so many pixels.
pub(super) fn check_compressed(
    data: &DataSet,
    format: &Format,
    count: usize,
    pixels: &Element,
) -> Result<(), DicomError> {
    for frame in fragments(data, count, pixels)? {
        let bytes = frame.iter().map(|fragment| fragment.len() as u64).sum();
        let limit = MIN_CLAIM.max(PIXELS_PER_BYTE.saturating_mul(bytes));
        let pixels = format.pixels() as u64;
        if pixels > limit {
            return Err(DicomError::FrameClaim { pixels, bytes, limit });
        }
    }
    Ok(())
}

/// The fragments of each frame: all of them, one each, or by the offset table.
fn fragments<'a>(
    data: &DataSet<'a>,
    count: usize,
    pixels: &Element<'a>,
) -> Result<Vec<Vec<&'a [u8]>>, DicomError> {
    if !pixels.delimited {
        let want = "fragments, as the transfer syntax says";
        return Err(PIXELS.refuse("of a stated length", want));
    }
    let items = data.fragments(pixels)?;
    let Some((table, fragments)) = items.split_first().filter(|(_, rest)| rest.len() >= count)
    else {
        let value = format!("{} fragments for {count} frames", items.len().saturating_sub(1));
        return Err(PIXELS.refuse(value, "at least one fragment per frame"));
    };
    if count == 1 {
        return Ok(vec![fragments.to_vec()]);
    }
    if fragments.len() == count {
        return Ok(fragments.iter().map(|&fragment| vec![fragment]).collect());
    }
    let offsets: Vec<u64> = match data.get(OFFSETS) {
        Some(table) => table.bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b)).collect(),
        None => table.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b).into()).collect(),
    };
    let mut frames: Vec<Vec<&[u8]>> = Vec::new();
    let mut at = 0;
    for &fragment in fragments {
        if offsets.get(frames.len()) == Some(&at) {
            frames.push(vec![]);
        }
        if let Some(frame) = frames.last_mut() {
            frame.push(fragment);
        }
        // Each fragment has a head of 8 bytes.
        at += 8 + fragment.len() as u64;
    }
    if frames.len() != count || offsets.len() != count {
        let value = format!("{} fragments for {count} frames", fragments.len());
        let want = "one fragment per frame, or a table of offsets that starts a frame each";
        return Err(PIXELS.refuse(value, want));
    }
    Ok(frames)
}

/// Adds the numbers of a frame to the voxels, which have the type of the format.
pub(super) fn append(voxels: &mut Voxels, format: &Format, frame: &Cells) {
    let Cells { cells, bits, shift } = frame;
    let spare = 32 - bits;
    let unsigned = |cell: &u32| (cell >> shift) << spare >> spare;
    // An arithmetic shift brings the sign down from the number's highest bit.
    let signed = |cell: &u32| (((cell >> shift) << spare) as i32) >> spare;
    match voxels {
        Voxels::U8(voxels) => voxels.extend(cells.iter().map(|cell| unsigned(cell) as u8)),
        Voxels::I8(voxels) => voxels.extend(cells.iter().map(|cell| signed(cell) as i8)),
        Voxels::U16(voxels) => voxels.extend(cells.iter().map(|cell| unsigned(cell) as u16)),
        Voxels::I16(voxels) => voxels.extend(cells.iter().map(|cell| signed(cell) as i16)),
        Voxels::U32(voxels) => voxels.extend(cells.iter().map(unsigned)),
        Voxels::I32(voxels) => voxels.extend(cells.iter().map(signed)),
        // Slices that are scaled one by one.
        Voxels::F64(voxels) if format.signed => {
            voxels.extend(cells.iter().map(signed).map(f64::from))
        }
        Voxels::F64(voxels) => voxels.extend(cells.iter().map(unsigned).map(f64::from)),
        Voxels::U64(_) | Voxels::I64(_) | Voxels::F32(_) => {}
    }
}
