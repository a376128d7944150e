//! One level: its matrix, its smoother, and the way to the next coarser one.

use nalgebra::SMatrix;
use rayon::prelude::*;
use yawara_mesh::kuhn::Point;

use super::aggregates::{aggregates, tentative};
use super::rows::{BlockRows, ByColumn, Six, add};

/// Vertices per piece of parallel work in a sweep.
const CHUNK: usize = 256;

/// Steps of the power method for the largest eigenvalue of D⁻¹A.
const POWER_STEPS: usize = 8;

/// A with N unknowns per vertex, smoothed by Gauss-Seidel colour after colour: vertices of one
/// colour are not coupled, so that the result does not depend on the number of threads.
pub(super) struct Level<const N: usize> {
    /// In each row the colours ascend.
    matrix: BlockRows<N, N>,
    /// Place of each row's diagonal block.
    middle: Vec<usize>,
    inverse: Vec<SMatrix<f64, N, N>>,
    colours: Vec<Vec<u32>>,
    prolongation: BlockRows<N, 6>,
    by_aggregate: ByColumn,
}

/// What a level is made of: its matrix, and six rigid motions and a place per vertex.
pub(super) struct Problem<const N: usize> {
    pub matrix: BlockRows<N, N>,
    pub motions: Vec<SMatrix<f64, N, 6>>,
    pub places: Vec<Point>,
    /// ‖A_ij‖² over ‖A_ii‖‖A_jj‖ above which i and j are strongly coupled.
    pub strong: f64,
}

impl<const N: usize> Level<N> {
    /// A level, and the coarser one with PᵀAP: P = (I − ω D⁻¹A) T, T the motions of aggregates and
    /// ω = 4/3 over the largest eigenvalue of D⁻¹A.
    pub fn new(problem: Problem<N>) -> (Self, Problem<6>) {
        let (of, places) = aggregates(&problem.matrix, &problem.places, problem.strong);
        let count = places.len();
        let (tentative, motions) = tentative(&of, count, &problem.motions);
        let (matrix, middle, colours) = coloured(problem.matrix);
        let invert = |&at: &usize| matrix.blocks[at].try_inverse();
        let inverse: Vec<_> =
            middle.par_iter().map(|at| invert(at).unwrap_or_else(SMatrix::zeros)).collect();
        let omega = 4.0 / 3.0 / largest(&matrix, &inverse);
        let mut prolongation = matrix.times(&tentative, count);
        for i in 0..matrix.len() {
            for at in prolongation.row(i) {
                let smoothed = -omega * inverse[i] * prolongation.blocks[at];
                let own = prolongation.columns[at] == of[i];
                prolongation.blocks[at] =
                    if own { tentative.blocks[i] + smoothed } else { smoothed };
            }
        }
        let by_aggregate = ByColumn::new(&prolongation, count);
        let product = matrix.times(&prolongation, count);
        let mut coarse = prolongation.transposed_times(&by_aggregate, &product, count);
        for i in 0..count {
            for at in coarse.row(i).filter(|&at| coarse.columns[at] as usize == i) {
                // A column that stands for nothing.
                for k in (0..6).filter(|&k| motions[i][(k, k)] == 0.0) {
                    coarse.blocks[at][(k, k)] += 1.0;
                }
            }
        }
        let level = Self { matrix, middle, inverse, colours, prolongation, by_aggregate };
        (level, Problem { matrix: coarse, motions, places, strong: 0.25 * problem.strong })
    }

    pub fn matrix(&self) -> &BlockRows<N, N> {
        &self.matrix
    }

    /// z ≈ A⁻¹ r: a sweep, what `coarser` makes of the rest, and a sweep backwards; symmetric if
    /// that is.
    pub fn cycle(
        &self,
        r: &[Six<N>],
        coarser: impl FnOnce(Vec<Six<6>>) -> Vec<Six<6>>,
    ) -> Vec<Six<N>> {
        let rows = &self.matrix;
        let mut x = vec![[[0.0; 6]; N]; rows.len()];
        let mut found = Vec::new();
        for colour in &self.colours {
            // What comes later is still zero.
            self.sweep(colour, r, &mut x, &mut found, |i| rows.starts[i]..self.middle[i]);
        }
        let rest = |i: usize| rows.sum(self.middle[i] + 1..rows.starts[i + 1], &x).map(negative);
        let rest: Vec<Six<N>> =
            (0..rows.len()).into_par_iter().with_min_len(CHUNK).map(rest).collect();
        let correction = coarser(self.by_aggregate.apply(&self.prolongation, &rest));
        x.par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(i, x)| {
            for at in self.prolongation.row(i) {
                let column = self.prolongation.columns[at] as usize;
                add(x, &self.prolongation.blocks[at], &correction[column]);
            }
        });
        for colour in self.colours.iter().rev() {
            self.sweep(colour, r, &mut x, &mut found, |i| rows.row(i));
        }
        x
    }

    /// x_i ← x_i + D_i⁻¹ (r_i − Σ A_ij x_j) over the `places` of each row of a colour, which hold the
    /// diagonal or x_i = 0.
    fn sweep(
        &self,
        colour: &[u32],
        r: &[Six<N>],
        x: &mut [Six<N>],
        found: &mut Vec<Six<N>>,
        places: impl Fn(usize) -> std::ops::Range<usize> + Sync,
    ) {
        let update = |&i: &u32| {
            let i = i as usize;
            let sum = self.matrix.sum(places(i), x);
            let rest: Six<N> =
                std::array::from_fn(|a| std::array::from_fn(|k| r[i][a][k] - sum[a][k]));
            let mut new = x[i];
            add(&mut new, &self.inverse[i], &rest);
            new
        };
        colour.par_iter().with_min_len(CHUNK).map(update).collect_into_vec(found);
        colour.iter().zip(found.iter()).for_each(|(&i, &new)| x[i as usize] = new);
    }
}

fn negative(row: [f64; 6]) -> [f64; 6] {
    row.map(|c| -c)
}

/// Greedy colours in the order of the vertices; the matrix with its rows in their order, the places
/// of the diagonal, and the vertices of each colour.
fn coloured<const N: usize>(
    mut a: BlockRows<N, N>,
) -> (BlockRows<N, N>, Vec<usize>, Vec<Vec<u32>>) {
    let mut colour = vec![u32::MAX; a.len()];
    let mut colours: Vec<Vec<u32>> = Vec::new();
    let mut taken: Vec<usize> = Vec::new();
    for i in 0..a.len() {
        for at in a.row(i) {
            // Marked by the vertex that asks.
            if let Some(mark) = taken.get_mut(colour[a.columns[at] as usize] as usize) {
                *mark = i + 1;
            }
        }
        let free = taken.iter().position(|&mark| mark != i + 1).unwrap_or(taken.len());
        if free == taken.len() {
            taken.push(0);
            colours.push(Vec::new());
        }
        colour[i] = free as u32;
        colours[free].push(i as u32);
    }
    let mut middle = Vec::with_capacity(a.len());
    for i in 0..a.len() {
        let row = a.row(i);
        let mut entries: Vec<(u32, SMatrix<f64, N, N>)> =
            row.clone().map(|at| (a.columns[at], a.blocks[at])).collect();
        entries.sort_by_key(|(column, _)| (colour[*column as usize], *column));
        for (at, (column, block)) in row.zip(entries) {
            a.columns[at] = column;
            a.blocks[at] = block;
            if column as usize == i {
                middle.push(at);
            }
        }
    }
    (a, middle, colours)
}

/// The largest eigenvalue of D⁻¹A, from below, by the power method on six vectors.
fn largest<const N: usize>(a: &BlockRows<N, N>, inverse: &[SMatrix<f64, N, N>]) -> f64 {
    // Weyl's sequence: as good as random here.
    let start = |i: usize, axis: usize, k: usize| {
        ((6 * (N * i + axis) + k) as f64 * 0.618_033_988_749_895).fract() - 0.5
    };
    let mut x: Vec<Six<N>> = (0..a.len())
        .map(|i| std::array::from_fn(|axis| std::array::from_fn(|k| start(i, axis, k))))
        .collect();
    let mut y = x.clone();
    let mut value = 1.0f64;
    for _ in 0..POWER_STEPS {
        a.apply(&x, &mut y);
        y.par_iter_mut().with_min_len(CHUNK).zip(inverse).for_each(|(y, inverse)| {
            let mut scaled = [[0.0; 6]; N];
            add(&mut scaled, inverse, y);
            *y = scaled;
        });
        let norm = |x: &[Six<N>]| x.iter().flatten().flatten().map(|c| c * c).sum::<f64>().sqrt();
        value = norm(&y) / norm(&x);
        let scale = 1.0 / norm(&y);
        x.iter_mut().zip(&y).for_each(|(x, y)| *x = y.map(|row| row.map(|c| scale * c)));
    }
    value
}
