//! What linear tetrahedra and element co-rotation must get right: patch test, rigid motion,
//! free-body balance, Timoshenko's cantilever.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara::scene_file;
use yawara::{Simulation, Stages};
use yawara_corot::{Body, ElementCorotation, InternalForces};
use yawara_embed::Embedding;
use yawara_mesh::{BisectionForest, MeshDelta, Placement};
use yawara_tests::organ::{Organ, elements, organs};

fn body(forest: &BisectionForest, placement: &Placement, embedding: &Embedding) -> Body {
    let mut body = Body::new();
    elements(forest, placement, embedding).for_each(|element| body.insert(element));
    body
}

fn rest(forest: &BisectionForest, placement: &Placement) -> Vec<Vector3<f64>> {
    let mut rest = vec![Vector3::zeros(); forest.vertex_capacity()];
    for v in forest.vertices() {
        rest[v.index()] = placement.position(forest.point(v));
    }
    rest
}

fn refine(forest: &mut BisectionForest, picks: &[Index]) {
    let mut delta = MeshDelta::empty();
    for pick in picks {
        let candidates = forest.candidates();
        forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
    }
}

fn largest(a: &[Vector3<f64>]) -> f64 {
    a.iter().map(Vector3::amax).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn patch_test(
        picks in proptest::collection::vec(any::<Index>(), 25),
        strain in proptest::array::uniform9(-1.0..1.0f64),
        poisson in -0.5..0.499f64,
        laminate in any::<bool>(),
    ) {
        // A linear field on the boundary is a linear field inside, on any refined mesh.
        let mut organ = Organ::homogeneous([2, 1, 1], 4e3, poisson);
        for (i, label) in organ.labels.iter_mut().enumerate() {
            *label += (i % 3 == 0) as u16;
        }
        organ.materials.push((4e3, poisson));
        let embedding = organ.embedding(if laminate { "laminate" } else { "linear" });
        let mut forest = organ.forest(3, 7);
        refine(&mut forest, &picks);
        let placement = organ.placement(7);
        let (x, body) = (rest(&forest, &placement), body(&forest, &placement, &embedding));
        let field = Matrix3::from_row_slice(&strain);

        let n = 3 * x.len();
        let mut k = Mat::<f64>::zeros(n, n);
        for e in body.elements() {
            let ke = e.geometry.stiffness(&e.elasticity);
            for i in 0..12 {
                for j in 0..12 {
                    k[(3 * e.vertices[i / 3] + i % 3, 3 * e.vertices[j / 3] + j % 3)] += ke[(i, j)];
                }
            }
        }
        let mut on_boundary = vec![false; x.len()];
        for v in forest.boundary_faces().into_iter().flatten() {
            on_boundary[v.index()] = true;
        }
        let u = |dof: usize| (field * x[dof / 3])[dof % 3];
        let dofs = |outer: bool| -> Vec<usize> {
            (0..n).filter(|&i| on_boundary[i / 3] == outer).collect()
        };
        let (inner, outer) = (dofs(false), dofs(true));
        prop_assert!(!inner.is_empty());
        let part = |rows: &[usize], columns: &[usize]| {
            Mat::from_fn(rows.len(), columns.len(), |i, j| k[(rows[i], columns[j])])
        };
        let boundary = Mat::from_fn(outer.len(), 1, |i, _| u(outer[i]));
        let load = -(part(&inner, &outer) * boundary);
        let solved = part(&inner, &inner).llt(Side::Lower).unwrap().solve(load);
        for (i, &dof) in inner.iter().enumerate() {
            // Condition number of the inner block times rounding stays far below this.
            prop_assert!((solved[(i, 0)] - u(dof)).abs() <= 1e-10 * largest(&x));
        }
    }

    #[test]
    fn rigid_motion_by_170_degrees_costs_no_force(
        organ in organs([2, 1, 1], 3, 2.0..6.0, 0.0..0.49),
        picks in proptest::collection::vec(any::<Index>(), 20),
        axis in proptest::array::uniform3(0.1..1.0f64),
        shift in proptest::array::uniform3(-1.0..1.0f64),
    ) {
        let mut forest = organ.forest(0, 7);
        refine(&mut forest, &picks);
        let placement = organ.placement(7);
        let embedding = organ.embedding("laminate");
        let mut body = body(&forest, &placement, &embedding);
        let x = rest(&forest, &placement);
        let angle = 170f64.to_radians();
        let turn = Rotation3::new(Vector3::from(axis).normalize() * angle);
        let moved: Vec<_> = x.iter().map(|x| turn * x + Vector3::from(shift)).collect();
        let mut forces = vec![Vector3::zeros(); x.len()];
        ElementCorotation.internal_forces(&mut body, &moved, &mut forces);
        // Forces that straining by 100 % would cause, times 1e-10.
        let bar = 1e-10 * body.stiffness_scale() * largest(&moved);
        prop_assert!(largest(&forces) <= bar);
        // A strain of 1e-3 is far above the bar.
        let stretched: Vec<_> = moved.iter().map(|x| x * 1.001).collect();
        ElementCorotation.internal_forces(&mut body, &stretched, &mut forces);
        prop_assert!(largest(&forces) > 10.0 * bar);
    }

    #[test]
    fn a_free_body_pulls_itself_nowhere(
        organ in organs([2, 1, 1], 3, 2.0..6.0, 0.0..0.49),
        bend in proptest::collection::vec(proptest::array::uniform3(-0.3..0.3f64), 200),
    ) {
        let forest = organ.forest(4, 4);
        let placement = organ.placement(4);
        let mut mixed = body(&forest, &placement, &organ.embedding("laminate"));
        let x: Vec<_> = rest(&forest, &placement)
            .iter()
            .enumerate()
            .map(|(i, x)| x + Vector3::from(bend[i % bend.len()]) * 0.01)
            .collect();
        let mut forces = vec![Vector3::zeros(); x.len()];
        let scale = ElementCorotation.internal_forces(&mut mixed, &x, &mut forces);
        let net: Vector3<f64> = forces.iter().sum();
        prop_assert!(net.norm() <= 1e-12 * scale);
        // Torque vanishes where stress and stretch commute: for isotropic material.
        let plain = Organ::homogeneous(organ.cells, 5e3, 0.4);
        let mut plain = body(&plain.forest(4, 4), &placement, &plain.embedding("laminate"));
        let scale = ElementCorotation.internal_forces(&mut plain, &x, &mut forces);
        let torque: Vector3<f64> = x.iter().zip(&forces).map(|(x, f)| x.cross(f)).sum();
        prop_assert!(torque.norm() <= 1e-12 * scale * largest(&x));
    }
}

/// Sag of the free end under its weight, mean over the end face, m.
fn sag(level: u8, gravity: f64) -> f64 {
    let set = [
        format!("mesh.start_level={level}"),
        format!("mesh.max_level={level}"),
        format!("gravity_m_s2=[0.0, 0.0, {}]", -gravity),
        "time.steps=1".into(),
        "solver.residual=1e-9".into(),
        "tools=[]".into(),
        "image.size_mm=[100.0, 20.0, 20.0]".into(),
        "image.voxel_mm=20.0".into(),
        "support.hold=vertices".into(),
        "mesh.base_mm=20.0".into(),
        "materials.0.young_modulus_pa=1e5".into(),
        "materials.0.poisson_ratio=0.0".into(),
        "fixed=[{ shape = 'box', min = [-0.1, -0.1, -0.1], max = [0.0, 1.1, 1.1] }]".into(),
    ];
    let (scene, _) = scene_file::load("beam", &set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let report = simulation.step().unwrap();
    assert!(report.converged, "{report:?}");
    let frame = simulation.frame().unwrap();
    let right = frame.points_mm.iter().zip(&frame.displacement_mm).map(|(p, u)| p[0] - u[0]);
    let end = right.clone().fold(f64::MIN, f64::max);
    let moved: Vec<f64> = right
        .zip(&frame.displacement_mm)
        .filter(|(x, _)| (x - end).abs() < 1e-6)
        .map(|(_, u)| -u[2] * 1e-3)
        .collect();
    moved.iter().sum::<f64>() / moved.len() as f64
}

#[test]
fn cantilever_converges_to_timoshenko() {
    // L = 0.1 m, square section h = 0.02 m, E = 1e5 Pa, nu = 0, load q = rho g h² small enough
    // for linear theory: w = q L⁴/(8 E I) + q L²/(2 k G A), k = 5/6 for a square at nu = 0.
    let (length, side, young, density, gravity) = (0.1f64, 0.02f64, 1e5, 1000.0, 0.01);
    let load = density * gravity * side * side;
    let inertia = side.powi(4) / 12.0;
    let shear_stiffness = 5.0 / 6.0 * (young / 2.0) * side * side;
    let expected = load * length.powi(4) / (8.0 * young * inertia)
        + load * length * length / (2.0 * shear_stiffness);
    // Levels 0, 3, 6: h, h/2, h/4. Too stiff by a part that goes with h².
    let errors: Vec<f64> =
        [0, 3, 6].iter().map(|&level| expected / sag(level, gravity) - 1.0).collect();
    let slopes: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("excess stiffness at h, h/2, h/4: {errors:.4?}, slopes {slopes:.2?}");
    assert!(errors.iter().all(|&e| e > 0.0), "linear tetrahedra are too stiff, never too soft");
    assert!(slopes[0] > 1.7 && slopes[1] > 1.9 && slopes[1] < 2.2, "{slopes:?}");
    assert!(errors[2] < 0.2, "{errors:?}");
}
