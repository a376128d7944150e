//! Commands of one submit, and the numbers that come back from it.

use super::device_store::DeviceStore;
use crate::GpuError;
use crate::kernels::{Kernel, Work, before, tile_rows};
use crate::scalar::DeviceScalar;

/// Commands of one submit.
pub(super) struct Recording<'a, E: DeviceScalar> {
    store: &'a DeviceStore<E>,
    pass: wgpu::ComputePass<'static>,
}

impl<E: DeviceScalar> Recording<'_, E> {
    /// A kernel that leaves C alone.
    pub(super) fn run(&mut self, kernel: Kernel, work: Work, groups: (usize, usize)) {
        let store = self.store;
        if let Some(group) = store.buffers.group(0) {
            let kernels = E::kernels(&store.device);
            kernels.dispatch(&mut self.pass, kernel, group, &work, groups);
        }
    }

    /// A kernel that touches tiles from `first` on, up to those of `rows` rows: once per chunk. One
    /// workgroup per tile of a chunk where `groups` is `None`.
    pub(super) fn run_on_tiles(
        &mut self,
        kernel: Kernel,
        work: Work,
        (first, rows): (usize, usize),
        groups: (Option<usize>, usize),
    ) {
        let store = self.store;
        let (each, end) = (store.buffers.chunk_tiles, before(tile_rows(rows)));
        let kernels = E::kernels(&store.device);
        for chunk in first / each..end.div_ceil(each) {
            let Some(group) = store.buffers.group(chunk) else { return };
            let first_tile = chunk * each;
            let tiles = each.min(end - first_tile);
            let work = Work { first_tile, tiles, ..work };
            let groups = (groups.0.unwrap_or(tiles), groups.1);
            kernels.dispatch(&mut self.pass, kernel, group, &work, groups);
        }
    }

    /// The columns of so many noted rows into the panel, with the deferred terms.
    fn gather(&mut self, rows: usize) {
        let work = Work { target: self.store.buffers.capacity.front, ..self.store.work() };
        let tiles = work.tile_rows;
        self.run_on_tiles(Kernel::Gather, work, (0, work.rows), (Some(tiles), rows));
        if work.terms > 0 {
            self.run(Kernel::Correct, work, (tiles, rows));
        }
    }
}

/// Which buffer numbers come back from.
#[derive(Clone, Copy)]
pub(super) enum From {
    /// The panel, from a column on.
    Panel(usize),
    Result,
}

impl<E: DeviceScalar> DeviceStore<E> {
    /// Brings the columns of some rows into the panel, which has space for them, unless they are
    /// there; then runs the commands that read them, and reads numbers back.
    pub(super) fn fetch_gathered(
        &mut self,
        rows: &[usize],
        commands: impl FnOnce(&mut Recording<'_, E>),
        from: From,
        numbers: usize,
    ) -> Result<Vec<f64>, GpuError> {
        let are_there = self.gathered.as_deref() == Some(rows);
        if !are_there {
            self.gathered = None;
            self.buffers.write_index(rows);
        }
        let encoder = self.record(|record| {
            if !are_there {
                record.gather(rows.len());
            }
            commands(record);
        });
        let numbers = self.fetch(encoder, from, numbers)?;
        self.gathered = Some(rows.to_vec());
        Ok(numbers)
    }

    /// Records commands without submitting them.
    pub(super) fn record(
        &self,
        commands: impl FnOnce(&mut Recording<'_, E>),
    ) -> wgpu::CommandEncoder {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        let pass = encoder.begin_compute_pass(&Default::default()).forget_lifetime();
        let mut recording = Recording { store: self, pass };
        commands(&mut recording);
        drop(recording);
        encoder
    }

    pub(super) fn submit(
        &self,
        commands: impl FnOnce(&mut Recording<'_, E>),
    ) -> Result<(), GpuError> {
        self.device.submit(self.record(commands))
    }

    /// Submits commands and reads numbers back.
    pub(super) fn fetch(
        &self,
        mut encoder: wgpu::CommandEncoder,
        from: From,
        numbers: usize,
    ) -> Result<Vec<f64>, GpuError> {
        let Some((panel, result, readback)) = self.buffers.ways_back() else { return Ok(vec![]) };
        let bytes = numbers as u64 * E::BYTES;
        if bytes == 0 {
            self.device.submit(encoder)?;
            return Ok(vec![]);
        }
        let (source, at) = match from {
            From::Panel(column) => (panel, (column * self.buffers.stride()) as u64 * E::BYTES),
            From::Result => (result, 0),
        };
        encoder.copy_buffer_to_buffer(source, at, &readback.buffer, 0, bytes);
        self.device.submit(encoder)?;
        let bytes = self.device.read(readback, bytes)?;
        Ok(bytemuck::pod_collect_to_vec::<u8, E>(&bytes).into_iter().map(E::value).collect())
    }
}
