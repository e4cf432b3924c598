//! Clocks for the time of jobs.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// The clock that jobs are timed with. It is no part of the other results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockKind {
    /// CPU time of the job's thread, as the system counts it.
    ThreadCpu,
    /// Wall time, which includes whatever else the machine does.
    Wall,
}

impl ClockKind {
    /// Returns CPU time where the system reports it, else wall time.
    pub fn here() -> Self {
        if thread_cpu_seconds().is_some() { Self::ThreadCpu } else { Self::Wall }
    }

    /// Returns the clock's name for reports.
    pub fn describe(self) -> &'static str {
        match self {
            Self::ThreadCpu => "CPU time of the job's thread",
            Self::Wall => "wall time of the job's thread",
        }
    }
}

/// Measures a job from its start, on its own thread.
pub(super) struct JobClock {
    kind: ClockKind,
    cpu: f64,
    begun: Instant,
}

impl JobClock {
    pub fn start(kind: ClockKind) -> Self {
        Self { kind, cpu: thread_cpu_seconds().unwrap_or(0.0), begun: Instant::now() }
    }

    /// Returns the seconds since the start, to the microsecond.
    pub fn seconds(&self) -> f64 {
        let wall = || self.begun.elapsed().as_secs_f64();
        let seconds = match self.kind {
            ClockKind::ThreadCpu => thread_cpu_seconds().map_or_else(wall, |cpu| cpu - self.cpu),
            ClockKind::Wall => wall(),
        };
        (seconds * 1e6).round() / 1e6
    }
}

/// Returns the CPU time of this thread since it started. The first number of the file is in nanoseconds.
#[cfg(target_os = "linux")]
fn thread_cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: u64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds as f64 / 1e9)
}

#[cfg(not(target_os = "linux"))]
fn thread_cpu_seconds() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_time_by_either_clock() {
        for kind in [ClockKind::here(), ClockKind::Wall] {
            let clock = JobClock::start(kind);
            let mut number = 1_u64;
            // Longer than the system takes to update its count.
            while clock.begun.elapsed().as_millis() < 50 {
                number = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            }
            assert!(clock.seconds() > 0.0 && clock.seconds() < 600.0, "{number}");
        }
    }
}
