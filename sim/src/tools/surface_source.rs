//! Where surface points come from: the outline of all that is not void, or a mesh file's faces.

use std::collections::HashMap;

use nalgebra::Vector3;
use yawara_mesh::isosurface::{Outline, Outlines};

use super::surface_points::SurfacePoints;
use crate::body::{ImageBody, Origin, Start, Zone, cut, solid, surface_level};
use crate::error::SimError;
use crate::scene::Scene;

/// Width of the blur that takes the stairs off voxels, voxels.
const SIGMA_VOXELS: f64 = 1.0;

/// The most points of a surface: some 100 MB.
const MOST_POINTS: f64 = 1e6;

/// Points of a regular grid of the spacing are not too near for rounding.
const NEARER: f64 = 1.0 - 1e-9;

/// A surface with vertices, m, and corners counter-clockwise as seen from outside.
struct Triangles {
    points: Vec<Vector3<f64>>,
    corners: Vec<[usize; 3]>,
    /// How far it may lie off the material, m.
    off: f64,
}

/// The surface at rest, made when the first tool asks.
pub(super) struct SurfaceSource<'a> {
    scene: &'a Scene,
    start: &'a Start,
    triangles: Option<Triangles>,
}

impl<'a> SurfaceSource<'a> {
    pub fn new(scene: &'a Scene, start: &'a Start) -> Self {
        Self { scene, start, triangles: None }
    }

    fn triangles(&mut self) -> Result<&Triangles, SimError> {
        let made = match self.triangles.take() {
            Some(made) => made,
            None => match &self.start.origin {
                Origin::Image(setup) => outline(self.scene, setup)?,
                Origin::MeshFile(mesh) => Triangles {
                    points: mesh.mesh.points().to_vec(),
                    corners: mesh
                        .mesh
                        .boundary_faces()
                        .iter()
                        .map(|f| f.map(|v| v as usize))
                        .collect(),
                    off: 1e-6 * self.start.edge_m,
                },
            },
        };
        Ok(self.triangles.insert(made))
    }

    /// Points all over the surface, `spacing` (m) or a little more apart where it is smooth.
    pub fn points(&mut self, spacing: f64) -> Result<SurfacePoints, SimError> {
        let name = self.start.places.name.clone();
        let Triangles { points, corners, off } = self.triangles()?;
        let area: f64 = corners.iter().map(|face| area(&face.map(|i| points[i])).norm()).sum();
        let least = (area / MOST_POINTS).sqrt();
        if spacing < least {
            let key = "spacing_m (a quarter of radius_m if absent)";
            let want = format!("at least {least:.3e}: {MOST_POINTS} points on {area:.3e} m²");
            return Err(SimError::value(&name, key, format!("{spacing:e}"), want));
        }
        let mut kept = Thinned::new(spacing);
        for face in corners {
            kept.cover(&face.map(|i| points[i]));
        }
        Ok(SurfacePoints::new(kept.points, Vec::new(), *off))
    }

    /// The triangles whose middles lie in `zone`: their middles with their area vectors.
    pub fn patch(&mut self, key: &str, zone: &Zone) -> Result<SurfacePoints, SimError> {
        let (organ, name) = (self.start.places.organ, self.start.places.name.clone());
        let Triangles { points, corners, off } = self.triangles()?;
        let (mut middles, mut areas) = (Vec::new(), Vec::new());
        for face in corners {
            let corners = face.map(|i| points[i]);
            let middle = corners.iter().sum::<Vector3<f64>>() / 3.0;
            if zone.contains(&organ, &middle) {
                middles.push(middle);
                areas.push(area(&corners));
            }
        }
        if middles.is_empty() {
            return Err(SimError::PatchEmpty { key: format!("{key}.region"), image: name });
        }
        Ok(SurfacePoints::new(middles, areas, *off))
    }
}

/// The area vector of a triangle.
fn area([a, b, c]: &[Vector3<f64>; 3]) -> Vector3<f64> {
    0.5 * (b - a).cross(&(c - a))
}

/// The outline of all labels together.
fn outline(scene: &Scene, setup: &ImageBody) -> Result<Triangles, SimError> {
    let (volume, level) = (solid(&setup.volume)?, surface_level(scene, setup));
    let asked = [Outline { label: 1, sigma_voxels: SIGMA_VOXELS }];
    let Outlines { rest, surfaces, .. } = cut(&setup.forest, &volume, level, &asked)?;
    Ok(Triangles {
        points: surfaces[0].positions(&rest)?,
        corners: surfaces[0].triangles.iter().map(|t| t.map(|i| i as usize)).collect(),
        off: volume.grid().spacing_mm * 1e-3,
    })
}

/// Points no two of which are nearer than a distance.
struct Thinned {
    spacing: f64,
    points: Vec<Vector3<f64>>,
    /// By cubes of that edge.
    cells: HashMap<[i64; 3], Vec<usize>>,
}

impl Thinned {
    fn new(spacing: f64) -> Self {
        Self { spacing, points: Vec::new(), cells: HashMap::new() }
    }

    /// Takes a point that is far enough from all others.
    fn offer(&mut self, x: &Vector3<f64>) {
        let cell = |x: f64| (x / self.spacing).floor() as i64;
        let at = [cell(x.x), cell(x.y), cell(x.z)];
        for offset in 0..27 {
            let near = [at[0] + offset % 3 - 1, at[1] + offset / 3 % 3 - 1, at[2] + offset / 9 - 1];
            let others = self.cells.get(&near).map_or(&[][..], |list| list);
            if others.iter().any(|&i| (self.points[i] - x).norm() < NEARER * self.spacing) {
                return;
            }
        }
        self.cells.entry(at).or_default().push(self.points.len());
        self.points.push(*x);
    }

    /// Offers points of a triangle whose edges are longer than the spacing.
    fn cover(&mut self, [a, b, c]: &[Vector3<f64>; 3]) {
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        // Far above what an image or a mesh needs, and no more than memory holds.
        let parts = (longest / self.spacing).ceil().clamp(1.0, 256.0) as usize;
        for i in 0..=parts {
            for j in 0..=parts - i {
                let (s, t) = (i as f64 / parts as f64, j as f64 / parts as f64);
                self.offer(&(a + (b - a) * s + (c - a) * t));
            }
        }
    }
}
