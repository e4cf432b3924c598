//! The runs of a study: skills, training and measurement, each resumed where it was stopped. They go on side by side, with
//! as few threads each as there are enough runs for: on many cores several trainings use a machine better than one.
//!
//! The folder has:
//!
//! - `side_by_side`: runs on threads of their own, what they share, and what they tell.

mod side_by_side;

use crate::{
    checkpoint::CheckpointChoice,
    error::TrainError,
    experiment::{Algorithm, EvalConfig, Experiment, ExperimentError},
    imitate::{ImitateError, Imitation},
    learn_skills,
    learn_skills::{LearnSkillsError, behaviour_cloning},
    metrics_log::{EPISODIC_RETURN, SUCCESS_RATE},
    recordings::{Recorded, RecordingsError, check_recordings, find_recordings, read_dataset, read_rollouts},
    run_dir::{OpenedRun, RunDir, RunError, RunInfo, RunLock, check_replaceable, end_replacement, is_unstarted},
    run_observer::{CountedWork, RunEvent, RunObserver},
    runs::{RunCurves, RunsError, settings_that_differ},
    study::{LearningCurves, StudyReport, StudyResult, StudyRun, TestResult, TrainingResult, table::CostClock},
    study_runner::side_by_side::{SkillFiles, lock},
    train_run::{NewRun, Training, TrainingError, TrainingSetup, run_info},
    trainer::Trainer,
};
use bevy_playbot::{policy::ActionDraw, unknown_name::UnknownName, vision::ObservationConfig};
use playbot_harness::{
    eval::{EpisodeResult, EvalError, EvalPlan, EvalSummary, Player, evaluate, summarize},
    game::Game,
    games::Games,
    held_out::HeldOut,
    machine::free_memory,
    sealed_file::{SealedFileError, io_error, read_sealed, write_sealed},
    split::LevelSplit,
};
use playbot_learner::{Dataset, FileError, HasExitCode, SeenLevels, SkillModel, disk};
use playbot_report::statistics::steps_to_reach;
use std::{
    cell::Cell,
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Mutex,
};
use thiserror::Error;

/// The file of a run's result.
const RESULT: &str = "result.json";

/// Failure of a study's run.
#[derive(Debug, Error)]
pub enum StudyRunError {
    /// The program lacks the game.
    #[error(transparent)]
    Game(#[from] UnknownName),
    /// The experiment does not go together.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The folder holds a run of other settings.
    #[error(
        "{} holds a run with other settings: {}; use the same settings or another folder", folder.display(),
        settings_that_differ(wanted, saved)
    )]
    OtherSettings {
        /// The folder.
        folder: PathBuf,
        /// The experiment of the study's run.
        wanted: Box<Experiment>,
        /// The experiment of the run in the folder.
        saved: Box<Experiment>,
    },
    /// The file of a skill model has no name.
    #[error("{0}")]
    SkillFile(ron::Error),
    /// A skill model in the folder has seen held-out levels.
    #[error(
        "{} was learned from demonstrations of {seen}, and the held-out levels {test} have some of these: keep the runs of \
         this study in a folder of their own, with --runs", file.display()
    )]
    SeenSkills {
        /// Its file.
        file: PathBuf,
        /// Levels of its demonstrations.
        seen: String,
        /// The held-out levels.
        test: LevelSplit,
    },
    /// All held-out levels have layouts that were trained on or recorded.
    #[error(
        "each of the held-out levels {0} has a layout that this study trains on or that is recorded: name others with \
         `test`, or measure all of them with --include-seen"
    )]
    AllSeen(LevelSplit),
    /// The recordings cannot be learned from.
    #[error(transparent)]
    Recordings(Box<RecordingsError>),
    /// The skills cannot be learned.
    #[error(transparent)]
    Skills(Box<LearnSkillsError>),
    /// A skill model cannot be read or written.
    #[error(transparent)]
    Model(#[from] FileError),
    /// The imitation fails.
    #[error(transparent)]
    Imitate(Box<ImitateError>),
    /// The training fails.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The folder of the run cannot be used.
    #[error(transparent)]
    Run(Box<RunError>),
    /// The metrics of the run cannot be read.
    #[error(transparent)]
    Metrics(#[from] RunsError),
    /// The policy cannot be measured.
    #[error(transparent)]
    Measure(#[from] EvalError),
}

impl From<RecordingsError> for StudyRunError {
    fn from(error: RecordingsError) -> Self {
        Self::Recordings(error.into())
    }
}

impl From<LearnSkillsError> for StudyRunError {
    fn from(error: LearnSkillsError) -> Self {
        Self::Skills(error.into())
    }
}

impl From<ImitateError> for StudyRunError {
    fn from(error: ImitateError) -> Self {
        Self::Imitate(error.into())
    }
}

impl From<RunError> for StudyRunError {
    fn from(error: RunError) -> Self {
        Self::Run(error.into())
    }
}

impl HasExitCode for StudyRunError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Game(error) => error.exit_code(),
            Self::Experiment(error) => error.exit_code(),
            Self::OtherSettings { .. } | Self::SkillFile(_) | Self::SeenSkills { .. } | Self::AllSeen(_) => 3,
            Self::Recordings(error) => error.exit_code(),
            Self::Skills(error) => error.exit_code(),
            Self::Model(error) => error.exit_code(),
            Self::Imitate(error) => error.exit_code(),
            Self::Training(error) => error.exit_code(),
            Self::Run(error) => error.exit_code(),
            Self::Metrics(error) => error.exit_code(),
            Self::Measure(error) => error.exit_code(),
        }
    }
}

impl From<TrainError> for StudyRunError {
    fn from(error: TrainError) -> Self {
        Self::Training(error.into())
    }
}

impl From<SealedFileError> for StudyRunError {
    fn from(error: SealedFileError) -> Self {
        RunError::from(error).into()
    }
}

/// The runs of a study in one folder, and what they share: skill models and recordings.
pub struct StudyRunner<'a> {
    games: &'a Games<'a>,
    /// Folder of all runs.
    folder: PathBuf,
    /// Replace existing runs instead of resuming them.
    force: bool,
    setup: TrainingSetup<'a>,
    /// The most runs at a time.
    side_by_side: Option<usize>,
    skills: SkillFiles,
    /// Recordings that proved readable, with the levels that they show.
    checked: Vec<(RecordingsKey, SeenLevels)>,
    /// The last recordings that were read.
    last: Mutex<Option<(RecordingsKey, Dataset)>>,
    /// Held-out levels that some run of the study knows. All runs are measured on the others.
    known: BTreeSet<u64>,
    /// The number of known levels that are measured like new ones, since there are no new ones.
    measured_known: u64,
}

/// The folder of a run, locked.
enum RunFolder {
    /// An existing run is resumed.
    Begun(RunDir),
    /// An existing folder, if any, is replaced.
    New(RunLock),
}

/// A run whose training is over.
struct TrainedRun {
    dir: RunDir,
    player: Player,
    training: Option<TrainingResult>,
    curves: LearningCurves,
}

impl TrainedRun {
    /// Adds what the metrics of a training or imitation of this many steps say.
    fn with_metrics(dir: RunDir, player: Player, experiment: &Experiment, steps: u64) -> Result<Self, RunsError> {
        let training = Some(training_result(dir.path(), experiment, steps)?);
        let curves = learning_curves(dir.path())?;
        Ok(Self { dir, player, training, curves })
    }
}

/// Result of a run; `None` if the observer stopped it.
type Ended = Option<(StudyResult, LearningCurves)>;

/// Results of all runs; `None` if the observer stopped one.
type AllEnded = Option<Vec<(StudyResult, LearningCurves)>>;

impl<'a> StudyRunner<'a> {
    /// Makes a runner of runs in `folder`. With `force`, existing runs are replaced instead of resumed.
    pub fn new(games: &'a Games<'a>, folder: &Path, force: bool, setup: TrainingSetup<'a>) -> Self {
        Self {
            games,
            folder: folder.into(),
            force,
            setup,
            side_by_side: None,
            skills: SkillFiles::default(),
            checked: Vec::new(),
            last: Mutex::default(),
            known: BTreeSet::new(),
            measured_known: 0,
        }
    }

    /// Limits the number of runs that go on side by side. Without a limit there are as many as threads, and as have room in
    /// the memory.
    pub fn side_by_side(self, most: Option<usize>) -> Self {
        Self { side_by_side: most, ..self }
    }

    /// Brings all runs to their ends, and returns the report with their results. `None` if the observer stopped a run. All of
    /// them are measured on the held-out levels that are new to each. The results do not depend on how many runs go on side
    /// by side.
    ///
    /// # Errors
    ///
    /// A folder holds a run with other settings, no held-out level is new, or learning, training, measuring or saving
    /// fails.
    pub fn run_all(
        &mut self,
        runs: &[StudyRun],
        command: String,
        experiment: Experiment,
        observer: &mut dyn RunObserver,
    ) -> Result<Option<StudyReport>, StudyRunError> {
        self.note_known(runs, &experiment, observer)?;
        let ended = match self.lanes(runs)? {
            1 => self.run_in_turn(runs, observer)?,
            lanes => self.run_side_by_side(runs, lanes, observer)?,
        };
        let Some(ended) = ended else { return Ok(None) };
        let (results, curves) = ended.into_iter().unzip();
        Ok(Some(StudyReport { command, experiment, results, curves }))
    }

    /// Returns how many runs go on side by side.
    fn lanes(&self, runs: &[StudyRun]) -> Result<usize, StudyRunError> {
        let mut largest = 1;
        for run in runs {
            largest = largest.max(run.experiment.memory(self.games.get(&run.experiment.game)?));
        }
        let fit = usize::try_from(free_memory() / largest).unwrap_or(usize::MAX);
        let most = self.side_by_side.unwrap_or(usize::MAX);
        Ok(self.setup.threads.min(most).min(fit).min(runs.len()).max(1))
    }

    fn run_in_turn(&self, runs: &[StudyRun], observer: &mut dyn RunObserver) -> Result<AllEnded, StudyRunError> {
        let mut all = Vec::new();
        for (index, run) in runs.iter().enumerate() {
            observer.observe(RunEvent::StudyRunBegun { index, run });
            let ended = self.run(run, CostClock::start(), self.setup.threads, observer)?;
            let is_last = index + 1 == runs.len();
            let Some(ended) = ended.filter(|_| is_last || !observer.stopped()) else { return Ok(None) };
            observer.observe(RunEvent::StudyRunEnded { run, result: &ended.0 });
            all.push(ended);
        }
        Ok(Some(all))
    }

    /// Finds the held-out levels that some run knows: by number, as a file, or by their layout. A comparison of runs
    /// needs the same levels for all of them.
    fn note_known(
        &mut self,
        runs: &[StudyRun],
        study: &Experiment,
        observer: &mut dyn RunObserver,
    ) -> Result<(), StudyRunError> {
        let mut compared = Vec::new();
        (self.known, self.measured_known) = (BTreeSet::new(), 0);
        for run in runs {
            let game = self.games.get(&run.experiment.game)?;
            let seen = self.seen_by(game, run, observer)?;
            if !compared.contains(&seen) {
                self.known.extend(HeldOut::new(game, &run.experiment.test).seen_in(&seen, &|_, _| {}));
                compared.push(seen);
            }
        }
        let (test, known, is_measured) = (&study.test, self.known.len() as u64, study.eval.include_seen);
        if known > 0 {
            observer.observe(RunEvent::KnownLevels { test, known, is_measured });
        }
        if known == test.len() {
            if !is_measured {
                return Err(StudyRunError::AllSeen(test.clone()));
            }
            (self.known, self.measured_known) = (BTreeSet::new(), known);
        }
        Ok(())
    }

    /// Returns the levels that a run sees in training and in recordings.
    fn seen_by(
        &mut self,
        game: &dyn Game,
        run: &StudyRun,
        observer: &mut dyn RunObserver,
    ) -> Result<SeenLevels, StudyRunError> {
        let (experiment, folder) = (&run.experiment, self.folder.join(run.id()));
        let trained = || match experiment.algorithm.has_checkpoints() {
            true => experiment.seen_by_training(game),
            false => SeenLevels { game: game.name().to_owned(), ..SeenLevels::default() },
        };
        end_replacement(&folder)?;
        if let Some(info) = self.saved(run, &folder)? {
            // Runs of older versions have no note.
            return Ok(info.seen.unwrap_or_else(trained));
        }
        let mut seen = trained();
        if experiment.learns_from_demos() {
            seen.extend(&self.recorded(game, run, observer)?);
        }
        Ok(seen)
    }

    /// Returns the levels of the recordings that a new run learns from, or its skills have learned from.
    fn recorded(
        &mut self,
        game: &dyn Game,
        run: &StudyRun,
        observer: &mut dyn RunObserver,
    ) -> Result<SeenLevels, StudyRunError> {
        let file = self.skill_file(run)?;
        if run.experiment.algorithm.needs_skills() && !self.force && file.exists() {
            let model = self.load_skills(game, &run.experiment, file)?;
            return Ok(model.demos().cloned().unwrap_or_default());
        }
        let key = self.recordings_key(&run.experiment)?;
        if let Some((_, seen)) = self.checked.iter().find(|(checked, _)| *checked == key) {
            return Ok(seen.clone());
        }
        find_recordings(&run.experiment, self.setup.recordings, observer)?;
        let seen = check_recordings(game, &run.experiment, &key.path)?;
        self.checked.push((key, seen.clone()));
        Ok(seen)
    }

    /// Brings a run to its end, on this many threads.
    fn run(
        &self,
        run: &StudyRun,
        clock: CostClock,
        threads: usize,
        observer: &mut dyn RunObserver,
    ) -> Result<Ended, StudyRunError> {
        let game = self.games.get(&run.experiment.game)?;
        let folder = self.folder.join(run.id());
        end_replacement(&folder)?;
        let saved = self.saved(run, &folder)?;
        saved.iter().for_each(|info| self.warn_of_others(&folder, info));
        let is_saved = saved.is_some();
        let wants_all = run.experiment.eval.include_seen && !self.known.is_empty();
        let known = known_result(&folder.join(RESULT)).filter(|_| is_saved);
        // Runs that joined or left the study change the levels that all are measured on.
        let is_current = |result: &StudyResult| {
            let is_same = result.left_out.iter().eq(&self.known) && result.test.seen == self.measured_known;
            is_same && (result.with_seen.is_some() || !wants_all)
        };
        if let Some(result) = known.filter(is_current) {
            let result = StudyResult { with_seen: result.with_seen.filter(|_| wants_all), ..result };
            return Ok(Some((result, learning_curves(&folder)?)));
        }
        disk::create_dir_all(&folder).map_err(io_error("create", &folder))?;
        let lock = RunLock::take(&folder)?;
        let dir = if is_saved { RunFolder::Begun(RunDir::open_with(lock)?.run) } else { RunFolder::New(lock) };
        // The folder is locked until the result is written.
        let trained = self.train(game, run, dir, threads, observer)?;
        clock.note(&folder)?;
        let Some(TrainedRun { dir: _dir, player, training, curves }) = trained else { return Ok(None) };
        let experiment = &run.experiment;
        let (test, with_seen) = self.measure(game, run, &player, (wants_all, threads), observer)?;
        let result = StudyResult {
            variant: run.variant.clone(),
            algorithm: experiment.algorithm,
            seed: experiment.seed,
            training,
            test,
            left_out: self.known.iter().copied().collect(),
            with_seen,
        };
        write_sealed(&folder.join(RESULT), &result)?;
        Ok(Some((result, curves)))
    }

    /// Checks the folders of all existing runs. So nothing is begun if one of them is in use, or is no run and would
    /// have to be replaced.
    ///
    /// # Errors
    ///
    /// The folder, and its contents.
    pub fn check_folders(&self, runs: &[StudyRun]) -> Result<(), RunError> {
        for folder in runs.iter().map(|run| self.folder.join(run.id())).filter(|folder| folder.exists()) {
            if self.force {
                check_replaceable(&folder)?;
            }
            if RunLock::is_known(&folder) {
                RunLock::take(&folder)?;
            }
        }
        Ok(())
    }

    /// Opens the recordings of all runs that have yet to learn, so that nothing is begun if those of another run cannot
    /// be read. With `force`, recordings are also replayed.
    ///
    /// # Errors
    ///
    /// Recordings cannot be read, belong to another game, or show held-out levels.
    pub fn check_recordings(&mut self, runs: &[StudyRun], observer: &mut dyn RunObserver) -> Result<(), StudyRunError> {
        for run in runs {
            if self.wants_recordings(run)? {
                self.check_recordings_of(&run.experiment, observer)?;
            }
        }
        Ok(())
    }

    /// Returns whether a run has yet to learn from recordings.
    fn wants_recordings(&self, run: &StudyRun) -> Result<bool, StudyRunError> {
        let algorithm = run.experiment.algorithm;
        let learns = run.experiment.learns_from_demos();
        let is_measured = !self.force && self.folder.join(run.id()).join(RESULT).exists();
        let has_skills = algorithm.needs_skills() && !self.force && self.skill_file(run)?.exists();
        Ok(learns && !is_measured && !has_skills)
    }

    /// Checks recordings, unless they were checked already.
    fn check_recordings_of(
        &mut self,
        experiment: &Experiment,
        observer: &mut dyn RunObserver,
    ) -> Result<(), StudyRunError> {
        let key = self.recordings_key(experiment)?;
        if self.checked.iter().any(|(checked, _)| *checked == key) {
            return Ok(());
        }
        let (game, setup) = (self.games.get(&experiment.game)?, self.setup);
        match (self.force, key.with_rewards) {
            (false, _) => drop(find_recordings(experiment, setup.recordings, observer)?),
            (true, false) => drop(self.dataset(game, experiment, setup.threads, observer)?),
            (true, true) => drop(read_rollouts(game, experiment, setup.recordings, setup.threads, observer)?),
        }
        let seen = check_recordings(game, experiment, &key.path)?;
        self.checked.push((key, seen));
        Ok(())
    }

    /// Reads recordings, or returns the last ones if they are the same.
    fn dataset(
        &self,
        game: &dyn Game,
        experiment: &Experiment,
        threads: usize,
        observer: &mut dyn RunObserver,
    ) -> Result<Dataset, StudyRunError> {
        let key = self.recordings_key(experiment)?;
        // Recordings may be large: runs that read the same wait for them.
        let mut last = lock(&self.last);
        if let Some((known, dataset)) = &*last
            && *known == key
        {
            return Ok(dataset.clone());
        }
        let path = find_recordings(experiment, self.setup.recordings, observer)?;
        let dataset = read_dataset(game, experiment, &path, threads, observer)?;
        *last = Some((key, dataset.clone()));
        Ok(dataset)
    }

    fn recordings_key(&self, experiment: &Experiment) -> Result<RecordingsKey, ExperimentError> {
        Ok(RecordingsKey {
            game: experiment.game.clone(),
            path: (self.setup.recordings)(experiment.recordings()?),
            held_out: experiment.test.clone(),
            observation_config: experiment.observation_config(),
            steps: experiment.demo_steps,
            wins: experiment.demo_wins,
            with_states: experiment.skills.tells_states(),
            with_rewards: experiment.algorithm.trains_on_demos(),
        })
    }

    /// Returns the metadata of this run if the folder holds it, to be resumed.
    fn saved(&self, run: &StudyRun, folder: &Path) -> Result<Option<RunInfo>, StudyRunError> {
        if self.force || !folder.exists() || is_unstarted(folder) {
            return Ok(None);
        }
        let OpenedRun { experiment: saved, info, .. } = RunDir::open(folder)?;
        // The levels of a measurement are none of training, and an imitation counts its own steps.
        let eval = EvalConfig { include_seen: saved.eval.include_seen, ..run.experiment.eval.clone() };
        let steps = if run.experiment.algorithm == Algorithm::Imitation { saved.steps } else { run.experiment.steps };
        if saved == (Experiment { eval, steps, ..run.experiment.clone() }) {
            return Ok(Some(info));
        }
        let (wanted, saved) = (Box::new(run.experiment.clone()), Box::new(saved));
        Err(StudyRunError::OtherSettings { folder: folder.into(), wanted, saved })
    }

    /// Warns if another program or device made a run whose results go into the same table.
    fn warn_of_others(&self, folder: &Path, info: &RunInfo) {
        let TrainingSetup { revision, device, .. } = self.setup;
        let folder = folder.display();
        if info.revision != revision {
            tracing::warn!("{folder} was made by revision {} of playbot; this is {revision}", info.revision);
        }
        if info.device != device {
            tracing::warn!("{folder} was made on {}, not on {device}", info.device);
        }
    }

    /// Makes the folder of a run, in place of an existing one.
    fn begin(
        &self,
        game: &dyn Game,
        run: &StudyRun,
        lock: RunLock,
        skills: Option<&SkillModel>,
        recorded: Option<SeenLevels>,
    ) -> Result<RunDir, StudyRunError> {
        let (file, path, experiment) = (self.skill_file(run)?, lock.folder().to_owned(), &run.experiment);
        let new = NewRun { path: &path, experiment, skills, skill_file: Some(&file), from: None, force: true };
        let info = run_info(game, &new, recorded, &self.setup)?;
        Ok(RunDir::begin(lock, experiment, &info)?)
    }

    /// Trains a run that needs it. A folder to be replaced stays until its skills and recordings are there.
    fn train(
        &self,
        game: &dyn Game,
        run: &StudyRun,
        run_folder: RunFolder,
        threads: usize,
        observer: &mut dyn RunObserver,
    ) -> Result<Option<TrainedRun>, StudyRunError> {
        let (experiment, setup) = (&run.experiment, TrainingSetup { threads, ..self.setup });
        let draw = if experiment.eval.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
        if experiment.algorithm == Algorithm::Imitation {
            return self.imitate(game, run, run_folder, (draw, setup), observer);
        }
        let begun = matches!(&run_folder, RunFolder::Begun(dir) if dir.checkpoint(CheckpointChoice::Last).is_ok());
        let skills = match experiment.algorithm.needs_skills() && !begun {
            true => match self.skills(game, run, threads, observer)? {
                Some(skills) => Some(skills),
                None => return Ok(None),
            },
            false => None,
        };
        let Recorded { rollouts, seen } = match begun {
            true => Recorded::default(),
            false => read_rollouts(game, experiment, setup.recordings, setup.threads, observer)?,
        };
        let dir = match run_folder {
            RunFolder::Begun(dir) => dir,
            RunFolder::New(lock) => self.begin(game, run, lock, skills.as_ref(), seen)?,
        };
        if let (false, Some(skills)) = (experiment.algorithm.is_trained(), &skills) {
            let player = behaviour_cloning(skills, experiment, draw);
            return Ok(Some(TrainedRun { dir, player, training: None, curves: LearningCurves::default() }));
        }
        let trainer = if begun {
            dir.resume(game, experiment, setup.device, setup.threads)?
        } else {
            Trainer::with_demos(game, experiment, skills.as_ref(), &rollouts, setup.device, setup.threads)?
        };
        let mut training = Training { run: dir, trainer, started: None };
        if !training.drive(observer)? {
            return Ok(None);
        }
        let Training { run: dir, trainer, .. } = training;
        let player = Player::Policy { policy: trainer.policy(), prior: trainer.skill_prior(), draw };
        Ok(Some(TrainedRun::with_metrics(dir, player, experiment, trainer.steps())?))
    }

    /// Imitates recordings or a demonstrator, without reward: the policy of the best round is the run's.
    fn imitate(
        &self,
        game: &dyn Game,
        run: &StudyRun,
        run_folder: RunFolder,
        (draw, setup): (ActionDraw, TrainingSetup<'_>),
        observer: &mut dyn RunObserver,
    ) -> Result<Option<TrainedRun>, StudyRunError> {
        let experiment = &run.experiment;
        let mut imitation = match run_folder {
            RunFolder::Begun(dir) => {
                let OpenedRun { experiment, info, .. } = RunDir::open(dir.path())?;
                Imitation::resume(game, OpenedRun { run: dir, experiment, info }, &setup)?
            }
            RunFolder::New(lock) => {
                let lock = Cell::new(Some(lock));
                let taken = || lock.take().map_or_else(|| RunLock::of_new(&self.folder.join(run.id()), true), Ok);
                Imitation::begin_with(game, experiment, &taken, &setup, observer)?
            }
        };
        if !imitation.drive(observer, &mut |_, _| {})? {
            return Ok(None);
        }
        let steps = imitation.progress().steps;
        let (dir, policy) = imitation.into_best(setup.device)?;
        let player = Player::Policy { policy, prior: None, draw };
        Ok(Some(TrainedRun::with_metrics(dir, player, experiment, steps)?))
    }

    /// Returns the skill model of a run, learned once for all runs that share it; `None` if the observer stopped that.
    fn skills(
        &self,
        game: &dyn Game,
        run: &StudyRun,
        threads: usize,
        observer: &mut dyn RunObserver,
    ) -> Result<Option<SkillModel>, StudyRunError> {
        let (file, experiment) = (self.skill_file(run)?, &run.experiment);
        let _taken = self.skills.take(&file);
        let is_new = self.force && !self.skills.is_learned(&file);
        if is_new || !file.exists() {
            let dataset = self.dataset(game, experiment, threads, observer)?;
            if is_new {
                learn_skills::remove_checkpoint(&learn_skills::checkpoint_of(&file))?;
            }
            let learned =
                learn_skills::learn_into(&file, &experiment.with_sets(game), dataset, self.setup.device, observer)?;
            if learned.is_none() {
                return Ok(None);
            }
            self.skills.note_learned(&file);
        }
        self.load_skills(game, experiment, file).map(Some)
    }

    /// Loads skills for an experiment, whose held-out levels they must not have learned from.
    fn load_skills(
        &self,
        game: &dyn Game,
        experiment: &Experiment,
        file: PathBuf,
    ) -> Result<SkillModel, StudyRunError> {
        let model = SkillModel::load(&file, self.setup.device)?;
        match HeldOut::new(game, &experiment.test).shown_by(model.demos()) {
            Some(seen) => Err(StudyRunError::SeenSkills { file, seen, test: experiment.test.clone() }),
            None => Ok(model),
        }
    }

    /// Measures a player on the held-out levels that no run knows, and on all of them if that is wanted.
    fn measure(
        &self,
        game: &dyn Game,
        run: &StudyRun,
        player: &Player,
        (wants_all, threads): (bool, usize),
        observer: &mut dyn RunObserver,
    ) -> Result<(TestResult, Option<TestResult>), EvalError> {
        let (name, split) = (run.id(), &run.experiment.test);
        let held_out = HeldOut::new(game, split);
        let result = |summary: &EvalSummary, left_out: &BTreeSet<u64>, seen: u64| TestResult {
            layouts: held_out.different(left_out),
            seen,
            ..TestResult::from(summary)
        };
        let all = run.experiment.eval_plan(split, threads);
        let new = EvalPlan { left_out: self.known.clone(), ..all.clone() };
        let mut episodes = play(game, &name, player, &new, observer)?;
        let summary = summarize(&name, split, &episodes);
        observer.observe(RunEvent::Measured(&summary));
        let test = result(&summary, &self.known, self.measured_known);
        if !wants_all {
            return Ok((test, None));
        }
        // The draws of a policy depend on the levels of a plan: with a plan of their own, those that are known do not
        // change the result of the others.
        let is_new = |level: &u64| !self.known.contains(level);
        let known = EvalPlan { left_out: split.levels().filter(is_new).collect(), ..all };
        episodes.extend(play(game, &name, player, &known, observer)?);
        episodes.sort_by_key(|episode| episode.level);
        let summary = summarize(&name, split, &episodes);
        observer.observe(RunEvent::Measured(&summary));
        Ok((test, Some(result(&summary, &BTreeSet::new(), self.known.len() as u64))))
    }

    fn skill_file(&self, run: &StudyRun) -> Result<PathBuf, StudyRunError> {
        Ok(self.folder.join(run.skill_file().map_err(StudyRunError::SkillFile)?))
    }
}

/// The settings that determine the contents of a dataset or of training recordings.
#[derive(PartialEq)]
struct RecordingsKey {
    game: String,
    path: PathBuf,
    /// Levels that must not be among them.
    held_out: LevelSplit,
    observation_config: ObservationConfig,
    /// Most steps.
    steps: Option<u64>,
    /// Lost episodes are left out.
    wins: bool,
    /// The game's state is read beside the pictures.
    with_states: bool,
    /// Rewards are read, for which all recordings are replayed.
    with_rewards: bool,
}

/// Reads the result of a measured run. A damaged one is measured again.
fn known_result(path: &Path) -> Option<StudyResult> {
    let read = path.exists().then(|| read_sealed(path))?;
    Some(read.inspect_err(|error| tracing::warn!("{error}; the run is measured again")).ok()?.0)
}

/// Plays the levels of a plan.
fn play(
    game: &dyn Game,
    name: &str,
    player: &Player,
    plan: &EvalPlan,
    observer: &mut dyn RunObserver,
) -> Result<Vec<EpisodeResult>, EvalError> {
    let episodes = plan.episodes();
    let counter = observer.counter(CountedWork::Measure { name, episodes });
    evaluate(game, player, plan, counter)
}

/// Returns the training result of a run, from its metrics.
fn training_result(run: &Path, experiment: &Experiment, steps: u64) -> Result<TrainingResult, RunsError> {
    let curves = RunCurves::read(run)?;
    Ok(TrainingResult {
        steps,
        steps_to_threshold: steps_to_reach(curves.settled(SUCCESS_RATE), experiment.study.threshold),
        success: curves.last(SUCCESS_RATE),
        episodic_return: curves.last(EPISODIC_RETURN),
    })
}

/// Returns the learning curves of a run, from its metrics. They begin once 100 episodes have ended: means of fewer
/// jump, and are those of the shortest episodes.
fn learning_curves(run: &Path) -> Result<LearningCurves, RunsError> {
    let curves = RunCurves::read(run)?;
    let of = |tag| curves.settled(tag).to_vec();
    Ok(LearningCurves { success: of(SUCCESS_RATE), returns: of(EPISODIC_RETURN) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn learning_curves_begin_once_a_hundred_episodes_have_ended() {
        let folder = tempfile::tempdir().expect("a folder");
        let line = |(step, episodes, value): (u64, u64, f64)| {
            format!(
                "{{\"step\":{step},\"charts/episodes\":{episodes},\"charts/success_rate\":{value},\
                 \"charts/episodic_return\":{value}}}\n"
            )
        };
        let write = |lines: &[(u64, u64, f64)]| {
            let lines: String = lines.iter().map(|of| line(*of)).collect();
            fs::write(folder.path().join("metrics.jsonl"), lines).expect("writable");
            learning_curves(folder.path()).expect("readable")
        };
        let curves = write(&[(8, 40, 1.0), (16, 99, 0.1), (24, 100, 0.5), (32, 150, 0.75)]);
        assert_eq!((&curves.success, &curves.returns), (&vec![(24, 0.5), (32, 0.75)], &vec![(24, 0.5), (32, 0.75)]));
        assert_eq!(write(&[(8, 40, 1.0), (16, 99, 0.1)]), LearningCurves::default());
    }
}
