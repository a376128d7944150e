//! `mass_spring`: a spring along each edge, in place of elasticity.

use std::sync::{Mutex, PoisonError};

use nalgebra::{Matrix3, Vector3};
use yawara_embed::MixedModuli;

use super::internal_forces::InternalForces;
use super::tangent::{TangentOf, beyond_tangent};
use crate::body::Body;
use crate::element::{EDGES, Element};
use crate::field::Field;

/// k (‖x_b − x_a‖ − L) along each edge (a, b), L its length at rest, k = Σ E V/L² over the tetrahedra around it:
/// what a mass-spring model on the same mesh makes of it, the baseline of most older work.
///
/// E is that of the element's bulk and shear modulus. Springs know no other Poisson ratio than ¼, whatever the
/// material's, and no anisotropy but the mesh's: a regular tetrahedron answers to a strain as the material of ν = ¼ does
/// on average over its directions, and any tetrahedron to a dilation. Flat elements are far too soft across. Element
/// rotations are renewed for who reads them; stresses, energies and error estimates are those of the material at the
/// springs' positions. What a law has beyond D ε is added as to other forces.
///
/// Cost: some forty flops per edge; O(elements) where the mesh or the material has changed.
///
/// Source: Van Gelder, Journal of Graphics Tools 3(2), 1998, for triangles; Lloyd, Székely and Harders, IEEE
/// Transactions on Visualization and Computer Graphics 13(5), 2007, have 2√2/25 E L for regular tetrahedra, where this
/// is √2/12 E L.
#[derive(Debug, Default)]
pub struct MassSpring {
    net: Mutex<Net>,
}

/// The springs of a body, and what they were made of.
#[derive(Debug, Default)]
struct Net {
    /// Of the body's elements.
    stamps: Vec<u64>,
    springs: Vec<Spring>,
}

#[derive(Clone, Copy, Debug)]
struct Spring {
    /// Vertex numbers, ascending.
    ends: [usize; 2],
    /// m.
    length: f64,
    /// N/m.
    stiffness: f64,
}

impl Spring {
    /// Those that an element has a part in.
    fn of(element: &Element) -> [Self; 6] {
        let Element { geometry, vertices, elasticity, .. } = element;
        let MixedModuli { bulk, shear, .. } = MixedModuli::split(elasticity);
        let young_modulus = 9.0 * bulk * shear / (3.0 * bulk + shear);
        let [_, b, c, d] = geometry.gradients;
        // ∇λ_i (X_j − X_0) = δ_ij.
        let edges = Matrix3::from_columns(&[b, c, d]).transpose().try_inverse();
        let edges = edges.unwrap_or_else(Matrix3::zeros);
        let corner = |i: usize| match i {
            0 => Vector3::zeros(),
            _ => edges.column(i - 1).into_owned(),
        };
        EDGES.map(|[i, j]| {
            let length = (corner(j) - corner(i)).norm();
            let stiffness = young_modulus * geometry.volume / (length * length);
            let [a, b] = [vertices[i], vertices[j]];
            Self { ends: [a.min(b), a.max(b)], length, stiffness }
        })
    }

    /// k (n nᵀ + (1 − L/ℓ)(1 − n nᵀ)) of an edge ℓ n, N/m: ∂pull/∂x_b.
    fn tangent(&self, edge: &Vector3<f64>) -> Matrix3<f64> {
        let now = edge.norm();
        if now == 0.0 {
            return Matrix3::zeros();
        }
        let along = edge * edge.transpose() / (now * now);
        let across = (1.0 - self.length / now) * (Matrix3::identity() - along);
        self.stiffness * (along + across)
    }
}

impl Net {
    /// Makes the springs of a body, unless they are at hand.
    fn follow(&mut self, body: &Body) {
        let count = body.elements().len();
        let is_same = |number: usize| self.stamps[number] == body.stamp(number);
        if self.stamps.len() == count && (0..count).all(is_same) {
            return;
        }
        self.stamps.clear();
        self.springs = body.elements().iter().flat_map(Spring::of).collect();
        self.springs.sort_by_key(|spring| spring.ends);
        self.springs.dedup_by(|next, kept| {
            let is_same = next.ends == kept.ends;
            kept.stiffness += if is_same { next.stiffness } else { 0.0 };
            is_same
        });
        // Last: springs that are half made are of no body.
        self.stamps.extend((0..count).map(|number| body.stamp(number)));
    }
}

impl InternalForces for MassSpring {
    fn name(&self) -> &'static str {
        "mass_spring"
    }

    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64 {
        // What a thread has left half made has no stamps, and is made anew.
        let mut net = self.net.lock().unwrap_or_else(PoisonError::into_inner);
        net.follow(body);
        body.renew_rotations(positions);
        forces.fill(Vector3::zeros());
        let mut squares = 0.0;
        for Spring { ends: [a, b], length, stiffness } in &net.springs {
            let edge = positions[*b] - positions[*a];
            let now = edge.norm();
            // An edge without length pulls nowhere.
            let pull = if now > 0.0 { stiffness * (now - length) / now * edge } else { edge };
            forces[*a] -= pull;
            forces[*b] += pull;
            squares += 2.0 * pull.norm_squared();
        }
        (squares + body.add_law_forces(positions, forces)).sqrt()
    }

    fn tangent(&self) -> Option<TangentOf<'_>> {
        Some(Box::new(|body, number, positions| {
            let element = &body.elements()[number];
            let mut tangent = beyond_tangent(body, number, positions);
            for (spring, [i, j]) in Spring::of(element).into_iter().zip(EDGES) {
                let edge = positions[element.vertices[j]] - positions[element.vertices[i]];
                let block = spring.tangent(&edge);
                for (a, b) in [(i, i), (i, j), (j, i), (j, j)] {
                    let mut entries = tangent.fixed_view_mut::<3, 3>(3 * a, 3 * b);
                    entries += if a == b { block } else { -block };
                }
            }
            tangent
        }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use yawara_embed::{LinearTet, isotropic};
    use yawara_mesh::TetId;

    use super::*;

    const E: f64 = 2e3;

    /// Tetrahedra on corners at rest, of ν = .45, and the work that small displacements take by the springs.
    fn work(
        rest: &[Vector3<f64>],
        tets: &[[usize; 4]],
        moved: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> f64 {
        let mut body = Body::new();
        for (number, &vertices) in tets.iter().enumerate() {
            let geometry = LinearTet::new(&vertices.map(|v| rest[v]));
            let (tet, elasticity) = (TetId(number as u32), isotropic(E, 0.45));
            body.insert(Element { tet, vertices, geometry, elasticity });
        }
        let positions: Vec<Vector3<f64>> = rest.iter().map(&moved).collect();
        let mut forces = vec![Vector3::zeros(); rest.len()];
        let springs = MassSpring::default();
        springs.internal_forces(&mut body, rest, &mut forces);
        assert!(forces.iter().all(|f| f.norm() < 1e-12 * E));
        springs.internal_forces(&mut body, &positions, &mut forces);
        let moves = positions.iter().zip(rest).map(|(x, rest)| x - rest);
        0.5 * forces.iter().zip(moves).map(|(f, u)| f.dot(&u)).sum::<f64>()
    }

    proptest! {
        #[test]
        fn a_dilation_is_resisted_as_by_a_material_of_a_quarter(
            corners in prop::array::uniform4(prop::array::uniform3(-1.0..1.0f64)),
            strain in -1e-3..1e-3f64,
        ) {
            let rest = corners.map(Vector3::from);
            let volume = LinearTet::new(&rest).volume;
            prop_assume!(volume.abs() > 1e-2);
            let vertices = if volume > 0.0 { [0, 1, 2, 3] } else { [0, 1, 3, 2] };
            let got = work(&rest, &[vertices], |x| (1.0 + strain) * x);
            // ½ · 9 κ e² V, κ = E / (3 (1 − 2ν)).
            let want = 0.5 * 9.0 * (E / 1.5) * strain * strain * volume.abs();
            prop_assert!((got - want).abs() <= 1e-9 * want + 1e-18);
        }
    }

    #[test]
    fn on_average_over_directions_a_regular_tetrahedron_has_the_modulus() {
        let rest = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let rest = rest.map(Vector3::from);
        let volume = LinearTet::new(&rest).volume.abs();
        let vertices = if LinearTet::new(&rest).volume > 0.0 { [0, 1, 2, 3] } else { [1, 0, 2, 3] };
        // Directions of an icosahedron's corners average fourth powers exactly.
        let golden = 0.5 * (1.0 + 5f64.sqrt());
        let corners = [[0.0, 1.0, golden], [0.0, -1.0, golden]].map(Vector3::from);
        let all = corners.iter().flat_map(|n| [*n, n.yzx(), n.zxy()]).map(|n| n.normalize());
        let strain = 1e-5;
        let directions: Vec<Vector3<f64>> = all.collect();
        let works =
            directions.iter().map(|n| work(&rest, &[vertices], |x| x + strain * n.dot(x) * n));
        let mean = works.sum::<f64>() / directions.len() as f64;
        // ½ (λ + 2μ) e² V with λ = μ = .4 E.
        let want = 0.5 * 1.2 * E * strain * strain * volume;
        assert!((mean - want).abs() < 1e-4 * want, "{mean}, {want}");
    }

    #[test]
    fn the_tangent_is_the_derivative_of_forces() {
        let rest = [[0.0; 3], [1.0, 0.0, 0.0], [0.2, 1.0, 0.0], [0.1, 0.3, 0.8]].map(Vector3::from);
        let (vertices, geometry) = ([0, 1, 2, 3], LinearTet::new(&rest));
        let mut body = Body::new();
        let (tet, elasticity) = (TetId(0), isotropic(E, 0.3));
        body.insert(Element { tet, vertices, geometry, elasticity });
        // Some edges get longer, some shorter.
        let at = rest.map(|x| Vector3::new(1.3 * x.x + 0.2 * x.y, 0.7 * x.y, x.z - 0.4 * x.x));
        let springs = MassSpring::default();
        let tangent = springs.tangent().unwrap()(&body, 0, &at);
        let mut forces = |x: &[Vector3<f64>]| {
            let mut forces = vec![Vector3::zeros(); 4];
            springs.internal_forces(&mut body, x, &mut forces);
            forces
        };
        let step = 1e-6;
        for column in 0..12 {
            let [less, more] = [-step, step].map(|by| {
                let mut x = at;
                x[column / 3][column % 3] += by;
                forces(&x)
            });
            for row in 0..12 {
                let slope = (more[row / 3] - less[row / 3])[row % 3] / (2.0 * step);
                let error = (tangent[(row, column)] - slope).abs();
                assert!(error < 1e-7 * E, "{row}, {column}: {error}");
            }
        }
    }

    #[test]
    fn springs_follow_the_mesh() {
        let rest: Vec<Vector3<f64>> =
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]
                .map(Vector3::from)
                .to_vec();
        let pull = |x: &Vector3<f64>| x + Vector3::new(1e-4 * x.y, 0.0, 2e-4 * x.x);
        let tets = [[0, 1, 2, 3], [1, 2, 3, 4]].map(|tet: [usize; 4]| {
            match LinearTet::new(&tet.map(|v| rest[v])).volume > 0.0 {
                true => tet,
                false => [tet[1], tet[0], tet[2], tet[3]],
            }
        });
        // Edges that both have are springs of both.
        let both = work(&rest, &tets, pull);
        let each = work(&rest, &tets[..1], pull) + work(&rest, &tets[1..], pull);
        assert!(each > 0.0 && (both - each).abs() < 1e-9 * each);
        // The same springs under another body.
        let springs = MassSpring::default();
        let mut forces = vec![Vector3::zeros(); rest.len()];
        let moved: Vec<Vector3<f64>> = rest.iter().map(pull).collect();
        let mut bodies = [1, 2].map(|count| {
            let mut body = Body::new();
            for (number, &vertices) in tets[..count].iter().enumerate() {
                let geometry = LinearTet::new(&vertices.map(|v| rest[v]));
                let (tet, elasticity) = (TetId(number as u32), isotropic(E, 0.3));
                body.insert(Element { tet, vertices, geometry, elasticity });
            }
            body
        });
        let sizes =
            bodies.each_mut().map(|body| springs.internal_forces(body, &moved, &mut forces));
        assert!(sizes[0] > 0.0 && sizes[1] > sizes[0]);
        assert!(forces[4].norm() > 0.0);
    }
}
