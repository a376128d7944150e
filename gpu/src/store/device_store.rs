//! A dense C that lives on a device.

use std::sync::Arc;

use faer::{Mat, MatRef};
use yawara_inverse_update::DenseStore;

use crate::GpuError;
use crate::buffers::{Buffers, Need};
use crate::device::Device;
use crate::kernels::{Kernel, Work, tile_rows};
use crate::scalar::DeviceScalar;

/// A dense symmetric C on a device, its lower half in tiles of 64 × 64, in chunks of tiles.
///
/// Small matrices are uploaded, rounded from f64 to `E`; small submatrices and single columns are
/// read. Growing adds tiles, and chunks for them, and never moves one. Results are the same in
/// every run on the same device.
#[derive(Debug)]
pub struct DeviceStore<E: DeviceScalar> {
    pub(super) device: Arc<Device>,
    pub(super) buffers: Buffers<E>,
    pub(super) rows: usize,
    /// Deferred columns.
    pub(super) pending: usize,
    /// Of the columns staged behind them, those to be deferred.
    pub(super) staged: usize,
    /// The rows whose columns of C the panel holds.
    pub(super) gathered: Option<Vec<usize>>,
}

impl<E: DeviceScalar> DeviceStore<E> {
    /// Holds a C of no rows on that device.
    /// # Errors
    /// [`GpuError::NoF64`] for f64 where shaders don't have it; [`GpuError::Lost`];
    /// [`GpuError::Refused`] if the driver can't translate the kernels.
    pub fn new(device: Arc<Device>) -> Result<Self, GpuError> {
        E::prepare(&device)?;
        let buffers = Buffers::new(Arc::clone(&device));
        Ok(Self { device, buffers, rows: 0, pending: 0, staged: 0, gathered: None })
    }

    /// The device that holds C.
    #[must_use]
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Buffers that C is spread over.
    #[must_use]
    pub fn chunks(&self) -> usize {
        self.buffers.chunks()
    }

    /// Waits until the device has done all submitted work.
    /// # Errors
    /// [`GpuError::Lost`], [`GpuError::Timeout`].
    pub fn finish(&self) -> Result<(), GpuError> {
        self.device.wait()
    }

    pub(super) fn work(&self) -> Work {
        let (rows, stride, terms) = (self.rows, self.buffers.stride(), self.pending);
        Work { rows, tile_rows: tile_rows(rows), stride, terms, ..Work::default() }
    }

    /// Makes space for more rows, `front` staged columns and `gather` columns of C.
    pub(super) fn make_space(
        &mut self,
        rows: usize,
        front: usize,
        gather: usize,
    ) -> Result<(), GpuError> {
        let need = Need { rows, front, gather };
        let is_short = self.buffers.is_short_of(need);
        if is_short || self.pending + front > self.buffers.capacity.front {
            self.fold()?;
        }
        if is_short {
            self.gathered = None;
        }
        self.buffers.grow(need)
    }

    /// Staged columns from `first` on ← the gathered ones times X, all in f64 until here.
    pub(super) fn multiply_gathered(
        &self,
        x: MatRef<'_, f64>,
        first: usize,
        is_added: bool,
    ) -> (Kernel, Work) {
        let numbers: Vec<E> =
            (0..x.nrows()).flat_map(|i| (0..x.ncols()).map(move |j| E::of(x[(i, j)]))).collect();
        let at = self.buffers.capacity.front;
        self.buffers.write_small(at, &numbers);
        let work = Work {
            source: self.buffers.capacity.front,
            sources: x.nrows(),
            target: first,
            targets: x.ncols(),
            at,
            other: usize::from(is_added),
            ..self.work()
        };
        (Kernel::Times, work)
    }

    /// Writes columns into the panel, 0 behind their rows.
    pub(super) fn write_columns(&self, first: usize, columns: MatRef<'_, f64>) {
        let stride = self.buffers.stride();
        let mut numbers = vec![E::default(); stride * columns.ncols()];
        for k in 0..columns.ncols() {
            for i in 0..columns.nrows() {
                numbers[k * stride + i] = E::of(columns[(i, k)]);
            }
        }
        self.buffers.write_panel(first, 0, &numbers);
    }

    /// Consecutive panel columns without their padding.
    pub(super) fn unpack(&self, numbers: &[f64], columns: usize) -> Mat<f64> {
        let stride = self.buffers.stride();
        Mat::from_fn(self.rows, columns, |i, k| numbers[k * stride + i])
    }
}
