//! Where a study was measured.

use std::process::Command;

use serde::{Deserialize, Serialize};

use crate::solvers::stream::Stream;

/// The machine, for the head of a report.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// The processor's own name, `unknown` where the system does not tell.
    pub cpu: String,
    /// Operating system and architecture.
    pub system: String,
    /// Threads that the system offers.
    pub threads_available: usize,
    /// Threads that the study uses for what it times; a fresh factor that `sparse` makes in the
    /// background comes on top.
    pub threads_used: usize,
    /// Bytes of memory that are free, if the system tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_available: Option<u64>,
    /// Bytes per second, read and written, of a copy within memory, in 10⁹.
    pub memcpy_gb_s: f64,
}

/// Where a row of a study is from.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Place {
    /// The processor's own name, `unknown` where the system does not tell.
    pub cpu: String,
    /// The sources' commit, with `+` if they differ from it; `unknown` outside a checkout.
    pub commit: String,
}

impl Place {
    /// Asks the system, and git for the state of these sources.
    pub fn here() -> Self {
        Self { cpu: cpu(), commit: commit().unwrap_or_else(|| "unknown".to_owned()) }
    }
}

fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    field(&text, "model name").unwrap_or("unknown").to_owned()
}

fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let mut command = Command::new("git");
        let output = command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
        let output = output.ok().filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let is_clean = git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty();
    Some(git(&["rev-parse", "--short=12", "HEAD"])? + if is_clean { "" } else { "+" })
}

/// Most bytes that this process has held in memory since [`reset_peak`], if the system tells.
pub(crate) fn peak_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    field(&text, "VmHWM").and_then(kibibytes)
}

/// Bytes that this process holds in memory now, if the system tells.
pub(crate) fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    field(&text, "VmRSS").and_then(kibibytes)
}

/// Starts [`peak_bytes`] anew; false where the system does not let it.
pub(crate) fn reset_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// Numbers that no cache holds.
const LARGE: usize = 1 << 24;

impl Machine {
    /// Asks the system, and copies 128 MiB a few times.
    pub fn here() -> Self {
        let read = |path| std::fs::read_to_string(path).unwrap_or_default();
        let available = field(&read("/proc/meminfo"), "MemAvailable").and_then(kibibytes);
        Self {
            cpu: cpu(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            threads_available: std::thread::available_parallelism().map_or(1, usize::from),
            threads_used: 1,
            memory_available: available,
            memcpy_gb_s: memcpy_gb_s(),
        }
    }
}

fn memcpy_gb_s() -> f64 {
    let mut stream = Stream::new(LARGE);
    let seconds = (0..5).map(|_| {
        let begin = std::time::Instant::now();
        stream.copy(LARGE);
        begin.elapsed().as_secs_f64()
    });
    gigabytes_per_second(LARGE * size_of::<f64>(), seconds.fold(f64::INFINITY, f64::min))
}

/// Of `bytes` that are read once and written once.
pub(crate) fn gigabytes_per_second(bytes: usize, seconds: f64) -> f64 {
    2.0 * bytes as f64 / seconds / 1e9
}

/// What follows `name :` on its line.
fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(rest.trim_start().strip_prefix(':')?.trim())
}

fn kibibytes(text: &str) -> Option<u64> {
    text.strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_s_files_are_read() {
        let cpuinfo = "processor\t: 0\nmodel name\t: A Processor @ 2 GHz\nflags\t: fpu\n";
        assert_eq!(field(cpuinfo, "model name"), Some("A Processor @ 2 GHz"));
        assert_eq!(field(cpuinfo, "nothing"), None);
        assert_eq!(kibibytes("12 kB"), Some(12288));
        assert_eq!(kibibytes("12 MB"), None);
    }

    #[test]
    fn what_is_held_is_in_memory_and_in_its_peak() {
        let (Some(_), Some(_)) = (resident_bytes(), peak_bytes()) else { return };
        // Other tests take and give back memory meanwhile, and start the peak anew: while this is
        // held both have it.
        let held = vec![1u8; 64 << 20];
        assert!(std::hint::black_box(&held).iter().all(|&byte| byte == 1));
        let (resident, peak) = (resident_bytes().unwrap(), peak_bytes().unwrap());
        assert!(resident >= 64 << 20 && peak >= 64 << 20, "{resident} {peak}");
        assert!(resident < 1 << 40, "{resident}");
        drop(held);
    }

    #[test]
    fn a_copy_counts_reading_and_writing() {
        assert_eq!(gigabytes_per_second(3_000_000_000, 2.0), 3.0);
        assert!(Machine::here().memcpy_gb_s > 0.1);
    }
}
