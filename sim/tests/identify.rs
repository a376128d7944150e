//! Moduli from how a body moved: derivatives against differences, phantoms with noise, what is refused.

use yawara::identify::{Identified, Measured, Measurement, Options, identify, misfit, predict};
use yawara::scene::{Image, Scene};
use yawara::scene_file;
use yawara_mesh::volume::{Grid, LabelVolume};

use crate::workbench::Workbench;

const MODULI: [f64; 4] = [4e3, 9e3, 1.5e4, 6e3];

/// A block of 80 mm with a label to each quarter, as seen from above.
fn quarters() -> LabelVolume {
    let cells = 16;
    let label = |i: usize| {
        let (x, y) = (i % cells, i / cells % cells);
        1 + u16::from(2 * x >= cells) + 2 * u16::from(2 * y >= cells)
    };
    let labels = (0..cells * cells * cells).map(label).collect();
    LabelVolume::new(Grid::centred([cells; 3], 5.0), labels, vec![0, 1, 2, 3, 4]).unwrap()
}

/// The block on a table with `tool` in its second step.
fn scene(tool: &str, settings: &[&str]) -> Scene {
    let material = |(i, modulus): (usize, &f64)| {
        format!(
            "[[materials]]\nlabel = {}\nyoung_modulus_pa = {modulus:?}\npoisson_ratio = 0.3\n\
             density_kg_m3 = 1000.0\n",
            i + 1
        )
    };
    let materials: String = MODULI.iter().enumerate().map(material).collect();
    let text = format!(
        "name = \"quarters\"\n{materials}\
         [mesh]\nbase_mm = 40.0\nstart_level = 3\n\
         [[fixed]]\nshape = \"box\"\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 1.0, 0.1]\n\
         [[tools]]\n{tool}\n[time]\nsteps = 2\nstep_s = 0.5\n"
    );
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    scene_file::parse(&text, "quarters", &settings, true).unwrap()
}

const PULL: &str = "kind = \"grab\"\nregion = { shape = \"box\", min = [0.3, 0.3, 0.9], max = [0.7, 0.7, 1.0] }\n\
     path = [{ time_s = 0.0, move_m = [0.0, 0.0, 0.0] }, { time_s = 1.0, move_m = [0.004, 0.0, 0.012] }]";

const PRESS: &str = "kind = \"probe\"\ncentre = [0.5, 0.5, 1.0]\nradius_m = 0.03\nspacing_m = 0.005\n\
     path = [{ time_s = 0.0, move_m = [0.003, 0.001, 0.031] }, { time_s = 1.0, move_m = [0.003, 0.001, 0.022] }]";

/// Points of the top and two sides, the force of tool 0, both at the end of the first step and of the second.
fn asked() -> Vec<Measurement> {
    let mut asked = Vec::new();
    let one = |time_s, of| Measurement {
        time_s,
        of,
        values: [Some(0.0); 3],
        sd: Some(0.1),
        place: "asked".into(),
    };
    for time_s in [0.5, 1.0] {
        for (i, j) in (0..5).flat_map(|j| (0..5).map(move |i| (i, j))) {
            let [a, b] = [i, j].map(|n: i32| f64::from(n) * 18.0 - 36.0);
            asked.extend(
                [[a, b, 39.0], [39.0, a, b], [a, -39.0, b]]
                    .map(|at| one(time_s, Measured::Move(at))),
            );
        }
        asked.push(Measurement { sd: Some(0.02), ..one(time_s, Measured::Force(0)) });
    }
    asked
}

/// Standard normal numbers: Box and Muller's of Marsaglia's xorshift64*.
fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = move || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    };
    move || {
        let [u, v] = [uniform(), uniform()];
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// What the scene says, with normal noise of the given standard deviations.
fn noisy(scene: &Scene, seed: u64, share: f64) -> Vec<Measurement> {
    let mut asked = asked();
    let values = predict(scene, Some(&quarters()), &asked).unwrap();
    let mut normal = normal(seed);
    for (one, values) in asked.iter_mut().zip(values.chunks_exact(3)) {
        let sd = one.sd.unwrap();
        one.values = [0, 1, 2].map(|axis| Some(values[axis] + share * sd * normal()));
    }
    asked
}

fn with_moduli(scene: &Scene, moduli: [f64; 4]) -> Scene {
    let mut scene = scene.clone();
    let materials = scene.materials.iter_mut().zip(moduli);
    materials.for_each(|(material, modulus)| material.young_modulus_pa = modulus);
    scene
}

/// Half the squares' slope by one adjoint state against fourth-order differences.
fn assert_gradient(tool: &str, settings: &[&str], bound: f64) {
    let mut exact = [settings, &["solver.residual=1e-12"]].concat();
    if !settings.contains(&"support.hold=vertices") {
        // Otherwise it goes with the moduli that a scene begins with.
        exact.push("support.stiffness_n_m4=2e10");
    }
    let scene = scene(tool, &exact);
    let measured = noisy(&scene, 1, 3.0);
    let here = with_moduli(&scene, [5e3, 8e3, 1.2e4, 8e3]);
    assert_slopes(&here, Some(&quarters()), &measured, &[0, 1, 2, 3], bound);
}

fn assert_slopes(
    here: &Scene,
    volume: Option<&LabelVolume>,
    measured: &[Measurement],
    entries: &[usize],
    bound: f64,
) {
    let value = |entry: usize, change: f64| {
        let mut scene = here.clone();
        scene.materials[entry].young_modulus_pa *= change.exp();
        misfit(&scene, volume, measured, &entries[..1]).unwrap().0
    };
    let found = misfit(here, volume, measured, entries).unwrap().1;
    let largest = found.iter().fold(0.0, |most: f64, slope| most.max(slope.abs()));
    for (&entry, found) in entries.iter().zip(found) {
        let central = |h: f64| (value(entry, h) - value(entry, -h)) / (2.0 * h);
        let slope = (4.0 * central(5e-3) - central(1e-2)) / 3.0;
        let off = (found - slope).abs() / largest;
        let stages = &here.stages;
        assert!(off < bound, "{stages:?}, {entry}: {found} for {slope}, {off:.1e}");
    }
}

/// The liver with tetrahedra that carry the label of most of them.
#[cfg(feature = "gmsh")]
#[test]
fn the_gradient_is_that_of_differences_on_a_mesh_from_a_file() {
    let bench = Workbench::new();
    let set = ["--steps", "1", "--set", "image.voxel_mm=4.0", "--set", "output.msh=true"];
    bench.succeed(&[&["run", "liver", "--out", "image"][..], &set].concat());
    let set = ["solver.residual=1e-12", "support.hold=vertices", "tools.0.hold=vertices"];
    let (mut scene, _) = scene_file::load("liver", &set.map(str::to_owned)).unwrap();
    scene.image = Image::default();
    scene.mesh.path = Some(bench.path("image/frames/step_000000.msh"));
    (scene.mesh.base_mm, scene.mesh.max_level) = (None, None);
    let measured: Vec<Measurement> = [2.0, 4.0]
        .into_iter()
        .map(|steps| Measurement {
            time_s: steps * scene.time.step_s,
            of: Measured::Force(0),
            values: [Some(0.1), Some(0.0), Some(0.1)],
            sd: Some(0.01),
            place: "asked".into(),
        })
        .collect();
    // Parenchyma and tumour.
    assert_slopes(&scene, None, &measured, &[0, 3], 1e-6);
}

#[test]
fn the_gradient_is_that_of_differences_under_a_grab() {
    for hold in ["mean", "vertices"] {
        assert_gradient(PULL, &[&format!("tools.0.hold={hold}")], 1e-6);
    }
    assert_gradient(PULL, &["tools.0.hold=pad", "tools.0.stiffness_n_m4=3e9"], 1e-6);
}

#[test]
fn the_gradient_is_that_of_differences_for_other_elements_rotations_and_supports() {
    assert_gradient(PULL, &["stages.element=p1p1", "materials.1.poisson_ratio=0.49"], 1e-6);
    assert_gradient(PULL, &["stages.corotation=none", "support.hold=vertices"], 1e-6);
    assert_gradient(PULL, &["stages.law=neo_hookean"], 1e-6);
    assert_gradient(PULL, &["stages.homogenisation=paper", "gravity_m_s2=[0.0,0.0,-9.8]"], 1e-6);
}

#[test]
fn the_gradient_is_that_of_differences_under_a_probe() {
    assert_gradient(PRESS, &[], 1e-6);
}

/// The scene that knows nothing but one modulus for all, and what is found from there.
fn found(truth: &Scene, measured: &[Measurement], options: &Options) -> Identified {
    let start = with_moduli(truth, [8e3; 4]);
    identify(&start, Some(&quarters()), measured, options, &mut |_, _| {}).unwrap()
}

/// How far each is off, as a part of it.
fn errors(found: &Identified) -> Vec<f64> {
    let of = |modulus: &yawara::identify::Modulus| {
        modulus.young_modulus_pa / MODULI[modulus.entry] - 1.0
    };
    found.moduli.iter().map(of).collect()
}

#[test]
fn four_moduli_are_found_from_noisy_moves_and_forces() {
    let truth = scene(PULL, &["support.stiffness_n_m4=2e10"]);
    let found = found(&truth, &noisy(&truth, 7, 1.0), &Options::default());
    assert!(found.converged && found.sd_is_given && found.vertices > 50);
    for (modulus, off) in found.moduli.iter().zip(errors(&found)) {
        assert!(modulus.is_told && off.abs() < 3.0 * modulus.relative_sd, "{modulus:?} {off}");
        assert!(modulus.relative_sd < 0.06 && modulus.mesh_shift.is_none(), "{modulus:?}");
    }
    // Within four of its own standard deviations.
    let (chi, free) = (found.chi_squared, found.degrees_of_freedom);
    assert!(
        (free - 452.0).abs() < 1.0 && (chi - free).abs() < 4.0 * (2.0 * free).sqrt(),
        "{chi} of {free}"
    );
    assert_eq!(found.residuals.len(), 456);
    assert!((0..4).all(|i| (found.correlation[i][i] - 1.0).abs() < 1e-12));
}

#[test]
fn noise_that_is_not_given_is_taken_from_what_is_left() {
    let truth = scene(PULL, &["support.stiffness_n_m4=2e10"]);
    let mut measured = noisy(&truth, 7, 1.0);
    measured.retain(|one| matches!(one.of, Measured::Move(_)) || one.time_s == 1.0);
    let given = found(&truth, &measured, &Options::default());
    measured.iter_mut().for_each(|one| one.sd = None);
    let taken = found(&truth, &measured, &Options::default());
    assert!(!taken.sd_is_given);
    let moves = taken.residuals.iter().find(|one| one.kind == "move_mm").unwrap();
    assert!((moves.sd - 0.1).abs() < 0.02, "{}", moves.sd);
    for (a, b) in given.moduli.iter().zip(&taken.moduli) {
        // A force that counts for more than it should tells more.
        assert!((0.4..2.5).contains(&(a.relative_sd / b.relative_sd)), "{a:?} {b:?}");
    }
}

/// A pull that is led tells ratios of moduli; how large they are only its force does.
#[test]
fn what_nothing_measured_depends_on_stays_as_it_was_believed_and_is_said_so() {
    let truth = scene(PULL, &["support.hold=vertices"]);
    let mut measured = noisy(&truth, 3, 1.0);
    measured.retain(|one| matches!(one.of, Measured::Move(_)));
    let found = found(&truth, &measured, &Options { prior_factor: 2.0, ..Options::default() });
    for modulus in &found.moduli {
        assert!(!modulus.is_told && modulus.relative_sd > 0.3, "{modulus:?}");
        assert!(modulus.relative_sd <= 2.0_f64.ln());
    }
    let ratio = |i: usize| {
        let of = |moduli: &dyn Fn(usize) -> f64| moduli(i) / moduli(2);
        of(&|i| found.moduli[i].young_modulus_pa) / of(&|i| MODULI[i]) - 1.0
    };
    assert!([0, 1, 3].map(ratio).iter().all(|off| off.abs() < 0.15), "{:?}", [0, 1, 3].map(ratio));
    assert!(found.correlation[0][2] > 0.95, "{:?}", found.correlation);
}

#[test]
fn where_the_scene_refines_it_is_said_by_how_much_the_mesh_moves_what_is_found() {
    let truth = scene(PULL, &["support.stiffness_n_m4=2e10", "mesh.max_level=6"]);
    let found = found(&truth, &noisy(&truth, 5, 1.0), &Options::default());
    let shifts: Vec<f64> = found.moduli.iter().filter_map(|one| one.mesh_shift).collect();
    assert!(shifts.len() == 4 && shifts.iter().any(|shift| shift.abs() > 1e-3), "{shifts:?}");
    assert!(shifts.iter().all(|shift| shift.abs() < 0.5), "{shifts:?}");
    assert!(found.left_out[0].contains("refinement"), "{:?}", found.left_out);
    // A start mesh that is finer where labels meet stays so.
    let finer = ["support.stiffness_n_m4=2e10", "mesh.max_level=6", "mesh.label_level=4"];
    let start = scene(PULL, &finer);
    let measured = noisy(&start, 5, 1.0);
    let one_run = Options { runs: 1, ..Options::default() };
    let there = identify(&start, Some(&quarters()), &measured, &one_run, &mut |_, _| {}).unwrap();
    // Here labels meet on faces of its cells.
    assert_eq!((there.vertices, there.runs), (found.vertices, 1));
}

#[test]
fn what_does_not_fit_the_scene_is_refused_with_its_place() {
    let plain = scene(PULL, &[]);
    let one = asked().remove(0);
    let refused = |scene: &Scene, measured: &[Measurement], options: &Options, want: &str| {
        let found = identify(scene, Some(&quarters()), measured, options, &mut |_, _| {});
        let message = found.unwrap_err().to_string();
        assert!(message.contains(want), "{message}\nwant {want}");
    };
    let usual = Options::default();
    let with = |change: &dyn Fn(&mut Measurement)| {
        let mut one = one.clone();
        change(&mut one);
        [one]
    };
    refused(&plain, &[], &usual, "measurements is none, want one at least");
    refused(
        &plain,
        &with(&|one| one.time_s = 0.7),
        &usual,
        "asked: time_s is 0.7, want the end of",
    );
    refused(&plain, &with(&|one| one.time_s = 1.5), &usual, "at most 1 s");
    let far = with(&|one| one.of = Measured::Move([0.0, 0.0, 60.0]));
    refused(&plain, &far, &usual, "x_mm, y_mm, z_mm is [0.0, 0.0, 60.0], want a point of the body");
    let other = with(&|one| one.of = Measured::Force(1));
    refused(&plain, &other, &usual, "tool is 1, want below 1");
    let mixed = [one.clone(), Measurement { sd: None, ..one.clone() }];
    refused(&plain, &mixed, &usual, "sd is given for 1 of 2 measurements");
    let entries = Options { entries: vec![4], ..Options::default() };
    refused(&plain, &with(&|_| ()), &entries, "a material is 4");
    let twice = Options { entries: vec![1, 1], ..Options::default() };
    refused(&plain, &with(&|_| ()), &twice, "a material is 1, want the number of an entry");
    let prior = Options { prior_factor: 1.0, ..Options::default() };
    refused(&plain, &with(&|_| ()), &prior, "the prior's factor is 1");
    let moving = scene(PULL, &["dynamics={}", "stages.integrator=newmark"]);
    refused(&moving, &with(&|_| ()), &usual, "dynamics is there, want none");
    let viscous = "materials.0.law={ kind = 'prony', terms = [{ fraction = 0.5, time_s = 1.0 }] }";
    refused(&scene(PULL, &[viscous]), &with(&|_| ()), &usual, "want laws of the strain alone");
    let load = "kind = \"load\"\nregion = { shape = \"box\", min = [0.0, 0.0, 0.9], max = [1.0, 1.0, 1.0] }\nload = [{ time_s = 0.0, force_n = [0.0, 0.0, 0.1] }]";
    let force = with(&|one| one.of = Measured::Force(0));
    refused(&scene(load, &[]), &force, &usual, "tool is 0, want that of a grab or a probe");
}

/// The program with a table of its own making, and the skin of the same scene.
#[test]
fn the_program_finds_a_modulus_and_draws_a_skin() {
    let bench = Workbench::new();
    let settings = ["--set", "mesh.max_level=0", "--set", "gravity_m_s2=[0.0, 0.0, 0.0]"];
    let measured = [0.1, 0.2].map(|time_s| Measurement {
        time_s,
        of: Measured::Force(0),
        values: [Some(0.0); 3],
        sd: None,
        place: "asked".into(),
    });
    let set = ["mesh.max_level=0", "gravity_m_s2=[0.0, 0.0, 0.0]"].map(str::to_owned);
    let (beam, _) = scene_file::load("beam", &set).unwrap();
    let steps: Vec<Measurement> = measured
        .into_iter()
        .zip(1..)
        .map(|(one, step)| Measurement { time_s: f64::from(step) * beam.time.step_s, ..one })
        .collect();
    let values = predict(&beam, None, &steps).unwrap();
    let mut table = String::from("time_s,tool,fx_n,fy_n,fz_n,sd_n\n");
    for (one, values) in steps.iter().zip(values.chunks_exact(3)) {
        let [x, y, z] = [0, 1, 2].map(|axis| 1.5 * values[axis]);
        table += &format!("{},0,{x},{y},{z},1e-4\n", one.time_s);
    }
    bench.write("forces.csv", table);
    let identify = ["identify", "beam", "--measured", "forces.csv"];
    let files = ["--json", "found.json", "--picture", "found.svg"];
    let printed = bench.succeed(&[&identify[..], &files[..], &settings[..]].concat());
    assert!(printed.contains("nothing changes any more"), "{printed}");
    let found: serde_json::Value = serde_json::from_str(&bench.read("found.json")).unwrap();
    let modulus = found["moduli"][0]["young_modulus_pa"].as_f64().unwrap();
    // The support stays as it is: not quite in proportion.
    let ratio = modulus / beam.materials[0].young_modulus_pa;
    assert!((1.5..1.7).contains(&ratio), "{ratio}");
    assert!(
        bench.read("found.svg").starts_with("<svg")
            && bench.read("found.svg").contains("forces, N")
    );
    bench.refused(
        &[&identify[..], &["--material", "steel"]].concat(),
        &["--material is steel, want one of"],
    );
    bench.refused(&[&identify[..], &["--picture", "found.png"]].concat(), &["ends in .svg"]);
    bench.write("bad.csv", "time_s,tool,fx_n\n0.1,0,one\n");
    let bad = ["identify", "beam", "--measured", "bad.csv"];
    bench.refused(&bad, &["bad.csv, line 2: fx_n is \"one\", want a number"]);

    let feel = ["feel", "beam", "--out", "felt.png", "--points", "200"];
    let printed = bench.succeed(&[&feel[..], &["--json", "felt.json"], &settings[..]].concat());
    assert!(printed.contains("stiffness"), "{printed}");
    let skin: serde_json::Value = serde_json::from_str(&bench.read("felt.json")).unwrap();
    assert!(skin["points"].as_array().unwrap().len() > 100 && skin.get("felt_share").is_none());
    bench.refused(&[&feel[..], &["--radius-mm", "0"]].concat(), &["the radius (mm) is 0"]);
    bench.refused(&["feel", "beam", "--out", "felt.jpg"], &["ends in .png"]);
}
