//! A law of one's own: a beam of Kelvin and Voigt's material sags slowly under its weight.
//!
//! `cargo run --release -p yawara --example own_law`

use nalgebra::Matrix6;
use yawara::{SimError, Simulation, Stages, scene_file};
use yawara_corot::{ConstitutiveLaw, MaterialPoint};
use yawara_embed::Strain;

/// σ = D ε̃ + (2η/Δt) dev(ε̃ − ε̃ₙ): a change of volume is elastic, one of shape also viscous. Its
/// state is ε̃ₙ. Here η = τ G, with which the shape follows its load within a few times τ (s).
struct KelvinVoigt(f64);

impl ConstitutiveLaw for KelvinVoigt {
    fn name(&self) -> &str {
        "kelvin_voigt"
    }

    fn state_len(&self) -> usize {
        6
    }

    fn stress(&self, point: &MaterialPoint<'_>, trial: &mut [f64]) -> Strain {
        trial.copy_from_slice(point.strain.as_slice());
        let start = Strain::from_column_slice(point.state);
        point.elasticity * start + self.tangent(point) * (point.strain - start)
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        let mut dev = Matrix6::from_diagonal(&Strain::new(1.0, 1.0, 1.0, 0.5, 0.5, 0.5));
        dev.fixed_view_mut::<3, 3>(0, 0).add_scalar_mut(-1.0 / 3.0);
        point.elasticity + 2.0 * self.0 * point.elasticity[(3, 3)] / point.step_s * dev
    }

    fn stiffening(&self, step_s: f64) -> f64 {
        1.0 + self.0 / step_s
    }
}

fn main() -> Result<(), SimError> {
    let keys = ["materials.0={young_modulus_pa=5e6,poisson_ratio=0,label=1}", "time.steps=8"];
    let (scene, _) = scene_file::load("homogeneous", &keys.map(String::from))?;
    let mut sags = Vec::new();
    for tau_s in [0.0, scene.time.step_s] {
        let law = Box::new(KelvinVoigt(tau_s));
        let stages = Stages { law: Some(law), ..Stages::by_name(&scene.stages)? };
        let mut simulation = Simulation::new(&scene, stages)?;
        while simulation.steps_left() > 0 {
            assert!(simulation.step()?.converged);
            let body = simulation.body();
            let sunk = body.rest_positions().iter().zip(body.positions()).map(|(a, b)| a.z - b.z);
            sags.push(1e3 * sunk.fold(0.0, f64::max));
        }
    }
    println!("elastic, then with tau of one step, mm: {sags:.4?}");
    // Half of what the shape lacks comes in every step.
    let lacks: Vec<f64> = sags[8..].iter().map(|sag| sags[7] - sag).collect();
    assert!(lacks.windows(2).all(|pair| (pair[1] / pair[0] - 0.5).abs() < 0.05));
    Ok(())
}
