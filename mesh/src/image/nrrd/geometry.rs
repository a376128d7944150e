//! Which axes of an NRRD image are space, and where they lie in the scanner.

use nalgebra::Vector3;

use crate::image::ImageError;
use crate::image::header::{TextField, TextHeader, only_three};
use crate::image::placement::VoxelAffine;

/// Signs that turn the axes of a space to right, anterior, superior.
const SPACES: &[(&[&str], [f64; 3])] = &[
    (&["right-anterior-superior", "ras"], [1.0, 1.0, 1.0]),
    (&["left-anterior-superior", "las"], [-1.0, 1.0, 1.0]),
    (&["left-posterior-superior", "lps"], [-1.0, -1.0, 1.0]),
];

/// Voxels along the three axes of space, in the file's order, and where they lie.
pub(super) fn geometry(
    header: &TextHeader,
    sizes: &[u64],
) -> Result<([u64; 3], VoxelAffine), ImageError> {
    let to_ras = to_ras(header)?;
    let Some(field) = header.get("spacedirections") else {
        return from_spacings(header, sizes, to_ras);
    };
    let to_ras = to_ras.ok_or(ImageError::MissingField("space"))?;
    let directions = directions(field, sizes.len())?;
    let spatial: Vec<usize> = (0..sizes.len()).filter(|&axis| directions[axis].is_some()).collect();
    let Ok(axes) = <[usize; 3]>::try_from(spatial) else {
        return Err(field.refuse("a vector for three axes and `none` for others"));
    };
    let scale = space_units(header)?.component_mul(&to_ras);
    let affine = VoxelAffine {
        form: "space directions",
        columns: axes.map(|axis| directions[axis].unwrap_or_default().component_mul(&scale)),
        first_centre: origin(header)?.component_mul(&scale),
    };
    Ok((only_three(sizes, axes)?, affine))
}

/// Axes along those of the space, or along right, anterior, superior where it has no name.
fn from_spacings(
    header: &TextHeader,
    sizes: &[u64],
    to_ras: Option<Vector3<f64>>,
) -> Result<([u64; 3], VoxelAffine), ImageError> {
    let missing = ImageError::MissingField("spacings (nor space directions)");
    let field = header.get("spacings").ok_or(missing)?;
    // Axes of size 1 go, the last ones first, until three are left.
    let mut kept: Vec<usize> = (0..sizes.len()).collect();
    while let Some(at) = kept.iter().rposition(|&axis| sizes[axis] == 1)
        && kept.len() > 3
    {
        kept.remove(at);
    }
    let axes = [kept[0], kept[1], kept[2]];
    let dims = only_three(sizes, axes)?;
    let want = "a finite number > 0 per axis of space";
    let spacings: Vec<f64> = field.list(sizes.len(), want)?;
    if axes.iter().any(|&axis| !(spacings[axis] > 0.0 && spacings[axis].is_finite())) {
        return Err(field.refuse(want));
    }
    let units = match header.get("units") {
        Some(field) => quoted_units(field, sizes.len())?,
        None => vec![1.0; sizes.len()],
    };
    let signs = to_ras.unwrap_or(Vector3::repeat(1.0));
    let steps = signs.component_mul(&Vector3::from(axes.map(|axis| spacings[axis] * units[axis])));
    let columns = [0, 1, 2].map(|i| Vector3::ith(i, steps[i]));
    let first_centre = match to_ras {
        Some(signs) => origin(header)?.component_mul(&space_units(header)?.component_mul(&signs)),
        None => Vector3::zeros(),
    };
    Ok((dims, VoxelAffine { form: "spacings", columns, first_centre }))
}

/// Signs that turn the space's axes to right, anterior, superior; `None` if it has no name.
fn to_ras(header: &TextHeader) -> Result<Option<Vector3<f64>>, ImageError> {
    const WANT: &str = "right-anterior-superior, left-anterior-superior or \
                        left-posterior-superior, without time";
    match (header.get("space"), header.get("spacedimension")) {
        (Some(space), _) => Ok(Some(space.choice(SPACES, WANT)?.into())),
        (None, Some(dimension)) => Err(dimension.refuse("a named space instead")),
        (None, None) => Ok(None),
    }
}

/// One `(x,y,z)` or `none` per axis.
fn directions(field: &TextField, axes: usize) -> Result<Vec<Option<Vector3<f64>>>, ImageError> {
    const WANT: &str = "(x,y,z) with finite numbers, or none, per axis";
    let mut directions = Vec::new();
    let mut rest = field.value.trim_start();
    while !rest.is_empty() && directions.len() <= axes {
        let (direction, after) = match rest.strip_prefix("none") {
            Some(after) => (None, after),
            None => {
                let (vector, after) = vector(rest).ok_or_else(|| field.refuse(WANT))?;
                (Some(vector), after)
            }
        };
        directions.push(direction);
        rest = after.trim_start();
    }
    if directions.len() != axes { Err(field.refuse(WANT)) } else { Ok(directions) }
}

/// `(x,y,z)` at the start, and what follows it.
fn vector(text: &str) -> Option<(Vector3<f64>, &str)> {
    let (inside, after) = text.strip_prefix('(')?.split_once(')')?;
    let parts: Option<Vec<f64>> = inside.split(',').map(|part| part.trim().parse().ok()).collect();
    let vector = Vector3::from(<[f64; 3]>::try_from(parts?).ok()?);
    vector.iter().all(|x| x.is_finite()).then_some((vector, after))
}

/// Centre of the first voxel in the space's axes and units.
fn origin(header: &TextHeader) -> Result<Vector3<f64>, ImageError> {
    let Some(field) = header.get("spaceorigin") else { return Ok(Vector3::zeros()) };
    match vector(&field.value) {
        Some((origin, "")) => Ok(origin),
        _ => Err(field.refuse("(x,y,z) with finite numbers")),
    }
}

/// Millimetres per unit along the three axes of the space.
fn space_units(header: &TextHeader) -> Result<Vector3<f64>, ImageError> {
    let Some(field) = header.get("spaceunits") else { return Ok(Vector3::repeat(1.0)) };
    Ok(Vector3::from_vec(quoted_units(field, 3)?))
}

/// Millimetres per unit along the axes of the image.
fn quoted_units(field: &TextField, count: usize) -> Result<Vec<f64>, ImageError> {
    const WANT: &str = "\"m\", \"cm\", \"mm\" or \"um\" (or \"\" for mm) per axis, in quotes";
    let pieces: Vec<&str> = field.value.split('"').collect();
    // Between quotes are the odd pieces, outside nothing but blanks.
    let blank = pieces.iter().step_by(2).all(|piece| piece.trim().is_empty());
    if pieces.len() != 2 * count + 1 || !blank {
        return Err(field.refuse(WANT));
    }
    let unit = |name: &str| match name.trim().to_ascii_lowercase().as_str() {
        "" | "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Ok(1.0),
        "m" | "meter" | "meters" | "metre" | "metres" => Ok(1000.0),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Ok(10.0),
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => Ok(0.001),
        _ => Err(field.refuse(WANT)),
    };
    pieces.into_iter().skip(1).step_by(2).map(unit).collect()
}
