//! A run as a page that plays it without a server.

use std::io::Write;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::json;

use super::page_files::alone;
use super::painter::Painter;
use super::player::{snapshot, standing};
use crate::SimError;
use crate::output::write_file;
use crate::playback::Run;

/// Writes a run to `path` as one page that plays it without a server and without a network.
///
/// Displacements of surfaces are in 16 bits: rounded by at most half of the largest one over 32767, which is
/// returned, mm; all else in 32-bit floats. The same run gives the same bytes. Cost: O(all frames).
///
/// # Errors
/// As [`Run::frame`]; [`SimError::Io`] if the file can't be written: what stood there is still there then.
pub fn write_html(run: &Run, path: &Path) -> Result<f64, SimError> {
    let io = |source| SimError::Io(path.into(), source);
    let mut painter = Painter::default();
    let mut pictures = Vec::with_capacity(run.frame_count());
    let mut quantum_mm = 0.0;
    for number in 0..run.frame_count() {
        let snapshot = snapshot(run, number)?;
        quantum_mm = snapshot.quantum_mm;
        let picture = painter.paint(snapshot)?;
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
        // Pictures are shown in any order.
        let with_rest = number == 0 || !run.has_one_surface();
        packed.write_all(&picture.encode_alone(with_rest)).map_err(io)?;
        pictures.push(STANDARD.encode(packed.finish().map_err(io)?));
    }
    let recording = json!({ "state": standing(run), "pictures": pictures });
    write_file(path, alone(&recording.to_string()))?;
    Ok(0.5 * quantum_mm)
}
