//! The vertices whose rows have changed, with a layer around them, solved for exactly.

use faer::Mat;

use super::since::{NONE, Since};
use crate::maintainer::Load;
use crate::matrix::SparseStiffness;
use crate::sparse::{BadPivot, Factor, Pattern, Symbolic, dissection_order};

/// K on some of its vertices, factored, and what couples them to the others.
#[derive(Default)]
pub(super) struct Patch {
    /// Of its vertices, ascending.
    pub slots: Vec<usize>,
    /// By slot, the vertex's number here; [`NONE`] for those outside, all of which K had before.
    number: Vec<u32>,
    factor: Factor,
    /// Operations that it took.
    pub operations: f64,
    couplings: Vec<Coupling>,
    /// Their blocks, row-major, rows those of the inner vertex.
    values: Vec<f64>,
}

/// A vertex of the patch and one outside that has a block with it.
struct Coupling {
    inner: u32,
    outer: u32,
}

/// The factor of K as it was, and what has become of it.
pub(super) struct Far<'a> {
    pub factor: &'a Factor,
    pub since: &'a Since,
    /// Whether factors may be read in f32.
    pub is_rough: bool,
}

impl Patch {
    /// The slots of the vertices whose rows have changed and of those that K couples to them.
    pub fn slots_of(k: &SparseStiffness, since: &Since) -> Vec<usize> {
        let mut is_inner = since.is_changed.clone();
        for slot in (0..k.vertices()).filter(|&slot| since.is_changed[slot]) {
            k.neighbours(slot).iter().for_each(|&other| is_inner[other] = true);
        }
        (0..k.vertices()).filter(|&slot| is_inner[slot]).collect()
    }

    /// Factors K on the vertices of `slots`, which ascend. Cost: that of a factor of as many vertices.
    /// # Errors
    /// [`BadPivot`] with the slot of the vertex for its position.
    pub fn new(k: &SparseStiffness, slots: Vec<usize>) -> Result<Self, BadPivot> {
        let (m, size) = (k.block(), k.block() * k.block());
        let mut number = vec![NONE; k.vertices()];
        slots.iter().enumerate().for_each(|(inner, &slot)| number[slot] = inner as u32);
        let mut pattern = Pattern {
            block: m,
            negative: k.negative(),
            keys: slots.iter().map(|&slot| k.order_keys()[slot]).collect(),
            starts: vec![0],
            columns: Vec::new(),
            values: Vec::new(),
        };
        let (mut couplings, mut values) = (Vec::new(), Vec::new());
        for (inner, &slot) in slots.iter().enumerate() {
            for (&other, block) in k.neighbours(slot).iter().zip(k.row_values(slot).chunks(size)) {
                if number[other] == NONE {
                    couplings.push(Coupling { inner: inner as u32, outer: other as u32 });
                    values.extend_from_slice(block);
                    continue;
                }
                pattern.columns.push(number[other]);
                pattern.values.extend_from_slice(block);
            }
            pattern.starts.push(pattern.columns.len());
        }
        let symbolic = Symbolic::new(&pattern, dissection_order(&pattern));
        let place = |position: usize| slots[symbolic.order[slots.len() - 1 - position]];
        let mut factor = Factor::new(&pattern, &symbolic)
            .map_err(|bad| BadPivot { position: place(bad.position), ..bad })?;
        factor.try_rounding(&pattern);
        let operations = symbolic.operations(pattern.block);
        Ok(Self { slots, number, factor, operations, couplings, values })
    }

    /// Multiplications of a [`cycle`](Self::cycle), those with the factor of before not included.
    pub fn multiplications(&self) -> f64 {
        let size = (self.factor.block * self.factor.block) as f64;
        size * (4 * self.factor.blocks + 2 * self.couplings.len()) as f64
    }

    /// u ≈ K⁻¹ f: the patch is solved for with the others held, the others by `far` with what that leaves
    /// them, and the patch again with the others where they are now.
    ///
    /// That is [C_pp, 0; 0, 0] + [−C_pp K_po; 1] B_oo [−K_op C_pp, 1] with C_pp = K_pp⁻¹ and B the inverse of
    /// before: symmetric, and exact if the Schur complement that the patch leaves the others is what it was.
    pub fn cycle(&self, far: &Far<'_>, f: &[f64], u: &mut [f64]) {
        let m = self.factor.block;
        let mut near = self.inner(f);
        far.solve_by(&self.factor, &mut near);
        let mut rest = vec![0.0; m * far.factor.vertices()];
        self.outer(far.since, |to, from| {
            rest[m * to..m * (to + 1)].copy_from_slice(&f[m * from..m * (from + 1)]);
        });
        self.leave(far.since, &near, |row, force| rest[row] += force);
        far.solve_by(far.factor, &mut rest);
        self.outer(far.since, |from, to| {
            u[m * to..m * (to + 1)].copy_from_slice(&rest[m * from..m * (from + 1)]);
        });
        let mut near = self.inner(f);
        for (Coupling { inner, outer }, block) in self.coupled() {
            let (inner, outer) = (m * *inner as usize, m * *outer as usize);
            let there = &u[outer..outer + m];
            for (near, row) in near[inner..inner + m].iter_mut().zip(block.chunks_exact(m)) {
                let sum: f64 = row.iter().zip(there).map(|(value, u)| value * u).sum();
                *near -= sum;
            }
        }
        far.solve_by(&self.factor, &mut near);
        for (slot, near) in self.slots.iter().zip(near.chunks_exact(m.max(1))) {
            u[m * slot..m * (slot + 1)].copy_from_slice(near);
        }
    }

    /// G M Gᵀ for the M of [`cycle`](Self::cycle), the loads the rows of G.
    pub fn compliance(&self, far: &Far<'_>, loads: &[Load]) -> Mat<f64> {
        let m = self.factor.block;
        let mut near = Mat::<f64>::zeros(m * self.slots.len(), loads.len());
        let mut rest: Vec<Load> = vec![Load::new(); loads.len()];
        for (side, load) in loads.iter().enumerate() {
            for &(row, force) in load {
                match self.number[row / m] {
                    NONE => {
                        let slot = far.since.before[row / m] as usize;
                        rest[side].push((m * slot + row % m, force));
                    }
                    inner => near[(m * inner as usize + row % m, side)] += force,
                }
            }
        }
        let moves = self.factor.solve_columns(near.as_ref());
        let mut left = vec![0.0; m * far.factor.vertices()];
        for (side, rest) in rest.iter_mut().enumerate() {
            let mut rows = Vec::new();
            self.leave(far.since, moves.col_as_slice(side), |row, force| {
                left[row] += force;
                rows.push(row);
            });
            for row in rows {
                let force = std::mem::take(&mut left[row]);
                if force != 0.0 {
                    rest.push((row, force));
                }
            }
        }
        let whole = near.transpose() * moves + far.compliance(&rest);
        Mat::from_fn(loads.len(), loads.len(), |i, j| 0.5 * (whole[(i, j)] + whole[(j, i)]))
    }

    fn coupled(&self) -> impl Iterator<Item = (&Coupling, &[f64])> {
        let size = (self.factor.block * self.factor.block).max(1);
        self.couplings.iter().zip(self.values.chunks_exact(size))
    }

    /// The patch's part of a vector.
    fn inner(&self, f: &[f64]) -> Vec<f64> {
        let m = self.factor.block;
        let mut inner = vec![0.0; m * self.slots.len()];
        for (slot, inner) in self.slots.iter().zip(inner.chunks_exact_mut(m.max(1))) {
            inner.copy_from_slice(&f[m * slot..m * (slot + 1)]);
        }
        inner
    }

    /// The slots before and now of each vertex outside.
    fn outer(&self, since: &Since, mut each: impl FnMut(usize, usize)) {
        for (now, (&before, &number)) in since.before.iter().zip(&self.number).enumerate() {
            if number == NONE {
                each(before as usize, now);
            }
        }
    }

    /// −K_op u, by rows of before.
    fn leave(&self, since: &Since, u: &[f64], mut add: impl FnMut(usize, f64)) {
        let m = self.factor.block;
        for (Coupling { inner, outer }, block) in self.coupled() {
            let outer = m * since.before[*outer as usize] as usize;
            let here = &u[m * *inner as usize..m * (*inner as usize + 1)];
            for (u, row) in here.iter().zip(block.chunks_exact(m)) {
                row.iter().enumerate().for_each(|(axis, value)| add(outer + axis, -value * u));
            }
        }
    }
}

impl Far<'_> {
    fn solve_by(&self, factor: &Factor, side: &mut [f64]) {
        match self.is_rough {
            true => factor.precondition(side),
            false => factor.solve(side),
        }
    }

    fn compliance(&self, loads: &[Load]) -> Mat<f64> {
        match self.is_rough {
            true => self.factor.rough_compliance(loads),
            false => self.factor.compliance(loads),
        }
    }
}
