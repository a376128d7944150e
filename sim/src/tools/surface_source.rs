//! Where surface points come from: the outline of all that is not void, or a mesh file's faces.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};

use nalgebra::Vector3;
use yawara_mesh::BisectionForest;
use yawara_mesh::isosurface::{Outline, Outlines};
use yawara_mesh::volume::LabelVolume;

use super::surface_points::SurfacePoints;
use crate::body::{Origin, Start, Zone, cut, solid, surface_level};
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

/// The surface at rest, made when a tool asks.
pub(super) struct SurfaceSource<'a> {
    scene: &'a Scene,
    start: &'a Start,
    /// By the level of the mesh that cuts it; a mesh file has one.
    made: BTreeMap<u8, Triangles>,
}

impl<'a> SurfaceSource<'a> {
    pub fn new(scene: &'a Scene, start: &'a Start) -> Self {
        Self { scene, start, made: BTreeMap::new() }
    }

    /// The triangles of the surface, for points `spacing` (m) apart.
    fn triangles(&mut self, spacing: f64) -> Result<&Triangles, SimError> {
        let level = match &self.start.origin {
            Origin::Image(setup) => level_for(self.scene, &setup.forest, &setup.volume, spacing),
            Origin::MeshFile(_) => 0,
        };
        Ok(match self.made.entry(level) {
            Entry::Occupied(made) => made.into_mut(),
            Entry::Vacant(place) => place.insert(match &self.start.origin {
                Origin::Image(setup) => outline(&setup.forest, &setup.volume, level)?,
                Origin::MeshFile(mesh) => {
                    let faces = mesh.mesh.boundary_faces();
                    Triangles {
                        points: mesh.mesh.points().to_vec(),
                        corners: faces.iter().map(|f| f.map(|v| v as usize)).collect(),
                        off: 1e-6 * self.start.edge_m,
                    }
                }
            }),
        })
    }

    /// Points all over the surface, `spacing` (m) or a little more apart where it is smooth.
    pub fn points(&mut self, spacing: f64) -> Result<SurfacePoints, SimError> {
        let name = self.start.places.name.clone();
        self.triangles(spacing)?.points(&name, spacing)
    }

    /// The triangles whose middles lie in `zone`: their middles with their area vectors.
    pub fn patch(&mut self, key: &str, zone: &Zone) -> Result<SurfacePoints, SimError> {
        let (organ, name) = (self.start.places.organ, self.start.places.name.clone());
        let Triangles { points, corners, off } = self.triangles(0.0)?;
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

impl Triangles {
    /// Points all over them, `spacing` (m) or a little more apart where they are smooth.
    fn points(&self, name: &str, spacing: f64) -> Result<SurfacePoints, SimError> {
        let Self { points, corners, off } = self;
        let area: f64 = corners.iter().map(|face| area(&face.map(|i| points[i])).norm()).sum();
        let least = (area / MOST_POINTS).sqrt();
        if spacing < least {
            let key = "spacing_m (a quarter of radius_m if absent)";
            let want = format!("at least {least:.3e}: {MOST_POINTS} points on {area:.3e} m²");
            return Err(SimError::value(name, key, format!("{spacing:e}"), want));
        }
        let mut kept = Thinned::new(spacing);
        for face in corners {
            kept.cover(&face.map(|i| points[i]));
        }
        Ok(SurfacePoints::new(kept.points, Vec::new(), *off))
    }
}

/// Points of the outline of all that is not void in `volume`, which has the grid of the labels of `forest`.
///
/// # Errors
/// As [`SurfaceSource::points`].
pub(crate) fn points_of(
    scene: &Scene,
    forest: &BisectionForest,
    volume: &LabelVolume,
    spacing: f64,
) -> Result<SurfacePoints, SimError> {
    let level = level_for(scene, forest, volume, spacing);
    outline(forest, volume, level)?.points(&scene.name, spacing)
}

/// The area vector of a triangle.
fn area([a, b, c]: &[Vector3<f64>; 3]) -> Vector3<f64> {
    0.5 * (b - a).cross(&(c - a))
}

/// Edges of the mesh that cuts a surface on `level`, voxels.
fn edge_voxels(forest: &BisectionForest, level: u8) -> f64 {
    forest.tree().grid().voxels_per_cell as f64 / f64::from(level / 3).exp2()
}

/// The level of the surfaces, or a coarser one whose edges are still no longer than half of `spacing`, m.
fn level_for(scene: &Scene, forest: &BisectionForest, volume: &LabelVolume, spacing: f64) -> u8 {
    let voxel = volume.grid().spacing_mm * 1e-3;
    let mut level = surface_level(scene, forest);
    while level >= scene.mesh.finest_level() + 3
        && edge_voxels(forest, level - 3) * voxel <= 0.5 * spacing
    {
        level -= 3;
    }
    level
}

/// The outline of all labels together.
fn outline(
    forest: &BisectionForest,
    volume: &LabelVolume,
    level: u8,
) -> Result<Triangles, SimError> {
    let volume = solid(volume)?;
    // Without a blur of half an edge the surface has stairs.
    let sigma_voxels = (0.5 * edge_voxels(forest, level)).max(SIGMA_VOXELS);
    let asked = [Outline { label: 1, sigma_voxels }];
    let Outlines { rest, surfaces, .. } = cut(forest, &volume, level, &asked)?;
    Ok(Triangles {
        points: surfaces[0].positions(&rest)?,
        corners: surfaces[0].triangles.iter().map(|t| t.map(|i| i as usize)).collect(),
        off: volume.grid().spacing_mm * 1e-3 * edge_voxels(forest, level).max(1.0),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_file;

    #[test]
    fn a_surface_for_points_far_apart_is_coarser_and_nearly_the_same() {
        let (scene, _) = scene_file::load("liver", &["mesh.max_level=0".into()]).unwrap();
        let start = Start::new(&scene, None).unwrap();
        let mut source = SurfaceSource::new(&scene, &start);
        let mut measured = |spacing: f64| {
            let Triangles { points, corners, off } = source.triangles(spacing).unwrap();
            let area: f64 = corners.iter().map(|f| area(&f.map(|i| points[i])).norm()).sum();
            let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
            (corners.len(), area, middle, *off)
        };
        // Voxels of 2 mm.
        let (count, area, middle, off) = measured(0.0);
        assert_eq!(measured(7.9e-3).0, count);
        let (coarse, coarse_area, coarse_middle, coarse_off) = measured(8e-3);
        assert!(3 * coarse < count, "{coarse} of {count}");
        assert!((coarse_area / area - 1.0).abs() < 0.03, "{coarse_area} of {area}");
        assert!((coarse_middle - middle).norm() < 2e-3, "{coarse_middle} {middle}");
        assert_eq!((off, coarse_off), (2e-3, 4e-3));
        assert_eq!(source.made.len(), 2);
    }
}
