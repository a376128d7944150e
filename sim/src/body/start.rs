//! What a scene starts from: a mesh at rest, from an image or from a mesh file.

use nalgebra::Vector3;
use yawara_mesh::VertexId;
use yawara_mesh::volume::LabelVolume;

use super::axes::ScannerAxes;
use super::image_body::ImageBody;
use super::mesh_file::FileMesh;
use super::organ_box::OrganBox;
use crate::error::SimError;
use crate::scene::Scene;

/// Where the mesh comes from.
pub(crate) enum Origin {
    Image(Box<ImageBody>),
    MeshFile(Box<FileMesh>),
}

/// A mesh at rest, and what tools and regions ask of it.
pub(crate) struct Start {
    /// What its source is called in messages.
    pub name: String,
    pub axes: ScannerAxes,
    pub organ: OrganBox,
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
            name: setup.image_name().into(),
            axes: ScannerAxes::of_grid(setup.volume.grid()),
            organ: setup.organ,
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
            name: mesh.name.clone(),
            axes: ScannerAxes::identity(),
            organ: mesh.organ,
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
        scene.fixed.iter().any(|region| region.contains(&self.organ, x))
    }
}
