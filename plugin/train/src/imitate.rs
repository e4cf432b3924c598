//! Imitation without skills: of recordings, or of a demonstrator that is asked (DAgger).
//!
//! Imitation of recordings fits a policy to the states that the demonstrator has led to. A small mistake leads the policy
//! elsewhere, where it has learned nothing. DAgger (Ross et al. 2011, "A reduction of imitation learning and structured
//! prediction to no-regret online learning") lets the policy play, and asks the demonstrator for its action in each state
//! that was visited. The policy learns from all states of all rounds. The demonstrator takes a falling share of the
//! actions ([`ImitationConfig::beta`](playbot_learner::ImitationConfig)).
//!
//! After each round the policy is measured on training levels on which the demonstrator is not asked. Checkpoints hold
//! the best policy so far, for everything that reads runs, and the present one, for the resumption.
//!
//! ```text
//! runs/<id>/labels/round-0000.safetensors           the labelled steps of a round
//! runs/<id>/checkpoints/step-…/learner.safetensors  the best policy so far
//! runs/<id>/checkpoints/step-…/present.safetensors  the present policy, with its optimiser
//! runs/<id>/checkpoints/step-…/imitation.json       rounds and results
//! ```
//!
//! - `asked`: the Worlds in which the demonstrator is asked.

mod asked;
#[cfg(test)]
mod tests;

use crate::{
    checkpoint,
    checkpoint::{CheckpointChoice, CheckpointSummary},
    error::TrainError,
    experiment::{Algorithm, Experiment},
    imitate::asked::{AskPlan, Asked, ask},
    metrics_log::{Timing, UpdateReport},
    recordings::{RecordingsError, find_recordings, read_dataset},
    run_dir::{OpenedRun, RunDir, RunError, RunLock, check_new},
    run_observer::{CountedWork, RunEvent, RunObserver},
    train_run::{NewRun, TrainingSetup, run_info},
    trainer,
};
use bevy_playbot::{fault::Fault, policy::ActionDraw, vision::VisionError};
use playbot_harness::{
    eval::{EvalError, EvalSummary, Player, evaluate, summarize},
    game::Game,
    sealed_file::{SealedFileError, io_error, read_sealed, write_atomically, write_sealed},
    sensors::GameSensors,
    split::LevelSplit,
};
use playbot_learner::{
    DeviceKind, FileError, HasExitCode, LabelledSteps, LearnError, Learner, Policy, PolicySpec, PpoLearner, Streams,
    disk, rng::unit,
};
use serde::{Deserialize, Serialize};
use std::{fs, path::PathBuf, time::Instant};
use thiserror::Error;

/// Failure of an imitation.
#[derive(Debug, Error)]
pub enum ImitateError {
    /// The game has no demonstrator to ask.
    #[error(
        "`{game}` has no demonstrator to ask: give it one (`ForeignGame::demonstrator`, or `BotTools::demonstrator`), or \
         imitate recordings, with --demos and without --dagger"
    )]
    NoDemonstrator {
        /// Name of the game.
        game: String,
    },
    /// The demonstrator acts for a purpose that other actions would break.
    #[error(
        "`{demonstrator}` of `{game}` cannot be asked: {why}; imitate its recordings, with --demos and without --dagger"
    )]
    CannotBeAsked {
        /// Name of the game.
        game: String,
        /// Name of the demonstrator.
        demonstrator: String,
        /// The reason.
        why: String,
    },
    /// The run is none of imitation.
    #[error("{} is a run of {algorithm}, not of imitation: go on with `playbot train --run {} --resume`", run.display(), run.display())]
    OtherRun {
        /// Folder of the run.
        run: PathBuf,
        /// Its algorithm.
        algorithm: Algorithm,
    },
    /// The experiment does not fit the game, or the game broke its contract.
    #[error(transparent)]
    Train(#[from] Box<TrainError>),
    /// The folder of the run cannot be used.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The recordings cannot be learned from.
    #[error(transparent)]
    Recordings(#[from] Box<RecordingsError>),
    /// The policy cannot be measured.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// The policy cannot be learned.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A file of the run cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl From<TrainError> for ImitateError {
    fn from(error: TrainError) -> Self {
        Self::Train(error.into())
    }
}

impl From<Fault> for ImitateError {
    fn from(error: Fault) -> Self {
        Self::Train(Box::new(error.into()))
    }
}

impl From<VisionError> for ImitateError {
    fn from(error: VisionError) -> Self {
        Self::Eval(error.into())
    }
}

impl From<RecordingsError> for ImitateError {
    fn from(error: RecordingsError) -> Self {
        Self::Recordings(error.into())
    }
}

impl From<SealedFileError> for ImitateError {
    fn from(error: SealedFileError) -> Self {
        Self::Run(error.into())
    }
}

impl HasExitCode for ImitateError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::NoDemonstrator { .. } | Self::CannotBeAsked { .. } | Self::OtherRun { .. } => 3,
            Self::Train(error) => error.exit_code(),
            Self::Run(error) => error.exit_code(),
            Self::Recordings(error) => error.exit_code(),
            Self::Eval(error) => error.exit_code(),
            Self::Learn(error) => error.exit_code(),
            Self::File(error) => error.exit_code(),
        }
    }
}

/// How far an imitation has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImitationProgress {
    /// Rounds done.
    pub rounds: u64,
    /// Labelled steps that were played, or recorded steps that were read in all rounds together.
    pub steps: u64,
    /// Episodes that ended while steps were labelled.
    pub episodes: u64,
    /// The best round; `None` without levels to measure on.
    pub best: Option<BestRound>,
}

/// The round whose policy is the best on the levels without labels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BestRound {
    /// Its number, from 1.
    pub round: u64,
    /// Share of its episodes that reached the goal.
    pub success: f64,
    /// Its mean return.
    pub episodic_return: f64,
}

impl BestRound {
    fn is_better_than(&self, other: &Self) -> bool {
        (self.success, self.episodic_return) > (other.success, other.episodic_return)
    }
}

/// The training levels of an imitation: most are labelled, and the last ones say which round is the best.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImitationLevels {
    /// Levels that are played and labelled.
    pub labelled: LevelSplit,
    /// Levels on which rounds are measured; `None` if there is only one level, or the share is 0.
    pub held_out: Option<LevelSplit>,
}

impl ImitationLevels {
    /// Splits the training levels of an experiment.
    pub fn of(experiment: &Experiment) -> Self {
        let (train, config) = (&experiment.train, &experiment.imitation);
        let wanted = (train.len() as f64 * config.held_out).round() as u64;
        let count = wanted.min(train.len().saturating_sub(1));
        if count == 0 {
            return Self { labelled: train.clone(), held_out: None };
        }
        let first = train.last - (count - 1);
        let last = train.last.min(first.saturating_add(config.played - 1));
        Self {
            labelled: LevelSplit { last: first - 1, ..train.clone() },
            held_out: Some(LevelSplit { first, last, ..train.clone() }),
        }
    }
}

const PRESENT: &str = "present.safetensors";

const PROGRESS: &str = "imitation.json";

/// An imitation in the folder of a run.
pub struct Imitation<'a> {
    game: &'a dyn Game,
    run: RunDir,
    experiment: Experiment,
    levels: ImitationLevels,
    learner: PpoLearner,
    /// The file of the best learner so far.
    best: Option<Vec<u8>>,
    steps: LabelledSteps,
    progress: ImitationProgress,
    threads: usize,
}

impl<'a> Imitation<'a> {
    /// Begins an imitation. The algorithm of the experiment becomes [`Algorithm::Imitation`]. Without
    /// [`dagger`](playbot_learner::ImitationConfig) its recordings are read. The folder is made last.
    ///
    /// # Errors
    ///
    /// [`ImitateError`]; an existing run in the folder stays.
    pub fn begin(
        game: &'a dyn Game,
        new: &NewRun<'_>,
        setup: &TrainingSetup<'_>,
        observer: &mut dyn RunObserver,
    ) -> Result<Self, ImitateError> {
        check_new(new.path, new.force)?;
        let lock = || RunLock::of_new(new.path, new.force);
        Self::begin_with(game, &new.experiment.without_study(), &lock, setup, observer)
    }

    /// Begins an imitation as [`begin`](Self::begin) does, in the folder that `lock` gives.
    pub(crate) fn begin_with(
        game: &'a dyn Game,
        experiment: &Experiment,
        lock: &dyn Fn() -> Result<RunLock, RunError>,
        setup: &TrainingSetup<'_>,
        observer: &mut dyn RunObserver,
    ) -> Result<Self, ImitateError> {
        let mut experiment = Experiment { algorithm: Algorithm::Imitation, ..experiment.clone() };
        trainer::check(game, &experiment)?;
        let spec = spec_of(game, &experiment);
        let (mut steps, mut seen) = (LabelledSteps::empty(&spec), None);
        if experiment.imitation.dagger {
            check_demonstrator(game)?;
            experiment.steps = round_steps(&experiment).saturating_mul(experiment.imitation.rounds);
        } else {
            let path = find_recordings(&experiment, setup.recordings, observer).map_err(RecordingsError::from)?;
            let dataset = read_dataset(game, &experiment, &path, setup.threads, observer)?;
            seen = dataset.seen().cloned();
            steps = LabelledSteps::of(&dataset)?;
            experiment.steps = (steps.len() as u64).saturating_mul(experiment.imitation.rounds).max(1);
        }
        let learner = PpoLearner::new(experiment.with_sets(game).ppo_config(), spec, experiment.seed, setup.device)?;
        let lock = lock()?;
        let new = NewRun {
            path: lock.folder(),
            experiment: &experiment,
            skills: None,
            skill_file: None,
            from: None,
            force: true,
        };
        let info = run_info(game, &new, seen, setup)?;
        let run = RunDir::begin(lock, &experiment, &info)?;
        let imitation = Self {
            game,
            levels: ImitationLevels::of(&experiment),
            run,
            experiment,
            learner,
            best: None,
            steps,
            progress: ImitationProgress::default(),
            threads: setup.threads,
        };
        if !imitation.steps.is_empty() {
            imitation.save_labels(0, &imitation.steps)?;
        }
        Ok(imitation)
    }

    /// Resumes an imitation from its last checkpoint, or from its beginning if it has none.
    ///
    /// # Errors
    ///
    /// [`ImitateError::OtherRun`] for a run of `train`; another [`ImitateError`] if its files cannot be read.
    pub fn resume(game: &'a dyn Game, opened: OpenedRun, setup: &TrainingSetup<'_>) -> Result<Self, ImitateError> {
        let OpenedRun { run, experiment, info } = opened;
        if info.algorithm != Algorithm::Imitation {
            return Err(ImitateError::OtherRun { run: run.path().to_owned(), algorithm: info.algorithm });
        }
        trainer::check(game, &experiment)?;
        let spec = spec_of(game, &experiment);
        let (learner, progress, best) = match run.checkpoint(CheckpointChoice::Last) {
            Ok(last) => {
                let best_file = last.learner_file();
                let best = fs::read(&best_file).map_err(io_error("read", &best_file))?;
                let (progress, _) = read_sealed::<ImitationProgress>(&last.path.join(PROGRESS))?;
                (PpoLearner::load(&last.path.join(PRESENT), setup.device)?, progress, Some(best))
            }
            Err(RunError::NoCheckpoint { .. }) => {
                let config = experiment.with_sets(game).ppo_config();
                let learner = PpoLearner::new(config, spec, experiment.seed, setup.device)?;
                (learner, ImitationProgress::default(), None)
            }
            Err(error) => return Err(error.into()),
        };
        run.metrics_log().rewind(progress.steps, progress.rounds)?;
        let levels = ImitationLevels::of(&experiment);
        let steps = LabelledSteps::empty(&spec);
        let mut imitation =
            Self { game, run, levels, learner, best, steps, progress, threads: setup.threads, experiment };
        let rounds = if imitation.experiment.imitation.dagger { progress.rounds } else { 1 };
        for round in 0..rounds {
            let more = LabelledSteps::load(&imitation.labels(round), &spec)?;
            imitation.steps.extend(&more, &spec)?;
        }
        Ok(imitation)
    }

    /// Returns how far it has come.
    pub fn progress(&self) -> &ImitationProgress {
        &self.progress
    }

    /// Returns its experiment.
    pub fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// Returns its levels.
    pub fn levels(&self) -> &ImitationLevels {
        &self.levels
    }

    /// Returns all labelled steps so far.
    pub fn steps(&self) -> &LabelledSteps {
        &self.steps
    }

    /// Returns the present policy.
    pub fn policy(&self) -> Policy {
        self.learner.policy()
    }

    /// Returns the folder of the run, and the policy of the best round so far: the present one before the first round.
    ///
    /// # Errors
    ///
    /// [`ImitateError::File`] if that cannot be read.
    pub(crate) fn into_best(self, device: DeviceKind) -> Result<(RunDir, Policy), ImitateError> {
        let policy = match self.run.checkpoint(CheckpointChoice::Last) {
            Ok(last) => PpoLearner::load(&last.learner_file(), device)?.policy(),
            Err(_) => self.learner.policy(),
        };
        Ok((self.run, policy))
    }

    /// Returns whether all rounds are done, or the last ones were no better than one before.
    pub fn is_done(&self) -> bool {
        let ImitationProgress { rounds, best, .. } = self.progress;
        let config = &self.experiment.imitation;
        rounds >= config.rounds || best.is_some_and(|best| rounds - best.round >= config.patience)
    }

    /// Imitates to the end, or until the observer stops it between two rounds. `after` receives the number of each round,
    /// from 1, and its report. Returns whether the end was reached.
    ///
    /// # Errors
    ///
    /// [`ImitateError`]; the last checkpoint is kept.
    pub fn drive(
        &mut self,
        observer: &mut dyn RunObserver,
        after: &mut dyn FnMut(&ImitationProgress, &UpdateReport),
    ) -> Result<bool, ImitateError> {
        observer.observe(RunEvent::TrainingBegun { experiment: &self.experiment });
        while !self.is_done() && !observer.stopped() {
            observer.observe(RunEvent::UpdateBegun { step: self.progress.steps });
            let before = self.progress.steps;
            let report = self.round(observer)?;
            let steps = self.progress.steps - before;
            self.run.log(&report, steps)?;
            observer.observe(RunEvent::Updated { report: &report, steps_per_update: steps });
            self.save()?;
            observer.observe(RunEvent::Saved { run: self.run.path(), step: self.progress.steps });
            after(&self.progress, &report);
        }
        if self.is_done() && self.experiment.steps != self.progress.steps {
            // It ended early, and is finished.
            self.experiment.steps = self.progress.steps;
            self.run.write_experiment(&self.experiment)?;
        }
        observer.observe(RunEvent::TrainingEnded);
        Ok(self.is_done())
    }

    /// Labels steps if the demonstrator is asked, learns from all of them, and measures.
    fn round(&mut self, observer: &mut dyn RunObserver) -> Result<UpdateReport, ImitateError> {
        let (start, round) = (Instant::now(), self.progress.rounds);
        let config = self.experiment.imitation.clone();
        let fresh = match config.dagger {
            true => self.label(round)?,
            false if round == 0 => self.steps.len(),
            false => 0,
        };
        let (labelled, start) = (start.elapsed(), Instant::now());
        let metrics = self.learner.imitate(&self.steps, fresh, &config)?;
        let learned = start.elapsed();
        self.progress.rounds += 1;
        self.progress.steps += if config.dagger { fresh } else { self.steps.len() } as u64;
        let measured = self.measure(observer)?;
        let of_round = measured.as_ref().map(|summary| BestRound {
            round: self.progress.rounds,
            success: summary.success,
            episodic_return: summary.return_mean,
        });
        let is_best = match (&of_round, &self.progress.best) {
            (Some(new), Some(best)) => new.is_better_than(best),
            _ => true,
        };
        if is_best {
            self.progress.best = of_round;
            self.best = None;
        }
        Ok(UpdateReport {
            update: self.progress.rounds,
            step: self.progress.steps,
            episodes: self.progress.episodes,
            episodic_return: measured.as_ref().map(|summary| summary.return_mean),
            episodic_length: measured.as_ref().map(|summary| summary.length_mean),
            success_rate: measured.as_ref().map(|summary| summary.success),
            clipped_share: None,
            initial_kl: None,
            levels: Vec::new(),
            learner: metrics,
            timing: Timing { collect_s: labelled.as_secs_f64(), learn_s: learned.as_secs_f64(), ..Timing::default() },
        })
    }

    /// Plays a round, asks the demonstrator, and keeps its labels. Returns their number.
    fn label(&mut self, round: u64) -> Result<usize, ImitateError> {
        let Experiment { imitation, seed, worlds, .. } = &self.experiment;
        let arenas = arenas_of(&self.experiment);
        let policy = self.learner.policy();
        let Asked { steps, episodes } = ask(&AskPlan {
            game: self.game,
            levels: &self.levels.labelled,
            randomise: &self.experiment.randomise,
            observation_config: self.experiment.observation_config(),
            seed: seed_of(*seed, round),
            share: imitation.beta.powi(i32::try_from(round).unwrap_or(i32::MAX)),
            policy: &policy,
            ticks: imitation.steps.div_ceil(u64::from(arenas)),
            arenas,
            worlds: (*worlds).min(arenas),
            threads: self.threads,
        })?;
        self.save_labels(round, &steps)?;
        self.steps.extend(&steps, &policy.spec())?;
        self.progress.episodes += episodes;
        Ok(steps.len())
    }

    /// Measures the present policy on the levels without labels.
    fn measure(&self, observer: &mut dyn RunObserver) -> Result<Option<EvalSummary>, ImitateError> {
        let Some(held_out) = &self.levels.held_out else { return Ok(None) };
        let draw = if self.experiment.eval.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
        let player = Player::Policy { policy: self.learner.policy(), prior: None, draw };
        let plan = self.experiment.eval_plan(held_out, self.threads);
        let counter = observer.counter(CountedWork::Measure { name: "round", episodes: plan.episodes() });
        let results = evaluate(self.game, &player, &plan, counter)?;
        let summary = summarize(Algorithm::Imitation.name(), held_out, &results);
        observer.observe(RunEvent::Measured(&summary));
        Ok(Some(summary))
    }

    fn labels(&self, round: u64) -> PathBuf {
        self.run.path().join("labels").join(format!("round-{round:04}.safetensors"))
    }

    fn save_labels(&self, round: u64, steps: &LabelledSteps) -> Result<(), ImitateError> {
        let folder = self.run.path().join("labels");
        disk::create_dir_all(&folder).map_err(io_error("create", &folder))?;
        Ok(steps.save(&self.labels(round), &self.learner.spec())?)
    }

    /// Saves the present learner and the best one as a checkpoint.
    fn save(&mut self) -> Result<(), ImitateError> {
        self.run.metrics_log().sync()?;
        let ImitationProgress { steps: step, best, .. } = self.progress;
        let episodic_return = best.map(|best| best.episodic_return);
        let summary =
            CheckpointSummary { step, episodic_return, success_rate: best.map(|best| best.success), elo: None };
        let keep = self.experiment.checkpoints.keep;
        let (learner, best, progress) = (&self.learner, &self.best, &self.progress);
        checkpoint::write(self.run.path(), summary, keep, |fresh| {
            learner.save(&fresh.path.join(PRESENT))?;
            match best {
                Some(bytes) => write_atomically(&fresh.learner_file(), bytes)?,
                None => learner.save(&fresh.learner_file())?,
            }
            Ok(write_sealed(&fresh.path.join(PROGRESS), progress)?)
        })?;
        if self.best.is_none() {
            let file = self.run.checkpoint(CheckpointChoice::Last)?.learner_file();
            self.best = Some(fs::read(&file).map_err(io_error("read", &file))?);
        }
        Ok(())
    }
}

fn spec_of(game: &dyn Game, experiment: &Experiment) -> PolicySpec {
    PolicySpec { obs: experiment.observation_config().obs_kind(game), latent: 0, action_space: game.actions() }
}

/// Returns the random seed of a round.
fn seed_of(seed: u64, round: u64) -> u64 {
    (unit(&mut Streams::new(seed).stream("imitation.round", round)) * (1u64 << 53) as f64) as u64
}

/// Returns the arenas of a round: as many as play long enough, and a number that the Worlds share.
fn arenas_of(experiment: &Experiment) -> u32 {
    let Experiment { imitation, arenas, worlds, .. } = experiment;
    let wanted = (imitation.steps / imitation.ticks.max(1)).clamp(1, u64::from(*arenas)) as u32;
    if wanted < *worlds { wanted } else { wanted - wanted % (*worlds).max(1) }
}

/// Returns the steps of a round: whole ticks of all arenas.
fn round_steps(experiment: &Experiment) -> u64 {
    let (steps, arenas) = (experiment.imitation.steps, u64::from(arenas_of(experiment)));
    steps.checked_next_multiple_of(arenas).unwrap_or(steps)
}

/// Checks that a game has a demonstrator that can be asked.
///
/// # Errors
///
/// [`ImitateError::NoDemonstrator`], or [`ImitateError::CannotBeAsked`] with the reason.
pub fn check_demonstrator(game: &dyn Game) -> Result<(), ImitateError> {
    let bots = game.tools().bots;
    let Some(demonstrator) = bots.demonstrator() else {
        return Err(ImitateError::NoDemonstrator { game: game.name().to_owned() });
    };
    match bots.cannot_be_asked() {
        Some(why) => {
            let (game, demonstrator) = (game.name().to_owned(), demonstrator.to_owned());
            Err(ImitateError::CannotBeAsked { game, demonstrator, why })
        }
        None => Ok(()),
    }
}
