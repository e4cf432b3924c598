//! Options of computing that several verbs have: threads and device.

use std::path::{Path, PathBuf};

use playbot_lab::{machine::usable_threads, parallel::default_threads, train::train_run::TrainingSetup};
use playbot_learner::DeviceKind;

use super::number::at_least_one;

/// More threads than any machine has cores.
pub const MOST_THREADS: usize = 1024;

/// The number of threads.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Threads {
    /// Threads. The result does not depend on their number.
    #[arg(long, default_value_t = usual_threads(), value_parser = number_of_threads)]
    threads: usize,
}

impl Threads {
    /// Returns the number of threads: the requested one, or as many as the system's limits allow.
    pub fn count(self) -> usize {
        usable_threads(self.threads)
    }
}

/// Returns the revision of playbot that this program was built from.
pub fn revision() -> &'static str {
    env!("PLAYBOT_REVISION")
}

/// Returns one for each core.
fn usual_threads() -> usize {
    default_threads().min(MOST_THREADS)
}

/// Parses a number of threads.
///
/// # Errors
///
/// It is 0, no number, or more than [`MOST_THREADS`].
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

/// The device that computes networks.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Device {
    /// Device: flex or ndarray on the CPU, wgpu or cuda on a graphics card in programs built with these features.
    #[arg(long, default_value_t)]
    pub device: DeviceKind,
}

/// Threads and device, for verbs that learn or measure.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Compute {
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    device: Device,
}

impl Compute {
    /// Returns the number of threads: the requested one, or as many as the system's limits allow.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Returns the device that computes networks.
    pub fn device(&self) -> DeviceKind {
        self.device.device
    }

    /// Returns the setup of trainings, whose recordings are where `recordings` finds them.
    pub fn setup<'a>(&self, recordings: &'a dyn Fn(&Path) -> PathBuf) -> TrainingSetup<'a> {
        let (device, threads) = (self.device(), self.threads());
        TrainingSetup { device, threads, revision: revision(), recordings }
    }
}
