//! A dead load does not know the mesh: the same force, torque and work on every one, so that under it a
//! finer mesh of a nested family gives way more.

use nalgebra::{Matrix3, Vector3};
use yawara::report::StepReport;
use yawara::{Simulation, Stages, scene_file};
use yawara_corot::locate;

/// Edge of the beam's voxels, m; it has 32 × 8 × 8 of them.
const VOXEL: f64 = 5e-3;

/// Part of the beam that lies in no line with its cells, fractions of its box.
const PART: ([f64; 3], [f64; 3]) = ([0.45, 0.1, 0.2], [0.97, 0.75, 1.0]);

const FORCE: [f64; 3] = [0.03, -0.02, 0.05];
const TORQUE: [f64; 3] = [1e-3, -2e-3, 5e-4];

/// The built-in beam without weight under `load`.
fn beam(load: &str, set: &[&str]) -> Simulation {
    let mut all = vec![
        format!("tools=[{{ kind = 'load', {load} }}]"),
        "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
        "stages.element=p1".into(),
        // What is fixed stays where it is.
        "support.hold=vertices".into(),
        "mesh.max_vertices=20000".into(),
        "solver.residual=1e-8".into(),
    ];
    all.extend(set.iter().map(|set| String::from(*set)));
    let (scene, _) = scene_file::load("beam", &all).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

fn on_the_part(load: &str) -> String {
    let (min, max) = PART;
    format!("region = {{ shape = 'box', min = {min:?}, max = {max:?} }}, load = [{load}]")
}

fn step(simulation: &mut Simulation) -> StepReport {
    let report = simulation.step().unwrap();
    assert!(report.converged, "{report:?}");
    report
}

/// The reference: two points along each axis of the voxels, those in the part, and the force on each, N.
fn by_hand(force: [f64; 3], torque: [f64; 3]) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let size = Vector3::new(0.16, 0.04, 0.04);
    let mut middles = Vec::new();
    for i in 0..64 * 16 * 16 {
        // Gauss points of a voxel's halves lie off its middle by 1/(2√3) of its edge.
        let at = [i % 64, i / 64 % 16, i / 1024].map(|i| {
            let side = f64::from(2 * (i % 2) - 1) / 12.0f64.sqrt();
            (f64::from(i / 2) + 0.5 + side) * VOXEL
        });
        let x = Vector3::from(at);
        let is_inside = |k| PART.0[k] * size[k] < x[k] && x[k] < PART.1[k] * size[k];
        middles.extend((0..3).all(is_inside).then_some(x));
    }
    let share = 1.0 / middles.len() as f64;
    let centre = middles.iter().sum::<Vector3<f64>>() * share;
    let arms = middles.iter().map(|x| x - centre);
    let inertia: Matrix3<f64> =
        arms.map(|r| Matrix3::identity() * r.norm_squared() - r * r.transpose()).sum();
    let turn = inertia.lu().solve(&Vector3::from(torque)).unwrap();
    let load = |x: Vector3<f64>| (x, share * Vector3::from(force) + turn.cross(&(x - centre)));
    middles.into_iter().map(load).collect()
}

/// How far points of the material at rest have moved, m.
fn moves(simulation: &Simulation, points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let body = simulation.body();
    let found = locate(points, body.elements().iter(), body.rest_positions(), 1e-9, |_, _| true);
    let moved = found
        .iter()
        .zip(points)
        .map(|(found, x)| found.expect("inside the body").1.position(body.positions()) - x);
    moved.collect()
}

fn off(got: [f64; 3], want: [f64; 3]) -> f64 {
    (Vector3::from(got) - Vector3::from(want)).norm() / Vector3::from(want).norm()
}

/// All but the end of the beam is fixed, so that nothing moves under a load elsewhere: what is felt is
/// what was asked for.
#[test]
fn force_and_torque_are_what_was_asked_for_on_every_mesh() {
    let still = "fixed=[{ shape = 'box', min = [0, 0, 0], max = [0.9, 1, 1] }]";
    let regions = [
        "{ shape = 'box', min = [0.13, 0.1, 0.2], max = [0.7, 0.75, 1] }",
        "{ shape = 'sphere', centre = [0.4, 0.3, 0.6], radius_m = 0.017 }",
        // Faces of voxels in a plane through the body, and on its outside.
        "{ shape = 'box', min = [0.5, 0, 0], max = [0.5, 1, 1] }",
        "{ shape = 'box', min = [0.1, 0, 0], max = [0.6, 1, 0] }",
    ];
    for region in regions {
        let key = format!("time_s = 0, force_n = {FORCE:?}, torque_n_m = {TORQUE:?}");
        let load = format!("region = {region}, load = [{{ {key} }}]");
        let mut centres = Vec::new();
        for level in 0..=3 {
            let level = format!("mesh.start_level={level}");
            let report = step(&mut beam(&load, &[still, &level, "mesh.max_level=3"]));
            let tool = report.tools[0];
            assert!(off(tool.force_n, FORCE) < 1e-12, "{region} {level}: {:?}", tool.force_n);
            assert!(off(tool.torque_n_m, TORQUE) < 1e-12, "{region} {level}: {tool:?}");
            centres.push(tool.reference_mm);
        }
        let is_same = |at: &[f64; 3]| (0..3).all(|i| (at[i] - centres[0][i]).abs() < 1e-9);
        assert!(centres.iter().all(is_same), "{centres:?}");
    }
}

/// Of a traction on a side of 96 mm by 40 mm, whose outline loses no more than a voxel at each end.
#[test]
fn a_traction_is_a_force_by_area_on_every_mesh() {
    let still = "fixed=[{ shape = 'box', min = [0, 0, 0], max = [0.9, 1, 1] }]";
    let load = "region = { shape = 'box', min = [0.1, 0, 0.9], max = [0.7, 1, 1] }, \
                load = [{ time_s = 0, traction_pa = [30, -20, 10] }]";
    let mut forces = Vec::new();
    for level in 0..=3 {
        let level = format!("mesh.start_level={level}");
        let tool = step(&mut beam(load, &[still, &level, "mesh.max_level=3"])).tools[0];
        // About the centre of its area it turns nothing.
        let force = Vector3::from(tool.force_n);
        let along = Vector3::new(30.0, -20.0, 10.0).normalize();
        assert!((force - along * force.norm()).norm() < 1e-12 * force.norm(), "{tool:?}");
        assert!(Vector3::from(tool.torque_n_m).norm() < 1e-12 * force.norm(), "{tool:?}");
        forces.push(tool.force_n);
    }
    assert!(forces.iter().all(|&force| off(force, forces[0]) < 1e-12), "{forces:?}");
    let area = forces[0][0] / 30.0;
    assert!(area > 0.9 * 0.096 * 0.04 && area < 1.2 * 0.096 * 0.04, "{area} m²");
}

/// Under a load that comes and goes vertices come in and go out again. The force stays what was asked
/// for, and the torque of rest moves with the material as the forces on voxels by hand do.
#[test]
fn splits_and_merges_change_neither_force_nor_torque() {
    let load = on_the_part(&format!(
        "{{ time_s = 0 }}, {{ time_s = 1, force_n = {FORCE:?}, torque_n_m = {TORQUE:?} }}, \
         {{ time_s = 1.5, force_n = {FORCE:?} }}, {{ time_s = 2 }}"
    ));
    let set =
        ["mesh.max_level=4", "refinement.split_above=1e-8", "time={ steps = 16, step_s = 0.2 }"];
    let mut simulation = beam(&load, &set);
    let (mut splits, mut merges, mut compared) = (0, 0, 0);
    for _ in 0..16 {
        let report = step(&mut simulation);
        (splits, merges) = (splits + report.splits, merges + report.merges);
        let (t, tool) = (report.time_s, report.tools[0]);
        let force = FORCE.map(|f| f * if t < 1.5 { t.min(1.0) } else { (4.0 - 2.0 * t).max(0.0) });
        let torque = TORQUE.map(|f| f * if t < 1.0 { t } else { (3.0 - 2.0 * t).max(0.0) });
        let scale = Vector3::from(FORCE).norm();
        let miss = (Vector3::from(tool.force_n) - Vector3::from(force)).norm();
        assert!(miss < 1e-12 * scale, "{t} s: {:?} N", tool.force_n);
        // The report is of the mesh before it changed. A vertex comes in on its edge; where one goes
        // out the body is no longer as it was.
        if report.merges > 0 {
            continue;
        }
        compared += 1;
        let loads = by_hand(force, torque);
        let rest: Vec<Vector3<f64>> = loads.iter().map(|(x, _)| *x).collect();
        let moved = rest.iter().zip(moves(&simulation, &rest)).map(|(x, u)| x + u);
        let centre = rest.iter().sum::<Vector3<f64>>() / rest.len() as f64;
        let want: Vector3<f64> = moved.zip(&loads).map(|(x, (_, f))| (x - centre).cross(f)).sum();
        let miss = (Vector3::from(tool.torque_n_m) - want).norm();
        assert!(miss < 1e-12 * scale * 0.16, "{t} s: {:?}, {want:?} N m", tool.torque_n_m);
    }
    println!("{splits} splits, {merges} merges, {compared} torques by hand");
    assert!(splits > 100 && merges > 50 && compared > 5, "{splits}, {merges}, {compared}");
}

/// Displacement times force, J, of loads so small that the beam hardly turns; twice the strain energy.
#[test]
fn the_beam_gives_way_more_on_every_finer_mesh() {
    let (small, point) = ([0.0, 0.0, 1e-3], [76.0, 13.0, 17.0]);
    let end = Vector3::new(0.08, 0.02, 0.02) + 1e-3 * Vector3::from(point);
    let cases = [
        (
            on_the_part(&format!(
                "{{ time_s = 0, force_n = {small:?}, torque_n_m = [1e-4, 0, 0] }}"
            )),
            by_hand(small, [1e-4, 0.0, 0.0]),
        ),
        (
            format!("at_mm = {point:?}, load = [{{ time_s = 0, force_n = {small:?} }}]"),
            vec![(end, Vector3::from(small))],
        ),
    ];
    for (load, by_hand) in cases {
        let mut compliances: Vec<f64> = Vec::new();
        for level in 0..=4 {
            let level = format!("mesh.start_level={level}");
            let mut simulation = beam(&load, &[&level, "mesh.max_level=4"]);
            step(&mut simulation);
            let points: Vec<Vector3<f64>> = by_hand.iter().map(|(x, _)| *x).collect();
            let moves = moves(&simulation, &points);
            let work: f64 = moves.iter().zip(&by_hand).map(|(u, (_, force))| u.dot(force)).sum();
            let energy = 2.0 * simulation.energy_j();
            assert!((work / energy - 1.0).abs() < 1e-3, "{level}: {work} and {energy} J");
            compliances.push(work);
        }
        println!("{compliances:?} J");
        assert!(compliances.windows(2).all(|w| w[0] < w[1]), "{compliances:?} J");
    }
}
