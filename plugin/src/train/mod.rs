//! Headless training over many levels: collecting with the current policy, learning from what was collected.

pub mod arena_state;
pub mod collect;
pub mod config;
pub mod config_file;
pub mod json_lines;
pub mod metrics_log;
pub mod run_dir;
pub mod tensorboard;
pub mod trainer;
pub mod worlds;

pub use config::{Algorithm, Experiment};
pub use trainer::{Trainer, UpdateReport};
