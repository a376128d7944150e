//! Runs that were interrupted go on from their last checkpoint, to the same bytes.

mod workbench;

use yawara::report::{StageTimes, StepReport};
use yawara::scene::Scene;
use yawara::{Checkpoint, Simulation, scene_file};

fn scene(name: &str, set: &[&str]) -> Scene {
    let set: Vec<String> = set.iter().map(|one| (*one).into()).collect();
    scene_file::load(name, &set).unwrap().0
}

/// All of a step but its times.
fn told(report: StepReport) -> String {
    format!("{:?}", StepReport { times: StageTimes::default(), ..report })
}

/// Steps and the frame at the end, from where the simulation is, with a checkpoint every `every` steps.
fn rest(simulation: &mut Simulation, every: usize) -> (Vec<String>, Vec<Checkpoint>) {
    let (mut all, mut kept) = (Vec::new(), Vec::new());
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        let step = report.step;
        all.push(told(report));
        if step.is_multiple_of(every) && simulation.steps_left() > 0 {
            kept.push(simulation.checkpoint().unwrap());
        }
    }
    all.push(format!("{:?}", simulation.frame().unwrap()));
    (all, kept)
}

/// A simulation that resumes each of the checkpoints of another one makes the rest of its steps to the last bit.
fn goes_on(scene: &Scene) -> Vec<String> {
    let every = scene.output.checkpoint_steps;
    let mut whole = Simulation::builder(scene).build().unwrap();
    let (want, checkpoints) = rest(&mut whole, every);
    assert!(checkpoints.len() > 1);
    for checkpoint in &checkpoints {
        let done = checkpoint.steps();
        let mut resumed = Simulation::builder(scene).build().unwrap();
        resumed.resume(checkpoint).unwrap();
        let (got, _) = rest(&mut resumed, every);
        assert_eq!(got.len(), want.len() - done);
        for (n, (got, want)) in got.iter().zip(&want[done..]).enumerate() {
            assert!(got == want, "after {done} step {}:\n{got:.600}\n{want:.600}", done + n + 1);
        }
    }
    want
}

#[test]
fn grab() {
    goes_on(&scene("liver", &["mesh.max_level=4", "time.step_s=0.05", "output.checkpoint_steps=7"]));
}
#[test]
fn contact() {
    goes_on(&scene("palpate", &["time.steps=42", "time.step_s=0.01", "output.checkpoint_steps=11"]));
}
#[test]
fn dynamics() {
    goes_on(&scene("drop", &["materials.0.law={ kind = 'prony', terms = [{ fraction = 0.3, time_s = 0.1 }] }", "mesh.max_level=4", "time.steps=24", "output.checkpoint_steps=7"]));
}
