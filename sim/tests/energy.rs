//! The ledger of energy: work is what is stored as steps get short, splits and merges do by themselves
//! what the energies before and after them say, and nothing is entered twice.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use nalgebra::{Matrix3, SVector, Vector3};
use yawara::indicator::{Indicator, RingMember};
use yawara::report::{EnergyChange, EnergySummary};
use yawara::{BodyState, Pose, Simulation, Stages, Tool, scene_file};

fn strings(set: &[&str]) -> Vec<String> {
    set.iter().map(|s| (*s).into()).collect()
}

fn simulation(scene: &str, set: &[&str]) -> Simulation {
    let (scene, _) = scene_file::load(scene, &strings(set)).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

/// Runs all steps, which have to converge.
fn run(simulation: &mut Simulation) -> EnergySummary {
    while simulation.steps_left() > 0 {
        assert!(simulation.step().unwrap().converged);
    }
    simulation.summary().unwrap().energy.unwrap()
}

/// What the body stores with the rotation of each element nearest to its gradient, by singular values: an
/// energy of positions alone. For displacements alone and a linear law.
fn energy(simulation: &Simulation) -> f64 {
    let body = simulation.body();
    let mut sum = simulation.energy_j();
    for (number, element) in body.elements().iter().enumerate() {
        let mut f = Matrix3::zeros();
        for (v, gradient) in element.vertices.iter().zip(&element.geometry.gradients) {
            f += body.positions()[*v] * gradient.transpose();
        }
        let svd = f.svd(true, true);
        let nearest = svd.u.unwrap() * svd.v_t.unwrap();
        let stored = |rotation: &Matrix3<f64>| {
            let e = rotation.transpose() * f - Matrix3::identity();
            let [xy, yz, zx] = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| e[(i, j)] + e[(j, i)]);
            let strain = SVector::<f64, 6>::from([e.m11, e.m22, e.m33, xy, yz, zx]);
            0.5 * element.geometry.volume * (element.elasticity * strain).dot(&strain)
        };
        sum += stored(&nearest) - stored(&body.rotation(number));
    }
    sum
}

/// What is left of the balance of `twist` on a mesh that stays, of what is stored, with `steps` steps for the
/// same path.
fn imbalance(steps: u32, set: &[&str]) -> f64 {
    let (steps, step_s) = (format!("time.steps={steps}"), 2.0 / f64::from(steps));
    let step_s = format!("time.step_s={step_s:?}");
    let mut all = vec!["mesh.max_level=0", "solver.residual=1e-9", &steps, &step_s];
    all.extend(set);
    let energy = run(&mut simulation("twist", &all));
    assert!(energy.stored_j > 1e-4, "{energy:?}");
    assert_eq!((energy.splits, energy.merges), Default::default());
    let left = energy.tools_work_j + energy.weight_work_j - energy.stored_j;
    // One time between measurements: the whole run.
    let entered = energy.released_j - energy.created_j;
    assert!((left - entered).abs() <= 1e-14 * energy.tools_work_j, "{left} {energy:?}");
    left.abs() / energy.stored_j
}

/// Halves of a step leave a quarter of the error.
fn is_of_second_order(set: &[&str]) {
    let [coarse, fine] = [8, 16].map(|steps| imbalance(steps, set));
    let slope = (coarse / fine).log2();
    println!("{set:?}: {coarse:.2e}, {fine:.2e}, slope {slope:.2}");
    assert!(fine < 0.01 && slope > 1.7 && slope < 2.6, "{coarse} {fine}, slope {slope}");
}

#[test]
fn the_work_of_a_turn_is_stored_with_an_error_of_second_order() {
    is_of_second_order(&[]);
    is_of_second_order(&["tools.0.hold=pad"]);
    is_of_second_order(&["tools.0.hold=vertices", "stages.element=p1p1"]);
}

#[test]
fn the_work_of_a_push_of_loads_and_of_weight_is_too() {
    let side = "{shape='box', min=[0.3, -0.1, 0.5], max=[0.9, 1.1, 1.1]}";
    let end = "{shape='box', min=[0.9, 0, 0], max=[1, 1, 1]}";
    let pressure = format!(
        "{{kind='pressure', region={side}, normal='dead', pressure=[{{time_s=0, pressure_pa=0}}, \
         {{time_s=2, pressure_pa=30}}]}}"
    );
    let load = format!(
        "{{kind='load', region={end}, load=[{{time_s=0}}, {{time_s=2, force_n=[0, 0.02, -0.03]}}]}}"
    );
    let loads = format!("tools=[{pressure}, {load}]");
    is_of_second_order(&[&loads]);
    let grab = format!(
        "tools=[{{kind='grab', region={end}, path=[{{time_s=0}}, {{time_s=2, move_m=[0, 0.03, 0.05], \
         turn_deg=60}}]}}]"
    );
    is_of_second_order(&[&grab]);
}

#[test]
fn a_pressure_that_follows_does_its_work_along_the_way() {
    let side = "{shape='box', min=[0.3, -0.1, 0.5], max=[0.9, 1.1, 1.1]}";
    let pressure = format!(
        "tools=[{{kind='pressure', region={side}, pressure=[{{time_s=0, pressure_pa=0}}, {{time_s=2, \
         pressure_pa=60}}]}}]"
    );
    is_of_second_order(&[&pressure]);
}

#[test]
fn weight_that_has_come_at_once_gives_off_half_of_its_work() {
    // It grows over the first step, in which the body sags as a spring does.
    let set = ["tools=[]", "mesh.max_level=0", "time.steps=2", "gravity_m_s2=[0, 0, -0.05]"];
    let energy = run(&mut simulation("beam", &set));
    assert_eq!(energy.tools_work_j, 0.0);
    // By the trapezoidal rule ½ W·u, and so is what a linear body stores. It sags by a hundredth of its height.
    let off = (energy.weight_work_j - energy.stored_j).abs() / energy.stored_j;
    assert!(energy.stored_j > 1e-9 && off < 1e-3, "{off} {energy:?}");
}

/// A pull of the same size on every piece of volume alike: on nested meshes the same load. N/m³.
struct Pull(Vector3<f64>);

impl Pull {
    fn forces(&self, body: &BodyState) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); body.positions().len()];
        for element in body.elements() {
            element
                .vertices
                .iter()
                .for_each(|&v| forces[v] += 0.25 * element.geometry.volume * self.0);
        }
        forces
    }

    /// Σ f·x, J.
    fn potential(&self, body: &BodyState) -> f64 {
        self.forces(body).iter().zip(body.positions()).map(|(f, x)| f.dot(x)).sum()
    }
}

impl Tool for Pull {
    fn kind(&self) -> &'static str {
        "pull"
    }

    /// That it moves is nothing to a load.
    fn reference(&self, t: f64) -> Vector3<f64> {
        Vector3::new(t, 0.0, 0.0)
    }

    fn add_loads(&self, body: &BodyState, _: f64, loads: &mut [Vector3<f64>]) {
        loads.iter_mut().zip(self.forces(body)).for_each(|(load, force)| *load += force);
    }
}

/// What a [`Whim`] asks for.
#[derive(Clone, Copy, Debug)]
enum Mood {
    Rest,
    Random,
    Split,
    Merge,
}

/// Asks for splits and merges as it is told.
#[derive(Clone, Default)]
struct Whim(Arc<(AtomicUsize, AtomicU64)>);

impl Whim {
    fn is_to(&self, mood: Mood) {
        self.0.0.store(mood as usize, Ordering::Relaxed);
    }
}

impl Indicator for Whim {
    fn name(&self) -> &'static str {
        "whim"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn measure(&self, _: &[RingMember]) -> f64 {
        let drawn = self.0.1.fetch_add(0x9e37_79b9_7f4a_7c15, Ordering::Relaxed);
        let mixed = (drawn ^ (drawn >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let (rest, random, split, merge) =
            (0.5, [10.0, 0.0, 0.5][(mixed >> 40) as usize % 3], 10.0, 0.0);
        [rest, random, split, merge][self.0.0.load(Ordering::Relaxed)]
    }
}

/// The pulled liver after four steps.
struct Liver {
    stored: f64,
    pulled: f64,
    energy: EnergySummary,
    splits: usize,
    merges: usize,
}

/// Coarse, by elements of displacements alone, with a pull on everything; split and merged at random in the second and third step, and also in the last if `to_the_end`.
fn liver(homogenisation: &str, to_the_end: bool) -> Liver {
    let set = [
        "image.voxel_mm=4.0",
        "mesh={ base_mm = 32.0, start_level = 0, max_level = 4, max_vertices = 2000 }",
        "stages={ element = 'p1', homogenisation = 'HOW' }",
        "refinement={ split_above = 1.0, merge_fraction = 0.1, dwell_steps = 0, max_splits_per_step = 200 }",
        "tools.0.region.radius_m=0.03",
        "time.steps=4",
        "solver.residual=1e-8",
    ];
    let set = set.map(|key| key.replace("HOW", homogenisation));
    let (scene, _) = scene_file::load("liver", &set).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    let whim = Whim::default();
    stages.indicator = Box::new(whim.clone());
    let pull = || Pull(Vector3::new(30.0, -80.0, 50.0));
    let builder = Simulation::builder(&scene).stages(stages).tool(|_| Ok(pull()));
    let mut simulation = builder.build().unwrap();
    let (mut splits, mut merges) = (0, 0);
    let last = if to_the_end { Mood::Random } else { Mood::Rest };
    for mood in [Mood::Rest, Mood::Random, Mood::Random, last] {
        whim.is_to(mood);
        let began = pull().potential(simulation.body());
        let report = simulation.step().unwrap();
        assert!(report.converged);
        if report.step == 1 {
            // The same force all the way.
            let work = pull().potential(simulation.body()) - began;
            let off = (report.tools[1].work_j - work).abs();
            assert!(off <= 1e3 * f64::EPSILON * began.abs(), "{work} {off}");
        }
        (splits, merges) = (report.splits, report.merges);
    }
    let summary = simulation.summary().unwrap().energy.unwrap();
    let pulled = pull().potential(simulation.body());
    Liver { stored: energy(&simulation), pulled, energy: summary, splits, merges }
}

/// What the splits and merges of the last step did by the ledger, checked against energies before and after.
fn last_round(homogenisation: &str) -> [EnergyChange; 2] {
    let [before, after] = [false, true].map(|to_the_end| liver(homogenisation, to_the_end));
    let Liver { energy, splits, merges, .. } = after;
    println!("{homogenisation}: {splits} splits, {merges} merges, {energy:?}");
    assert!(splits > 10 && merges > 10 && before.splits + before.merges == 0);
    // Sums over some thousand tetrahedra of rounded terms.
    let rounding = 1e3 * f64::EPSILON * (before.stored + before.pulled.abs());
    let worked = energy.tools_work_j - before.energy.tools_work_j;
    let moved = after.pulled - before.pulled;
    assert!((worked - moved).abs() <= rounding, "{worked} {moved}");
    let since = |now: EnergyChange, then: EnergyChange| EnergyChange {
        added_j: now.added_j - then.added_j,
        removed_j: now.removed_j - then.removed_j,
    };
    let splits = since(energy.splits, before.energy.splits);
    let merges = since(energy.merges, before.energy.merges);
    let want = after.stored - before.stored - moved;
    let net = splits.net_j() + merges.net_j();
    assert!((net - want).abs() <= rounding, "{net} {want}");
    assert!(want.abs() > 1e3 * rounding && moved.abs() > 1e3 * rounding, "{want} {moved}");
    [splits, merges]
}

#[test]
fn nested_spaces_split_without_a_change_of_energy() {
    let [splits, merges] = last_round("linear");
    println!("{splits:?} {merges:?}");
    assert!(splits.added_j + splits.removed_j <= 1e-15, "{splits:?}");
    // What goes stood off the middle of its edge because that is where it stores less.
    assert!(merges.removed_j <= 1e-15 && merges.added_j > 1e-9, "{merges:?}");
}

#[test]
fn other_homogenisations_may_add_energy_or_take_it_away() {
    let [splits, merges] = last_round("laminate");
    println!("{splits:?} {merges:?}");
    assert!(splits.added_j > 1e-9 && splits.removed_j > 1e-9, "{splits:?}");
}

/// Leads the tool of a scene to `pose` in ten steps, and leaves it there while the mesh is refined in five and
/// coarsened in as many as it takes. The ledger when it had come there and at the end.
fn refined_and_back(scene: &str, set: &[&str], pose: impl Fn(f64) -> Pose) -> [EnergySummary; 2] {
    let mut all = vec![
        "stages={ element = 'p1', homogenisation = 'linear' }",
        "refinement={ split_above = 1.0, merge_fraction = 0.1, dwell_steps = 0, max_splits_per_step = 100 }",
        "solver.residual=1e-7",
        "time.steps=40",
    ];
    all.extend(set);
    let (scene, _) = scene_file::load(scene, &strings(&all)).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    let whim = Whim::default();
    stages.indicator = Box::new(whim.clone());
    let mut simulation = Simulation::builder(&scene).stages(stages).build().unwrap();
    let mut come = EnergySummary::default();
    let (mut splits, mut merges) = (0, 0);
    for step in 1..=40 {
        whim.is_to(match step {
            ..=10 => Mood::Rest,
            11..=15 => Mood::Split,
            _ => Mood::Merge,
        });
        simulation.set_tool_pose(0, pose((0.1 * f64::from(step)).min(1.0))).unwrap();
        let report = simulation.step().unwrap();
        assert!(report.converged, "step {step}");
        // Far above the rounding of what stands still.
        assert!(step <= 10 || report.tools[0].work_j.abs() < 1e-14, "{}", report.tools[0].work_j);
        (splits, merges) = (splits + report.splits, merges + report.merges);
        if step == 10 {
            come = simulation.summary().unwrap().energy.unwrap();
        }
        if step > 16 && report.merges == 0 {
            break;
        }
    }
    assert!(splits > 100 && merges == splits, "{splits} {merges}");
    [come, simulation.summary().unwrap().energy.unwrap()]
}

/// On the mesh of the start it stores again what it stored there, and on the way nothing comes from nowhere
/// though merges and holds have added much.
fn is_balanced([come, end]: [EnergySummary; 2]) {
    println!("{come:?}\n{end:?}");
    let stored = come.stored_j;
    // Of second order in the residual τ, but for contacts: they may be τ R deep, and F τ R of 4e-9 m is with
    // F ≈ 2 stored/5 mm some 2e-6 of what is stored.
    assert!((end.stored_j - stored).abs() < 2e-6 * stored, "{stored} {}", end.stored_j);
    assert!(end.merges.added_j > 0.1 * stored && end.holds.added_j > 1e-3 * stored, "{end:?}");
    let created = end.created_j - come.created_j;
    assert!(created < 1e-5 * stored, "{created} of {stored}");
    let changes = [end.splits, end.merges, end.holds].map(|change| change.net_j());
    let given = end.tools_work_j + end.weight_work_j + changes.iter().sum::<f64>();
    let went = end.stored_j + end.released_j - end.created_j;
    assert!((given - went).abs() < 1e-12 * given, "{given} {went}");
}

#[test]
fn what_presses_brings_back_what_merges_have_moved_into_it() {
    let set = [
        "mesh={ base_mm = 40.0, start_level = 0, max_level = 3, max_vertices = 2000 }",
        "tools.0.centre=[0.625, 0.5, 1.0]",
    ];
    let down = |part: f64| Pose { move_m: [0.0, 0.0, 0.04 - 0.005 * part], turn_deg: 0.0 };
    is_balanced(refined_and_back("indent", &set, down));
}

#[test]
fn what_holds_a_mean_brings_it_back_too() {
    let set = [
        "mesh={ base_mm = 20.0, start_level = 0, max_level = 3, max_vertices = 2000 }",
        "tools.0.region={ shape = 'box', min = [0.8, 0.2, 0.1], max = [1.0, 0.9, 0.7] }",
    ];
    let away = |part: f64| Pose { move_m: [0.03 * part, 0.01 * part, 0.0], turn_deg: 50.0 * part };
    is_balanced(refined_and_back("twist", &set, away));
}
