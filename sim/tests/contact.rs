//! A ball against a block: the force is that of Hertz on a layer, it pushes and never pulls,
//! nothing goes in deeper than promised, and what is pressed comes back.

use yawara::report::{Frame, StepReport};
use yawara::scene::ToolEntry;
use yawara::{Pose, SimError, Simulation, Stages, scene_file};

fn simulation(scene: &str, set: &[&str]) -> Simulation {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load(scene, &overrides).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

fn run(simulation: &mut Simulation) -> Vec<StepReport> {
    let mut reports = Vec::new();
    while simulation.steps_left() > 0 {
        reports.push(simulation.step().unwrap());
    }
    reports
}

fn largest_displacement_mm(frame: &Frame) -> f64 {
    frame.displacement_mm.iter().flatten().fold(0.0, |m: f64, u| m.max(u.abs()))
}

/// F = 4/3 E/(1−ν²) √R d^{3/2} on a half space, times the series in χ = √(R d)/h for a layer of
/// height h bonded to a rigid floor (Dimitriadis et al., Biophysical Journal 82, 2002, eq. 10).
fn hertz_on_a_layer(young: f64, poisson: f64, radius: f64, depth: f64, height: f64) -> f64 {
    use std::f64::consts::PI;
    let half_space =
        4.0 / 3.0 * young / (1.0 - poisson * poisson) * radius.sqrt() * depth.powf(1.5);
    let x = (radius * depth).sqrt() / height;
    let a = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson * poisson) / (1.0 - poisson);
    let b = (0.6387 - 1.0277 * poisson + 1.5164 * poisson * poisson) / (1.0 - poisson);
    let cubic = a.powi(3) + 4.0 * PI * PI / 15.0 * b;
    let quartic = 16.0 * a / PI.powi(4) * (a.powi(3) + 3.0 * PI * PI / 5.0 * b);
    let layer = 1.0 - 2.0 * a / PI * x + 4.0 * a * a / (PI * PI) * x * x
        - 8.0 / PI.powi(3) * cubic * x.powi(3)
        + quartic * x.powi(4);
    half_space * layer
}

#[test]
fn the_force_is_that_of_hertz_and_comes_nearer_under_refinement() {
    let want = hertz_on_a_layer(1e4, 0.3, 0.04, 0.0025, 0.08);
    let error = |split_above: &str| {
        let set = [split_above, "time.steps=12", "mesh.max_vertices=8000"];
        let reports = run(&mut simulation("indent", &set));
        assert!(reports.iter().all(|r| r.converged));
        let last = &reports[11];
        // Held at full depth while the mesh still gets finer.
        -last.tools[0].force_n[2] / want - 1.0
    };
    let (coarse, fine) =
        (error("refinement.split_above=1e-7"), error("refinement.split_above=1e-9"));
    println!("relative error of the force: {coarse:.3} coarse, {fine:.3} fine");
    // Linear elements are too stiff, so both are above.
    assert!(fine > -0.02 && fine < 0.6 * coarse, "{coarse} {fine}");
    assert!(fine < 0.12, "{fine}");
}

/// A surface that is finer than the points on it comes in between them.
#[test]
fn points_that_may_touch_a_ball_lie_closer_together_than_the_mesh_is_fine() {
    let forces = |spacing_m: Option<f64>, max_level: u8| {
        let overrides = ["time.steps=3".into(), format!("mesh.max_level={max_level}")];
        let (mut scene, _) = scene_file::load("indent", &overrides).unwrap();
        let ToolEntry::Probe(probe) = &mut scene.tools[0] else { panic!("the ball") };
        probe.spacing_m = spacing_m;
        let stages = Stages::by_name(&scene.stages).unwrap();
        let reports = run(&mut Simulation::new(&scene, stages).unwrap());
        reports.iter().map(|r| (r.tools[0].force_n, r.tools[0].contacts)).collect::<Vec<_>>()
    };
    // Edges of 20 mm, halved with every third level; a radius of 40 mm.
    assert_eq!(forces(None, 6), forces(Some(0.75 * 0.005), 6));
    assert_eq!(forces(None, 0), forces(Some(0.25 * 0.04), 0));
    assert_ne!(forces(Some(0.75 * 0.005), 6), forces(Some(0.25 * 0.04), 6));
}

#[test]
fn it_pushes_and_never_pulls_and_what_was_pressed_comes_back() {
    let mut simulation = simulation("indent", &[]);
    let residual = 1e-6;
    let radius = 0.04;
    let mut touched = 0;
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "step {}", report.step);
        let tool = report.tools[0];
        assert!(tool.force_n[2] <= 0.0, "the ball is above: {:?}", tool.force_n);
        assert!(tool.penetration_m <= residual * radius, "{}", tool.penetration_m);
        // Symmetric: sideways next to nothing; frictionless: no torque about the centre.
        let side = tool.force_n[0].hypot(tool.force_n[1]);
        assert!(side <= 0.01 * tool.force_n[2].abs(), "{:?}", tool.force_n);
        let lever = tool.torque_n_m.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
        assert!(lever <= 1e-9 * radius * (1.0 - tool.force_n[2]));
        touched += usize::from(tool.contacts > 0);
        if report.time_s > 1.35 {
            assert_eq!((tool.contacts, tool.force_n), (0, [0.0; 3]), "the ball is away");
        }
    }
    assert!(touched >= 12);
    assert!(largest_displacement_mm(&simulation.frame().unwrap()) < 1e-3);
}

#[test]
fn what_pushes_is_carried_by_the_support_with_the_weight() {
    let set = ["gravity_m_s2=[0.3, 0.0, -2.0]", "time.steps=10", "mesh.max_level=3"];
    let mut simulation = simulation("indent", &set);
    let reports = run(&mut simulation);
    let last = reports.last().unwrap();
    assert!(last.converged && last.tools[0].contacts > 0);
    let support = simulation.support_force();
    let volume = 0.16 * 0.16 * 0.08;
    let weight: [f64; 3] = [0.3, 0.0, -2.0].map(|g| 1000.0 * volume * g);
    let scale = weight[2].abs();
    for axis in 0..3 {
        let sum = support[axis] + weight[axis] + last.tools[0].force_n[axis];
        // 1e-6 of the elements' forces is left over, of all elements together.
        assert!(sum.abs() < 1e-4 * scale, "axis {axis}: {sum} N of {scale} N");
    }
    assert_eq!(last.force_n, last.tools[0].force_n);
}

#[test]
fn a_grab_led_through_the_interface_does_what_its_path_would() {
    let short = ["time.steps=3", "mesh.max_level=1"];
    let by_path = run(&mut simulation("twist", &short));
    let (mut led, mut teacher) = (simulation("twist", &short), simulation("twist", &short));
    for report in &by_path {
        let pose = teacher.tool_pose(0, report.time_s).unwrap();
        led.set_tool_pose(0, pose).unwrap();
        let same = led.step().unwrap();
        let off: f64 = (0..3).map(|i| (same.force_n[i] - report.force_n[i]).abs()).sum();
        let size: f64 = report.force_n.iter().map(|f| f.abs()).sum();
        assert!(off <= 1e-5 * (1.0 + size), "{:?} {:?}", same.force_n, report.force_n);
        assert!(same.tools[0].torque_n_m.iter().any(|t| t.abs() > 1e-6), "{:?}", same.tools);
    }
}

#[test]
fn a_steady_push_needs_few_iterations_and_fewer_than_one_that_trembles() {
    // The ball goes on evenly: every step begins near where it ends.
    let set = ["time.steps=40", "time.step_s=0.01", "image.voxel_mm=4", "stages.element=p1"];
    let steady = run(&mut simulation("probe", &set));
    let pressed: Vec<_> = steady.iter().filter(|report| report.force_n[2] < 0.0).collect();
    assert!(pressed.len() > 10 && pressed.iter().all(|report| report.converged));
    let total: usize = pressed.iter().map(|report| report.iterations).sum();
    let (mut trembling, mut teacher) = (simulation("probe", &set), simulation("probe", &set));
    // The same way, but two steps forth and one back.
    let mut back_and_forth = 0;
    for step in 0..40_u8 {
        let at = 0.01 * f64::from(step - step % 3 + [1, 3, 2][usize::from(step % 3)]);
        let pose = teacher.tool_pose(0, at).unwrap();
        trembling.set_tool_pose(0, pose).unwrap();
        let report = trembling.step().unwrap();
        back_and_forth += if report.force_n[2] < 0.0 { report.iterations } else { 0 };
    }
    assert!(4 * total < 3 * back_and_forth, "{total} {back_and_forth}");
    // A start where the last step ended takes nearly four.
    assert!(total <= 3 * pressed.len(), "{total} in {}", pressed.len());
}

#[test]
fn points_that_come_and_go_are_settled_as_a_set() {
    // At full depth points at the rim of the contact come in and go out again: mixing alone gives
    // up there, after more than a hundred iterations.
    let mut simulation = simulation("probe", &[]);
    let reports: Vec<StepReport> = (0..170).map(|_| simulation.step().unwrap()).collect();
    assert!(reports.iter().all(|report| report.converged && report.fallbacks == 0));
    let total: usize = reports.iter().map(|report| report.iterations).sum();
    assert!(total < 500, "{total}");
}

#[test]
fn a_tool_led_through_the_interface_does_what_its_path_would() {
    let short = ["time.steps=6", "mesh.max_level=0"];
    let by_path = run(&mut simulation("indent", &short));
    let mut led = simulation("indent", &short);
    let mut teacher = simulation("indent", &short);
    let mut reports = Vec::new();
    for step in 1..=6 {
        let pose = teacher.tool_pose(0, 0.1 * f64::from(step)).unwrap();
        led.set_tool_pose(0, pose).unwrap();
        reports.push(led.step().unwrap());
    }
    for (a, b) in by_path.iter().zip(&reports) {
        assert!((a.force_n[2] - b.force_n[2]).abs() < 1e-6 * (1.0 + a.force_n[2].abs()));
    }
    assert!(by_path[5].force_n[2] < 0.0);
    // The slope that a hand feels: a secant between two poses is near it.
    let slope = led.tool_stiffness(0).unwrap()[2][2];
    assert!(slope > 0.0 && slope.is_finite());

    let error = led.set_tool_pose(1, Pose::default()).unwrap_err();
    assert!(matches!(error, SimError::NoSuchTool { tool: 1, count: 1, .. }), "{error}");
    let far = Pose { move_m: [0.0, f64::NAN, 0.0], turn_deg: 0.0 };
    assert!(matches!(led.set_tool_pose(0, far), Err(SimError::Pose { .. })));
}

#[test]
fn a_path_from_a_table_is_the_path_from_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("path.csv");
    std::fs::write(&file, "time_s,x_m,y_m,z_m\n0,0,0,0.04\n1.0,0,0,0.0375\n").unwrap();
    let csv = format!("tools.0.path_csv={}", file.display());
    let short = ["time.steps=3", "mesh.max_level=0"];
    let from_scene = run(&mut simulation("indent", &short));
    let set = [&short[..], &["tools.0.path=[]", &csv]].concat();
    let from_table = run(&mut simulation("indent", &set));
    let forces = |reports: &[StepReport]| reports.iter().map(|r| r.force_n).collect::<Vec<_>>();
    assert_eq!(forces(&from_scene), forces(&from_table));

    std::fs::write(&file, "time_s,x_m,y_m,z_m\n0,0,0,inf\n").unwrap();
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load("indent", &overrides).unwrap();
    let error = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).err().unwrap();
    assert!(error.to_string().contains("path.csv, line 2: z_m is \"inf\""), "{error}");
    let both = [csv];
    let error = scene_file::load("indent", &both).unwrap_err().to_string();
    assert!(error.contains("a path is given once"), "{error}");
}

const PRESS: &str = "tools=[{ kind = 'pressure', normal = 'NORMAL', \
    region = { shape = 'box', min = [0.0, 0.0, 0.99], max = [1.0, 1.0, 1.0] }, \
    pressure = [{ time_s = 0.0, pressure_pa = 0.0 }, { time_s = 0.2, pressure_pa = 300.0 }] }]";

#[test]
fn a_pressure_on_a_face_is_its_area_times_it() {
    for normal in ["dead", "following"] {
        let press = PRESS.replace("NORMAL", normal);
        let set = [&press, "time.steps=4", "mesh.max_level=0"];
        let mut simulation = simulation("indent", &set);
        let reports = run(&mut simulation);
        let last = reports.last().unwrap();
        assert!(last.converged);
        let support = simulation.support_force();
        let (force, area) = (last.tools[0].force_n, 0.16 * 0.16);
        // The edges of the face are rounded off by the blur of the outline: a voxel all round.
        let slack = 4.0 * 0.0025 / 0.16;
        assert!((force[2] / (-300.0 * area) - 1.0).abs() < slack, "{normal}: {force:?}");
        for axis in 0..3 {
            assert!((support[axis] + force[axis]).abs() < 1e-4 * force[2].abs(), "{normal}");
        }
    }
}

/// On a closed surface a fluid's pressure has no net force, however the body is bent.
#[test]
fn a_following_pressure_all_round_has_no_net_force_and_a_dead_one_has_the_same() {
    for normal in ["dead", "following"] {
        let tools = PRESS.replace("NORMAL", normal).replace("0.99]", "-0.1]");
        let tools = tools
            .replace("min = [0.0, 0.0,", "min = [-0.1, -0.1,")
            .replace("max = [1.0, 1.0, 1.0]", "max = [1.1, 1.1, 1.1]")
            .replace("300.0", "100.0");
        let set = [
            &tools,
            "image.size_mm=[80.0, 40.0, 40.0]",
            "fixed.0.min=[0.0, 0.0, 0.0]",
            "fixed.0.max=[0.0, 1.0, 1.0]",
            "gravity_m_s2=[0.0, 0.0, -5.0]",
            "time.steps=3",
            "mesh.max_level=0",
        ];
        let mut simulation = simulation("indent", &set);
        let last = run(&mut simulation).pop().unwrap();
        assert!(last.converged);
        assert!(largest_displacement_mm(&simulation.frame().unwrap()) > 0.5, "bent");
        let pressed = 100.0 * 0.04 * 0.04;
        for force in last.tools[0].force_n {
            // What the outline cuts off at the edges is not flat in the coarse mesh.
            assert!(force.abs() < 0.02 * pressed, "{normal}: {:?}", last.tools[0].force_n);
        }
    }
}

#[test]
fn a_mesh_that_changes_now_and_then_is_measured_in_one_step_and_changed_in_those_between() {
    let often = ["refinement.every_steps=3", "refinement.max_splits_per_step=4"];
    let set = [&often[..], &["time.steps=60", "output.frames_every=1000"]].concat();
    let mut simulation = simulation("palpate", &set);
    let reports = run(&mut simulation);
    for report in &reports[..59] {
        assert_eq!(report.times.indicator_ms > 0.0, report.step % 3 == 0, "{report:?}");
        assert!(report.splits + report.merges <= 4, "{report:?}");
        assert!(report.splits + report.merges == 0 || report.step % 3 > 0, "{report:?}");
    }
    // What is more than may change at a time is done in the step after.
    assert!(reports.iter().any(|r| r.step % 3 == 2 && r.splits > 0));
    assert!(reports.iter().map(|r| r.splits).sum::<usize>() > 20);
    assert!(reports.iter().all(|r| r.converged));
}

#[test]
fn a_pressed_body_takes_its_pressures_along() {
    let mut simulation = simulation("palpate", &["time.steps=60", "output.frames_every=1000"]);
    let reports = run(&mut simulation);
    assert!(reports.iter().all(|report| report.converged));
    // With pressures that begin where they were it takes 95.
    let iterations: usize = reports.iter().map(|report| report.iterations).sum();
    assert!(iterations < 84, "{iterations}");
}

/// The levels of the tetrahedra with a corner within 10 mm of the ball of `palpate` and not of void for the most part, at rest.
fn levels_near_the_ball(simulation: &mut Simulation) -> Vec<u8> {
    let [x, y, z] = simulation.tool_pose(0, 0.0).unwrap().move_m.map(|m| 1e3 * m);
    // The middle of the body's bounding box lies at (-1, 0, 0) mm.
    let centre = [x - 1.0, y, z];
    let frame = simulation.frame().unwrap().without_void();
    let off = |v: &u32| {
        let point = frame.points_mm[*v as usize];
        (0..3).map(|axis| (point[axis] - centre[axis]).powi(2)).sum::<f64>().sqrt()
    };
    let is_near = |tet: &[u32; 4]| tet.iter().any(|v| off(v) < 15.0 + 10.0);
    let tets = frame.tets.iter().zip(&frame.level);
    tets.filter(|(tet, _)| is_near(tet)).map(|(_, level)| *level).collect()
}

#[test]
fn where_a_ball_is_about_to_touch_the_mesh_is_fine_beforehand() {
    let made = |set: &[&str]| {
        let mut simulation = simulation("palpate", set);
        assert!(simulation.step().unwrap().tools[0].contacts == 0);
        simulation
    };
    let mut fine = made(&["refinement.near_probe={ level = 5, within_m = 0.01 }"]);
    let levels = levels_near_the_ball(&mut fine);
    assert!(levels.len() > 8 && levels.iter().all(|level| *level >= 5), "{levels:?}");
    let mut coarser = made(&["refinement.near_probe={ level = 3, within_m = 0.01 }"]);
    let levels = levels_near_the_ball(&mut coarser);
    assert!(levels.iter().all(|level| *level >= 3), "{levels:?}");
    assert!(levels.iter().any(|level| *level < 5), "{levels:?}");
    let vertices = [&coarser, &fine].map(|simulation| simulation.body().vertex_count());
    assert!(vertices[1] > vertices[0] + 20 && vertices[1] < 400, "{vertices:?}");
    // As many as there may be.
    let full = made(&["mesh.max_vertices=200"]);
    assert_eq!(full.body().vertex_count(), 200);
}

/// What a contact has made come in would be asked for again by the elements that it made: where that does
/// not count, it goes out, comes in again, and the force is another in every third step.
#[test]
fn a_ball_that_stays_leaves_the_mesh_alone() {
    let finer = [
        "mesh.base_mm=16",
        "mesh.start_level=1",
        "mesh.max_level=4",
        "stages.element=p1",
        "refinement.near_probe={ level = 4, within_m = 0.002 }",
    ];
    for (indicator, mesh) in [("residual", &[][..]), ("energy", &finer[..])] {
        let path = "tools.0.path=[{time_s=0,move_m=[0.0239,0.0760,0.0266]},\
            {time_s=0.1,move_m=[0.0239,0.0694,0.0266]}]";
        let indicator = format!("stages.indicator={indicator}");
        let often = ["refinement.every_steps=1", "refinement.max_splits_per_step=200"];
        // The ball stands from step 30 on; a change is felt over 18 steps, and what they bring may ask for one more.
        let set = [&often[..], mesh, &[path, &indicator, "time.steps=90"]].concat();
        let mut simulation = simulation("palpate", &set);
        let reports = run(&mut simulation);
        assert!(reports.iter().all(|r| r.converged));
        assert!(reports[55..].iter().all(|r| r.splits + r.merges == 0), "{indicator}");
        assert!(reports[..55].iter().map(|r| r.splits).sum::<usize>() > 20, "{indicator}");
        let force = |r: &StepReport| r.tools[0].force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        let last = force(&reports[89]);
        assert!(reports[70..].iter().all(|r| (force(r) - last).abs() < 2e-3 * last), "{indicator}");
    }
}
