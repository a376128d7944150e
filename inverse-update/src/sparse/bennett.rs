//! Low-rank changes of the factor, each a walk: from the vertices concerned along the elimination
//! tree to its root.
//!
//! K + U Σ Uᵀ has the factor that this recurrence makes of L and D, column by column, with w the
//! rows of U still to be eliminated and Θ = Σ at the start (block Bennett):
//! - D' = D + w_j Θ w_jᵀ, G = Θ w_jᵀ D'⁻¹, Θ ← Θ − G w_j Θ,
//! - rows i below: w_i ← w_i − L_ij w_j, then L_ij ← L_ij + w_i G.
//!
//! Only columns on the path are touched. Positive columns of U go first, with a Θ of their
//! own: with both signs at once G can be large where D' is not, a hyperbolic rotation near its
//! pole, which lost two digits more in a thousand updates. Quasi-definite matrices have no such
//! choice.

use faer::MatRef;

use super::factor::{Factor, NONE, Panel};
use super::lower::CHUNK;
use super::pivot::{BadPivot, by_rows};
use super::sweep::{SignGroup, Sweep, place};
use super::symbolic::blocks;

/// The most columns of U that go together where K is positive definite; more make several groups.
const MOST: usize = 32;

/// Working memory of walks, reused from one to the next.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// Rows of w by position, as the last panel left them and as the next one has them.
    from: Vec<u32>,
    to: Vec<u32>,
    /// Index of a position in `from`, [`NONE`] elsewhere.
    index_of: Vec<u32>,
    /// Index in `from` of each row in `to`.
    source: Vec<u32>,
    /// Columns of U of one sign each. A column of the factor is changed by one group after the
    /// other while it is in the cache, with the same result as by one walk per group.
    groups: Vec<SignGroup>,
    /// The largest ratio of a pivot's terms to the pivot, over all walks so far.
    pub loss: f64,
    /// Products of numbers, over all walks so far.
    pub operations: f64,
    /// Walks so far.
    pub walks: usize,
}

impl Factor {
    /// L D Lᵀ ← L D Lᵀ + U Σ Uᵀ with U on the rows of `positions` and Σ = diag(`signs`).
    ///
    /// Cost: (blocks of the columns on the path) · (columns of U) small products.
    /// # Errors
    /// [`BadPivot`] if a pivot has the wrong sign or has lost half of its digits; the factor is
    /// damaged then.
    pub(crate) fn update(
        &mut self,
        positions: &[u32],
        columns: MatRef<'_, f64>,
        signs: &[f64],
        scratch: &mut Scratch,
    ) -> Result<(), BadPivot> {
        scratch.start(self, positions, columns, signs);
        scratch.walks += 1;
        by_rows!(self.block, M => self.walk::<M>(scratch))
    }

    fn walk<const M: usize>(&mut self, scratch: &mut Scratch) -> Result<(), BadPivot> {
        let mut first = 0;
        while let Some(&top) = scratch.from[first..].iter().max() {
            let panel = &mut self.panels[self.panel_of[top as usize] as usize];
            let start = panel.local(top as usize);
            let before = panel.rows.len();
            scratch.enter::<M>(panel, start);
            let width = panel.width - start;
            let passed = (blocks(width, panel.rows.len()) * 2 * M * M) as f64;
            let rank: usize = scratch.groups.iter().map(|group| group.core.rank).sum();
            scratch.operations += passed * rank as f64;
            self.blocks += panel.width * (panel.rows.len() - before);
            let (negative, groups, loss) = (self.negative, &mut scratch.groups, &mut scratch.loss);
            let sweep = Sweep::<M> { start, negative, groups, loss, panel };
            if let Err(bad) = pulp::Arch::new().dispatch(sweep) {
                scratch.index_of.fill(NONE);
                return Err(bad);
            }
            first = panel.width - start;
            std::mem::swap(&mut scratch.from, &mut scratch.to);
            for group in &mut scratch.groups {
                std::mem::swap(&mut group.from, &mut group.to);
            }
            for (at, &row) in scratch.from.iter().enumerate().skip(first) {
                scratch.index_of[row as usize] = at as u32;
            }
        }
        Ok(())
    }
}

impl Scratch {
    /// Prepares for another factor.
    pub(crate) fn forget(&mut self) {
        self.index_of.clear();
        self.loss = 0.0;
    }

    /// Takes U over, in groups.
    fn start(
        &mut self,
        factor: &Factor,
        positions: &[u32],
        columns: MatRef<'_, f64>,
        signs: &[f64],
    ) {
        self.index_of.resize(factor.positions(), NONE);
        self.from.clear();
        if signs.is_empty() {
            return;
        }
        self.from.extend_from_slice(positions);
        for (at, &position) in positions.iter().enumerate() {
            self.index_of[position as usize] = at as u32;
        }
        // A quasi-definite K keeps its inertia with all of the change alone, not with part of it.
        let of = |sign: f64| (0..signs.len()).filter(move |&q| signs[q] == sign);
        let (order, most): (Vec<Vec<usize>>, usize) = match factor.negative {
            0 => (vec![of(1.0).collect(), of(-1.0).collect()], MOST),
            _ => (vec![(0..signs.len()).collect()], signs.len()),
        };
        let parts = order.iter().flat_map(|one| one.chunks(most));
        self.groups.resize_with(parts.clone().count(), SignGroup::default);
        for (group, part) in self.groups.iter_mut().zip(parts) {
            group.core.start(part.iter().map(|&q| signs[q]), factor.block);
            let (rank, rows) = (part.len(), factor.block * positions.len());
            group.from.clear();
            group.from.resize(rows.next_multiple_of(CHUNK) * rank, 0.0);
            for row in 0..rows {
                let to = place(row, rank);
                for (q, &column) in part.iter().enumerate() {
                    group.from[to + CHUNK * q] = columns[(row, column)];
                }
            }
        }
    }

    /// Brings w into the order of a panel's rows from its column `start` on. Rows that the panel
    /// does not have are added to it.
    fn enter<const M: usize>(&mut self, panel: &mut Panel, start: usize) {
        self.to.clear();
        self.to.extend(panel.positions_from(start).map(|row| row as u32));
        self.source.clear();
        for &row in &self.to {
            self.source.push(std::mem::replace(&mut self.index_of[row as usize], NONE));
        }
        for (at, &row) in self.from.iter().enumerate() {
            if self.index_of[row as usize] == at as u32 {
                self.index_of[row as usize] = NONE;
                panel.push_row(row, M);
                self.to.push(row);
                self.source.push(at as u32);
            }
        }
        for group in &mut self.groups {
            group.enter::<M>(&self.source);
        }
    }
}
