//! A tool of one's own: a spring from the free end of a beam to a point that rises.
//!
//! `cargo run --release -p yawara --example own_tool`

use nalgebra::Vector3;
use yawara::{BodyAtRest, BodyState, SimError, Simulation, Tool, scene_file};
use yawara_mesh::VertexId;

/// f = k (p(t) − x̄) on the mean x̄ of some vertices.
struct Spring {
    vertices: Vec<VertexId>,
    start: Vector3<f64>,
    velocity: Vector3<f64>,
    stiffness_n_m: f64,
}

impl Spring {
    fn at_end_of(body: &mut BodyAtRest<'_>) -> Result<Self, SimError> {
        let start = body.at([1.0, 0.5, 0.5]);
        let is_end = |v: &VertexId| (body.position(*v).x - start.x).abs() < 1e-9;
        let vertices = body.available().filter(is_end).collect();
        Ok(Self { vertices, start, velocity: Vector3::new(0.0, 0.0, 0.1), stiffness_n_m: 2.0 })
    }
}

impl Tool for Spring {
    fn kind(&self) -> &'static str {
        "spring"
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        self.start + self.velocity * t
    }

    fn add_loads(&self, body: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        let share = 1.0 / self.vertices.len() as f64;
        let at = |v: &VertexId| body.positions()[v.index()];
        let mean = self.vertices.iter().map(at).sum::<Vector3<f64>>() * share;
        for v in &self.vertices {
            loads[v.index()] += self.stiffness_n_m * share * (self.reference(t) - mean);
        }
    }
}

fn main() -> Result<(), SimError> {
    let keys = ["tools=[]", "gravity_m_s2=[0,0,0]", "time.steps=5"];
    let (scene, _) = scene_file::load("beam", &keys.map(String::from))?;
    let mut simulation = Simulation::builder(&scene).tool(Spring::at_end_of).build()?;
    while simulation.steps_left() > 0 {
        let report = simulation.step()?;
        let [pull, support] = [report.tools[0].force_n, simulation.support_force()].map(|f| f[2]);
        println!(
            "{:.1} s: it pulls with {pull:.5} N, the support with {support:.5} N",
            report.time_s
        );
        assert!(report.converged && pull > 0.0 && pull < 2.0 * 0.1 * report.time_s);
        assert!((pull + support).abs() < 1e-4 * pull);
    }
    Ok(())
}
