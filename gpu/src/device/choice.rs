//! Picking an adapter by number or name.

use std::fmt;

use super::report::AdapterReport;
use crate::GpuError;

/// An adapter by its number or by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AdapterChoice {
    /// Its number in the list of [`adapters`](crate::adapters).
    Index(usize),
    /// A part of its name, in upper or lower case, that no other adapter's name has.
    Name(String),
}

/// Prints the number, or the name in quotation marks.
impl fmt::Display for AdapterChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => write!(f, "{name:?}"),
        }
    }
}

/// The number of the chosen adapter, the first one without a choice.
pub(crate) fn chosen(
    choice: Option<&AdapterChoice>,
    found: &[&AdapterReport],
) -> Result<usize, GpuError> {
    let fits = |(index, report): &(usize, &&AdapterReport)| match choice {
        None => *index == 0,
        Some(AdapterChoice::Index(asked)) => index == asked,
        Some(AdapterChoice::Name(part)) => {
            report.name.to_lowercase().contains(&part.to_lowercase())
        }
    };
    let matches: Vec<(usize, &&AdapterReport)> = found.iter().enumerate().filter(fits).collect();
    if let [(index, _)] = matches[..] {
        return Ok(index);
    }
    let Some(choice) = choice.map(AdapterChoice::to_string) else {
        return Err(GpuError::NoAdapter);
    };
    Err(match matches[..] {
        [] => GpuError::NoSuchAdapter { choice, found: list(found.iter().enumerate()) },
        _ => GpuError::SeveralAdapters { choice, found: list(matches.into_iter()) },
    })
}

/// Number, name, sort and PCI address of each, on one line.
fn list<'a>(adapters: impl Iterator<Item = (usize, &'a &'a AdapterReport)>) -> String {
    let one = |(index, report): (usize, &&AdapterReport)| {
        let address = match &report.pci_bus_id[..] {
            "" => String::new(),
            address => format!(", PCI {address}"),
        };
        format!("{index}: {} ({}{address})", report.name, report.device_type)
    };
    adapters.map(one).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::super::report::tests::card;
    use super::*;
    use crate::DeviceType;

    fn machine() -> [AdapterReport; 4] {
        [
            card("NVIDIA H100 PCIe", DeviceType::Discrete, "0000:01:00.0"),
            card("NVIDIA H100 PCIe", DeviceType::Discrete, "0000:02:00.0"),
            card("Intel UHD Graphics 770", DeviceType::Integrated, "0000:00:02.0"),
            card("llvmpipe (LLVM 15.0.6, 256 bits)", DeviceType::Cpu, ""),
        ]
    }

    fn choose(choice: Option<AdapterChoice>) -> Result<usize, GpuError> {
        let machine = machine();
        let found: Vec<&AdapterReport> = machine.iter().collect();
        chosen(choice.as_ref(), &found)
    }

    fn named(name: &str) -> Result<usize, GpuError> {
        choose(Some(AdapterChoice::Name(name.into())))
    }

    #[test]
    fn by_number_by_part_of_the_name_or_the_first() {
        assert_eq!(choose(None), Ok(0));
        assert_eq!(choose(Some(AdapterChoice::Index(1))), Ok(1));
        assert_eq!(named("LLVMpipe"), Ok(3));
        assert_eq!(named("uhd"), Ok(2));
        assert_eq!(chosen(None, &[]), Err(GpuError::NoAdapter));
    }

    #[test]
    fn what_fits_none_or_several_is_refused_with_the_list() {
        let none = named("radeon").unwrap_err().to_string();
        assert_eq!(
            none,
            "no adapter is \"radeon\", want one of these by its number or a part of its name: 0: \
             NVIDIA H100 PCIe (discrete, PCI 0000:01:00.0); 1: NVIDIA H100 PCIe (discrete, PCI \
             0000:02:00.0); 2: Intel UHD Graphics 770 (integrated, PCI 0000:00:02.0); 3: llvmpipe \
             (LLVM 15.0.6, 256 bits) (cpu)"
        );
        let beyond = choose(Some(AdapterChoice::Index(4))).unwrap_err().to_string();
        assert!(beyond.starts_with("no adapter is 4, want") && beyond.contains("3: llvm"));
        let several = named("nvidia").unwrap_err().to_string();
        assert_eq!(
            several,
            "\"nvidia\" is a part of several adapters' names, choose one by its number or a longer \
             part: 0: NVIDIA H100 PCIe (discrete, PCI 0000:01:00.0); 1: NVIDIA H100 PCIe (discrete, \
             PCI 0000:02:00.0)"
        );
    }
}
