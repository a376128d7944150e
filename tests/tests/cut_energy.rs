//! What a cut does to the energy of a body under dead load.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::Severed;
use yawara_tests::clamped_body::ClampedBody;
use yawara_tests::cuts::{Cut, by_plane, cuts, parted};
use yawara_tests::organ::{Organ, organs};

/// The most faces that are severed in a case, each by itself.
const FACES: usize = 400;

/// The same force on the middle of each finest tetrahedron, handed to the corners of the sheet that holds it, in slots.
fn load(body: &ClampedBody, force: Vector3<f64>) -> Vec<f64> {
    let forest = &body.forest;
    let mut load = vec![0.0; 3 * body.link.maintainer().vertices()];
    for tet in forest.leaves() {
        let leaf = forest.leaf_of(tet.id);
        let middle = |corners: [[i32; 3]; 4]| {
            corners.iter().map(|&p| Vector3::from(p.map(f64::from))).sum::<Vector3<f64>>() * 0.25
        };
        let units = forest.finest_units();
        let x = tet.vertices.map(|v| Vector3::from(forest.point(v).map(|c| f64::from(c * units))));
        let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        let inverse = edges.try_inverse().unwrap();
        for (i, fine) in forest.finest_in(&tet).iter().enumerate() {
            if forest.sheet_with(leaf, i) != tet.id {
                continue;
            }
            let w = inverse * (middle(fine.corners) - x[0]);
            let weights = [1.0 - w.sum(), w.x, w.y, w.z];
            for (v, weight) in tet.vertices.iter().zip(weights) {
                if body.is_fixed(v.index()) {
                    continue;
                }
                let row = 3 * body.link.slot(v.index()).unwrap();
                (0..3).for_each(|axis| load[row + axis] += weight * force[axis]);
            }
        }
    }
    load
}

/// The total potential energy ½ uᵀKu − fᵀu at the kept inverse's u, J, whose error counts by its square; and what rounding
/// does to it, ε Σ K_ii u_i².
fn energy(body: &ClampedBody, force: Vector3<f64>) -> [f64; 2] {
    let f = load(body, force);
    let inverse = body.link.maintainer();
    let [mut u, mut ku] = [vec![0.0; f.len()], vec![0.0; f.len()]];
    inverse.solve(&f, &mut u).unwrap();
    inverse.stiffness().apply(&u, &mut ku).unwrap();
    let stored: f64 = u.iter().zip(&ku).map(|(u, ku)| 0.5 * u * ku).sum();
    let work: f64 = u.iter().zip(&f).map(|(u, f)| u * f).sum();
    let size: f64 = (0..u.len()).map(|i| inverse.stiffness().diagonal(i) * u[i] * u[i]).sum();
    [stored - work, size * f64::EPSILON]
}

/// What is done to a body, and the force on it.
struct History {
    splits: Vec<Index>,
    blades: Vec<Cut>,
    /// Which of the faces that are left comes next.
    order: Vec<usize>,
    force: Vector3<f64>,
}

/// Splits, then severs the faces of the blades one at a time; the energies from before the first face on, and what
/// rounding does to each.
fn energies(organ: &Organ, rule: &str, history: &History) -> Vec<[f64; 2]> {
    let History { splits, blades, order, force } = history;
    let mut body = ClampedBody::new(organ, rule, "sparse", "p1");
    splits.iter().for_each(|pick| body.step(&(true, *pick)));
    let faces = blades
        .iter()
        .flat_map(|&(normal, offset, ball)| parted(&body.forest, by_plane(normal, offset, ball)));
    let mut faces: Vec<Severed> = faces.collect();
    let mut energies = vec![energy(&body, *force)];
    for pick in order.iter().take(faces.len()) {
        let face = faces.swap_remove(pick % faces.len());
        if body.cut_faces(true, &[face]) {
            energies.push(energy(&body, *force));
        }
    }
    energies
}

fn never_rises(energies: &[[f64; 2]]) -> bool {
    energies.windows(2).all(|pair| pair[1][0] - pair[0][0] <= 4.0 * pair[1][1])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Where what a tetrahedron is made of counts by volume, parts together are as stiff as the whole: a cut only gives
    /// way. `laminate` takes a whole of several materials to be softer than its parts and can rise, but never above that.
    #[test]
    fn no_face_that_is_severed_raises_the_energy_under_dead_load(
        organ in organs([2, 1, 1], 3, 3.0..5.0, 0.0..0.45),
        blades in prop::collection::vec(cuts(), 3),
        splits in prop::collection::vec(any::<Index>(), 10),
        order in prop::collection::vec(any::<usize>(), FACES),
        force in prop::array::uniform3(-1.0..1.0f64),
    ) {
        let history = History { splits, blades, order, force: force.into() };
        let by_volume = energies(&organ, "linear", &history);
        prop_assert!(never_rises(&by_volume), "{by_volume:?}");
        let laminate = energies(&organ, "laminate", &history);
        let rises = laminate.windows(2).map(|pair| (pair[1][0] - pair[0][0]) / laminate[0][0].abs());
        println!("laminate: a face raises the energy by at most {:.4} of it", rises.fold(0.0, f64::max));
        for (softer, by_volume) in laminate.iter().zip(&by_volume) {
            prop_assert!(softer[0] <= by_volume[0] + 4.0 * by_volume[1], "{softer:?} {by_volume:?}");
        }
        let one = Organ::homogeneous([2, 1, 1], 1e4, 0.3);
        let of_one = energies(&one, "laminate", &history);
        prop_assert!(never_rises(&of_one), "{of_one:?}");
    }
}

/// Half through a bar of two materials, face by face.
#[test]
fn a_blade_half_through_a_bar_releases_energy() {
    let mut organ = Organ::homogeneous([2, 1, 1], 1e3, 0.3);
    organ.materials.push((1e5, 0.4));
    organ.labels.iter_mut().enumerate().for_each(|(i, label)| *label = 1 + (i / 2 % 2) as u16);
    let history = History {
        splits: Vec::new(),
        blades: vec![([1, 0, 0], 45, ([45, 16, 0], 30))],
        order: (0..FACES).map(|i| 7 * i).collect(),
        force: Vector3::x(),
    };
    let found = energies(&organ, "linear", &history);
    assert!(never_rises(&found), "{found:?}");
    let [first, last] = [found[0][0], found[found.len() - 1][0]];
    assert!(first < 0.0 && last < 1.1 * first, "{first:e} to {last:e} J");
}
