//! `pressure`: a pressure on a patch of the surface.

use nalgebra::Vector3;
use yawara_corot::{Element, Following};

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

    /// The elements that carry the patch, with the forces on their corners at rest, N.
    fn at_rest<'a>(
        &'a self,
        body: &'a BodyState,
        t: f64,
    ) -> impl Iterator<Item = (&'a Element, [Vector3<f64>; 4])> {
        let pressure = self.pressure(t);
        let points = &self.surface_points;
        points.groups().filter_map(move |(tet, members)| {
            let mut at_rest = [Vector3::zeros(); 4];
            for &i in members {
                let Some(point) = points.point(i) else { continue };
                let force = points.area(i) * -pressure;
                at_rest.iter_mut().zip(point.weights).for_each(|(sum, w)| *sum += w * force);
            }
            Some((body.element(tet)?, at_rest))
        })
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
        for (element, at_rest) in self.at_rest(body, t) {
            match self.normal {
                Normal::Following => {
                    Following::new(element, at_rest).add_forces(body.positions(), loads);
                }
                Normal::Dead => {
                    element.vertices.iter().zip(at_rest).for_each(|(&v, force)| loads[v] += force);
                }
            }
        }
    }

    fn following(&self, body: &BodyState, t: f64) -> Vec<Following> {
        if self.normal == Normal::Dead || self.pressure(t) == 0.0 {
            return Vec::new();
        }
        self.at_rest(body, t).map(|(element, at_rest)| Following::new(element, at_rest)).collect()
    }
}
