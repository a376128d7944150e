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
    let mut piece = Piece::<E> { chunk: 0, first: 0, numbers: Vec::new() };
    let most = PIECE_BYTES / E::BYTES as usize;
    for block in 0..tile_rows(lower.nrows()) {
        for other in 0..=block {
            let tile = before(block) + other;
            let chunk = tile / buffers.chunk_tiles;
            if chunk != piece.chunk || piece.numbers.len() + TILE_AREA > most {
                piece.send(store)?;
                let first = (tile % buffers.chunk_tiles * TILE_AREA) as u64;
                piece = Piece { chunk, first, numbers: Vec::new() };
            }
            piece.push_tile(lower, (block, other));
        }
    }
    piece.send(store)
}

/// Consecutive tiles of one chunk.
struct Piece<E> {
    chunk: usize,
    /// Where they go, in numbers.
    first: u64,
    numbers: Vec<E>,
}

impl<E: DeviceScalar> Piece<E> {
    /// Adds a tile of a matrix given by its lower half.
    fn push_tile(&mut self, lower: MatRef<'_, f64>, (block, other): (usize, usize)) {
        let n = lower.nrows();
        self.numbers.extend((0..TILE_AREA).map(|entry| {
            let (i, j) = (block * TILE + entry / TILE, other * TILE + entry % TILE);
            let is_inside = i < n && j < n;
            E::of(if is_inside { lower[(i.max(j), i.min(j))] } else { 0.0 })
        }));
    }

    fn send(&self, store: &DeviceStore<E>) -> Result<(), GpuError> {
        let (device, buffers) = (&store.device, &store.buffers);
        if !self.numbers.is_empty() {
            device.check()?;
            let (chunk, bytes) = (buffers.chunk(self.chunk), bytemuck::cast_slice(&self.numbers));
            device.queue.write_buffer(chunk, self.first * E::BYTES, bytes);
            device.queue.submit([]);
        }
        device.wait()
    }
}
