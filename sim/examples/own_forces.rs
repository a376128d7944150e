//! A co-rotation of one's own: one rotation for the whole body, which is enough for a bar that spins.
//!
//! `cargo run --release -p yawara --example own_forces`

use nalgebra::{Matrix3, Vector3};
use yawara::{SimError, Simulation, Stages, scene_file};
use yawara_corot::rotation::polar_cold;
use yawara_corot::{Body, ElementCorotation, InternalForces, NoCorotation};

/// All elements turn by the rotation nearest to the body's mean deformation gradient.
struct WholeBody;

impl InternalForces for WholeBody {
    fn name(&self) -> &'static str {
        "whole_body"
    }

    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let mut sum = Matrix3::zeros();
        for element in body.elements() {
            sum += element.deformation_gradient(positions) * element.geometry.volume;
        }
        let rotation = polar_cold(&sum);
        body.forces_with_rotations(|_| rotation, positions, forces)
    }

    fn carries_pressures(&self) -> bool {
        true
    }
}

/// Where the vertices of a free bar are after it has turned by about 2 rad, m.
fn spin(forces: Box<dyn InternalForces>) -> Result<Vec<Vector3<f64>>, SimError> {
    let turning = "dynamics={spin_rad_s=[0, 0, 10]}";
    let time = "time={steps=40, step_s=0.005}";
    let keys = [turning, time, "fixed=[]", "gravity_m_s2=[0,0,0]", "mesh.start_level=0"];
    let (scene, _) = scene_file::load("homogeneous", &keys.map(String::from))?;
    let mut simulation =
        Simulation::new(&scene, Stages { forces, ..Stages::by_name(&scene.stages)? })?;
    while simulation.steps_left() > 0 {
        assert!(simulation.step()?.converged);
    }
    Ok(simulation.body().positions().to_vec())
}

fn main() -> Result<(), SimError> {
    let want = spin(Box::new(ElementCorotation))?;
    let off =
        |x: Vec<Vector3<f64>>| x.iter().zip(&want).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let (whole, none) = (off(spin(Box::new(WholeBody))?), off(spin(Box::new(NoCorotation))?));
    println!("off from a rotation per element: {:.3} mm", 1e3 * whole);
    println!("off from it without rotations: {:.3} mm", 1e3 * none);
    assert!(whole < 1e-5 && none > 0.1);
    Ok(())
}
