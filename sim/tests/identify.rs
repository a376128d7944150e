//! Moduli from how a body moved: derivatives against differences, phantoms with noise, what is refused.

use yawara::identify::{Identified, Measured, Measurement, Options, identify, misfit, predict};
use yawara::scene::{Image, Scene};
use yawara::scene_file;
use yawara_mesh::volume::{Grid, LabelVolume};

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
        "name = \"quarters\"\n[image]\nphantom = \"block\"\nsize_mm = [80.0, 80.0, 80.0]\nvoxel_mm = 5.0\n{materials}\
         [mesh]\nbase_mm = 40.0\nstart_level = 3\n\
         [[fixed]]\nshape = \"box\"\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 1.0, 0.1]\n\
         [[tools]]\n{tool}\n[time]\nsteps = 2\nstep_s = 0.5\n"
    );
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("quarters.toml");
    std::fs::write(&file, text).unwrap();
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let scene = scene_file::load(&file.display().to_string(), &settings).unwrap().0;
    Scene { image: Image::default(), ..scene }
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
    let volume = quarters();
    let here = [5e3, 8e3, 1.2e4, 8e3];
    let value = |entry: usize, change: f64| {
        let mut moduli = here;
        moduli[entry] *= f64::exp(change);
        misfit(&with_moduli(&scene, moduli), Some(&volume), &measured, &[0]).unwrap().0
    };
    let all = [0, 1, 2, 3];
    let found = misfit(&with_moduli(&scene, here), Some(&volume), &measured, &all).unwrap().1;
    let largest = found.iter().fold(0.0, |most: f64, slope| most.max(slope.abs()));
    for entry in all {
        let central = |h: f64| (value(entry, h) - value(entry, -h)) / (2.0 * h);
        let slope = (4.0 * central(5e-3) - central(1e-2)) / 3.0;
        let off = (found[entry] - slope).abs() / largest;
        assert!(
            off < bound,
            "{settings:?}, entry {entry}: {} for {slope}, {off:.1e}",
            found[entry]
        );
    }
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
    let measured = noisy(&truth, 7, 1.0);
    let found = found(&truth, &measured, &Options::default());
    println!("{} runs, chi {} of {}", found.runs, found.chi_squared, found.degrees_of_freedom);
    for (modulus, off) in found.moduli.iter().zip(errors(&found)) {
        println!("{modulus:?} {off:.4}");
    }
    assert!(found.converged);
}
