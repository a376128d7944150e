//! What a tool must do, whatever it does to the body.

use yawara::report::{Frame, StepReport};
use yawara::scene::Scene;
use yawara::{SimError, Simulation, Stages, scene_file};

/// Makes the simulation of a scene, which has no tools, with a tool in it that acts up to 1 s and is
/// gone from 1.5 s on.
type Make<'a> = &'a dyn Fn(Scene) -> Result<Simulation, SimError>;

/// What makes the simulation of a scene with a tool in it, by the tool's entry in a scene file.
pub fn by_entry(entry: &str) -> impl Fn(Scene) -> Result<Simulation, SimError> {
    let (with, _) = scene_file::load("beam", &[format!("tools=[{entry}]")]).unwrap();
    move |scene| {
        let scene = Scene { tools: with.tools.clone(), ..scene };
        Simulation::new(&scene, Stages::by_name(&scene.stages)?)
    }
}

/// All steps of the built-in beam without weight, and where it then is. After each the tool and the
/// support pull with opposite forces, to the residual of 1e-8 on some hundred vertices.
fn run(make: Make<'_>, steps: usize, step_s: f64, max_level: u8) -> (Vec<StepReport>, Frame) {
    let set = [
        "tools=[]".into(),
        "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
        "solver.residual=1e-8".into(),
        format!("time={{ steps = {steps}, step_s = {step_s} }}"),
        format!("mesh.max_level={max_level}"),
        "refinement.split_above=1e-9".into(),
    ];
    let (scene, _) = scene_file::load("beam", &set).unwrap();
    let mut simulation = make(scene).unwrap();
    let mut reports: Vec<StepReport> = Vec::new();
    for _ in 0..steps {
        let (report, peak) =
            (simulation.step().unwrap(), largest(reports.iter().flat_map(|r| r.force_n)));
        assert!(report.converged, "{report:?}");
        let (tool, support) = (report.force_n, simulation.support_force());
        let off = largest([0, 1, 2].map(|axis| tool[axis] + support[axis]));
        assert!(off <= 1e-6 * largest(tool).max(peak), "{tool:?} N, support {support:?} N");
        reports.push(report);
    }
    (reports, simulation.frame().unwrap())
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |most, value| if value.abs() <= most { most } else { value.abs() })
}

/// A force where it acts, which is the force of all tools together.
pub fn it_is_felt_and_reported(make: Make<'_>) {
    let (reports, frame) = run(make, 2, 0.5, 0);
    for report in &reports {
        assert_eq!(report.tools.len(), 1);
        assert_eq!(report.tools[0].force_n, report.force_n);
        assert!(largest(report.force_n) > 1e-4, "{report:?}");
    }
    assert!(largest(frame.displacement_mm.into_iter().flatten()) > 0.1);
}

/// No force and a body at rest.
pub fn once_gone_it_leaves_nothing_behind(make: Make<'_>) {
    let (reports, frame) = run(make, 4, 0.5, 0);
    assert!(largest(reports[3].force_n) <= 1e-6 * largest(reports[1].force_n), "{reports:?}");
    assert!(largest(frame.displacement_mm.into_iter().flatten()) < 1e-4);
}

/// One step to 1 s or eight: the same force and displacements. Each is an equilibrium to 1e-8 of its
/// forces, times the condition number of a beam.
pub fn where_it_leads_does_not_depend_on_the_steps(make: Make<'_>) {
    let [(once, one), (often, other)] = [(1, 1.0), (8, 0.125)].map(|(n, s)| run(make, n, s, 0));
    let (once, often) = (once[0].force_n, often[7].force_n);
    let off = largest([0, 1, 2].map(|axis| once[axis] - often[axis]));
    assert!(off <= 1e-4 * largest(once), "{once:?}, {often:?} N");
    let pairs = one.displacement_mm.iter().flatten().zip(other.displacement_mm.iter().flatten());
    let off = largest(pairs.map(|(a, b)| a - b));
    assert!(off <= 1e-4 * largest(one.displacement_mm.into_iter().flatten()), "{off} mm");
}

/// Vertices come in while it acts: every step still finds its equilibrium, and the force is of the
/// same size.
pub fn the_mesh_may_refine_under_it(make: Make<'_>) {
    let [(coarse, _), (fine, _)] = [0, 3].map(|max_level| run(make, 4, 0.25, max_level));
    assert!(fine.iter().map(|report| report.splits).sum::<usize>() > 0);
    let [coarse, fine] = [&coarse, &fine].map(|reports| largest(reports[3].force_n));
    assert!(0.2 * coarse < fine && fine < 5.0 * coarse, "{coarse} N, refined {fine} N");
}

/// Whatever the tool looks at, it is not the clock.
pub fn the_same_run_gives_the_same_bytes(make: Make<'_>) {
    let [(_, one), (_, other)] = [(); 2].map(|()| run(make, 4, 0.25, 3));
    assert_eq!(one.points_mm, other.points_mm);
}
