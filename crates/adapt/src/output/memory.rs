//! Peak memory of this process.

/// Largest resident memory since the process began, in MiB: `VmHWM` of Linux; `None` elsewhere.
pub fn peak_memory_mb() -> Option<f64> {
    if cfg!(target_os = "linux") {
        high_water_mark(&std::fs::read_to_string("/proc/self/status").ok()?)
    } else {
        None
    }
}

fn high_water_mark(status: &str) -> Option<f64> {
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_linux_is_understood_and_nothing_else() {
        let status =
            "Name:\tmembranes\nVmPeak:\t  999999 kB\nVmHWM:\t    3072 kB\nVmRSS:\t    1024 kB\n";
        assert_eq!(high_water_mark(status), Some(3.0));
        assert_eq!(high_water_mark("VmHWM:\t lots\n"), None);
        assert_eq!(high_water_mark(""), None);
    }

    #[test]
    fn touching_memory_shows() {
        let Some(before) = peak_memory_mb() else {
            return;
        };
        let block = vec![1u8; 64 << 20];
        assert!(block.iter().all(|&b| b == 1));
        assert!(peak_memory_mb().is_some_and(|after| after >= before && after > 64.0));
    }
}
