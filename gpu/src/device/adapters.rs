//! The list of adapters, in an order that is the same in every run.

use wgpu::{Backends, Instance, InstanceDescriptor, InstanceFlags};

use super::report::AdapterReport;
use crate::GpuError;

/// Lists the Vulkan adapters of this machine: discrete, integrated, virtual, CPU, other, and among
/// equals by name, PCI address, ids and driver, so that an index means the same device in
/// every run on an unchanged machine.
///
/// The list is never empty. Layers for debugging are never switched on and no environment variable
/// of wgpu is read; those of the Vulkan loader (`VK_DRIVER_FILES`, …) act as usual.
///
/// Cost: loads the Vulkan loader and all its drivers, 10–500 ms; opens no device.
/// # Errors
/// [`GpuError::NoAdapter`] without a loader, a driver or a device; [`GpuError::NoVulkan`] where
/// wgpu does not offer Vulkan (macOS).
pub fn adapters() -> Result<Vec<AdapterReport>, GpuError> {
    Ok(found()?.into_iter().map(|(_, report)| report).collect())
}

/// The adapters themselves, in the order of the list.
pub(crate) fn found() -> Result<Vec<(wgpu::Adapter, AdapterReport)>, GpuError> {
    // wgpu panics when asked for an instance without any backend.
    if !Instance::enabled_backend_features().contains(Backends::VULKAN) {
        return Err(GpuError::NoVulkan(std::env::consts::OS));
    }
    let instance = Instance::new(InstanceDescriptor {
        backends: Backends::VULKAN,
        // The default differs between debug and release builds, and its check of indirect
        // dispatches lowers the limits; dispatches are never indirect here.
        flags: InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    });
    let adapters = pollster::block_on(instance.enumerate_adapters(Backends::VULKAN));
    if adapters.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let report = |adapter: wgpu::Adapter| {
        let report = AdapterReport::of(&adapter);
        (adapter, report)
    };
    let mut found: Vec<_> = adapters.into_iter().map(report).collect();
    found.sort_by(|(_, a), (_, b)| a.order(b));
    Ok(found)
}
