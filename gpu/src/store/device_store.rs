//! A dense C that lives on a device.

use std::sync::Arc;

use faer::{Mat, MatRef};
use yawara_inverse_update::{DenseStore, InverseError, Staged};

use crate::GpuError;
use crate::buffers::{Buffers, Need, needed_bytes};
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
    ///
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
    ///
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
        if is_short || self.pending + front > self.buffers.front() {
            self.fold_now()?;
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
        let at = self.buffers.front();
        self.buffers.write_small(at, &numbers);
        let work = Work {
            source: self.buffers.front(),
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
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

impl<E: DeviceScalar> DenseStore for DeviceStore<E> {
    type Scalar = E;

    fn method(&self) -> &'static str {
        E::NAME
    }

    fn place(&self) -> Option<String> {
        let report = self.device.report();
        let (used, needed) = (self.device.used_bytes(), needed_bytes(self.rows, E::BYTES));
        Some(format!(
            "on {} ({}, {} {}), {} bits, {:.1} MiB needed and {:.1} MiB reserved there, at most {:.0} \
             MiB per buffer",
            report.name,
            report.device_type,
            report.driver,
            report.driver_info,
            8 * E::BYTES,
            mebibytes(needed),
            mebibytes(used),
            mebibytes(report.max_buffer_bytes.min(report.max_storage_binding_bytes)),
        ))
    }

    fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), InverseError> {
        self.load_now(lower).map_err(|error| error.of(E::NAME))
    }

    fn delayed(&self) -> usize {
        self.pending
    }

    fn submatrix(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.submatrix_now(rows).map_err(|error| error.of(E::NAME))
    }

    fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.columns_now(rows).map_err(|error| error.of(E::NAME))
    }

    fn product(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.product_now(rows, x).map_err(|error| error.of(E::NAME))
    }

    fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.multiply_now(x).map_err(|error| error.of(E::NAME))
    }

    fn stage(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, InverseError> {
        self.stage_now(staged).map_err(|error| error.of(E::NAME))
    }

    fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), InverseError> {
        self.accept_now(own).map_err(|error| error.of(E::NAME))
    }

    fn remove(&mut self, slot: usize, block: usize) -> Result<(), InverseError> {
        self.remove_now(slot, block).map_err(|error| error.of(E::NAME))
    }

    fn fold(&mut self) -> Result<(), InverseError> {
        self.fold_now().map_err(|error| error.of(E::NAME))
    }
}
