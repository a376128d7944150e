//! The factor K = L D Lᵀ: dense panels of block columns, newest vertex first.

use super::lower::{CHUNK, Lower};
use super::symbolic::blocks;

/// No position, no slot, no index.
pub(crate) const NONE: u32 = u32::MAX;

/// Rows that can be added to a panel before it is reallocated.
fn slack(rows: usize) -> usize {
    6 + rows / 8
}

/// K = L D Lᵀ with blocks of `block` rows.
///
/// A vertex has a *position*: 0 is eliminated last, a new vertex takes the next one and is
/// eliminated first. So a column has its rows at lower positions, and a change walks down to 0.
#[derive(Debug, Clone, Default)]
pub(crate) struct Factor {
    pub block: usize,
    /// Rows at the end of a block with negative pivots.
    pub negative: usize,
    /// By position, ascending.
    pub panels: Vec<Panel>,
    /// Panel of each position.
    pub panel_of: Vec<u32>,
    /// Slot of each position, [`NONE`] if its vertex is gone.
    pub slot_of: Vec<u32>,
    /// Position of each slot.
    pub position_of: Vec<u32>,
    /// Blocks on and below the diagonal, zeros of the panels included.
    pub blocks: usize,
    /// Whether who preconditions with it may read L in f32.
    pub may_round: bool,
}

/// The columns of positions `low..low + width`, which share their rows.
///
/// Local row and column 0 is the highest position, the first to be eliminated; behind the panel's
/// own positions come those of `rows`, in any order. Every scalar column is contiguous. Above and
/// on the block diagonal and behind the last row there are zeros: kernels run over them.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    pub low: usize,
    pub width: usize,
    pub rows: Vec<u32>,
    /// From one scalar column to the next.
    pub stride: usize,
    /// L, scalar column by scalar column.
    pub values: Lower,
    /// D, a row-major block per column.
    pub diagonal: Vec<f64>,
    /// D's own factors, see [`super::pivot::Pivot`].
    pub pivots: Vec<f64>,
}

impl Panel {
    /// A panel of zeros with spare capacity for some more rows.
    pub(crate) fn zeros(low: usize, width: usize, rows: Vec<u32>, block: usize) -> Self {
        let stride = Self::stride(width, rows.len(), block);
        let square = block * block * width;
        Self {
            low,
            width,
            values: vec![0.0; stride * block * width].into(),
            diagonal: vec![0.0; square],
            pivots: vec![0.0; square],
            rows,
            stride,
        }
    }

    fn stride(width: usize, rows: usize, block: usize) -> usize {
        block * (width + rows + slack(rows)) + CHUNK
    }

    /// Local row of one of the panel's own positions.
    pub(crate) fn local(&self, position: usize) -> usize {
        self.low + self.width - 1 - position
    }

    /// Position of one of the panel's own columns.
    #[inline(always)]
    pub(crate) fn position(&self, column: usize) -> usize {
        self.low + self.width - 1 - column
    }

    /// The position of every local row from that of column `start` on.
    pub(crate) fn positions_from(&self, start: usize) -> impl Iterator<Item = usize> {
        let own = (self.low..self.low + self.width - start).rev();
        own.chain(self.rows.iter().map(|&row| row as usize))
    }

    /// Adds a row of zeros.
    pub(crate) fn push_row(&mut self, position: u32, block: usize) {
        self.rows.push(position);
        self.values.forget();
        let used = block * (self.width + self.rows.len());
        if used + CHUNK <= self.stride {
            return;
        }
        let stride = Self::stride(self.width, self.rows.len(), block);
        let mut values = vec![0.0; stride * block * self.width];
        for (to, from) in values.chunks_exact_mut(stride).zip(self.values.chunks_exact(self.stride))
        {
            to[..self.stride].copy_from_slice(from);
        }
        self.values = values.into();
        self.stride = stride;
    }

    /// Removes a row; the last one takes its place. False if there is none of `position`.
    pub(crate) fn drop_row(&mut self, position: u32, block: usize) -> bool {
        let Some(at) = self.rows.iter().position(|&row| row == position) else { return false };
        self.rows.swap_remove(at);
        let gap = block * (self.width + at);
        let last = block * (self.width + self.rows.len());
        for column in self.values.chunks_exact_mut(self.stride) {
            column.copy_within(last..last + block, gap);
            column[last..last + block].fill(0.0);
        }
        true
    }

    /// Decouples a column: L and the row within the panel become 0, D the identity.
    pub(crate) fn clear_column(&mut self, local: usize, block: usize) {
        let columns = self.stride * block * local..self.stride * block * (local + 1);
        self.values[columns].fill(0.0);
        for column in self.values.chunks_exact_mut(self.stride).take(block * local) {
            column[block * local..block * (local + 1)].fill(0.0);
        }
        let own = block * block * local..block * block * (local + 1);
        for part in [&mut self.diagonal[own.clone()], &mut self.pivots[own]] {
            part.iter_mut().enumerate().for_each(|(at, entry)| {
                *entry = if at % (block + 1) == 0 { 1.0 } else { 0.0 };
            });
        }
    }

    pub(crate) fn blocks(&self) -> usize {
        blocks(self.width, self.rows.len())
    }
}

impl Factor {
    pub(crate) fn vertices(&self) -> usize {
        self.position_of.len()
    }

    pub(crate) fn positions(&self) -> usize {
        self.panel_of.len()
    }

    /// Adds a column that is eliminated before all others, in a panel of its own.
    pub(crate) fn push(&mut self, panel: Panel) {
        debug_assert_eq!((panel.low, panel.width), (self.positions(), 1));
        self.blocks += panel.blocks();
        self.position_of.push(panel.low as u32);
        self.slot_of.push(self.position_of.len() as u32 - 1);
        self.panel_of.push(self.panels.len() as u32);
        self.panels.push(panel);
    }

    /// Removes a vertex as if its row and column of K were those of the identity; what its
    /// elimination has subtracted from the others stays subtracted. The last slot takes its slot.
    pub(crate) fn remove(&mut self, slot: usize) {
        let position = self.position_of.swap_remove(slot);
        if let Some(&moved) = self.position_of.get(slot) {
            self.slot_of[moved as usize] = slot as u32;
        }
        self.slot_of[position as usize] = NONE;
        let at = self.panel_of[position as usize] as usize;
        for panel in &mut self.panels[at + 1..] {
            if panel.drop_row(position, self.block) {
                self.blocks -= panel.width;
            }
        }
        let panel = &mut self.panels[at];
        let local = panel.local(position as usize);
        panel.clear_column(local, self.block);
        if panel.width > 1 {
            return;
        }
        self.blocks -= panel.rows.len();
        panel.rows.clear();
        // Vertices that come and go leave nothing behind.
        while let Some(last) = self.panels.last() {
            if last.width > 1 || self.slot_of[last.low] != NONE {
                break;
            }
            self.blocks -= 1;
            self.panels.pop();
            self.panel_of.pop();
            self.slot_of.pop();
        }
    }
}
