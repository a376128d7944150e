//! The bytes at the start of a NIfTI file, 348 in version 1 and 540 in version 2, checked field by field.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::image::ImageError;
use crate::image::placement::VoxelAffine;
use crate::image::voxels::{VoxelType, check_count};

/// Length of the shorter header, by which a file is recognised.
pub(super) const LEAST_BYTES: usize = 348;

/// `vox_offset` is an f32 in version 1 and a multiple of 16 by custom; beyond this it can't count them
/// all.
const LAST_OFFSET: f64 = 268_435_456.0;

/// b² + c² + d² of a unit quaternion may exceed 1 by rounding only.
const MAX_QUATERNION: f64 = 1.0 + 1e-3;

/// What the reader needs of a header, in range.
pub(super) struct Header {
    pub big_endian: bool,
    /// Voxels along the file's axes, each ≥ 1.
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
    /// Reads and checks the fields of a header that [starts](Start::of) so and is as long as it says.
    pub fn parse(bytes: &[u8], start: Start) -> Result<Self, ImageError> {
        let fields = Fields { bytes, start };
        fields.check_magic()?;
        let dims = fields.dims()?;
        let datatype = fields.datatype()?;
        let voxels: u64 = dims.iter().map(|&d| d as u64).product();
        Ok(Self {
            big_endian: start.big,
            dims,
            datatype,
            vox_offset: fields.vox_offset()?,
            voxel_bytes: voxels * datatype.bytes(),
            scale: fields.scale()?,
            affine: fields.affine()?,
        })
    }
}

/// What the first field of a header, its length, tells.
#[derive(Clone, Copy)]
pub(super) struct Start {
    big: bool,
    /// Of version 2, whose fields are wider and elsewhere.
    wide: bool,
}

impl Start {
    /// By `sizeof_hdr`, or why this is no NIfTI file.
    pub fn of(bytes: &[u8]) -> Result<Self, ImageError> {
        let refuse = |value: String| {
            let want = "348 or 540 in either byte order";
            Err(ImageError::NotNifti { field: "sizeof_hdr", value, want })
        };
        let Some(first) = bytes.first_chunk::<4>() else {
            return refuse(format!("missing ({} bytes in all)", bytes.len()));
        };
        match (i32::from_le_bytes(*first), i32::from_be_bytes(*first)) {
            (length @ (348 | 540), _) => Ok(Self { big: false, wide: length == 540 }),
            (_, length @ (348 | 540)) => Ok(Self { big: true, wide: length == 540 }),
            (other, _) => refuse(other.to_string()),
        }
    }

    /// Length of the header.
    pub fn header_bytes(self) -> usize {
        if self.wide { 540 } else { LEAST_BYTES }
    }
}

/// A header's bytes. Where a field lies is given for both versions, `[1, 2]`.
struct Fields<'a> {
    bytes: &'a [u8],
    start: Start,
}

impl Fields<'_> {
    fn at(&self, places: [usize; 2]) -> usize {
        places[usize::from(self.start.wide)]
    }

    /// `count` bytes from `at` on, least significant first in the low end of eight.
    fn low_bytes(&self, at: usize, count: usize) -> [u8; 8] {
        let byte = |i: usize| self.bytes[at + if self.start.big { count - 1 - i } else { i }];
        std::array::from_fn(|i| if i < count { byte(i) } else { 0 })
    }

    /// A signed integer of so many bytes in either version.
    fn integer(&self, places: [usize; 2], widths: [usize; 2]) -> i64 {
        let (at, width) = (self.at(places), self.at(widths));
        let unused = 64 - 8 * width as u32;
        i64::from_le_bytes(self.low_bytes(at, width)) << unused >> unused
    }

    /// A code, whose type is not the same in both versions.
    fn code(&self, places: [usize; 2]) -> i64 {
        self.integer(places, [2, 4])
    }

    /// A float, single in version 1 and double in version 2.
    fn real(&self, places: [usize; 2]) -> f64 {
        let at = self.at(places);
        match self.start.wide {
            true => f64::from_bits(u64::from_le_bytes(self.low_bytes(at, 8))),
            false => {
                let bits = u64::from_le_bytes(self.low_bytes(at, 4));
                f64::from(f32::from_bits(bits as u32))
            }
        }
    }

    fn finite(&self, field: &'static str, places: [usize; 2]) -> Result<f64, ImageError> {
        let value = self.real(places);
        if value.is_finite() { Ok(value) } else { Err(wrong(field, value, "finite")) }
    }

    /// Three numbers, `stride` floats from one to the next.
    fn vector(
        &self,
        names: [&'static str; 3],
        [one, two]: [usize; 2],
        stride: usize,
    ) -> Result<Vector3<f64>, ImageError> {
        let places = |i: usize| [one + 4 * stride * i, two + 8 * stride * i];
        let number = |i: usize| self.finite(names[i], places(i));
        Ok(Vector3::new(number(0)?, number(1)?, number(2)?))
    }

    fn check_magic(&self) -> Result<(), ImageError> {
        let (found, single, pair, want) = match self.start.wide {
            false => (&self.bytes[344..348], &b"n+1\0"[..], &b"ni1\0"[..], "\"n+1\\x00\""),
            true => (
                &self.bytes[4..12],
                &b"n+2\0\r\n\x1a\n"[..],
                &b"ni2\0\r\n\x1a\n"[..],
                "\"n+2\\x00\\r\\n\\x1a\\n\"",
            ),
        };
        if found == pair {
            return Err(ImageError::HeaderPair);
        }
        if found != single {
            let value = format!("\"{}\"", found.escape_ascii());
            return Err(ImageError::NotNifti { field: "magic", value, want });
        }
        Ok(())
    }

    fn dims(&self) -> Result<[usize; 3], ImageError> {
        const NAMES: [&str; 8] =
            ["dim[0]", "dim[1]", "dim[2]", "dim[3]", "dim[4]", "dim[5]", "dim[6]", "dim[7]"];
        let dim: [i64; 8] = std::array::from_fn(|i| self.integer([40 + 2 * i, 16 + 8 * i], [2, 8]));
        let rank = dim[0];
        if !(3..=7).contains(&rank) {
            return Err(wrong(NAMES[0], rank as f64, "3, or 4 to 7 with trailing ones"));
        }
        if let Some(i) = (1..=rank as usize).find(|&i| dim[i] < 1) {
            let want = if self.start.wide { "at least 1" } else { "1 to 32767" };
            return Err(wrong(NAMES[i], dim[i] as f64, want));
        }
        let others = dim[4..=rank as usize].iter();
        let count = others.fold(1, |product: u64, &d| product.saturating_mul(d as u64));
        if count > 1 {
            return Err(ImageError::NotThreeDimensional { rank, count });
        }
        let dims = [dim[1], dim[2], dim[3]];
        check_count(dims.map(|d| d as u64))?;
        Ok(dims.map(|d| d as usize))
    }

    /// The type of a voxel.
    fn datatype(&self) -> Result<VoxelType, ImageError> {
        let code = self.integer([70, 12], [2, 2]);
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
        let bitpix = self.integer([72, 14], [2, 2]);
        if bitpix != 8 * datatype.bytes() as i64 {
            return Err(wrong("bitpix", bitpix as f64, want));
        }
        Ok(datatype)
    }

    fn vox_offset(&self) -> Result<u64, ImageError> {
        let offset = match self.start.wide {
            true => self.integer([0, 168], [0, 8]) as f64,
            false => self.real([108, 0]),
        };
        // After the header and 4 bytes of extension flags.
        let first = (self.start.header_bytes() + 4) as f64;
        if !(first..=LAST_OFFSET).contains(&offset) || offset.fract() != 0.0 {
            let want = match self.start.wide {
                true => "a whole number of bytes from 544 to 268435456",
                false => "a whole number of bytes from 352 to 268435456",
            };
            return Err(wrong("vox_offset", offset, want));
        }
        Ok(offset as u64)
    }

    /// The standard: no scaling where the slope is 0; not finite counts as unset too.
    fn scale(&self) -> Result<Option<[f64; 2]>, ImageError> {
        let slope = self.real([112, 176]);
        if slope == 0.0 || !slope.is_finite() {
            return Ok(None);
        }
        let inter = self.finite("scl_inter", [116, 184])?;
        Ok((slope != 1.0 || inter != 0.0).then_some([slope, inter]))
    }

    fn affine(&self) -> Result<VoxelAffine, ImageError> {
        let unit_mm = self.unit_mm()?;
        let spacing_mm = self.spacing()?.map(|spacing| spacing * unit_mm);
        let mut qform = None;
        if self.code([252, 344]) > 0 {
            let offset = self.vector(["qoffset_x", "qoffset_y", "qoffset_z"], [268, 376], 1)?;
            qform = Some((
                self.vector(["quatern_b", "quatern_c", "quatern_d"], [256, 352], 1)?,
                offset,
            ));
        }
        if self.code([254, 348]) > 0 {
            let names = ["srow_x", "srow_y", "srow_z"];
            let column = |j: usize| self.vector(names, [280 + 4 * j, 400 + 8 * j], 4);
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
        let qfac = if self.real([76, 104]) < 0.0 { -1.0 } else { 1.0 };
        let [x, y, z] = spacing_mm;
        let columns =
            [turn * Vector3::x() * x, turn * Vector3::y() * y, turn * Vector3::z() * (z * qfac)];
        Ok(VoxelAffine { form: "qform", columns, first_centre: offset * unit_mm })
    }

    /// Millimetres per unit of length.
    fn unit_mm(&self) -> Result<f64, ImageError> {
        match self.integer([123, 500], [1, 4]) & 7 {
            0 | 2 => Ok(1.0),
            1 => Ok(1000.0),
            3 => Ok(0.001),
            other => {
                let want = "0 (unknown), 1 (metre), 2 (mm) or 3 (micron) in its low 3 bits";
                Err(wrong("xyzt_units", other as f64, want))
            }
        }
    }

    fn spacing(&self) -> Result<[f64; 3], ImageError> {
        let names = ["pixdim[1]", "pixdim[2]", "pixdim[3]"];
        let spacing = [1, 2, 3].map(|i| self.real([76 + 4 * i, 104 + 8 * i]));
        match (0..3).find(|&i| !(spacing[i] > 0.0 && spacing[i].is_finite())) {
            Some(i) => Err(wrong(names[i], spacing[i], "a finite spacing > 0")),
            None => Ok(spacing),
        }
    }
}

fn wrong(field: &'static str, value: f64, want: &'static str) -> ImageError {
    ImageError::Header { field, value, want }
}
