//! `volume`: how much the halves' volumes change, the paper's measure.

use nalgebra::{Matrix3, Vector3};

use super::ring::{Indicator, RingMember};

/// The largest |V_c/V_c0 − 1| among the ring's halves that hold any material.
///
/// Source: Oishi et al., section 3.1.4. With a midpoint that stays in the middle of its edge
/// both ratios equal det F: it then measures the parent's strain, not its rotation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Volume;

impl Indicator for Volume {
    fn name(&self) -> &'static str {
        "volume"
    }

    fn remembers(&self) -> bool {
        false
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        ring.iter()
            .filter(|member| !member.is_void)
            .flat_map(|member| {
                child_volume_ratios(
                    &member.deformation_gradient,
                    &member.midpoint_offset(),
                    &member.halves.midpoint_gradients,
                )
            })
            .map(|ratio| (ratio - 1.0).abs())
            .fold(0.0, f64::max)
    }
}

/// V_c/V_c0 of both halves, exactly: det F + d · cof(F) g_c, where `offset` d is the midpoint's
/// position off the middle of the deformed edge (m) and g_c its gradient at rest (1/m).
pub fn child_volume_ratios(
    deformation_gradient: &Matrix3<f64>,
    offset: &Vector3<f64>,
    midpoint_gradients: &[Vector3<f64>; 2],
) -> [f64; 2] {
    let f = deformation_gradient;
    let cofactor = Matrix3::from_columns(&[
        f.column(1).cross(&f.column(2)),
        f.column(2).cross(&f.column(0)),
        f.column(0).cross(&f.column(1)),
    ]);
    midpoint_gradients.map(|g| f.determinant() + offset.dot(&(cofactor * g)))
}
