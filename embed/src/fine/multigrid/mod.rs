//! A preconditioner by smoothed aggregation: coarse vertices that move like rigid bodies.
//!
//! `aggregates.rs` says which vertices they stand for, `level.rs` has the smoother and the way
//! between two levels, `rows.rs` the sparse matrices. Open this file first.

mod aggregates;
mod level;
mod rows;

use faer::Mat;
use faer::sparse::{SparseColMat, Triplet};
use nalgebra::SMatrix;
use yawara_mesh::kuhn::Point;

use super::cholesky::SparseCholesky;
use level::{Level, Problem};
pub(super) use rows::{BlockRows, Six};

/// Vertices at which there is no coarser level: their matrix is factored.
const COARSEST: usize = 250;

/// ‖A_ij‖² over ‖A_ii‖‖A_jj‖ above which i and j are strongly coupled, on the finest level: 0.08². A
/// soft phase and a stiff one are not.
const STRONG: f64 = 0.0064;

/// One V-cycle of algebraic multigrid by smoothed aggregation, with rigid motions as what every level
/// has to keep, a Gauss-Seidel sweep before and after each correction, and a factor of the coarsest
/// matrix. Symmetric positive definite.
///
/// Whatever is coupled weakly, such as a stiff phase and a soft one, is in different aggregates, so
/// that the number of iterations hardly depends on the ratio of materials. Cost: about three products
/// with K and its memory half as much again. Source: Vaněk, Mandel, Brezina, Computing 56, 1996.
pub(super) struct Multigrid {
    finest: Level<3>,
    coarse: Vec<Level<6>>,
    coarsest: SparseCholesky,
}

impl Multigrid {
    /// From K and the places of its vertices; none if a coarsest matrix is not positive definite.
    pub fn new(k: BlockRows<3, 3>, points: &[Point]) -> Option<Self> {
        let problem = Problem {
            motions: rigid_motions(points),
            places: points.to_vec(),
            matrix: k,
            strong: STRONG,
        };
        let (finest, mut problem) = Level::new(problem);
        let mut coarse = Vec::new();
        while problem.matrix.len() > COARSEST {
            let vertices = problem.matrix.len();
            let (level, next) = Level::new(problem);
            coarse.push(level);
            problem = next;
            // Hardly anything is coupled any more.
            if 2 * problem.matrix.len() > vertices {
                break;
            }
        }
        let matrix = problem.matrix;
        let n = 6 * matrix.len();
        let entry = |i: usize, at: usize| {
            let (j, block) = (matrix.columns[at] as usize, &matrix.blocks[at]);
            let places = (0..36).map(|place| (place % 6, place / 6));
            places.map(move |(a, b)| Triplet::new(6 * i + a, 6 * j + b, block[(a, b)]))
        };
        let entries = (0..matrix.len()).flat_map(|i| matrix.row(i).map(move |at| (i, at)));
        let lower: Vec<Triplet<usize, usize, f64>> =
            entries.flat_map(|(i, at)| entry(i, at)).filter(|t| t.row >= t.col).collect();
        let lower = SparseColMat::try_new_from_triplets(n, n, &lower).ok()?;
        let coarsest = SparseCholesky::new(&lower, None, 6)?;
        Some(Self { finest, coarse, coarsest })
    }

    /// K.
    pub fn matrix(&self) -> &BlockRows<3, 3> {
        self.finest.matrix()
    }

    /// z ≈ K⁻¹ r.
    pub fn apply(&self, r: &[Six<3>]) -> Vec<Six<3>> {
        self.finest.cycle(r, |r| self.correct(&self.coarse, r))
    }

    fn correct(&self, levels: &[Level<6>], r: Vec<Six<6>>) -> Vec<Six<6>> {
        if let [level, coarser @ ..] = levels {
            return level.cycle(&r, |r| self.correct(coarser, r));
        }
        let mut x = Mat::from_fn(6 * r.len(), 6, |i, k| r[i / 6][i % 6][k]);
        self.coarsest.solve_in_place(&mut x);
        let six =
            |i: usize| std::array::from_fn(|axis| std::array::from_fn(|k| x[(6 * i + axis, k)]));
        (0..r.len()).map(six).collect()
    }
}

/// Three translations and three rotations about the mean of the points.
fn rigid_motions(points: &[Point]) -> Vec<SMatrix<f64, 3, 6>> {
    let n = points.len() as f64;
    let mean: [f64; 3] =
        std::array::from_fn(|axis| points.iter().map(|p| f64::from(p[axis])).sum::<f64>() / n);
    let motions = |p: &Point| {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| f64::from(p[axis]) - mean[axis]);
        #[rustfmt::skip]
        let rows = [
            1.0, 0.0, 0.0, 0.0, z,   -y,
            0.0, 1.0, 0.0, -z,  0.0, x,
            0.0, 0.0, 1.0, y,   -x,  0.0,
        ];
        SMatrix::from_row_slice(&rows)
    };
    points.iter().map(motions).collect()
}
