//! The bandwidth of the device's memory, which bounds the time of every pass over C.

use std::time::Instant;

use wgpu::BufferUsages;

use super::open_device::Device;
use crate::GpuError;

/// Copies of one timed submit: its own cost is shared by all of them.
const COPIES: usize = 16;

/// Bytes of each buffer: beyond the caches of any card.
const MOST_BYTES: u64 = 256 << 20;

impl Device {
    /// Bytes per second, read and written, of copies of one buffer to another on the device: the
    /// best of `repeats` submits of 16 copies.
    ///
    /// Takes two buffers of 256 MiB, or half the device's largest each. Cost: as that many copies.
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::Lost`], [`GpuError::Timeout`].
    pub fn copy_rate(&self, repeats: usize) -> Result<f64, GpuError> {
        let report = self.report();
        let largest = report.max_buffer_bytes.min(report.max_storage_binding_bytes);
        let bytes = MOST_BYTES.min(largest / 2) / 256 * 256;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let from = self.allocate("a copy's source", bytes, usage)?;
        let to = self.allocate("a copy's target", bytes, usage)?;
        let mut best = 0.0f64;
        // The first submit warms up.
        for _ in 0..=repeats.max(1) {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            for copy in 0..COPIES {
                let (source, target) = if copy % 2 == 0 { (&from, &to) } else { (&to, &from) };
                encoder.copy_buffer_to_buffer(&source.buffer, 0, &target.buffer, 0, bytes);
            }
            let start = Instant::now();
            self.submit(encoder)?;
            self.wait()?;
            let moved = (2 * COPIES as u64 * bytes) as f64;
            best = best.max(moved / start.elapsed().as_secs_f64());
        }
        Ok(best)
    }
}
