//! Bodies that remember: moduli that relax and strain that stays, as whole scenes.

use std::cell::Cell;

use yawara::indicator::{Indicator, RingMember};
use yawara::report::StepReport;
use yawara::scene::Image;
use yawara::{Simulation, Stages, scene_file};
use yawara_mesh::volume::{Grid, LabelVolume};

/// A scene with these settings, before its first step.
fn scene(name: &str, set: &[&str], change: impl FnOnce(&mut Stages)) -> Simulation {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load(name, &overrides).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    change(&mut stages);
    Simulation::new(&scene, stages).unwrap()
}

fn run(simulation: &mut Simulation) -> Vec<StepReport> {
    let mut reports = Vec::new();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{report:?}");
        reports.push(report);
    }
    reports
}

/// Wants any vertex with the same chance, and then does not.
struct Dice(Cell<u64>);

impl Indicator for Dice {
    fn name(&self) -> &'static str {
        "dice"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn measure(&self, _: &[RingMember]) -> f64 {
        // Knuth's generator.
        let next = self.0.get().wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        self.0.set(next);
        (next >> 33) as f64 / (1u64 << 31) as f64
    }
}

/// A bar of 160 x 40 x 40 mm of ν = 0 whose ends are pulled apart by 8 mm in the first step of .2 s, and held.
const PULLED: [&str; 7] = [
    "gravity_m_s2=[0.0, 0.0, 0.0]",
    "materials.0.poisson_ratio=0.0",
    "support.hold=vertices",
    "tools=[{ kind = 'grab', hold = 'vertices', region = { shape = 'box', min = [1.0, 0.0, 0.0], \
     max = [1.0, 1.0, 1.0] }, path = [{ time_s = 0.0 }, { time_s = 0.2, move_m = [0.008, 0.0, 0.0] }] }]",
    "time={ steps = 120, step_s = 0.2 }",
    "stages.element=p1",
    "solver.residual=1e-15",
];

const LADDER: &str = "materials.0.law={ kind = 'prony', relaxing = 'whole', terms = [\
     { fraction = 0.3, time_s = 0.3 }, { fraction = 0.4, time_s = 2.0 }] }";

/// F(t)/F_∞ of that ladder at the end of step `n`, from 1.
fn relaxed(n: usize) -> f64 {
    let term = |fraction: f64, tau: f64| {
        let x = 0.2 / tau;
        fraction * (1.0 - (-x).exp()) / x * (-(n as f64 - 1.0) * x).exp()
    };
    (0.3 + term(0.3, 0.3) + term(0.4, 2.0)) / 0.3
}

#[test]
fn an_even_relaxation_is_exact_through_ten_thousand_splits_and_merges() {
    let set = [
        "mesh={ base_mm = 20.0, max_level = 5, max_vertices = 500 }",
        "refinement={ split_above = 0.5, merge_fraction = 0.9, dwell_steps = 0, max_splits_per_step = 200 }",
    ];
    let set = [&PULLED[..], &[LADDER], &set].concat();
    let mut simulation =
        scene("homogeneous", &set, |stages| stages.indicator = Box::new(Dice(Cell::new(7))));
    let reports = run(&mut simulation);
    let changes: usize = reports.iter().map(|report| report.splits + report.merges).sum();
    // E_∞ A ε of .05, with E = 50 kPa at once.
    let rest = 0.3 * 5e4 * 1.6e-3 * 0.05;
    let off = |report: &StepReport| {
        (report.tools[0].force_n[0] / rest / relaxed(report.step) - 1.0).abs()
    };
    let worst = reports.iter().map(off).fold(0.0, f64::max);
    println!("{changes} splits and merges; off by {worst:e}");
    assert!(changes > 10_000, "{changes}");
    assert!(worst < 1e-12, "{worst:e}");
    let energy = simulation.summary().unwrap().energy.unwrap();
    let most = energy.stored_j * 1e-10;
    assert!(energy.merges.added_j + energy.merges.removed_j < most, "{energy:?}");
    assert!(energy.splits.added_j + energy.splits.removed_j < most, "{energy:?}");
}

/// A bar of two materials that is bent, pulled, let go: all laws at once.
const MIXED: [&str; 4] = [
    "materials.0.law={ kind = 'prony', terms = [{ fraction = 0.3, time_s = 0.1 }, { fraction = 0.2, time_s = 2.0 }] }",
    "materials.1.law={ kind = 'plastic', yield_pa = 400.0, hardening_pa = 1e4 }",
    "materials.2.law={ kind = 'creep', yield_strain = 0.01, rate_per_s = 1.0, max_strain = 0.2 }",
    "materials.3.law={ kind = 'prony', power_law = { exponent = 0.1, from_s = 0.1, to_s = 10.0, terms = 4 } }",
];

#[test]
fn an_organ_of_all_laws_moves_and_loses_what_tools_do() {
    let set = [&MIXED[..], &["time.steps=12", "mesh.max_vertices=900"]].concat();
    let mut simulation = scene("liver", &set, |_| ());
    let reports = run(&mut simulation);
    assert!(reports.iter().any(|report| report.splits > 0));
    let row = simulation.plan().iter().find(|row| row.stage == "law").unwrap().clone();
    println!("{}", row.why);
    assert!(row.why.contains("materials[1] plastic") && row.why.contains("% of its power law"));
    let energy = simulation.summary().unwrap().energy.unwrap();
    println!("{energy:?}");
    assert!(energy.dissipated_j.unwrap() > 0.0 && energy.created_j < 0.05 * energy.tools_work_j);
    let frame = simulation.frame().unwrap();
    assert_eq!(frame.plastic_strain.len(), frame.tets.len());
    assert!(frame.plastic_strain.iter().any(|strain| *strain > 0.0));
    assert!(frame.dissipated_j_m3.iter().all(|heat| *heat >= 0.0));
}

/// The force that holds a pulled bar after each step, N.
fn pull(set: &[&str]) -> Vec<f64> {
    let quick = ["time={ steps = 12, step_s = 0.2 }", "mesh={ base_mm = 20.0, start_level = 0 }"];
    let set = [&PULLED[..6], &quick, set].concat();
    run(&mut scene("homogeneous", &set, |_| ()))
        .iter()
        .map(|report| report.tools[0].force_n[0])
        .collect()
}

#[test]
fn both_elements_relax_alike_and_linear_materials_do_not() {
    let prony = "materials.0.law={ kind = 'prony', terms = [{ fraction = 0.5, time_s = 0.4 }] }";
    let mixed = pull(&[prony, "stages.element=p1p1", "materials.0.poisson_ratio=0.3"]);
    let plain = pull(&[prony, "materials.0.poisson_ratio=0.3"]);
    let [elastic, linear] = [&["materials.0.law={ kind = 'linear' }"][..], &[]].map(pull);
    for ((a, b), step) in mixed.iter().zip(&plain).zip(1..) {
        assert!((a / b - 1.0).abs() < 0.05, "step {step}: {a} and {b} N");
    }
    let left = |forces: &[f64]| forces[11] / forces[0];
    assert!(left(&plain) < 0.75 && (left(&mixed) / left(&plain) - 1.0).abs() < 0.01);
    for (a, b) in elastic.iter().zip(&linear) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} and {b} N");
    }
}

/// A stiff elastic tube along x in a matrix that relaxes, 16 x 8 x 8 voxels of 5 mm, pulled across or along: forces over
/// time on a mesh of a level.
fn tube(along: usize, level: u8, steps: usize, law: &str, young_modulus_pa: f64) -> Vec<f64> {
    let dims = [16, 8, 8];
    let labels = (0..dims.iter().product::<usize>()).map(|i| {
        let [y, z] = [i / 16 % 8, i / 128].map(|c| c as f64 - 3.5);
        if y.hypot(z) < 2.5 { 2 } else { 1 }
    });
    let volume = LabelVolume::from_original(Grid::centred(dims, 5.0), labels).unwrap();
    let mut box_max = [1.0; 3];
    let mut box_min = [0.0; 3];
    (box_max[along], box_min[along]) = (0.0, 1.0);
    let mut by = [0.0; 3];
    by[along] = 0.002;
    let set = [
        "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
        "support.hold=vertices".into(),
        format!("fixed=[{{ shape = 'box', min = [0.0, 0.0, 0.0], max = {box_max:?} }}]"),
        format!(
            "tools=[{{ kind = 'grab', hold = 'vertices', region = {{ shape = 'box', min = {box_min:?}, \
             max = [1.0, 1.0, 1.0] }}, path = [{{ time_s = 0.0 }}, {{ time_s = 0.2, move_m = {by:?} }}] }}]"
        ),
        format!("time={{ steps = {steps}, step_s = 0.2 }}"),
        "materials.0.poisson_ratio=0.3".into(),
        format!("materials.0.law={law}"),
        format!("materials.0.young_modulus_pa={young_modulus_pa}"),
        format!("mesh={{ base_mm = 20.0, start_level = {level}, max_vertices = 10000 }}"),
        "stages.element=p1".into(),
    ];
    let (mut scene, _) = scene_file::load("homogeneous", &set).unwrap();
    scene.image = Image::default();
    let mut stiff = scene.materials[0].clone();
    (stiff.label, stiff.law) = (Some(2), None);
    stiff.young_modulus_pa = 1e6;
    scene.materials.push(stiff);
    let mut simulation = Simulation::builder(&scene).volume(volume).build().unwrap();
    run(&mut simulation).iter().map(|report| report.tools[0].force_n[along]).collect()
}

const RELAXING: &str =
    "{ kind = 'prony', relaxing = 'whole', terms = [{ fraction = 0.8, time_s = 0.5 }] }";

/// What a coarse mesh has left of its force beside the fine one that it stands for: as wrong as the homogenisation of
/// the tube, and less so on a finer mesh.
#[test]
fn a_homogenised_tube_relaxes_as_the_fine_body_does_but_for_its_homogenisation() {
    for along in [0, 2] {
        let left = |level: u8| {
            let forces = tube(along, level, 5, RELAXING, 5e4);
            (forces[0], forces[4] / forces[0])
        };
        let [fine, half, coarse] = [6, 3, 0].map(left);
        println!(
            "axis {along}, force in N and what is left of it after 1 s: {fine:?}, {half:?}, {coarse:?}"
        );
        let off = |(_, left): (f64, f64)| (left / fine.1 - 1.0).abs();
        assert!(
            off(half) < 0.7 * off(coarse) && off(coarse) < 0.2,
            "{} {}",
            off(half),
            off(coarse)
        );
    }
}

/// After a long time a homogenised body is that of the relaxed materials.
#[test]
fn a_homogenised_tube_comes_to_the_force_of_relaxed_materials() {
    let relaxed = tube(2, 0, 1, "{ kind = 'linear' }", 0.2 * 5e4)[0];
    let last = tube(2, 0, 80, RELAXING, 5e4)[79];
    // e⁻³² is left, and a residual of 1e-6.
    assert!((last / relaxed - 1.0).abs() < 1e-5, "{last} N, want {relaxed} N");
}
