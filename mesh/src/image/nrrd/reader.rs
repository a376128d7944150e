//! Reads NRRD images (.nrrd; .nhdr with its data file).

use std::path::Path;

use super::geometry::Geometry;
use crate::image::ImageError;
use crate::image::bytes::ByteStream;
use crate::image::header::TextHeader;
use crate::image::raw::RawVolume;
use crate::image::voxels::{VoxelType, Voxels, check_count};

/// Dimensions that are read at most, as by the format's own library.
const MAX_DIMENSION: i64 = 16;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    Text,
}

/// Reads an NRRD image of version 1 to 5 with attached data or one data file.
///
/// Encodings raw, gzip and text; all integer types, float and double; three axes, and others of
/// size 1. `space` must be right-anterior-superior, left-anterior-superior or
/// left-posterior-superior; without it the axes count as right, anterior, superior and the first
/// voxel's centre as the origin. `space units` and `units` may be m, cm, mm and µm, mm unless
/// given. `axis mins`, `old min`, `kinds` and the measurement frame are ignored. Bytes after the
/// voxels are left unread, with a warning.
///
/// Cost: O(voxels); at most two copies of the stored bytes.
///
/// # Errors
/// [`ImageError`] that names the file and the line: an encoding (hex, bzip2), type (block), space
/// or unit that is not read; a list or pattern of data files, or one in another folder; neither
/// spacings nor directions; fewer bytes than the header announces; those of [`RawVolume::new`].
/// # Source
/// <https://teem.sourceforge.net/nrrd/format.html>.
pub fn read_nrrd(path: &Path) -> Result<RawVolume, ImageError> {
    let mut stream = ByteStream::open(path)?;
    let header = read_header(path, &mut stream)?;
    let field = header.require("dimension", "dimension")?;
    let want = "3, or up to 16 if all other axes have size 1";
    let dimension = header.integer(field, want)?;
    if !(3..=MAX_DIMENSION).contains(&dimension) {
        return Err(header.refuse(field, want));
    }
    let sizes = header.sizes(header.require("sizes", "sizes")?, dimension as usize)?;
    let Geometry { dims, affine } = Geometry::of(&header, &sizes)?;
    let count = check_count(path, dims)?;
    let kind = voxel_type(&header)?;
    let encoding = encoding(&header)?;
    let big_endian = big_endian(&header, kind, encoding)?;
    if let Some(field) = header.get("datafile") {
        stream = ByteStream::open(&header.data_file(field)?)?;
    }
    let bytes = voxel_bytes(&header, stream, encoding, count * kind.bytes())?;
    let voxels = match encoding {
        Encoding::Text => Voxels::parse(path, kind, count as usize, &bytes)?,
        _ => Voxels::decode(kind, big_endian, &bytes),
    };
    drop(bytes);
    RawVolume::new(path, dims.map(|d| d as usize), &affine, None, voxels)
}

/// All fields, names in lower case without blanks: the format lets writers drop those.
fn read_header<'a>(path: &'a Path, stream: &mut ByteStream) -> Result<TextHeader<'a>, ImageError> {
    let mut header = TextHeader::new(path);
    let magic = header.next_line(stream)?.unwrap_or_default();
    let version = magic.strip_prefix("NRRD000").and_then(|v| v.parse().ok());
    if !version.is_some_and(|version: u8| (1..=5).contains(&version)) {
        return Err(header.refuse_line(&magic, "NRRD0001 to NRRD0005"));
    }
    while let Some(line) = header.next_line(stream)? {
        if line.is_empty() {
            break;
        }
        if line.starts_with('#') {
            continue;
        }
        let Some((name, value)) = line.split_once(':') else {
            return Err(header.refuse_line(&line, "`field: value`, `key:=value` or a comment"));
        };
        // Keys are the writer's own business.
        if value.starts_with('=') {
            continue;
        }
        let key: String = name.chars().filter(|c| *c != ' ').collect();
        header.insert(key.to_ascii_lowercase(), name, value)?;
    }
    Ok(header)
}

fn voxel_type(header: &TextHeader) -> Result<VoxelType, ImageError> {
    let field = header.require("type", "type")?;
    let words: Vec<&str> = field.value.split_whitespace().collect();
    let kind = match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => VoxelType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => VoxelType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            VoxelType::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => {
            VoxelType::U16
        }
        "int" | "signed int" | "int32" | "int32_t" => VoxelType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => VoxelType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => VoxelType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            VoxelType::U64
        }
        "float" => VoxelType::F32,
        "double" => VoxelType::F64,
        _ => return Err(header.refuse(field, "an integer type, float or double")),
    };
    Ok(kind)
}

fn encoding(header: &TextHeader) -> Result<Encoding, ImageError> {
    let field = header.require("encoding", "encoding")?;
    match field.value.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gzip" | "gz" => Ok(Encoding::Gzip),
        "text" | "txt" | "ascii" => Ok(Encoding::Text),
        _ => Err(header.refuse(field, "raw, gzip or text")),
    }
}

/// Single bytes and text have no order; all else must say it.
fn big_endian(
    header: &TextHeader,
    kind: VoxelType,
    encoding: Encoding,
) -> Result<bool, ImageError> {
    if kind.bytes() == 1 || encoding == Encoding::Text {
        return Ok(false);
    }
    let field = header.require("endian", "endian")?;
    match field.value.to_ascii_lowercase().as_str() {
        "little" => Ok(false),
        "big" => Ok(true),
        _ => Err(header.refuse(field, "little or big")),
    }
}

/// Skips lines of the stored data, inflates, then skips bytes: in the order of the format.
fn voxel_bytes(
    header: &TextHeader,
    mut stream: ByteStream,
    encoding: Encoding,
    want: u64,
) -> Result<Vec<u8>, ImageError> {
    if let Some(field) = header.get("lineskip") {
        let want = "a whole number ≥ 0";
        let lines =
            u64::try_from(header.integer(field, want)?).map_err(|_| header.refuse(field, want))?;
        if !stream.skip_lines(lines)? {
            return Err(header.refuse(field, "no more lines than the data has"));
        }
    }
    if encoding == Encoding::Gzip {
        stream = stream.inflate_gzip();
    }
    if let Some(field) = header.get("byteskip") {
        let text = "a whole number ≥ 0, or -1 where the encoding is raw";
        match header.integer(field, text)? {
            -1 if encoding == Encoding::Raw => stream.skip_to_last(want)?,
            skipped if skipped >= 0 => stream.skip(skipped as u64, "the byte skip")?,
            _ => return Err(header.refuse(field, text)),
        }
    }
    match encoding {
        // Numbers have no fixed length as text: all that is there, as far as the file goes.
        Encoding::Text => stream.take(u64::MAX),
        _ => stream.voxel_bytes(want),
    }
}
