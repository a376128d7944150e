//! `energy`: what the new vertex would release.

use nalgebra::{Matrix3, Vector3};

use super::ring::{Indicator, RingMember};

/// η = ½ rᵀA⁻¹r with the out-of-balance force on the midpoint, r = −Σ V_c R G_cᵀD_c ε, and its
/// stiffness A = Σ V_c R G_cᵀD_cG_c Rᵀ over the ring's halves; J.
///
/// For `linear` exactly the energy that the new vertex would release at frozen neighbours (a
/// hierarchical-basis residual estimator: Bank and Smith, SIAM J. Numer. Anal. 30(4), 1993).
#[derive(Clone, Copy, Debug, Default)]
pub struct Energy;

impl Indicator for Energy {
    fn name(&self) -> &'static str {
        "energy"
    }

    fn remembers(&self) -> bool {
        false
    }

    fn unit(&self) -> &'static str {
        "J"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        let (force, stiffness) = balance(ring);
        match stiffness.cholesky() {
            Some(chol) => 0.5 * force.dot(&chol.solve(&force)),
            None => 0.0,
        }
    }

    /// ½ dᵀA d: the energy that it would take to bring the vertex back, whatever loads it out there.
    fn measure_vertex(&self, ring: &[RingMember], surplus: &Vector3<f64>) -> f64 {
        0.5 * surplus.dot(&(balance(ring).1 * surplus))
    }

    /// One bisection takes this share of what all after it take: energies of errors go with the square
    /// of the edge, which a bisection makes shorter by 2^⅓.
    fn error_over_sum(&self) -> Option<f64> {
        Some(1.0 / (1.0 - 0.5f64.powf(2.0 / 3.0)))
    }
}

/// r and A of a ring's midpoint, N and N/m.
fn balance(ring: &[RingMember]) -> (Vector3<f64>, Matrix3<f64>) {
    let mut force = Vector3::zeros();
    let mut stiffness = Matrix3::zeros();
    for member in ring {
        let half_volume = 0.5 * member.geometry.volume;
        let strain = member.strain();
        let r = &member.rotation;
        for (g, d) in member.halves.strain_operators().iter().zip(&member.halves.elasticity) {
            let coupling = g.transpose() * d * half_volume;
            force -= r * (coupling * strain);
            stiffness += r * (coupling * g) * r.transpose();
        }
    }
    (force, stiffness)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, SMatrix};
    use yawara_embed::{ChildPair, Excess, LinearTet, ParentMaterial, isotropic};

    use super::*;

    /// One tetrahedron of two materials; its halves' energy is computed term by term.
    #[test]
    fn a_vertex_is_worth_what_its_halves_take_for_it_to_go_back() {
        let corners = [[0.0; 3], [0.2, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
        let geometry = LinearTet::new(&corners.map(Vector3::from));
        let parent = ParentMaterial {
            elasticity: Matrix6::identity(),
            midpoint: SMatrix::zeros(),
            excess: Excess::Zero,
        };
        let mut member = RingMember {
            geometry,
            halves: ChildPair::new(&geometry, 0, 1, [isotropic(1.0, 0.3), isotropic(5.0, 0.2)]),
            parent,
            deformation_gradient: Matrix3::identity(),
            rotation: Matrix3::identity(),
            edge: Vector3::new(0.2, 0.0, 0.0),
            end_rotations: [Matrix3::identity(); 2],
            pressed_dilation: None,
            is_void: false,
        };
        let energy = |member: &RingMember, d: &Vector3<f64>| -> f64 {
            let operators = member.halves.strain_operators();
            let halves = operators.iter().zip(&member.halves.elasticity);
            let of = halves.map(|(g, elasticity)| {
                let strain = member.strain() + g * d;
                0.25 * member.geometry.volume * strain.dot(&(elasticity * strain))
            });
            of.sum()
        };
        // Out there by a load alone: nothing is strained but by it, and by strain it is worth nothing.
        let d = Vector3::new(0.003, -0.001, 0.002);
        assert_eq!(Energy.measure(&[member]), 0.0);
        let want = energy(&member, &d);
        assert!((Energy.measure_vertex(&[member], &d) - want).abs() < 1e-12 * want);
        // Out there by the strain alone it is worth what it released.
        member.deformation_gradient[(0, 0)] = 1.1;
        member.deformation_gradient[(0, 1)] = 0.05;
        let (force, stiffness) = balance(&[member]);
        let d = stiffness.cholesky().unwrap().solve(&force);
        let want = energy(&member, &Vector3::zeros()) - energy(&member, &d);
        assert!(want > 0.0);
        for got in [Energy.measure(&[member]), Energy.measure_vertex(&[member], &d)] {
            assert!((got - want).abs() < 1e-9 * want, "{got} {want}");
        }
    }
}
