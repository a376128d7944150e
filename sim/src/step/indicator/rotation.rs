//! `rotation`: how far apart the ends of the bisected edge have turned.

use super::ring::{Indicator, RingMember};

/// ⅛ ‖(R_a − R_b)(X_b − X_a)‖: how far the middle of a bent edge lies off the straight one, m, if
/// its ends turn with the body there; R_a and R_b the rotations of the vertices at its ends.
///
/// Sees bending and twisting alone: a body that is stretched or indented asks for nothing, however
/// much.
/// # Source
/// The sagitta of an arc of length L that turns by θ is Lθ/8.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rotation;

impl Indicator for Rotation {
    fn name(&self) -> &'static str {
        "rotation"
    }

    fn remembers(&self) -> bool {
        false
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        // All members share the edge and the rotations of its ends.
        let Some(member) = ring.first() else { return 0.0 };
        let [a, b] = member.end_rotations;
        ((a - b) * member.edge).norm() / 8.0
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Rotation3, SMatrix, Vector3};
    use yawara_embed::{ChildPair, Excess, LinearTet, ParentMaterial, isotropic};

    use super::*;

    #[test]
    fn an_arc_rises_by_its_length_times_its_angle_over_eight() {
        let corners = [[0.0; 3], [0.2, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
        let geometry = LinearTet::new(&corners.map(Vector3::from));
        let turn = |angle: f64| *Rotation3::new(Vector3::new(0.0, angle, 0.0)).matrix();
        let mut member = RingMember {
            geometry,
            halves: ChildPair::new(&geometry, 0, 1, [isotropic(1.0, 0.3); 2]),
            parent: ParentMaterial {
                elasticity: Matrix6::identity(),
                midpoint: SMatrix::zeros(),
                excess: Excess::Zero,
            },
            deformation_gradient: turn(0.5) * 1.3,
            rotation: turn(0.5),
            edge: Vector3::new(0.2, 0.0, 0.0),
            end_rotations: [turn(0.5); 2],
            pressed_dilation: None,
            is_void: false,
        };
        // Turned and stretched as a whole: nothing.
        assert_eq!(Rotation.measure(&[member]), 0.0);
        member.end_rotations = [turn(0.49), turn(0.51)];
        // The chord of .02 rad is 2 sin(.01).
        let want = 0.2 * 2.0 * 0.01f64.sin() / 8.0;
        assert!((Rotation.measure(&[member]) - want).abs() < 1e-15);
        // An edge along the axis of the turn stays straight.
        member.edge = Vector3::new(0.0, 0.2, 0.0);
        assert!(Rotation.measure(&[member]) < 1e-16);
        assert_eq!(Rotation.measure(&[]), 0.0);
    }
}
