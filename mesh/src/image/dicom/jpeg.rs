//! Frames in JPEG: baseline, extended of 8 bits, lossless.

use std::panic::{AssertUnwindSafe, catch_unwind};

use jpeg_decoder::{Decoder, PixelFormat};

use super::format::{Cells, Format, Refusal};

/// Decodes a frame of as many pixels as the format has.
pub(super) fn decode(bytes: &[u8], format: &Format) -> Result<Cells, Refusal> {
    // The decoder panics on some damaged data; it holds nothing that could be left broken.
    catch_unwind(AssertUnwindSafe(|| decode_checked(bytes, format)))
        .unwrap_or_else(|_| Err(Refusal::new("a stream that its decoder can't follow", "JPEG")))
}

fn decode_checked(bytes: &[u8], format: &Format) -> Result<Cells, Refusal> {
    let refuse = |error: jpeg_decoder::Error| Refusal::new(error, "a whole JPEG stream");
    let mut decoder = Decoder::new(bytes);
    decoder.read_info().map_err(refuse)?;
    let (columns, rows) = (format.columns, format.rows);
    let want = format!("{columns}×{rows} pixels of one component, up to {} bits", format.allocated);
    let Some(info) = decoder.info() else { return Err(Refusal::new("no frame", want)) };
    let bytes_per_pixel = match info.pixel_format {
        PixelFormat::L8 => 1,
        PixelFormat::L16 => 2,
        other => return Err(Refusal::new(format!("pixels as {other:?}"), want)),
    };
    if [info.width, info.height] != [columns, rows] || bytes_per_pixel > format.allocated / 8 {
        let bits = 8 * bytes_per_pixel;
        let found = format!("{}×{} pixels of {bits} bits", info.width, info.height);
        return Err(Refusal::new(found, want));
    }
    let pixels = decoder.decode().map_err(refuse)?;
    let cells: Vec<u32> = match bytes_per_pixel {
        1 => pixels.iter().map(|&byte| byte.into()).collect(),
        _ => pixels.as_chunks().0.iter().map(|b| u16::from_ne_bytes(*b).into()).collect(),
    };
    if cells.len() != format.pixels() {
        return Err(Refusal::new(format!("{} pixels", cells.len()), want));
    }
    Ok(Cells { cells, bits: format.stored, shift: format.shift })
}
