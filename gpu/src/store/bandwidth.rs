//! The bandwidth of the device's memory, which bounds the time of every pass over C.

use std::sync::Arc;
use std::time::Instant;

use super::device_store::DeviceStore;
use crate::GpuError;
use crate::device::Device;
use crate::kernels::{Kernel, TILE, TILE_AREA, Work, before};

/// Passes of one timed submit: its own cost is shared by all of them.
const PASSES: usize = 16;

/// Tile rows of the C that is passed over: 302 MB, beyond the caches of any card.
const TILE_ROWS: usize = 192;

impl DeviceStore<f32> {
    /// Bytes per second, read and written, of passes over a C that add nothing to it: the best of
    /// `repeats` submits of 16 passes.
    ///
    /// A copy by Vulkan's own command is no such bound: on an H200 it moves 0.8 TB/s, a pass 2.6.
    /// Takes 0.3 GB on the device. Cost: that of those passes.
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::Lost`], [`GpuError::Timeout`].
    pub fn pass_rate(device: &Arc<Device>, repeats: usize) -> Result<f64, GpuError> {
        let mut store = Self::new(Arc::clone(device))?;
        let rows = TILE_ROWS * TILE;
        store.make_space(rows, 0, 0)?;
        let mut best = 0.0f64;
        // The first submit warms up.
        for _ in 0..=repeats.max(1) {
            let encoder = store.record(|record| {
                for _ in 0..PASSES {
                    let work = Work { rows, ..store.work() };
                    record.run_on_tiles(Kernel::Update, work, (0, rows), (None, 1));
                }
            });
            let start = Instant::now();
            device.submit(encoder)?;
            store.finish()?;
            let moved = (2 * PASSES * before(TILE_ROWS) * TILE_AREA * size_of::<f32>()) as f64;
            best = best.max(moved / start.elapsed().as_secs_f64());
        }
        Ok(best)
    }
}
