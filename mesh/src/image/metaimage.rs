//! Reads MetaImage files (.mha; .mhd with its data file).

use std::path::Path;

use nalgebra::Vector3;

use crate::image::ImageError;
use crate::image::bytes::{ByteStream, GZIP_MAGIC};
use crate::image::header::{TextField, TextHeader};
use crate::image::placement::VoxelAffine;
use crate::image::raw::RawVolume;
use crate::image::voxels::{VoxelType, Voxels, check_count};

/// Dimensions that are read at most, as by the format's own library.
const MAX_DIMENSION: i64 = 10;

/// Reads a MetaImage with its data in the same file (`LOCAL`) or in one other.
///
/// Binary data, plain or compressed, and text; all integer types, MET_FLOAT and MET_DOUBLE;
/// three axes, and further ones of size 1. Positions are left, posterior, superior, as ITK has
/// it, whatever `AnatomicalOrientation` says; the first three numbers of `TransformMatrix` are
/// the direction of the first axis. `ElementSize` stands in for a missing `ElementSpacing`. Byte
/// order is little-endian unless given; `DistanceUnits` may be um, mm and cm, mm unless given.
/// `ElementToIntensityFunctionSlope` and `…Offset` are applied. Bytes after the voxels are left
/// unread, with a warning.
///
/// Cost: O(voxels); at most two copies of the stored bytes.
///
/// # Errors
/// [`ImageError`] that names the file and the line: no image, an element type that is not read,
/// several channels, a list or pattern of data files, or one in another folder; no spacing;
/// fewer bytes than the header announces; those of [`RawVolume::new`].
/// # Source
/// <https://itk.org/Wiki/ITK/MetaIO/Documentation>.
pub fn read_metaimage(path: &Path) -> Result<RawVolume, ImageError> {
    let mut stream = ByteStream::open(path)?;
    let header = read_header(path, &mut stream)?;
    check_kind(&header)?;
    let sizes = sizes(&header)?;
    let dims = [sizes[0], sizes[1], sizes[2]];
    let count = check_count(path, dims)?;
    let affine = affine(&header, sizes.len())?;
    let scale = scale(&header)?;
    let kind = voxel_type(&header)?;
    let big_endian = match header.get("binarydatabyteordermsb") {
        Some(field) => flag(&header, field)?,
        None => match header.get("elementbyteordermsb") {
            Some(field) => flag(&header, field)?,
            None => false,
        },
    };
    let field = header.require("elementdatafile", "ElementDataFile")?;
    if !field.value.eq_ignore_ascii_case("LOCAL") {
        stream = ByteStream::open(&header.data_file(field)?)?;
    }
    let want = count * kind.bytes();
    let voxels = if flag(&header, header.require("binarydata", "BinaryData")?)? {
        Voxels::decode(kind, big_endian, &binary(&header, stream, want)?)
    } else {
        Voxels::parse(path, kind, count as usize, &stream.take(u64::MAX)?)?
    };
    RawVolume::new(path, dims.map(|d| d as usize), &affine, scale, voxels)
}

/// All fields up to `ElementDataFile`, which is the last by definition.
fn read_header<'a>(path: &'a Path, stream: &mut ByteStream) -> Result<TextHeader<'a>, ImageError> {
    let mut header = TextHeader::new(path);
    while let Some(line) = header.next_line(stream)? {
        if line.trim().is_empty() {
            continue;
        }
        let Some((name, value)) = line.split_once('=') else {
            return Err(header.refuse_line(&line, "`Field = value`"));
        };
        let key = name.trim().to_ascii_lowercase();
        let last = key == "elementdatafile";
        header.insert(key, name, value)?;
        if last {
            return Ok(header);
        }
    }
    Err(ImageError::MissingField { path: path.into(), field: "ElementDataFile" })
}

fn check_kind(header: &TextHeader) -> Result<(), ImageError> {
    if let Some(field) = header.get("objecttype")
        && !field.value.eq_ignore_ascii_case("Image")
    {
        return Err(header.refuse(field, "Image"));
    }
    if let Some(field) = header.get("elementnumberofchannels")
        && field.value != "1"
    {
        return Err(header.refuse(field, "1; extract one channel first"));
    }
    Ok(())
}

/// Voxels along all axes: three of them, then ones.
fn sizes(header: &TextHeader) -> Result<Vec<u64>, ImageError> {
    let field = header.require("ndims", "NDims")?;
    let want = "3, or up to 10 if all further axes have size 1";
    let rank = header.integer(field, want)?;
    if !(3..=MAX_DIMENSION).contains(&rank) {
        return Err(header.refuse(field, want));
    }
    let sizes = header.sizes(header.require("dimsize", "DimSize")?, rank as usize)?;
    let count = sizes[3..].iter().fold(1u64, |product, &d| product.saturating_mul(d));
    if count > 1 {
        let (path, rank) = (header.path.into(), rank as i16);
        return Err(ImageError::NotThreeDimensional { path, rank, count });
    }
    Ok(sizes)
}

fn affine(header: &TextHeader, rank: usize) -> Result<VoxelAffine, ImageError> {
    let unit = unit_mm(header)?;
    let field = match header.get("elementspacing") {
        Some(field) => field,
        None => header.require("elementsize", "ElementSpacing (nor ElementSize)")?,
    };
    let want = "a finite number > 0 per dimension";
    let spacings = header.numbers(field, rank, want)?;
    if !spacings[..3].iter().all(|s| *s > 0.0 && s.is_finite()) {
        return Err(header.refuse(field, want));
    }
    let mut columns = [Vector3::x(), Vector3::y(), Vector3::z()];
    if let Some(field) = first(header, ["transformmatrix", "orientation", "rotation"]) {
        let numbers = finite(header, field, rank * rank)?;
        for (axis, column) in columns.iter_mut().enumerate() {
            *column = Vector3::from_fn(|i, _| numbers[rank * axis + i]);
        }
    }
    let mut first_centre = Vector3::zeros();
    if let Some(field) = first(header, ["offset", "position", "origin"]) {
        let numbers = finite(header, field, rank)?;
        first_centre = Vector3::from_fn(|i, _| numbers[i]);
    }
    // From left, posterior, superior.
    let to_ras = Vector3::new(-unit, -unit, unit);
    for (column, spacing) in columns.iter_mut().zip(spacings) {
        *column = column.component_mul(&to_ras) * spacing;
    }
    let first_centre = first_centre.component_mul(&to_ras);
    Ok(VoxelAffine { form: "TransformMatrix", columns, first_centre })
}

fn unit_mm(header: &TextHeader) -> Result<f64, ImageError> {
    let Some(field) = header.get("distanceunits") else { return Ok(1.0) };
    match field.value.to_ascii_lowercase().as_str() {
        "mm" | "?" => Ok(1.0),
        "um" => Ok(0.001),
        "cm" => Ok(10.0),
        _ => Err(header.refuse(field, "um, mm or cm")),
    }
}

fn scale(header: &TextHeader) -> Result<Option<[f64; 2]>, ImageError> {
    let slope = header.get("elementtointensityfunctionslope");
    let offset = header.get("elementtointensityfunctionoffset");
    let number = |field: Option<&TextField>, default| -> Result<f64, ImageError> {
        field.map_or(Ok(default), |field| Ok(finite(header, field, 1)?[0]))
    };
    let scale = [number(slope, 1.0)?, number(offset, 0.0)?];
    Ok((scale != [1.0, 0.0]).then_some(scale))
}

/// The first of these fields that is there: they mean the same.
fn first<'a>(header: &'a TextHeader, keys: [&str; 3]) -> Option<&'a TextField> {
    keys.into_iter().find_map(|key| header.get(key))
}

fn finite(header: &TextHeader, field: &TextField, count: usize) -> Result<Vec<f64>, ImageError> {
    let want = "finite numbers, as many as the dimensions ask for";
    let numbers = header.numbers(field, count, want)?;
    if numbers.iter().all(|x| x.is_finite()) {
        Ok(numbers)
    } else {
        Err(header.refuse(field, want))
    }
}

fn flag(header: &TextHeader, field: &TextField) -> Result<bool, ImageError> {
    match field.value.to_ascii_lowercase().as_str() {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        _ => Err(header.refuse(field, "True or False")),
    }
}

fn voxel_type(header: &TextHeader) -> Result<VoxelType, ImageError> {
    let field = header.require("elementtype", "ElementType")?;
    match field.value.to_ascii_uppercase().as_str() {
        "MET_CHAR" => Ok(VoxelType::I8),
        "MET_UCHAR" => Ok(VoxelType::U8),
        "MET_SHORT" => Ok(VoxelType::I16),
        "MET_USHORT" => Ok(VoxelType::U16),
        // The format's long has four bytes on every machine.
        "MET_INT" | "MET_LONG" => Ok(VoxelType::I32),
        "MET_UINT" | "MET_ULONG" => Ok(VoxelType::U32),
        "MET_LONG_LONG" => Ok(VoxelType::I64),
        "MET_ULONG_LONG" => Ok(VoxelType::U64),
        "MET_FLOAT" => Ok(VoxelType::F32),
        "MET_DOUBLE" => Ok(VoxelType::F64),
        _ => Err(header.refuse(field, "a scalar integer type, MET_FLOAT or MET_DOUBLE")),
    }
}

fn binary(header: &TextHeader, mut stream: ByteStream, want: u64) -> Result<Vec<u8>, ImageError> {
    let compressed = match header.get("compresseddata") {
        Some(field) => flag(header, field)?,
        None => false,
    };
    if let Some(field) = header.get("headersize") {
        let text = "a whole number ≥ 0, or -1 where the data are not compressed";
        match header.integer(field, text)? {
            -1 if !compressed => stream.skip_to_last(want)?,
            skipped if skipped >= 0 => stream.skip(skipped as u64, "the HeaderSize")?,
            _ => return Err(header.refuse(field, text)),
        }
    }
    if compressed {
        if let Some(field) = header.get("compresseddatasize") {
            let text = "a whole number > 0 of bytes";
            let bytes = u64::try_from(header.integer(field, text)?).unwrap_or(0);
            if bytes == 0 {
                return Err(header.refuse(field, text));
            }
            stream = stream.limited(bytes);
        }
        let gzip = stream.starts_with(&GZIP_MAGIC)?;
        stream = if gzip { stream.inflate_gzip() } else { stream.inflate_zlib() };
    }
    stream.voxel_bytes(want)
}
