//! Changing C: terms deferred and folded in, rows appended and removed.

use faer::MatRef;
use yawara_inverse_update::Staged;

use super::device_store::DeviceStore;
use super::recording::From;
use super::upload;
use crate::GpuError;
use crate::kernels::{Kernel, TILE, Work, before, tile_rows};
use crate::scalar::DeviceScalar;

impl<E: DeviceScalar> DeviceStore<E> {
    pub(super) fn load_now(&mut self, lower: MatRef<'_, f64>) -> Result<(), GpuError> {
        self.device.check()?;
        self.make_space(lower.nrows(), 0, 0)?;
        upload::all(self, lower)?;
        (self.rows, self.pending, self.staged, self.gathered) = (lower.nrows(), 0, 0, None);
        Ok(())
    }

    pub(super) fn stage_now(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, GpuError> {
        let (k, all) = (staged.signs.len(), staged.x.ncols());
        self.make_space(self.rows + all - k, all, staged.rows.len())?;
        let gathering = self.gathering(staged.rows)?;
        let signs: Vec<E> = staged.signs.iter().map(|&sign| E::of(sign)).collect();
        self.buffers.write_small(self.pending, &signs);
        if let Some(plus) = staged.plus {
            self.write_columns(self.pending, plus);
        }
        let (kernel, work) = self.multiply_gathered(staged.x, self.pending, staged.plus.is_some());
        let (blocks, tiles) = (self.buffers.stride() / TILE, tile_rows(self.rows));
        let diagonal = Work { terms: self.pending + k, ..self.work() };
        let encoder = self.record(|record| {
            record.gather(gathering.as_ref());
            record.run(kernel, work, (blocks, all));
            record.run_on_tiles(Kernel::Diagonal, diagonal, (0, self.rows), (Some(tiles), 1));
            record.run(Kernel::CorrectDiagonal, diagonal, (tiles, 1));
        });
        let diagonal = self.fetch(encoder, From::Result, self.rows)?;
        self.note_gathered(gathering);
        self.staged = k;
        Ok(diagonal)
    }

    pub(super) fn accept_now(&mut self, own: MatRef<'_, f64>) -> Result<(), GpuError> {
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

    pub(super) fn remove_now(&mut self, slot: usize, block: usize) -> Result<(), GpuError> {
        let (first, kept) = (block * slot, self.rows - block);
        let last: Vec<usize> = (kept..self.rows).collect();
        let front = self.buffers.front();
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

    pub(super) fn fold_now(&mut self) -> Result<(), GpuError> {
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
