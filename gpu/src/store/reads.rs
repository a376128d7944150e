//! Reading C with its deferred terms: small submatrices, columns and products.

use faer::{Mat, MatRef};

use super::device_store::DeviceStore;
use super::recording::From;
use crate::GpuError;
use crate::kernels::{Kernel, TILE, Work, before, tile_rows};
use crate::scalar::DeviceScalar;

impl<E: DeviceScalar> DeviceStore<E> {
    pub(super) fn submatrix_now(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let r = rows.len();
        if r == 0 {
            return Ok(Mat::zeros(0, 0));
        }
        let gathering = self.gathering(rows)?;
        let work = Work { source: self.buffers.front(), at: r, ..self.work() };
        let encoder = self.record(|record| {
            record.gather(gathering.as_ref());
            record.run(Kernel::Pick, work, (r.div_ceil(TILE), r));
        });
        let numbers = self.fetch(encoder, From::Result, r * r)?;
        self.note_gathered(gathering);
        Ok(Mat::from_fn(r, r, |i, j| numbers[j * r + i]))
    }

    pub(super) fn columns_now(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let mut columns = Mat::zeros(self.rows, rows.len());
        let batch = self.buffers.gather().max(1);
        for (at, rows) in rows.chunks(batch).enumerate() {
            let gathering = self.gathering(rows)?;
            let encoder = self.record(|record| record.gather(gathering.as_ref()));
            let stride = self.buffers.stride();
            let numbers =
                self.fetch(encoder, From::Panel(self.buffers.front()), rows.len() * stride)?;
            self.note_gathered(gathering);
            let mut target = columns.subcols_mut(at * batch, rows.len());
            target.copy_from(self.unpack(&numbers, rows.len()));
        }
        Ok(columns)
    }

    pub(super) fn product_now(
        &mut self,
        rows: &[usize],
        x: MatRef<'_, f64>,
    ) -> Result<Mat<f64>, GpuError> {
        let mut product = Mat::zeros(self.rows, x.ncols());
        if rows.is_empty() || self.rows == 0 {
            return Ok(product);
        }
        self.make_space(self.rows, x.ncols().min(self.buffers.gather()), rows.len())?;
        let batch = (self.buffers.front() - self.pending).min(self.buffers.gather());
        for first in (0..x.ncols()).step_by(batch.max(1)) {
            let columns = batch.min(x.ncols() - first);
            let gathering = self.gathering(rows)?;
            let x = x.subcols(first, columns);
            let (kernel, work) = self.multiply_gathered(x, self.pending, false);
            let blocks = self.buffers.stride() / TILE;
            let encoder = self.record(|record| {
                record.gather(gathering.as_ref());
                record.run(kernel, work, (blocks, columns));
            });
            let from = From::Panel(self.pending);
            let numbers = self.fetch(encoder, from, columns * self.buffers.stride())?;
            self.note_gathered(gathering);
            product.subcols_mut(first, columns).copy_from(self.unpack(&numbers, columns));
        }
        Ok(product)
    }

    pub(super) fn multiply_now(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, GpuError> {
        let mut product = Mat::zeros(self.rows, x.ncols());
        if self.rows == 0 {
            return Ok(product);
        }
        self.gathered = None;
        let (batch, stride) = (self.buffers.batch(), self.buffers.stride());
        let tiles = tile_rows(self.rows);
        for first in (0..x.ncols()).step_by(batch) {
            let columns = batch.min(x.ncols() - first);
            self.write_columns(self.buffers.front(), x.subcols(first, columns));
            let work =
                Work { source: self.buffers.front(), other: columns * stride, ..self.work() };
            let work = Work { at: before(tiles), ..work };
            let encoder = self.record(|record| {
                record.run_on_tiles(Kernel::Symv, work, (0, self.rows), (None, columns));
                record.run(Kernel::Inner, work, (work.terms, columns));
                record.run(Kernel::Reduce, work, (tiles, columns));
            });
            let numbers = self.fetch(encoder, From::Result, columns * stride)?;
            product.subcols_mut(first, columns).copy_from(self.unpack(&numbers, columns));
        }
        Ok(product)
    }

    /// Consecutive panel columns without their padding.
    fn unpack(&self, numbers: &[f64], columns: usize) -> Mat<f64> {
        let stride = self.buffers.stride();
        Mat::from_fn(self.rows, columns, |i, k| numbers[k * stride + i])
    }
}
