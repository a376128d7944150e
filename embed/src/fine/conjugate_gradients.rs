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
            change(&mut x, &p, |k, x, p| x + alpha[k] * p);
            change(&mut r, &kp, |k, r, kp| r - alpha[k] * kp);
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
            change(&mut p, &z, |k, p, z| z + beta[k] * p);
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

/// Changes the entries x of load k to `f(k, x, y)`.
fn change(x: &mut [SixFields], y: &[SixFields], f: impl Fn(usize, f64, f64) -> f64 + Sync) {
    x.par_iter_mut().with_min_len(CHUNK).zip(y).for_each(|(x, y)| {
        for (k, axis) in (0..6).flat_map(|k| (0..3).map(move |axis| (k, axis))) {
            x[(axis, k)] = f(k, x[(axis, k)], y[(axis, k)]);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine::FineBody;
    use crate::fine::grid::FineGrid;
    use crate::{Material, Materials};
    use nalgebra::Vector3;
    use yawara_mesh::volume::{Grid, LabelVolume};
    use yawara_mesh::{CellGrid, LabelTree};

    struct System {
        grid: FineGrid,
        k: FineStiffness,
        multilevel: Multilevel,
        loads: Vec<SixFields>,
    }

    impl System {
        /// An L of three cubes of 2³ voxels, every third voxel a hundred times stiffer.
        fn new() -> Self {
            let solid = |i: usize| i % 4 < 2 || i / 4 % 4 < 2;
            let labels = (0..32).map(|i| if solid(i) { 1 + (i % 3 == 0) as u16 } else { 0 });
            let grid = Grid::centred([4, 4, 2], 1.0);
            let volume = LabelVolume::new(grid, labels.collect(), vec![0, 1, 2]).unwrap();
            let grid = CellGrid { cells: [2, 2, 1], voxels_per_cell: 2, first_voxel: [0; 3] };
            let tree = LabelTree::new(&volume, grid).unwrap();
            let moduli = [(1e-3, 0.0), (1.0, 0.3), (100.0, 0.4)];
            let materials: Materials =
                moduli.map(|(e, nu)| Material::new(e, nu, 0.0).unwrap()).to_vec().into();
            let body = FineBody::new(&tree, &materials);
            let components = body.components();
            assert_eq!(components, vec![vec![0, 1, 2]]);
            let grid = FineGrid::new(&tree, &components[0]);
            Self {
                k: FineStiffness::new(&body, &components[0], &grid).unwrap(),
                multilevel: Multilevel::new(&body, &components[0], &grid).unwrap(),
                loads: body.traction_loads(&components[0], &grid).unwrap(),
                grid,
            }
        }

        fn iterate(
            &self,
            mut progress: impl FnMut(f64) -> ControlFlow<()>,
        ) -> Result<Vec<SixFields>, EmbedError> {
            self.k.conjugate_gradients(&self.multilevel, &self.loads, &mut progress)
        }
    }

    #[test]
    fn both_solvers_balance_the_loads() {
        let system = System::new();
        let System { grid, k, loads, .. } = &system;
        assert_eq!(grid.len(), 3 * 25 - 4 * 3);
        let mut order = grid.elimination_order();
        let direct = k.cholesky(&order, loads).unwrap();
        let mut last = 0.0;
        let iterated = system.iterate(|part| {
            last = part;
            ControlFlow::Continue(())
        });
        let iterated = iterated.unwrap();
        assert_eq!(last, 1.0);
        let largest = |x: &[SixFields]| x.iter().map(SixFields::amax).fold(0.0, f64::max);
        for x in [&direct, &iterated] {
            let mut f = loads.clone();
            k.apply(x, &mut f);
            let residual: Vec<SixFields> = f.iter().zip(loads).map(|(a, b)| a - b).collect();
            assert!(largest(&residual) < 1e-8 * largest(loads));
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
        let System { grid, loads, .. } = System::new();
        for k in 0..6 {
            let (mut force, mut torque, mut work) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for (v, f) in loads.iter().enumerate() {
                let x = Vector3::from(grid.point(v).map(f64::from));
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
        let mut calls = 0;
        let stopped = System::new().iterate(|_| {
            calls += 1;
            if calls < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        assert!(matches!(stopped, Err(EmbedError::Stopped { done }) if done < 1.0), "{stopped:?}");
        assert_eq!(calls, 3);
    }

    #[test]
    fn a_load_that_is_no_number_is_an_error_not_a_loop() {
        let mut system = System::new();
        system.loads[0][(0, 0)] = f64::NAN;
        let error = system.iterate(|_| ControlFlow::Continue(())).unwrap_err();
        assert!(matches!(error, EmbedError::FineSolve { iterations: 1, .. }), "{error}");
    }
}
