//! The error estimate against the error itself, and refinement to a target.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Vector3;
use yawara::indicator::{Indicator, Measured, Residual, RingMember, Sight};
use yawara::report::StepReport;
use yawara::{Simulation, Stages, scene_file};

/// The step in which the beam is pulled farthest.
const FARTHEST: usize = 10;

fn farthest(set: &[String]) -> StepReport {
    let (scene, _) = scene_file::load("beam", set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut last = StepReport::default();
    for _ in 0..FARTHEST {
        last = simulation.step().unwrap();
        assert!(last.converged, "{last:?}");
    }
    last
}

/// The farthest step on a uniform mesh. On one that stays it is measured where a frame is written.
fn uniform(level: u8, set: &[String]) -> StepReport {
    let keys = [
        format!("mesh.start_level={level}"),
        format!("mesh.max_level={level}"),
        "mesh.max_vertices=9000".into(),
        format!("output.frames_every={FARTHEST}"),
    ];
    farthest(&[&keys[..], set].concat())
}

fn force(report: &StepReport) -> f64 {
    Vector3::from(report.force_n).norm()
}

/// What levels 0 to 6 go to, which levels of half the edge give by Richardson's rule.
fn limit(values: &[f64]) -> f64 {
    let [first, second] = [values[0] - values[3], values[3] - values[6]];
    values[6] - second * second / (first - second)
}

/// Nothing but a tool: the force is off by as much as the energy is.
const UNLOADED: &str = "gravity_m_s2=[0,0,0]";

/// So little that the body answers as a linear one.
const A_LITTLE: &str = "tools=[{kind='grab', region={shape='box', min=[1,0,0], max=[1,1,1]}, \
                        path=[{time_s=0},{time_s=1, move_m=[0,0,1e-4]}]}]";

#[test]
fn the_estimate_is_the_error_within_a_factor_on_every_uniform_mesh() {
    let mut limits = Vec::new();
    for element in ["p1", "p1p1"] {
        let set = [UNLOADED.into(), A_LITTLE.into(), format!("stages.element={element}")];
        let runs: Vec<StepReport> = (0..=6).map(|level| uniform(level, &set)).collect();
        let forces: Vec<f64> = runs.iter().map(force).collect();
        assert!(forces.is_sorted_by(|a, b| a > b), "{element}: {forces:?}");
        let limit = limit(&forces);
        limits.push(limit);
        for (level, (report, force)) in runs.iter().zip(&forces).enumerate() {
            let error = 1.0 - limit / force;
            let ratio = report.error_estimate.unwrap() / error;
            println!("{element}, level {level}: {error:.4}, estimate over it {ratio:.2}");
            assert!(0.75 < ratio && ratio < 1.35, "{element}, level {level}: {ratio}");
            // Of a tool that acts alone.
            let of_tool = report.tools[0].force_error_n.unwrap();
            assert!((of_tool / force / report.error_estimate.unwrap() - 1.0).abs() < 1e-9);
        }
    }
    assert!((limits[0] / limits[1] - 1.0).abs() < 0.005, "{limits:?}");
}

/// Two tools at a time.
const TWO: &str = "tools=[{kind='grab', region={shape='box', min=[0.9,0,0], max=[1,1,1]}, \
                   path=[{time_s=0}, {time_s=1, move_m=[0,0,0.01]}]}, \
                   {kind='probe', centre=[0.45,0.5,1.35], radius_m=0.012, \
                   path=[{time_s=0}, {time_s=1, move_m=[0,0,-0.012]}]}]";

#[test]
fn errors_of_forces_displacements_and_volumes_are_estimated_by_their_duals() {
    let middle = "region={shape='box', min=[0.4,0,0], max=[0.6,1,1]}";
    let force = |tool: usize| format!("{{kind='force', tool={tool}}}");
    let displacement = format!("{{kind='displacement', {middle}, direction=[0,0,1]}}");
    let cases = [
        ("force beside weight", force(0), vec![]),
        // Of a tool that acts alone its dual says what the energy does.
        ("force alone", force(0), vec![UNLOADED, A_LITTLE]),
        ("displacement", displacement, vec![]),
        ("volume", format!("{{kind='volume', {middle}}}"), vec![]),
        ("force beside a probe", force(0), vec![UNLOADED, TWO]),
        ("force of a probe", force(1), vec![UNLOADED, TWO]),
    ];
    for (name, goal, set) in cases {
        let mut set: Vec<String> = set.into_iter().map(String::from).collect();
        set.push(format!("refinement.goal={goal}"));
        let runs: Vec<StepReport> = (0..=6).map(|level| uniform(level, &set)).collect();
        let goals: Vec<_> = runs.iter().map(|report| report.goal.unwrap()).collect();
        let values: Vec<f64> = goals.iter().map(|goal| goal.value).collect();
        let limit = limit(&values);
        for (level, goal) in goals.iter().enumerate() {
            let ratio = goal.error.unwrap() / (goal.value - limit).abs();
            println!("{name}, level {level}: {:.5e}, estimate over error {ratio:.2}", goal.value);
            assert!(0.4 < ratio && ratio < 3.0, "{name}, level {level}: {ratio}");
        }
        if name == "force alone" {
            let [dual, energy] =
                [goals[2].error.unwrap(), runs[2].error_estimate.unwrap() * values[2]];
            assert!((dual / energy - 1.0).abs() < 0.01, "{dual} N, {energy} N");
        }
    }
}

/// Lifted by a small ball of material near its end; how far the middle moves does not depend on what
/// happens around the ball.
#[test]
fn a_mesh_refined_to_a_goal_has_less_error_of_it_with_no_more_vertices() {
    let lifted = |indicator: &str, target: f64| {
        let load = "tools=[{kind='load', region={shape='sphere', centre=[0.9,0.5,0.9], \
                    radius_m=0.006}, load=[{time_s=0},{time_s=1, force_n=[0,0,1]}]}]";
        let goal = "refinement.goal={kind='displacement', direction=[0,0,1], \
                    region={shape='box', min=[0.4,0,0], max=[0.5,1,1]}}";
        let stage = format!("stages.indicator={indicator}");
        let target = format!("refinement.target={target}");
        let report = farthest(&[
            load.into(),
            goal.into(),
            UNLOADED.into(),
            stage,
            target,
            "mesh.max_level=12".into(),
        ]);
        (report.vertices, report.goal.unwrap().value)
    };
    // Displacements under a load rise with the mesh.
    let (energy, goal) = (lifted("residual", 0.107), lifted("goal", 0.08));
    assert!(goal.0 <= energy.0 && goal.1 > 1.01 * energy.1, "{energy:?} {goal:?}");
}

#[test]
fn a_mesh_is_refined_until_the_estimate_is_the_target() {
    let mut before = 0;
    for target in [0.33, 0.23, 0.13] {
        let report = farthest(&[format!("refinement.target={target}")]);
        let estimate = report.error_estimate.unwrap();
        // The last step's own growth is answered in the next.
        assert!(estimate < 1.1 * target, "{estimate} where {target} was asked for");
        assert!(report.vertices > before, "{target}: {} vertices", report.vertices);
        before = report.vertices;
    }
}

/// A tool that stands still while vertices come in, some of them in what it holds: its force changes by no
/// more than what was announced as its error, and never grows, as nested meshes can only be softer.
#[test]
fn vertices_that_come_in_at_a_held_tool_change_its_force_by_what_was_announced() {
    for hold in ["mean", "pad"] {
        let tool = format!(
            "tools=[{{kind='grab', hold='{hold}', region={{shape='sphere', centre=[0.9,0.5,0.5], \
             radius_m=0.018}}, path=[{{time_s=0}},{{time_s=0.1, move_m=[0,0,4e-3]}}]}}]"
        );
        let keys = ["refinement.target=0.005", "refinement.max_splits_per_step=60", UNLOADED];
        let keys: Vec<String> = keys.into_iter().map(String::from).chain([tool]).collect();
        let (scene, _) = scene_file::load("beam", &keys).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        let mut before = simulation.step().unwrap();
        let mut splits = before.splits;
        while simulation.steps_left() > 0 {
            let now = simulation.step().unwrap();
            assert!(now.converged, "{now:?}");
            let fall = force(&before) - force(&now);
            let announced = before.tools[0].force_error_n.unwrap();
            // No more than what the solver leaves.
            let least = -2.0 * scene.solver.residual * force(&now);
            assert!(least < fall && fall < announced, "{hold}: {fall} N, {announced} N announced");
            splits += now.splits;
            before = now;
        }
        assert!(splits > 500, "{hold}: {splits}");
    }
}

/// On a mesh that stays the estimate costs something in steps with a frame alone, and is none of the others.
#[test]
fn a_fixed_mesh_is_measured_where_a_frame_is_written() {
    for (every, want) in [(3, vec![3, 6, 7]), (0, vec![7])] {
        let set = ["mesh.max_level=0".into(), "time.steps=7".into()];
        let set = [&set[..], &[format!("output.frames_every={every}")]].concat();
        let (scene, _) = scene_file::load("beam", &set).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        let mut measured = Vec::new();
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            measured.extend(report.error_estimate.map(|_| report.step));
        }
        assert_eq!(measured, want, "frames every {every}");
    }
}

/// `residual`, counting how often it is asked.
struct Counted(Residual, Arc<AtomicUsize>);

impl Indicator for Counted {
    fn name(&self) -> &'static str {
        "counted"
    }

    fn unit(&self) -> &'static str {
        self.0.unit()
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        self.0.measure(ring)
    }

    fn measure_vertex(&self, ring: &[RingMember], surplus: &Vector3<f64>) -> f64 {
        self.0.measure_vertex(ring, surplus)
    }

    fn elements(&self, sight: &Sight<'_>) -> Option<Measured> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.elements(sight)
    }

    fn error_over_sum(&self) -> Option<f64> {
        self.0.error_over_sum()
    }

    fn remembers(&self) -> bool {
        self.0.remembers()
    }

    fn estimates(&self) -> bool {
        self.0.estimates()
    }
}

/// A pull until .5 s, a hand that stands still until 1 s, then goes on until 1.2 s.
#[test]
fn what_stands_still_is_measured_once_and_again_when_it_moves() {
    let set = [
        UNLOADED.into(),
        "time={steps=24, step_s=0.05}".into(),
        "refinement={target=0.25, dwell_steps=3}".into(),
        "tools.0.release_s=9.0".into(),
        "tools.0.path=[{time_s=0}, {time_s=0.5, move_m=[0, 0, -0.02]}, {time_s=1, move_m=[0, 0, -0.02]}, \
         {time_s=1.2, move_m=[0, 0, -0.024]}]"
            .into(),
    ];
    let (scene, _) = scene_file::load("beam", &set).unwrap();
    let asked = Arc::new(AtomicUsize::new(0));
    let indicator = Box::new(Counted(Residual::default(), asked.clone()));
    let stages = Stages { indicator, ..Stages::by_name(&scene.stages).unwrap() };
    let mut simulation = Simulation::new(&scene, stages).unwrap();
    let mut step = || {
        let before = asked.load(Ordering::Relaxed);
        let report = simulation.step().unwrap();
        assert!(report.converged && report.error_estimate.is_some(), "{report:?}");
        (asked.load(Ordering::Relaxed) - before, report)
    };
    let steps: Vec<(usize, StepReport)> = (0..24).map(|_| step()).collect();
    assert!(steps[..10].iter().chain(&steps[20..]).all(|(asked, _)| *asked == 1));
    // Until no vertex comes or goes any more, and each has been there for as long as it has to be.
    let stands = |i: &usize| {
        let is_still = |one: &StepReport| one.iterations + one.splits + one.merges == 0;
        steps[i - 4..=*i].iter().all(|(_, one)| is_still(one))
    };
    let still: Vec<usize> = (14..20).filter(stands).collect();
    assert!(!still.is_empty());
    for i in still {
        let ((asked, report), (_, before)) = (&steps[i], &steps[i - 1]);
        assert_eq!(*asked, 0, "step {}", i + 1);
        assert_eq!(report.error_estimate, before.error_estimate);
        assert_eq!(report.tools[0].force_error_n, before.tools[0].force_error_n);
    }
    assert!(steps[23].1.error_estimate != steps[19].1.error_estimate);
}

#[test]
fn a_goal_that_nothing_feels_is_refused() {
    let outside = "{kind='volume', region={shape='sphere', centre=[9,9,9], radius_m=0.01}}";
    let no_axis = "{kind='displacement', region={shape='box', min=[0,0,0], max=[1,1,1]}, \
                   direction=[0,0,0]}";
    let vertices = "tools.0.hold='vertices'";
    for (goal, beside, words) in [
        ("{kind='force', tool=1}", UNLOADED, "refinement.goal.tool"),
        ("{kind='force', tool=0}", vertices, "holds material"),
        (outside, UNLOADED, "refinement.goal.region"),
        (no_axis, UNLOADED, "refinement.goal.direction"),
        ("{kind='force', tool=0}", "dynamics={}", "refinement.goal"),
    ] {
        let keys = [format!("refinement.goal={goal}"), beside.to_owned()];
        let built = scene_file::load("beam", &keys)
            .and_then(|(scene, _)| Simulation::new(&scene, Stages::by_name(&scene.stages)?));
        let error = built.err().unwrap().to_string();
        assert!(error.contains(words), "{goal}: {error}");
    }
}

#[test]
fn an_indicator_that_is_no_energy_asks_for_a_threshold() {
    let (scene, _) = scene_file::load("beam", &["stages.indicator=volume".into()]).unwrap();
    let built = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap());
    let error = built.err().unwrap().to_string();
    for words in ["beam", "refinement.split_above", "volume"] {
        assert!(error.contains(words), "{error}");
    }
}
