//! Reads MetaImage files (.mha; .mhd with its data file).

use std::num::NonZero;
use std::path::Path;

use nalgebra::Vector3;

use crate::image::ImageError;
use crate::image::bytes::{ByteStream, GZIP_MAGIC};
use crate::image::header::{TextField, TextHeader, only_three};
use crate::image::placement::VoxelAffine;
use crate::image::raw::RawVolume;
use crate::image::voxels::{VoxelType, Voxels, check_count};

/// Dimensions that are read at most, as by the format's own library.
const MAX_DIMENSION: usize = 10;

const TYPES: &[(&[&str], VoxelType)] = &[
    (&["met_char"], VoxelType::I8),
    (&["met_uchar"], VoxelType::U8),
    (&["met_short"], VoxelType::I16),
    (&["met_ushort"], VoxelType::U16),
    // The format's long has four bytes on every machine.
    (&["met_int", "met_long"], VoxelType::I32),
    (&["met_uint", "met_ulong"], VoxelType::U32),
    (&["met_long_long"], VoxelType::I64),
    (&["met_ulong_long"], VoxelType::U64),
    (&["met_float"], VoxelType::F32),
    (&["met_double"], VoxelType::F64),
];

/// Millimetres per unit.
const UNITS: &[(&[&str], f64)] = &[(&["mm", "?"], 1.0), (&["um"], 0.001), (&["cm"], 10.0)];

/// Reads a MetaImage with its data in the same file (`LOCAL`) or in one other.
///
/// Binary data, plain or compressed, and text; all integer types, MET_FLOAT and MET_DOUBLE;
/// three axes, and further ones of size 1. Positions are left, posterior, superior, as ITK has
/// it, whatever `AnatomicalOrientation` says; the first three numbers of `TransformMatrix` are
/// the direction of the first axis. `ElementSize` stands in for a missing `ElementSpacing`. Byte
/// order is little-endian unless given; `DistanceUnits` may be um, mm and cm, mm unless given.
/// `ElementToIntensityFunctionSlope` and `…Offset` are applied.
///
/// Cost: O(voxels); at most two copies of the stored bytes.
///
/// # Errors
/// [`ImageError`] that names the file and the line: no image, an element type that is not read,
/// several channels, a list or pattern of data files, or one in another folder; no spacing;
/// fewer or more bytes than the header announces; those of [`RawVolume::new`].
/// # Source
/// <https://itk.org/Wiki/ITK/MetaIO/Documentation>.
pub fn read_metaimage(path: &Path) -> Result<RawVolume, ImageError> {
    read(path).map_err(ImageError::in_file(path))
}

fn read(path: &Path) -> Result<RawVolume, ImageError> {
    let mut stream = ByteStream::open(path)?;
    let header = read_header(&mut stream)?;
    check_kind(&header)?;
    let want = "3, or up to 10 if all further axes have size 1";
    let sizes = header.sizes("NDims", "DimSize", MAX_DIMENSION, want)?;
    let dims = only_three(&sizes, [0, 1, 2])?;
    let count = check_count(dims)?;
    let affine = affine(&header, sizes.len())?;
    let scale = scale(&header)?;
    let want = "a scalar integer type, MET_FLOAT or MET_DOUBLE";
    let kind = header.require("ElementType")?.choice(TYPES, want)?;
    let order = header.first(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]);
    let big_endian = order.map_or(Ok(false), flag)?;
    let field = header.require("ElementDataFile")?;
    if !field.value.eq_ignore_ascii_case("LOCAL") {
        stream = ByteStream::open(&field.data_file(path)?)?;
    }
    let want = count * kind.bytes();
    let voxels = if flag(header.require("BinaryData")?)? {
        Voxels::decode(kind, big_endian, &binary(&header, stream, want)?)
    } else {
        Voxels::parse(kind, count as usize, &stream.take(u64::MAX)?)?
    };
    RawVolume::new(path, dims.map(|d| d as usize), &affine, scale, voxels)
}

/// All fields up to `ElementDataFile`, which is the last by definition.
fn read_header(stream: &mut ByteStream) -> Result<TextHeader, ImageError> {
    let mut header = TextHeader::default();
    while let Some(line) = header.next_line(stream)? {
        match line.split_once('=') {
            Some((name, value)) => header.insert(name, value)?,
            None if line.trim().is_empty() => {}
            None => return Err(header.refuse_line(&line, "`Field = value`")),
        }
        if header.get("ElementDataFile").is_some() {
            break;
        }
    }
    header.require("ElementDataFile")?;
    Ok(header)
}

fn check_kind(header: &TextHeader) -> Result<(), ImageError> {
    match (header.get("ObjectType"), header.get("ElementNumberOfChannels")) {
        (Some(field), _) if !field.value.eq_ignore_ascii_case("Image") => {
            Err(field.refuse("Image"))
        }
        (_, Some(field)) if field.value != "1" => Err(field.refuse("1; extract one channel first")),
        _ => Ok(()),
    }
}

fn affine(header: &TextHeader, rank: usize) -> Result<VoxelAffine, ImageError> {
    let unit = match header.get("DistanceUnits") {
        Some(field) => field.choice(UNITS, "um, mm or cm")?,
        None => 1.0,
    };
    let missing = ImageError::MissingField("ElementSpacing (nor ElementSize)");
    let field = header.first(&["ElementSpacing", "ElementSize"]).ok_or(missing)?;
    let want = "a finite number > 0 per dimension";
    let spacings: Vec<f64> = field.list(rank, want)?;
    if !spacings[..3].iter().all(|s| *s > 0.0 && s.is_finite()) {
        return Err(field.refuse(want));
    }
    let mut columns = [Vector3::x(), Vector3::y(), Vector3::z()];
    if let Some(field) = header.first(&["TransformMatrix", "Orientation", "Rotation"]) {
        let numbers = finite(field, rank * rank)?;
        columns = [0, 1, 2].map(|axis| Vector3::from_column_slice(&numbers[rank * axis..][..3]));
    }
    let mut first_centre = Vector3::zeros();
    if let Some(field) = header.first(&["Offset", "Position", "Origin"]) {
        first_centre = Vector3::from_column_slice(&finite(field, rank)?[..3]);
    }
    // From left, posterior, superior.
    let to_ras = Vector3::new(-unit, -unit, unit);
    for (column, spacing) in columns.iter_mut().zip(spacings) {
        *column = column.component_mul(&to_ras) * spacing;
    }
    let first_centre = first_centre.component_mul(&to_ras);
    Ok(VoxelAffine { form: "TransformMatrix", columns, first_centre })
}

fn scale(header: &TextHeader) -> Result<Option<[f64; 2]>, ImageError> {
    let number = |name: &str, default| -> Result<f64, ImageError> {
        header.get(name).map_or(Ok(default), |field| Ok(finite(field, 1)?[0]))
    };
    let slope = number("ElementToIntensityFunctionSlope", 1.0)?;
    let offset = number("ElementToIntensityFunctionOffset", 0.0)?;
    Ok((slope != 1.0 || offset != 0.0).then_some([slope, offset]))
}

fn finite(field: &TextField, count: usize) -> Result<Vec<f64>, ImageError> {
    let want = "finite numbers, as many as the dimensions ask for";
    let numbers: Vec<f64> = field.list(count, want)?;
    let finite = numbers.iter().all(|x| x.is_finite());
    if finite { Ok(numbers) } else { Err(field.refuse(want)) }
}

fn flag(field: &TextField) -> Result<bool, ImageError> {
    field.choice(&[(&["true", "1"], true), (&["false", "0"], false)], "True or False")
}

fn binary(header: &TextHeader, mut stream: ByteStream, want: u64) -> Result<Vec<u8>, ImageError> {
    let compressed = header.get("CompressedData").map_or(Ok(false), flag)?;
    if let Some(field) = header.get("HeaderSize") {
        let text = "a whole number ≥ 0, or -1 where the data are not compressed";
        match field.parse(text)? {
            -1 if !compressed => stream.skip_to_last(want)?,
            skipped @ 0i64.. => stream.skip(skipped as u64, "the HeaderSize")?,
            _ => return Err(field.refuse(text)),
        }
    }
    if compressed {
        if let Some(field) = header.get("CompressedDataSize") {
            let bytes: NonZero<u64> = field.parse("a whole number > 0 of bytes")?;
            stream.check_rest(bytes.get())?;
        }
        let gzip = stream.starts_with(&GZIP_MAGIC)?;
        stream = if gzip { stream.inflate_gzip() } else { stream.inflate_zlib() };
    }
    stream.voxel_bytes(want)
}
