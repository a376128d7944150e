//! Frames in JPEG 2000, reversible or not.

use std::panic::{AssertUnwindSafe, catch_unwind};

use jpeg2k::{DecodeParameters, Image};

use super::codestream;
use super::format::{Cells, Format, Refusal};

/// Decodes a frame of as many pixels as the format has; its bits are those of the codestream.
pub(super) fn decode(bytes: &[u8], format: &Format) -> Result<Cells, Refusal> {
    // The standard wants the bare codestream; some writers put it in a JP2 file all the same.
    let start = bytes.windows(4).position(|four| four == codestream::START).unwrap_or(0);
    let bytes = &bytes[start..];
    codestream::check(bytes, format)?;
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
