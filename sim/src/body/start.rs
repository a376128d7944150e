//! What a scene starts from: a mesh at rest, from an image or from a mesh file.

use nalgebra::Vector3;
use yawara_corot::WeightedPoint;
use yawara_mesh::VertexId;
use yawara_mesh::volume::LabelVolume;

use super::image_body::ImageBody;
use super::material_points;
use super::mesh_file::FileMesh;
use super::organ_box::Zone;
use super::places::Places;
use crate::error::SimError;
use crate::scene::{Scene, SupportHold};

/// κ h²/E of what holds material: its own layer is a tenth of a voxel thick.
const STIFFER: f64 = 100.0;

/// Where the mesh comes from.
pub(crate) enum Origin {
    Image(Box<ImageBody>),
    MeshFile(Box<FileMesh>),
}

/// A mesh at rest, and what tools and regions ask of it.
pub(crate) struct Start {
    /// What its source is called, how it lies, and where its places are.
    pub places: Places,
    /// What `[[fixed]]` holds.
    pub fixed: Vec<Zone>,
    /// Length of a typical element's edge, m.
    pub edge_m: f64,
    pub vertices: Vec<VertexId>,
    /// By vertex number: rest position, m, and whether it touches anything but void.
    pub rest: Vec<Vector3<f64>>,
    pub solid: Vec<bool>,
    pub origin: Origin,
}

impl Start {
    /// Reads the image or the mesh file of a scene and builds what depends on no stage.
    ///
    /// `volume` takes the place of the image.
    pub fn new(scene: &Scene, volume: Option<LabelVolume>) -> Result<Self, SimError> {
        match &scene.mesh.path {
            Some(path) => Ok(Self::of_file(FileMesh::new(scene, path)?)),
            None => Ok(Self::of_image(ImageBody::new(scene, volume)?)),
        }
    }

    fn of_image(mut setup: ImageBody) -> Self {
        let vertices: Vec<VertexId> = setup.forest.vertices().collect();
        let mut rest = vec![Vector3::zeros(); setup.forest.vertex_capacity()];
        for &v in &vertices {
            rest[v.index()] = setup.rest(v);
        }
        Self {
            places: setup.places.clone(),
            fixed: setup.fixed.clone(),
            edge_m: setup.start_edge_m(),
            vertices,
            rest,
            solid: std::mem::take(&mut setup.solid),
            origin: Origin::Image(Box::new(setup)),
        }
    }

    fn of_file(mesh: FileMesh) -> Self {
        let rest = mesh.mesh.points().to_vec();
        Self {
            places: mesh.places.clone(),
            fixed: mesh.fixed.clone(),
            edge_m: mesh.longest_edge_m,
            vertices: (0..rest.len() as u32).map(VertexId).collect(),
            solid: vec![true; rest.len()],
            rest,
            origin: Origin::MeshFile(Box::new(mesh)),
        }
    }

    /// True where a scene region fixes `vertex`.
    pub fn is_fixed(&self, scene: &Scene, vertex: VertexId) -> bool {
        let x = &self.rest[vertex.index()];
        scene.support.hold == SupportHold::Vertices
            && self.fixed.iter().any(|zone| zone.contains(&self.places.organ, x))
    }

    /// The material that fixed region `i` holds: all of it that none before it does.
    pub fn held_by(&self, i: usize) -> Vec<WeightedPoint> {
        let is_first = |point: &WeightedPoint| {
            !self.fixed[..i].iter().any(|zone| zone.contains(&self.places.organ, &point.rest))
        };
        let mut points = self.material_points(&self.fixed[i]);
        points.retain(is_first);
        points
    }

    /// The material in a zone: points with the volumes that they stand for, m³.
    pub fn material_points(&self, zone: &Zone) -> Vec<WeightedPoint> {
        match &self.origin {
            Origin::Image(setup) => {
                material_points::of_volume(&setup.volume, &self.places.organ, zone)
            }
            Origin::MeshFile(mesh) => mesh.material_points(zone),
        }
    }

    /// How many voxels of the material are in a zone but in none of `others`; of a mesh file none is known.
    pub fn voxels_in(&self, zone: &Zone, others: &[Zone]) -> Option<usize> {
        let Origin::Image(setup) = &self.origin else { return None };
        let organ = &self.places.organ;
        Some(material_points::count_voxels(&setup.volume, organ, zone, others))
    }

    /// All of it.
    pub fn all_material(&self) -> Vec<WeightedPoint> {
        self.material_points(&Zone::Box { min: [0.0; 3], max: [1.0; 3] })
    }

    /// The point of the material nearest to `x`, and how far it may be for `x` to stand for it: the
    /// edge of a voxel, of a mesh file a thousandth of an element's, m.
    pub fn nearest_material(&self, x: &Vector3<f64>) -> (Option<Vector3<f64>>, f64) {
        match &self.origin {
            Origin::Image(setup) => {
                let voxel = setup.volume.grid().spacing_mm * 1e-3;
                (material_points::nearest_of_volume(&setup.volume, x), voxel)
            }
            Origin::MeshFile(mesh) => {
                (material_points::nearest_of_mesh(&mesh.mesh, x), 1e-3 * self.edge_m)
            }
        }
    }

    /// The κ of a support or a pad that a scene does not give: 100 E/h², E of the softest material
    /// and h the edge of a voxel (of a mesh file: a quarter of an element's), N/m⁴.
    pub fn holding_stiffness(&self, scene: &Scene) -> f64 {
        let fine = match &self.origin {
            Origin::Image(setup) => setup.volume.grid().spacing_mm * 1e-3,
            Origin::MeshFile(_) => 0.25 * self.edge_m,
        };
        let moduli = scene.materials.iter().map(|material| material.young_modulus_pa);
        STIFFER * moduli.fold(f64::INFINITY, f64::min) / (fine * fine)
    }
}
