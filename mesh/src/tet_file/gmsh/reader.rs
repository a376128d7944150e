//! Reads MSH files section by section.

use std::path::Path;

use super::content::Content;
use super::scanner::{Scanner, Version};
use super::{msh22, msh41};
use crate::tet_file::TetMeshError;
use crate::tet_file::file;
use crate::tet_file::mesh::LoadedMesh;

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
/// [`TetMeshError::LengthUnit`]; [`TetMeshError::InFile`] with [`TetMeshError::Io`]; with section
/// and line (or byte, if binary) [`TetMeshError::Syntax`], [`TetMeshError::Claim`] for counts beyond
/// the file's length, [`TetMeshError::Unsupported`] for other versions, tetrahedra of higher order
/// and partitioned meshes; or with what [`PlainMesh::new`](crate::PlainMesh::new) refuses,
/// tetrahedra numbered from 0 in the order of the file.
/// # Source
/// Gmsh reference manual, "Gmsh file formats".
pub fn read_msh(path: &Path, unit_m: f64) -> Result<LoadedMesh, TetMeshError> {
    file::load(path, unit_m, parse)
}

fn parse(bytes: &[u8]) -> Result<file::Content, TetMeshError> {
    let mut scanner = Scanner::new(bytes);
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
                return Err(scanner.unsupported("a partitioned mesh", advice));
            }
            _ => {
                scanner.skip_section()?;
                continue;
            }
        }
        scanner.end_section()?;
    }
    content.finish()
}

/// `$PhysicalNames`, which is text in binary files too: dimension, tag, "name".
fn physical_names(scanner: &mut Scanner, content: &mut Content) -> Result<(), TetMeshError> {
    let count = scanner.line_count()?;
    scanner.claim("names", count, 6)?;
    for _ in 0..count {
        let line = scanner.line()?;
        let wrong = || scanner.syntax(format!("{line:?}"), "dimension, tag, \"name\"");
        let (numbers, rest) = line.split_once('"').ok_or_else(wrong)?;
        // Gmsh writes quotes within a name as they are: the last one ends it.
        let (name, _) = rest.rsplit_once('"').ok_or_else(wrong)?;
        let numbers: Option<Vec<i64>> =
            numbers.split_whitespace().map(|n| n.parse().ok()).collect();
        let Some([dimension, tag]) = numbers.as_deref() else { return Err(wrong()) };
        if *dimension == 3 {
            content.file.names.insert(*tag, name.to_string());
        }
    }
    Ok(())
}
