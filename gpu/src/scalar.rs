//! The two precisions in which C can be stored on a device.

use yawara_inverse_update::Precision;

use crate::GpuError;
use crate::device::Device;
use crate::kernels::Kernels;

/// A number of C on a device: f32, refined by the host in f64, or f64 where shaders have it.
///
/// Only these two implement it, as [`Precision`] is sealed.
pub trait DeviceScalar: Precision + bytemuck::Pod {
    /// Scene name of the maintainer.
    const NAME: &'static str;
    /// What shaders call it.
    const WGSL: &'static str;
    /// Bytes of a number.
    const BYTES: u64 = size_of::<Self>() as u64;

    /// Translates the kernels of this precision, the first time.
    /// # Errors
    /// [`GpuError::NoF64`]; [`GpuError::Refused`] if the driver can't translate them.
    fn prepare(device: &Device) -> Result<(), GpuError> {
        if Self::BYTES == 8 && !device.report().shader_f64 {
            return Err(GpuError::NoF64(device.report().name.clone()));
        }
        Self::kernels(device);
        device.check()
    }

    #[doc(hidden)]
    fn kernels(device: &Device) -> &Kernels {
        let kernels = &device.kernels[usize::from(Self::BYTES == 8)];
        kernels.get_or_init(|| Kernels::new(&device.device, Self::WGSL))
    }
}

impl DeviceScalar for f32 {
    const NAME: &'static str = "gpu_f32";
    const WGSL: &'static str = "f32";
}

impl DeviceScalar for f64 {
    const NAME: &'static str = "gpu";
    const WGSL: &'static str = "f64";
}
