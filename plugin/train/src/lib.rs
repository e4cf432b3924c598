//! Headless training over many levels: collection of rollouts with the current policy, and learning from them.
//!
//! - [`Trainer`] trains an update at a time. [`train_run::Training`] is a whole run, with its folder and checkpoints.
//! - [`learn_skills`] learns the skill model from the [`recordings`] of an experiment.
//! - [`study_runner::StudyRunner`] brings all runs of a [`study`] to their ends, [`study_output`] writes its tables.
//! - A [`run_observer::RunObserver`] follows any of these and stops them. What was stopped is resumed bit for bit.

pub mod checkpoint;
pub mod collect;
pub mod demo;
mod error;
pub mod experiment;
pub mod learn_skills;
mod memory;
pub mod metrics_log;
pub mod pipeline;
pub mod policy_export;
pub(crate) mod progress;
pub mod recordings;
pub mod run_dir;
pub mod run_lock;
pub mod run_observer;
pub mod runs;
pub mod study;
pub mod study_runner;
pub mod tensorboard;
pub mod train_run;
pub mod trainer;

pub use crate::{
    error::TrainError,
    experiment::{Algorithm, Experiment, LearnerKind},
    metrics_log::{Timing, UpdateReport},
    trainer::{
        Trainer,
        learner::{LearnerMetrics, TrainedLearner},
    },
};
