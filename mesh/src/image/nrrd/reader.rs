//! Reads NRRD images (.nrrd; .nhdr with its data file).

use std::collections::BTreeMap;
use std::path::Path;

use super::geometry::geometry;
use crate::image::ImageError;
use crate::image::bytes::ByteStream;
use crate::image::header::TextHeader;
use crate::image::raw::RawVolume;
use crate::image::voxels::{VoxelType, Voxels, check_count};

/// Dimensions that are read at most, as by the format's own library.
const MAX_DIMENSION: usize = 16;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    Text,
}

const ENCODINGS: &[(&[&str], Encoding)] = &[
    (&["raw"], Encoding::Raw),
    (&["gzip", "gz"], Encoding::Gzip),
    (&["text", "txt", "ascii"], Encoding::Text),
];

const TYPES: &[(&[&str], VoxelType)] = &[
    (&["signed char", "int8", "int8_t"], VoxelType::I8),
    (&["uchar", "unsigned char", "uint8", "uint8_t"], VoxelType::U8),
    (
        &["short", "short int", "signed short", "signed short int", "int16", "int16_t"],
        VoxelType::I16,
    ),
    (&["ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"], VoxelType::U16),
    (&["int", "signed int", "int32", "int32_t"], VoxelType::I32),
    (&["uint", "unsigned int", "uint32", "uint32_t"], VoxelType::U32),
    (&["longlong", "long long", "long long int", "int64", "int64_t"], VoxelType::I64),
    (&["signed long long", "signed long long int"], VoxelType::I64),
    (&["ulonglong", "unsigned long long", "uint64", "uint64_t"], VoxelType::U64),
    (&["unsigned long long int"], VoxelType::U64),
    (&["float"], VoxelType::F32),
    (&["double"], VoxelType::F64),
];

/// Reads an NRRD image of version 1 to 5 with attached data or one data file.
///
/// Encodings raw, gzip and text; all integer types, float and double; three axes, and others of
/// size 1. `space` must be right-anterior-superior, left-anterior-superior or
/// left-posterior-superior; without it the axes count as right, anterior, superior and the first
/// voxel's centre as the origin. `space units` and `units` may be m, cm, mm and µm, mm unless
/// given. `axis mins`, `old min`, `kinds` and the measurement frame are ignored. Segments of 3D Slicer
/// (`.seg.nrrd`) give labels their names, if all are in one layer.
///
/// Cost: O(voxels); at most two copies of the stored bytes.
///
/// # Errors
/// [`ImageError`] that names the file and the line: an encoding (hex, bzip2), type (block), space
/// or unit that is not read; a list or pattern of data files, or one in another folder; neither
/// spacings nor directions; fewer or more bytes than the header announces; those of [`RawVolume::new`].
/// # Source
/// <https://teem.sourceforge.net/nrrd/format.html>.
pub fn read_nrrd(path: &Path) -> Result<RawVolume, ImageError> {
    read(path).map_err(ImageError::in_file(path))
}

fn read(path: &Path) -> Result<RawVolume, ImageError> {
    let mut stream = ByteStream::open(path)?;
    let (header, keys) = read_header(&mut stream)?;
    let want = "3, or up to 16 if all other axes have size 1";
    let sizes = header.sizes("dimension", "sizes", MAX_DIMENSION, want)?;
    let (dims, affine) = geometry(&header, &sizes)?;
    let count = check_count(dims)?;
    let kind = header.require("type")?.choice(TYPES, "an integer type, float or double")?;
    let encoding = header.require("encoding")?.choice(ENCODINGS, "raw, gzip or text")?;
    // Single bytes and text have no order; all else must say it.
    let big_endian = kind.bytes() > 1 && encoding != Encoding::Text && {
        let orders: &[(&[&str], bool)] = &[(&["little"], false), (&["big"], true)];
        header.require("endian")?.choice(orders, "little or big")?
    };
    if let Some(field) = header.get("datafile") {
        stream = ByteStream::open(&field.data_file(path)?)?;
    }
    let bytes = voxel_bytes(&header, stream, encoding, count * kind.bytes())?;
    let voxels = match encoding {
        Encoding::Text => Voxels::parse(kind, count as usize, &bytes)?,
        _ => Voxels::decode(kind, big_endian, &bytes),
    };
    drop(bytes);
    let volume = RawVolume::new(path, dims.map(|d| d as usize), &affine, None, voxels)?;
    Ok(volume.with_label_names(segments(&keys)))
}

/// Labels by the names of 3D Slicer's segments: `Segment0_LabelValue:=1`, `Segment0_Name:=liver`.
fn segments(keys: &BTreeMap<String, String>) -> BTreeMap<i64, String> {
    let labels = keys.iter().filter_map(|(key, value)| {
        let label = value.trim().parse().ok()?;
        let name = keys.get(&format!("{}_Name", key.strip_suffix("_LabelValue")?))?;
        Some((label, name.trim().to_owned()))
    });
    labels.filter(|(_, name)| !name.is_empty()).collect()
}

/// Fields, and the `key:=value` lines, which are the writer's own business.
fn read_header(
    stream: &mut ByteStream,
) -> Result<(TextHeader, BTreeMap<String, String>), ImageError> {
    let (mut header, mut keys) = (TextHeader::default(), BTreeMap::new());
    let magic = header.next_line(stream)?.unwrap_or_default();
    let version = magic.strip_prefix("NRRD000").and_then(|v| v.parse().ok());
    if !version.is_some_and(|version: u8| (1..=5).contains(&version)) {
        return Err(header.refuse_line(&magic, "NRRD0001 to NRRD0005"));
    }
    while let Some(line) = header.next_line(stream)?.filter(|line| !line.is_empty()) {
        match line.split_once(':') {
            _ if line.starts_with('#') => {}
            Some((key, value)) if value.starts_with('=') => {
                keys.insert(key.to_owned(), value[1..].to_owned());
            }
            Some((name, value)) => header.insert(name, value)?,
            None => {
                return Err(header.refuse_line(&line, "`field: value`, `key:=value` or a comment"));
            }
        }
    }
    Ok((header, keys))
}

/// Skips lines of the stored data, inflates, then skips bytes: in the order of the format.
fn voxel_bytes(
    header: &TextHeader,
    mut stream: ByteStream,
    encoding: Encoding,
    want: u64,
) -> Result<Vec<u8>, ImageError> {
    if let Some(field) = header.get("lineskip")
        && !stream.skip_lines(field.parse("a whole number ≥ 0")?)?
    {
        return Err(field.refuse("no more lines than the data has"));
    }
    if encoding == Encoding::Gzip {
        stream = stream.inflate_gzip();
    }
    if let Some(field) = header.get("byteskip") {
        let text = "a whole number ≥ 0, or -1 where the encoding is raw";
        match field.parse(text)? {
            -1 if encoding == Encoding::Raw => stream.skip_to_last(want)?,
            skipped @ 0i64.. => stream.skip(skipped as u64, "the byte skip")?,
            _ => return Err(field.refuse(text)),
        }
    }
    match encoding {
        // Numbers have no fixed length as text: all that is there, as far as the file goes.
        Encoding::Text => stream.take(u64::MAX),
        _ => stream.voxel_bytes(want),
    }
}
