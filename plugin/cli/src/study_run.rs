//! One run of a study: skills, training and measurement, each taken up where it was left.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use bevy_playbot::policy::ActionDraw;
use playbot_lab::games::Games;
use playbot_lab::{
    eval::{EvalPlan, Player},
    game::Game,
    report::{LearningCurves, StudyResult, TestResult, TrainingResult},
    train::{
        Trainer,
        checkpoint::CheckpointChoice,
        run_dir::{OpenedRun, RunDir, RunInfo, check_replaceable, end_replacement, is_unstarted},
        run_lock::RunLock,
        sealed_file::{read_sealed, write_sealed},
        study::StudyRun,
    },
};
use playbot_learner::{DeviceKind, SeenLevels, SkillModel, disk};

use super::{
    cloning::cloning,
    differences::{Options, in_words},
    error::CliError,
    experiment::ExperimentArgs,
    learn_skills::{self, SkillCheckpoint},
    methods,
    read_demos::{Recorded, read_rollouts},
    study_cost::CostClock,
    study_demos::StudyDemos,
    study_metrics::{learning_curves, training_result},
    train::{Source, drive, run_info},
    unseen::check_skills_unseen,
};

const RESULT: &str = "result.json";

/// Where the runs of a study live, and how they are computed.
pub struct Runner<'a> {
    games: &'a Games<'a>,
    /// What the command line says of the experiment.
    from: &'a ExperimentArgs,
    /// Folder of all runs.
    folder: PathBuf,
    /// Replace what is there instead of going on with it.
    force: bool,
    /// Where to compute.
    device: DeviceKind,
    /// Threads.
    threads: usize,
    /// Skill models that this process has learned already.
    learned: BTreeSet<PathBuf>,
    /// The recordings that skills are learned from.
    demos: StudyDemos<'a>,
}

/// The folder of a run, locked.
enum RunFolder {
    /// What is there is gone on with.
    Begun(RunDir),
    /// What is there, if anything, is replaced.
    New(RunLock),
}

/// A run whose training is over.
struct TrainedRun {
    dir: RunDir,
    player: Player,
    training: Option<TrainingResult>,
    curves: LearningCurves,
}

/// What came of a run; `None` after Ctrl-C.
pub type Ended = Option<(StudyResult, LearningCurves)>;

impl<'a> Runner<'a> {
    pub fn new(
        games: &'a Games<'a>,
        from: &'a ExperimentArgs,
        folder: &Path,
        force: bool,
        device: DeviceKind,
        threads: usize,
    ) -> Self {
        let (learned, demos) = (BTreeSet::new(), StudyDemos::new(games, from, threads));
        Self { games, from, folder: folder.into(), force, device, threads, learned, demos }
    }

    /// Brings a run to its end. `on_step` hears the steps of its training as it goes on.
    ///
    /// # Errors
    ///
    /// The folder holds a run with other settings, or learning, training, measuring or saving fails.
    pub fn run(&mut self, run: &StudyRun, title: &str, on_step: impl FnMut(u64)) -> Result<Ended, CliError> {
        let game = self.games.get(&run.experiment.game)?;
        let folder = self.folder.join(run.id());
        end_replacement(&folder)?;
        let is_saved = self.is_saved(run, &folder)?;
        if is_saved && let Some(result) = known_result(&folder.join(RESULT)) {
            return Ok(Some((result, learning_curves(&folder)?)));
        }
        disk::create_dir_all(&folder)
            .map_err(|error| CliError::Io(format!("cannot create {}: {error}", folder.display())))?;
        let lock = RunLock::take(&folder)?;
        let dir = if is_saved { RunFolder::Begun(RunDir::open_with(lock)?.run) } else { RunFolder::New(lock) };
        let clock = CostClock::start();
        // Nobody else writes there until the result is written.
        let trained = self.player(game, run, dir, title, on_step)?;
        clock.note(&folder)?;
        let Some(TrainedRun { dir: _dir, player, training, curves }) = trained else { return Ok(None) };
        let experiment = &run.experiment;
        let plan = EvalPlan::of(experiment, &experiment.test, self.threads);
        let measured = methods::measure(game, &run.id(), &player, &plan)?;
        let result = StudyResult {
            variant: run.variant.clone(),
            algorithm: experiment.algorithm,
            seed: experiment.seed,
            training,
            test: TestResult::from(&measured.summary),
        };
        write_sealed(&folder.join(RESULT), &result)?;
        Ok(Some((result, curves)))
    }

    /// Opens the demonstrations of all runs that have yet to learn from some, so that nothing is begun if those of another cannot
    /// be read; where runs are to be replaced, they are replayed, too.
    ///
    /// # Errors
    ///
    /// Recordings cannot be read, belong to another game, or show held-out levels.
    pub fn check_demos(&mut self, runs: &[StudyRun]) -> Result<(), CliError> {
        for run in runs {
            if self.wants_demos(run)? {
                self.demos.check(&run.experiment, self.force)?;
            }
        }
        Ok(())
    }

    /// Whether a run has yet to learn from recordings.
    fn wants_demos(&self, run: &StudyRun) -> Result<bool, CliError> {
        let algorithm = run.experiment.algorithm;
        let is_measured = !self.force && self.folder.join(run.id()).join(RESULT).exists();
        let has_skills = algorithm.needs_skills() && !self.force && self.skill_file(run)?.exists();
        Ok(algorithm.learns_from_demos() && !is_measured && !has_skills)
    }

    /// Looks at the folders of all runs that are there, so that nothing is begun if one of them is in use, or is no run
    /// and would have to be replaced.
    ///
    /// # Errors
    ///
    /// The folder, and what it is.
    pub fn check_folders(&self, runs: &[StudyRun]) -> Result<(), CliError> {
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

    /// Whether there is a folder with this run that is gone on with.
    fn is_saved(&self, run: &StudyRun, folder: &Path) -> Result<bool, CliError> {
        if self.force || !folder.exists() || is_unstarted(folder) {
            return Ok(false);
        }
        let OpenedRun { experiment: saved, info, .. } = RunDir::open(folder)?;
        if saved == run.experiment {
            self.warn_of_others(folder, &info);
            return Ok(true);
        }
        let differences = Options { from: self.from, own: &[] }.differences(&run.experiment, &saved, "the run", &[]);
        Err(CliError::Usage(format!(
            "{} holds a run with other settings: {}; ask for the same, choose another folder with --runs, or replace all \
             with --force",
            folder.display(),
            in_words(differences)
        )))
    }

    /// Says if another program or device made a run whose results go into the same table.
    fn warn_of_others(&self, folder: &Path, info: &RunInfo) {
        let revision = env!("PLAYBOT_REVISION");
        if info.revision != revision {
            let folder = folder.display();
            tell!("warning: {folder} was made by revision {} of playbot; this is {revision}", info.revision);
        }
        if info.device != self.device {
            tell!("warning: {} was made on {}, not on {}", folder.display(), info.device, self.device);
        }
    }

    /// Makes a folder that of a run, in place of what is there.
    fn begin(
        &self,
        run: &StudyRun,
        lock: RunLock,
        skills: Option<&SkillModel>,
        recorded: Option<SeenLevels>,
    ) -> Result<RunDir, CliError> {
        let file = self.skill_file(run)?;
        let game = self.games.get(&run.experiment.game)?;
        let info = run_info(game, &run.experiment, &Source::new(Some(&file), skills, recorded), self.device)?;
        Ok(RunDir::begin(lock, &run.experiment, &info)?)
    }

    /// Trains what has to be trained. What is to be replaced stays until its skills and recordings are there.
    fn player(
        &mut self,
        game: &dyn Game,
        run: &StudyRun,
        run_folder: RunFolder,
        title: &str,
        mut on_step: impl FnMut(u64),
    ) -> Result<Option<TrainedRun>, CliError> {
        let experiment = &run.experiment;
        let draw = if experiment.eval.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
        let begun = matches!(&run_folder, RunFolder::Begun(dir) if dir.checkpoint(CheckpointChoice::Last).is_ok());
        let skills = match experiment.algorithm.needs_skills() && !begun {
            true => match self.skills(game, run)? {
                Some(skills) => Some(skills),
                None => return Ok(None),
            },
            false => None,
        };
        let Recorded { rollouts, seen } = match begun {
            true => Recorded::default(),
            false => read_rollouts(game, experiment, self.from, self.games, self.threads)?,
        };
        let dir = match run_folder {
            RunFolder::Begun(dir) => dir,
            RunFolder::New(lock) => self.begin(run, lock, skills.as_ref(), seen)?,
        };
        if let (false, Some(skills)) = (experiment.algorithm.is_trained(), &skills) {
            let player = cloning(skills, experiment, draw);
            return Ok(Some(TrainedRun { dir, player, training: None, curves: LearningCurves::default() }));
        }
        let mut trainer = if begun {
            dir.resume(game, experiment, self.device, self.threads)?
        } else {
            Trainer::with_demos(game, experiment, skills.as_ref(), &rollouts, self.device, self.threads)?
        };
        if !drive(&dir, &mut trainer, title, |report| on_step(report.step))? {
            return Ok(None);
        }
        let player = Player::Policy { policy: trainer.policy(), prior: trainer.skill_prior(), draw };
        let training = Some(training_result(dir.path(), experiment, trainer.steps())?);
        let curves = learning_curves(dir.path())?;
        Ok(Some(TrainedRun { dir, player, training, curves }))
    }

    /// The skill model of a run, learned once for all runs that share it; `None` after Ctrl-C.
    fn skills(&mut self, game: &dyn Game, run: &StudyRun) -> Result<Option<SkillModel>, CliError> {
        let file = self.skill_file(run)?;
        let is_new = self.force && !self.learned.contains(&file);
        if is_new || !file.exists() {
            let demos = self.demos.read(game, &run.experiment)?;
            let checkpoint = learn_skills::checkpoint_of(&file);
            if is_new {
                learn_skills::remove(&checkpoint)?;
            }
            let options = Options { from: self.from, own: &[] };
            let unfinished = SkillCheckpoint { path: &checkpoint, options, go_on: None };
            let learned = learn_skills::learn(&run.experiment, demos, self.device, Some(&unfinished), |_, _| Ok(()))?;
            let Some(model) = learned else { return Ok(None) };
            model.save(&file)?;
            learn_skills::remove(&checkpoint)?;
            self.learned.insert(file.clone());
        }
        let model = SkillModel::load(&file, self.device)?;
        check_skills_unseen(&file, &model, game, &run.experiment.test)?;
        Ok(Some(model))
    }

    fn skill_file(&self, run: &StudyRun) -> Result<PathBuf, CliError> {
        let name = run.skill_file().map_err(|error| CliError::Usage(error.to_string()))?;
        Ok(self.folder.join(name))
    }
}

/// The result of a run that was measured. A damaged one is measured again.
fn known_result(path: &Path) -> Option<StudyResult> {
    let read = path.exists().then(|| read_sealed(path))?;
    Some(read.inspect_err(|error| tracing::warn!("{error}; the run is measured again")).ok()?.0)
}
