//! What fits into memory. An allocation that fails ends the process, so routes whose arrays grow like n^2 ask here before they begin.
use std::fs;

use crate::error::{Error, Result};

/// Requests below this many bytes are granted without a look at the machine.
pub const ALWAYS_GRANTED: f64 = 16e6;
/// What a system without `/proc` is taken to have, in bytes: a small machine of today. The variable MBRS_MEMORY tells better.
const UNKNOWN: f64 = 4e9;
/// Kept for stacks of threads and arenas of the allocator, in bytes: both lie in the address space that a limit counts.
const RESERVE: f64 = 160e6;

/// Refuses `what`, which needs `bytes`, where they are not available; `remedy` says what to do instead.
pub fn require(bytes: f64, what: &str, remedy: &str) -> Result<()> {
    if bytes <= ALWAYS_GRANTED {
        return Ok(());
    }
    let free = available();
    // not a number is refused as well
    if bytes < free {
        return Ok(());
    }
    let (needed, free) = (readable(bytes), readable(free));
    Err(Error::Route(format!("{what} would take about {needed} of memory, of which {free} are available; {remedy}")))
}

/// Bytes that this process can still allocate: the least of the variable MBRS_MEMORY, the free memory of the machine, the limits
/// of the process and those of its control groups.
pub fn available() -> f64 {
    let told = std::env::var("MBRS_MEMORY").ok().and_then(|text| text.trim().parse::<f64>().ok());
    let machine = told.or_else(machine).unwrap_or(UNKNOWN);
    let limits = [limit("Max address space", "VmSize:"), limit("Max data size", "VmData:"), control_groups()];
    limits.into_iter().flatten().fold(machine, f64::min).max(0.0)
}

fn readable(bytes: f64) -> String {
    let units = ["kB", "MB", "GB", "TB", "PB"];
    let mut value = bytes / 1e3;
    let mut k = 0;
    while value >= 1e3 && k + 1 < units.len() {
        value /= 1e3;
        k += 1;
    }
    format!("{value:.1} {}", units[k])
}

/// The number of kB behind a key of a file such as `/proc/meminfo`, in bytes.
fn entry(text: &str, key: &str) -> Option<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kilobytes| 1024.0 * kilobytes)
}

fn machine() -> Option<f64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    Some(entry(&text, "MemAvailable:")? + entry(&text, "SwapFree:").unwrap_or(0.0))
}

/// The soft limit of the process, less what it uses already.
fn limit(name: &str, used: &str) -> Option<f64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix(name))?;
    let most: f64 = line.split_whitespace().next()?.parse().ok()?;
    let status = fs::read_to_string("/proc/self/status").ok()?;
    Some(most - entry(&status, used)? - RESERVE)
}

/// The tightest limit among the control groups (version 2) that hold this process; file pages that can be dropped count as free.
fn control_groups() -> Option<f64> {
    let own = fs::read_to_string("/proc/self/cgroup").ok()?;
    let path = own.lines().find_map(|line| line.strip_prefix("0::"))?;
    let mut folder = std::path::PathBuf::from("/sys/fs/cgroup").join(path.trim().trim_start_matches('/'));
    let mut least: Option<f64> = None;
    while folder.starts_with("/sys/fs/cgroup") {
        let number =
            |name: &str| fs::read_to_string(folder.join(name)).ok().and_then(|text| text.trim().parse::<f64>().ok());
        if let (Some(most), Some(used)) = (number("memory.max"), number("memory.current")) {
            let statistics = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
            let droppable = entry(&statistics, "inactive_file ").map_or(0.0, |pages| pages / 1024.0);
            let free = most - used + droppable;
            least = Some(least.map_or(free, |l| l.min(free)));
        }
        if !folder.pop() {
            break;
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_read_as_bytes() {
        let text = "MemTotal:       24684092 kB\nMemAvailable:   22814476 kB\n";
        assert_eq!(entry(text, "MemAvailable:"), Some(22_814_476.0 * 1024.0));
        assert_eq!(entry(text, "SwapFree:"), None);
        assert_eq!(readable(8.3e10), "83.0 GB");
    }

    #[test]
    fn what_no_machine_has_is_refused_with_its_size_and_the_remedy() {
        assert!(require(1e6, "a small matrix", "").is_ok());
        for bytes in [3.7e18, f64::INFINITY, f64::NAN] {
            let Err(Error::Route(text)) = require(bytes, "the matrix", "take fewer rows") else {
                panic!("granted");
            };
            assert!(text.contains("the matrix would take about") && text.ends_with("take fewer rows"), "{text}");
        }
    }
}
