//! What the maintainer asks of C: single columns, products and small submatrices with the deferred
//! terms; terms deferred and folded in, rows appended and removed.

use faer::{Mat, MatRef};
use yawara_inverse_update::{DenseStore, Staged};

use super::device_store::DeviceStore;
use super::recording::{From, Recording};
use super::upload;
use crate::GpuError;
use crate::buffers::{Need, needed_bytes};
use crate::kernels::{Kernel, TILE, Work, before, tile_rows};
use crate::scalar::DeviceScalar;

impl<E: DeviceScalar> DenseStore for DeviceStore<E> {
    type Scalar = E;
    type Error = GpuError;

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

    fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), GpuError> {
        self.device.check()?;
        self.make_space(lower.nrows(), 0, 0)?;
        upload::all(self, lower)?;
        (self.rows, self.pending, self.staged, self.gathered) = (lower.nrows(), 0, 0, None);
        Ok(())
    }

    fn delayed(&self) -> usize {
        self.pending
    }

    fn submatrix(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let r = rows.len();
        if r == 0 {
            return Ok(Mat::zeros(0, 0));
        }
        self.make_space(self.rows, 0, r)?;
        let work = Work { source: self.buffers.capacity.front, at: r, ..self.work() };
        let pick = |record: &mut Recording<'_, E>| {
            record.run(Kernel::Pick, work, (r.div_ceil(TILE), r));
        };
        let numbers = self.fetch_gathered(rows, pick, From::Result, r * r)?;
        Ok(Mat::from_fn(r, r, |i, j| numbers[j * r + i]))
    }

    fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let mut columns = Mat::zeros(self.rows, rows.len());
        let batch = self.buffers.capacity.gather.max(1);
        for (at, rows) in rows.chunks(batch).enumerate() {
            self.make_space(self.rows, 0, rows.len())?;
            let (from, stride) = (self.buffers.capacity.front, self.buffers.stride());
            let numbers =
                self.fetch_gathered(rows, |_| (), From::Panel(from), rows.len() * stride)?;
            let mut target = columns.subcols_mut(at * batch, rows.len());
            target.copy_from(self.unpack(&numbers, rows.len()));
        }
        Ok(columns)
    }

    fn product(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, GpuError> {
        let mut product = Mat::zeros(self.rows, x.ncols());
        if rows.is_empty() || self.rows == 0 {
            return Ok(product);
        }
        self.make_space(self.rows, x.ncols().min(self.buffers.capacity.gather), rows.len())?;
        let Need { rows: stride, front, gather } = self.buffers.capacity;
        let batch = (front - self.pending).min(gather).max(1);
        for first in (0..x.ncols()).step_by(batch) {
            let columns = batch.min(x.ncols() - first);
            let x = x.subcols(first, columns);
            let (kernel, work) = self.multiply_gathered(x, self.pending, false);
            let times = |record: &mut Recording<'_, E>| {
                record.run(kernel, work, (stride / TILE, columns));
            };
            let from = From::Panel(self.pending);
            let numbers = self.fetch_gathered(rows, times, from, columns * stride)?;
            product.subcols_mut(first, columns).copy_from(self.unpack(&numbers, columns));
        }
        Ok(product)
    }

    fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, GpuError> {
        let mut product = Mat::zeros(self.rows, x.ncols());
        if self.rows == 0 {
            return Ok(product);
        }
        self.gathered = None;
        let (batch, tiles) = (self.buffers.batch(), tile_rows(self.rows));
        let Need { rows: stride, front, .. } = self.buffers.capacity;
        for first in (0..x.ncols()).step_by(batch) {
            let columns = batch.min(x.ncols() - first);
            self.write_columns(front, x.subcols(first, columns));
            let (at, other) = (before(tiles), columns * stride);
            let work = Work { source: front, at, other, ..self.work() };
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

    fn stage(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, GpuError> {
        let (k, all) = (staged.signs.len(), staged.x.ncols());
        self.make_space(self.rows + all - k, all, staged.rows.len())?;
        let signs: Vec<E> = staged.signs.iter().map(|&sign| E::of(sign)).collect();
        self.buffers.write_small(self.pending, &signs);
        if let Some(plus) = staged.plus {
            self.write_columns(self.pending, plus);
        }
        let (kernel, work) = self.multiply_gathered(staged.x, self.pending, staged.plus.is_some());
        let (blocks, tiles) = (self.buffers.stride() / TILE, tile_rows(self.rows));
        let diagonal = Work { terms: self.pending + k, ..self.work() };
        let commands = |record: &mut Recording<'_, E>| {
            record.run(kernel, work, (blocks, all));
            record.run_on_tiles(Kernel::Diagonal, diagonal, (0, diagonal.rows), (Some(tiles), 1));
            record.run(Kernel::CorrectDiagonal, diagonal, (tiles, 1));
        };
        let diagonal = self.fetch_gathered(staged.rows, commands, From::Result, self.rows)?;
        self.staged = k;
        Ok(diagonal)
    }

    fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), GpuError> {
        let (old, m) = (self.rows, own.nrows());
        self.device.check()?;
        self.gathered = None;
        let border = self.pending + self.staged;
        for a in 0..m {
            let corner: Vec<E> = (0..m).map(|b| E::of(own[(a.max(b), a.min(b))])).collect();
            self.buffers.write_panel(border + a, old, &corner);
        }
        if m > 0 {
            let rows = old + m;
            let work = Work { source: border, at: old, other: 0, ..self.work() };
            let work = Work { rows, tile_rows: tile_rows(rows), ..work };
            self.submit(|record| {
                let part = (before(old / TILE), rows);
                record.run_on_tiles(Kernel::Put, work, part, (Some(work.tile_rows), m));
            })?;
        }
        self.rows += m;
        self.pending = border;
        self.staged = 0;
        Ok(())
    }

    fn remove(&mut self, slot: usize, block: usize) -> Result<(), GpuError> {
        let (first, kept) = (block * slot, self.rows - block);
        let last: Vec<usize> = (kept..self.rows).collect();
        let front = self.buffers.capacity.front;
        let all = self.work();
        self.buffers.write_index(&last);
        let gather = Work { target: front, ..all };
        let gap = Work { source: front, targets: block, at: first, rows: kept, other: 2, ..all };
        let none = Work { at: kept, other: 1, ..all };
        let rows = Work { at: first, rows: kept, targets: block, ..all };
        self.gathered = None;
        self.submit(|record| {
            let (tiles, whole) = (Some(all.tile_rows), (0, self.rows));
            if first != kept {
                record.run_on_tiles(Kernel::Gather, gather, whole, (tiles, block));
                let part = (before(first / TILE), self.rows);
                record.run_on_tiles(Kernel::Put, gap, part, (Some(tile_rows(kept)), block));
            }
            let part = (before(kept / TILE), self.rows);
            record.run_on_tiles(Kernel::Put, none, part, (tiles, block));
            record.run(Kernel::MoveRows, rows, (all.terms.div_ceil(TILE), 1));
        })?;
        self.rows = kept;
        Ok(())
    }

    fn fold(&mut self) -> Result<(), GpuError> {
        if self.pending == 0 {
            return Ok(());
        }
        let work = self.work();
        self.submit(|record| {
            record.run_on_tiles(Kernel::Update, work, (0, self.rows), (None, 1));
        })?;
        self.pending = 0;
        Ok(())
    }
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}
