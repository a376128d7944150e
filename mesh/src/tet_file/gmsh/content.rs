//! What the sections of an MSH file hold, until all of them are known.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use nalgebra::Vector3;

use super::element::Element;
use super::scanner::Scanner;
use crate::tet_file::TetMeshError;
use crate::tet_file::mesh::{LoadedMesh, PlainMesh};

/// What the sections hold, until all of them are known.
#[derive(Default)]
pub(super) struct Content {
    points: Vec<Vector3<f64>>,
    /// Positions in `points` by node tag.
    nodes: HashMap<u64, u32>,
    tets: Vec<Tetrahedron>,
    ignored_elements: usize,
    pub(super) names: BTreeMap<i64, String>,
    /// The first physical tag of each volume (4.1).
    pub(super) volumes: HashMap<i64, i64>,
}

/// A tetrahedron as it stands in a file.
struct Tetrahedron {
    element: u64,
    nodes: [u64; 4],
    material: Material,
}

/// Where a tetrahedron has its tag from.
pub(super) enum Material {
    Tag(i64),
    /// The tag of a volume, which may come later in the file.
    Volume(i64),
}

impl Content {
    pub(super) fn add_node(
        &mut self,
        scanner: &Scanner,
        tag: u64,
        x: [f64; 3],
    ) -> Result<(), TetMeshError> {
        let number = u32::try_from(self.points.len()).unwrap_or(u32::MAX);
        if self.nodes.insert(tag, number).is_some() {
            return Err(scanner.syntax(format!("node {tag} a second time"), "each node once"));
        }
        self.points.push(Vector3::from(x));
        Ok(())
    }

    /// Counts an element or keeps it, if it is a tetrahedron.
    pub(super) fn add_element(
        &mut self,
        kind: &Element,
        tag: u64,
        nodes: &[u64],
        material: Material,
    ) {
        match *nodes {
            [a, b, c, d] if kind.is_tetrahedron() => {
                self.tets.push(Tetrahedron { element: tag, nodes: [a, b, c, d], material });
            }
            _ => self.ignored_elements += 1,
        }
    }

    pub(super) fn load(mut self, path: &Path, unit_m: f64) -> Result<LoadedMesh, TetMeshError> {
        let mut tets = Vec::with_capacity(self.tets.len());
        let mut tags = Vec::with_capacity(self.tets.len());
        for tet in &self.tets {
            let mut corners = [0; 4];
            for (corner, node) in corners.iter_mut().zip(tet.nodes) {
                *corner = *self.nodes.get(&node).ok_or_else(|| TetMeshError::Syntax {
                    path: path.into(),
                    place: format!("$Elements, element {}", tet.element),
                    found: format!("node {node}"),
                    want: "a node of $Nodes".into(),
                })?;
            }
            tets.push(corners);
            tags.push(match tet.material {
                Material::Tag(tag) => tag,
                Material::Volume(volume) => self.volumes.get(&volume).copied().unwrap_or(0),
            });
        }
        for point in &mut self.points {
            *point *= unit_m;
        }
        let (mesh, repairs) = PlainMesh::new(self.points, tets, tags)
            .map_err(|e| TetMeshError::InFile { path: path.into(), source: Box::new(e) })?;
        let (ignored_elements, names) = (self.ignored_elements, self.names);
        Ok(LoadedMesh { mesh, repairs, ignored_elements, names })
    }
}
