//! The 348 bytes at the start of a NIfTI-1 file, checked field by field.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::image::ImageError;
use crate::image::placement::VoxelAffine;
use crate::image::voxels::{VoxelType, check_count};

/// Length of a NIfTI-1 header.
pub(super) const HEADER_BYTES: usize = 348;

/// Where voxels may start at the earliest: after the header and 4 bytes of extension flags.
const FIRST_OFFSET: f32 = 352.0;

/// `vox_offset` is an f32 and a multiple of 16 by custom; beyond this it can't count them all.
const LAST_OFFSET: f32 = 268_435_456.0;

/// b² + c² + d² of a unit quaternion may exceed 1 by rounding only.
const MAX_QUATERNION: f64 = 1.0 + 1e-3;

/// What the reader needs of a header, in range.
pub(super) struct Header {
    pub big_endian: bool,
    /// Voxels along the file's axes, each 1..=32767.
    pub dims: [usize; 3],
    pub datatype: VoxelType,
    pub vox_offset: u64,
    /// dims[0] · dims[1] · dims[2] · bytes per voxel.
    pub voxel_bytes: u64,
    /// Slope and intercept, `None` where values are stored as they are.
    pub scale: Option<[f64; 2]>,
    /// By the sform, else the qform, else the spacings alone.
    pub affine: VoxelAffine,
}

impl Header {
    /// Reads and checks the fields.
    pub fn parse(bytes: &[u8; HEADER_BYTES]) -> Result<Self, ImageError> {
        let big_endian = check_start(bytes)?;
        let fields = Fields { bytes, big: big_endian };
        fields.check_magic()?;
        let dims = fields.dims()?;
        let datatype = fields.datatype()?;
        let voxels: u64 = dims.iter().map(|&d| d as u64).product();
        Ok(Self {
            big_endian,
            dims,
            datatype,
            vox_offset: fields.vox_offset()?,
            voxel_bytes: voxels * datatype.bytes(),
            scale: fields.scale()?,
            affine: fields.affine()?,
        })
    }
}

/// Whether the bytes are big-endian, by `sizeof_hdr`, the first field, or why this is no NIfTI-1
/// file.
pub(super) fn check_start(bytes: &[u8]) -> Result<bool, ImageError> {
    let refuse = |value: String| {
        let want = "348 in either byte order";
        Err(ImageError::NotNifti { field: "sizeof_hdr", value, want })
    };
    let Some(first) = bytes.first_chunk::<4>() else {
        return refuse(format!("missing ({} bytes in all)", bytes.len()));
    };
    match (i32::from_le_bytes(*first), i32::from_be_bytes(*first)) {
        (348, _) => Ok(false),
        (_, 348) => Ok(true),
        (540, _) | (_, 540) => refuse("540 (NIfTI-2; convert it to NIfTI-1)".into()),
        (other, _) => refuse(other.to_string()),
    }
}

struct Fields<'a> {
    bytes: &'a [u8; HEADER_BYTES],
    big: bool,
}

impl Fields<'_> {
    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|i| self.bytes[at + i])
    }

    fn i16(&self, at: usize) -> i16 {
        let bytes = self.array(at);
        if self.big { i16::from_be_bytes(bytes) } else { i16::from_le_bytes(bytes) }
    }

    fn f32(&self, at: usize) -> f32 {
        let bytes = self.array(at);
        if self.big { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }
    }

    fn finite(&self, field: &'static str, at: usize) -> Result<f64, ImageError> {
        let value = f64::from(self.f32(at));
        if value.is_finite() { Ok(value) } else { Err(wrong(field, value, "finite")) }
    }

    /// Three numbers, `stride` bytes from one to the next.
    fn vector(
        &self,
        names: [&'static str; 3],
        at: usize,
        stride: usize,
    ) -> Result<Vector3<f64>, ImageError> {
        let number = |i: usize| self.finite(names[i], at + stride * i);
        Ok(Vector3::new(number(0)?, number(1)?, number(2)?))
    }

    fn check_magic(&self) -> Result<(), ImageError> {
        match &self.array::<4>(344) {
            b"n+1\0" => Ok(()),
            b"ni1\0" => Err(ImageError::HeaderPair),
            other => {
                let (value, want) = (format!("\"{}\"", other.escape_ascii()), "\"n+1\\x00\"");
                Err(ImageError::NotNifti { field: "magic", value, want })
            }
        }
    }

    fn dims(&self) -> Result<[usize; 3], ImageError> {
        const NAMES: [&str; 8] =
            ["dim[0]", "dim[1]", "dim[2]", "dim[3]", "dim[4]", "dim[5]", "dim[6]", "dim[7]"];
        let dim: [i16; 8] = std::array::from_fn(|i| self.i16(40 + 2 * i));
        let rank = dim[0];
        if !(3..=7).contains(&rank) {
            return Err(wrong(NAMES[0], rank.into(), "3, or 4 to 7 with trailing ones"));
        }
        if let Some(i) = (1..=rank as usize).find(|&i| dim[i] < 1) {
            return Err(wrong(NAMES[i], dim[i].into(), "1 to 32767"));
        }
        // Below 2⁶⁰: four factors below 2¹⁵.
        let count: u64 = dim[4..=rank as usize].iter().map(|&d| d as u64).product();
        if count > 1 {
            return Err(ImageError::NotThreeDimensional { rank, count });
        }
        let dims = [dim[1], dim[2], dim[3]];
        check_count(dims.map(|d| d as u64))?;
        Ok(dims.map(|d| d as usize))
    }

    /// The type of a voxel.
    fn datatype(&self) -> Result<VoxelType, ImageError> {
        let code = self.i16(70);
        let refuse = |name| Err(ImageError::Datatype { code, name });
        let (datatype, want) = match code {
            2 => (VoxelType::U8, "8, as its datatype 2 (uint8)"),
            4 => (VoxelType::I16, "16, as its datatype 4 (int16)"),
            8 => (VoxelType::I32, "32, as its datatype 8 (int32)"),
            16 => (VoxelType::F32, "32, as its datatype 16 (float32)"),
            64 => (VoxelType::F64, "64, as its datatype 64 (float64)"),
            256 => (VoxelType::I8, "8, as its datatype 256 (int8)"),
            512 => (VoxelType::U16, "16, as its datatype 512 (uint16)"),
            768 => (VoxelType::U32, "32, as its datatype 768 (uint32)"),
            1024 => (VoxelType::I64, "64, as its datatype 1024 (int64)"),
            1280 => (VoxelType::U64, "64, as its datatype 1280 (uint64)"),
            1 => return refuse("binary, 1 bit"),
            32 => return refuse("complex64"),
            128 => return refuse("RGB24"),
            1536 => return refuse("float128"),
            1792 => return refuse("complex128"),
            2048 => return refuse("complex256"),
            2304 => return refuse("RGBA32"),
            _ => return refuse("unknown"),
        };
        let bitpix = self.i16(72);
        if i64::from(bitpix) != 8 * datatype.bytes() as i64 {
            return Err(wrong("bitpix", bitpix.into(), want));
        }
        Ok(datatype)
    }

    fn vox_offset(&self) -> Result<u64, ImageError> {
        let offset = self.f32(108);
        if !(FIRST_OFFSET..=LAST_OFFSET).contains(&offset) || offset.fract() != 0.0 {
            let want = "a whole number of bytes from 352 to 268435456";
            return Err(wrong("vox_offset", offset.into(), want));
        }
        Ok(offset as u64)
    }

    /// The standard: no scaling where the slope is 0; not finite counts as unset too.
    fn scale(&self) -> Result<Option<[f64; 2]>, ImageError> {
        let slope = f64::from(self.f32(112));
        if slope == 0.0 || !slope.is_finite() {
            return Ok(None);
        }
        let inter = self.finite("scl_inter", 116)?;
        Ok((slope != 1.0 || inter != 0.0).then_some([slope, inter]))
    }

    fn affine(&self) -> Result<VoxelAffine, ImageError> {
        let unit_mm = self.unit_mm()?;
        let spacing_mm = self.spacing()?.map(|spacing| spacing * unit_mm);
        let mut qform = None;
        if self.i16(252) > 0 {
            let offset = self.vector(["qoffset_x", "qoffset_y", "qoffset_z"], 268, 4)?;
            qform = Some((self.vector(["quatern_b", "quatern_c", "quatern_d"], 256, 4)?, offset));
        }
        if self.i16(254) > 0 {
            let column = |j: usize| self.vector(["srow_x", "srow_y", "srow_z"], 280 + 4 * j, 16);
            let columns = [column(0)? * unit_mm, column(1)? * unit_mm, column(2)? * unit_mm];
            return Ok(VoxelAffine { form: "sform", columns, first_centre: column(3)? * unit_mm });
        }
        let Some((imaginary, offset)) = qform else {
            let columns = [0, 1, 2].map(|i| Vector3::ith(i, spacing_mm[i]));
            return Ok(VoxelAffine { form: "pixdim", columns, first_centre: Vector3::zeros() });
        };
        let squared = imaginary.norm_squared();
        if squared > MAX_QUATERNION {
            let field = "quatern_b² + quatern_c² + quatern_d²";
            return Err(wrong(field, squared, "at most 1, as of a unit quaternion"));
        }
        let real = (1.0 - squared).max(0.0).sqrt();
        let turn = UnitQuaternion::from_quaternion(Quaternion::from_parts(real, imaginary));
        let qfac = if self.f32(76) < 0.0 { -1.0 } else { 1.0 };
        let [x, y, z] = spacing_mm;
        let columns =
            [turn * Vector3::x() * x, turn * Vector3::y() * y, turn * Vector3::z() * (z * qfac)];
        Ok(VoxelAffine { form: "qform", columns, first_centre: offset * unit_mm })
    }

    /// Millimetres per unit of length.
    fn unit_mm(&self) -> Result<f64, ImageError> {
        match self.bytes[123] & 7 {
            0 | 2 => Ok(1.0),
            1 => Ok(1000.0),
            3 => Ok(0.001),
            other => {
                let want = "0 (unknown), 1 (metre), 2 (mm) or 3 (micron) in its low 3 bits";
                Err(wrong("xyzt_units", other.into(), want))
            }
        }
    }

    fn spacing(&self) -> Result<[f64; 3], ImageError> {
        let names = ["pixdim[1]", "pixdim[2]", "pixdim[3]"];
        let spacing = [80, 84, 88].map(|at| f64::from(self.f32(at)));
        match (0..3).find(|&i| !(spacing[i] > 0.0 && spacing[i].is_finite())) {
            Some(i) => Err(wrong(names[i], spacing[i], "a finite spacing > 0")),
            None => Ok(spacing),
        }
    }
}

fn wrong(field: &'static str, value: f64, want: &'static str) -> ImageError {
    ImageError::Header { field, value, want }
}
