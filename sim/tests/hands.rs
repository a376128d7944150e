//! Tools that come while a simulation runs: what they hold, and that the scene as led is the same again.

use yawara::scene::{Scene, ToolEntry};
use yawara::{Pose, SimError, Simulation, scene_file};

fn beam(more: &[&str]) -> Scene {
    let small = ["tools=[]", "mesh.max_level=4", "time.steps=40", "time.step_s=0.02"];
    let settings: Vec<String> = small.iter().chain(more).map(|one| (*one).into()).collect();
    scene_file::load("beam", &settings).unwrap().0
}

/// A tool of a scene's text.
fn tool(text: &str) -> ToolEntry {
    let settings = [format!("tools=[{text}]")];
    scene_file::load("beam", &settings).unwrap().0.tools.remove(0)
}

fn grab() -> ToolEntry {
    tool(
        "{ kind='grab', region={ shape='sphere', centre=[0.9, 0.5, 0.5], radius_m=0.02 }, path=[{ time_s=0.0 }] }",
    )
}

fn lead(simulation: &mut Simulation, tool: usize, move_m: [f64; 3]) {
    simulation.extend_tool_path(tool, Pose { move_m, turn_deg: 0.0 }).unwrap();
}

fn bits(simulation: &Simulation) -> Vec<u64> {
    simulation.body().positions().iter().flatten().map(|x| x.to_bits()).collect()
}

#[test]
fn a_scene_as_it_was_led_is_the_same_simulation_to_the_last_bit() {
    let mut live = Simulation::builder(&beam(&[])).build().unwrap();
    let mut forces = Vec::new();
    let mut steps = |live: &mut Simulation, tool: Option<usize>, to: [f64; 3], n: usize| {
        for _ in 0..n {
            if let Some(tool) = tool {
                lead(live, tool, to);
            }
            let report = live.step().unwrap();
            assert!(report.converged);
            forces.push(felt(report.force_n));
        }
    };
    steps(&mut live, None, [0.0; 3], 2);
    let first = live.add_tool(grab()).unwrap();
    for i in 1..=5 {
        steps(&mut live, Some(first), [0.0, 0.0, 0.003 * f64::from(i)], 1);
    }
    live.release_tool(first).unwrap();
    steps(&mut live, None, [0.0; 3], 3);
    // The same place again, and a ball beside it.
    let second = live.add_tool(grab()).unwrap();
    let ball =
        tool("{ kind='probe', centre=[0.5, 0.5, 1.6], radius_m=0.01, path=[{ time_s=0.0 }] }");
    let third = live.add_tool(ball).unwrap();
    assert_eq!([first, second, third], [0, 1, 2]);
    for i in 1..=6 {
        lead(&mut live, third, [0.0, 0.0, -0.004 * f64::from(i)]);
        steps(&mut live, Some(second), [0.001 * f64::from(i), 0.0, 0.0], 1);
    }
    live.release_tool(third).unwrap();
    steps(&mut live, Some(second), [0.006, 0.0, 0.0], 2);

    let scene = live.scene_as_led();
    assert_eq!((scene.tools.len(), scene.time.steps), (3, forces.len()));
    // Through a file and back.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("led.toml");
    std::fs::write(&file, toml::to_string(&scene).unwrap()).unwrap();
    let (scene, _) = scene_file::load(file.to_str().unwrap(), &[]).unwrap();
    let mut again = Simulation::builder(&scene).build().unwrap();
    for (number, force) in forces.iter().enumerate() {
        assert_eq!(felt(again.step().unwrap().force_n), *force, "step {}", number + 1);
    }
    assert_eq!(bits(&again), bits(&live));
}

#[test]
fn a_blade_that_came_is_the_same_as_one_that_was_there() {
    let mut live = Simulation::builder(&beam(&["gravity_m_s2=[0, 0, 0]"])).build().unwrap();
    let mut felt = Vec::new();
    let tip = live.add_tool(grab()).unwrap();
    for i in 1..=3 {
        lead(&mut live, tip, [0.0, 0.0, -0.003 * f64::from(i)]);
        felt.push(live.step().unwrap().force_n);
    }
    let blade = live.add_tool(tool(
        "{ kind='scalpel', centre=[0.5, -0.1, 0.5], edge_m=[0.0, 0.0, 0.1], level=4, path=[{ time_s=0.0 }] }",
    ));
    let blade = blade.unwrap();
    let mut edits = 0;
    for i in 1..=5 {
        lead(&mut live, tip, [0.0, 0.0, -0.009]);
        lead(&mut live, blade, [0.0, 0.01 * f64::from(i), 0.0]);
        let report = live.step().unwrap();
        assert!(report.converged);
        felt.push(report.force_n);
        edits += report.edits;
    }
    assert!(edits >= 3, "{edits} steps in which it cut");
    live.release_tool(blade).unwrap();
    lead(&mut live, tip, [0.0, 0.0, -0.012]);
    felt.push(live.step().unwrap().force_n);
    let size = |f: &[f64; 3]| f.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!(size(&felt[7]) < 0.9 * size(&felt[2]), "{felt:?}");
    let mut again = Simulation::builder(&live.scene_as_led()).build().unwrap();
    for (number, force) in felt.iter().enumerate() {
        assert_eq!(again.step().unwrap().force_n, *force, "step {}", number + 1);
    }
    assert_eq!(bits(&again), bits(&live));
}

#[test]
fn a_hand_takes_hold_of_bent_material_without_a_jerk() {
    let mut simulation = Simulation::builder(&beam(&[])).build().unwrap();
    let tip = simulation.add_tool(grab()).unwrap();
    for i in 1..=8 {
        lead(&mut simulation, tip, [0.0, 0.0, 0.004 * f64::from(i)]);
        simulation.step().unwrap();
    }
    let before = simulation.step().unwrap().force_n;
    // Where it has moved and turned, it is held as it is: nothing pulls yet.
    let near = "{ kind='grab', region={ shape='sphere', centre=[0.6, 0.5, 0.5], radius_m=0.02 }, path=[{ time_s=0.0 }] }";
    let other = simulation.add_tool(tool(near)).unwrap();
    let report = simulation.step().unwrap();
    let size = |f: [f64; 3]| f.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!(size(before) > 1e-3, "{before:?}");
    let pull = size(report.tools[other].force_n);
    assert!(report.converged && pull < 0.02 * size(before), "{pull} of {}", size(before));
}

#[test]
fn what_can_not_be_held_is_refused_and_changes_nothing() {
    let mut simulation = Simulation::builder(&beam(&[])).build().unwrap();
    simulation.add_tool(grab()).unwrap();
    let outside = "{ kind='grab', region={ shape='sphere', centre=[9.0, 0.5, 0.5], radius_m=0.001 }, path=[{ time_s=0.0 }] }";
    let pad = "{ kind='grab', hold='pad', region={ shape='sphere', centre=[0.5, 0.5, 0.5], radius_m=0.02 }, path=[{ time_s=0.0 }] }";
    let load = "{ kind='pressure', region={ shape='box', min=[0.5,0,0], max=[1,1,1] }, pressure=[{ time_s=0.0, pressure_pa=1.0 }] }";
    let inside = "{ kind='probe', centre=[0.5, 0.5, 0.5], radius_m=0.01, path=[{ time_s=0.0, move_m=[0,0,1] }] }";
    for (text, want) in [
        (outside, "region"),
        (pad, "hold"),
        (load, "grab, probe, scalpel or suture"),
        (inside, "outside of the body"),
    ] {
        let error = simulation.add_tool(tool(text)).unwrap_err().to_string();
        assert!(error.contains(want), "{error}");
    }
    let twice = simulation.add_tool(grab()).unwrap_err();
    assert!(matches!(twice, SimError::Value { .. }), "{twice}");
    assert!(matches!(simulation.release_tool(7), Err(SimError::NoSuchTool { .. })));
    assert_eq!(simulation.step().unwrap().tools.len(), 1);
}

/// The bits of a force; a sum of nothing is −0.
fn felt(force_n: [f64; 3]) -> [u64; 3] {
    force_n.map(|x| (x + 0.0).to_bits())
}
