//! K x = f by preconditioned conjugate gradients, for meshes that are too large to factor.

use std::ops::ControlFlow;

use nalgebra::RowVector6;
use rayon::prelude::*;

use super::body::SixFields;
use super::multilevel::Multilevel;
use super::stiffness::FineStiffness;
use crate::error::EmbedError;

/// Residual over load at which the solution is taken; energies are then right to its square.
const RESIDUAL: f64 = 1e-8;

/// Iterations after which there is no hope.
const MOST: usize = 20_000;

/// Vertices per partial sum, whatever the number of threads: sums do not depend on it.
const CHUNK: usize = 4096;

impl FineStiffness {
    /// Six conjugate gradients side by side (they share the matrix, not the search space),
    /// preconditioned on all levels.
    pub(super) fn conjugate_gradients(
        &self,
        multilevel: &Multilevel,
        loads: &[SixFields],
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Vec<SixFields>, EmbedError> {
        let mut scratch = Vec::new();
        let mut precondition =
            |r: &[SixFields], z: &mut [SixFields]| multilevel.apply(r, z, &mut scratch);
        let norm = dot(loads, loads).map(f64::sqrt);
        let (mut x, mut r) = (vec![SixFields::zeros(); loads.len()], loads.to_vec());
        let mut z = x.clone();
        precondition(&r, &mut z);
        let (mut p, mut kp) = (z.clone(), x.clone());
        let mut energy = dot(&r, &z);
        let (mut residual, mut iterations) = (1.0, 0);
        while iterations < MOST {
            iterations += 1;
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
            let done = (residual.ln() / RESIDUAL.ln()).clamp(0.0, 1.0);
            let go_on = progress(done);
            if residual <= RESIDUAL {
                return Ok(x);
            }
            if go_on.is_break() {
                return Err(EmbedError::Stopped { done });
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
        let rows = 3 * self.vertices();
        Err(EmbedError::FineSolve { rows, iterations, residual, want: RESIDUAL })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine::FineBody;
    use crate::fine::grid::FineGrid;
    use crate::{Material, Materials};
    use yawara_mesh::volume::{Grid, LabelVolume};
    use yawara_mesh::{CellGrid, LabelTree};

    /// An L of three cubes of 2³ voxels, every third voxel a hundred times stiffer.
    fn tree() -> LabelTree {
        let solid = |i: usize| i % 4 < 2 || i / 4 % 4 < 2;
        let labels = (0..32).map(|i| if solid(i) { 1 + (i % 3 == 0) as u16 } else { 0 });
        let grid = Grid::centred([4, 4, 2], 1.0);
        let volume = LabelVolume::new(grid, labels.collect(), vec![0, 1, 2]).unwrap();
        let grid = CellGrid { cells: [2, 2, 1], voxels_per_cell: 2, first_voxel: [0; 3] };
        LabelTree::new(&volume, grid).unwrap()
    }

    fn materials() -> Materials {
        let moduli = [(1e-3, 0.0), (1.0, 0.3), (100.0, 0.4)];
        moduli.map(|(e, nu)| Material::new(e, nu, 0.0).unwrap()).to_vec().into()
    }

    #[test]
    fn both_solvers_balance_the_loads() {
        let (tree, materials) = (tree(), materials());
        let body = FineBody::new(&tree, &materials);
        let components = body.components();
        assert_eq!(components, vec![vec![0, 1, 2]]);
        let grid = FineGrid::new(&tree, &components[0]);
        assert_eq!(grid.len(), 3 * 25 - 4 * 3);
        let mut order = grid.elimination_order();
        let k = FineStiffness::new(&body, &components[0], &grid).unwrap();
        let loads = body.traction_loads(&components[0], &grid).unwrap();
        let multilevel = Multilevel::new(&body, &components[0], &grid).unwrap();
        let direct = k.cholesky(&order, &loads).unwrap();
        let mut last = 0.0;
        let iterated = k.conjugate_gradients(&multilevel, &loads, &mut |part| {
            last = part;
            ControlFlow::Continue(())
        });
        let iterated = iterated.unwrap();
        assert_eq!(last, 1.0);
        let largest = |x: &[SixFields]| x.iter().map(SixFields::amax).fold(0.0, f64::max);
        for x in [&direct, &iterated] {
            let mut f = loads.clone();
            k.apply(x, &mut f);
            let residual: Vec<SixFields> = f.iter().zip(&loads).map(|(a, b)| a - b).collect();
            assert!(largest(&residual) < 1e-8 * largest(&loads));
        }
        // Condition about 1e5 times the residual.
        let apart: Vec<SixFields> = direct.iter().zip(&iterated).map(|(a, b)| a - b).collect();
        assert!(largest(&apart) < 1e-4 * largest(&direct), "{:e}", largest(&apart));
        order.sort_unstable();
        assert!(order.into_iter().eq(0..grid.len()), "an order names every vertex once");
    }

    /// Loads that uniform tractions make balance, whatever the shape: no net force, no torque.
    #[test]
    fn tractions_balance() {
        let (tree, materials) = (tree(), materials());
        let body = FineBody::new(&tree, &materials);
        let cells = &body.components()[0];
        let grid = FineGrid::new(&tree, cells);
        let loads = body.traction_loads(cells, &grid).unwrap();
        for k in 0..6 {
            let (mut force, mut torque, mut work) =
                (nalgebra::Vector3::zeros(), nalgebra::Vector3::zeros(), 0.0);
            for (v, f) in loads.iter().enumerate() {
                let x = nalgebra::Vector3::from(grid.point(v).map(f64::from));
                let f = f.column(k).into_owned();
                force += f;
                torque += x.cross(&f);
                // Displacement u_i = x_j does the work σ_ij V.
                work += [f.x * x.x, f.y * x.y, f.z * x.z, f.x * x.y, f.y * x.z, f.z * x.x][k];
            }
            assert!(force.norm() < 1e-12 && torque.norm() < 1e-11, "{force} {torque}");
            assert!((work - 3.0 * 8.0).abs() < 1e-11, "{k}: {work}");
        }
    }

    #[test]
    fn the_watch_may_stop_it() {
        let (tree, materials) = (tree(), materials());
        let body = FineBody::new(&tree, &materials);
        let cells = &body.components()[0];
        let grid = FineGrid::new(&tree, cells);
        let k = FineStiffness::new(&body, cells, &grid).unwrap();
        let multilevel = Multilevel::new(&body, cells, &grid).unwrap();
        let loads = body.traction_loads(cells, &grid).unwrap();
        let mut calls = 0;
        let stopped = k.conjugate_gradients(&multilevel, &loads, &mut |_| {
            calls += 1;
            if calls < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        assert!(matches!(stopped, Err(EmbedError::Stopped { done }) if done < 1.0), "{stopped:?}");
        assert_eq!(calls, 3);
    }

    #[test]
    fn a_load_that_is_no_number_is_an_error_not_a_loop() {
        let (tree, materials) = (tree(), materials());
        let body = FineBody::new(&tree, &materials);
        let cells = &body.components()[0];
        let grid = FineGrid::new(&tree, cells);
        let k = FineStiffness::new(&body, cells, &grid).unwrap();
        let multilevel = Multilevel::new(&body, cells, &grid).unwrap();
        let mut loads = body.traction_loads(cells, &grid).unwrap();
        loads[0][(0, 0)] = f64::NAN;
        let error = k
            .conjugate_gradients(&multilevel, &loads, &mut |_| ControlFlow::Continue(()))
            .unwrap_err();
        assert!(matches!(error, EmbedError::FineSolve { iterations: 1, .. }), "{error}");
    }
}
