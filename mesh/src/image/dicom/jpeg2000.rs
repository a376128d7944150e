//! Frames in JPEG 2000, reversible or not; the headers of their codestreams are checked before the
//! decoder allocates what they say.

use std::panic::{AssertUnwindSafe, catch_unwind};

use jpeg2k::{DecodeParameters, Image};

use super::format::{Cells, Format, Refusal};

/// Start of codestream, then image and tile size.
const START: &[u8] = &[0xff, 0x4f, 0xff, 0x51];

const CODING: u16 = 0xff52;
const COMPONENT_CODING: u16 = 0xff53;
const TILE: u16 = 0xff90;
const DATA: u16 = 0xff93;
const END: u16 = 0xffd9;

/// Bytes that a tile takes at least: its start and the start of its data.
const TILE_BYTES: u64 = 14;

/// Decodes a frame of as many pixels as the format has; its bits are those of the codestream.
pub(super) fn decode(bytes: &[u8], format: &Format) -> Result<Cells, Refusal> {
    // The standard wants the bare codestream; some writers put it in a JP2 file all the same.
    let start = bytes.windows(4).position(|four| four == START).unwrap_or(0);
    let bytes = &bytes[start..];
    check(bytes, format)?;
    let parameters = DecodeParameters::new().strict(true);
    let damaged = || Refusal::new("a stream that its decoder can't follow", "JPEG 2000");
    // The decoder panics on some damaged data; it holds nothing that could be left broken.
    let image = catch_unwind(AssertUnwindSafe(|| Image::from_bytes_with(bytes, parameters)))
        .map_err(|_| damaged())?
        .map_err(|error| Refusal::new(error, "a whole JPEG 2000 stream"))?;
    let [component] = image.components() else { return Err(damaged()) };
    let size = [component.width(), component.height()];
    let bits = component.precision();
    if size != [format.columns.into(), format.rows.into()]
        || !(1..=format.allocated).contains(&bits)
    {
        return Err(damaged());
    }
    // Negative numbers keep their low bits, from which the sign is found again.
    let cells = component.data().iter().map(|&value| value as u32).collect();
    Ok(Cells { cells, bits, shift: 0 })
}

/// Whether the headers announce the format's image, no more tiles and no more packets than the
/// bytes can hold: a packet takes one byte at least.
///
/// Source: ISO/IEC 15444-1, annex A.
fn check(bytes: &[u8], format: &Format) -> Result<(), Refusal> {
    let reader = Reader { bytes };
    if !bytes.starts_with(START) {
        return Err(Refusal::new("no codestream", "one that starts with FF4F FF51"));
    }
    reader.check_size(format)?;
    let mut layers = 1;
    let mut at = 2;
    // Where the current tile part ends, by its head.
    let mut part_end = bytes.len();
    loop {
        let marker = reader.u16(at)?;
        match marker {
            END => return Ok(()),
            DATA => {
                // The rest of the part is packets.
                if part_end >= bytes.len() {
                    return Ok(());
                }
                at = part_end;
                continue;
            }
            TILE => {
                let length = reader.u32(at + 6)? as usize;
                part_end = match length {
                    // Up to the end of the codestream.
                    0 => bytes.len(),
                    _ if length < TILE_BYTES as usize => {
                        let found = format!("a tile part of {length} bytes");
                        return Err(Refusal::new(found, format!("at least {TILE_BYTES}")));
                    }
                    _ => at.saturating_add(length),
                };
            }
            CODING => {
                layers = u64::from(reader.u16(at + 6)?);
                reader.check_packets(at + 4, at + 9, layers, format)?;
            }
            COMPONENT_CODING => reader.check_packets(at + 5, at + 6, layers, format)?,
            _ => {}
        }
        at += 2 + usize::from(reader.u16(at + 2)?.max(2));
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], Refusal> {
        let bytes = self.bytes.get(at..).and_then(|rest| rest.first_chunk());
        bytes.copied().ok_or_else(|| {
            let found = format!("{} bytes", self.bytes.len());
            Refusal::new(found, format!("whole headers, at least {} bytes", at + N))
        })
    }

    fn u16(&self, at: usize) -> Result<u16, Refusal> {
        self.array(at).map(u16::from_be_bytes)
    }

    fn u32(&self, at: usize) -> Result<u32, Refusal> {
        self.array(at).map(u32::from_be_bytes)
    }

    fn check_size(&self, format: &Format) -> Result<(), Refusal> {
        let mut fields = [0u64; 8];
        for (i, field) in fields.iter_mut().enumerate() {
            *field = self.u32(8 + 4 * i)?.into();
        }
        let [x1, y1, x0, y0, tile_x, tile_y, tile_x0, tile_y0] = fields;
        let (columns, rows) = (x1.saturating_sub(x0), y1.saturating_sub(y0));
        let components = self.u16(40)?;
        let [depth, step_x, step_y] = self.array(42)?;
        let bits = u32::from(depth & 0x7f) + 1;
        if [columns, rows] != [format.columns.into(), format.rows.into()]
            || [components, step_x.into(), step_y.into()] != [1, 1, 1]
            || bits > format.allocated
        {
            let found = format!("{columns}×{rows} pixels, {components} components of {bits} bits");
            let (columns, rows, bits) = (format.columns, format.rows, format.allocated);
            return Err(Refusal::new(found, format!("{columns}×{rows}, 1, up to {bits}")));
        }
        let count = |end: u64, start: u64, tile: u64| end.saturating_sub(start).div_ceil(tile);
        let limit = self.bytes.len() as u64 / TILE_BYTES;
        let empty = tile_x == 0 || tile_y == 0 || tile_x0 > x0 || tile_y0 > y0;
        let tiles = if empty { 0 } else { count(x1, tile_x0, tile_x) * count(y1, tile_y0, tile_y) };
        if tiles == 0 || tiles > limit {
            return Err(Refusal::new(format!("{tiles} tiles"), format!("1 to {limit}")));
        }
        Ok(())
    }

    /// Checks the packets by the style of coding at `style` and its parameters.
    fn check_packets(
        &self,
        style: usize,
        parameters: usize,
        layers: u64,
        format: &Format,
    ) -> Result<(), Refusal> {
        let [style] = self.array(style)?;
        let [levels] = self.array(parameters)?;
        if levels > 32 {
            return Err(Refusal::new(format!("{levels} decompositions"), "at most 32"));
        }
        let levels = usize::from(levels);
        let mut packets = 0u64;
        for resolution in 0..=levels {
            let [exponents] = match style & 1 {
                1 => self.array(parameters + 5 + resolution)?,
                _ => [0xff],
            };
            let halvings = (levels - resolution) as u32;
            let count = |size: u16, exponent: u8| {
                u64::from(size).div_ceil(1 << halvings).div_ceil(1 << exponent)
            };
            packets += count(format.columns, exponents & 15) * count(format.rows, exponents >> 4);
        }
        let (packets, limit) = (packets.saturating_mul(layers), self.bytes.len() as u64);
        if packets > limit {
            return Err(Refusal::new(format!("{packets} packets"), format!("at most {limit}")));
        }
        Ok(())
    }
}
