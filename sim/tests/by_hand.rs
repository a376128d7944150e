//! The mesh changed from outside between steps, and scenes from text.

use yawara::{SimError, Simulation, scene_file};

fn beam(settings: &[&str]) -> Simulation {
    let all: Vec<String> = settings.iter().map(|&one| one.to_owned()).collect();
    let (scene, _) = scene_file::load("beam", &all).unwrap();
    Simulation::builder(&scene).build().unwrap()
}

/// Force in a step of the beam with no refinement of its own.
const STILL: [&str; 3] =
    ["refinement.split_above=1e30", "mesh.max_level=6", "solver.residual=1e-9"];

#[test]
fn splits_by_hand_lead_to_the_mesh_that_starts_so() {
    let mut fine = beam(&[&STILL[..], &["mesh.start_level=3"]].concat());
    let mut split = beam(&[&STILL[..], &["mesh.start_level=0"]].concat());
    let start = split.body().vertex_count();
    let mut came = 0;
    while split.frame().unwrap().level.iter().any(|&level| level < 3) {
        let levels = split.frame().unwrap().level;
        let coarse: Vec<usize> = (0..levels.len()).filter(|&i| levels[i] < 3).collect();
        came += split.split(&coarse).unwrap();
    }
    assert_eq!(split.body().vertex_count(), start + came);
    assert_eq!(split.body().vertex_count(), fine.body().vertex_count());
    let [a, b] = [&mut fine, &mut split].map(|simulation| simulation.step().unwrap());
    assert!(a.converged && b.converged);
    let force = a.force_n[2];
    assert!(force.abs() > 1e-3 && (b.force_n[2] - force).abs() < 1e-6 * force.abs(), "{a:?} {b:?}");
    // All go out again, and the force is that of the coarse mesh.
    let mut went = 0;
    loop {
        let all: Vec<usize> = (0..split.body().vertex_count()).collect();
        match split.merge(&all).unwrap() {
            0 => break,
            merged => went += merged,
        }
    }
    // Those that the grab holds stay, and what these need.
    assert!(went > 0 && went <= came, "{went} of {came}");
    let report = split.step().unwrap();
    assert!(report.converged && report.force_n[2].abs() > force.abs(), "{report:?}");
}

#[test]
fn numbers_that_nothing_has_are_refused_and_nothing_changes() {
    let mut simulation = beam(&STILL);
    let (tets, vertices) = (simulation.body().tet_count(), simulation.body().vertex_count());
    for (error, key) in
        [(simulation.split(&[0, tets]), "tetrahedra"), (simulation.merge(&[vertices]), "vertices")]
    {
        let error = error.unwrap_err();
        assert!(matches!(&error, SimError::Value { key: of, .. } if of == key), "{error}");
    }
    assert_eq!(simulation.body().vertex_count(), vertices);
    let most = format!("mesh.max_vertices={}", vertices + 1);
    let mut full = beam(&[&STILL[..], &[&most]].concat());
    assert_eq!(full.split(&(0..tets).collect::<Vec<_>>()).unwrap(), 1);
}

#[test]
fn a_scene_from_text_is_that_of_its_file() {
    let (name, text) = scene_file::built_in()[2];
    let settings = ["time.steps=3".to_owned()];
    let parsed = scene_file::parse(text, "mine", &settings, false).unwrap();
    assert_eq!(parsed, scene_file::load(name, &settings).unwrap().0);
    let error = scene_file::parse(text, "mine", &["time.steps=0".into()], false).unwrap_err();
    assert!(error.to_string().contains("time.steps"), "{error}");
    // A volume that is given stands in no file.
    let error = scene_file::parse(text, "mine", &[], true).unwrap_err().to_string();
    assert!(error.starts_with("mine") && error.contains("image"), "{error}");
}
