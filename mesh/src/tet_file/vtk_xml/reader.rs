//! Reads tetrahedra and their material tags.

use std::path::Path;

use nalgebra::Vector3;

use super::array::Layout;
use super::document::{Document, Piece};
use crate::tet_file::TetMeshError;
use crate::tet_file::file::{self, Content};
use crate::tet_file::mesh::LoadedMesh;

/// Names of cell arrays that hold the material tag, in upper or lower case; the first one present
/// counts.
pub const TAG_ARRAYS: [&str; 12] = [
    "label",
    "labels",
    "material",
    "materials",
    "material_id",
    "MaterialId",
    "MaterialIds",
    "gmsh:physical",
    "medit:ref",
    "CellEntityIds",
    "region",
    "tag",
];

const TETRAHEDRON: i64 = 10;

/// Cell types of tetrahedra with curved edges.
const CURVED: [(i64, &str); 4] = [
    (24, "VTK_QUADRATIC_TETRA"),
    (64, "VTK_HIGHER_ORDER_TETRAHEDRON"),
    (71, "VTK_LAGRANGE_TETRAHEDRON"),
    (78, "VTK_BEZIER_TETRAHEDRON"),
];

/// Reads the VTK_TETRA cells of a .vtu file; other cells are counted and passed over.
///
/// The material tag is the first cell array of [`TAG_ARRAYS`] that there is, else 0. Several
/// pieces become one mesh, without joining points.
///
/// Units: file coordinates are multiplied by `unit_m`, metres per file unit: 1e-3 for
/// millimetres. Cost: O(file), inflated.
///
/// # Errors
/// [`TetMeshError::LengthUnit`]; [`TetMeshError::InFile`] with [`TetMeshError::Io`]; by array
/// [`TetMeshError::Syntax`], [`TetMeshError::Claim`] for counts beyond the file's length,
/// [`TetMeshError::Unsupported`] for other compressors and curved tetrahedra; or with what
/// [`PlainMesh::new`](crate::PlainMesh::new) refuses, tetrahedra numbered from 0 in the order of
/// the file.
/// # Source
/// VTK file formats, <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.
pub fn read_vtu(path: &Path, unit_m: f64) -> Result<LoadedMesh, TetMeshError> {
    file::load(path, unit_m, |bytes| {
        let Document { layout, pieces, .. } = Document::parse(bytes, "UnstructuredGrid")?;
        let mut content = Content::default();
        for piece in &pieces {
            add(&mut content, &layout, piece)?;
        }
        Ok(content)
    })
}

fn add(content: &mut Content, layout: &Layout, piece: &Piece) -> Result<(), TetMeshError> {
    let first = content.points.len();
    let (points, cells) = (piece.count("NumberOfPoints")?, piece.count("NumberOfCells")?);
    let array = piece.points()?;
    if array.components != 3 {
        return Err(array.wrong(format!("{} components", array.components), "3 per point"));
    }
    let points = array.reals(layout, points.saturating_mul(3))?;
    if let Some(value) = points.iter().find(|c| !c.is_finite()) {
        return Err(array.wrong(value.to_string(), "finite coordinates"));
    }
    content.points.extend(points.chunks_exact(3).map(Vector3::from_column_slice));
    let integers =
        |name, count| piece.topology(name)?.integers(layout, count, "integers of 64 bits");
    let types = integers("types", cells)?;
    let offsets = integers("offsets", cells)?;
    let corners = u64::try_from(offsets.last().copied().unwrap_or(0)).unwrap_or(u64::MAX);
    let connectivity = integers("connectivity", corners)?;
    let tags = material_tags(layout, piece, cells)?;
    let mut start = 0;
    for (cell, (&kind, &end)) in types.iter().zip(&offsets).enumerate() {
        let range = usize::try_from(start).ok().zip(usize::try_from(end).ok());
        let corners = range.and_then(|(start, end)| connectivity.get(start..end));
        let corners = corners.ok_or_else(|| {
            let want = format!("{start} to {}, ascending", connectivity.len());
            TetMeshError::syntax(format!("offset of cell {cell}"), end.to_string(), want)
        })?;
        start = end;
        if let Some((_, name)) = CURVED.iter().find(|(code, _)| *code == kind) {
            let advice = "save the mesh with linear cells";
            return Err(TetMeshError::unsupported(&format!("cell {cell}"), name, advice));
        }
        if kind != TETRAHEDRON {
            content.ignored_elements += 1;
            continue;
        }
        content.tets.push(tetrahedron(cell, corners, first, content.points.len())?);
        content.tags.push(tags.as_ref().map_or(0, |tags| tags[cell]));
    }
    Ok(())
}

fn material_tags(
    layout: &Layout,
    piece: &Piece,
    cells: u64,
) -> Result<Option<Vec<i64>>, TetMeshError> {
    let Some(array) = TAG_ARRAYS.iter().find_map(|name| piece.cell_array(name)) else {
        return Ok(None);
    };
    if array.components != 1 {
        let found = format!("{} components", array.components);
        return Err(array.wrong(found, "1, a material tag per cell"));
    }
    array.integers(layout, cells, "integers, a material tag per cell").map(Some)
}

/// Corners of a cell, counted over all pieces.
fn tetrahedron(
    cell: usize,
    corners: &[i64],
    first: usize,
    end: usize,
) -> Result<[u32; 4], TetMeshError> {
    let Ok(corners) = <[i64; 4]>::try_from(corners) else {
        let (place, found) = (format!("cell {cell}, a VTK_TETRA"), corners.len());
        return Err(TetMeshError::syntax(place, format!("{found} corners"), "4"));
    };
    let mut numbers = [0; 4];
    for (number, corner) in numbers.iter_mut().zip(corners) {
        let shifted = usize::try_from(corner).ok().and_then(|c| c.checked_add(first));
        let valid = shifted.filter(|&c| c < end).and_then(|c| u32::try_from(c).ok());
        *number = valid.ok_or_else(|| {
            let want = format!("a point below {}", end - first);
            TetMeshError::syntax(format!("cell {cell}"), format!("corner {corner}"), want)
        })?;
    }
    Ok(numbers)
}
