//! What a verb computes with: options that several verbs have.

use playbot_lab::{parallel::default_threads, train::usable_threads};
use playbot_learner::DeviceKind;

use super::number::at_least_one;

/// More threads than any machine has cores.
pub const MOST_THREADS: usize = 1024;

/// How many threads work.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Threads {
    /// Threads; the result does not depend on it.
    #[arg(long, default_value_t = usual_threads(), value_parser = number_of_threads)]
    threads: usize,
}

impl Threads {
    /// How many threads work: those that were asked for, or as many as limits leave room for.
    pub fn count(self) -> usize {
        usable_threads(self.threads)
    }
}

/// One for each core.
fn usual_threads() -> usize {
    default_threads().min(MOST_THREADS)
}

/// A number of threads that the command line names.
///
/// # Errors
///
/// It is 0, no number, or more than a program has a use for.
fn number_of_threads(text: &str) -> Result<usize, String> {
    match at_least_one(text)? {
        threads if threads > MOST_THREADS => {
            Err(format!("it must be at most {MOST_THREADS}: more threads than a machine has cores make nothing faster"))
        }
        threads => Ok(threads),
    }
}

impl Default for Threads {
    fn default() -> Self {
        Self { threads: usual_threads() }
    }
}

/// What networks are computed on.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Device {
    /// Where to compute: flex or ndarray on the CPU; wgpu or cuda on a graphics card, in programs built with these features.
    #[arg(long, default_value_t)]
    pub device: DeviceKind,
}

/// Both, for verbs that learn or measure.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Compute {
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    device: Device,
}

impl Compute {
    /// How many threads work: those that were asked for, or as many as limits leave room for.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// What networks are computed on.
    pub fn device(&self) -> DeviceKind {
        self.device.device
    }
}
