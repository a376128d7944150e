//! `rotation`: how far apart the ends of the bisected edge have turned.

use super::{Indicator, RingMember};

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
