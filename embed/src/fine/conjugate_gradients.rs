//! K x = f by preconditioned conjugate gradients, for meshes that are too large to factor.

use nalgebra::{Matrix3, RowVector6};
use rayon::prelude::*;

use super::{FineStiffness, SixFields};
use crate::error::EmbedError;

/// Residual over load at which the solution is taken; energies are then right to its square.
const RESIDUAL: f64 = 1e-8;

/// Iterations after which there is no hope.
const MOST: usize = 20_000;

/// Vertices per partial sum, whatever the number of threads: sums do not depend on it.
const CHUNK: usize = 4096;

impl FineStiffness {
    /// Six conjugate gradients side by side (they share the matrix, not the search space),
    /// preconditioned by the inverse of K's diagonal blocks.
    pub(super) fn conjugate_gradients(
        &self,
        loads: &[SixFields],
        progress: &mut dyn FnMut(f64),
    ) -> Result<Vec<SixFields>, EmbedError> {
        let inverse = self.diagonal_inverse()?;
        let precondition = |r: &[SixFields], z: &mut [SixFields]| {
            z.par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(v, z)| *z = inverse[v] * r[v]);
        };
        let norm = dot(loads, loads).map(f64::sqrt);
        let (mut x, mut r) = (vec![SixFields::zeros(); loads.len()], loads.to_vec());
        let mut z = x.clone();
        precondition(&r, &mut z);
        let (mut p, mut kp) = (z.clone(), x.clone());
        let mut energy = dot(&r, &z);
        let mut residual = 1.0;
        for _ in 0..MOST {
            self.apply(&p, &mut kp);
            // A load that is solved exactly has p = 0 and stays as it is.
            let alpha = ratio(&energy, &dot(&p, &kp));
            add_scaled(&mut x, &p, &alpha);
            add_scaled(&mut r, &kp, &(-alpha));
            residual = worst(&ratio(&dot(&r, &r).map(f64::sqrt), &norm));
            // Negated, so that a NaN ends the loop.
            if !(residual < f64::INFINITY) {
                break;
            }
            progress((residual.ln() / RESIDUAL.ln()).clamp(0.0, 1.0));
            if residual <= RESIDUAL {
                return Ok(x);
            }
            precondition(&r, &mut z);
            let next = dot(&r, &z);
            let beta = ratio(&next, &energy);
            p.par_iter_mut().with_min_len(CHUNK).zip(&z).for_each(|(p, z)| {
                for k in 0..6 {
                    let column = z.column(k) + beta[k] * p.column(k);
                    p.set_column(k, &column);
                }
            });
            energy = next;
        }
        let (rows, iterations) = (3 * self.vertices(), MOST);
        Err(EmbedError::FineSolve { rows, iterations, residual, want: RESIDUAL })
    }

    fn diagonal_inverse(&self) -> Result<Vec<Matrix3<f64>>, EmbedError> {
        let [softest, stiffest] = self.moduli;
        let refused =
            || EmbedError::FineFactor { rows: 3 * self.vertices(), softest, stiffest };
        (0..self.vertices())
            .map(|v| {
                let at = self.row(v).find(|&at| self.columns[at] as usize == v);
                at.and_then(|at| self.blocks[at].try_inverse()).ok_or_else(refused)
            })
            .collect()
    }
}

/// Σ aᵀb, one sum per load.
fn dot(a: &[SixFields], b: &[SixFields]) -> RowVector6<f64> {
    let parts: Vec<RowVector6<f64>> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.component_mul(b).row_sum()).sum())
        .collect();
    parts.iter().sum()
}

/// a / b, zero where b is.
fn ratio(a: &RowVector6<f64>, b: &RowVector6<f64>) -> RowVector6<f64> {
    a.zip_map(b, |a, b| if b == 0.0 { 0.0 } else { a / b })
}

/// The largest entry; NaN if there is one.
fn worst(a: &RowVector6<f64>) -> f64 {
    a.iter().fold(0.0, |worst, &a| if a > worst || a.is_nan() { a } else { worst })
}

fn add_scaled(x: &mut [SixFields], p: &[SixFields], alpha: &RowVector6<f64>) {
    x.par_iter_mut().with_min_len(CHUNK).zip(p).for_each(|(x, p)| {
        for k in 0..6 {
            let column = x.column(k) + alpha[k] * p.column(k);
            x.set_column(k, &column);
        }
    });
}
