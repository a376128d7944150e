//! `load`: a dead load on material, on a part of the surface or on a point.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::at_rest::BodyAtRest;
use super::path::around;
use super::surface_points::SurfacePoints;
use super::tool::Tool;
use crate::body::{BodyState, ScannerAxes};
use crate::error::SimError;
use crate::scene::{LoadEntry, LoadKey};

/// The least radius of gyration of points that can bear a torque, as a part of the largest.
const FLAT: f64 = 1e-4;

/// Forces f_a = Σ w_f λ_a(X_f) t_f on vertices, t_f = q + ω × (X_f − c), over points f of the fine
/// body whose weights w_f do not know the mesh; c is their weighted mean.
///
/// Their sum is F = q Σ w and their torque at rest about c is I ω, I = Σ w (r² 1 − r rᵀ), on every
/// mesh alike: Σ λ_a = 1 and Σ λ_a X_a = X_f. Forces stay as they are when the body moves, a dead
/// load: then the torque is no longer that of rest.
pub(super) struct Load {
    /// The key of its place and the image or mesh, for messages.
    key: String,
    image: String,
    axes: ScannerAxes,
    keys: Vec<LoadKey>,
    points: SurfacePoints,
    /// Volumes, m³, or areas, m², by point.
    weights: Vec<f64>,
    spread: Spread,
}

/// How a load lies on the vertices of the mesh as it is.
#[derive(Default)]
struct Spread {
    /// Σ w.
    weight: f64,
    /// c, m.
    centre: Vector3<f64>,
    /// I⁻¹; none of points on a line.
    flexibility: Option<Matrix3<f64>>,
    /// By vertex number Σ w λ_a and Σ w λ_a (X_f − c).
    shares: BTreeMap<usize, (f64, Vector3<f64>)>,
}

impl Load {
    pub fn new(entry: &LoadEntry, key: &str, body: &mut BodyAtRest<'_>) -> Result<Self, SimError> {
        // Points of the material lie in its tetrahedra, up to rounding.
        let bound_to = |rest, body: &BodyAtRest<'_>| {
            SurfacePoints::new(rest, Vec::new(), 1e-6 * body.edge_m())
        };
        let is_traction = entry.load.iter().any(|at| at.traction_pa.is_some());
        let (points, weights) = match (entry.at_mm, &entry.region) {
            (Some(at_mm), _) => (bound_to(vec![body.material_at(key, at_mm)?], body), vec![1.0]),
            (None, Some(region)) if is_traction => {
                let points = body.surface_patch(key, region)?;
                let weights = (0..points.len()).map(|i| points.area(i).norm()).collect();
                (points, weights)
            }
            (None, Some(region)) => {
                let material = body.material_inside(key, region)?;
                let rest = material.iter().map(|point| point.rest).collect();
                (bound_to(rest, body), material.iter().map(|point| point.weight).collect())
            }
            (None, None) => {
                let (place, key) = (body.name().into(), format!("{key}.region"));
                return Err(SimError::MissingKey { place, key, want: "a region, or at_mm".into() });
            }
        };
        Ok(Self {
            key: format!("{key}.{}", if entry.region.is_some() { "region" } else { "at_mm" }),
            image: body.name().into(),
            axes: body.axes(),
            keys: entry.load.clone(),
            points,
            weights,
            spread: Spread::default(),
        })
    }

    /// What `of` the keys is at time `t`, in solver axes: linear between keys, held at both ends.
    fn at(&self, t: f64, of: impl Fn(&LoadKey) -> Option<[f64; 3]>) -> Vector3<f64> {
        let given = |key: &LoadKey| of(key).map_or_else(Vector3::zeros, Vector3::from);
        let now = around(&self.keys, |key| key.time_s, t)
            .map_or_else(Vector3::zeros, |(a, b, s)| given(a).lerp(&given(b), s));
        self.axes.to_solver_direction(&now)
    }

    fn refused(&self, value: &str, want: &str) -> SimError {
        SimError::value(&self.image, &self.key, value, want)
    }
}

impl Tool for Load {
    fn kind(&self) -> &'static str {
        "load"
    }

    fn reference(&self, _: f64) -> Vector3<f64> {
        self.spread.centre
    }

    fn follow(&mut self, body: &BodyState) -> Result<(), SimError> {
        self.points.bind(body);
        self.spread = Spread::new(&self.points, &self.weights, body);
        if self.spread.shares.is_empty() {
            let want = "material of a part that is kept";
            return Err(self.refused("in parts that are left out", want));
        }
        let has_torque = self.keys.iter().any(|key| key.torque_n_m.is_some());
        if has_torque && self.spread.flexibility.is_none() {
            let want = "voxels off one line, to bear torque_n_m";
            return Err(self.refused("one of voxels on a line", want));
        }
        Ok(())
    }

    fn unbind(&mut self) {
        self.points.unbind();
    }

    fn add_loads(&self, _: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        let Spread { weight, flexibility, shares, .. } = &self.spread;
        let even = self.at(t, |key| key.force_n) / *weight + self.at(t, |key| key.traction_pa);
        let turn = flexibility.unwrap_or_default() * self.at(t, |key| key.torque_n_m);
        for (&v, (share, arm)) in shares {
            loads[v] += *share * even + turn.cross(arm);
        }
    }
}

impl Spread {
    /// That of `points`, as the mesh of `body` carries them. Cost: O(points).
    fn new(points: &SurfacePoints, weights: &[f64], body: &BodyState) -> Self {
        let rest = body.rest_positions();
        let bound = |&i: &usize| Some((points.point(i)?, weights[i]));
        let first = points.order().first().and_then(bound);
        let near = first.map_or_else(Vector3::zeros, |(point, _)| point.position(rest));
        let mut shares: BTreeMap<usize, (f64, Vector3<f64>)> = BTreeMap::new();
        for (_, members) in points.groups() {
            let (mut corners, mut of_tet) = ([0; 4], [(0.0, Vector3::zeros()); 4]);
            for (point, w) in members.iter().filter_map(bound) {
                corners = point.vertices;
                let arm = point.position(rest) - near;
                for ((share, moment), lambda) in of_tet.iter_mut().zip(point.weights) {
                    *share += w * lambda;
                    *moment += w * lambda * arm;
                }
            }
            for (v, (share, moment)) in corners.into_iter().zip(of_tet) {
                let sum = shares.entry(v).or_default();
                *sum = (sum.0 + share, sum.1 + moment);
            }
        }
        // Sums over vertices are exact for the forces there, whatever was rounded before.
        let weight: f64 = shares.values().map(|(share, _)| share).sum();
        let off = shares.values().map(|(_, moment)| moment).sum::<Vector3<f64>>() / weight;
        shares.values_mut().for_each(|(share, moment)| *moment -= *share * off);
        let centre = near + off;
        // Σ w r rᵀ, since Σ λ_a (X_a − c) = r.
        let second: Matrix3<f64> =
            shares.iter().map(|(&v, (_, moment))| (rest[v] - centre) * moment.transpose()).sum();
        let inertia = Matrix3::identity() * second.trace() - second;
        let axes = inertia.symmetric_eigenvalues();
        let can_turn = axes.min() > FLAT * FLAT * axes.max();
        let flexibility = if can_turn { inertia.try_inverse() } else { None };
        Self { weight, centre, flexibility, shares }
    }
}
