//! Headless training over many levels: collection of rollouts with the current policy, and learning from them.
//!
//! - [`Trainer`] trains an update at a time. [`train_run::Training`] is a whole run, with its folder and checkpoints.
//! - [`learn_skills`] learns the skill model from the [`recordings`] of an experiment.
//! - [`study_runner::StudyRunner`] brings all runs of a [`study`] to their ends, [`study_output`] writes its tables.
//! - A [`run_observer::RunObserver`] follows any of these and stops them. What was stopped is resumed bit for bit.

mod agents_tick;
mod algorithm;
pub mod arena_state;
pub mod checkpoint;
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
mod experiment_fit;
pub mod json_lines;
mod known_settings;
pub mod learn_skills;
pub mod learner;
pub mod length;
mod log_gaps;
mod memory;
pub mod metrics_log;
pub mod presets;
mod prior_checks;
pub(crate) mod progress;
pub mod recordings;
pub mod run_dir;
mod run_error;
pub mod run_lock;
pub mod run_observer;
pub mod settings_page;
pub mod study;
pub mod study_output;
pub mod study_runner;
pub mod tensorboard;
mod train_error;
pub mod train_run;
pub mod trainer;
mod update_report;

pub use config::{Algorithm, Experiment, LearnerKind};
pub use learner::{LearnerMetrics, TrainedLearner};
pub use train_error::TrainError;
pub use trainer::Trainer;
pub use update_report::{Timing, UpdateReport};
