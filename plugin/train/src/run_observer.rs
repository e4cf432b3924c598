//! The observer of trainings and studies: how a caller follows the work and stops it.

use crate::{
    experiment::Experiment,
    metrics_log::UpdateReport,
    study::{StudyResult, StudyRun},
};
use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{eval::EvalSummary, split::LevelSplit};
use playbot_learner::SkillMetrics;
use std::path::Path;

/// A counter of finished units of work. It may be called from several threads.
pub type Counter = Box<dyn Fn(u64) + Send + Sync>;

/// Follows trainings, the learning of skills and studies, and stops them. Every method has a default, which ignores
/// everything and never stops.
///
/// The result of the work does not depend on its observer, except where it is stopped.
pub trait RunObserver {
    /// Returns true if the work is to stop at its next safe point: after a batch of skills or an update of training.
    fn stopped(&self) -> bool {
        false
    }

    /// Receives an event of the work.
    fn observe(&mut self, event: RunEvent<'_>) {
        let _ = event;
    }

    /// Returns the counter of work that several threads share.
    fn counter(&mut self, work: CountedWork<'_>) -> Counter {
        let _ = work;
        Box::new(|_| {})
    }
}

/// Work whose units several threads finish.
#[derive(Clone, Copy, Debug)]
pub enum CountedWork<'a> {
    /// The replay of recordings. [`RunEvent::RecordingsRead`] ends it.
    Replay {
        /// Recorded steps.
        steps: u64,
    },
    /// The measurement of a player. [`RunEvent::Measured`] ends it.
    Measure {
        /// Name of the player.
        name: &'a str,
        /// Episodes.
        episodes: u64,
    },
}

/// An event of a training, of the learning of skills, or of a study.
#[derive(Debug)]
pub enum RunEvent<'a> {
    /// Recordings are taken from another path than the experiment names.
    RecordingsElsewhere {
        /// Path in the experiment.
        named: &'a Path,
        /// Path that is read.
        found: &'a Path,
    },
    /// Recordings are about to be read. Nothing has to be saved before [`RecordingsRead`](Self::RecordingsRead).
    ReadingRecordings,
    /// Recordings were opened, and are about to be replayed where that is needed.
    RecordingsOpened(RecordingsSummary<'a>),
    /// Recordings with rewards are of other tasks than the training.
    OtherModes {
        /// Modes of these recordings.
        recorded: &'a [&'a str],
        /// Mode of the training.
        trained: &'a str,
    },
    /// Recordings were read.
    RecordingsRead,
    /// Recorded episodes of a game with masks do not replay: every action counts as legal in them.
    MasksUnknown {
        /// Number of these episodes.
        episodes: usize,
        /// Number of all recorded episodes.
        of: usize,
    },
    /// The learning of skills begins.
    SkillsBegun {
        /// Batches done, in a resumed learning.
        done: u64,
        /// Batches of all epochs.
        batches: u64,
    },
    /// The learning of skills goes on from its checkpoint.
    SkillsResumed {
        /// Number of the epoch, from 1.
        epoch: u64,
        /// Epochs.
        epochs: u64,
    },
    /// A batch of skills was learned.
    SkillBatch,
    /// An epoch of skills was learned.
    SkillEpoch {
        /// Number of the epoch, from 1.
        epoch: u64,
        /// Its metrics.
        metrics: &'a SkillMetrics,
    },
    /// The state of the learning of skills was saved.
    SkillsSaved {
        /// The checkpoint.
        checkpoint: &'a Path,
        /// Whole epochs in it.
        epochs: u64,
    },
    /// The learning of skills ended or was stopped.
    SkillsEnded {
        /// Loss of the kept model; `None` if learning was stopped, or no episodes are held out.
        kept: Option<KeptSkills>,
    },
    /// The training of a run begins or goes on.
    TrainingBegun {
        /// Its experiment.
        experiment: &'a Experiment,
    },
    /// An update begins.
    UpdateBegun {
        /// Environment steps done.
        step: u64,
    },
    /// An update was trained.
    Updated {
        /// Its results.
        report: &'a UpdateReport,
        /// Environment steps of each update.
        steps_per_update: u64,
    },
    /// A run has a checkpoint.
    Saved {
        /// Folder of the run.
        run: &'a Path,
        /// Environment steps of the checkpoint.
        step: u64,
    },
    /// The training of a run ended or was stopped.
    TrainingEnded,
    /// Some held-out levels of a study have layouts that its runs train on or that are recorded.
    KnownLevels {
        /// The held-out levels.
        test: &'a LevelSplit,
        /// The number of those that are known.
        known: u64,
        /// True if they are measured, too.
        is_measured: bool,
    },
    /// A player was measured.
    Measured(&'a EvalSummary),
    /// A run of a study begins.
    StudyRunBegun {
        /// Index of the run, from 0.
        index: usize,
        /// The run.
        run: &'a StudyRun,
    },
    /// A run of a study, one of several that go on side by side, has come further.
    StudyRunAdvanced {
        /// The run.
        run: &'a StudyRun,
        /// What it has done.
        done: Advance,
    },
    /// A run of a study was measured.
    StudyRunEnded {
        /// The run.
        run: &'a StudyRun,
        /// Its result.
        result: &'a StudyResult,
    },
}

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// It learns skills.
    Skills {
        /// Batches done.
        batches: u64,
        /// Batches of all epochs.
        of: u64,
    },
    /// It trains.
    Steps(u64),
}

/// Contents of opened recordings.
#[derive(Clone, Copy, Debug)]
pub struct RecordingsSummary<'a> {
    /// Their path.
    pub path: &'a Path,
    /// Steps.
    pub steps: u64,
    /// Episodes.
    pub episodes: u64,
    /// They have more steps than were requested, since episodes are kept whole.
    pub exceeds_request: bool,
    /// The observations that are made of them.
    pub observation: ObservationConfig,
    /// Memory of pictures and states together; 0 if all observations are vectors.
    pub bytes: u64,
    /// Memory of the pictures alone.
    pub picture_bytes: u64,
}

/// Held-out loss of the skill model that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptSkills {
    /// Epoch of the model, from 1.
    pub epoch: u64,
    /// Epochs that were learned.
    pub epochs: u64,
    /// Negative log-likelihood on the held-out episodes.
    pub held_out_nll: f32,
    /// The model is that of the best epoch; else that of the last.
    pub is_best: bool,
}

/// An observer that ignores everything and never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl RunObserver for Unobserved {}

/// An observer that calls a function after each update of training.
#[derive(Clone, Copy, Debug)]
pub struct AfterUpdate<F>(pub F);

impl<F: FnMut(&UpdateReport)> RunObserver for AfterUpdate<F> {
    fn observe(&mut self, event: RunEvent<'_>) {
        if let RunEvent::Updated { report, .. } = event {
            (self.0)(report);
        }
    }
}
