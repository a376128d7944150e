//! Solutions by a preconditioner that only comes close.

use crate::matrix::SparseStiffness;

/// Directions before the solution is started again from where it is.
const DIRECTIONS: usize = 40;

/// Starts at most.
const STARTS: usize = 4;

/// What is left of a load at the end, if rounding allows it: less than solutions are refined for.
const LEFT: f64 = 1e-13;

/// A start that leaves more than this of what the one before left is the last.
const PROGRESS: f64 = 0.1;

/// A direction that adds less than this part of itself to those before it adds rounding.
const SINGULAR: f64 = 1e-12;

/// u with K u = f by generalised minimal residuals, in the norm of D^(−½), D = |diag K|, with M ≈ K⁻¹ on the right: M f
/// where that is exact. K need not be definite.
///
/// Cost: a product with K and one with M for each direction, and O(directions · rows) for it.
/// # Source
/// Saad, Schultz, GMRES, SIAM J. Sci. Stat. Comput. 7(3), 1986.
pub(super) fn solve(k: &SparseStiffness, f: &[f64], m: impl Fn(&[f64], &mut [f64])) -> Vec<f64> {
    let root = |i: usize| match k.diagonal(i).abs().sqrt() {
        root if root > 0.0 => root,
        _ => 1.0,
    };
    let scale: Vec<f64> = (0..f.len()).map(root).collect();
    let mut u = vec![0.0; f.len()];
    let whole = size(f, &scale);
    let mut last = whole;
    for _ in 0..STARTS {
        let Some(rest) = residual(k, f, &u) else { break };
        let left = size(&rest, &scale);
        // Also where anything is not finite.
        if !(left > LEFT * whole) || !(last == whole || left < PROGRESS * last) {
            break;
        }
        last = left;
        start(k, &scale, &rest, left, LEFT * whole, &m, &mut u);
    }
    u
}

fn size(r: &[f64], scale: &[f64]) -> f64 {
    r.iter().zip(scale).map(|(r, s)| (r / s).powi(2)).sum::<f64>().sqrt()
}

fn residual(k: &SparseStiffness, f: &[f64], u: &[f64]) -> Option<Vec<f64>> {
    let mut product = vec![0.0; f.len()];
    k.apply(u, &mut product).ok()?;
    Some(f.iter().zip(&product).map(|(f, p)| f - p).collect())
}

/// Adds to u what [`DIRECTIONS`] at most find of a residual of some size, until less than `enough` is left.
fn start(
    k: &SparseStiffness,
    scale: &[f64],
    rest: &[f64],
    left: f64,
    enough: f64,
    m: &impl Fn(&[f64], &mut [f64]),
    u: &mut [f64],
) {
    // Orthonormal in the norm of D^(−½); what M makes of them.
    let mut basis = vec![scaled(rest, left)];
    let mut moves: Vec<Vec<f64>> = Vec::new();
    // Columns of the triangle that plane rotations make of the Hessenberg matrix, and of the right-hand side.
    let (mut columns, mut rotations) = (Vec::<Vec<f64>>::new(), Vec::<(f64, f64)>::new());
    let mut sides = vec![left];
    for at in 0..DIRECTIONS {
        let (mut step, mut next) = (vec![0.0; rest.len()], vec![0.0; rest.len()]);
        m(&basis[at], &mut step);
        if k.apply(&step, &mut next).is_err() {
            break;
        }
        let product = |x: &[f64], y: &[f64]| -> f64 {
            x.iter().zip(y).zip(scale).map(|((x, y), s)| x * y / (s * s)).sum()
        };
        let mut column = vec![0.0; at + 1];
        // Twice: once loses what cancels.
        for _ in 0..2 {
            for (entry, direction) in column.iter_mut().zip(&basis) {
                let share = product(&next, direction);
                *entry += share;
                next.iter_mut().zip(direction).for_each(|(x, y)| *x -= share * y);
            }
        }
        let length = size(&next, scale);
        let reached = column.iter().fold(length, |sum, x| sum.hypot(*x));
        for (i, &(c, s)) in rotations.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
        }
        let radius = column[at].hypot(length);
        // What K can't reach is left; not a number is neither.
        if !(radius > SINGULAR * reached && radius.is_finite()) {
            break;
        }
        let (c, s) = (column[at] / radius, length / radius);
        column[at] = radius;
        rotations.push((c, s));
        columns.push(column);
        moves.push(step);
        let side = sides[at];
        sides[at] = c * side;
        sides.push(-s * side);
        if (s * side).abs() <= enough || length == 0.0 {
            break;
        }
        basis.push(scaled(&next, length));
    }
    for at in (0..columns.len()).rev() {
        let known: f64 = (at + 1..columns.len()).map(|j| columns[j][at] * sides[j]).sum();
        sides[at] = (sides[at] - known) / columns[at][at];
        u.iter_mut().zip(&moves[at]).for_each(|(u, x)| *u += sides[at] * x);
    }
}

fn scaled(x: &[f64], by: f64) -> Vec<f64> {
    x.iter().map(|x| x / by).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;
    use std::cell::Cell;

    /// Springs of 1 to 1e6 N/m in a row, of which both signs of rows are made.
    fn chain(negative: usize) -> SparseStiffness {
        let mut k = SparseStiffness::quasi_definite(40, 2, negative).unwrap();
        for i in 0..40 {
            let stiff = 10f64.powi(i as i32 % 7);
            let sign = if negative > 0 { -1.0 } else { 1.0 };
            let own = mat![[stiff, 0.5 * stiff], [0.5 * stiff, sign * stiff]];
            k.add(&[i], own.as_ref()).unwrap();
            if i > 0 {
                let pair = mat![
                    [stiff, 0.0, -stiff, 0.0],
                    [0.0, 0.0, 0.0, 0.0],
                    [-stiff, 0.0, stiff, 0.0],
                    [0.0, 0.0, 0.0, 0.0]
                ];
                k.add(&[i - 1, i], pair.as_ref()).unwrap();
            }
        }
        k
    }

    #[test]
    fn it_solves_with_what_only_comes_close() {
        for negative in [0, 1] {
            let k = chain(negative);
            let exact = k.to_dense().partial_piv_lu();
            let f: Vec<f64> = (0..80).map(|i| f64::from(i * i % 11) - 5.0).collect();
            let products = Cell::new(0);
            let u = solve(&k, &f, |r, u| {
                products.set(products.get() + 1);
                use faer::linalg::solvers::SolveCore;
                u.copy_from_slice(r);
                let side = faer::MatMut::from_column_major_slice_mut(u, 80, 1);
                exact.solve_in_place_with_conj(faer::Conj::No, side);
                // A third off, by other thirds from row to row.
                u.iter_mut().enumerate().for_each(|(i, u)| *u *= 1.0 + (i % 3) as f64 / 6.0);
            });
            let rest = residual(&k, &f, &u).unwrap();
            let unit: Vec<f64> = (0..80).map(|i| k.diagonal(i).abs().sqrt()).collect();
            assert!(size(&rest, &unit) < 1e-11 * size(&f, &unit), "{negative}");
            assert!(products.get() <= 2 * DIRECTIONS, "{negative}: {}", products.get());
        }
    }

    #[test]
    fn nothing_is_found_of_nothing_nor_of_nan() {
        let k = chain(0);
        let exact = |_: &[f64], _: &mut [f64]| panic!("not asked");
        assert_eq!(solve(&k, &[0.0; 80], exact), vec![0.0; 80]);
        let u = solve(&k, &[1.0; 80], |_, u| u.fill(f64::NAN));
        assert!(u.iter().all(|u| u.is_nan() || *u == 0.0), "{u:?}");
    }
}
