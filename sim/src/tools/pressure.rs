//! `pressure`: a pressure on a patch of the surface.

use nalgebra::{Matrix3, Vector3};

use super::at_rest::BodyAtRest;
use super::path::around;
use super::surface_points::SurfacePoints;
use super::tool::Tool;
use crate::body::BodyState;
use crate::error::SimError;
use crate::scene::{Normal, PressureEntry, PressureKey};

/// f_v = −p(t) Σ w_v a over the patch's pieces, a their area vectors outward: those at rest
/// (`dead`), or a = cof(F) A with F the deformation gradient of the piece's coarse tetrahedron
/// (`following`; Nanson's formula).
pub(super) struct Pressure {
    centre: Vector3<f64>,
    keys: Vec<PressureKey>,
    normal: Normal,
    surface_points: SurfacePoints,
}

impl Pressure {
    pub fn new(
        entry: &PressureEntry,
        key: &str,
        body: &mut BodyAtRest<'_>,
    ) -> Result<Self, SimError> {
        let zone = body.places().zone(&entry.region, &format!("{key}.region"))?;
        Ok(Self {
            centre: zone.centre(&body.places().organ),
            keys: entry.pressure.clone(),
            normal: entry.normal,
            surface_points: body.surface_patch(key, &entry.region)?,
        })
    }

    /// p(t), Pa: linear between keys, held at both ends.
    fn pressure(&self, t: f64) -> f64 {
        around(&self.keys, |key| key.time_s, t)
            .map_or(0.0, |(a, b, s)| a.pressure_pa + s * (b.pressure_pa - a.pressure_pa))
    }
}

impl Tool for Pressure {
    fn kind(&self) -> &'static str {
        "pressure"
    }

    fn reference(&self, _: f64) -> Vector3<f64> {
        self.centre
    }

    fn surface_points(&self) -> Option<&SurfacePoints> {
        Some(&self.surface_points)
    }

    fn surface_points_mut(&mut self) -> Option<&mut SurfacePoints> {
        Some(&mut self.surface_points)
    }

    fn add_loads(&self, body: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        let pressure = self.pressure(t);
        for (tet, range) in self.surface_points.groups() {
            let Some(element) = body.element(*tet) else { continue };
            let turn = match self.normal {
                Normal::Dead => Matrix3::identity(),
                Normal::Following => cofactor(&element.deformation_gradient(body.positions())),
            };
            for &i in &self.surface_points.order()[range.clone()] {
                let Some(point) = self.surface_points.point(i) else { continue };
                let force = turn * self.surface_points.area(i) * -pressure;
                for (&v, weight) in point.vertices.iter().zip(point.weights) {
                    loads[v] += weight * force;
                }
            }
        }
    }
}

/// cof F = det(F) F⁻ᵀ, finite where F is flat.
fn cofactor(f: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[
        f.column(1).cross(&f.column(2)),
        f.column(2).cross(&f.column(0)),
        f.column(0).cross(&f.column(1)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cofactor_is_that_of_the_inverse() {
        let f = Matrix3::new(1.1, 0.2, -0.1, 0.0, 0.9, 0.3, 0.05, 0.1, 1.2);
        let want = f.try_inverse().unwrap().transpose() * f.determinant();
        assert!((cofactor(&f) - want).amax() < 1e-14);
    }
}
