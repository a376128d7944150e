//! The body at rest, as tools see it when they are made.

use nalgebra::Vector3;
use yawara_corot::WeightedPoint;
use yawara_mesh::VertexId;

use super::surface_points::SurfacePoints;
use super::surface_source::SurfaceSource;
use crate::body::{Hold, Origin, Places, ScannerAxes, Start, Zone};
use crate::error::SimError;
use crate::scene::{GrabEntry, Region, Scene};

/// The start mesh and the surface of a body before anything moves.
///
/// All positions are in solver axes, m.
pub struct BodyAtRest<'a> {
    scene: &'a Scene,
    start: &'a Start,
    surface: SurfaceSource<'a>,
    /// By vertex number.
    holds: Vec<Hold>,
    /// What grabs have taken so far, with their keys, and from when to when.
    grabbed: Vec<(String, Vec<WeightedPoint>, [f64; 2])>,
}

impl<'a> BodyAtRest<'a> {
    /// The body with its fixed vertices held.
    pub(crate) fn new(scene: &'a Scene, start: &'a Start) -> Self {
        let mut holds = vec![Hold::Free; start.rest.len()];
        for &v in &start.vertices {
            if start.is_fixed(scene, v) {
                holds[v.index()] = Hold::Fixed;
            }
        }
        Self { scene, start, surface: SurfaceSource::new(scene, start), holds, grabbed: Vec::new() }
    }

    /// Gives vertices to a tool.
    pub(crate) fn hold(&mut self, vertices: &[VertexId], tool: usize) {
        for v in vertices {
            self.holds[v.index()] = Hold::Grabbed(tool);
        }
    }

    /// Notes what a grab takes.
    ///
    /// # Errors
    /// [`SimError::Value`] if another one has just that at the same time: they can't both lead it.
    pub(crate) fn grab(&mut self, key: &str, grab: &GrabEntry) -> Result<(), SimError> {
        let points = self.start.material_points(&self.zone(key, &grab.region)?);
        let times = [grab.begin_s.unwrap_or(0.0), grab.release_s.unwrap_or(f64::INFINITY)];
        let is_same = |(_, other, of): &&(String, Vec<WeightedPoint>, [f64; 2])| {
            let mut pairs = points.iter().zip(other);
            let is_at_once = of[0] < times[1] && times[0] < of[1];
            is_at_once && other.len() == points.len() && pairs.all(|(a, b)| a.rest == b.rest)
        };
        match self.grabbed.iter().find(is_same).filter(|_| !points.is_empty()) {
            Some((other, ..)) => {
                let (key, value) = (format!("{key}.region"), format!("that of {other}"));
                let want = "other material: one grab leads what it holds";
                Err(SimError::value(self.name(), &key, value, want))
            }
            None => {
                self.grabbed.push((key.into(), points, times));
                Ok(())
            }
        }
    }

    /// Whether a point lies in the material at rest.
    pub(crate) fn is_inside(&self, x: &Vector3<f64>) -> bool {
        self.start.nearest_material(x).0 == Some(*x)
    }

    /// The mesh that it is of.
    pub(crate) fn start(&self) -> &'a Start {
        self.start
    }

    /// What holds a vertex.
    pub(crate) fn held_by(&self, vertex: VertexId) -> Hold {
        self.holds[vertex.index()]
    }

    /// What holds each vertex, by number.
    pub(crate) fn into_holds(self) -> Vec<Hold> {
        self.holds
    }

    /// Whether the image or its materials have a label; void is one.
    pub(crate) fn has_label(&self, label: i64) -> bool {
        match &self.start.origin {
            Origin::Image(setup) => setup.volume.values().contains(&label),
            Origin::MeshFile(_) => false,
        }
    }

    pub(crate) fn places(&self) -> &Places {
        &self.start.places
    }

    /// The `region` of a tool whose key is `key`.
    pub(super) fn zone(&self, key: &str, region: &Region) -> Result<Zone, SimError> {
        self.places().zone(region, &format!("{key}.region"))
    }

    /// The image or the mesh file, as messages call it.
    pub fn name(&self) -> &str {
        &self.start.places.name
    }

    /// How solver axes lie in the scanner.
    pub fn axes(&self) -> ScannerAxes {
        self.start.places.axes
    }

    /// The point at these fractions of the body's bounding box (right, anterior, superior), m.
    pub fn at(&self, fractions: [f64; 3]) -> Vector3<f64> {
        self.start.places.organ.at(fractions)
    }

    /// Length of a typical element's edge, m.
    pub fn edge_m(&self) -> f64 {
        self.start.edge_m
    }

    /// Where a vertex of the start mesh is, m.
    pub fn position(&self, vertex: VertexId) -> Vector3<f64> {
        self.start.rest[vertex.index()]
    }

    /// The vertices of the start mesh that touch material and that nothing holds yet.
    pub fn available(&self) -> impl Iterator<Item = VertexId> + '_ {
        let is_free =
            |v: &VertexId| self.start.solid[v.index()] && self.holds[v.index()] == Hold::Free;
        self.start.vertices.iter().copied().filter(is_free)
    }

    /// The material in `region`: points with the volumes that they stand for (m³, positions in m);
    /// the nearest one within an element's edge of the region's centre if the region is too small to
    /// have any.
    ///
    /// # Errors
    /// [`SimError::ToolOutside`] with `key` if there is none.
    pub fn material_points(
        &self,
        key: &str,
        region: &Region,
    ) -> Result<Vec<WeightedPoint>, SimError> {
        let zone = self.zone(key, region)?;
        let inside = self.start.material_points(&zone);
        if !inside.is_empty() {
            return Ok(inside);
        }
        let centre = zone.centre(&self.start.places.organ);
        let distance = |point: &WeightedPoint| (point.rest - centre).norm();
        let all = self.start.all_material();
        let nearest = all.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        match nearest {
            Some(point) if distance(&point) <= self.edge_m() => Ok(vec![point]),
            _ => Err(SimError::ToolOutside {
                key: format!("{key}.region"),
                image: self.name().into(),
                distance_mm: nearest.map_or(f64::INFINITY, |point| distance(&point) * 1e3),
                limit_mm: self.edge_m() * 1e3,
            }),
        }
    }

    /// The material in `region`, without the nearest one where there is none.
    ///
    /// # Errors
    /// [`SimError::NoMaterial`] with `key` if there is none.
    pub fn material_inside(
        &self,
        key: &str,
        region: &Region,
    ) -> Result<Vec<WeightedPoint>, SimError> {
        let inside = self.start.material_points(&self.zone(key, region)?);
        match inside.is_empty() {
            false => Ok(inside),
            true => {
                let key = format!("{key}.region");
                Err(SimError::NoMaterial { key, image: self.name().into() })
            }
        }
    }

    /// The point of the material at scanner RAS `at_mm`, or the one nearest to it within the edge of
    /// a voxel, m.
    ///
    /// # Errors
    /// [`SimError::ToolOutside`] with `key` if there is none.
    pub fn material_at(&self, key: &str, at_mm: [f64; 3]) -> Result<Vector3<f64>, SimError> {
        let at = self.axes().to_solver(&Vector3::from(at_mm));
        let (nearest, limit) = self.start.nearest_material(&at);
        let distance = nearest.map_or(f64::INFINITY, |point| (point - at).norm());
        nearest.filter(|_| distance <= limit).ok_or_else(|| SimError::ToolOutside {
            key: format!("{key}.at_mm"),
            image: self.name().into(),
            distance_mm: distance * 1e3,
            limit_mm: limit * 1e3,
        })
    }

    /// The stiffness κ of what holds material so firmly that it hardly gives way, N/m⁴.
    pub fn holding_stiffness_n_m4(&self) -> f64 {
        self.start.holding_stiffness(self.scene)
    }

    /// Length of edges at the finest level that the mesh may come to, m; of a mesh file none is known.
    pub fn finest_edge_m(&self) -> Option<f64> {
        let Origin::Image(setup) = &self.start.origin else { return None };
        Some(setup.edge_m(self.scene.mesh.finest_level()))
    }

    /// Points all over the surface, `spacing_m` or a little more apart where it is smooth.
    ///
    /// # Errors
    /// [`SimError::Surface`] if the surface can't be made.
    pub fn surface_points(&mut self, spacing_m: f64) -> Result<SurfacePoints, SimError> {
        self.surface.points(spacing_m)
    }

    /// The triangles of the surface whose middles lie in `region`: their middles, with their area
    /// vectors.
    ///
    /// # Errors
    /// [`SimError::PatchEmpty`] with `key` if there are none; [`SimError::Surface`] if the surface
    /// can't be made.
    pub fn surface_patch(&mut self, key: &str, region: &Region) -> Result<SurfacePoints, SimError> {
        let zone = self.zone(key, region)?;
        self.surface.patch(key, &zone)
    }
}
