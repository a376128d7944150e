//! What is read of C: small blocks, columns and products, what is put off included.

use faer::{Mat, MatRef};

use super::DeviceStore;
use super::recording::From;
use crate::GpuError;
use crate::kernels::{Kernel, Work};
use crate::layout::{TILE, before, tile_rows};
use crate::scalar::DeviceScalar;

impl<E: DeviceScalar> DeviceStore<E> {
    pub(super) fn block_now(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let r = rows.len();
        if r == 0 {
            return Ok(Mat::zeros(0, 0));
        }
        let gathering = self.gathering(rows)?;
        let work = Work { source: self.room.front(), at: r, ..self.work() };
        let encoder = self.record(|record| {
            record.gather(gathering.as_ref());
            record.run(Kernel::Pick, work, (r.div_ceil(TILE), r));
        });
        let numbers = self.fetch(encoder, From::Result, r * r)?;
        self.stands(gathering);
        Ok(Mat::from_fn(r, r, |i, j| numbers[j * r + i]))
    }

    pub(super) fn columns_now(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let mut columns = Mat::zeros(self.rows, rows.len());
        let batch = self.room.gather().max(1);
        for (at, rows) in rows.chunks(batch).enumerate() {
            let gathering = self.gathering(rows)?;
            let encoder = self.record(|record| record.gather(gathering.as_ref()));
            let stride = self.room.stride();
            let numbers =
                self.fetch(encoder, From::Panel(self.room.front()), rows.len() * stride)?;
            self.stands(gathering);
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
        self.make_room(self.rows, x.ncols().min(self.room.gather()), rows.len())?;
        let batch = (self.room.front() - self.pending).min(self.room.gather());
        for first in (0..x.ncols()).step_by(batch.max(1)) {
            let columns = batch.min(x.ncols() - first);
            let gathering = self.gathering(rows)?;
            let x = x.subcols(first, columns);
            let (kernel, work) = self.multiply_gathered(x, self.pending, false);
            let blocks = self.room.stride() / TILE;
            let encoder = self.record(|record| {
                record.gather(gathering.as_ref());
                record.run(kernel, work, (blocks, columns));
            });
            let from = From::Panel(self.pending);
            let numbers = self.fetch(encoder, from, columns * self.room.stride())?;
            self.stands(gathering);
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
        let (batch, stride) = (self.room.batch(), self.room.stride());
        let tiles = tile_rows(self.rows);
        for first in (0..x.ncols()).step_by(batch) {
            let columns = batch.min(x.ncols() - first);
            self.write_columns(self.room.front(), x.subcols(first, columns));
            let work = Work { source: self.room.front(), other: columns * stride, ..self.work() };
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

    /// The rows that C has, of panel columns next to each other.
    fn unpack(&self, numbers: &[f64], columns: usize) -> Mat<f64> {
        let stride = self.room.stride();
        Mat::from_fn(self.rows, columns, |i, k| numbers[k * stride + i])
    }
}
