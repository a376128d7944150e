//! Reads tetrahedra and their material tags.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;

use super::document::{Document, Piece};
use super::layout::Layout;
use crate::tet_file::TetMeshError;
use crate::tet_file::file;
use crate::tet_file::mesh::{LoadedMesh, PlainMesh};

/// Names of cell arrays that hold the material tag; the first one present counts.
pub const TAG_ARRAYS: [&str; 9] = [
    "label",
    "material",
    "material_id",
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
/// [`TetMeshError::Io`]; [`TetMeshError::LengthUnit`]; by array: [`TetMeshError::Syntax`],
/// [`TetMeshError::Claim`] for counts beyond the file's length, [`TetMeshError::Unsupported`]
/// for other compressors and curved tetrahedra; [`TetMeshError::InFile`] with what
/// [`PlainMesh::new`] refuses, tetrahedra numbered from 0 in the order of the file.
/// # Source
/// VTK file formats, <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.
pub fn read_vtu(path: &Path, unit_m: f64) -> Result<LoadedMesh, TetMeshError> {
    file::check_unit(unit_m)?;
    let bytes = file::read(path)?;
    let document = Document::parse(path, &bytes)?;
    let mut content = Content::default();
    for piece in &document.pieces {
        content.add(&document.layout, piece)?;
    }
    let points = content.points.into_iter().map(|x| x * unit_m).collect();
    let (mesh, repairs) = PlainMesh::new(points, content.tets, content.tags)
        .map_err(|e| TetMeshError::InFile { path: path.into(), source: Box::new(e) })?;
    let ignored_elements = content.ignored_elements;
    Ok(LoadedMesh { mesh, repairs, ignored_elements, names: BTreeMap::new() })
}

#[derive(Default)]
struct Content {
    points: Vec<Vector3<f64>>,
    tets: Vec<[u32; 4]>,
    tags: Vec<i64>,
    ignored_elements: usize,
}

impl Content {
    fn add(&mut self, layout: &Layout, piece: &Piece) -> Result<(), TetMeshError> {
        let first = self.points.len();
        let array = piece.points(layout)?;
        if array.components != 3 {
            let found = format!("{} components", array.components);
            return Err(layout.syntax(array.place(), found, "3 per point"));
        }
        let place = array.place();
        let points = array.numbers(layout, piece.points.saturating_mul(3))?.reals();
        if let Some(value) = points.iter().find(|c| !c.is_finite()) {
            return Err(layout.syntax(place, value.to_string(), "finite coordinates"));
        }
        self.points.extend(points.chunks_exact(3).map(|x| Vector3::new(x[0], x[1], x[2])));
        let integers = |name: &str, count: u64| {
            let array = piece.topology(layout, name)?;
            let place = array.place();
            array
                .numbers(layout, count)?
                .integers()
                .map_err(|value| layout.syntax(place, value.to_string(), "integers of 64 bits"))
        };
        let types = integers("types", piece.cells)?;
        let offsets = integers("offsets", piece.cells)?;
        let corners = u64::try_from(offsets.last().copied().unwrap_or(0)).unwrap_or(u64::MAX);
        let connectivity = integers("connectivity", corners)?;
        let tags = self.piece_tags(layout, piece)?;
        let mut start = 0;
        for (cell, (&kind, &end)) in types.iter().zip(&offsets).enumerate() {
            let range = usize::try_from(start).ok().zip(usize::try_from(end).ok());
            let corners = range.and_then(|(start, end)| connectivity.get(start..end));
            let Some(corners) = corners else {
                let want = format!("{start} to {}, ascending", connectivity.len());
                return Err(layout.syntax(format!("offset of cell {cell}"), end.to_string(), want));
            };
            start = end;
            if let Some((_, name)) = CURVED.iter().find(|(code, _)| *code == kind) {
                let advice = "save the mesh with linear cells";
                return Err(layout.unsupported(format!("cell {cell}"), name, advice));
            }
            if kind != TETRAHEDRON {
                self.ignored_elements += 1;
                continue;
            }
            self.tets.push(tetrahedron(layout, cell, corners, first, self.points.len())?);
            self.tags.push(tags.as_ref().map_or(0, |tags| tags[cell]));
        }
        Ok(())
    }

    fn piece_tags(&self, layout: &Layout, piece: &Piece) -> Result<Option<Vec<i64>>, TetMeshError> {
        let Some(array) = TAG_ARRAYS.iter().find_map(|name| piece.cell_array(name)) else {
            return Ok(None);
        };
        if array.components != 1 {
            let found = format!("{} components", array.components);
            return Err(layout.syntax(array.place(), found, "1, a material tag per cell"));
        }
        let tags: Result<_, f64> = array.numbers(layout, piece.cells)?.integers();
        let want = "integers, a material tag per cell";
        tags.map(Some).map_err(|value| layout.syntax(array.place(), value.to_string(), want))
    }
}

/// Corners of a cell, counted over all pieces.
fn tetrahedron(
    layout: &Layout,
    cell: usize,
    corners: &[i64],
    first: usize,
    end: usize,
) -> Result<[u32; 4], TetMeshError> {
    let Ok(corners) = <[i64; 4]>::try_from(corners) else {
        let found = format!("{} corners", corners.len());
        return Err(layout.syntax(format!("cell {cell}, a VTK_TETRA"), found, "4"));
    };
    let mut numbers = [0; 4];
    for (number, corner) in numbers.iter_mut().zip(corners) {
        let shifted = usize::try_from(corner).ok().and_then(|c| c.checked_add(first));
        let valid = shifted.filter(|&c| c < end).and_then(|c| u32::try_from(c).ok());
        *number = valid.ok_or_else(|| {
            let want = format!("a point below {}", end - first);
            layout.syntax(format!("cell {cell}"), format!("corner {corner}"), want)
        })?;
    }
    Ok(numbers)
}
