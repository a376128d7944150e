//! An integrator of one's own: with Newmark's method a plucked beam goes on swinging.
//!
//! `cargo run --release -p yawara --example own_integrator`

use nalgebra::Vector3;
use yawara::{SimError, Simulation, Stages, scene_file};
use yawara_corot::{ImplicitEuler, TimeIntegrator, TimeStep, VertexMotion};

/// Average acceleration (β = ¼, γ = ½): a' = 4u/h² − 4v/h − a and v' = 2u/h − v with u = x' − x.
struct Newmark;

impl TimeIntegrator for Newmark {
    fn name(&self) -> &str {
        "newmark"
    }
    fn uses_accelerations(&self) -> bool {
        true
    }
    fn mass_per_s2(&self, step: &TimeStep) -> Option<f64> {
        let TimeStep { length_s: h, damping_mass_per_s: alpha } = *step;
        Some((4.0 / h + 2.0 * alpha) / h)
    }
    fn predict(&self, step: &TimeStep, start: &VertexMotion) -> Vector3<f64> {
        let TimeStep { length_s: h, damping_mass_per_s: alpha } = *step;
        let c = (4.0 / h + 2.0 * alpha) / h;
        start.position + ((4.0 / h + alpha) * start.velocity + start.acceleration) / c
    }
    fn finish(&self, step: &TimeStep, start: &VertexMotion, end: Vector3<f64>) -> VertexMotion {
        let h = step.length_s;
        let velocity = 2.0 * (end - start.position) / h - start.velocity;
        let acceleration = 2.0 * (velocity - start.velocity) / h - start.acceleration;
        VertexMotion { position: end, velocity, acceleration }
    }
}

/// How far a level beam that is let go swings up and down: first, and 1 s later, mm.
fn swing(integrator: Box<dyn TimeIntegrator>) -> Result<[f64; 2], SimError> {
    let stiff = "materials.0.young_modulus_pa=2e5";
    let keys = ["tools=[]", stiff, "mesh.max_level=0", "dynamics={}", "time.steps=150"];
    let (scene, _) = scene_file::load("drop", &keys.map(String::from))?;
    let stages = Stages { integrator: Some(integrator), ..Stages::by_name(&scene.stages)? };
    let mut simulation = Simulation::new(&scene, stages)?;
    let mut sag = Vec::new();
    while simulation.steps_left() > 0 {
        assert!(simulation.step()?.converged);
        let body = simulation.body();
        let sunk = body.rest_positions().iter().zip(body.positions()).map(|(a, b)| a.z - b.z);
        sag.push(1e3 * sunk.fold(f64::MIN, f64::max));
    }
    let highest = |part: &[f64], sign: f64| part.iter().map(|x| sign * x).fold(f64::MIN, f64::max);
    let height = |part: &[f64]| highest(part, 1.0) + highest(part, -1.0);
    Ok([height(&sag[..50]), height(&sag[100..])])
}

fn main() -> Result<(), SimError> {
    // Left alone, a vertex goes on as it was.
    let step = TimeStep { length_s: 0.1, damping_mass_per_s: 0.0 };
    let (rest, velocity) = (Vector3::zeros(), Vector3::new(3.0, 0.0, 0.0));
    let start = VertexMotion { position: rest, velocity, acceleration: Vector3::zeros() };
    let alone = Newmark.predict(&step, &start);
    assert!((alone - 0.1 * velocity).norm() < 1e-15);
    assert!((Newmark.finish(&step, &start, alone).velocity - velocity).norm() < 1e-14);
    let [newmark, euler] = [swing(Box::new(Newmark))?, swing(Box::new(ImplicitEuler))?];
    println!("newmark: {newmark:.1?} mm, implicit Euler: {euler:.1?} mm");
    assert!(newmark[1] > 0.8 * newmark[0] && euler[1] < 0.5 * euler[0]);
    Ok(())
}
