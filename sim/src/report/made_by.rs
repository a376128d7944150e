//! Which program made a run, on which machine.

use serde::Serialize;

/// A program, its build and the machine that it runs on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MadeBy {
    /// The library's version.
    pub version: &'static str,
    /// `release` or `debug`.
    pub profile: &'static str,
    /// The cargo features that it was built with.
    pub features: Vec<&'static str>,
    /// The machine's name, empty where the system does not tell.
    pub host: String,
    /// Its system and processor.
    pub platform: String,
    /// Threads of the arithmetic.
    pub threads: usize,
    /// The command line, the program first.
    pub command: Vec<String>,
}

impl MadeBy {
    /// This process.
    pub fn this_process() -> Self {
        let command = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        Self {
            version: env!("CARGO_PKG_VERSION"),
            profile: if cfg!(debug_assertions) { "debug" } else { "release" },
            features: features(),
            host: host(),
            platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            threads: rayon::current_num_threads(),
            command: command.collect(),
        }
    }
}

fn features() -> Vec<&'static str> {
    [
        ("nifti", cfg!(feature = "nifti")),
        ("nrrd", cfg!(feature = "nrrd")),
        ("metaimage", cfg!(feature = "metaimage")),
        ("gmsh", cfg!(feature = "gmsh")),
        ("vtu", cfg!(feature = "vtu")),
        ("dicom", cfg!(feature = "dicom")),
        ("gpu", cfg!(feature = "gpu")),
    ]
    .into_iter()
    .filter_map(|(name, is_in)| is_in.then_some(name))
    .collect()
}

fn host() -> String {
    let by_system = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let by_shell = || ["HOSTNAME", "COMPUTERNAME"].into_iter().find_map(|v| std::env::var(v).ok());
    by_system.or_else(by_shell).unwrap_or_default().trim().into()
}
