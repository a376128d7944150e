/// Why no device can be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The Vulkan loader or every driver is missing, or no driver offers a device.
    #[error("no Vulkan adapter; install mesa-vulkan-drivers or choose another inverse")]
    NoAdapter,

    /// wgpu has no Vulkan for the system that this program was built for.
    #[error("no Vulkan on {target_os}; choose another inverse")]
    NoVulkan {
        /// The system, as in `std::env::consts::OS`.
        target_os: &'static str,
    },
}
