//! The voxels, decoded by the `nifti` crate from bytes that were checked here.

use std::path::Path;

use nifti::{DataElement, Endianness, InMemNiftiVolume, NiftiType};

use super::header::Header;
use crate::image::ImageError;
use crate::image::voxels::{VoxelType, Voxels};

/// Decodes the bytes of all voxels. Slope 0 keeps the crate from scaling, which would truncate
/// integers; scaling happens here, in f64.
pub(super) fn decode(path: &Path, header: &Header, bytes: Vec<u8>) -> Result<Voxels, ImageError> {
    let parts = Parts { path, header, bytes };
    match header.datatype {
        VoxelType::U8 => parts.typed(NiftiType::Uint8).map(Voxels::U8),
        VoxelType::I8 => parts.typed(NiftiType::Int8).map(Voxels::I8),
        VoxelType::U16 => parts.typed(NiftiType::Uint16).map(Voxels::U16),
        VoxelType::I16 => parts.typed(NiftiType::Int16).map(Voxels::I16),
        VoxelType::U32 => parts.typed(NiftiType::Uint32).map(Voxels::U32),
        VoxelType::I32 => parts.typed(NiftiType::Int32).map(Voxels::I32),
        VoxelType::U64 => parts.typed(NiftiType::Uint64).map(Voxels::U64),
        VoxelType::I64 => parts.typed(NiftiType::Int64).map(Voxels::I64),
        VoxelType::F32 => parts.typed(NiftiType::Float32).map(Voxels::F32),
        VoxelType::F64 => parts.typed(NiftiType::Float64).map(Voxels::F64),
    }
}

struct Parts<'a> {
    path: &'a Path,
    header: &'a Header,
    bytes: Vec<u8>,
}

impl Parts<'_> {
    fn typed<T: DataElement>(self, datatype: NiftiType) -> Result<Vec<T>, ImageError> {
        let [nx, ny, nz] = self.header.dims.map(|d| d as u16);
        let dim = [3, nx, ny, nz, 1, 1, 1, 1];
        let endianness = if self.header.big_endian { Endianness::Big } else { Endianness::Little };
        InMemNiftiVolume::from_raw_fields(dim, datatype, 0.0, 0.0, self.bytes, endianness)
            .and_then(InMemNiftiVolume::into_nifti_typed_data)
            .map_err(|source| ImageError::Decode { path: self.path.into(), source })
    }
}
