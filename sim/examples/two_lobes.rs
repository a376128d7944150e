//! Two lobes a voxel apart, of which one is pulled away from the other, in tetrahedra coarser than a voxel: what
//! `mesh.topology` makes of the force, and of the time for it. `cargo run --release -p yawara --example two_lobes`.

use std::time::Instant;

use yawara::{Simulation, scene_file};
use yawara_mesh::volume::{Grid, LabelVolume};

/// Voxels, of 4 mm, and those of a base cell.
const DIMS: [usize; 3] = [24, 8, 16];
const VOXEL_MM: f64 = 4.0;

/// Level of tetrahedra as fine as voxels, and one as fine as the reference.
const VOXELS: u8 = 6;
const REFERENCE: u8 = 8;

/// The lobes stand on a common ground, on both sides of a void one voxel wide.
fn lobes() -> Result<LabelVolume, Box<dyn std::error::Error>> {
    let [nx, ny, nz] = DIMS;
    let is_between = |i: usize| i % nx == 11 && i / (nx * ny) >= 4;
    let labels = (0..nx * ny * nz).map(|i| u16::from(!is_between(i))).collect();
    Ok(LabelVolume::new(Grid::centred(DIMS, VOXEL_MM), labels, vec![0, 1])?)
}

struct Pulled {
    vertices: usize,
    step_ms: f64,
    /// Of the hand at the end, and by how much it is off by the estimate, N.
    force: f64,
    estimate: f64,
}

fn pulled(topology: &str, level: u8) -> Result<Pulled, Box<dyn std::error::Error>> {
    let set = [
        "fixed=[{ shape = 'box', min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 0.0] }]".into(),
        "tools=[{ kind = 'grab', region = { shape = 'box', min = [0.0, 0.0, 0.9], max = [0.2, 1.0, 1.0] }, \
         path = [{ time_s = 0.0 }, { time_s = 1.0, move_m = [-0.01, 0.0, 0.0] }] }]"
            .into(),
        "time={ steps = 4, step_s = 0.25 }".into(),
        "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
        "materials.0.young_modulus_pa=5e3".into(),
        "materials.0.poisson_ratio=0.3".into(),
        format!(
            "mesh={{ base_mm = 16.0, start_level = {level}, max_vertices = 100000, topology = '{topology}' }}"
        ),
    ];
    let (mut scene, _) = scene_file::load("homogeneous", &set)?;
    scene.image = Default::default();
    let mut simulation = Simulation::builder(&scene).volume(lobes()?).build()?;
    let begin = Instant::now();
    let mut last = None;
    while simulation.steps_left() > 0 {
        last = Some(simulation.step()?);
    }
    let report = last.ok_or("no steps")?;
    let step_ms = begin.elapsed().as_secs_f64() * 1e3 / scene.time.steps as f64;
    let tool = &report.tools[0];
    Ok(Pulled {
        vertices: report.vertices,
        step_ms,
        force: tool.force_n.iter().map(|f| f * f).sum::<f64>().sqrt(),
        estimate: tool.force_error_n.ok_or("no estimate")?,
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let reference = pulled("components", REFERENCE)?.force;
    println!("| topology | level | vertices | ms a step | force, N | off by | by the estimate |");
    println!("|---|---|---|---|---|---|---|");
    for topology in ["merged", "components"] {
        for level in 0..=VOXELS {
            let Pulled { vertices, step_ms, force, estimate } = pulled(topology, level)?;
            let [off, by_estimate] = [force / reference - 1.0, estimate / force].map(|x| 100.0 * x);
            println!(
                "| {topology} | {level} | {vertices} | {step_ms:.2} | {force:.4} | {off:.1} % | {by_estimate:.1} % |"
            );
        }
    }
    println!("\nOff from {reference:.4} N, at level {REFERENCE}.");
    Ok(())
}
