//! What a verb computes with: options that several verbs have.

use playbot_lab::parallel::default_threads;
use playbot_learner::DeviceKind;

use super::number::at_least_one;

/// How many threads work.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Threads {
    /// Threads; the result does not depend on it.
    #[arg(long, default_value_t = default_threads(), value_parser = at_least_one)]
    pub threads: usize,
}

impl Default for Threads {
    fn default() -> Self {
        Self { threads: default_threads() }
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
    /// How many threads work.
    pub fn threads(&self) -> usize {
        self.threads.threads
    }

    /// What networks are computed on.
    pub fn device(&self) -> DeviceKind {
        self.device.device
    }
}
