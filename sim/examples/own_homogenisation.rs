//! Swap a stage without touching any crate: a homogenisation of one's own in the liver scene.
//!
//! `cargo run --release -p yawara --example own_homogenisation`

use nalgebra::SMatrix;
use yawara::{Simulation, Stages, scene_file};
use yawara_embed::{ChildPair, Excess, Homogenisation, ParentMaterial};

/// The Reuss bound: both halves carry the same stress, D_p = 2 (D₁⁻¹ + D₂⁻¹)⁻¹.
struct Reuss;

impl Homogenisation for Reuss {
    fn name(&self) -> &str {
        "reuss"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        let [d1, d2] = pair.elasticity;
        let compliance = |d: nalgebra::Matrix6<f64>| d.try_inverse().unwrap_or(d * f64::NAN);
        let mean = 0.5 * (compliance(d1) + compliance(d2));
        ParentMaterial {
            elasticity: compliance(0.5 * (mean + mean.transpose())),
            midpoint: SMatrix::zeros(),
            excess: Excess::Unfactored,
        }
    }
}

fn main() -> Result<(), yawara::SimError> {
    let (mut scene, _) = scene_file::load("liver", &[])?;
    scene.time.steps = 6;
    let mut stages = Stages::by_name(&scene.stages)?;
    let mut built_in = Simulation::new(&scene, stages)?;

    stages = Stages::by_name(&scene.stages)?;
    stages.homogenisation = Box::new(Reuss);
    let mut own = Simulation::new(&scene, stages)?;

    println!("step  force with laminate  with reuss, N  vertices");
    while built_in.steps_left() > 0 {
        let (a, b) = (built_in.step()?, own.step()?);
        let size = |f: [f64; 3]| f.iter().map(|c| c * c).sum::<f64>().sqrt();
        println!(
            "{:4}  {:19.4}  {:13.4}  {:4} {:4}",
            a.step,
            size(a.force_n),
            size(b.force_n),
            a.vertices,
            b.vertices
        );
        assert!(a.converged && b.converged, "both rules give a solvable body");
        assert!(size(b.force_n) < size(a.force_n), "the Reuss bound is the softer one");
    }
    Ok(())
}
