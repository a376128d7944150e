//! Reads NIfTI-1 images (.nii, .nii.gz) as label or intensity volumes in RAS+ orientation.
//!
//! The header is checked before the `nifti` crate decodes the voxels, because that crate trusts
//! the dimensions and ignores `vox_offset`. Memory grows with the bytes that arrive, never with
//! what a header claims.

mod affine;
mod header;

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use nifti::{DataElement, InMemNiftiVolume, NiftiType};

use crate::MeshError;
use crate::volume::{IntensityVolume, LabelVolume};
use affine::Placement;
use header::{HEADER_BYTES, Header};

/// The largest magnitude up to which every integer is an f64.
const EXACT_F64: f64 = 9_007_199_254_740_992.0;

/// Reads a label map: one integer per voxel, of any integer or float type.
///
/// Compression is recognised by the gzip magic, not by the name. Axes are permuted and flipped
/// to RAS+; a remaining rotation stays in the grid. An unknown unit counts as millimetre. The
/// scale (`scl_slope`, `scl_inter`) is applied unless the slope is 0 or not finite. The spacing
/// of the grid is the geometric mean of the three.
///
/// Cost: O(voxels); at most three copies of the stored bytes and 2 bytes a voxel in memory.
///
/// # Errors
/// [`MeshError`] that names the file and the field: no readable file, no NIfTI-1 image, a
/// header that contradicts the file's length, more than one volume, more than 2³¹ voxels, a
/// complex or colour datatype, spacings ≤ 0, not finite or more than 1 % apart, a singular or
/// sheared affine, a voxel that is no integer, more than 65 535 labels.
/// # Source
/// nifti1.h, <https://nifti.nimh.nih.gov/nifti-1>.
pub fn read_labels(path: &Path) -> Result<LabelVolume, MeshError> {
    let image = Image::read(path)?;
    match image.header.datatype {
        NiftiType::Uint8 => image.labels(u8::into),
        NiftiType::Int8 => image.labels(i8::into),
        NiftiType::Uint16 => image.labels(u16::into),
        NiftiType::Int16 => image.labels(i16::into),
        NiftiType::Uint32 => image.labels(u32::into),
        NiftiType::Int32 => image.labels(i32::into),
        NiftiType::Uint64 => image.labels(Sample::from_u64),
        NiftiType::Int64 => image.labels(Sample::Integer),
        NiftiType::Float32 => image.labels(|v: f32| Sample::Float(v.into())),
        _ => image.labels(Sample::Float),
    }
}

/// Reads an intensity image, e.g. a CT in Hounsfield units: one finite f32 per voxel, scaled.
///
/// File, orientation, spacing and scale are treated as by [`read_labels`].
///
/// # Errors
/// As [`read_labels`], but for the labels; a voxel that is NaN, infinite or beyond f32.
/// # Source
/// nifti1.h, <https://nifti.nimh.nih.gov/nifti-1>.
pub fn read_intensities(path: &Path) -> Result<IntensityVolume, MeshError> {
    let image = Image::read(path)?;
    match image.header.datatype {
        NiftiType::Uint8 => image.intensities(u8::into),
        NiftiType::Int8 => image.intensities(i8::into),
        NiftiType::Uint16 => image.intensities(u16::into),
        NiftiType::Int16 => image.intensities(i16::into),
        NiftiType::Uint32 => image.intensities(u32::into),
        NiftiType::Int32 => image.intensities(i32::into),
        NiftiType::Uint64 => image.intensities(Sample::from_u64),
        NiftiType::Int64 => image.intensities(Sample::Integer),
        NiftiType::Float32 => image.intensities(|v: f32| Sample::Float(v.into())),
        _ => image.intensities(Sample::Float),
    }
}

/// A stored voxel before scaling; integers stay integers, since f64 holds them only to 2⁵³.
#[derive(Clone, Copy)]
enum Sample {
    Integer(i64),
    Float(f64),
}

macro_rules! sample_from {
    ($($integer:ty)*) => {$(
        impl From<$integer> for Sample {
            fn from(value: $integer) -> Self {
                Self::Integer(value.into())
            }
        }
    )*};
}
sample_from!(u8 i8 u16 i16 u32 i32);

impl Sample {
    /// Beyond i64 it becomes a float, which is too large for a label and good for intensities.
    fn from_u64(value: u64) -> Self {
        i64::try_from(value).map_or(Self::Float(value as f64), Self::Integer)
    }

    fn scaled(self, scale: Option<[f64; 2]>) -> Self {
        let Some([slope, inter]) = scale else { return self };
        Self::Float(self.value() * slope + inter)
    }

    fn value(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Float(value) => value,
        }
    }

    fn label(self) -> Option<i64> {
        match self {
            Self::Integer(value) => Some(value),
            // NaN and infinity fail the comparison of magnitudes.
            Self::Float(value) => {
                (value.abs() <= EXACT_F64 && value.fract() == 0.0).then_some(value as i64)
            }
        }
    }
}

/// A checked header with the bytes of all voxels.
struct Image<'a> {
    path: &'a Path,
    header: Header,
    placement: Placement,
    bytes: Vec<u8>,
}

impl<'a> Image<'a> {
    fn read(path: &'a Path) -> Result<Self, MeshError> {
        let io_error = |source| MeshError::Io { path: path.into(), source };
        let metadata = fs::metadata(path).map_err(io_error)?;
        if !metadata.is_file() {
            let found = if metadata.is_dir() { "a directory" } else { "no regular file" };
            return Err(MeshError::NotAFile { path: path.into(), found });
        }
        let mut file = BufReader::new(File::open(path).map_err(io_error)?);
        let start = file.fill_buf().map_err(io_error)?;
        if start.is_empty() {
            return Err(MeshError::EmptyFile { path: path.into() });
        }
        let mut stream = if start.starts_with(&[0x1f, 0x8b]) {
            // Only inflating tells how much a gzip stream holds.
            Stream { path, source: Box::new(MultiGzDecoder::new(file)), length: None }
        } else {
            Stream { path, source: Box::new(file), length: Some(metadata.len()) }
        };
        let header = Header::parse(path, &stream.header()?)?;
        let placement = Placement::new(path, &header)?;
        let bytes = stream.voxels(&header)?;
        Ok(Self { path, header, placement, bytes })
    }

    /// Decodes the voxels in the file's order.
    fn decode<T: DataElement>(&mut self) -> Result<Vec<T>, MeshError> {
        let dims = self.header.dims.map(|d| d as u16);
        let dim = [3, dims[0], dims[1], dims[2], 1, 1, 1, 1];
        let bytes = std::mem::take(&mut self.bytes);
        // Slope 0: scaled here, in f64, where the decoder would truncate integers.
        let (datatype, endianness) = (self.header.datatype, self.header.endianness);
        InMemNiftiVolume::from_raw_fields(dim, datatype, 0.0, 0.0, bytes, endianness)
            .and_then(InMemNiftiVolume::into_nifti_typed_data)
            .map_err(|source| MeshError::Decode { path: self.path.into(), source })
    }

    fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.header.dims;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    fn labels<T: DataElement>(
        mut self,
        sample: impl Fn(T) -> Sample + Copy,
    ) -> Result<LabelVolume, MeshError> {
        let stored = self.decode()?;
        let scale = self.header.scale;
        let scaled = move |&stored: &T| sample(stored).scaled(scale);
        if let Some(index) = stored.iter().position(|v| scaled(v).label().is_none()) {
            let value = scaled(&stored[index]).value();
            let voxel = self.voxel(index);
            return Err(MeshError::LabelValue { path: self.path.into(), voxel, value });
        }
        let stored = self.placement.reorient(stored);
        let labels = stored.iter().map(|v| scaled(v).label().unwrap_or(0));
        LabelVolume::from_original(self.placement.grid, labels)
    }

    fn intensities<T: DataElement>(
        mut self,
        sample: impl Fn(T) -> Sample + Copy,
    ) -> Result<IntensityVolume, MeshError> {
        let stored: Vec<T> = self.decode()?;
        let scale = self.header.scale;
        let mut values = Vec::with_capacity(stored.len());
        for (index, &stored) in stored.iter().enumerate() {
            let value = sample(stored).scaled(scale).value();
            if !(value as f32).is_finite() {
                let voxel = self.voxel(index);
                return Err(MeshError::IntensityValue { path: self.path.into(), voxel, value });
            }
            values.push(value as f32);
        }
        let values = self.placement.reorient(values);
        IntensityVolume::new(self.placement.grid, values)
    }
}

/// The (inflated) bytes of a file, from the start.
struct Stream<'a> {
    path: &'a Path,
    source: Box<dyn Read>,
    /// Bytes in all, where that is known beforehand.
    length: Option<u64>,
}

impl Stream<'_> {
    /// Up to `want` bytes, fewer only at the end of the file.
    fn take(&mut self, want: u64) -> Result<Vec<u8>, MeshError> {
        let mut bytes = Vec::new();
        match self.source.by_ref().take(want).read_to_end(&mut bytes) {
            Ok(_) => Ok(bytes),
            Err(error) => self.failed(error, bytes),
        }
    }

    fn failed(&self, source: io::Error, got: Vec<u8>) -> Result<Vec<u8>, MeshError> {
        match self.length {
            Some(_) => Err(MeshError::Io { path: self.path.into(), source }),
            // A gzip stream cut short: what came before the cut tells what is missing.
            None if source.kind() == io::ErrorKind::UnexpectedEof => Ok(got),
            None => Err(MeshError::Gzip { path: self.path.into(), source }),
        }
    }

    fn length_error(&self, part: &'static str, found: u64, want: u64) -> MeshError {
        MeshError::Length { path: self.path.into(), part, found, more: found > want, want }
    }

    fn header(&mut self) -> Result<[u8; HEADER_BYTES], MeshError> {
        let bytes = self.take(HEADER_BYTES as u64)?;
        header::check_start(self.path, &bytes)?;
        let found = bytes.len() as u64;
        bytes.try_into().map_err(|_| self.length_error("header", found, HEADER_BYTES as u64))
    }

    /// The bytes from `vox_offset` to the end, exactly as many as the header announces.
    fn voxels(&mut self, header: &Header) -> Result<Vec<u8>, MeshError> {
        let want = header.voxel_bytes;
        if let Some(length) = self.length {
            let found = length.saturating_sub(header.vox_offset);
            if found != want {
                return Err(self.length_error("voxel data", found, want));
            }
        }
        let gap = header.vox_offset - HEADER_BYTES as u64;
        let skipped = match io::copy(&mut self.source.by_ref().take(gap), &mut io::sink()) {
            Ok(skipped) => skipped,
            Err(error) => self.failed(error, Vec::new())?.len() as u64,
        };
        if skipped < gap {
            return Err(self.length_error("extensions before vox_offset", skipped, gap));
        }
        let bytes = self.take(want)?;
        // The byte after the last proves the end, and makes gzip verify its checksum.
        let found =
            bytes.len() as u64 + if bytes.len() as u64 == want { self.excess()? } else { 0 };
        if found != want { Err(self.length_error("voxel data", found, want)) } else { Ok(bytes) }
    }

    /// 1 if there is another byte, 0 at the end of an intact stream.
    fn excess(&mut self) -> Result<u64, MeshError> {
        let mut byte = [0];
        self.source.read(&mut byte).map(|n| n as u64).map_err(|source| match self.length {
            Some(_) => MeshError::Io { path: self.path.into(), source },
            None => MeshError::Gzip { path: self.path.into(), source },
        })
    }
}
