//! The vector kernels of the elements against scalar code, on bodies that come and go.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};
use yawara_bench::Solid;
use yawara_corot::{Body, ElementCorotation, ElementReference, InternalForces, StiffnessPacket};
use yawara_embed::{P1P1, isotropic};
use yawara_mesh::TetId;

/// A number in −1..1 that looks random.
fn noise(i: usize) -> f64 {
    ((i as f64 * 12.9898).sin() * 43758.5453).fract()
}

/// A block whose tetrahedra have anisotropic elasticities that span three decades.
fn block() -> Solid {
    block_of([5, 3, 3])
}

/// One of enough tetrahedra that threads share them.
fn large_block() -> Solid {
    block_of([18, 16, 12])
}

fn block_of(cells: [usize; 3]) -> Solid {
    let mut solid = Solid::block(cells, cells.map(|n| n as f64), isotropic(1.0, 0.3));
    for (t, d) in solid.elasticity.iter_mut().enumerate() {
        let m = Matrix6::from_fn(|i, j| 0.1 * noise(7 * t + 6 * i + j));
        *d = (isotropic(1.0, 0.4) + m * m.transpose()) * 10f64.powf(1.5 * noise(t));
    }
    solid
}

fn moved(solid: &Solid, angle: f64, size: f64) -> Vec<Vector3<f64>> {
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.3, -0.5, 0.8) * angle);
    let shaken = |(i, x): (usize, &Vector3<f64>)| {
        let shake = Vector3::from_fn(|axis, _| noise(3 * i + axis));
        turn * (x + shake * size) + Vector3::new(1.0, 2.0, -1.0)
    };
    solid.points.iter().enumerate().map(shaken).collect()
}

fn compare(fast: &mut Body, slow: &mut Body, x: &[Vector3<f64>]) {
    let mut got = vec![Vector3::repeat(1.0); x.len()];
    let mut want = got.clone();
    let scale = ElementCorotation.internal_forces(fast, x, &mut got);
    let reference = ElementReference.internal_forces(slow, x, &mut want);
    assert!((scale - reference).abs() <= 1e-13 * reference);
    let largest = want.iter().map(Vector3::amax).fold(0.0, f64::max);
    for (got, want) in got.iter().zip(&want) {
        assert!((got - want).amax() <= 1e-13 * largest.max(scale), "{got} {want}");
    }
    for number in 0..slow.elements().len() {
        assert_eq!(fast.elements()[number].tet, slow.elements()[number].tet);
        assert!((fast.rotation(number) - slow.rotation(number)).amax() < 1e-13);
    }
    for (a, b) in fast.vertex_rotations().iter().zip(slow.vertex_rotations()) {
        assert!((a - b).amax() < 1e-13);
    }
}

#[test]
fn forces_and_rotations_are_those_of_the_scalar_code() {
    for solid in [block(), large_block()] {
        let (mut fast, mut slow) = (solid.body(), solid.body());
        // Small, large, and from one to the other; the last two invert elements.
        for (angle, size) in
            [(0.0, 0.01), (0.4, 0.1), (3.0, 0.2), (0.0, 0.2), (2.0, 0.6), (0.1, 2.0)]
        {
            compare(&mut fast, &mut slow, &moved(&solid, angle, size));
        }
    }
}

#[test]
fn figures_do_not_depend_on_the_number_of_threads() {
    let solid = large_block();
    let x = moved(&solid, 0.4, 0.1);
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut body = solid.body();
        let mut mixed = Body::mixed(P1P1::default());
        body.elements().iter().for_each(|&element| mixed.insert(element));
        mixed.set_pressures(&(0..x.len()).map(noise).collect::<Vec<_>>());
        let mut forces = [vec![Vector3::zeros(); x.len()], vec![Vector3::zeros(); x.len()]];
        let [of_body, of_mixed] = &mut forces;
        pool.install(|| {
            ElementCorotation.internal_forces(&mut body, &x, of_body);
            ElementCorotation.internal_forces(&mut mixed, &x, of_mixed);
        });
        let lack: Vec<f64> = (0..x.len()).map(|v| mixed.pressure_residual(v)).collect();
        let rotations = [body.vertex_rotations().to_vec(), mixed.vertex_rotations().to_vec()];
        (forces, lack, rotations)
    };
    let one = with_threads(1);
    assert!(one.1.iter().any(|lack| *lack != 0.0));
    for threads in [2, 3, 7] {
        assert!(with_threads(threads) == one, "{threads} threads");
    }
}

#[test]
fn elements_come_and_go_one_by_one() {
    let solid = block();
    let (mut fast, mut slow) = (solid.body(), solid.body());
    let x = moved(&solid, 0.5, 0.1);
    for round in 0..200usize {
        let tet = TetId((round * 37 % solid.tets.len()) as u32);
        for body in [&mut fast, &mut slow] {
            if let Some(element) = body.remove(tet)
                && round % 3 == 0
            {
                body.insert(element);
            }
        }
        if round % 20 == 0 {
            compare(&mut fast, &mut slow, &x);
        }
    }
    while let Some(element) = fast.elements().first().copied() {
        fast.remove(element.tet);
        slow.remove(element.tet);
        compare(&mut fast, &mut slow, &x);
    }
}

#[test]
fn stiffness_blocks_are_rotated_element_matrices() {
    [block(), large_block()].iter().for_each(check_blocks);
}

fn check_blocks(solid: &Solid) {
    let mut body = solid.body();
    let x = moved(solid, 1.0, 0.1);
    let mut forces = vec![Vector3::zeros(); x.len()];
    let mut blocks: Vec<StiffnessPacket> =
        vec![[[f64::NAN; 8]; 144]; body.elements().len().div_ceil(8)];
    body.forces_and_stiffness(&x, &mut forces, &mut blocks);
    for (number, element) in body.elements().iter().enumerate() {
        let k = element.geometry.stiffness(&element.elasticity);
        let r = body.rotation(number);
        for (a, b) in (0..4).flat_map(|a| (0..4).map(move |b| (a, b))) {
            let want = r * k.fixed_view::<3, 3>(3 * a, 3 * b) * r.transpose();
            let got = Matrix3::from_fn(|i, j| {
                blocks[number / 8][12 * (3 * a + i) + 3 * b + j][number % 8]
            });
            assert!((got - want).amax() <= 1e-13 * k.amax(), "{number} {a} {b}: {got} {want}");
        }
    }
}

#[test]
fn what_is_not_finite_or_flat_stays_apart() {
    let solid = block();
    let mut body = solid.body();
    let mut x = moved(&solid, 0.2, 0.05);
    let mut forces = vec![Vector3::zeros(); x.len()];
    x[7] = Vector3::repeat(f64::NAN);
    assert!(ElementCorotation.internal_forces(&mut body, &x, &mut forces).is_nan());
    let mut rotations = (0..body.elements().len()).map(|number| body.rotation(number));
    assert!(rotations.all(|rotation| rotation.iter().all(|r| r.is_finite())));
    assert!(forces.iter().any(|f| f.x.is_finite()), "elements without that vertex are whole");
    // All in a plane, then all in a point.
    for squeeze in [0.0, 1.0] {
        let flat: Vec<_> =
            solid.points.iter().map(|p| Vector3::new(p.x, p.y, 0.0) * (1.0 - squeeze)).collect();
        assert!(ElementCorotation.internal_forces(&mut body, &flat, &mut forces).is_finite());
        for number in 0..body.elements().len() {
            let r = body.rotation(number);
            assert!((r.transpose() * r - Matrix3::identity()).amax() < 1e-13);
        }
    }
}
