//! K x = f by preconditioned conjugate gradients, for meshes that are too large to factor.

use std::ops::ControlFlow;

use nalgebra::SMatrix;
use rayon::prelude::*;

use super::body::SixFields;
use super::multigrid::{Multigrid, Six};
use crate::error::EmbedError;

/// Residual over load at which the solution is taken; energies are then right to its square.
const RESIDUAL: f64 = 1e-8;

/// Iterations after which there is no hope.
const MOST: usize = 20_000;

/// Vertices per partial sum, whatever the number of threads: sums do not depend on it.
const CHUNK: usize = 4096;

/// Solves K x = f for six loads by conjugate gradients side by side (they share the matrix, not the
/// search space), preconditioned by a V-cycle.
///
/// # Errors
/// [`EmbedError::FineSolve`], [`EmbedError::Stopped`].
pub(super) fn conjugate_gradients(
    multigrid: &Multigrid,
    loads: &[SixFields],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<SixFields>, EmbedError> {
    let k = multigrid.matrix();
    let mut r: Vec<Six<3>> = loads.iter().map(|f| f.transpose().data.0).collect();
    let norm = dot(&r, &r).map(f64::sqrt);
    let mut x = vec![[[0.0; 6]; 3]; r.len()];
    let mut p = multigrid.apply(&r);
    let mut kp = x.clone();
    let mut energy = dot(&r, &p);
    let (mut residual, mut iterations) = (1.0, 0);
    while iterations < MOST {
        iterations += 1;
        k.apply(&p, &mut kp);
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
            return Ok(x.iter().map(|x| SMatrix::<f64, 6, 3>::from(*x).transpose()).collect());
        }
        if go_on.is_break() {
            return Err(EmbedError::Stopped { done });
        }
        let z = multigrid.apply(&r);
        let next = dot(&r, &z);
        let beta = ratio(&next, &energy);
        change(&mut p, &z, |k, p, z| z + beta[k] * p);
        energy = next;
    }
    let rows = 3 * loads.len();
    Err(EmbedError::FineSolve { rows, iterations, residual, want: RESIDUAL })
}

/// Σ aᵀb, one sum per load.
fn dot(a: &[Six<3>], b: &[Six<3>]) -> [f64; 6] {
    let part = |(a, b): (&[Six<3>], &[Six<3>])| {
        let mut sums = [0.0; 6];
        for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
            (0..6).for_each(|k| sums[k] += a[k] * b[k]);
        }
        sums
    };
    let parts: Vec<[f64; 6]> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(part).collect();
    std::array::from_fn(|k| parts.iter().map(|part| part[k]).sum())
}

/// a / b, zero where b is.
fn ratio(a: &[f64; 6], b: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|k| if b[k] == 0.0 { 0.0 } else { a[k] / b[k] })
}

/// The largest entry; NaN if there is one.
fn worst(a: &[f64; 6]) -> f64 {
    a.iter().fold(0.0, |worst, &a| if a > worst || a.is_nan() { a } else { worst })
}

/// Changes the entries x of load k to `f(k, x, y)`.
fn change(x: &mut [Six<3>], y: &[Six<3>], f: impl Fn(usize, f64, f64) -> f64 + Sync) {
    x.par_iter_mut().with_min_len(CHUNK).zip(y).for_each(|(x, y)| {
        for (x, y) in x.iter_mut().zip(y) {
            (0..6).for_each(|k| x[k] = f(k, x[k], y[k]));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine::FineBody;
    use crate::fine::grid::FineGrid;
    use crate::fine::region::Region;
    use crate::fine::stiffness::FineStiffness;
    use crate::fine::tractions::traction_loads;
    use crate::{Material, Materials};
    use nalgebra::Vector3;
    use yawara_mesh::volume::{Grid, LabelVolume};
    use yawara_mesh::{CellGrid, LabelTree};

    struct System {
        grid: FineGrid,
        k: FineStiffness,
        multigrid: Multigrid,
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
            Self::of(tree, [(1e-3, 0.0), (1.0, 0.3), (100.0, 0.4)])
        }

        fn of(tree: LabelTree, moduli: [(f64, f64); 3]) -> Self {
            let materials: Materials =
                moduli.map(|(e, nu)| Material::new(e, nu, 0.0).unwrap()).to_vec().into();
            let body = FineBody::new(&tree, &materials);
            let components = body.components();
            assert_eq!(components.len(), 1);
            let region = Region {
                cubes: components[0].iter().map(|&cell| body.root_low(cell)).collect(),
                units: tree.grid().voxels_per_cell as i32,
                visit: &|visit| components[0].iter().try_for_each(|&c| body.visit(c, visit)),
            };
            let grid = FineGrid::new(&region.cubes, region.units);
            let k = FineStiffness::new(&region, &grid).unwrap();
            Self {
                multigrid: Multigrid::new(k.rows.clone(), grid.points()).unwrap(),
                k,
                loads: traction_loads(&region, &grid).unwrap(),
                grid,
            }
        }

        fn iterate(
            &self,
            mut progress: impl FnMut(f64) -> ControlFlow<()>,
        ) -> Result<Vec<SixFields>, EmbedError> {
            conjugate_gradients(&self.multigrid, &self.loads, &mut progress)
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

    /// Balls in a body with hollows, ten thousand times as stiff and as soft.
    #[test]
    fn the_ratio_of_materials_costs_few_iterations() {
        let centre = |i: usize| [5 * i % 13, 7 * i % 11, 3 * i % 14].map(|c| c as f64 + 1.5);
        let label = |i: usize| {
            let x = [i % 16, i / 16 % 16, i / 256].map(|c| c as f64);
            let inside = |c: [f64; 3]| (0..3).map(|a| (x[a] - c[a]).powi(2)).sum::<f64>() < 7.0;
            (0..10).find(|&i| inside(centre(i))).map_or(1, |i| 2 * (i as u16 % 2))
        };
        let grid = Grid::centred([16; 3], 1.0);
        let labels = (0..4096).map(label).collect();
        let volume = LabelVolume::new(grid, labels, vec![0, 1, 2]).unwrap();
        let grid = CellGrid { cells: [2; 3], voxels_per_cell: 8, first_voxel: [0; 3] };
        let system = System::of(
            LabelTree::new(&volume, grid).unwrap(),
            [(1e-4, 0.0), (1.0, 0.3), (1e4, 0.3)],
        );
        let (mut iterations, n) = (0, 17usize.pow(3));
        assert_eq!(system.grid.len(), n);
        let count = |_| {
            iterations += 1;
            ControlFlow::Continue(())
        };
        assert!(system.iterate(count).is_ok() && iterations <= 60, "{iterations}");
        // The cycle is symmetric: six products of two fields each.
        let noise = |i: usize| (i as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let field = |from: usize| -> Vec<Six<3>> {
            (0..n).map(|v| [0, 1, 2].map(|a| [noise(from + 3 * v + a); 6])).collect()
        };
        let (u, v) = (field(0), field(7919));
        let [a, b] = [(&u, &v), (&v, &u)].map(|(u, v)| dot(u, &system.multigrid.apply(v))[0]);
        let size = dot(&u, &system.multigrid.apply(&u))[0];
        assert!(size > 0.0 && (a - b).abs() < 1e-9 * size, "{a} {b} {size}");
    }
}
