//! Reads cells of one kind with the numbers on them, as they stand in a file.

use std::path::Path;

use super::array::Layout;
use super::document::{Document, Piece};
use crate::tet_file::TetMeshError;
use crate::tet_file::file::read;

const TETRAHEDRON: i64 = 10;

/// Points, cells of `N` corners and the arrays on both, in the file's units and order.
///
/// Every corner is a point and every number is finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VtkFields<const N: usize> {
    /// Coordinates.
    pub points: Vec<[f64; 3]>,
    /// Corners of the cells, as positions in `points`.
    pub cells: Vec<[u32; N]>,
    /// Name, numbers per point and numbers.
    point_data: Vec<Field>,
    cell_data: Vec<Field>,
}

/// An array by name: numbers per entry, and all of them.
type Field = (String, usize, Vec<f64>);

impl<const N: usize> VtkFields<N> {
    /// The numbers on points under this name, if there are `components` of them per point.
    pub fn of_points(&self, name: &str, components: usize) -> Option<&[f64]> {
        found(&self.point_data, name, components)
    }

    /// The numbers on cells under this name, if there are `components` of them per cell.
    pub fn of_cells(&self, name: &str, components: usize) -> Option<&[f64]> {
        found(&self.cell_data, name, components)
    }
}

fn found<'a>(fields: &'a [Field], name: &str, components: usize) -> Option<&'a [f64]> {
    let is_it = |field: &&Field| field.0 == name && field.1 == components;
    fields.iter().find(is_it).map(|(_, _, values)| &values[..])
}

/// Reads a .vtu file of one piece whose cells are all tetrahedra, with the numbers on them.
///
/// Integers beyond 2⁵³ lose their last digits. Cost: O(file), inflated.
///
/// # Errors
/// [`TetMeshError::InFile`] with [`TetMeshError::Io`], [`TetMeshError::Syntax`],
/// [`TetMeshError::Claim`] for counts beyond the file's length, [`TetMeshError::Unsupported`] for
/// other compressors and arrays that are no numbers.
pub fn read_vtu_fields(path: &Path) -> Result<VtkFields<4>, TetMeshError> {
    let load = || fields(&read(path)?, "UnstructuredGrid", "NumberOfCells", "Cells");
    load().map_err(TetMeshError::in_file(path))
}

/// Reads a .vtp file of one piece whose cells are all triangles, with the numbers on them.
///
/// Cost and errors as of [`read_vtu_fields`].
///
/// # Errors
/// As [`read_vtu_fields`].
pub fn read_vtp_fields(path: &Path) -> Result<VtkFields<3>, TetMeshError> {
    let load = || fields(&read(path)?, "PolyData", "NumberOfPolys", "Polys");
    load().map_err(TetMeshError::in_file(path))
}

fn fields<const N: usize>(
    bytes: &[u8],
    grid: &'static str,
    count: &str,
    section: &str,
) -> Result<VtkFields<N>, TetMeshError> {
    let Document { layout, pieces, .. } = Document::parse(bytes, grid)?;
    let [piece] = &pieces[..] else {
        return Err(TetMeshError::syntax(grid, format!("{} pieces", pieces.len()), "1"));
    };
    let (points, cells) = (piece.count("NumberOfPoints")?, piece.count(count)?);
    let array = piece.points()?;
    if array.components != 3 {
        return Err(array.wrong(format!("{} components", array.components), "3 per point"));
    }
    let coordinates = array.reals(&layout, points.saturating_mul(3))?;
    if let Some(value) = coordinates.iter().find(|x| !x.is_finite()) {
        return Err(array.wrong(value.to_string(), "finite coordinates"));
    }
    let corners = corners::<N>(&layout, piece, section, cells, points)?;
    Ok(VtkFields {
        points: coordinates.as_chunks::<3>().0.to_vec(),
        cells: corners,
        point_data: data(&layout, piece, "PointData", points)?,
        cell_data: data(&layout, piece, "CellData", cells)?,
    })
}

fn corners<const N: usize>(
    layout: &Layout,
    piece: &Piece,
    section: &str,
    cells: u64,
    points: u64,
) -> Result<Vec<[u32; N]>, TetMeshError> {
    let integers =
        |name, count| piece.of(section, name)?.integers(layout, count, "integers of 64 bits");
    for (cell, (end, want)) in
        integers("offsets", cells)?.iter().zip((N as i64..).step_by(N)).enumerate()
    {
        if *end != want {
            let place = format!("offset of cell {cell}");
            return Err(TetMeshError::syntax(
                place,
                end.to_string(),
                format!("{want}: {N} corners each"),
            ));
        }
    }
    if N == 4
        && let Some(cell) = integers("types", cells)?.iter().position(|&kind| kind != TETRAHEDRON)
    {
        return Err(TetMeshError::syntax(format!("cell {cell}"), "another type", "VTK_TETRA"));
    }
    let flat = integers("connectivity", cells.saturating_mul(N as u64))?;
    let number = |(at, &corner): (usize, &i64)| {
        let inside = u32::try_from(corner).ok().filter(|&corner| u64::from(corner) < points);
        inside.ok_or_else(|| {
            let (place, want) = (format!("cell {}", at / N), format!("a point below {points}"));
            TetMeshError::syntax(place, format!("corner {corner}"), want)
        })
    };
    let numbers: Vec<u32> = flat.iter().enumerate().map(number).collect::<Result<_, _>>()?;
    Ok(numbers.as_chunks::<N>().0.to_vec())
}

fn data(
    layout: &Layout,
    piece: &Piece,
    section: &str,
    count: u64,
) -> Result<Vec<Field>, TetMeshError> {
    let arrays = piece.arrays.iter().filter(|(parent, _)| parent == section);
    let decode = |(_, array): &(String, super::array::Array)| {
        let values = array.reals(layout, count.saturating_mul(array.components))?;
        match values.iter().find(|x| !x.is_finite()) {
            Some(value) => Err(array.wrong(value.to_string(), "finite numbers")),
            None => Ok((array.name.clone(), array.components as usize, values)),
        }
    };
    arrays.map(decode).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::isosurface::{SurfaceData, write_vtp};
    use crate::tet_file::{VtkArray, VtkValues, tetrahedra_xml};

    fn vtu() -> Vec<u8> {
        let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0 / 3.0];
        let of = |name, components, values| VtkArray { name, components, values };
        let moved = [of("displacement_mm", 3, VtkValues::Float64(&points))];
        let cells =
            [of("level", 1, VtkValues::UInt8(&[7])), of("label", 1, VtkValues::Int64(&[-4]))];
        tetrahedra_xml(&points, &[[0, 1, 2, 3]], &moved, &cells)
    }

    #[test]
    fn tetrahedra_come_back_with_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtu");
        fs::write(&path, vtu()).unwrap();
        let read = read_vtu_fields(&path).unwrap();
        assert_eq!((read.points[3], &read.cells[..]), ([0.0, 0.0, 1.0 / 3.0], &[[0, 1, 2, 3]][..]));
        assert_eq!(read.of_points("displacement_mm", 3).unwrap(), read.points.as_flattened());
        assert_eq!(
            (read.of_cells("level", 1), read.of_cells("label", 1)),
            (Some(&[7.0][..]), Some(&[-4.0][..]))
        );
        assert_eq!((read.of_cells("level", 3), read.of_points("level", 1)), (None, None));
    }

    #[test]
    fn triangles_come_back_with_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtp");
        let points = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Into::into);
        let (triangles, displacement) = ([[0, 2, 1]], [[0.5; 3]; 3].map(Into::into));
        let data = SurfaceData {
            points_mm: &points,
            triangles: &triangles,
            displacement_mm: Some(&displacement),
            label: None,
        };
        write_vtp(&path, &data).unwrap();
        let read = read_vtp_fields(&path).unwrap();
        assert_eq!((read.points[0], &read.cells[..]), ([0.0, 0.0, 0.1], &triangles[..]));
        assert_eq!(read.of_points("displacement_mm", 3), Some(&[0.5; 9][..]));
    }

    #[test]
    fn what_is_damaged_is_refused_by_name_and_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtu");
        let text = String::from_utf8(vtu()).unwrap();
        for (bad, want) in [
            (text[..text.len() / 2].to_owned(), "a.vtu"),
            (text.replace("NumberOfCells=\"1\"", "NumberOfCells=\"2\""), "offsets"),
            (text.replace("NumberOfPoints=\"4\"", "NumberOfPoints=\"3\""), "array"),
            (text.replace("NumberOfCells=\"1\"", "NumberOfCells=\"99999999999999\""), "announces"),
            (text.replace("UnstructuredGrid", "PolyData"), "UnstructuredGrid"),
            (String::new(), "a.vtu"),
        ] {
            fs::write(&path, bad).unwrap();
            let message = read_vtu_fields(&path).unwrap_err().to_string();
            assert!(message.contains("a.vtu") && message.contains(want), "{message}");
        }
        assert!(matches!(read_vtu_fields(folder.path()), Err(TetMeshError::InFile { .. })));
    }
}
