//! An indicator of one's own: a beam that sags is refined where it is stretched most.
//!
//! `cargo run --release -p yawara --example own_indicator`

use nalgebra::Matrix3;
use yawara::indicator::{Indicator, RingMember};
use yawara::{SimError, Simulation, Stages, scene_file};

/// The largest principal strain of a ring, times the length of its edge: how much the edge of an
/// element may be longer than at rest, m.
struct Stretch;

impl Indicator for Stretch {
    fn name(&self) -> &'static str {
        "stretch"
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        let stretch = |member: &RingMember| {
            let e = member.strain();
            let (xy, yz, zx) = (0.5 * e[3], 0.5 * e[4], 0.5 * e[5]);
            let strain = Matrix3::new(e[0], xy, zx, xy, e[1], yz, zx, yz, e[2]);
            strain.symmetric_eigenvalues().max() * member.edge.norm()
        };
        ring.iter().filter(|member| !member.is_void).map(stretch).fold(0.0, f64::max)
    }
}

fn main() -> Result<(), SimError> {
    let refine = "refinement={split_above=5e-4}";
    let keys = ["tools=[]", "materials.0.young_modulus_pa=2e5", refine, "time.steps=5"];
    let (scene, _) = scene_file::load("beam", &keys.map(String::from))?;
    let mut stages = Stages::by_name(&scene.stages)?;
    stages.indicator = Box::new(Stretch);
    let mut simulation = Simulation::new(&scene, stages)?;
    let [held, free] = halves(&simulation);
    while simulation.steps_left() > 0 {
        let report = simulation.step()?;
        println!("step {}: {} splits, {} vertices", report.step, report.splits, report.vertices);
        assert!(report.converged);
    }
    let now = halves(&simulation);
    println!("vertices in the half that is held: {held}, then {}", now[0]);
    println!("vertices in the half that is free: {free}, then {}", now[1]);
    assert!(now[0] - held > 2 * (now[1] - free));
    Ok(())
}

/// How many vertices rest in each half of the beam.
fn halves(simulation: &Simulation) -> [usize; 2] {
    let rest = simulation.body().rest_positions();
    let held = simulation.body().vertices().filter(|v| rest[v.index()].x < 0.08).count();
    [held, simulation.body().vertex_count() - held]
}
