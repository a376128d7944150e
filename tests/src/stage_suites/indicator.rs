//! What an indicator must be, whatever it measures.

use nalgebra::{Matrix3, Rotation3, Vector3};
use yawara::indicator::{RingMember, by_name};
use yawara_corot::rotation::polar_warm;
use yawara_embed::LinearTet;
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{MeshDelta, VertexId};

use crate::organ::Organ;

/// A place for each point at rest, m.
type Place<'a> = &'a dyn Fn(&Vector3<f64>) -> Vector3<f64>;

/// Every ring of a body of two materials, deformed.
fn rings(place: Place<'_>) -> Vec<Vec<RingMember>> {
    let mut organ = Organ::homogeneous([1, 1, 1], 1e3, 0.3);
    organ.labels.iter_mut().enumerate().for_each(|(i, label)| *label += (i / 2 % 3 % 2) as u16);
    organ.materials.push((2e4, 0.4));
    let embedding = organ.embedding("laminate");
    let (start, placement) = (organ.forest(2, 6), organ.placement(6));
    let rings = start.candidates().into_iter().map(|candidate| {
        let (mut forest, mut delta) = (start.clone(), MeshDelta::empty());
        forest.split(candidate, &mut delta).unwrap();
        let rest = |v: VertexId| placement.position(forest.point(v));
        let members = delta.ring.iter().map(|ring_tet| {
            let tet = ring_tet.parent;
            let corners = tet.vertices.map(rest);
            let geometry = LinearTet::new(&corners);
            let (halves, parent) = embedding.combine(tet.node, &geometry, tet.level);
            let deformation_gradient = geometry.gradient(&corners.map(|x| place(&x)));
            let ends = [corners[0], corners[bisected_corner(tet.level)]];
            let rotation = polar_warm(&deformation_gradient, &Matrix3::identity());
            RingMember {
                geometry,
                halves,
                parent,
                deformation_gradient,
                rotation,
                edge: ends[1] - ends[0],
                end_rotations: ends.map(|x| polar_warm(&gradient(place, &x), &Matrix3::identity())),
                pressed_dilation: None,
                is_void: false,
            }
        });
        members.collect()
    });
    rings.collect()
}

/// ∂x/∂X by central differences.
fn gradient(place: Place<'_>, at: &Vector3<f64>) -> Matrix3<f64> {
    let h = 1e-6;
    let columns = [Vector3::x(), Vector3::y(), Vector3::z()];
    Matrix3::from_columns(
        &columns.map(|d| (place(&(at + h * d)) - place(&(at - h * d))) / (2.0 * h)),
    )
}

/// Stretched, bent and twisted, by up to `size`.
fn bent(size: f64) -> impl Fn(&Vector3<f64>) -> Vector3<f64> {
    move |x| {
        let turn =
            Rotation3::from_scaled_axis(Vector3::new(20.0 * x.z, 35.0 * x.x, 50.0 * x.y) * size);
        turn * x + Vector3::new(0.4 * x.x - 0.2 * x.y, 0.1 * x.z, 12.0 * x.x * x.y) * size
    }
}

fn values(name: &str, rings: &[Vec<RingMember>]) -> Vec<f64> {
    let indicator = by_name(name).unwrap();
    rings.iter().map(|ring| indicator.measure(ring)).collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| if *value <= most { most } else { *value })
}

/// 0, but for the rounding of positions: some thousand ε of what a large deformation gives.
pub fn at_rest_nothing_is_asked_for(name: &str) {
    let at_rest = largest(&values(name, &rings(&|x| *x)));
    let deformed = largest(&values(name, &rings(&bent(1.0))));
    assert!(at_rest <= 1e-9 * deformed, "{at_rest:e} at rest, {deformed:e} deformed");
}

/// More of the same deformation asks for more, and nothing is negative.
pub fn a_deformed_ring_asks_for_its_vertex(name: &str) {
    let [little, more] = [0.1, 0.2].map(|size| values(name, &rings(&bent(size))));
    assert!(little.iter().chain(&more).all(|v| *v >= 0.0));
    assert!(0.0 < largest(&little) && largest(&little) < largest(&more));
}

/// x ↦ Q x + t leaves all values as they are.
pub fn rigid_motion_changes_nothing(name: &str) {
    let turn = Rotation3::from_scaled_axis(Vector3::new(1.9, 0.8, -1.4));
    let shift = Vector3::new(0.3, -0.2, 0.1);
    let bent = bent(0.5);
    let here = values(name, &rings(&bent));
    let there = values(name, &rings(&|x| turn * bent(x) + shift));
    for (here, there) in here.iter().zip(&there) {
        // Rotations at the ends come from differences over 1 µm of positions of .3 m: 1e-10 of them,
        // and as much of angles of .1.
        assert!((here - there).abs() <= 1e-7 * here, "{here:e}, {there:e}");
    }
}

/// A ring has no first member.
pub fn order_does_not_matter(name: &str) {
    let rings = rings(&bent(0.5));
    let turned: Vec<Vec<_>> = rings.iter().map(|r| r.iter().rev().copied().collect()).collect();
    for (one, other) in values(name, &rings).iter().zip(values(name, &turned)) {
        assert!((one - other).abs() <= 1e-12 * one, "{one:e}, {other:e}");
    }
}

/// Crushed to a plane, a point, or turned inside out.
pub fn flat_and_inverted_elements_give_a_number(name: &str) {
    for scale in [[1.0, 1.0, 0.0], [0.0; 3], [1.0, 1.0, -1.0], [-1.0; 3]] {
        let place = move |x: &Vector3<f64>| x.component_mul(&Vector3::from(scale));
        let values = values(name, &rings(&place));
        assert!(values.iter().all(|v| v.is_finite()), "{values:?} at {scale:?}");
    }
}
