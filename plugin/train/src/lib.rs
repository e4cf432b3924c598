//! Training of bots without a window: from recordings and reward to a policy, and to comparisons of methods.
//!
//! The numbers of a run depend on its experiment and its random seed alone. Whatever was stopped is resumed bit for
//! bit. Most programs use this crate through `playbot`, as `playbot::train`.
//!
//! The modules, in reading order:
//!
//! - [`pipeline`]: all steps from recordings to a policy, as functions. Begin here.
//! - [`experiment`]: experiments and their settings.
//! - [`recordings`] and [`demo`]: recordings of an experiment, and data sets made from them.
//! - [`learn_skills`]: the learning of a skill model.
//! - [`trainer`]: the training loop, one update at a time ([`Trainer`]); [`collect`]: the Worlds that play for it;
//!   [`cluster`]: Worlds in other processes.
//! - [`train_run`]: a whole run ([`train_run::Training`]), with its folder ([`run_dir`]), checkpoints
//!   ([`checkpoint`]), metrics ([`metrics_log`], [`tensorboard`]) and observer ([`run_observer`]).
//! - [`self_play`]: a training against rivals, and their [`ladder`](self_play::ladder).
//! - [`begin_from`]: the start of a run from another one, and its ancestry ([`Ancestor`](run_dir::Ancestor)).
//! - [`imitate`]: imitation of recordings, or of a demonstrator that is asked (DAgger).
//! - [`policy_export`]: the one file that a game ships with.
//! - [`lesson`]: from a recording to a policy that plays at once, and gets better.
//! - [`diagnose`]: why a training does not learn, as findings.
//! - [`runs`]: runs on disk, found and compared over seeds.
//! - [`study`] and [`study_runner`]: variants of an experiment, each with every seed, and their tables.

pub mod begin_from;
pub mod checkpoint;
pub mod cluster;
pub mod collect;
pub mod demo;
pub mod diagnose;
mod error;
pub mod experiment;
pub mod imitate;
pub mod learn_skills;
pub mod lesson;
mod levels;
pub mod metrics_log;
pub mod pipeline;
pub mod policy_export;
pub mod recordings;
mod rival_seats;
pub mod run_dir;
pub mod run_observer;
pub mod runs;
pub mod self_play;
pub mod study;
pub mod study_runner;
pub mod tensorboard;
pub mod train_run;
pub mod trainer;

pub use crate::{
    error::TrainError,
    experiment::{Algorithm, Experiment, LearnerKind},
    metrics_log::{Timing, UpdateReport},
    trainer::{TrainedLearner, Trainer},
};
pub use playbot_learner::LearnerMetrics;
