//! Tools that change labels: what is left is the body of the labels that are left.

use nalgebra::Vector3;
use yawara::scene::{Image, Scene};
use yawara::{Edit, Simulation, Tool, scene_file};
use yawara_mesh::phantom::block;
use yawara_mesh::volume::LabelVolume;

/// A block of 16 × 8 × 8 voxels of 5 mm, held at one end and pulled along at the other, with a core of another label.
fn scene(settings: &[&str]) -> Scene {
    let own = [
        "gravity_m_s2=[0, 0, 0]",
        "mesh.start_level=3",
        "mesh.max_level=3",
        "time.steps=4",
        "solver.residual=1e-9",
        "materials.1={label=2, name=\"core\", young_modulus_pa=1e5, poisson_ratio=0.3}",
        "materials.2={label=7, name=\"scar\", young_modulus_pa=3e5, poisson_ratio=0.3}",
        "time.step_s=0.5",
        "tools.0.release_s=9.0",
        "tools.0.path=[{time_s=0.5, move_m=[0, 0, 0]}, {time_s=2, move_m=[0.02, 0, 0]}]",
    ];
    let all: Vec<String> = own.iter().chain(settings).map(|&one| one.to_owned()).collect();
    Scene { image: Image::default(), ..scene_file::load("beam", &all).unwrap().0 }
}

fn volume() -> LabelVolume {
    let mut volume = block([32, 8, 8], 5.0).unwrap();
    let dims = volume.grid().dims;
    let original: Vec<i64> = (0..volume.labels().len())
        .map(|i| {
            let at = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])];
            let is_core = (12..20).contains(&at[0]) && at[1..].iter().all(|x| (2..6).contains(x));
            if is_core { 2 } else { 1 }
        })
        .collect();
    volume = LabelVolume::from_original(volume.grid().clone(), original.into_iter()).unwrap();
    volume
}

/// Positions of the labels that lie in a ball in the volume's own axes, voxels.
fn in_ball(volume: &LabelVolume, centre: [f64; 3], radius: f64) -> Vec<usize> {
    let [nx, ny, _] = volume.grid().dims;
    let distance = |i: usize| {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        (0..3).map(|k| (at[k] as f64 + 0.5 - centre[k]).powi(2)).sum::<f64>().sqrt()
    };
    (0..volume.labels().len()).filter(|&i| distance(i) <= radius).collect()
}

fn run(scene: &Scene, volume: LabelVolume) -> Simulation {
    let mut simulation = Simulation::builder(scene).volume(volume).build().unwrap();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{report:?}");
    }
    simulation
}

/// The largest distance of what is not void, m, and what the pull is at the end, N.
fn compare(one: &Simulation, other: &Simulation) -> (f64, [f64; 2]) {
    let (body, positions) = (one.body(), [one, other].map(|it| it.body().positions()));
    let solid = body.elements().iter().filter(|element| !body.is_void(element.tet));
    let corners = solid.flat_map(|element| element.vertices);
    let off = corners.map(|v| (positions[0][v] - positions[1][v]).norm()).fold(0.0, f64::max);
    (off, [one, other].map(|it| it.summary().unwrap().tools[0].force_end_n))
}

#[test]
fn what_is_left_is_the_body_of_the_labels_that_are_left() {
    // Voxel 16, 4, 4 of 32 × 8 × 8 is the middle; the ball acts before the body moves.
    let ball = "centre_mm=[0, 0, 0], radius_m=0.0175, begin_s=0, release_s=0.01, \
                path=[{time_s=0, move_m=[0, 0, 0]}]";
    for (element, tool, becomes) in [
        ("p1", format!("{{kind=\"resect\", {ball}}}"), 0),
        ("p1p1", format!("{{kind=\"resect\", {ball}}}"), 0),
        ("p1", format!("{{kind=\"resect\", labels=[2], {ball}}}"), 0),
        ("p1p1", format!("{{kind=\"coagulate\", becomes=7, labels=[1], {ball}}}"), 7),
        ("p1", format!("{{kind=\"coagulate\", becomes=2, {ball}}}"), 2),
    ] {
        let element = format!("stages.element={element}");
        let with = scene(&[&element, &format!("tools.1={tool}")]);
        let edited = run(&with, volume());
        let mut left = volume().with_label(7).unwrap();
        let id = left.values().iter().position(|&label| label == becomes).unwrap() as u16;
        let (labels, mut counts) = (left.values().to_vec(), std::collections::BTreeMap::new());
        for i in in_ball(&left.clone(), [16.0, 4.0, 4.0], 3.5) {
            let label = labels[usize::from(left.labels()[i])];
            let is_meant = !tool.contains("labels=") || tool.contains(&format!("labels=[{label}]"));
            if is_meant && label != becomes {
                left.set(i, id).unwrap();
                *counts.entry(label).or_insert(0.0) += 0.125;
            }
        }
        let summary = edited.summary().unwrap();
        assert!(!counts.is_empty());
        for (label, cm3) in &counts {
            let found = summary.tools[1].changed_cm3[label];
            assert!((found - cm3).abs() < 1e-9, "{tool}: {found} of {cm3}");
        }
        assert_eq!(summary.tools[1].changed_cm3.len(), counts.len());
        let plain = run(&scene(&[&element]), left);
        for element in edited.body().elements() {
            let other = plain.body().element(element.tet).unwrap();
            assert_eq!(element.elasticity, other.elasticity, "{tool}: {:?}", element.tet);
        }
        let (off, [force, want]) = compare(&edited, &plain);
        assert!(off < 1e-7, "{tool}: {off} m, {force} of {want} N");
        assert!((force / want - 1.0).abs() < 1e-6, "{tool}: {force} of {want} N");
        // It is another body than before.
        let (_, [_, whole]) = compare(&edited, &run(&scene(&[&element]), volume()));
        assert!((force / whole - 1.0).abs() > 0.01, "{tool}: {force} and {whole} N");
        assert!(summary.inverse.drift_max < 1e-8, "{:?}", summary.inverse);
        let energy = summary.energy.unwrap();
        assert!(energy.created_j < 1e-6 * energy.tools_work_j, "{energy:?}");
    }
}

#[test]
fn a_ball_takes_the_voxels_that_are_in_it_where_the_body_is_now() {
    // Without a Poisson ratio the bar is stretched evenly from its fixed end, by an eighth at the end of step 2.
    let ball =
        "radius_m=0.0175, begin_s=1, release_s=1.001, path=[{time_s=0, move_m=[0.01, 0, 0]}]";
    let with = scene(&[
        // A ball that comes at the end of step 2 acts in step 3.
        "time.steps=3",
        "materials.0.poisson_ratio=0.0",
        "materials.1.poisson_ratio=0.0",
        "materials.1.young_modulus_pa=5e4",
        "materials.0.young_modulus_pa=5e4",
        "support.hold=vertices",
        "tools.0.hold=vertices",
        "tools.0.path=[{time_s=0, move_m=[0, 0, 0]}, {time_s=1, move_m=[0.02, 0, 0]}]",
        &format!("tools.1={{kind=\"resect\", centre_mm=[0, 0, 0], {ball}}}"),
    ]);
    let edited = run(&with, volume());
    let whole = volume();
    let [nx, ny, _] = whole.grid().dims;
    let is_in = |i: &usize| {
        let at = [i % nx, i / nx % ny, i / (nx * ny)].map(|x| (x as f64 + 0.5) * 5.0);
        // From the fixed end, mm; the middle of the bar at rest lies at 80.
        let off = [at[0] * 1.125 - 90.0, at[1] - 20.0, at[2] - 20.0];
        off.iter().map(|x| x * x).sum::<f64>().sqrt() <= 17.5
    };
    let count = (0..whole.labels().len()).filter(is_in).count() as f64 * 0.125;
    let found: f64 = edited.summary().unwrap().tools[1].changed_cm3.values().sum();
    assert!((found - count).abs() < 1e-9, "{found} of {count} cm³");
}

/// A block of 40 × 40 × 20 mm on its bottom, under a ball that goes 6 mm into where its top was.
fn pressed(settings: &[&str]) -> (Scene, LabelVolume) {
    let own = [
        "time={steps=4, step_s=0.25}",
        "mesh.base_mm=20",
        "mesh.max_level=6",
        "output.frames_every=4",
        "output.outline=true",
        "output.field=true",
        "tools.0.radius_m=0.01",
        "tools.0.spacing_m=0.002",
        "tools.0.path=[{time_s=0, move_m=[0, 0, 0.02]}, {time_s=0.25, move_m=[0, 0, 0.02]}, \
         {time_s=1, move_m=[0, 0, 0.004]}]",
    ];
    let all: Vec<String> = own.iter().chain(settings).map(|&one| one.to_owned()).collect();
    let scene = Scene { image: Image::default(), ..scene_file::load("indent", &all).unwrap().0 };
    (scene, block([20, 20, 10], 2.0).unwrap())
}

#[test]
fn a_probe_feels_the_surface_that_is_left() {
    let cut = "tools.1={kind=\"resect\", centre=[0.5, 0.5, 1.0], radius_m=0.008, release_s=0.01, \
               path=[{time_s=0, move_m=[0, 0, 0]}]}";
    let (with, volume) = pressed(&[cut]);
    let edited = run(&with, volume.clone());
    let mut left = volume.clone();
    for i in in_ball(&volume, [10.0, 10.0, 10.0], 4.0) {
        left.set(i, 0).unwrap();
    }
    let plain = run(&pressed(&[]).0, left);
    let whole = run(&pressed(&[]).0, volume);
    let force = |it: &Simulation| it.summary().unwrap().tools[0].force_end_n;
    let [found, want, before] = [&edited, &plain, &whole].map(force);
    assert!(want > 0.01 && (found / want - 1.0).abs() < 1e-3, "{found} of {want} N");
    assert!(before > 1.1 * want, "{before} N before, {want} N after");
    let triangles = |it: &Simulation| it.frame().unwrap().outline.unwrap().triangles;
    assert_eq!(triangles(&edited), triangles(&plain));
    assert_ne!(triangles(&edited), triangles(&whole));
    let labels = |it: &Simulation| it.fields().unwrap().unwrap().label;
    assert_eq!(labels(&edited), labels(&plain));
}

/// Takes all of label 2 away in one step.
struct Eraser;

impl Tool for Eraser {
    fn kind(&self) -> &'static str {
        "eraser"
    }

    fn reference(&self, _: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    fn edit(&self, _: f64, _: f64) -> Option<Edit> {
        Some(Edit::Labels {
            sweep: [Vector3::zeros(); 2],
            radius_m: 1.0,
            labels: vec![2],
            becomes: 0,
        })
    }
}

#[test]
fn a_tool_of_ones_own_changes_labels_too() {
    let scene = scene(&["time.steps=2"]);
    let mut simulation =
        Simulation::builder(&scene).volume(volume()).tool(|_| Ok(Eraser)).build().unwrap();
    simulation.step().unwrap();
    let changed = || simulation.summary().unwrap().tools[1].changed_cm3.clone();
    assert_eq!(changed().keys().copied().collect::<Vec<_>>(), [2]);
    assert!((changed()[&2] - 16.0).abs() < 1e-9, "{:?}", changed());
    simulation.step().unwrap();
    assert!((simulation.summary().unwrap().tools[1].changed_cm3[&2] - 16.0).abs() < 1e-9);
    // Checkpoints would go on with the labels of the start.
    let scene = self::scene(&["output.checkpoint_steps=1"]);
    let mut kept =
        Simulation::builder(&scene).volume(volume()).tool(|_| Ok(Eraser)).build().unwrap();
    let refusal = kept.step().unwrap_err().to_string();
    assert!(refusal.contains("output.checkpoint_steps is 1, want 0"), "{refusal}");
}

const RESECT: &str = "tools.1={kind=\"resect\", centre_mm=[0, 0, 0], radius_m=0.03, \
                      path=[{time_s=0, move_m=[0, 0, 0]}]";

#[test]
fn a_label_that_is_gone_has_no_surface_and_no_mass() {
    let all = format!("{RESECT}, labels=[2]}}");
    let with = scene(&[
        &all,
        "dynamics={}",
        "mesh.max_level=6",
        "output.frames_every=2",
        "output.surfaces=[{label=2, sigma_voxels=0.5}]",
        "materials.1.density_kg_m3=4000.0",
    ]);
    let mut simulation = Simulation::builder(&with).volume(volume()).build().unwrap();
    let mass = simulation.momentum().unwrap().mass_kg;
    assert!(!simulation.frame().unwrap().surfaces[0].triangles.is_empty());
    simulation.step().unwrap();
    let left = simulation.momentum().unwrap().mass_kg;
    let core = 8.0 * 4.0 * 4.0 * 5e-3_f64.powi(3);
    assert!((mass - left - 4000.0 * core).abs() < 1e-9, "{mass} kg, then {left} kg");
    // The surface is cut anew for the frames that are written.
    simulation.step().unwrap();
    assert!(simulation.frame().unwrap().surfaces[0].triangles.is_empty());
    let summary = simulation.summary().unwrap();
    assert_eq!(summary.tools[1].changed_cm3.keys().copied().collect::<Vec<_>>(), [2]);
    assert_eq!(summary.steps.converged, 2);
}

#[test]
fn what_can_not_be_beside_a_change_of_labels_is_refused() {
    let refusal = |settings: &[&str]| {
        let own = ["tools.0.path=[{time_s=0}, {time_s=2, move_m=[0.02, 0, 0]}]"];
        let all: Vec<String> = own.iter().chain(settings).map(|&one| one.to_owned()).collect();
        let built = scene_file::load("beam", &all)
            .and_then(|(scene, _)| Simulation::builder(&scene).build().map(drop));
        built.err().map(|error| error.to_string()).unwrap_or_default()
    };
    let resect = format!("{RESECT}}}");
    let coagulate = RESECT.replace("resect", "coagulate");
    let pressure = "tools.2={kind=\"pressure\", region={shape=\"box\", min=[0, 0, 1], max=[1, 1, 1]}, \
                    pressure=[{time_s=0, pressure_pa=10}]}";
    let prony = "materials.0.law={kind=\"prony\", terms=[{fraction=0.5, time_s=1.0}]}";
    for (settings, words) in [
        (vec![&*resect], ""),
        (vec![&*format!("{RESECT}, becomes=1}}")], "tools[1].becomes is 1, want no such key"),
        (vec![&*format!("{coagulate}}}")], "tools[1].becomes is None, want the label"),
        (
            vec![&*format!("{coagulate}, becomes=9}}")],
            "tools[1].becomes is 9, want a label of a material",
        ),
        (
            vec![&*format!("{RESECT}, labels=[0]}}")],
            "tools[1].labels is [0], want other labels than 0",
        ),
        (
            vec![&*format!("{RESECT}, labels=[5]}}")],
            "tools[1].labels is 5, want a label of the image",
        ),
        (vec![&*resect.replace("0.03", "0.0")], "tools[1].radius_m is 0.0"),
        (vec![&*resect, pressure], "tools[2].kind is \"pressure\", want no pressure or traction"),
        (vec![&*resect, "output.checkpoint_steps=2"], "output.checkpoint_steps is 2, want 0"),
        (vec![&*resect, "stages.homogenisation=kharevych"], "stages.homogenisation is kharevych"),
        (vec![&*resect, prony], "materials is with a law, want no law that remembers"),
    ] {
        let found = refusal(&settings);
        match words {
            "" => assert_eq!(found, ""),
            _ => assert!(found.contains(words), "{settings:?}: {found}"),
        }
    }
}
