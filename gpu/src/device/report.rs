//! What an adapter is and can hold.

use std::cmp::Ordering;
use std::fmt;

/// The kind of hardware behind an adapter, best first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum DeviceType {
    /// A card with its own memory.
    Discrete,
    /// A processor's graphics part, which shares the host's memory.
    Integrated,
    /// A share of a card in a virtual machine.
    Virtual,
    /// A driver that computes on the host's cores, such as lavapipe.
    Cpu,
    /// Anything else that the driver does not name.
    Other,
}

/// Prints the lower-case name, e.g. `discrete`.
impl fmt::Display for DeviceType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{self:?}").to_lowercase())
    }
}

impl From<wgpu::DeviceType> for DeviceType {
    fn from(kind: wgpu::DeviceType) -> Self {
        match kind {
            wgpu::DeviceType::DiscreteGpu => DeviceType::Discrete,
            wgpu::DeviceType::IntegratedGpu => DeviceType::Integrated,
            wgpu::DeviceType::VirtualGpu => DeviceType::Virtual,
            wgpu::DeviceType::Cpu => DeviceType::Cpu,
            wgpu::DeviceType::Other => DeviceType::Other,
        }
    }
}

/// What one adapter is and what it can hold, as its driver reports it.
///
/// Sizes are in bytes. They are limits of the interface, not free memory: a buffer of
/// `max_buffer_bytes` may still fail to allocate.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct AdapterReport {
    /// The device's name, e.g. `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// The driver's name.
    pub driver: String,
    /// The driver's version, in the driver's own words.
    pub driver_info: String,
    /// The kind of hardware.
    pub device_type: DeviceType,
    /// The interface it is reached by: `vulkan`.
    pub backend: String,
    /// PCI vendor, or a Khronos vendor id from 0x10000 on.
    pub vendor_id: u32,
    /// PCI device, or the vendor's own numbering.
    pub device_id: u32,
    /// PCI address such as `0000:01:00.0`, by which equal cards differ; empty where there is none.
    pub pci_bus_id: String,
    /// Whether shaders may compute in 64-bit floating point.
    pub shader_f64: bool,
    /// Largest buffer.
    pub max_buffer_bytes: u64,
    /// Largest part of a buffer that a shader sees as one array; larger data comes in chunks.
    pub max_storage_binding_bytes: u64,
    /// Memory shared by the threads of one workgroup.
    pub max_workgroup_storage_bytes: u64,
    /// Most threads of one workgroup.
    pub max_threads_per_workgroup: u32,
    /// Most workgroups of one dispatch along x, y or z.
    pub max_workgroups_per_dimension: u32,
}

impl AdapterReport {
    pub(crate) fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let limits = adapter.limits();
        Self {
            name: info.name,
            driver: info.driver,
            driver_info: info.driver_info,
            device_type: info.device_type.into(),
            backend: info.backend.to_string(),
            vendor_id: info.vendor,
            device_id: info.device,
            pci_bus_id: info.device_pci_bus_id,
            shader_f64: adapter.features().contains(wgpu::Features::SHADER_F64),
            max_buffer_bytes: limits.max_buffer_size,
            max_storage_binding_bytes: limits.max_storage_buffer_binding_size,
            max_workgroup_storage_bytes: limits.max_compute_workgroup_storage_size.into(),
            max_threads_per_workgroup: limits.max_compute_invocations_per_workgroup,
            max_workgroups_per_dimension: limits.max_compute_workgroups_per_dimension,
        }
    }

    /// The order of the list; drivers enumerate in whatever order the loader found them.
    pub(crate) fn order(&self, other: &Self) -> Ordering {
        fn key(report: &AdapterReport) -> (DeviceType, [&str; 4], [u32; 2]) {
            let names = [&report.name, &report.pci_bus_id, &report.driver, &report.driver_info];
            (report.device_type, names.map(String::as_str), [report.vendor_id, report.device_id])
        }
        key(self).cmp(&key(other))
    }
}

/// Prints a paragraph of six lines: name, driver, ids, precision, memory, dispatch; no newline at
/// the end.
impl fmt::Display for AdapterReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} ({}, {})", self.name, self.device_type, self.backend)?;
        writeln!(f, "  driver      {} {}", self.driver, self.driver_info)?;
        write!(f, "  ids         vendor {:#06x}, device {:#06x}", self.vendor_id, self.device_id)?;
        if !self.pci_bus_id.is_empty() {
            write!(f, ", PCI {}", self.pci_bus_id)?;
        }
        writeln!(f)?;
        writeln!(f, "  64-bit      {}", if self.shader_f64 { "yes" } else { "no" })?;
        writeln!(
            f,
            "  memory      buffer {}, binding {}, workgroup {}",
            Size(self.max_buffer_bytes),
            Size(self.max_storage_binding_bytes),
            Size(self.max_workgroup_storage_bytes)
        )?;
        write!(
            f,
            "  dispatch    {} workgroups per dimension, {} threads each",
            self.max_workgroups_per_dimension, self.max_threads_per_workgroup
        )
    }
}

/// Bytes in the largest binary unit that leaves at least 1, rounded down to a tenth so that no
/// limit is shown above what the device takes.
struct Size(u64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const UNITS: [&str; 5] = ["B", "KiB", "MiB", "GiB", "TiB"];
        let steps = (self.0.max(1).ilog2() / 10).min(4);
        let unit = 1u64 << (10 * steps);
        let (whole, tenth) = (self.0 / unit, self.0 % unit * 10 / unit);
        match tenth {
            0 => write!(f, "{whole} {}", UNITS[steps as usize]),
            _ => write!(f, "{whole}.{tenth} {}", UNITS[steps as usize]),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in super::super) fn card(
        name: &str,
        device_type: DeviceType,
        pci_bus_id: &str,
    ) -> AdapterReport {
        AdapterReport {
            name: name.into(),
            driver: "driver".into(),
            driver_info: "1.2".into(),
            device_type,
            backend: "vulkan".into(),
            vendor_id: 0x10de,
            device_id: 0x2330,
            pci_bus_id: pci_bus_id.into(),
            shader_f64: true,
            max_buffer_bytes: 1 << 40,
            max_storage_binding_bytes: (1 << 31) - 1,
            max_workgroup_storage_bytes: 48 << 10,
            max_threads_per_workgroup: 1024,
            max_workgroups_per_dimension: 65_535,
        }
    }

    #[test]
    fn order_is_by_sort_then_name_then_address_whatever_the_loader_found_first() {
        let sorted = [
            card("b", DeviceType::Discrete, "0000:01:00.0"),
            card("b", DeviceType::Discrete, "0000:02:00.0"),
            card("a", DeviceType::Integrated, ""),
            card("a", DeviceType::Virtual, ""),
            card("a", DeviceType::Cpu, ""),
            card("a", DeviceType::Other, ""),
        ];
        for shift in 0..sorted.len() {
            let mut found = sorted.to_vec();
            found.rotate_left(shift);
            found.sort_by(AdapterReport::order);
            assert_eq!(found, sorted);
        }
    }

    #[test]
    fn every_device_type_of_wgpu_keeps_its_name() {
        let pairs = [
            (wgpu::DeviceType::DiscreteGpu, "discrete"),
            (wgpu::DeviceType::IntegratedGpu, "integrated"),
            (wgpu::DeviceType::VirtualGpu, "virtual"),
            (wgpu::DeviceType::Cpu, "cpu"),
            (wgpu::DeviceType::Other, "other"),
        ];
        for (kind, name) in pairs {
            assert_eq!(DeviceType::from(kind).to_string(), name);
        }
    }

    #[test]
    fn sizes_are_rounded_down() {
        let cases = [
            (0, "0 B"),
            (1023, "1023 B"),
            (48 << 10, "48 KiB"),
            (128 << 20, "128 MiB"),
            ((1 << 31) - 1, "1.9 GiB"),
            (3 << 29, "1.5 GiB"),
            (1 << 40, "1 TiB"),
            // 2⁶⁴ − 1 bytes are one byte short of 16 777 216 TiB.
            (u64::MAX, "16777215.9 TiB"),
        ];
        for (bytes, text) in cases {
            assert_eq!(Size(bytes).to_string(), text);
        }
    }

    #[test]
    fn paragraph_names_device_driver_and_limits() {
        let text = card("Card 1", DeviceType::Discrete, "0000:01:00.0").to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "Card 1 (discrete, vulkan)");
        assert!(lines[1].ends_with("driver 1.2"));
        assert!(lines[2].ends_with("vendor 0x10de, device 0x2330, PCI 0000:01:00.0"));
        assert!(lines[3].ends_with("yes"));
        assert!(lines[4].ends_with("buffer 1 TiB, binding 1.9 GiB, workgroup 48 KiB"));
        assert!(lines[5].ends_with("65535 workgroups per dimension, 1024 threads each"));
        assert_eq!(lines.len(), 6);
        let no_address = card("Card 1", DeviceType::Cpu, "").to_string();
        assert!(!no_address.contains("PCI"));
    }
}
