//! Run-length encoded frames: one segment of PackBits per byte of a pixel, highest byte first.

use super::format::{Cells, Format, Refusal};

/// Number of segments and fifteen offsets.
const HEADER: usize = 64;

/// Decodes a frame of as many pixels as the format has.
///
/// Source: DICOM PS3.5, annex G.
pub(super) fn decode(bytes: &[u8], format: &Format) -> Result<Cells, Refusal> {
    let header = bytes.get(..HEADER).ok_or_else(|| {
        Refusal::new(format!("{} bytes", bytes.len()), format!("at least {HEADER}, its header"))
    })?;
    let words: Vec<usize> =
        header.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word) as usize).collect();
    let want = (format.allocated / 8) as usize;
    if words[0] != want {
        let found = format!("{} segments", words[0]);
        return Err(Refusal::new(found, format!("{want}, the bytes of a pixel")));
    }
    let mut cells = vec![0; format.pixels()];
    for segment in 1..=want {
        let start = words[segment];
        let end = if segment < want { words[segment + 1] } else { bytes.len() };
        let packed = bytes.get(start..end).filter(|_| start >= HEADER).ok_or_else(|| {
            let found = format!("segment {segment} from byte {start} to {end}");
            Refusal::new(found, format!("offsets rising from {HEADER} to {}", bytes.len()))
        })?;
        let found = unpack(packed, &mut cells);
        if found < cells.len() {
            let found = format!("{found} pixels in segment {segment}");
            return Err(Refusal::new(found, cells.len()));
        }
    }
    Ok(Cells { cells, bits: format.stored, shift: format.shift })
}

/// Shifts the unpacked bytes into the cells from below; how many there were.
fn unpack(mut packed: &[u8], cells: &mut [u32]) -> usize {
    let mut at = 0;
    let mut push = |at: &mut usize, byte: u8| {
        if let Some(cell) = cells.get_mut(*at) {
            *cell = *cell << 8 | u32::from(byte);
            *at += 1;
        }
    };
    while let Some((&head, rest)) = packed.split_first() {
        packed = rest;
        match head as i8 {
            // Nothing, by the standard.
            i8::MIN => {}
            count @ 0.. => {
                let literal = &packed[..packed.len().min(count as usize + 1)];
                literal.iter().for_each(|&byte| push(&mut at, byte));
                packed = &packed[literal.len()..];
            }
            count => {
                let Some((&byte, rest)) = packed.split_first() else { break };
                packed = rest;
                (0..=-i32::from(count)).for_each(|_| push(&mut at, byte));
            }
        }
    }
    at
}
