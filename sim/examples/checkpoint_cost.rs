//! What checkpoints of a scene cost: `cargo run --release -p yawara --example checkpoint_cost -- liver 6`.

use std::time::Instant;

use yawara::output::RunDirectory;
use yawara::{Simulation, scene_file};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "liver".into());
    let every: usize = arguments.next().map_or(Ok(6), |every| every.parse())?;
    let settings = [format!("output.checkpoint_steps={every}"), "output.frames_every=0".into()];
    let (scene, _) = scene_file::load(&name, &settings)?;
    let folder = std::env::temp_dir().join(format!("checkpoint_cost_{}", std::process::id()));
    let mut directory = RunDirectory::create(&folder, false)?;
    let mut simulation = Simulation::builder(&scene).build()?;
    directory.write_scene(&scene, simulation.plan())?;
    println!("step vertices step_ms state_ms file_ms kilobytes");
    while simulation.steps_left() > 0 {
        let begin = Instant::now();
        let report = simulation.step()?;
        let step_ms = begin.elapsed().as_secs_f64() * 1e3;
        directory.write_step(&report)?;
        if !report.step.is_multiple_of(every) {
            continue;
        }
        let begin = Instant::now();
        let checkpoint = simulation.checkpoint()?;
        let state_ms = begin.elapsed().as_secs_f64() * 1e3;
        let begin = Instant::now();
        directory.write_checkpoint(&checkpoint)?;
        let file_ms = begin.elapsed().as_secs_f64() * 1e3;
        let file = directory.resumable().map(|path| std::fs::metadata(path.join("checkpoint")));
        let kilobytes = file.transpose()?.map_or(0, |file| file.len() / 1000);
        let (step, vertices) = (report.step, report.vertices);
        println!("{step} {vertices} {step_ms:.1} {state_ms:.1} {file_ms:.1} {kilobytes}");
    }
    std::fs::remove_dir_all(directory.finish()?)?;
    Ok(())
}
