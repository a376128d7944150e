//! The deformed mesh as arrays for output.

use nalgebra::{Matrix6, Vector3};
use yawara_embed::Strain;
use yawara_mesh::TetId;
use yawara_mesh::geometry::signed_volume;

use super::records::Frame;
use crate::body::{BodyState, ScannerAxes};

/// The current state in scanner coordinates, vertices and tetrahedra by ascending number.
/// `indicator`: the last measurement by tetrahedron, if the mesh is one that refines.
pub(crate) fn capture(
    state: &BodyState,
    axes: &ScannerAxes,
    indicator: Option<&dyn Fn(TetId) -> f64>,
    time_s: f64,
) -> Frame {
    let mut frame = Frame { time_s, ..Frame::default() };
    let mut number = vec![0u32; state.vertex_capacity()];
    for v in state.vertices() {
        number[v.index()] = frame.points_mm.len() as u32;
        let (rest, now) = (state.rest[v.index()], state.positions[v.index()]);
        frame.points_mm.push(axes.to_ras_mm(&now).into());
        frame.displacement_mm.push(axes.to_ras_direction(&((now - rest) * 1e3)).into());
    }
    for (of_body, element) in state.elements_by_number() {
        let mut corners = element.vertices;
        if signed_volume(&corners.map(|v| state.rest[v])) < 0.0 {
            corners.swap(2, 3);
        }
        let cell = state.cell(element.tet);
        frame.tets.push(corners.map(|v| number[v]));
        frame.level.push(cell.level);
        frame.label.push(cell.label);
        frame.young_modulus_pa.push(isotropic_part(&element.elasticity));
        let stress = state.body.stress_without_pressure(of_body, &state.positions);
        frame.von_mises_pa.push(von_mises(&stress));
        frame.plastic_strain.extend(state.body.plastic_strain(of_body));
        frame.dissipated_j_m3.extend(state.body.dissipated(of_body));
        frame.indicator.extend(indicator.map(|measured| measured(element.tet)));
    }
    frame
}

/// Young's modulus of the isotropic matrix nearest in energy (Voigt average) to D, Pa.
fn isotropic_part(d: &Matrix6<f64>) -> f64 {
    let normal = d[(0, 0)] + d[(1, 1)] + d[(2, 2)];
    let mixed = d[(0, 1)] + d[(1, 2)] + d[(0, 2)];
    let shear = d[(3, 3)] + d[(4, 4)] + d[(5, 5)];
    let bulk = (normal + 2.0 * mixed) / 9.0;
    let shear_modulus = (normal - mixed + 3.0 * shear) / 15.0;
    9.0 * bulk * shear_modulus / (3.0 * bulk + shear_modulus)
}

pub(crate) fn von_mises(s: &Strain) -> f64 {
    let normal = Vector3::new(s[0] - s[1], s[1] - s[2], s[2] - s[0]).norm_squared();
    let shear = Vector3::new(s[3], s[4], s[5]).norm_squared();
    (0.5 * normal + 3.0 * shear).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara_embed::isotropic;

    #[test]
    fn isotropic_material_gives_its_own_modulus() {
        assert!((isotropic_part(&isotropic(5e3, 0.45)) - 5e3).abs() < 1e-8);
    }

    #[test]
    fn von_mises_of_tension_and_shear() {
        assert_eq!(von_mises(&Strain::new(7.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 7.0);
        assert_eq!(von_mises(&Strain::repeat(0.0)), 0.0);
        let shear = von_mises(&Strain::new(0.0, 0.0, 0.0, 2.0, 0.0, 0.0));
        assert!((shear - 2.0 * 3f64.sqrt()).abs() < 1e-15);
        assert_eq!(von_mises(&Strain::new(4.0, 4.0, 4.0, 0.0, 0.0, 0.0)), 0.0, "pressure");
    }
}
