//! Headless training over many levels: collecting with the current policy, learning from what was collected.

mod algorithm;
pub mod arena_state;
pub mod checkpoint;
pub mod checksum;
pub mod collect;
pub mod config;
mod config_error;
pub mod config_file;
mod config_keys;
mod config_set;
mod cut_episodes;
pub mod default_experiment;
mod experiment_checks;
mod experiment_error;
pub mod json_lines;
pub mod learner;
mod memory;
pub mod metrics_log;
pub mod presets;
pub(crate) mod progress;
mod replaced_run;
mod ron_keys;
pub mod run_dir;
mod run_error;
pub mod run_lock;
pub mod study;
pub mod tensorboard;
mod train_error;
pub mod trainer;
mod update_report;
mod which_checkpoint;

pub use config::{Algorithm, Experiment};
pub use learner::{LearnerMetrics, TrainedLearner};
pub use train_error::TrainError;
pub use trainer::Trainer;
pub use update_report::{Timing, UpdateReport};
