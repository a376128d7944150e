//! The buffers of one inverse, and how they grow: C by chunks that never move, the others by
//! reallocation.

use std::marker::PhantomData;
use std::sync::Arc;

use wgpu::{BindGroup, BufferUsages};

use crate::GpuError;
use crate::device::{Device, Memory};
use crate::kernels::{BINDINGS, MOST_ROWS, TILE, TILE_AREA, before, tile_rows};
use crate::scalar::DeviceScalar;

/// Panel columns for deferred and staged terms, at least.
pub(crate) const FRONT: usize = 160;

/// Panel columns for columns of C and right-hand sides, at least.
pub(crate) const GATHER: usize = 64;

/// Right-hand sides of one product.
pub(crate) const BATCH: usize = 8;

/// Bytes of partial sums beyond which right-hand sides come one by one.
const PARTIAL_BYTES: u64 = 32 << 20;

/// How much the buffers have to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Need {
    pub(crate) rows: usize,
    pub(crate) front: usize,
    pub(crate) gather: usize,
}

/// The buffers but for C's, made for one size.
#[derive(Debug)]
struct Scratch {
    panel: Memory,
    small: Memory,
    index: Memory,
    result: Memory,
    partial: Memory,
    readback: Memory,
}

/// All buffers of one inverse.
#[derive(Debug)]
pub(crate) struct Buffers<E> {
    device: Arc<Device>,
    pub(crate) chunk_tiles: usize,
    chunks: Vec<Memory>,
    groups: Vec<BindGroup>,
    scratch: Option<Scratch>,
    /// What `scratch` has memory for; rows are whole tiles. Columns of C follow the front ones.
    pub(crate) capacity: Need,
    scalar: PhantomData<E>,
}

impl<E: DeviceScalar> Buffers<E> {
    pub(crate) fn new(device: Arc<Device>) -> Self {
        let chunk_tiles = device.chunk_tiles(E::BYTES);
        let capacity = Need { rows: 0, front: 0, gather: 0 };
        let (chunks, groups) = (Vec::new(), Vec::new());
        Self { device, chunk_tiles, chunks, groups, scratch: None, capacity, scalar: PhantomData }
    }

    /// Numbers in a panel column.
    pub(crate) fn stride(&self) -> usize {
        self.capacity.rows
    }

    /// Chunks made so far.
    pub(crate) fn chunks(&self) -> usize {
        self.chunks.len()
    }

    /// Right-hand sides that partial sums have memory for.
    pub(crate) fn batch(&self) -> usize {
        let each = partial_numbers(self.capacity.rows) as u64 * E::BYTES;
        ((PARTIAL_BYTES / each) as usize).clamp(1, BATCH)
    }

    /// Whether the panel would have to be reallocated, which loses its contents.
    pub(crate) fn is_short_of(&self, need: Need) -> bool {
        let Need { rows, front, gather } = self.capacity;
        need.rows > rows || need.front > front || need.gather > gather || self.scratch.is_none()
    }

    /// Grows to what is needed; the panel is 0 afterwards where [`is_short_of`](Self::is_short_of)
    /// said so.
    /// # Errors
    /// [`GpuError::Limit`], [`GpuError::OutOfMemory`], [`GpuError::Lost`]; what there is stays.
    pub(crate) fn grow(&mut self, need: Need) -> Result<(), GpuError> {
        if need.rows > MOST_ROWS {
            let adapter = self.device.report().name.clone();
            let (got, want) = (MOST_ROWS as u64, need.rows as u64);
            return Err(GpuError::Limit { adapter, limit: "the most rows", got, want });
        }
        let chunks = before(tile_rows(need.rows)).div_ceil(self.chunk_tiles).max(1);
        let is_short = self.is_short_of(need);
        if !is_short && chunks <= self.chunks.len() {
            return Ok(());
        }
        while self.chunks.len() < chunks {
            let bytes = (self.chunk_tiles * TILE_AREA) as u64 * E::BYTES;
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
            self.chunks.push(self.device.allocate("a part of C", bytes, usage)?);
        }
        if is_short {
            let capacity = Need {
                // An eighth more rows: the panel grows seldom.
                rows: match need.rows > self.capacity.rows {
                    true => tile_rows(need.rows + need.rows / 8).max(1) * TILE,
                    false => self.capacity.rows.max(TILE),
                },
                front: need.front.max(self.capacity.front).max(FRONT),
                gather: need.gather.max(self.capacity.gather).max(GATHER),
            };
            self.scratch = Some(self.make_scratch(capacity)?);
            self.capacity = capacity;
        }
        self.bind();
        Ok(())
    }

    fn make_scratch(&self, capacity: Need) -> Result<Scratch, GpuError> {
        let Need { rows, front, gather } = capacity;
        let make = |what, numbers: usize, usage| {
            self.device.allocate(what, numbers as u64 * E::BYTES, usage)
        };
        let (storage, to, from) =
            (BufferUsages::STORAGE, BufferUsages::COPY_DST, BufferUsages::COPY_SRC);
        let each = partial_numbers(rows);
        let batch = (PARTIAL_BYTES / (each as u64 * E::BYTES)).clamp(1, BATCH as u64) as usize;
        let result = (BATCH * (rows + front)).max(gather * gather);
        Ok(Scratch {
            panel: make("the panel", (front + gather) * rows, storage | to | from)?,
            small: make("small matrices", front * (1 + gather), storage | to)?,
            index: self.device.allocate("row numbers", 4 * gather as u64, storage | to)?,
            result: make("results", result, storage | from)?,
            partial: make("partial sums", batch * each, storage)?,
            readback: make(
                "the readback buffer",
                gather * rows.max(gather),
                to | BufferUsages::MAP_READ,
            )?,
        })
    }

    /// One bind group per chunk.
    fn bind(&mut self) {
        let Some(scratch) = &self.scratch else { return };
        let layout = &E::kernels(&self.device).layout;
        let group = |chunk: &Memory| {
            let buffers: [&Memory; BINDINGS] = [
                chunk,
                &scratch.panel,
                &scratch.small,
                &scratch.index,
                &scratch.result,
                &scratch.partial,
            ];
            let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
                .zip(buffers)
                .map(|(binding, memory)| wgpu::BindGroupEntry {
                    binding,
                    resource: memory.buffer.as_entire_binding(),
                })
                .collect();
            self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries,
            })
        };
        self.groups = self.chunks.iter().map(group).collect();
    }

    /// The bind group of a chunk; kernels that leave C alone take that of the first.
    pub(crate) fn group(&self, chunk: usize) -> Option<&BindGroup> {
        self.groups.get(chunk)
    }

    pub(crate) fn chunk(&self, chunk: usize) -> &wgpu::Buffer {
        &self.chunks[chunk].buffer
    }

    /// The panel, the results, and the buffer by which either is read back.
    pub(crate) fn ways_back(&self) -> Option<(&wgpu::Buffer, &wgpu::Buffer, &Memory)> {
        let scratch = self.scratch.as_ref()?;
        Some((&scratch.panel.buffer, &scratch.result.buffer, &scratch.readback))
    }

    /// Writes numbers into the panel from a column and a row on.
    pub(crate) fn write_panel(&self, column: usize, row: usize, numbers: &[E]) {
        if let Some(scratch) = &self.scratch {
            let at = (column * self.capacity.rows + row) as u64 * E::BYTES;
            self.write(&scratch.panel, at, numbers);
        }
    }

    /// Writes numbers into the small matrices.
    pub(crate) fn write_small(&self, at: usize, numbers: &[E]) {
        if let Some(scratch) = &self.scratch {
            self.write(&scratch.small, at as u64 * E::BYTES, numbers);
        }
    }

    pub(crate) fn write_index(&self, rows: &[usize]) {
        if let Some(scratch) = &self.scratch {
            let words: Vec<u32> = rows.iter().map(|&row| row as u32).collect();
            self.write(&scratch.index, 0, &words);
        }
    }

    fn write(&self, memory: &Memory, at: u64, numbers: &[impl bytemuck::Pod]) {
        if !numbers.is_empty() {
            self.device.queue.write_buffer(&memory.buffer, at, bytemuck::cast_slice(numbers));
        }
    }
}

/// Bytes that an inverse of that many rows takes on a device, for numbers of 4 or 8 bytes.
///
/// The tiles of C without what a chunk leaves over at the end, and the scratch beside them:
/// deferred and staged columns, partial sums, and the readback buffer.
#[must_use]
pub fn needed_bytes(rows: usize, number_bytes: u64) -> u64 {
    let tiles = before(tile_rows(rows)) as u64;
    let stride = (tile_rows(rows) * TILE) as u64;
    let columns = (FRONT + 2 * GATHER + BATCH) as u64;
    number_bytes * (tiles * (TILE_AREA + 2 * TILE) as u64 + columns * stride)
}

/// Partial sums of one right-hand side, for so many rows of whole tiles.
fn partial_numbers(rows: usize) -> usize {
    before(tile_rows(rows)).max(1) * 2 * TILE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_largest_mesh_takes_half_of_a_full_matrix() {
        // 10368 rows are 162 tile rows, 13203 tiles of 16 KiB in f32.
        let tiles = 13_203 * 16_384;
        let need = needed_bytes(10_368, 4);
        assert!(need > tiles && need < tiles + tiles / 8, "{need}");
        assert_eq!(needed_bytes(10_368, 8), 2 * need);
        assert!(need < 10_368 * 10_368 * 4 * 6 / 10);
    }
}
