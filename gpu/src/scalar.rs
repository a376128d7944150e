//! The two precisions in which C can be stored on a device.

use yawara_inverse_update::Precision;

use crate::GpuError;
use crate::device::Device;
use crate::kernels::{Kernels, Translated};

/// A number of C on a device: f32, refined by the host in f64, or f64 where shaders have it.
///
/// Only these two implement it, as [`Precision`] is sealed.
pub trait DeviceScalar: Precision {
    /// Scene name of the maintainer.
    const NAME: &'static str;
    /// Bytes of a number.
    const BYTES: u64;

    /// Appends the number as the device stores it.
    fn put(self, bytes: &mut Vec<u8>);

    /// Reads a number that the device stored.
    fn take(bytes: &[u8]) -> Self;

    /// Translates the kernels of this precision, the first time.
    ///
    /// # Errors
    /// [`GpuError::NoF64`]; [`GpuError::Refused`] if the driver can't translate them.
    fn prepare(device: &Device) -> Result<(), GpuError>;

    #[doc(hidden)]
    fn kernels(device: &Device) -> &Translated;
}

impl DeviceScalar for f32 {
    const NAME: &'static str = "gpu_f32";
    const BYTES: u64 = 4;

    fn put(self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.to_le_bytes());
    }

    fn take(bytes: &[u8]) -> Self {
        bytes.try_into().map_or(f32::NAN, f32::from_le_bytes)
    }

    fn prepare(device: &Device) -> Result<(), GpuError> {
        Self::kernels(device);
        device.check()
    }

    fn kernels(device: &Device) -> &Translated {
        device.kernels_f32.get_or_init(|| Translated(Kernels::new(&device.device, "f32")))
    }
}

impl DeviceScalar for f64 {
    const NAME: &'static str = "gpu";
    const BYTES: u64 = 8;

    fn put(self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.to_le_bytes());
    }

    fn take(bytes: &[u8]) -> Self {
        bytes.try_into().map_or(f64::NAN, f64::from_le_bytes)
    }

    fn prepare(device: &Device) -> Result<(), GpuError> {
        if !device.report().shader_f64 {
            return Err(GpuError::NoF64 { adapter: device.report().name.clone() });
        }
        Self::kernels(device);
        device.check()
    }

    fn kernels(device: &Device) -> &Translated {
        device.kernels_f64.get_or_init(|| Translated(Kernels::new(&device.device, "f64")))
    }
}
