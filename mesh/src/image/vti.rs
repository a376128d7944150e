//! Reads VTK image data (.vti).

use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use crate::image::ImageError;
use crate::image::bytes::ByteStream;
use crate::image::placement::VoxelAffine;
use crate::image::raw::RawVolume;
use crate::image::voxels::check_count;
use crate::tet_file::{Array, Attributes, Document, Piece, TetMeshError};

/// What carries values in a VTK grid, and how far a voxel's centre is from its point, in spacings.
const CARRIERS: [(&str, f64); 2] = [("PointData", 0.0), ("CellData", 0.5)];

/// Reads the image of a .vti file: the active scalars of its points or cells, or its only array of
/// one component. A voxel is a point or a cell.
///
/// Text, base64 and appended data, plain or compressed with zlib, one piece. VTK has no axes of the
/// body and no unit: coordinates count as scanner RAS in mm, as in the files that are written here.
///
/// Cost: O(voxels); at most three copies of the stored bytes.
///
/// # Errors
/// [`ImageError::Vtk`] by element or array; [`ImageError::TooManyVoxels`]; those of
/// [`RawVolume::new`].
/// # Source
/// VTK file formats, <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.
pub fn read_vti(path: &Path) -> Result<RawVolume, ImageError> {
    read(path).map_err(ImageError::in_file(path))
}

fn read(path: &Path) -> Result<RawVolume, ImageError> {
    let bytes = ByteStream::open(path)?.take(u64::MAX)?;
    let Document { layout, grid, pieces } = Document::parse(&bytes, "ImageData")?;
    let [piece] = &pieces[..] else {
        let (found, want) = (format!("{} pieces", pieces.len()), "one with the whole image");
        return Err(TetMeshError::syntax("ImageData", found, want).into());
    };
    let extent = whole_extent(&grid, piece)?;
    let (carrier, array) = values(piece)?;
    let (of_points, shift) = CARRIERS[carrier];
    if array.components != 1 {
        let found = format!("{} components", array.components);
        return Err(array.wrong(found, "1, a number per voxel").into());
    }
    // As many points as the ends say, and a cell less.
    let points = extent.map(|[first, last]| (last - first + 1) as u64);
    let dims = points.map(|points| points - carrier as u64);
    if dims.contains(&0) {
        let (place, found) = (format!("WholeExtent, {of_points}"), format!("{extent:?}"));
        return Err(TetMeshError::syntax(place, found, "at least one voxel along each axis").into());
    }
    let count = check_count(dims)?;
    let first = extent.map(|[first, _]| first as f64 + shift);
    let affine = affine(&grid, Vector3::from(first))?;
    let voxels = array.numbers(&layout, count)?;
    RawVolume::new(path, dims.map(|d| d as usize), &affine, None, voxels)
}

/// First and last point along each axis, of the grid and of its piece.
fn whole_extent(grid: &Attributes, piece: &Piece) -> Result<[[i64; 2]; 3], TetMeshError> {
    let extent = |tag: &Attributes, place, name| {
        let ends = numbers::<i32, 6>(tag, name);
        let axes =
            ends.map(|e| [[e[0], e[1]], [e[2], e[3]], [e[4], e[5]]].map(|a| a.map(i64::from)));
        let ascending = axes.filter(|axes| axes.iter().all(|[first, last]| first <= last));
        ascending.ok_or_else(|| tag.wrong(place, name, "the first and last point of each axis"))
    };
    let whole = extent(grid, "ImageData", "WholeExtent")?;
    if extent(&piece.attributes, "Piece", "Extent")? != whole {
        let want = "that of the whole image: save it as one piece";
        return Err(piece.attributes.wrong("Piece", "Extent", want));
    }
    Ok(whole)
}

/// The array with the voxels, and which of [`CARRIERS`] it is of.
fn values(piece: &Piece) -> Result<(usize, &Array), TetMeshError> {
    let found = |parent: &String, array: &Array| {
        let carrier = CARRIERS.iter().position(|(name, _)| name == parent)?;
        let active = piece.scalars.iter().any(|(p, name)| p == parent && *name == array.name);
        Some((carrier, active))
    };
    let mut all = Vec::new();
    for (parent, array) in &piece.arrays {
        all.extend(found(parent, array).map(|(carrier, active)| (carrier, active, array)));
    }
    let active = all.iter().filter(|(_, active, _)| *active);
    let single = all.iter().filter(|(_, _, array)| array.components == 1);
    let chosen: Vec<_> = active.collect();
    let chosen = if chosen.is_empty() { single.collect() } else { chosen };
    match chosen[..] {
        [(carrier, _, array)] => Ok((*carrier, array)),
        _ => {
            let names: Vec<&str> = all.iter().map(|(_, _, array)| &array.name[..]).collect();
            let found = format!("{} arrays for voxels: {}", chosen.len(), names.join(", "));
            let want = "one in PointData or CellData, named as Scalars there if there are others";
            Err(TetMeshError::syntax("Piece", found, want))
        }
    }
}

/// Where voxels lie whose first one is `first` spacings along the axes.
fn affine(grid: &Attributes, first: Vector3<f64>) -> Result<VoxelAffine, TetMeshError> {
    let given = |name, default: [f64; 3]| match grid.get(name) {
        None => Ok(default),
        Some(_) => {
            let finite =
                numbers(grid, name).filter(|list: &[f64; 3]| list.iter().all(|x| x.is_finite()));
            finite.ok_or_else(|| grid.wrong("ImageData", name, "3 finite numbers"))
        }
    };
    let (origin, spacing) = (given("Origin", [0.0; 3])?, given("Spacing", [1.0; 3])?);
    let direction = match grid.get("Direction") {
        None => Matrix3::identity(),
        Some(_) => {
            let rows =
                numbers(grid, "Direction").map(|rows: [f64; 9]| Matrix3::from_row_slice(&rows));
            let finite = rows.filter(|rows| rows.iter().all(|x| x.is_finite()));
            finite.ok_or_else(|| {
                grid.wrong("ImageData", "Direction", "9 finite numbers, row by row")
            })?
        }
    };
    let steps = direction * Matrix3::from_diagonal(&spacing.into());
    Ok(VoxelAffine {
        form: "Spacing and Direction",
        columns: [0, 1, 2].map(|axis| steps.column(axis).into()),
        first_centre: Vector3::from(origin) + steps * first,
    })
}

/// Exactly N numbers of an attribute.
fn numbers<T: std::str::FromStr, const N: usize>(tag: &Attributes, name: &str) -> Option<[T; N]> {
    let words = tag.get(name)?.split_ascii_whitespace();
    let list: Vec<T> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
    list.try_into().ok()
}
