//! The maintainers that keep C on a device, by name.

use std::sync::Arc;

use yawara_inverse_update::{
    Delayed, InverseError, InverseMaintainer, SparseStiffness, StorageError,
};

use crate::device::Device;
use crate::scalar::DeviceScalar;
use crate::store::DeviceStore;

/// The inverse on a device: C in `E`, up to 96 columns of updates beside it.
///
/// In f64 scene name `gpu`; in f32 `gpu_f32`, where every solution and column is refined by K on
/// the host in f64.
pub type DeviceInverse<E> = Delayed<DeviceStore<E>>;

/// The scene names that [`build`] knows.
pub const CHOICES: &[&str] = &["gpu", "gpu_f32"];

/// Makes the maintainer of that name on a device and inverts `stiffness`. Cost: O(n³) on the host.
/// # Errors
/// [`InverseError::Unknown`] if `name` is not one of [`CHOICES`]; [`InverseError::Storage`] around
/// a [`GpuError`](crate::GpuError) if the device can't hold it; [`InverseError::Singular`].
pub fn build(
    name: &str,
    stiffness: SparseStiffness,
    device: &Arc<Device>,
) -> Result<Box<dyn InverseMaintainer>, InverseError> {
    match name {
        "gpu" => Ok(Box::new(on_device::<f64>(stiffness, device)?)),
        "gpu_f32" => Ok(Box::new(on_device::<f32>(stiffness, device)?)),
        _ => Err(InverseError::Unknown { name: name.to_owned(), choices: CHOICES }),
    }
}

/// Inverts `stiffness` on the host and keeps it on a device. Cost: O(n³) on the host.
/// # Errors
/// As [`build`].
pub fn on_device<E: DeviceScalar>(
    stiffness: SparseStiffness,
    device: &Arc<Device>,
) -> Result<DeviceInverse<E>, InverseError> {
    let store = DeviceStore::<E>::new(Arc::clone(device)).map_err(|error| {
        InverseError::Storage { method: E::NAME, cause: StorageError::new(error) }
    })?;
    Delayed::new(stiffness, store)
}
