//! A dense C that lives on a device.

use std::sync::Arc;

use faer::{Mat, MatRef};
use yawara_inverse_update::{DenseStore, InverseError, Staged};

use crate::device::Device;
use crate::kernels::{Kernel, Work};
use crate::layout::{TILE, TILE_AREA, before, needed_bytes, tile_rows};
use crate::room::{Need, Room};
use crate::scalar::DeviceScalar;
use crate::{GpuError, upload};

/// A dense symmetric C on a device, its lower half in tiles of 64 × 64, in chunks of tiles.
///
/// Small matrices go there in f64 rounded to `E`, small blocks and single columns come back.
/// Growing adds tiles, and chunks for them, and never moves one. Results are the same in every run
/// on the same device.
#[derive(Debug)]
pub struct DeviceStore<E: DeviceScalar> {
    pub(crate) device: Arc<Device>,
    pub(crate) room: Room<E>,
    rows: usize,
    /// Columns put off.
    pending: usize,
    /// Of the columns staged behind them, those to be put off.
    staged: usize,
    /// Rows whose columns of C stand in the panel.
    gathered: Option<Vec<usize>>,
}

/// Commands of one submit.
struct Recording<'a, E: DeviceScalar> {
    store: &'a DeviceStore<E>,
    pass: wgpu::ComputePass<'static>,
}

impl<E: DeviceScalar> Recording<'_, E> {
    /// A kernel that leaves C alone.
    fn run(&mut self, kernel: Kernel, work: Work, groups: (usize, usize)) {
        let store = self.store;
        if let Some(group) = store.room.group(0) {
            let kernels = &E::kernels(&store.device).0;
            kernels.dispatch(&mut self.pass, kernel, group, &work, groups);
        }
    }

    /// A kernel that touches tiles from `first` on, up to those of `rows` rows: once per chunk. One
    /// workgroup per tile of a chunk where `groups` is `None`.
    fn run_on_tiles(
        &mut self,
        kernel: Kernel,
        work: Work,
        (first, rows): (usize, usize),
        groups: (Option<usize>, usize),
    ) {
        let store = self.store;
        let (each, end) = (store.room.chunk_tiles(), before(tile_rows(rows)));
        let kernels = &E::kernels(&store.device).0;
        for chunk in first / each..end.div_ceil(each) {
            let Some(group) = store.room.group(chunk) else { return };
            let first_tile = chunk * each;
            let tiles = each.min(end - first_tile);
            let work = Work { first_tile, tiles, ..work };
            let groups = (groups.0.unwrap_or(tiles), groups.1);
            kernels.dispatch(&mut self.pass, kernel, group, &work, groups);
        }
    }
}

/// Which buffer numbers come back from.
#[derive(Clone, Copy)]
enum From {
    /// The panel, from a column on.
    Panel(usize),
    Result,
}

impl<E: DeviceScalar> DeviceStore<E> {
    /// Holds a C of no rows on that device.
    ///
    /// # Errors
    /// [`GpuError::NoF64`] for f64 where shaders don't have it; [`GpuError::Lost`];
    /// [`GpuError::Refused`] if the driver can't translate the kernels.
    pub fn new(device: Arc<Device>) -> Result<Self, GpuError> {
        E::prepare(&device)?;
        let room = Room::new(Arc::clone(&device));
        Ok(Self { device, room, rows: 0, pending: 0, staged: 0, gathered: None })
    }

    /// The device that C lies on.
    #[must_use]
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Buffers that C is spread over.
    #[must_use]
    pub fn chunks(&self) -> usize {
        self.room.chunks()
    }

    /// Waits until the device has done all that it was told.
    ///
    /// # Errors
    /// [`GpuError::Lost`], [`GpuError::Timeout`].
    pub fn finish(&self) -> Result<(), GpuError> {
        self.device.wait()
    }

    fn work(&self) -> Work {
        let (rows, stride, terms) = (self.rows, self.room.stride(), self.pending);
        Work { rows, tile_rows: tile_rows(rows), stride, terms, ..Work::default() }
    }

    /// Records commands; nothing is handed over yet.
    fn record(&self, commands: impl FnOnce(&mut Recording<'_, E>)) -> wgpu::CommandEncoder {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        let pass = encoder.begin_compute_pass(&Default::default()).forget_lifetime();
        let mut recording = Recording { store: self, pass };
        commands(&mut recording);
        drop(recording);
        encoder
    }

    fn submit(&self, commands: impl FnOnce(&mut Recording<'_, E>)) -> Result<(), GpuError> {
        self.device.submit(self.record(commands))
    }

    /// Hands commands over and waits for numbers to come back.
    fn fetch(
        &self,
        mut encoder: wgpu::CommandEncoder,
        from: From,
        numbers: usize,
    ) -> Result<Vec<f64>, GpuError> {
        let Some((panel, result, readback)) = self.room.ways_back() else { return Ok(vec![]) };
        let bytes = numbers as u64 * E::BYTES;
        if bytes == 0 {
            self.device.submit(encoder)?;
            return Ok(vec![]);
        }
        let (source, at) = match from {
            From::Panel(column) => (panel, (column * self.room.stride()) as u64 * E::BYTES),
            From::Result => (result, 0),
        };
        encoder.copy_buffer_to_buffer(source, at, &readback.buffer, 0, bytes);
        self.device.submit(encoder)?;
        let bytes = self.device.read(readback, bytes)?;
        Ok(bytes.chunks_exact(E::BYTES as usize).map(|x| E::take(x).value()).collect())
    }

    /// The rows that C has, of panel columns next to each other.
    fn unpack(&self, numbers: &[f64], columns: usize) -> Mat<f64> {
        let stride = self.room.stride();
        Mat::from_fn(self.rows, columns, |i, k| numbers[k * stride + i])
    }

    /// Makes room for more rows, `front` staged columns and `gather` columns of C.
    fn make_room(&mut self, rows: usize, front: usize, gather: usize) -> Result<(), GpuError> {
        let need = Need { rows, front, gather };
        let is_short = self.room.is_short_of(need);
        if is_short || self.pending + front > self.room.front() {
            self.fold_now()?;
        }
        if is_short {
            self.gathered = None;
        }
        self.room.grow(need)
    }

    /// Has the columns of some rows stand in the panel, with what is put off.
    fn gather(&mut self, rows: &[usize]) -> Result<(), GpuError> {
        if self.gathered.as_deref() == Some(rows) {
            return Ok(());
        }
        self.make_room(self.rows, 0, rows.len())?;
        self.room.write_index(rows);
        let (tiles, columns) = (tile_rows(self.rows), rows.len());
        let work = Work { target: self.room.front(), ..self.work() };
        self.submit(|record| {
            let all = (0, self.rows);
            record.run_on_tiles(Kernel::Gather, work, all, (Some(tiles), columns));
            if work.terms > 0 {
                record.run(Kernel::Correct, work, (tiles, columns));
            }
        })?;
        self.gathered = Some(rows.to_vec());
        Ok(())
    }

    /// Staged columns from `first` on ← the gathered ones times X, all in f64 until here.
    fn multiply_gathered(
        &self,
        x: MatRef<'_, f64>,
        first: usize,
        is_added: bool,
    ) -> (Kernel, Work) {
        let numbers: Vec<E> =
            (0..x.nrows()).flat_map(|i| (0..x.ncols()).map(move |j| E::of(x[(i, j)]))).collect();
        let at = self.room.front();
        self.room.write_small(at, &numbers);
        let work = Work {
            source: self.room.front(),
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
    fn write_columns(&self, first: usize, columns: MatRef<'_, f64>) {
        let stride = self.room.stride();
        let mut numbers = vec![E::default(); stride * columns.ncols()];
        for k in 0..columns.ncols() {
            for i in 0..columns.nrows() {
                numbers[k * stride + i] = E::of(columns[(i, k)]);
            }
        }
        self.room.write_panel(first, 0, &numbers);
    }

    fn load_now(&mut self, lower: MatRef<'_, f64>) -> Result<(), GpuError> {
        self.device.check()?;
        self.make_room(lower.nrows(), 0, 0)?;
        upload::all(self, lower)?;
        (self.rows, self.pending, self.staged, self.gathered) = (lower.nrows(), 0, 0, None);
        Ok(())
    }

    fn block_now(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let r = rows.len();
        if r == 0 {
            return Ok(Mat::zeros(0, 0));
        }
        self.gather(rows)?;
        let work = Work { source: self.room.front(), at: r, ..self.work() };
        let encoder = self.record(|record| record.run(Kernel::Pick, work, (r.div_ceil(TILE), r)));
        let numbers = self.fetch(encoder, From::Result, r * r)?;
        Ok(Mat::from_fn(r, r, |i, j| numbers[j * r + i]))
    }

    fn columns_now(&mut self, rows: &[usize]) -> Result<Mat<f64>, GpuError> {
        let mut columns = Mat::zeros(self.rows, rows.len());
        let batch = self.room.gather().max(1);
        for (at, rows) in rows.chunks(batch).enumerate() {
            self.gather(rows)?;
            let encoder = self.record(|_| {});
            let stride = self.room.stride();
            let numbers =
                self.fetch(encoder, From::Panel(self.room.front()), rows.len() * stride)?;
            let mut target = columns.subcols_mut(at * batch, rows.len());
            target.copy_from(self.unpack(&numbers, rows.len()));
        }
        Ok(columns)
    }

    fn product_now(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, GpuError> {
        let mut product = Mat::zeros(self.rows, x.ncols());
        if rows.is_empty() || self.rows == 0 {
            return Ok(product);
        }
        self.make_room(self.rows, x.ncols().min(self.room.gather()), rows.len())?;
        let batch = (self.room.front() - self.pending).min(self.room.gather());
        for first in (0..x.ncols()).step_by(batch.max(1)) {
            let columns = batch.min(x.ncols() - first);
            self.gather(rows)?;
            let x = x.subcols(first, columns);
            let (kernel, work) = self.multiply_gathered(x, self.pending, false);
            let blocks = self.room.stride() / TILE;
            let encoder = self.record(|record| record.run(kernel, work, (blocks, columns)));
            let from = From::Panel(self.pending);
            let numbers = self.fetch(encoder, from, columns * self.room.stride())?;
            product.subcols_mut(first, columns).copy_from(self.unpack(&numbers, columns));
        }
        Ok(product)
    }

    fn multiply_now(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, GpuError> {
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

    fn stage_now(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, GpuError> {
        let (k, all) = (staged.signs.len(), staged.x.ncols());
        self.make_room(self.rows + all - k, all, staged.rows.len())?;
        self.gather(staged.rows)?;
        let signs: Vec<E> = staged.signs.iter().map(|&sign| E::of(sign)).collect();
        self.room.write_small(self.pending, &signs);
        if let Some(plus) = staged.plus {
            self.write_columns(self.pending, plus);
        }
        let (kernel, work) = self.multiply_gathered(staged.x, self.pending, staged.plus.is_some());
        let (blocks, tiles) = (self.room.stride() / TILE, tile_rows(self.rows));
        let diagonal = Work { terms: self.pending + k, ..self.work() };
        let encoder = self.record(|record| {
            record.run(kernel, work, (blocks, all));
            record.run_on_tiles(Kernel::Diagonal, diagonal, (0, self.rows), (Some(tiles), 1));
            record.run(Kernel::CorrectDiagonal, diagonal, (tiles, 1));
        });
        self.staged = k;
        self.fetch(encoder, From::Result, self.rows)
    }

    fn accept_now(&mut self, own: MatRef<'_, f64>) -> Result<(), GpuError> {
        let (old, m) = (self.rows, own.nrows());
        self.device.check()?;
        self.gathered = None;
        let border = self.pending + self.staged;
        for a in 0..m {
            let corner: Vec<E> = (0..m).map(|b| E::of(own[(a.max(b), a.min(b))])).collect();
            self.room.write_panel(border + a, old, &corner);
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

    fn remove_now(&mut self, slot: usize, block: usize) -> Result<(), GpuError> {
        let (first, kept) = (block * slot, self.rows - block);
        let last: Vec<usize> = (kept..self.rows).collect();
        let front = self.room.front();
        let all = self.work();
        self.room.write_index(&last);
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

    fn fold_now(&mut self) -> Result<(), GpuError> {
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

/// Tiles of C in the device's order: numbers of tile `tile` of a matrix given by its lower half.
pub(crate) fn tile_of<E: DeviceScalar>(
    lower: MatRef<'_, f64>,
    (block, other): (usize, usize),
    bytes: &mut Vec<u8>,
) {
    let n = lower.nrows();
    for entry in 0..TILE_AREA {
        let (i, j) = (block * TILE + entry / TILE, other * TILE + entry % TILE);
        let is_inside = i < n && j < n;
        let value = if is_inside { lower[(i.max(j), i.min(j))] } else { 0.0 };
        E::of(value).put(bytes);
    }
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

    fn block(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.block_now(rows).map_err(|error| error.of(E::NAME))
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
