//! What the sections of an MSH file hold, until all of them are known.

use std::collections::HashMap;

use nalgebra::Vector3;

use super::element::Element;
use super::scanner::Scanner;
use crate::tet_file::{TetMeshError, file};

#[derive(Default)]
pub(super) struct Content {
    /// All but the tetrahedra.
    pub(super) file: file::Content,
    /// Positions of points by node tag.
    nodes: HashMap<u64, u32>,
    tets: Vec<Tetrahedron>,
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
        let number = u32::try_from(self.file.points.len()).unwrap_or(u32::MAX);
        if self.nodes.insert(tag, number).is_some() {
            return Err(scanner.syntax(format!("node {tag} a second time"), "each node once"));
        }
        self.file.points.push(Vector3::from(x));
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
            _ => self.file.ignored_elements += 1,
        }
    }

    pub(super) fn finish(mut self) -> Result<file::Content, TetMeshError> {
        for Tetrahedron { element, nodes, material } in self.tets {
            let mut corners = [0; 4];
            for (corner, node) in corners.iter_mut().zip(nodes) {
                *corner = *self.nodes.get(&node).ok_or_else(|| {
                    let place = format!("$Elements, element {element}");
                    TetMeshError::syntax(place, format!("node {node}"), "a node of $Nodes")
                })?;
            }
            self.file.tets.push(corners);
            self.file.tags.push(match material {
                Material::Tag(tag) => tag,
                Material::Volume(volume) => self.volumes.get(&volume).copied().unwrap_or(0),
            });
        }
        Ok(self.file)
    }
}
