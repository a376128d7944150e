//! Two stages of one's own beside the built-in ones, in error against time on a small liver.
//!
//! `cargo run --release -p yawara-bench --example swap_a_stage [DIR]`; docs/swap-a-stage.md walks
//! through it.

use faer::Mat;
use nalgebra::{Matrix6, SMatrix};
use yawara::Stages;
use yawara_bench::BenchError;
use yawara_bench::cases::{Selection, Shard};
use yawara_bench::pareto::{Candidate, Options, Study};
use yawara_embed::{ChildPair, Excess, Homogenisation, ParentMaterial};
use yawara_inverse_update::{
    Counts, FreshRows, InverseError, InverseMaintainer, RingChange, SparseStiffness,
    StiffnessChange,
};

// begin: homogenisation
/// Hill's mean of the bounds: halfway between equal strains and equal stresses.
struct Hill;

impl Homogenisation for Hill {
    fn name(&self) -> &str {
        "hill"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        let [d1, d2] = pair.elasticity;
        let inverse = |d: Matrix6<f64>| d.try_inverse().unwrap_or(d * f64::NAN);
        let reuss = inverse(0.5 * (inverse(d1) + inverse(d2)));
        let hill = 0.5 * (pair.mean_elasticity() + reuss);
        ParentMaterial {
            elasticity: 0.5 * (hill + hill.transpose()),
            midpoint: SMatrix::zeros(),
            excess: Excess::Unfactored,
        }
    }
}
// end: homogenisation

// begin: inverse
/// No inverse at all: conjugate gradients with the diagonal for a preconditioner.
struct Gradients(SparseStiffness);

impl InverseMaintainer for Gradients {
    fn name(&self) -> &'static str {
        "gradients"
    }
    fn vertices(&self) -> usize {
        self.0.vertices()
    }
    fn stiffness(&self) -> &SparseStiffness {
        &self.0
    }
    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.0.split(change)
    }
    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.0.merge(slot, change)
    }
    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.0.change(change)
    }
    fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError> {
        self.0.refresh(rows)
    }
    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let scaled = |r: &[f64]| (0..r.len()).map(|j| r[j] / self.0.diagonal(j)).collect();
        let (mut r, mut product) = (f.to_vec(), vec![0.0; f.len()]);
        u.fill(0.0);
        let mut z: Vec<f64> = scaled(&r);
        let mut p = z.clone();
        let (mut rz, end) = (dot(&r, &z), 1e-22 * dot(f, &z));
        for _ in 0..20 * f.len() {
            if !(rz > end) {
                break;
            }
            self.0.apply(&p, &mut product)?;
            let step = rz / dot(&p, &product);
            u.iter_mut().zip(&p).for_each(|(u, p)| *u += step * p);
            r.iter_mut().zip(&product).for_each(|(r, q)| *r -= step * q);
            z = scaled(&r);
            let next = dot(&r, &z);
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + next / rz * *p);
            rz = next;
        }
        Ok(())
    }
    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        let (m, n) = (self.0.block(), self.0.dofs());
        let unit = |i, j| f64::from(u8::from(i == m * slots[j / m] + j % m));
        self.solve_many(Mat::from_fn(n, m * slots.len(), unit).as_ref())
    }
    fn rebuild(&mut self) -> Result<(), InverseError> {
        Ok(())
    }
    fn watch(&mut self, _: u64) -> Result<f64, InverseError> {
        Ok(0.0)
    }
    fn counts(&self) -> Counts {
        Counts::default()
    }
}
// end: inverse

/// A liver of large voxels, by linear tetrahedra: conjugate gradients want a definite matrix.
const SMALL: &[&str] = &[
    "image.voxel_mm=8",
    "mesh.base_mm=32",
    "mesh.max_level=3",
    "time.steps=6",
    "stages.element=p1",
    "refinement.split_above=2e-6",
];

/// Built-in candidates that the own ones are shown beside.
const BESIDE: &[&str] = &["default", "homogenisation linear", "inverse sparse", "inverse lu"];

fn main() -> Result<(), BenchError> {
    let mut options = Options::new("liver", false);
    options.overrides = SMALL.iter().map(|&one| one.into()).collect();
    options.reference_vertices = 3_000;
    let mut study = Study::new(options)?;
    study.candidates.retain(|one| BESIDE.contains(&&one.name[..]));
    study.candidates.push(Candidate::new("own", "homogenisation hill", &[]).with_stages(|names| {
        Ok(Stages { homogenisation: Box::new(Hill), ..Stages::by_name(names)? })
    }));
    study.candidates.push(Candidate::new("own", "inverse gradients", &[]).with_stages(|names| {
        let mut stages = Stages::by_name(names)?;
        stages.inverse = Box::new(|k| Ok(Box::new(Gradients(k))));
        Ok(stages)
    }));
    let given = std::env::args_os().nth(1);
    let out = given.map_or_else(|| std::env::temp_dir().join("yawara-swap-a-stage"), Into::into);
    let selection = Selection { out, force: true, shard: Shard::ALL };
    print!("{}", study.run(&selection)?);
    println!("The report is {}", selection.out.join("report.html").display());
    Ok(())
}
