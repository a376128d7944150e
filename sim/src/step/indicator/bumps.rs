//! What is out of balance on the bump of every edge, and what that costs.

use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};
use yawara_corot::{EDGES, EdgeLoad, Element, Loads};
use yawara_embed::Strain;

use super::sight::{Dual, Measured, Sight};
use super::stencils::Stencils;
use crate::body::BodyState;

/// An error over what all bumps would take of it: they stand for a mesh of half the edges, which leaves a
/// quarter, since energies of errors go with the square of the edges.
pub(super) const OVER_GAIN: f64 = 4.0 / 3.0;

/// What each element counts for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    /// ½ rᵀA⁻¹r: the energy that a bump would release.
    Energy,
    /// |rᵀA⁻¹r*|, r* the residual of the first dual: what the bump would change of the goal.
    Goal,
}

/// Measures the bumps of all edges, and keeps what the next measurement may need again.
#[derive(Default)]
pub(super) struct Bumps {
    stencils: Stencils,
    /// The last measurement, and what it was of; none of a law with states.
    last: Option<(Seen, Measured)>,
    /// What elements leave at each vertex, N, and their volume there, m³; then N/m³.
    left: Vec<(Vector3<f64>, f64)>,
    /// Of each solid element the forces on its corners, N.
    forces: Vec<[Vector3<f64>; 4]>,
    /// By bump, N/m: the lower half by columns.
    stiffness: Vec<[f64; 6]>,
    /// By bump, m.
    heights: Vec<Vector3<f64>>,
    /// By bump, what each element around it has of its worth.
    shares: Vec<f64>,
}

/// What a measurement depends on besides stencils.
#[derive(PartialEq)]
struct Seen {
    weight: Weight,
    positions: Vec<Vector3<f64>>,
    pressures: Vec<f64>,
    is_free: Vec<bool>,
    loads: SeenLoads,
    duals: Vec<(Vec<Vector3<f64>>, Vec<f64>, SeenLoads)>,
}

/// Those of vertices and those of edges.
type SeenLoads = (Vec<Vector3<f64>>, Vec<EdgeLoad>);

impl Seen {
    fn new(sight: &Sight<'_>, weight: Weight) -> Self {
        let state = sight.body;
        let positions = state.positions().to_vec();
        let seen = |loads: &Loads| (loads.vertices().to_vec(), loads.edges().to_vec());
        let dual = |dual: &Dual| (dual.field.clone(), dual.pressures.clone(), seen(&dual.loads));
        Self {
            weight,
            is_free: (0..positions.len()).map(|v| state.is_free(v)).collect(),
            positions,
            pressures: state.body.pressures(),
            loads: seen(sight.loads),
            duals: sight.duals.iter().map(dual).collect(),
        }
    }
}

/// The bump of each of the loads on edges that has one.
fn loaded(stencils: &Stencils, loads: &Loads, mut visit: impl FnMut(usize, &EdgeLoad)) {
    for load in loads.edges() {
        if let Some(bump) = stencils.find(&load.ends) {
            visit(bump, load);
        }
    }
}

/// Bumps that are solved side by side.
const TOGETHER: usize = 8;

/// A⁻¹ r of each bump, m; zero where A is not positive definite.
struct Solve<'a> {
    /// The lower halves of A by columns, N/m.
    stiffness: &'a [[f64; 6]],
    /// r, N.
    residuals: &'a [Vector3<f64>],
    heights: &'a mut [Vector3<f64>],
}

impl WithSimd for Solve<'_> {
    type Output = ();

    /// Plain loops over lanes, which the compiler brings to the vector unit.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { stiffness, residuals, heights } = self;
        let chunks = stiffness.chunks(TOGETHER).zip(residuals.chunks(TOGETHER));
        for ((stiffness, residuals), heights) in chunks.zip(heights.chunks_mut(TOGETHER)) {
            // Behind the last one A = I and r = 0.
            let mut a = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0].map(|entry| [entry; TOGETHER]);
            let mut r = [[0.0; TOGETHER]; 3];
            for (lane, (stiffness, residual)) in stiffness.iter().zip(residuals).enumerate() {
                (0..6).for_each(|entry| a[entry][lane] = stiffness[entry]);
                (0..3).for_each(|axis| r[axis][lane] = residual[axis]);
            }
            for lane in 0..TOGETHER {
                let [xx, yx, zx, yy, zy, zz] = [0, 1, 2, 3, 4, 5].map(|entry| a[entry][lane]);
                // A = L D Lᵀ.
                let (l_yx, l_zx) = (yx / xx, zx / xx);
                let (d_y, t_zy) = (yy - l_yx * yx, zy - l_zx * yx);
                let l_zy = t_zy / d_y;
                let d_z = zz - l_zx * zx - l_zy * t_zy;
                let y = r[1][lane] - l_yx * r[0][lane];
                let z = (r[2][lane] - l_zx * r[0][lane] - l_zy * y) / d_z;
                let y = y / d_y - l_zy * z;
                let x = r[0][lane] / xx - l_yx * y - l_zx * z;
                let is_definite = xx > 0.0 && d_y > 0.0 && d_z > 0.0;
                (0..3).for_each(|axis| {
                    r[axis][lane] = if is_definite { [x, y, z][axis] } else { 0.0 }
                });
            }
            for (lane, height) in heights.iter_mut().enumerate() {
                *height = Vector3::new(r[0][lane], r[1][lane], r[2][lane]);
            }
        }
    }
}

impl Bumps {
    /// r by bump, N: ∫ fφ − ∫ σ∇φ of the stresses that elements have by `stress` (Pa, in their frames)
    /// under `loads`. What these leave at vertices is spread over the elements around by volume.
    fn residuals(
        &mut self,
        state: &BodyState,
        mut stress: impl FnMut(usize) -> Strain,
        loads: &Loads,
    ) -> Vec<Vector3<f64>> {
        let Self { stencils, left, forces, .. } = self;
        let elements = state.elements();
        left.clear();
        left.resize(state.positions().len(), (Vector3::zeros(), 0.0));
        forces.clear();
        forces.extend(stencils.solids.iter().map(|&number| {
            let Element { geometry, vertices, .. } = &elements[number];
            let s = stress(number);
            let s = Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2]);
            let scaled = geometry.volume * state.body.rotation(number);
            let forces = geometry.gradients.map(|g| scaled * (s * g));
            for (&v, force) in vertices.iter().zip(&forces) {
                left[v].0 += force;
                left[v].1 += geometry.volume;
            }
            forces
        }));
        left.iter_mut().zip(loads.vertices()).for_each(|(left, load)| left.0 -= load);
        for (v, (force, volume)) in left.iter_mut().enumerate() {
            let counts = state.is_free(v) && *volume > 0.0;
            *force = if counts { *force / *volume } else { Vector3::zeros() };
        }
        let mut residuals = vec![Vector3::zeros(); stencils.ends.len()];
        for (&number, forces) in stencils.solids.iter().zip(forces) {
            let Element { geometry, vertices, .. } = &elements[number];
            let load: Vector3<f64> = vertices.iter().map(|&v| left[v].0).sum();
            let load = 0.2 * geometry.volume * load;
            for (bump, [i, j]) in stencils.of[number].iter().zip(EDGES) {
                residuals[*bump] += load - forces[i] - forces[j];
            }
        }
        loaded(stencils, loads, |bump, load| residuals[bump] += load.force);
        residuals
    }

    /// The indicator of all elements by `weight`, and the errors of energy and of the duals' figures.
    ///
    /// Cost: some thousand flops per element; a comparison where nothing has changed since the last call.
    pub fn measure(&mut self, sight: &Sight<'_>, weight: Weight) -> Measured {
        let is_same_body = self.stencils.follow(sight.body);
        let is_memoryless = sight.body.body.law().state_len() == 0;
        let seen = is_memoryless.then(|| Seen::new(sight, weight));
        if let (true, Some(seen), Some((last, measured))) = (is_same_body, &seen, &self.last)
            && seen == last
        {
            return measured.clone();
        }
        let measured = self.measure_anew(sight, weight);
        self.last = seen.map(|seen| (seen, measured.clone()));
        measured
    }

    fn measure_anew(&mut self, sight: &Sight<'_>, weight: Weight) -> Measured {
        let (state, body, positions) = (sight.body, &sight.body.body, sight.body.positions());
        let mut stored_j = body.energy_of_grips(positions);
        let mut seen = 0;
        let mut stress = |number: usize| {
            let (stress, energy) = body.stress_and_energy(number, positions);
            stored_j += energy;
            // Elements of void are left out.
            let voids = (seen..number).map(|void| body.stress_and_energy(void, positions).1);
            stored_j += voids.sum::<f64>();
            seen = number + 1;
            stress
        };
        let primal = self.residuals(state, &mut stress, sight.loads);
        let rest = seen..state.elements().len();
        stored_j += rest.map(|void| body.stress_and_energy(void, positions).1).sum::<f64>();
        let dual = |dual: &Dual| {
            let Dual { field, pressures, loads, .. } = dual;
            self.residuals(state, |number| body.stress_change(number, field, pressures), loads)
        };
        let duals: Vec<Vec<Vector3<f64>>> = sight.duals.iter().map(dual).collect();
        let Self { stencils, stiffness, heights, shares, .. } = self;
        stencils.stiffness(stiffness);
        loaded(stencils, sight.loads, |bump, load| {
            [0, 3, 5].into_iter().for_each(|own| stiffness[bump][own] += load.stiffness);
        });
        heights.resize(primal.len(), Vector3::zeros());
        Arch::new().dispatch(Solve { stiffness, residuals: &primal, heights });
        shares.clear();
        let (mut energy, mut errors) = (0.0, vec![0.0; duals.len()]);
        for (bump, (ends, around)) in stencils.ends.iter().zip(&stencils.around).enumerate() {
            // What does not move takes nothing.
            if !ends.iter().any(|&v| state.is_free(v)) {
                shares.push(0.0);
                continue;
            }
            let height = heights[bump];
            let released = 0.5 * primal[bump].dot(&height);
            energy += released;
            let changes = duals.iter().map(|dual| dual[bump].dot(&height));
            errors.iter_mut().zip(changes.clone()).for_each(|(error, change)| *error += change);
            let worth = match weight {
                Weight::Energy => released,
                Weight::Goal => changes.map(f64::abs).next().unwrap_or(0.0),
            };
            shares.push(worth / *around as f64);
        }
        let mut values = vec![0.0; state.elements().len()];
        for &number in &stencils.solids {
            values[number] = stencils.of[number].iter().map(|&bump| shares[bump]).sum();
        }
        let errors = errors.into_iter().map(|error: f64| OVER_GAIN * error.abs()).collect();
        Measured {
            values,
            stored_j: Some(stored_j),
            energy_error: Some(OVER_GAIN * energy),
            errors,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::super::{Indicator, Residual, RingMember};
    use super::*;
    use crate::{Simulation, Stages, scene_file};

    /// How often the body had moved, how often it had not, and the elements of each time.
    type Seen = Arc<Mutex<(Vec<usize>, usize)>>;

    /// Measures with what was kept and with nothing kept, by both weights, and twice.
    #[derive(Default)]
    struct Checked {
        kept: Mutex<[Bumps; 2]>,
        seen: Seen,
    }

    impl Indicator for Checked {
        fn name(&self) -> &'static str {
            "residual"
        }

        fn unit(&self) -> &'static str {
            "J"
        }

        fn measure(&self, ring: &[RingMember]) -> f64 {
            Residual::default().measure(ring)
        }

        fn elements(&self, sight: &Sight<'_>) -> Option<Measured> {
            let weights = [Weight::Energy, Weight::Goal];
            let mut kept = self.kept.lock().unwrap();
            for (kept, weight) in kept.iter_mut().zip(weights) {
                let measured = kept.measure(sight, weight);
                let fresh = Bumps::default().measure(sight, weight);
                assert_eq!(format!("{measured:?}"), format!("{fresh:?}"));
                let (stored, whole) = (measured.stored_j.unwrap(), sight.body.energy_j());
                assert!((stored - whole).abs() <= 1e-13 * whole, "{stored} J of {whole}");
                // What was measured stays true, and nothing is measured for it.
                kept.left.clear();
                kept.stiffness.clear();
                let again = kept.measure(sight, weight);
                assert_eq!(format!("{measured:?}"), format!("{again:?}"));
                self.seen.lock().unwrap().1 += kept.left.len() + kept.stiffness.len();
            }
            self.seen.lock().unwrap().0.push(sight.body.tet_count());
            Some(kept[0].measure(sight, Weight::Energy))
        }

        fn estimates(&self) -> bool {
            true
        }

        fn error_over_sum(&self) -> Option<f64> {
            Some(OVER_GAIN)
        }
    }

    #[test]
    fn bumps_are_solved_as_each_by_its_cholesky_factor() {
        let part = |i: usize| ((37 * i + 11) % 101) as f64 / 50.0 - 1.0;
        // Nineteen are no multiple of those solved together; every fifth is not definite.
        let made: Vec<(Matrix3<f64>, Vector3<f64>)> = (0..19)
            .map(|bump| {
                let root = Matrix3::from_fn(|i, j| part(12 * bump + 3 * i + j));
                let shift = if bump % 5 == 4 { -3.0 } else { 0.1 };
                let a = root * root.transpose() + Matrix3::identity() * shift;
                (a, Vector3::from_fn(|i, _| part(12 * bump + 9 + i)))
            })
            .collect();
        let lower = |a: &Matrix3<f64>| [a.m11, a.m21, a.m31, a.m22, a.m32, a.m33];
        let stiffness: Vec<_> = made.iter().map(|(a, _)| lower(a)).collect();
        let residuals: Vec<_> = made.iter().map(|(_, r)| *r).collect();
        let mut heights = vec![Vector3::repeat(f64::NAN); made.len()];
        let solve = Solve { stiffness: &stiffness, residuals: &residuals, heights: &mut heights };
        Arch::new().dispatch(solve);
        let mut refused = 0;
        for ((a, r), height) in made.iter().zip(&heights) {
            match a.cholesky() {
                // ε times the condition number, at most 3·10² here.
                Some(factor) => assert!((height - factor.solve(r)).norm() < 1e-12 * height.norm()),
                None => {
                    refused += 1;
                    assert_eq!(*height, Vector3::zeros());
                }
            }
        }
        assert_eq!(refused, 3);
    }

    /// `scene` through splits, merges and movements.
    fn run(scene: &str, overrides: &[&str]) -> Vec<usize> {
        let overrides: Vec<String> = overrides.iter().map(|&text| text.into()).collect();
        let (scene, _) = scene_file::load(scene, &overrides).unwrap();
        let seen = Seen::default();
        let mut stages = Stages::by_name(&scene.stages).unwrap();
        stages.indicator = Box::new(Checked { seen: seen.clone(), ..Checked::default() });
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        let (mut splits, mut merges) = (0, 0);
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            (splits, merges) = (splits + report.splits, merges + report.merges);
        }
        assert!(splits > 0 && merges > 0, "{splits} splits, {merges} merges");
        let seen = seen.lock().unwrap();
        assert_eq!(seen.1, 0);
        seen.0.clone()
    }

    #[test]
    fn what_is_kept_measures_to_the_last_bit_what_nothing_kept_does() {
        let elements = run("beam", &["mesh.max_level=5"]);
        assert!(elements.len() > 5);
    }

    #[test]
    fn pressures_and_duals_are_seen() {
        run("beam", &["mesh.max_level=4", "stages.element=p1p1"]);
    }

    #[test]
    fn laws_without_memory_are_measured_once() {
        for law in ["linear", "neo_hookean"] {
            run("beam", &["mesh.max_level=4", &format!("stages.law={law}")]);
        }
    }
}
