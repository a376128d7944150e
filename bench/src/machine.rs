//! Where a study was measured.

use serde::Serialize;

use crate::stream::Stream;

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

/// Numbers that no cache holds.
const LARGE: usize = 1 << 24;

impl Machine {
    /// Asks the system, and copies 128 MiB a few times.
    pub fn here() -> Self {
        let read = |path| std::fs::read_to_string(path).unwrap_or_default();
        let cpu = field(&read("/proc/cpuinfo"), "model name").unwrap_or("unknown").to_owned();
        let available = field(&read("/proc/meminfo"), "MemAvailable").and_then(kibibytes);
        Self {
            cpu,
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
    fn a_copy_counts_reading_and_writing() {
        assert_eq!(gigabytes_per_second(3_000_000_000, 2.0), 3.0);
        assert!(Machine::here().memcpy_gb_s > 0.1);
    }
}
