//! The upload of a whole C, in pieces.

use faer::MatRef;

use super::device_store::DeviceStore;
use crate::GpuError;
use crate::kernels::{TILE, TILE_AREA, before, tile_rows};
use crate::scalar::DeviceScalar;

/// Bytes of a piece: drivers keep a copy of what is being written.
const PIECE_BYTES: usize = 16 << 20;

/// Clears every chunk and the panel, then writes the tiles of a matrix given by its lower half.
/// Each piece is waited for.
pub(crate) fn all<E: DeviceScalar>(
    store: &DeviceStore<E>,
    lower: MatRef<'_, f64>,
) -> Result<(), GpuError> {
    let (device, buffers) = (&store.device, &store.buffers);
    let mut encoder = device.device.create_command_encoder(&Default::default());
    for chunk in 0..buffers.chunks() {
        encoder.clear_buffer(buffers.chunk(chunk), 0, None);
    }
    if let Some((panel, _, _)) = buffers.ways_back() {
        encoder.clear_buffer(panel, 0, None);
    }
    device.submit(encoder)?;
    let mut piece = Piece { chunk: 0, first: 0, bytes: Vec::new() };
    let tile_bytes = TILE_AREA * E::BYTES as usize;
    for block in 0..tile_rows(lower.nrows()) {
        for other in 0..=block {
            let tile = before(block) + other;
            let chunk = tile / buffers.chunk_tiles();
            if chunk != piece.chunk || piece.bytes.len() + tile_bytes > PIECE_BYTES {
                piece.send(store)?;
                let first = ((tile % buffers.chunk_tiles()) * tile_bytes) as u64;
                piece = Piece { chunk, first, bytes: Vec::new() };
            }
            tile_of::<E>(lower, (block, other), &mut piece.bytes);
        }
    }
    piece.send(store)
}

/// Consecutive tiles of one chunk.
struct Piece {
    chunk: usize,
    /// Where they go, in bytes.
    first: u64,
    bytes: Vec<u8>,
}

impl Piece {
    fn send<E: DeviceScalar>(&self, store: &DeviceStore<E>) -> Result<(), GpuError> {
        let (device, buffers) = (&store.device, &store.buffers);
        if !self.bytes.is_empty() {
            device.check()?;
            device.queue.write_buffer(buffers.chunk(self.chunk), self.first, &self.bytes);
            device.queue.submit([]);
        }
        device.wait()
    }
}

/// Tiles of C in the device's order: numbers of tile `tile` of a matrix given by its lower half.
fn tile_of<E: DeviceScalar>(
    lower: MatRef<'_, f64>,
    (block, other): (usize, usize),
    bytes: &mut Vec<u8>,
) {
    let n = lower.nrows();
    for entry in 0..TILE_AREA {
        let (i, j) = (block * TILE + entry / TILE, other * TILE + entry % TILE);
        let is_inside = i < n && j < n;
        let value = if is_inside { lower[(i.max(j), i.min(j))] } else { 0.0 };
        E::of(value).put(bytes);
    }
}
