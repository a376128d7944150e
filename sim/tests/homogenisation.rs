//! Homogenisations by name, from a scene to the plan.

use yawara::{Simulation, Stages, scene_file};

fn liver(choice: &str) -> Simulation {
    let set: Vec<String> = [
        "image.voxel_mm=8.0",
        "mesh.base_mm=32.0",
        "time.steps=2",
        &format!("stages.homogenisation={choice}"),
    ]
    .map(String::from)
    .into();
    let (scene, _) = scene_file::load("liver", &set).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

fn why(simulation: &Simulation) -> &str {
    let row = simulation.plan().iter().find(|row| row.stage == "homogenisation").unwrap();
    assert!(row.runs);
    &row.why
}

#[test]
fn a_global_choice_sets_up_and_the_plan_counts() {
    let simulation = liver("kharevych");
    let text = why(&simulation).to_owned();
    let number = |after: &str| -> usize {
        let rest = text.split_once(after).map_or(&text[..], |(_, rest)| rest).trim_start();
        rest.split(' ').next().unwrap().parse().unwrap()
    };
    let (all, left) = (number(""), number("fine body,"));
    assert!(text.contains(&format!("; {} of them from solutions", all - left)), "{text}");
    assert!(left * 100 < all, "{text}");
}

#[test]
fn the_paper_s_choice_is_run_with_a_warning_and_others_without() {
    let paper = liver("paper");
    assert!(why(&paper).contains("WARNING") && why(&paper).contains("0.235"));
    assert!(!why(&liver("laminate")).contains("WARNING"));
}
