//! Reads and writes Gmsh meshes: MSH 2.2 and 4.1, text and binary.
//!
//! Both versions are sequences of `$Name … $EndName` sections. Four-node tetrahedra are taken;
//! other first-order elements are counted and passed over, and so are comments, fields and
//! unknown sections.
//!
//! Source: Gmsh reference manual, chapter "Gmsh file formats",
//! <https://gmsh.info/doc/texinfo/gmsh.html#Gmsh-file-formats>.

mod element;
mod msh22;
mod msh41;
mod scanner;
mod writer;

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use nalgebra::Vector3;

use crate::MeshError;
use crate::plain_mesh::{LoadedMesh, PlainMesh, file};
use element::Element;
use scanner::Scanner;

pub use writer::{write_msh22, write_msh41};

/// Reads the tetrahedra of an MSH 2.2 or 4.1 file, text or binary of either byte order.
///
/// The material tag is the first physical group of a tetrahedron (2.2: its first tag; 4.1: the
/// first physical tag of its volume), 0 if there is none. Names are those of physical groups of
/// dimension 3. Node tags may be sparse and in any order.
///
/// Units: file coordinates are multiplied by `unit_m`, metres per file unit: 1e-3 for
/// millimetres, as image files have them. Cost: O(file); memory grows with what the file holds,
/// never with what it announces.
///
/// # Errors
/// [`MeshError::Io`]; [`MeshError::LengthUnit`]; with section and line (or byte, if binary):
/// [`MeshError::MeshSyntax`], [`MeshError::MeshClaim`] for counts beyond the file's length,
/// [`MeshError::MeshUnsupported`] for other versions, tetrahedra of higher order and partitioned
/// meshes; [`MeshError::InMeshFile`] with what [`PlainMesh::new`] refuses, tetrahedra numbered
/// from 0 in the order of the file.
/// # Source
/// Gmsh reference manual, "Gmsh file formats".
pub fn read_msh(path: &Path, unit_m: f64) -> Result<LoadedMesh, MeshError> {
    file::check_unit(unit_m)?;
    let bytes = file::read(path)?;
    let mut scanner = Scanner::new(path, &bytes);
    let version = scanner.format()?;
    let mut content = Content::default();
    while let Some(section) = scanner.next_section()? {
        match (section.as_str(), version) {
            ("PhysicalNames", _) => physical_names(&mut scanner, &mut content)?,
            ("Nodes", Version::Two) => msh22::nodes(&mut scanner, &mut content)?,
            ("Nodes", Version::Four) => msh41::nodes(&mut scanner, &mut content)?,
            ("Elements", Version::Two) => msh22::elements(&mut scanner, &mut content)?,
            ("Elements", Version::Four) => msh41::elements(&mut scanner, &mut content)?,
            ("Entities", Version::Four) => msh41::entities(&mut scanner, &mut content)?,
            ("PartitionedEntities", Version::Four) => {
                let advice = "save the mesh without partitions";
                return Err(scanner.unsupported("a partitioned mesh".into(), advice));
            }
            _ => {
                scanner.skip_section()?;
                continue;
            }
        }
        scanner.end_section()?;
    }
    content.load(path, unit_m)
}

/// The two versions that are read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    Two,
    Four,
}

/// What the sections hold, until all of them are known.
#[derive(Default)]
struct Content {
    points: Vec<Vector3<f64>>,
    /// Positions in `points` by node tag.
    nodes: HashMap<u64, u32>,
    tets: Vec<Tetrahedron>,
    ignored_elements: usize,
    names: BTreeMap<i64, String>,
    /// The first physical tag of each volume (4.1).
    volumes: HashMap<i64, i64>,
}

/// A tetrahedron as it stands in a file.
struct Tetrahedron {
    element: u64,
    nodes: [u64; 4],
    material: Material,
}

/// Where a tetrahedron has its tag from.
enum Material {
    Tag(i64),
    /// The tag of a volume, which may come later in the file.
    Volume(i64),
}

impl Content {
    fn add_node(&mut self, scanner: &Scanner, tag: u64, x: [f64; 3]) -> Result<(), MeshError> {
        let number = u32::try_from(self.points.len()).unwrap_or(u32::MAX);
        if self.nodes.insert(tag, number).is_some() {
            return Err(scanner.syntax(format!("node {tag} a second time"), "each node once"));
        }
        self.points.push(Vector3::from(x));
        Ok(())
    }

    /// Counts an element or keeps it, if it is a tetrahedron.
    fn add_element(&mut self, kind: &Element, tag: u64, nodes: &[u64], material: Material) {
        match *nodes {
            [a, b, c, d] if kind.is_tetrahedron() => {
                self.tets.push(Tetrahedron { element: tag, nodes: [a, b, c, d], material });
            }
            _ => self.ignored_elements += 1,
        }
    }

    fn load(mut self, path: &Path, unit_m: f64) -> Result<LoadedMesh, MeshError> {
        let mut tets = Vec::with_capacity(self.tets.len());
        let mut tags = Vec::with_capacity(self.tets.len());
        for tet in &self.tets {
            let mut corners = [0; 4];
            for (corner, node) in corners.iter_mut().zip(tet.nodes) {
                *corner = *self.nodes.get(&node).ok_or_else(|| MeshError::MeshSyntax {
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
            .map_err(|e| MeshError::InMeshFile { path: path.into(), source: Box::new(e) })?;
        let (ignored_elements, names) = (self.ignored_elements, self.names);
        Ok(LoadedMesh { mesh, repairs, ignored_elements, names })
    }
}

/// `$PhysicalNames`, which is text in binary files too: dimension, tag, "name".
fn physical_names(scanner: &mut Scanner, content: &mut Content) -> Result<(), MeshError> {
    let count = scanner.line_count()?;
    scanner.claim("names", count, 6)?;
    for _ in 0..count {
        let line = scanner.line()?.to_string();
        let wrong = || scanner.syntax(format!("{line:?}"), "dimension, tag, \"name\"");
        let (numbers, rest) = line.split_once('"').ok_or_else(wrong)?;
        // Gmsh writes quotes within a name as they are: the last one ends it.
        let (name, _) = rest.rsplit_once('"').ok_or_else(wrong)?;
        let numbers: Option<Vec<i64>> =
            numbers.split_whitespace().map(|n| n.parse().ok()).collect();
        let Some([dimension, tag]) = numbers.as_deref() else { return Err(wrong()) };
        if *dimension == 3 {
            content.names.insert(*tag, name.to_string());
        }
    }
    Ok(())
}
