//! The training of a run: begun or resumed, logged and saved, stopped after any update.

use crate::{
    begin_from::{BeginError, BeginFrom, Origin, Started},
    checkpoint::CheckpointChoice,
    error::{RunError, TrainError},
    experiment::{Experiment, LearnerKind},
    metrics_log::UpdateReport,
    recordings::{Recorded, RecordingsError, read_rollouts},
    run_dir::{OpenedRun, RunDir, RunInfo, check_new},
    run_observer::{RunEvent, RunObserver},
    trainer,
    trainer::Trainer,
};
use playbot_harness::{game::Game, sealed_file::file_checksum};
use playbot_learner::{ContinuedSchedule, DeviceKind, HasExitCode, SeenLevels, SkillModel};
use playbot_report::{counted, whole};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Failure of a run's training.
#[derive(Debug, Error)]
pub enum TrainingError {
    /// The numbers of a training ran away.
    #[error(
        "{error}; the last good checkpoint is {} of step {step}: try a smaller learning rate or a tighter \
         max_grad_norm in a new run", checkpoint.display()
    )]
    Diverged {
        /// The error about diverged numbers.
        error: Box<TrainError>,
        /// Environment steps of the checkpoint.
        step: u64,
        /// Its folder.
        checkpoint: PathBuf,
    },
    /// A training could not be saved even once.
    #[error(
        "{error}; nothing of {} is saved yet, so there is nothing to go on from: make room or rights and start again \
         (`train` with --force, `study` with --resume)", run.display()
    )]
    NeverSaved {
        /// The reason.
        error: Box<RunError>,
        /// Folder of the run.
        run: PathBuf,
    },
    /// A training could not be saved.
    #[error(
        "{error}; the earlier checkpoints are untouched: make room or rights and go on with \
         `playbot train --run {} --resume`", run.display()
    )]
    NotSaved {
        /// The reason.
        error: Box<RunError>,
        /// Folder of the run.
        run: PathBuf,
    },
    /// The run cannot begin with another one.
    #[error(transparent)]
    BadStart(Box<BeginError>),
    /// The experiment, game and skills do not fit one another, or the training cannot go on.
    #[error(transparent)]
    Train(Box<TrainError>),
    /// The folder of the run cannot be used.
    #[error(transparent)]
    Run(Box<RunError>),
    /// The recordings cannot be trained on.
    #[error(transparent)]
    Recordings(Box<RecordingsError>),
}

impl From<TrainError> for TrainingError {
    fn from(error: TrainError) -> Self {
        Self::Train(error.into())
    }
}

impl From<BeginError> for TrainingError {
    fn from(error: BeginError) -> Self {
        Self::BadStart(error.into())
    }
}

impl From<RunError> for TrainingError {
    fn from(error: RunError) -> Self {
        Self::Run(error.into())
    }
}

impl From<RecordingsError> for TrainingError {
    fn from(error: RecordingsError) -> Self {
        Self::Recordings(error.into())
    }
}

impl HasExitCode for TrainingError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Diverged { .. } => 2,
            Self::BadStart(error) => error.exit_code(),
            Self::NeverSaved { error, .. } | Self::NotSaved { error, .. } => error.exit_code(),
            Self::Train(error) => error.exit_code(),
            Self::Run(error) => error.exit_code(),
            Self::Recordings(error) => error.exit_code(),
        }
    }
}

/// The circumstances of a training that its experiment does not say.
#[derive(Clone, Copy)]
pub struct TrainingSetup<'a> {
    /// Device that computes networks.
    pub device: DeviceKind,
    /// Threads. They change no result.
    pub threads: usize,
    /// Revision of playbot's own code, which runs note.
    pub revision: &'a str,
    /// Returns the path of recordings from the one that an experiment names.
    pub recordings: &'a (dyn Fn(&Path) -> PathBuf + Sync),
}

impl TrainingSetup<'_> {
    /// Returns a setup with an unknown revision, whose recordings are where experiments say.
    pub fn new(device: DeviceKind, threads: usize) -> Self {
        Self { device, threads, revision: "unknown", recordings: &Path::to_path_buf }
    }
}

/// A run to begin.
#[derive(Clone, Copy)]
pub struct NewRun<'a> {
    /// Its folder.
    pub path: &'a Path,
    /// Its experiment.
    pub experiment: &'a Experiment,
    /// The skill model, if the algorithm needs one.
    pub skills: Option<&'a SkillModel>,
    /// The file of the skill model, whose checksum the run notes.
    pub skill_file: Option<&'a Path>,
    /// The run with whose weights, normalisers and skills it begins, if it does not begin anew.
    pub from: Option<BeginFrom<'a>>,
    /// Replace an existing run.
    pub force: bool,
}

/// The training of a run: its folder, locked, and its trainer.
pub struct Training {
    /// The folder.
    pub run: RunDir,
    /// The trainer.
    pub trainer: Trainer,
    /// What it began with, if it has just begun with another run.
    pub started: Option<Started>,
}

impl Training {
    /// Begins a run, with the recordings of its experiment if its algorithm trains on them. The folder is made last.
    ///
    /// # Errors
    ///
    /// [`TrainingError`]; an existing run in the folder stays.
    pub fn begin(
        game: &dyn Game,
        new: &NewRun<'_>,
        setup: &TrainingSetup<'_>,
        observer: &mut dyn RunObserver,
    ) -> Result<Self, TrainingError> {
        let experiment = new.experiment;
        check_new(new.path, new.force)?;
        let origin = match &new.from {
            Some(from) => Some(Origin::open(game, from, experiment, new.skills.is_some(), setup.device)?),
            None => None,
        };
        let skills = new.skills.or_else(|| origin.as_ref().and_then(Origin::skills));
        let Recorded { rollouts, seen } = if experiment.algorithm.trains_on_demos() {
            // Before the recordings are replayed, which takes longer than the trainer's own check.
            trainer::check(game, experiment)?;
            read_rollouts(game, experiment, setup.recordings, setup.threads, observer)?
        } else {
            Recorded::default()
        };
        let mut trainer = Trainer::with_demos(game, experiment, skills, &rollouts, setup.device, setup.threads)?;
        if let Some(seen) = &seen {
            trainer.note_seen(seen);
        }
        let mut info = run_info(game, new, seen, setup)?;
        let started = origin.map(|origin| origin.give(&mut trainer, &mut info)).transpose()?;
        let run = RunDir::create(new.path, &experiment.without_study(), &info, new.force)?;
        Ok(Self { run, trainer, started })
    }

    /// Resumes a run from its last checkpoint. `experiment` is that of the run, or differs in its length or its
    /// checkpoints; it is then saved, unless nothing is left to train.
    ///
    /// # Errors
    ///
    /// [`TrainingError`] if there is no checkpoint, or it does not fit the game.
    pub fn resume(
        game: &dyn Game,
        opened: OpenedRun,
        experiment: &Experiment,
        setup: &TrainingSetup<'_>,
    ) -> Result<Self, TrainingError> {
        let OpenedRun { run, experiment: saved, .. } = opened;
        let trainer = run.resume(game, experiment, setup.device, setup.threads)?;
        if !trainer.is_done() && *experiment != saved {
            run.write_experiment(experiment)?;
        }
        Ok(Self { run, trainer, started: None })
    }

    /// Trains to the end of the experiment or until the observer stops it, with log and checkpoints. Returns whether
    /// the end was reached.
    ///
    /// # Errors
    ///
    /// Training or saving fails; the last checkpoint is kept.
    pub fn drive(&mut self, observer: &mut dyn RunObserver) -> Result<bool, TrainingError> {
        self.drive_with(observer, &mut |_, _| Ok(()))
    }

    /// Trains as [`drive`](Self::drive) does, and calls `after` with the trainer and its report after each update, once it
    /// is saved if it is to be.
    ///
    /// # Errors
    ///
    /// Those of [`drive`](Self::drive), and the first of `after`, which ends the training.
    pub fn drive_with<E: From<TrainingError>>(
        &mut self,
        observer: &mut dyn RunObserver,
        after: &mut dyn FnMut(&Trainer, &UpdateReport) -> Result<(), E>,
    ) -> Result<bool, E> {
        let Self { run, trainer, .. } = self;
        trainer.report_panics_to(run.path());
        let (steps_per_update, every) =
            (trainer.experiment().steps_per_update(), trainer.experiment().checkpoints.every);
        observer.observe(RunEvent::TrainingBegun { experiment: trainer.experiment() });
        let mut saved = trainer.updates();
        match run.checkpoint(CheckpointChoice::Last) {
            Ok(checkpoint) => observer.observe(RunEvent::Saved { run: run.path(), step: checkpoint.summary.step }),
            // A later failure then finds a good checkpoint.
            Err(_) => save(run, trainer, observer)?,
        }
        while !trainer.is_done() && !observer.stopped() {
            observer.observe(RunEvent::UpdateBegun { step: trainer.steps() });
            let report = trainer.update().map_err(|error| stopped_by(run, error))?;
            run.log(&report, steps_per_update).map_err(TrainingError::from)?;
            observer.observe(RunEvent::Updated { report: &report, steps_per_update });
            // The best of a training against rivals is a snapshot, so each of these is saved.
            if report.update.is_multiple_of(every) || trainer.is_snapshot() {
                save(run, trainer, observer)?;
                saved = report.update;
            }
            after(trainer, &report)?;
        }
        if trainer.updates() > saved {
            save(run, trainer, observer)?;
        }
        observer.observe(RunEvent::TrainingEnded);
        Ok(trainer.is_done())
    }
}

/// Returns the metadata of a new run. `recorded` are the levels of the recordings that it trains on.
///
/// # Errors
///
/// The skill model's file cannot be read.
pub(crate) fn run_info(
    game: &dyn Game,
    new: &NewRun<'_>,
    recorded: Option<SeenLevels>,
    setup: &TrainingSetup<'_>,
) -> Result<RunInfo, RunError> {
    let experiment = new.experiment;
    let skill_file = new.skill_file.filter(|_| experiment.algorithm.needs_skills());
    let mut seen = experiment.algorithm.has_checkpoints().then(|| experiment.seen_by_training(game));
    if let Some(recorded) = new.skills.and_then(SkillModel::demos).cloned().or(recorded) {
        seen.get_or_insert_with(|| recorded.clone()).extend(&recorded);
    }
    Ok(RunInfo {
        algorithm: experiment.algorithm,
        seed: experiment.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        revision: setup.revision.to_owned(),
        game_version: game.version(),
        skills: skill_file.map(file_checksum).transpose()?,
        seen,
        begun_from: None,
        observed: if experiment.observation_config().is_image() { Vec::new() } else { game.observation().names },
        device: setup.device,
    })
}

fn save(run: &RunDir, trainer: &mut Trainer, observer: &mut dyn RunObserver) -> Result<(), TrainingError> {
    run.save(trainer).map_err(|error| {
        let is_first = run.checkpoint(CheckpointChoice::Last).is_err();
        let (error, run) = (Box::new(error), run.path().into());
        if is_first { TrainingError::NeverSaved { error, run } } else { TrainingError::NotSaved { error, run } }
    })?;
    observer.observe(RunEvent::Saved { run: run.path(), step: trainer.steps() });
    Ok(())
}

/// Explains an error of a training, with the checkpoint that is left if its numbers diverged.
fn stopped_by(run: &RunDir, error: TrainError) -> TrainingError {
    match (&error, run.checkpoint(CheckpointChoice::Last)) {
        (TrainError::Learn(learn), Ok(checkpoint)) if learn.is_divergence() => {
            let (step, checkpoint) = (checkpoint.summary.step, checkpoint.path);
            TrainingError::Diverged { error: error.into(), step, checkpoint }
        }
        _ => error.into(),
    }
}

/// The end of a training that goes on until it mostly succeeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// Succeeded after this many steps.
    After(u64),
    /// Did not succeed within its steps.
    Never,
    /// Stopped by the observer.
    Stopped,
}

/// Trains until the success rate reaches the threshold of the experiment's study. Nothing is saved.
///
/// # Errors
///
/// [`TrainError`] if experiment, game and skills do not fit one another, or a loss is not a number.
pub fn train_to_success(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&SkillModel>,
    setup: &TrainingSetup<'_>,
    observer: &mut dyn RunObserver,
) -> Result<Reached, TrainError> {
    let mut trainer = Trainer::new(game, experiment, skills, setup.device, setup.threads)?;
    let steps_per_update = experiment.steps_per_update();
    observer.observe(RunEvent::TrainingBegun { experiment });
    let reached = loop {
        if trainer.is_done() {
            break Reached::Never;
        }
        if observer.stopped() {
            break Reached::Stopped;
        }
        let report = trainer.update()?;
        observer.observe(RunEvent::Updated { report: &report, steps_per_update });
        if report.mostly_succeeds(experiment.study.threshold) {
            break Reached::After(report.step);
        }
    };
    observer.observe(RunEvent::TrainingEnded);
    Ok(reached)
}

// Messages about the length of a training.

/// Returns a message about steps that are no whole number of updates; `None` for whole ones.
pub fn rounded(experiment: &Experiment) -> Option<String> {
    let (asked, trained) = (experiment.steps, experiment.whole_steps());
    (asked != trained).then(|| {
        format!(
            "{} rounded up to {} of {}: training for {}",
            if asked == 1 { "1 step is".to_owned() } else { format!("{} steps are", whole(asked as f64)) },
            counted(experiment.updates(), "update"),
            whole(experiment.steps_per_update() as f64),
            whole(trained as f64)
        )
    })
}

/// Returns a message about the values from which a prolonged training goes on; `None` if it has none that change.
pub fn goes_on_from(experiment: &Experiment, continued: &ContinuedSchedule) -> Option<String> {
    let lr = continued.lr.map(|lr| format!("the learning rate falls from {lr:.2e} to 0"));
    let kl_coef = continued.kl_coef.map(|(from, to)| format!("the penalty's weight goes from {from:.2e} to {to}"));
    let values: Vec<String> = lr.into_iter().chain(kl_coef).collect();
    (!values.is_empty()).then(|| {
        let last = whole(experiment.whole_steps() as f64);
        format!("the length is new: until step {last} {}, beginning with the last value", values.join(", and "))
    })
}

/// Returns a message about a training that ends before its policy learns; `None` for others.
pub fn never_learns(experiment: &Experiment) -> Option<String> {
    let algorithm = experiment.algorithm;
    if !algorithm.is_trained() {
        return None;
    }
    match algorithm.learner() {
        LearnerKind::Ppo => (experiment.updates() <= experiment.ppo.critic_warmup).then(|| {
            format!(
                "the policy will not change: only its critic learns in the first {} updates (`ppo.critic_warmup`), and \
                 this training has {}; train for longer, or set it lower",
                whole(experiment.ppo.critic_warmup as f64),
                whole(experiment.updates() as f64)
            )
        }),
        LearnerKind::Sac => sac_never_learns(experiment),
    }
}

fn sac_never_learns(experiment: &Experiment) -> Option<String> {
    let (algorithm, sac) = (experiment.algorithm, &experiment.sac);
    // Policies over skills learn from skills, not from ticks.
    let (held, what) = match algorithm.learns_prior() {
        true => (experiment.score.skill_interval as u64, "skills"),
        false => (1, "steps"),
    };
    let (starts, seen) = (sac.learning_starts, experiment.whole_steps() / held);
    if seen < starts {
        return Some(format!(
            "nothing will be learned: {algorithm} begins to learn after {} {what} (`sac.learning_starts`), and this training \
             has {} of them at most; train for longer, or set it lower",
            whole(starts as f64),
            whole(seen as f64),
        ));
    }
    // Steps of the update that reaches the start count, too.
    let steps = sac.updates_per_step * seen as f64;
    (steps <= sac.critic_warmup as f64).then(|| {
        format!(
            "the policy will not change: only its critics learn in the first {} gradient steps (`sac.critic_warmup`), \
             and this training has {} at most; train for longer, or set it lower",
            whole(sac.critic_warmup as f64),
            whole(steps.floor())
        )
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::experiment::file::parse_experiment;

    use super::*;

    #[test]
    fn only_what_is_no_whole_number_of_updates_is_spoken_of() {
        let said = |steps: u64| {
            let text = format!(
                r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: {steps}, algorithm: "ppo", arenas: 32,
                ppo: (num_steps: 128))"#
            );
            rounded(&parse_experiment(&text, Path::new("x.ron")).expect("valid"))
        };
        assert_eq!(said(500).as_deref(), Some("500 steps are rounded up to 1 update of 4,096: training for 4,096"));
        assert_eq!(said(1).as_deref(), Some("1 step is rounded up to 1 update of 4,096: training for 4,096"));
        assert_eq!(said(4097).as_deref(), Some("4,097 steps are rounded up to 2 updates of 4,096: training for 8,192"));
        assert_eq!(said(8192), None);
    }

    #[test]
    fn the_values_of_a_prolonged_training_are_reported() {
        let text = r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 8000, algorithm: "ppo", arenas: 32,
            ppo: (num_steps: 128))"#;
        let experiment = parse_experiment(text, Path::new("x.ron")).expect("valid");
        let said = |lr, kl_coef| goes_on_from(&experiment, &ContinuedSchedule { lr, kl_coef });
        assert_eq!(
            said(Some(0.000_05), None).as_deref(),
            Some(
                "the length is new: until step 8,192 the learning rate falls from 5.00e-5 to 0, beginning with the last value"
            )
        );
        let both = said(Some(0.000_05), Some((0.25, 0.0))).expect("both change");
        assert!(both.contains("to 0, and the penalty's weight goes from 2.50e-1 to 0, beginning"), "{both}");
        assert_eq!(said(None, None), None);
    }

    #[test]
    fn a_training_that_begins_too_late_is_reported() {
        let said = |algorithm: &str, steps: u64| {
            let text = format!(
                r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: {steps}, algorithm: "{algorithm}", demos: "d",
                arenas: 1, worlds: 1, sac: (num_steps: 100, learning_starts: 1000), score: (init_from_decoder: false, horizon: 4))"#
            );
            never_learns(&parse_experiment(&text, Path::new("x.ron")).expect("valid"))
        };
        let words = said("sac", 900).expect("too short");
        assert!(words.contains("after 1,000 steps (`sac.learning_starts`), and this training has 900"), "{words}");
        let words = said("spirl-sac", 3900).expect("too few skills");
        assert!(words.contains("after 1,000 skills") && words.contains("this training has 975 of them"), "{words}");
        for (algorithm, steps) in [("sac", 1000), ("spirl-sac", 4000), ("ppo", 900), ("bc", 900)] {
            assert_eq!(said(algorithm, steps), None, "{algorithm}");
        }
    }

    #[test]
    fn a_warm_up_that_never_ends_is_reported() {
        let said = |algorithm: &str, steps: u64| {
            let text = format!(
                r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: {steps}, algorithm: "{algorithm}", demos: "d",
                arenas: 4, worlds: 1, ppo: (num_steps: 100, critic_warmup: 3), score: (init_from_decoder: false),
                sac: (num_steps: 100, learning_starts: 100, updates_per_step: 0.5, critic_warmup: 1000))"#
            );
            never_learns(&parse_experiment(&text, Path::new("x.ron")).expect("valid"))
        };
        for algorithm in ["ppo", "score-ppo", "spirl-ppo"] {
            let words = said(algorithm, 1200).expect("three updates");
            assert!(words.contains("the first 3 updates (`ppo.critic_warmup`), and this training has 3;"), "{words}");
            assert_eq!(said(algorithm, 1201), None, "{algorithm}");
        }
        let words = said("score-sac", 2000).expect("too short");
        assert!(
            words.contains("1,000 gradient steps (`sac.critic_warmup`), and this training has 1,000 at most"),
            "{words}"
        );
        assert_eq!((said("score-sac", 2400), said("bc", 100)), (None, None));
    }
}
