//! Which axes of an NRRD image are space, and where they lie in the scanner.

use nalgebra::Vector3;

use crate::image::ImageError;
use crate::image::header::{TextField, TextHeader};
use crate::image::placement::VoxelAffine;

/// The three axes of space, in the file's order.
pub(super) struct Geometry {
    pub dims: [u64; 3],
    pub affine: VoxelAffine,
}

impl Geometry {
    pub fn of(header: &TextHeader, sizes: &[u64]) -> Result<Self, ImageError> {
        let to_ras = to_ras(header)?;
        let Some(field) = header.get("spacedirections") else {
            return Self::from_spacings(header, sizes, to_ras);
        };
        let Some(to_ras) = to_ras else {
            return Err(ImageError::MissingField { path: header.path.into(), field: "space" });
        };
        let directions = directions(header, field, sizes.len())?;
        let spatial: Vec<usize> =
            (0..sizes.len()).filter(|&axis| directions[axis].is_some()).collect();
        let Ok(axes) = <[usize; 3]>::try_from(spatial) else {
            return Err(header.refuse(field, "a vector for three axes and `none` for others"));
        };
        let dims = only(header, sizes, axes)?;
        let columns = axes.map(|axis| directions[axis].unwrap_or_default());
        let scale = space_units(header)?.component_mul(&to_ras);
        let affine = VoxelAffine {
            form: "space directions",
            columns: columns.map(|column| column.component_mul(&scale)),
            first_centre: origin(header)?.component_mul(&scale),
        };
        Ok(Self { dims, affine })
    }

    /// Axes along those of the space, or along right, anterior, superior where it has no name.
    fn from_spacings(
        header: &TextHeader,
        sizes: &[u64],
        to_ras: Option<Vector3<f64>>,
    ) -> Result<Self, ImageError> {
        let field = header.require("spacings", "spacings (nor space directions)")?;
        // Axes of size 1 go, the last ones first, until three are left.
        let mut kept: Vec<usize> = (0..sizes.len()).collect();
        while kept.len() > 3 {
            match kept.iter().rposition(|&axis| sizes[axis] == 1) {
                Some(at) => kept.remove(at),
                None => return Err(not_three(header, sizes, [0, 1, 2])),
            };
        }
        let axes = [kept[0], kept[1], kept[2]];
        let want = "a finite number > 0 per axis of space";
        let spacings = header.numbers(field, sizes.len(), want)?;
        let units = axis_units(header, sizes.len())?;
        let signs = to_ras.unwrap_or(Vector3::repeat(1.0));
        let mut columns = [Vector3::zeros(); 3];
        for (i, axis) in axes.into_iter().enumerate() {
            if !(spacings[axis] > 0.0 && spacings[axis].is_finite()) {
                return Err(header.refuse(field, want));
            }
            columns[i][i] = spacings[axis] * units[axis] * signs[i];
        }
        let first_centre = match to_ras {
            Some(signs) => {
                origin(header)?.component_mul(&space_units(header)?.component_mul(&signs))
            }
            None => Vector3::zeros(),
        };
        let affine = VoxelAffine { form: "spacings", columns, first_centre };
        Ok(Self { dims: only(header, sizes, axes)?, affine })
    }
}

/// The sizes of the three axes, if all others have size 1.
fn only(header: &TextHeader, sizes: &[u64], axes: [usize; 3]) -> Result<[u64; 3], ImageError> {
    if (0..sizes.len()).any(|axis| !axes.contains(&axis) && sizes[axis] > 1) {
        return Err(not_three(header, sizes, axes));
    }
    Ok(axes.map(|axis| sizes[axis]))
}

fn not_three(header: &TextHeader, sizes: &[u64], axes: [usize; 3]) -> ImageError {
    let others = (0..sizes.len()).filter(|axis| !axes.contains(axis));
    let count = others.fold(1u64, |product, axis| product.saturating_mul(sizes[axis]));
    let rank = sizes.len() as i16;
    ImageError::NotThreeDimensional { path: header.path.into(), rank, count }
}

/// Signs that turn the space's axes to right, anterior, superior; `None` if it has no name.
fn to_ras(header: &TextHeader) -> Result<Option<Vector3<f64>>, ImageError> {
    const WANT: &str = "right-anterior-superior, left-anterior-superior or \
                        left-posterior-superior, without time";
    let Some(field) = header.get("space") else {
        return match header.get("spacedimension") {
            Some(field) => Err(header.refuse(field, "a named space instead")),
            None => Ok(None),
        };
    };
    match field.value.to_ascii_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Ok(Some(Vector3::new(1.0, 1.0, 1.0))),
        "left-anterior-superior" | "las" => Ok(Some(Vector3::new(-1.0, 1.0, 1.0))),
        "left-posterior-superior" | "lps" => Ok(Some(Vector3::new(-1.0, -1.0, 1.0))),
        _ => Err(header.refuse(field, WANT)),
    }
}

/// One `(x,y,z)` or `none` per axis.
fn directions(
    header: &TextHeader,
    field: &TextField,
    axes: usize,
) -> Result<Vec<Option<Vector3<f64>>>, ImageError> {
    const WANT: &str = "(x,y,z) with finite numbers, or none, per axis";
    let mut directions = Vec::new();
    let mut rest = field.value.trim_start();
    while !rest.is_empty() && directions.len() <= axes {
        let (direction, after) = if let Some(after) = rest.strip_prefix("none") {
            (None, after)
        } else {
            let (vector, after) = vector(rest).ok_or_else(|| header.refuse(field, WANT))?;
            (Some(vector), after)
        };
        directions.push(direction);
        rest = after.trim_start();
    }
    if directions.len() != axes { Err(header.refuse(field, WANT)) } else { Ok(directions) }
}

/// `(x,y,z)` at the start, and what follows it.
fn vector(text: &str) -> Option<(Vector3<f64>, &str)> {
    let (inside, after) = text.strip_prefix('(')?.split_once(')')?;
    let mut vector = Vector3::zeros();
    let mut parts = inside.split(',');
    for i in 0..3 {
        vector[i] = parts.next()?.trim().parse().ok().filter(|x: &f64| x.is_finite())?;
    }
    parts.next().is_none().then_some((vector, after))
}

/// Centre of the first voxel in the space's axes and units.
fn origin(header: &TextHeader) -> Result<Vector3<f64>, ImageError> {
    let Some(field) = header.get("spaceorigin") else { return Ok(Vector3::zeros()) };
    match vector(&field.value) {
        Some((origin, "")) => Ok(origin),
        _ => Err(header.refuse(field, "(x,y,z) with finite numbers")),
    }
}

/// Millimetres per unit along the three axes of the space.
fn space_units(header: &TextHeader) -> Result<Vector3<f64>, ImageError> {
    let Some(field) = header.get("spaceunits") else { return Ok(Vector3::repeat(1.0)) };
    let units = quoted_units(header, field, 3)?;
    Ok(Vector3::new(units[0], units[1], units[2]))
}

/// Millimetres per unit along the axes of the image.
fn axis_units(header: &TextHeader, axes: usize) -> Result<Vec<f64>, ImageError> {
    match header.get("units") {
        Some(field) => quoted_units(header, field, axes),
        None => Ok(vec![1.0; axes]),
    }
}

fn quoted_units(
    header: &TextHeader,
    field: &TextField,
    count: usize,
) -> Result<Vec<f64>, ImageError> {
    const WANT: &str = "\"m\", \"cm\", \"mm\" or \"um\" (or \"\" for mm) per axis, in quotes";
    let pieces: Vec<&str> = field.value.split('"').collect();
    // Between quotes are the odd pieces, outside nothing but blanks.
    let blank = pieces.iter().step_by(2).all(|piece| piece.trim().is_empty());
    if pieces.len() != 2 * count + 1 || !blank {
        return Err(header.refuse(field, WANT));
    }
    let unit = |name: &str| match name.trim().to_ascii_lowercase().as_str() {
        "" | "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Ok(1.0),
        "m" | "meter" | "meters" | "metre" | "metres" => Ok(1000.0),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Ok(10.0),
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => Ok(0.001),
        _ => Err(header.refuse(field, WANT)),
    };
    pieces.into_iter().skip(1).step_by(2).map(unit).collect()
}
