//! Scenes on a mesh from a file: tetrahedra as they are, one material each, no refinement.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Matrix3;
use yawara_corot::{Body, Element, WeightedPoint};
use yawara_embed::{LinearTet, Material};
use yawara_mesh::tet_file::LoadedMesh;
use yawara_mesh::{PlainMesh, TetId, VertexId};

use super::axes::ScannerAxes;
use super::components::spans_a_plane;
use super::material_points::of_mesh;
use super::memory::Memory;
use super::organ_box::{OrganBox, Zone};
use super::places::Places;
use super::state::{BodyState, Cell, Hold};
use crate::error::SimError;
use crate::scene::Scene;

/// A mesh from a file with a material per tetrahedron.
pub(crate) struct FileMesh {
    /// What was read and repaired, in words.
    pub done: String,
    pub places: Places,
    /// What `[[fixed]]` holds.
    pub fixed: Vec<Zone>,
    pub longest_edge_m: f64,
    pub excluded_components: usize,
    pub excluded_tets: usize,
    pub mesh: PlainMesh,
    /// By tag: position in the scene, and material.
    pub materials: BTreeMap<i64, (usize, Material)>,
}

impl FileMesh {
    /// Reads the mesh, leaves out parts that nothing holds and finds every tag's material.
    pub fn new(scene: &Scene, path: &Path) -> Result<Self, SimError> {
        let unit_m = scene.mesh.unit_m;
        let loaded = read(path, unit_m)?;
        let name = path.display().to_string();
        let organ = bounding_box(&loaded.mesh);
        let axes = ScannerAxes::identity();
        let places = Places { name: name.clone(), organ, axes, voxels: None };
        let fixed = places.fixed(scene)?;
        let done = describe(&loaded, unit_m);
        let (mesh, excluded_components, excluded_tets) =
            held_parts(scene, &places, &fixed, loaded.mesh)?;
        let (count, limit) = (mesh.points().len(), scene.mesh.max_vertices);
        if count > limit {
            return Err(SimError::TooManyVertices { count, limit });
        }
        let materials = materials(scene, &name, &mesh)?;
        let mut longest_edge_m: f64 = 0.0;
        for tet in 0..mesh.tets().len() {
            let x = mesh.corners(tet);
            for i in 0..4 {
                for j in 0..i {
                    longest_edge_m = longest_edge_m.max((x[i] - x[j]).norm());
                }
            }
        }
        Ok(Self {
            done,
            places,
            fixed,
            longest_edge_m,
            excluded_components,
            excluded_tets,
            mesh,
            materials,
        })
    }

    /// Its material in a region: points with the volumes that they stand for, m³.
    pub fn material_points(&self, zone: &Zone) -> Vec<WeightedPoint> {
        of_mesh(&self.mesh, &self.places.organ, zone, 0.25 * self.longest_edge_m)
    }

    /// The mesh at rest, of the elements of an empty `body`. `holds` is by vertex number.
    pub fn state(&self, holds: &[Hold], body: Body, memory: Option<&Memory>) -> BodyState {
        let mut state = BodyState::new(body);
        for (i, &x) in self.mesh.points().iter().enumerate() {
            state.add_vertex(VertexId(i as u32), x, x, holds[i]);
        }
        for (i, (corners, tag)) in self.mesh.tets().iter().zip(self.mesh.tags()).enumerate() {
            let (position, material) = &self.materials[tag];
            let (elasticity, made_of) = match memory {
                Some(memory) => memory.alone(*position, material),
                None => (material.elasticity(), Vec::new()),
            };
            let element = Element {
                tet: TetId(i as u32),
                vertices: corners.map(|v| v as usize),
                geometry: LinearTet::new(&self.mesh.corners(i)),
                elasticity,
            };
            let density_kg_m3 = material.density_kg_m3();
            let cell = Cell { level: 0, label: *tag, density_kg_m3, is_void: false };
            state.add_tet(element, &Matrix3::identity(), cell, &made_of);
        }
        state
    }
}

/// The file by the extension of its name.
#[cfg_attr(not(any(feature = "gmsh", feature = "vtu")), expect(unused_variables))]
fn read(path: &Path, unit_m: f64) -> Result<LoadedMesh, SimError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        #[cfg(feature = "gmsh")]
        "msh" => Ok(yawara_mesh::tet_file::read_msh(path, unit_m)?),
        #[cfg(not(feature = "gmsh"))]
        "msh" => Err(SimError::FeatureMissing(path.display().to_string(), "gmsh")),
        #[cfg(feature = "vtu")]
        "vtu" => Ok(yawara_mesh::tet_file::read_vtu(path, unit_m)?),
        #[cfg(not(feature = "vtu"))]
        "vtu" => Err(SimError::FeatureMissing(path.display().to_string(), "vtu")),
        _ => {
            let name = format!("{:?}", path.file_name().unwrap_or_default());
            let want = "a name that ends in .msh (Gmsh) or .vtu (VTK)";
            Err(SimError::value(&path.display().to_string(), "mesh.path", name, want))
        }
    }
}

fn describe(loaded: &LoadedMesh, unit_m: f64) -> String {
    let LoadedMesh { mesh, repairs, ignored_elements, .. } = loaded;
    let (points, tets) = (mesh.points().len(), mesh.tets().len());
    let mut words = format!("{points} vertices, {tets} tetrahedra, {unit_m} m per unit");
    for (count, what) in [
        (repairs.rewound, "tetrahedra of negative volume rewound"),
        (repairs.dropped_points, "points of no tetrahedron dropped"),
        (*ignored_elements, "other elements passed over"),
    ] {
        if count > 0 {
            words += &format!("; {count} {what}");
        }
    }
    words
}

fn bounding_box(mesh: &PlainMesh) -> OrganBox {
    let first = mesh.points()[0];
    let points = mesh.points().iter();
    let (low, high) = points.fold((first, first), |(low, high), x| (low.inf(x), high.sup(x)));
    OrganBox { low, high }
}

/// Parts that hang together by faces but that no fixed region holds are taken out and counted.
fn held_parts(
    scene: &Scene,
    Places { name, organ, .. }: &Places,
    fixed: &[Zone],
    mesh: PlainMesh,
) -> Result<(PlainMesh, usize, usize), SimError> {
    let is_fixed = |x| fixed.iter().any(|zone| zone.contains(organ, x));
    let fixed: Vec<bool> = mesh.points().iter().map(is_fixed).collect();
    let components = mesh.components();
    let (mut kept, mut excluded) = (Vec::new(), 0);
    for component in &components {
        let corners = component.iter().flat_map(|&tet| mesh.tets()[tet]);
        let mut held: Vec<u32> = corners.filter(|&v| fixed[v as usize]).collect();
        held.sort_unstable();
        held.dedup();
        let held: Vec<_> = held.iter().map(|&v| mesh.points()[v as usize]).collect();
        // With inertia nothing need be held.
        if scene.dynamics.is_some() || spans_a_plane(&held) {
            kept.extend_from_slice(component);
        } else {
            excluded += 1;
        }
    }
    if kept.is_empty() {
        return Err(SimError::MeshNotFixed(name.clone()));
    }
    if excluded == 0 {
        return Ok((mesh, 0, 0));
    }
    kept.sort_unstable();
    let excluded_tets = mesh.tets().len() - kept.len();
    tracing::warn!(
        "{excluded} part(s) of {name} ({excluded_tets} tetrahedra) are not held by a fixed \
         region and left out"
    );
    let tets = kept.iter().map(|&tet| mesh.tets()[tet]).collect();
    let tags = kept.iter().map(|&tet| mesh.tags()[tet]).collect();
    let (mesh, _) = PlainMesh::new(mesh.points().to_vec(), tets, tags)?;
    Ok((mesh, excluded, excluded_tets))
}

/// The material of every tag that occurs.
fn materials(
    scene: &Scene,
    name: &str,
    mesh: &PlainMesh,
) -> Result<BTreeMap<i64, (usize, Material)>, SimError> {
    let mut counts: BTreeMap<i64, u64> = BTreeMap::new();
    for tag in mesh.tags() {
        *counts.entry(*tag).or_default() += 1;
    }
    let mut materials = BTreeMap::new();
    for (tag, count) in counts {
        let Some(position) = scene.material_of(tag) else {
            return Err(SimError::TagWithoutMaterial(tag, name.into(), count));
        };
        materials.insert(tag, (position, scene.materials[position].material()?));
    }
    Ok(materials)
}
