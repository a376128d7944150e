use std::time::Duration;

/// Why no device can be used, or no longer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The Vulkan loader or every driver is missing, or no driver offers a device.
    #[error("no Vulkan adapter; install mesa-vulkan-drivers or choose another inverse")]
    NoAdapter,

    /// wgpu has no Vulkan for the system that this program was built for.
    /// The system is named as in `std::env::consts::OS`.
    #[error("no Vulkan on {0}; choose another inverse")]
    NoVulkan(&'static str),

    /// No adapter has that number or name.
    #[error(
        "no adapter is {choice}, want one of these by its number or a part of its name: {found}"
    )]
    NoSuchAdapter {
        /// What was asked for.
        choice: String,
        /// The adapters of this machine.
        found: String,
    },

    /// A name that more than one adapter has.
    #[error(
        "{choice} is a part of several adapters' names, choose one by its number or a longer part: \
         {found}"
    )]
    SeveralAdapters {
        /// What was asked for.
        choice: String,
        /// The adapters that have it.
        found: String,
    },

    /// The device, an adapter by its name, can't compute in 64 bits.
    #[error("{0} has no 64-bit floating point in shaders; choose the inverse gpu_f32")]
    NoF64(String),

    /// A limit of the device or of the options is below what the kernels need.
    #[error("{adapter}: {limit} is {got}, want at least {want}; choose another inverse")]
    Limit {
        /// Name of the adapter.
        adapter: String,
        /// Which limit.
        limit: &'static str,
        /// What it is.
        got: u64,
        /// What is needed.
        want: u64,
    },

    /// The driver refused to open the device.
    #[error("{adapter} does not open: {reason}")]
    NotOpened {
        /// Name of the adapter.
        adapter: String,
        /// The driver's words.
        reason: String,
    },

    /// Memory does not suffice for a buffer.
    #[error(
        "{what} takes {bytes} bytes on the device, {left} are left: choose gpu_f32, fewer vertices \
         or another inverse"
    )]
    OutOfMemory {
        /// Which buffer.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// What is left of the budget, 0 where the driver refused.
        left: u64,
    },

    /// The device went away: it was removed, reset or destroyed, in the driver's words. All that it
    /// held is lost.
    #[error("the device is lost ({0}): what it held is gone, K is kept; start again")]
    Lost(String),

    /// The device did not answer in that time.
    #[error("the device did not answer within {} s", .0.as_secs())]
    Timeout(Duration),

    /// The interface refused a command, in its own words: a bug of this crate, or of the driver.
    #[error("the device refused a command: {0}")]
    Refused(String),
}
