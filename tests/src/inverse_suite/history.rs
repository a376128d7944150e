//! Random histories of splits, merges and changes, replayed on a maintainer and on the model.

use std::collections::HashMap;
use std::ops::Range;

use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use nalgebra::DMatrix;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_inverse_update::{
    Counts, InverseMaintainer, SparseStiffness, StiffnessChange, Update, drift,
};

use super::model::Model;
use super::scaled::Scaled;
use super::{build, comes_close, is_available, residual, solves_by_columns, updates_inverse};

/// One step of a history; all of its randomness.
#[derive(Debug, Clone)]
pub struct Op {
    kind: u8,
    picks: [Index; 4],
    vertices: usize,
    rank: usize,
    exponent: f64,
    numbers: Vec<f64>,
}

/// Histories with ratios of moduli up to 1e3.
pub fn ops(length: Range<usize>) -> impl Strategy<Value = Vec<Op>> {
    let parts =
        (0..11_u8, any::<[Index; 4]>(), 0..=4_usize, 0..=4_usize, -1.5..1.5, vec(-1.0..1.0, 61));
    let op = parts.prop_map(|(kind, picks, vertices, rank, exponent, numbers)| Op {
        kind,
        picks,
        vertices,
        rank,
        exponent,
        numbers,
    });
    vec(op, length)
}

/// A maintainer and the model, side by side.
pub struct Replay {
    maintainer: Box<dyn InverseMaintainer>,
    /// What the maintainer leaves of every residual, beyond rounding.
    residual: f64,
    model: Model,
    /// What each row went through, by vertex and row.
    passed: HashMap<(usize, usize), Passed>,
    /// The most that a diagonal ever shrank and stiffened: what it left behind in other rows stays
    /// when its own are fixed or merged.
    shrinkage: f64,
    stiffening: f64,
    /// Σ over the steps of the condition number of the scaled K, times the growth.
    conditions: f64,
    steps: f64,
    /// Condition numbers are taken every so many steps: they cost more than the step.
    stride: usize,
    worst: f64,
}

/// What the diagonal of a row of K has been.
struct Passed {
    /// Rounding in K is of the size of the largest.
    largest: f64,
    /// Rounding in C is of the inverse of the least.
    least: f64,
    /// The most that a change ever added and took, both counted.
    change: f64,
}

impl Replay {
    /// Starts from a chain of `start` vertices, to be checked every `stride` steps.
    pub fn new(
        name: &'static str,
        (block, negative): (usize, usize),
        start: usize,
        stride: usize,
    ) -> Self {
        let model = Model::chain(start, block, negative);
        let mut k = SparseStiffness::quasi_definite(start, block, negative).expect("a block");
        let slots: Vec<usize> = (0..start).collect();
        k.add(&slots, model.assemble().as_ref()).expect("a chain");
        let maintainer = build(name, k).expect("a chain that is held");
        let mut replay = Self {
            residual: residual(name),
            maintainer,
            model,
            passed: HashMap::new(),
            shrinkage: 1.0,
            stiffening: 1.0,
            conditions: 0.0,
            steps: 0.0,
            stride,
            worst: 0.0,
        };
        replay.note();
        replay
    }

    /// The largest error that [`check`](Self::check) has seen.
    pub fn worst(&self) -> f64 {
        self.worst
    }

    /// What the maintainer had to do beyond its ordinary updates.
    pub fn counts(&self) -> Counts {
        self.maintainer.counts()
    }

    /// Vertices now held.
    pub fn vertices(&self) -> usize {
        self.model.names.len()
    }

    /// Makes the steps of a history, with a check after each whole stride.
    pub fn run(&mut self, ops: &[Op]) {
        for (at, op) in ops.iter().enumerate() {
            self.step(op);
            if at % self.stride == self.stride - 1 {
                self.check();
            }
        }
    }

    /// Does what the step says on both sides, or nothing where it is not possible.
    pub fn step(&mut self, op: &Op) {
        match op.kind {
            0..2 => self.add_patch(op),
            2..5 => self.pick(op, false).into_iter().for_each(|patch| self.split(patch)),
            5..7 => self.pick(op, true).into_iter().for_each(|patch| self.merge(patch)),
            7 => self.batch(op),
            8 => self.fix(op),
            9 => self.release(op.picks[0].index(self.model.fixed.len().max(1))),
            _ => self.pick(op, false).into_iter().for_each(|patch| self.remove_patch(patch)),
        }
        self.note();
    }

    fn fix(&mut self, op: &Op) {
        let Some(last) = self.vertices().checked_sub(1) else { return };
        let slot = op.picks[0].index(self.vertices());
        let moved = self.maintainer.fix(slot).expect("a body that is held better");
        assert_eq!(moved, (slot != last).then_some(last), "the last vertex fills the gap");
        self.model.fix(slot);
    }

    /// Frees a fixed vertex, or does nothing without one.
    fn release(&mut self, at: usize) {
        if at < self.model.fixed.len() {
            let change = self.model.release(at);
            let slot = self.maintainer.split(&change).expect("a vertex that something holds");
            assert_eq!(slot, self.vertices() - 1, "a free vertex takes the last slot");
        }
    }

    /// Frees, merges and removes everything, youngest first.
    pub fn undo_all(&mut self) {
        while !self.model.fixed.is_empty() {
            self.release(0);
            self.note();
        }
        while let Some(last) = self.model.patches.len().checked_sub(1) {
            if let Some(&patch) = self.model.free(true).last() {
                self.merge(patch);
            } else {
                self.remove_patch(last);
            }
            self.note();
        }
    }

    fn pick(&self, op: &Op, split: bool) -> Option<usize> {
        let free = self.model.free(split);
        (!free.is_empty()).then(|| free[op.picks[0].index(free.len())])
    }

    fn add_patch(&mut self, op: &Op) {
        let mut vertices = Vec::new();
        for pick in &op.picks[..op.vertices.min(self.vertices())] {
            let vertex = self.model.names[pick.index(self.vertices())];
            if !vertices.contains(&vertex) {
                vertices.push(vertex);
            }
        }
        let mut numbers = op.numbers.iter().cycle();
        let number = || *numbers.next().expect("a cycle");
        let change = self.model.add_patch(vertices, 10_f64.powf(op.exponent), op.rank, number);
        self.note_change(&change);
        self.maintainer.change(&change).expect("a stiffer body");
    }

    fn remove_patch(&mut self, patch: usize) {
        let change = self.model.remove_patch(patch);
        self.note_change(&change);
        self.maintainer.change(&change).expect("a body that is still held");
    }

    fn split(&mut self, patch: usize) {
        let change = self.model.ring(patch);
        assert!(change.consistency_error() < 1e-12, "the model's own change");
        let slot = self.maintainer.split(&change).expect("a legal split");
        assert_eq!(slot, self.vertices(), "a new vertex takes the last slot");
        self.model.split(patch);
    }

    /// Merges and splits as many patches in turn as the step's rank says, all at once.
    fn batch(&mut self, op: &Op) {
        let (unsplit, split) = (self.model.free(false), self.model.free(true));
        let mut updates = Vec::new();
        for at in 0..=op.rank {
            if let Some(&patch) = split.get(at) {
                let change = self.model.ring(patch);
                let slot = self.model.merge(patch);
                updates.push(Update::Merge { slot, change });
                self.note();
            }
            if let Some(&patch) = unsplit.get(at) {
                updates.push(Update::Split(self.model.ring(patch)));
                self.model.split(patch);
                self.note();
            }
        }
        self.maintainer.batch(&updates).expect("legal updates");
        assert_eq!(self.maintainer.vertices(), self.vertices(), "as many as came and went");
    }

    fn merge(&mut self, patch: usize) {
        let change = self.model.ring(patch);
        let last = self.vertices() - 1;
        let slot = self.model.merge(patch);
        let moved = self.maintainer.merge(slot, &change).expect("a legal merge");
        assert_eq!(moved, (slot != last).then_some(last), "the last vertex fills the gap");
    }

    fn scaled(&self, k: &Mat<f64>) -> Scaled {
        Scaled::of(k, self.model.negative * self.vertices())
    }

    /// The vertex and the row in it of a row of K.
    fn row(&self, i: usize) -> (usize, usize) {
        (self.model.names[i / self.model.block], i % self.model.block)
    }

    /// Keeps account of what bounds the error: condition numbers, and how much larger and smaller
    /// than now diagonals have been. Rounding stays when stiffness goes; and that of a soft C stays
    /// when K gets stiffer (one vertex: C − Y Yᵀ keeps the ε C of before), where a C is updated.
    fn note(&mut self) {
        let k = self.model.assemble();
        if (self.steps as usize).is_multiple_of(self.stride) {
            let scaled = self.scaled(&k);
            self.conditions += self.stride as f64 * scaled.condition * scaled.growth;
        }
        self.steps += 1.0;
        for i in 0..k.nrows() {
            let (row, own) = (self.row(i), k[(i, i)].abs());
            let unseen = Passed { largest: own, least: own, change: 0.0 };
            let passed = self.passed.entry(row).or_insert(unseen);
            passed.largest = passed.largest.max(own);
            passed.least = passed.least.min(own);
        }
        for i in 0..k.nrows() {
            let ((vertex, row), own) = (self.row(i), k[(i, i)].abs());
            for j in 0..self.model.block {
                self.shrinkage = self.shrinkage.max(self.passed[&(vertex, j)].largest / own);
            }
            if updates_inverse(self.maintainer.name()) {
                let passed = &self.passed[&(vertex, row)];
                self.stiffening = self.stiffening.max((own + passed.change) / passed.least);
            }
        }
    }

    fn note_change(&mut self, change: &StiffnessChange) {
        let block = self.model.block;
        for i in 0..change.added.nrows() {
            let row = self.row(block * change.slots[i / block] + i % block);
            let [more, less] =
                [&change.added, &change.removed].map(|part| part.row(i).squared_norm_l2());
            let passed = self.passed.get_mut(&row).expect("noted when it came");
            passed.change = passed.change.max(more + less);
        }
    }

    /// Compares everything that a maintainer tells with LU of the model's K, by two libraries.
    ///
    /// Bound: rounding of size ε K_ii per step in K, and of size ε κ_t K_ii per step t from C
    /// (a perturbation δC of C is one of K δC K of K, which later updates carry along); both
    /// reach the relative error of C with the factor κ of now. Hence n ε κ ρ Σ κ_t, with ρ the
    /// shrinkage of the diagonal, and κ_t times the growth of pivots where K is quasi-definite; the
    /// factor 8 stands for the products per step.
    ///
    /// In the scale of now, what step t left in a C that is updated has grown with the diagonal
    /// since: by at most the stiffening. Of both the most so far counts: fixing or merging the row
    /// that shrank takes nothing back of what it left in the others.
    ///
    /// A maintainer that refines leaves ‖S⁻¹ r_j‖ ≤ ρ ‖S⁻¹ e_j‖ of the residual of column j, hence
    /// ‖S δC S‖_F ≤ ‖Ĉ‖ ρ √n, relative to ‖Ĉ‖_F ≥ ‖Ĉ‖ at most ρ √n.
    pub fn check(&mut self) {
        let k = self.model.assemble();
        let scaled = self.scaled(&k);
        let n = k.nrows();
        let rho = self.shrinkage;
        let unit = 8.0 * (n + 1) as f64 * f64::EPSILON;
        let bound =
            unit * scaled.condition * rho * self.stiffening * (self.conditions + self.steps)
                + self.residual * (n as f64).sqrt();
        assert_eq!(self.maintainer.vertices(), self.model.names.len());
        self.check_stiffness(&k, &scaled, unit * rho * self.steps);

        let all: Vec<usize> = (0..self.vertices()).collect();
        let c = self.maintainer.columns(&all).expect("all slots");
        let reference = DMatrix::from_fn(n, n, |i, j| k[(i, j)]).lu().try_inverse();
        let reference = reference.expect("a regular matrix");
        let reference = Mat::from_fn(n, n, |i, j| reference[(i, j)]);
        let error = scaled.inverse_error(&c, &reference);
        self.worst = self.worst.max(error);
        let second = scaled.inverse_error(&c, &k.partial_piv_lu().inverse());
        for (which, error) in [("nalgebra", error), ("faer", second)] {
            assert!(error <= bound, "{error:e} from LU by {which}, bound {bound:e}");
        }
        // ‖K̂ (Ĉ − Ĉ_exact)‖ ≤ ‖K̂‖ ‖Ĉ‖_F · error, and ‖Ĉ‖_F ≤ √n κ/‖K̂‖.
        let drift = drift(&*self.maintainer, 1, 8);
        let limit = bound * scaled.condition * (n as f64).sqrt();
        assert!(drift <= limit, "drift {drift:e}, bound {limit:e}");
        self.check_solve(&c, &scaled, bound);
        self.check_compliance(&c, &scaled, bound);
        self.check_applied(&c, &scaled, bound);
    }

    fn check_stiffness(&self, k: &Mat<f64>, scaled: &Scaled, bound: f64) {
        let kept = self.maintainer.stiffness().to_dense();
        for (i, j) in entries(k) {
            let error = (kept[(i, j)] - k[(i, j)]).abs() / (scaled.scale[i] * scaled.scale[j]);
            assert!(error <= bound, "K at ({i}, {j}) is off by {error:e}, bound {bound:e}");
        }
    }

    /// `solve` is the product with the C that `columns` shows: to rounding where C itself is kept;
    /// where every column is a solution of its own, C a sum whose parts may cancel, or the solution
    /// was refined and the columns were not, to twice what each may be off by.
    ///
    /// A maintainer that refines stops at residuals of ρ and of 4 ε (|K| |u| + |f|), scaled; the
    /// latter is at most 4 ε (n ‖Ĉ‖ + 1) of the load, both reach u by the factor ‖Ĉ‖, and n
    /// columns bring the same with √n.
    fn check_solve(&self, c: &Mat<f64>, scaled: &Scaled, bound: f64) {
        let n = c.nrows();
        let f: Vec<f64> = (0..n).map(|i| scaled.scale[i] * (1.0 + i as f64).sin()).collect();
        let load = (0..n).map(|i| (f[i] / scaled.scale[i]).powi(2)).sum::<f64>().sqrt();
        let mut u = vec![f64::NAN; n];
        let steps = self.maintainer.counts().refinement_steps;
        self.maintainer.solve(&f, &mut u).expect("a finite load");
        // A solution that took a step of refinement is no longer the product.
        let is_refined = self.maintainer.counts().refinement_steps > steps;
        let is_apart =
            !solves_by_columns(self.maintainer.name()) || (is_refined && self.residual == 0.0);
        let left = self.left(load, n, scaled);
        // ‖S u‖ ≤ ‖S C S‖ ‖S⁻¹ f‖, and ‖S⁻¹ f‖ ≤ √n.
        let size_by_factor = scaled.norm(c) * (n as f64).sqrt();
        for i in 0..n {
            let want: f64 = (0..n).map(|j| c[(i, j)] * f[j]).sum();
            let size: f64 = (0..n).map(|j| (c[(i, j)] * f[j]).abs()).sum();
            let limit = if is_apart {
                2.0 * bound * size_by_factor / scaled.scale[i]
            } else {
                2.0 * n as f64 * f64::EPSILON * size + left * scaled.compliance / scaled.scale[i]
            };
            assert!((u[i] - want).abs() <= limit, "row {i}: {} instead of {want}", u[i]);
        }
    }

    /// What a maintainer that refines may leave of a `load` of n rows.
    fn left(&self, load: f64, n: usize, scaled: &Scaled) -> f64 {
        let rounding = 4.0 * f64::EPSILON * (n as f64 * scaled.compliance + 1.0);
        let stop = if self.residual > 0.0 { self.residual + rounding } else { 0.0 };
        stop * load * (1.0 + (n as f64).sqrt())
    }

    /// `apply` is the product with C, and with a reply it is C (f + e) for an e that hears what C f is: what
    /// is told is C f, each to within twice the bounds of C and of refinement.
    fn check_applied(&self, c: &Mat<f64>, scaled: &Scaled, bound: f64) {
        let n = c.nrows();
        let mut f: Vec<f64> = (0..n).map(|i| scaled.scale[i] * (2.0 + i as f64).cos()).collect();
        let product = |f: &[f64], i: usize| (0..n).map(|j| c[(i, j)] * f[j]).sum::<f64>();
        let limit = |f: &[f64], i: usize| {
            let load = (0..n).map(|j| (f[j] / scaled.scale[j]).powi(2)).sum::<f64>().sqrt();
            let error = 2.0 * (bound + n as f64 * f64::EPSILON) * scaled.norm(c) * load;
            (error + 2.0 * self.left(load, n, scaled) * scaled.compliance) / scaled.scale[i]
        };
        let check = |what: &str, f: &[f64], i: usize, got: f64| {
            let want = product(f, i);
            assert!((got - want).abs() <= limit(f, i), "{what}, row {i}: {got} instead of {want}");
        };
        // A hundredth in the norm of energy: |e_i|² ≤ C_ii eᵀ K e.
        let near = self.preconditioner(c);
        let close = |f: &[f64], i: usize| (0..n).map(|j| near[(i, j)] * f[j]).sum::<f64>();
        let check_roughly = |f: &[f64], i: usize, got: f64| {
            let energy: f64 = (0..n).map(|j| (f[j] * close(f, j)).abs()).sum();
            let rough = 1e-2 * (near[(i, i)].abs() * energy).sqrt();
            let missed = (got - close(f, i)).abs();
            assert!(missed <= rough + limit(f, i), "precondition, row {i}: off by {missed:e}");
        };
        let mut u = vec![f64::NAN; n];
        self.maintainer.apply(&f, &mut u).expect("a finite load");
        (0..n).for_each(|i| check("apply", &f, i, u[i]));
        self.maintainer.precondition(&f, &mut u).expect("a finite load");
        (0..n).for_each(|i| check_roughly(&f, i, u[i]));
        let rows: Vec<usize> = (0..n).rev().step_by(3).collect();
        let mut told = Vec::new();
        let mut reply = |there: &[f64]| {
            told = there.to_vec();
            let force = |(&row, value): (&usize, &f64)| {
                scaled.scale[row] * (1.0 + (value * scaled.scale[row]).sin())
            };
            rows.iter().zip(there).map(force).collect()
        };
        self.maintainer.apply_and_reply(&f, &rows, &mut reply, &mut u).expect("rows of K");
        rows.iter().zip(&told).for_each(|(&row, &value)| check("told", &f, row, value));
        for (&row, value) in rows.iter().zip(&told) {
            f[row] += scaled.scale[row] * (1.0 + (value * scaled.scale[row]).sin());
        }
        (0..n).for_each(|i| check("with a reply", &f, i, u[i]));
        let silent = &mut |there: &[f64]| vec![0.0; there.len()];
        self.maintainer.precondition_and_reply(&f, &rows, silent, &mut u).expect("rows of K");
        (0..n).for_each(|i| check_roughly(&f, i, u[i]));
    }

    /// What `precondition` comes close to: C, or by its own columns a matrix that is symmetric and has the signs of K.
    fn preconditioner(&self, c: &Mat<f64>) -> Mat<f64> {
        if comes_close(self.maintainer.name()) {
            return c.clone();
        }
        let n = c.nrows();
        let mut near = Mat::zeros(n, n);
        for j in 0..n {
            let mut unit = vec![0.0; n];
            unit[j] = 1.0;
            self.maintainer.precondition(&unit, near.col_as_slice_mut(j)).expect("a finite load");
        }
        for (i, j) in entries(&near) {
            let size = (near[(i, i)] * near[(j, j)]).abs().sqrt();
            let apart = (near[(i, j)] - near[(j, i)]).abs();
            assert!(apart <= 1e-6 * size, "precondition ({i}, {j}) is {apart:e} from symmetric");
        }
        for i in 0..n {
            let sign = if i % self.model.block + self.model.negative < self.model.block {
                1.0
            } else {
                -1.0
            };
            assert!(sign * near[(i, i)] > 0.0, "precondition ({i}, {i}): {:e}", near[(i, i)]);
        }
        near
    }

    /// `compliance` is the block of C that `columns` shows, each to within the bound of both.
    fn check_compliance(&self, c: &Mat<f64>, scaled: &Scaled, bound: f64) {
        let block = self.model.block;
        // Not ascending, and not all.
        let slots: Vec<usize> = (0..self.vertices()).rev().step_by(2).collect();
        let row = |i: usize| block * slots[i / block] + i % block;
        let units: Vec<_> = (0..block * slots.len()).map(|i| vec![(row(i), 1.0)]).collect();
        let got = self.maintainer.compliance(&units).expect("rows that are there");
        assert_eq!(got.shape(), (block * slots.len(), block * slots.len()));
        let limit = 2.0 * bound * scaled.norm(c);
        let rough = self.maintainer.rough_compliance(&units).expect("rows that are there");
        let near = self.preconditioner(c);
        for (i, j) in entries(&rough) {
            let (at, to) = (row(i), row(j));
            let weight = scaled.scale[at] * scaled.scale[to];
            let size = (near[(at, at)] * near[(to, to)]).abs().sqrt();
            let error = (rough[(i, j)] - near[(at, to)]).abs();
            let most = 2e-2 * size + limit / weight;
            assert!(error <= most, "rough compliance ({at}, {to}) is off by {error:e}");
        }
        for (i, j) in entries(&got) {
            let (at, to) = (row(i), row(j));
            let weight = scaled.scale[at] * scaled.scale[to];
            let error = (got[(i, j)] - c[(at, to)]).abs() * weight;
            assert!(error <= limit, "compliance ({at}, {to}) is off by {error:e}");
            assert_eq!(got[(i, j)], got[(j, i)]);
        }
        // Two loads that share a row: of the sum of all and of the first alone, each row as stiff as it is.
        let all: Vec<_> = (0..got.nrows()).map(|i| (row(i), scaled.scale[row(i)])).collect();
        let loads = [all.clone(), all.iter().take(1).copied().collect()];
        let less = self.maintainer.compliance(&loads).expect("rows that are there");
        for (i, j) in entries(&less) {
            let pairs = loads[i].iter().flat_map(|a| loads[j].iter().map(move |b| (a, b)));
            let want: f64 = pairs.map(|(a, b)| a.1 * b.1 * c[(a.0, b.0)]).sum();
            let error = (less[(i, j)] - want).abs();
            assert!(error <= limit * all.len() as f64, "loads {i}, {j}: off by {error:e}");
        }
    }
}

fn entries(matrix: &Mat<f64>) -> impl Iterator<Item = (usize, usize)> {
    let (rows, columns) = matrix.shape();
    (0..rows).flat_map(move |i| (0..columns).map(move |j| (i, j)))
}

/// Makes a history and undoes it, with a check after every step; nothing where there is no such
/// maintainer.
pub fn random_history(name: &'static str, block: (usize, usize), start: usize, ops: &[Op]) {
    if is_available(name) {
        let mut replay = Replay::new(name, block, start, 1);
        replay.run(ops);
        replay.undo_all();
        replay.check();
    }
}
