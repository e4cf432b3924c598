//! The folder of a run: configuration, metrics, checkpoints; the lock of the one process that trains there, and the
//! replacement of a run.
//!
//! ```text
//! runs/<id>/experiment.ron     the experiment with all defaults filled in
//! runs/<id>/run.json           algorithm, seed, version
//! runs/<id>/metrics.jsonl      one line per update; the same bytes for the same seed
//! runs/<id>/timing.jsonl       seconds and steps per second of each update
//! runs/<id>/tensorboard/       both, as an event file for TensorBoard
//! runs/<id>/checkpoints/       the latest and the best, see [`checkpoint`]
//! runs/<id>/run.lock           locked during training, see [`RunLock`]
//! ```
//!
//! A run is replaced in two steps: it is moved aside, and removed once the new one is written.

use crate::{
    checkpoint,
    checkpoint::{Checkpoint, CheckpointChoice},
    collect::ArenaState,
    error::{TrainError, edited, unreadable},
    experiment::{
        Algorithm, Experiment,
        file::{parse_experiment_with, read_experiment_text},
    },
    levels::LevelState,
    metrics_log::{MetricsLog, UpdateReport},
    self_play::{SelfPlayState, Snapshot, read_snapshots},
    trainer,
    trainer::{Progress, TrainedLearner, Trainer},
};
use bevy_playbot::unknown_name::nearest;
use playbot_harness::{
    game::Game,
    sealed_file::{
        SealedFileError, check_text_seal, damaged, io_error, read_sealed, remove_temporaries, write_atomically,
        write_sealed,
    },
};
use playbot_learner::{DeviceKind, SeenLevels, disk, disk::DiskFile, seal_text};
use serde::{Deserialize, Serialize};
use std::{
    ffi::OsString,
    fs,
    fs::{File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
    thread,
};

pub use crate::error::{MEND, RunError};

/// File of the run's experiment.
const EXPERIMENT: &str = "experiment.ron";

/// Content of `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunInfo {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// The seed.
    pub seed: u64,
    /// Version of this crate.
    pub version: String,
    /// Revision of playbot's own code, if known. The game's revision is not kept, since its rules have a version.
    pub revision: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// [Checksum](playbot_harness::sealed_file::file_checksum) of the skill model's file, if the algorithm needs one.
    #[serde(default)]
    pub skills: Option<String>,
    /// The levels that it sees, with those of its recordings and its skills; missing in older runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenLevels>,
    /// The run whose weights or skills it began with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub begun_from: Option<Ancestor>,
    /// Names of the observed values, for runs that begin with it; none in older runs, and for pictures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub observed: Vec<String>,
    /// Device that it was started on; the default one if the run does not name it.
    #[serde(default)]
    pub device: DeviceKind,
}

/// Saved state of training besides the learner.
#[derive(Serialize, Deserialize)]
struct TrainState {
    progress: Progress,
    arenas: Vec<Vec<ArenaState>>,
    /// Missing without lessons and an order of levels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    levels: Option<LevelState>,
    /// Missing without rivals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    self_play: Option<SelfPlayState>,
}

/// A checkpoint that was read: its learner, its state, and the policies of its rivals.
type ReadCheckpoint = (TrainedLearner, TrainState, Vec<(usize, Snapshot)>);

/// An open folder of a run.
pub struct RunDir {
    path: PathBuf,
    /// Held while the run is open for writing.
    _lock: Option<RunLock>,
}

/// An existing run, with the content of its files.
pub struct OpenedRun {
    /// The folder.
    pub run: RunDir,
    /// Its experiment, with all defaults filled in.
    pub experiment: Experiment,
    /// Content of its `run.json`.
    pub info: RunInfo,
}

impl RunDir {
    /// Makes the folder if it is missing, locks it, and writes the run's description.
    ///
    /// # Errors
    ///
    /// [`RunError::Exists`] for a run unless `force`, which replaces it; [`RunError::NotARun`] for other content;
    /// [`RunError::Busy`] for a folder in use. [`RunError::File`] if it cannot be written.
    pub fn create(path: &Path, experiment: &Experiment, info: &RunInfo, force: bool) -> Result<Self, RunError> {
        Self::begin(RunLock::of_new(path, force)?, experiment, info)
    }

    /// Writes the run's description into a locked folder. An existing run is moved aside and removed once the new one
    /// is written; it is restored if that fails.
    ///
    /// # Errors
    ///
    /// [`RunError::NotARun`] for a folder with other content; [`RunError::File`] if it cannot be written.
    pub fn begin(lock: RunLock, experiment: &Experiment, info: &RunInfo) -> Result<Self, RunError> {
        let run = Self { path: lock.folder().to_owned(), _lock: Some(lock) };
        replace_run(&run.path, || {
            run.write_experiment(experiment)?;
            Ok(write_sealed(&run.path.join("run.json"), info)?)
        })?;
        Ok(run)
    }

    /// Opens the folder of an existing run for reading.
    ///
    /// # Errors
    ///
    /// [`RunError::NoRun`] without a run; another [`RunError`] if its files are damaged.
    pub fn open(path: &Path) -> Result<OpenedRun, RunError> {
        check_is_run(path)?;
        let experiment_path = path.join(EXPERIMENT);
        check_text_seal(&experiment_path).map_err(|error| with_remedy(error, edited))?;
        // Paths were resolved when the run began.
        let text = read_experiment_text(&experiment_path)?;
        let experiment = parse_experiment_with::<&str>(&text, &experiment_path, &[])?;
        let info_path = path.join("run.json");
        let (info, had_seal) = read_sealed(&info_path).map_err(|error| with_remedy(error, unreadable))?;
        if !had_seal {
            tracing::warn!(
                "{} was written by an older version and has no checksum: damage to it cannot be noticed",
                info_path.display()
            );
        }
        Ok(OpenedRun { run: Self { path: path.into(), _lock: None }, experiment, info })
    }

    /// Opens the folder of an existing run as [`open`](Self::open) does, to resume it.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open), and [`RunError::Busy`].
    pub fn open_to_write(path: &Path) -> Result<OpenedRun, RunError> {
        end_replacement(path)?;
        // Only the folder of a run gets a lock file.
        Self::open(path)?;
        Self::open_with(RunLock::take(path)?)
    }

    /// Opens a locked folder as [`open`](Self::open) does, to resume the run. Removes the leftovers of killed
    /// processes.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open).
    pub fn open_with(lock: RunLock) -> Result<OpenedRun, RunError> {
        let OpenedRun { run, experiment, info } = Self::open(lock.folder())?;
        tidy(&lock);
        Ok(OpenedRun { run: Self { _lock: Some(lock), ..run }, experiment, info })
    }

    /// Writes the experiment again, after its steps were raised.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn write_experiment(&self, experiment: &Experiment) -> Result<(), RunError> {
        let text = experiment.to_ron().map_err(|error| damaged(&self.path, &error))?;
        Ok(write_atomically(&self.path.join(EXPERIMENT), seal_text(&text).as_bytes())?)
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns a checkpoint of the run: the policy, its prior and the state of training.
    ///
    /// # Errors
    ///
    /// [`RunError::NoCheckpoint`].
    pub fn checkpoint(&self, choice: CheckpointChoice) -> Result<Checkpoint, RunError> {
        checkpoint::choose(&self.path, choice)
    }

    /// Returns the run's metrics.
    pub fn metrics_log(&self) -> MetricsLog {
        MetricsLog::new(&self.path)
    }

    /// Appends an update to the metrics.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn log(&self, report: &UpdateReport, steps_per_update: u64) -> Result<(), RunError> {
        Ok(self.metrics_log().append(report, steps_per_update)?)
    }

    /// Saves learner and arenas as a new checkpoint; the latest and the best of the earlier ones stay.
    ///
    /// # Errors
    ///
    /// [`RunError`]; the earlier checkpoints are still there.
    pub fn save(&self, trainer: &mut Trainer) -> Result<(), RunError> {
        self.metrics_log().sync()?;
        let keep = trainer.experiment().checkpoints.keep;
        checkpoint::write(&self.path, trainer.summary(), keep, |fresh| {
            trainer.learner.save(&fresh.learner_file())?;
            let (progress, levels) = (trainer.progress.clone(), trainer.level_state());
            let (arenas, self_play) = (trainer.save_arenas(), trainer.self_play_state());
            if let Some(rivals) = trainer.self_play() {
                let experiment = trainer.experiment();
                let (observation, algorithm) = (experiment.observation_config(), experiment.algorithm.name());
                rivals.save(&fresh.path, self_play.as_ref(), &observation, algorithm)?;
                rivals.ladder().write(&self.path)?;
            }
            Ok(write_sealed(&fresh.arenas_file(), &TrainState { progress, arenas, levels, self_play })?)
        })
    }

    /// Restores the last checkpoint, and drops metrics that were logged after it. A checkpoint that cannot be read,
    /// for instance after a disk fault, is skipped with a warning, and the one before it is used.
    ///
    /// # Errors
    ///
    /// [`RunError`] if no checkpoint exists, none can be read, or the checkpoint does not fit the game.
    pub fn resume(
        &self,
        game: &dyn Game,
        experiment: &Experiment,
        device: DeviceKind,
        threads: usize,
    ) -> Result<Trainer, RunError> {
        trainer::check(game, experiment)?;
        let (mut learner, state, rivals) = self.last_readable(experiment, device)?;
        let continued_schedule = learner.set_length(experiment);
        let mut trainer = Trainer::with_learner(game, experiment, learner, threads, state.levels)?;
        trainer.report_panics_to(&self.path);
        if let Some(self_play) = state.self_play {
            trainer.restore_self_play(self_play, rivals).map_err(TrainError::from)?;
        }
        trainer.restore_arenas(&state.arenas).map_err(TrainError::from)?;
        (trainer.progress, trainer.continued_schedule) = (state.progress, continued_schedule);
        trainer.seen = read_sealed::<RunInfo>(&self.path.join("run.json"))?.0.seen;
        checkpoint::set_aside_after(&self.path, trainer.progress.steps)?;
        self.metrics_log().rewind(trainer.progress.steps, trainer.progress.updates)?;
        Ok(trainer)
    }

    fn last_readable(&self, experiment: &Experiment, device: DeviceKind) -> Result<ReadCheckpoint, RunError> {
        let mut bad = Vec::new();
        for checkpoint in checkpoint::list(&self.path)?.iter().rev() {
            match read_checkpoint(checkpoint, experiment, device) {
                Ok(read) => {
                    if let Some(words) = passed_over(&bad, checkpoint.summary.step) {
                        tracing::warn!("{words}");
                    }
                    return Ok(read);
                }
                Err(error) => bad.push((checkpoint.summary.step, error)),
            }
        }
        let none = RunError::NoCheckpoint { path: self.path.clone(), steps: Vec::new() };
        Err(bad.into_iter().next().map_or(none, |(_, error)| error))
    }
}

fn read_checkpoint(
    checkpoint: &Checkpoint,
    experiment: &Experiment,
    device: DeviceKind,
) -> Result<ReadCheckpoint, RunError> {
    let learner = TrainedLearner::load(experiment.algorithm, &checkpoint.learner_file(), device)?;
    let state: TrainState = read_sealed(&checkpoint.arenas_file())?.0;
    let rivals = match &state.self_play {
        Some(rivals) => read_snapshots(&checkpoint.path, &experiment.self_play, rivals, device)?,
        None => Vec::new(),
    };
    Ok((learner, state, rivals))
}

/// Adds the remedy to the error of a damaged file.
fn with_remedy(error: SealedFileError, damage: fn(PathBuf, &str) -> RunError) -> RunError {
    match error {
        SealedFileError::Damaged { path, message } => damage(path, &message),
        other => other.into(),
    }
}

/// Describes the latest checkpoints of a run that cannot be read, by step and error, before the first readable one at
/// `step`. `None` if the last checkpoint is readable.
fn passed_over(bad: &[(u64, RunError)], step: u64) -> Option<String> {
    let (latest, why) = bad.first()?;
    if bad.len() == 1 {
        return Some(format!(
            "the checkpoint of step {latest} cannot be read ({why}); going on from step {step} instead"
        ));
    }
    let steps: Vec<String> = bad.iter().map(|(step, _)| step.to_string()).collect();
    Some(format!(
        "the checkpoints of the steps {} cannot be read (the first: {why}); going on from step {step} instead",
        steps.join(", ")
    ))
}

/// Removes the files that a process left when it was killed while it wrote into a run: temporary files and partial
/// checkpoints. Nothing depends on success, so a failure is only a warning.
fn tidy(lock: &RunLock) {
    remove_temporaries(lock.folder());
    if let Err(error) = checkpoint::remove_halves(lock.folder()) {
        tracing::warn!("{error}");
    }
}

// The lock, and the replacement of a run.

/// Name of the locked file. It stays when the lock is released, and is meaningless then.
const LOCK_FILE: &str = "run.lock";

/// Tries before a lock counts as taken: [`RunLock::is_taken`] of another process holds it for a moment.
const TRIES: usize = 1000;

/// The right to write into the folder of a run, until it is dropped. The system releases it at any end of the
/// process, so a kill leaves no lock. Readers need no lock.
#[derive(Debug)]
pub struct RunLock {
    folder: PathBuf,
    _file: DiskFile,
}

impl RunLock {
    /// Takes the lock of an existing folder.
    ///
    /// # Errors
    ///
    /// [`RunError::Busy`] if another process has it; [`RunError::File`] if the folder cannot be written.
    pub fn take(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(LOCK_FILE);
        let file = DiskFile::open(&path, OpenOptions::new().create(true).truncate(false).write(true));
        let file = file.map_err(io_error("open", &path))?;
        match try_often(file.as_file()) {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(RunError::Busy(folder.into())),
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {
                tracing::warn!("{} cannot be locked: make sure that nothing else trains there", folder.display());
            }
            Err(TryLockError::Error(error)) => return Err(io_error("lock", &path)(error).into()),
        }
        Ok(Self { folder: folder.into(), _file: file })
    }

    /// Makes the folder of a new run if it is missing, and takes its lock.
    ///
    /// # Errors
    ///
    /// As for [`check_new`] and [`take`](Self::take), and [`RunError::NoFolder`].
    pub fn of_new(path: &Path, force: bool) -> Result<Self, RunError> {
        check_new(path, force)?;
        disk::create_dir_all(path).map_err(|source| RunError::NoFolder { path: path.into(), source })?;
        Self::take(path)
    }

    /// Returns the path of the folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns whether the lock of a folder is taken now. Writes nothing.
    pub fn is_taken(folder: &Path) -> bool {
        let is_taken = |file: File| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
        File::open(folder.join(LOCK_FILE)).is_ok_and(is_taken)
    }

    /// Returns whether a folder has ever been locked, and so is the folder of a run.
    pub fn is_known(folder: &Path) -> bool {
        folder.join(LOCK_FILE).is_file()
    }
}

fn try_often(file: &File) -> Result<(), TryLockError> {
    for _ in 1..TRIES {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => thread::yield_now(),
            decided => return decided,
        }
    }
    file.try_lock()
}

/// Text between the name of a run and the number of the process that replaces it.
const MARK: &str = ".replaced-";

/// File in which a study notes the time of a run, even of one that was stopped while its skills were learned.
pub(crate) const COST: &str = "cost.json";

/// The files of a replaced run.
struct ReplacedRun {
    run: PathBuf,
    /// Folder beside the run; `None` if there was nothing to move.
    folder: Option<PathBuf>,
}

impl ReplacedRun {
    /// Moves everything but the lock aside. The files that identify a run go first, so a kill leaves no partial run.
    fn put_aside(run: &Path) -> Result<Self, RunError> {
        let mut names = names_in(run)?;
        let keeps_cost = is_unstarted(run);
        names.retain(|name| name != LOCK_FILE && !(keeps_cost && name == COST));
        names.sort_by_key(|name| (name != "run.json", name == "experiment.ron"));
        let mut aside = Self { run: run.into(), folder: None };
        if names.is_empty() {
            return Ok(aside);
        }
        let mut name = run.file_name().unwrap_or_default().to_owned();
        name.push(format!("{MARK}{}", std::process::id()));
        let folder = run.with_file_name(name);
        disk::create_dir_all(&folder).map_err(io_error("create", &folder))?;
        aside.folder = Some(folder.clone());
        for name in names {
            if let Err(error) = disk::rename(&run.join(&name), &folder.join(&name)) {
                aside.put_back();
                return Err(io_error("replace", run)(error).into());
            }
        }
        Ok(aside)
    }

    /// Removes the files. The new run does not depend on success.
    fn remove(self) {
        if let Some(folder) = self.folder
            && let Err(error) = disk::remove_dir_all(&folder)
        {
            tracing::warn!("cannot remove the old run in {}: {error}", folder.display());
        }
    }

    /// Restores as many files as possible after another failure, which is the one to report.
    fn put_back(self) {
        let Some(folder) = self.folder else { return };
        for name in names_in(&folder).unwrap_or_default() {
            let _ = disk::rename(&folder.join(&name), &self.run.join(&name));
        }
        if disk::remove_dir(&folder).is_err() {
            tracing::warn!("the old run is in {}", folder.display());
        }
    }
}

/// Writes a run in the place of the one that a locked folder may hold, which is restored if that fails.
///
/// # Errors
///
/// [`RunError::NotARun`] for a folder with other content, and the error of `write`.
pub(crate) fn replace_run(run: &Path, write: impl FnOnce() -> Result<(), RunError>) -> Result<(), RunError> {
    check_replaceable(run)?;
    let aside = ReplacedRun::put_aside(run)?;
    match write() {
        Ok(()) => aside.remove(),
        Err(error) => {
            aside.put_back();
            return Err(error);
        }
    }
    Ok(())
}

/// Completes a replacement whose process was killed: restores the old run if the new one had not begun, and removes
/// it otherwise.
///
/// # Errors
///
/// [`RunError::Busy`] while the other process lives; [`RunError::File`] if the folder cannot be written.
pub fn end_replacement(run: &Path) -> Result<(), RunError> {
    let leftovers = leftovers(run);
    if leftovers.is_empty() || !run.is_dir() {
        return Ok(());
    }
    let _lock = RunLock::take(run)?;
    for folder in leftovers {
        let aside = ReplacedRun { run: run.into(), folder: Some(folder.clone()) };
        let run = run.display();
        if aside.run.join("run.json").is_file() {
            tracing::warn!("{} holds the replaced files of {run}, and is removed", folder.display());
            aside.remove();
        } else {
            tracing::warn!(
                "the replacement of {run} was stopped before the new run began: the old run is brought back"
            );
            aside.put_back();
        }
    }
    Ok(())
}

/// Returns the run of a folder of leftovers; `None` for any other folder.
pub(crate) fn run_of_leftover(folder: &Path) -> Option<PathBuf> {
    let name = folder.file_name()?.to_string_lossy();
    let (run, process) = name.rsplit_once(MARK)?;
    (!run.is_empty() && process.parse::<u32>().is_ok()).then(|| folder.with_file_name(run))
}

/// Returns the folders beside a run that hold its leftovers.
fn leftovers(run: &Path) -> Vec<PathBuf> {
    let name_of = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let own = |folder: &PathBuf| run_of_leftover(folder).is_some_and(|of| name_of(&of) == name_of(run));
    let parent = run.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names = names_in(parent).unwrap_or_default();
    names.into_iter().map(|name| run.with_file_name(name)).filter(own).collect()
}

fn names_in(folder: &Path) -> Result<Vec<OsString>, SealedFileError> {
    let names = fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.file_name())).collect());
    names.map_err(io_error("list", folder))
}

/// Checks that a folder holds a run, or nothing: other content is never replaced.
///
/// # Errors
///
/// [`RunError::NotARun`].
pub fn check_replaceable(path: &Path) -> Result<(), RunError> {
    let is_known = path.join("run.json").is_file() || RunLock::is_known(path);
    if (is_known && path.join("experiment.ron").is_file()) || is_unstarted(path) {
        return Ok(());
    }
    Err(RunError::NotARun(path.into()))
}

/// Checks that a run may be made in a folder, before the long preparation of the run.
///
/// # Errors
///
/// [`RunError::Exists`] for a run unless `force`, [`RunError::NotARun`] for other content, [`RunError::File`] if an
/// unfinished replacement cannot be completed.
pub fn check_new(path: &Path, force: bool) -> Result<(), RunError> {
    end_replacement(path)?;
    if !path.exists() {
        return Ok(());
    }
    check_replaceable(path)?;
    match (force || is_free(path), is_unstarted(path)) {
        (true, _) => Ok(()),
        (false, true) => Err(RunError::NotARun(path.into())),
        (false, false) => Err(RunError::Exists(path.into())),
    }
}

/// Returns whether a folder holds at most the files written before `run.json`.
pub fn is_unstarted(path: &Path) -> bool {
    let first = |name: &str| {
        name == LOCK_FILE
            || name == COST
            || ["experiment.ron", "run.json.tmp", "cost.json.tmp"].iter().any(|known| name.starts_with(known))
    };
    names_in(path).is_ok_and(|names| names.iter().all(|name| name.to_str().is_some_and(first)))
}

/// Returns whether a run can begin in a folder without a replacement: it is empty, or an earlier run ended before it
/// began.
fn is_free(path: &Path) -> bool {
    is_unstarted(path) && (RunLock::is_known(path) || names_in(path).is_ok_and(|names| names.is_empty()))
}

/// Files and folders of a run. A folder with one of them is a run, perhaps a damaged one.
const SIGNS: [&str; 4] = ["run.json", "experiment.ron", "metrics.jsonl", "checkpoints"];

/// Largest number of existing runs named instead of a missing one.
const NAMED: usize = 3;

/// Checks that a folder is a run, perhaps a damaged one.
///
/// # Errors
///
/// [`RunError::NoRun`] with the runs that may be meant.
pub(crate) fn check_is_run(path: &Path) -> Result<(), RunError> {
    if is_run(path) {
        return Ok(());
    }
    let advice = if path.is_dir() { of_folder(path) } else { of_nothing(path) };
    Err(RunError::NoRun { path: path.into(), advice })
}

fn is_run(path: &Path) -> bool {
    SIGNS.iter().any(|sign| path.join(sign).exists()) && !is_free(path)
}

/// Returns the advice for a folder that is not a run.
fn of_folder(path: &Path) -> String {
    let inside = runs_in(path);
    let shown: Vec<_> = inside.iter().take(NAMED).map(|run| run.display().to_string()).collect();
    let more = if inside.len() > NAMED { ", …" } else { "" };
    match inside.is_empty() {
        true if is_free(path) => {
            format!(
                "the folder exists, but no training began in it; `playbot train --run {}` starts one",
                path.display()
            )
        }
        true => "the folder exists, but no training began in it; `playbot runs ls` lists runs".to_owned(),
        false => format!("it is a folder of runs: name one of them, such as {}{more}", shown.join(", ")),
    }
}

/// Returns the advice for a missing folder.
fn of_nothing(path: &Path) -> String {
    let (what, begin) = match path.exists() {
        true => ("it is a file, and a run is a folder", "FOLDER".into()),
        false => ("there is no such folder", path.to_owned()),
    };
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = runs_in(parent);
    let name_of = |run: &PathBuf| run.file_name().map(|name| name.to_string_lossy().into_owned());
    let names: Vec<String> = beside.iter().filter_map(name_of).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let wanted = path.file_name().unwrap_or_default().to_string_lossy();
    let near = nearest(&wanted, &names)
        .map_or_else(String::new, |name| format!(" (did you mean {}?)", path.with_file_name(name).display()));
    let ls = match (beside.is_empty(), parent == Path::new("runs")) {
        (true, _) => String::new(),
        (false, true) => "`playbot runs ls` lists the existing runs, and ".to_owned(),
        (false, false) => format!("`playbot runs ls {}` lists the existing runs, and ", parent.display()),
    };
    format!("{what}{near}; {ls}`playbot train --run {}` starts one", begin.display())
}

/// Returns the runs directly in a folder, by name; no runs if it cannot be listed.
fn runs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut runs: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_run(path)).collect();
    runs.sort();
    runs
}

// The ancestry of a run: the run that it began with, and those before.

/// The run that a run began with, and the runs before that one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ancestor {
    /// Its folder, as it was named then.
    pub run: PathBuf,
    /// Environment steps of the checkpoint.
    pub step: u64,
    /// Its algorithm; unknown in runs of older versions, like the values below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub algorithm: Option<Algorithm>,
    /// [Checksum](playbot_harness::sealed_file::file_checksum) of the checkpoint's learner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// Layers that were taken; none if only skills were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub taken: Vec<String>,
    /// Layers that began anew.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub anew: Vec<String>,
    /// Observed values that the other run had not.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub new_inputs: usize,
    /// The run that this one had begun with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub begun_from: Option<Box<Self>>,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

impl Ancestor {
    /// Iterates over this run and those before it, the latest first.
    pub fn chain(&self) -> impl Iterator<Item = &Self> {
        std::iter::successors(Some(self), |ancestor| ancestor.begun_from.as_deref())
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn one_sentence_says_it_of_all() {
        let bad = |step: u64| (step, damaged(Path::new("a"), &"torn").into());
        assert_eq!(passed_over(&[], 8), None);
        let words = passed_over(&[bad(16)], 8).expect("one");
        assert!(words.starts_with("the checkpoint of step 16 cannot be read (a: "), "{words}");
        assert!(words.ends_with("going on from step 8 instead"), "{words}");
        let words = passed_over(&[bad(24), bad(16)], 8).expect("two");
        assert!(words.starts_with("the checkpoints of the steps 24, 16 cannot be read (the first: a: "), "{words}");
    }

    #[test]
    fn what_was_left_is_gone_and_all_else_stays() {
        let run = tempfile::tempdir().expect("a folder");
        let file = |name: &str| {
            let path = run.path().join(name);
            fs::create_dir_all(path.parent().expect("in the run")).expect("writable");
            fs::write(&path, "half").expect("writable");
            path
        };
        let left = ["metrics.jsonl.tmp12", "checkpoints/unfinished/learner.safetensors.tmp12", "checkpoints/removed/a"];
        let kept =
            ["metrics.jsonl", "notes.tmp", "checkpoints/step-8/a", "checkpoints/damaged-step-16/a", "mine/a.tmp12"];
        let (left, kept) = (left.map(file), kept.map(file));
        tidy(&RunLock::take(run.path()).expect("free"));
        assert!(left.iter().all(|path| !path.exists()) && kept.iter().all(|path| path.exists()));
        assert!(
            !run.path().join("checkpoints/unfinished").exists() && !run.path().join("checkpoints/removed").exists()
        );
        tidy(&RunLock::take(run.path()).expect("free"));
    }

    #[test]
    fn a_folder_has_one_lock() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(!RunLock::is_taken(folder.path()));
        assert!(!RunLock::is_known(folder.path()), "who looks writes nothing");
        let lock = RunLock::take(folder.path()).expect("free");
        assert!(matches!(RunLock::take(folder.path()), Err(RunError::Busy(path)) if path == folder.path()));
        assert!(RunLock::is_taken(folder.path()));
        drop(lock);
        assert!(!RunLock::is_taken(folder.path()));
        assert!(RunLock::is_known(folder.path()));
        RunLock::take(folder.path()).expect("free again");
    }

    fn run_with(root: &Path, files: &[&str]) -> PathBuf {
        let run = root.join("a");
        for file in files {
            let path = run.join(file);
            fs::create_dir_all(path.parent().expect("in the run")).expect("writable");
            fs::write(path, "old").expect("writable");
        }
        run
    }

    fn all(root: &Path) -> Vec<String> {
        let mut names: Vec<String> = names_in(root)
            .expect("readable")
            .into_iter()
            .map(|name| name.to_string_lossy().into_owned())
            .filter(|name| name != LOCK_FILE)
            .collect();
        names.sort();
        names
    }

    const FILES: [&str; 4] = ["experiment.ron", "run.json", "metrics.jsonl", "checkpoints/step-1/summary.json"];

    #[test]
    fn a_kill_at_any_place_leaves_one_whole_run() {
        // The run is moved file by file; then the new one is written: the experiment first.
        for moved in 0..=FILES.len() {
            for is_begun in [false, true] {
                let root = tempfile::tempdir().expect("a folder");
                let run = run_with(root.path(), &FILES);
                let aside = ReplacedRun::put_aside(&run).expect("movable");
                let folder = aside.folder.clone().expect("there was something");
                assert_eq!((run_of_leftover(&folder), run_of_leftover(&run)), (Some(run.clone()), None));
                match is_begun {
                    // Killed while the old run was moved, or after the first file of the new one.
                    false => {
                        for name in names_in(&folder).expect("readable").into_iter().take(moved) {
                            fs::rename(folder.join(&name), run.join(&name)).expect("movable");
                        }
                    }
                    true => {
                        fs::write(run.join("experiment.ron"), "new").expect("writable");
                        fs::write(run.join("run.json"), "new").expect("writable");
                    }
                }
                let was_whole = run.join("run.json").is_file() && !is_begun;
                if was_whole {
                    continue;
                }
                end_replacement(&run).expect("writable");
                assert_eq!(all(root.path()), ["a"], "{moved} {is_begun}");
                let text = fs::read_to_string(run.join("experiment.ron")).expect("there");
                assert_eq!(text, if is_begun { "new" } else { "old" });
                if !is_begun {
                    assert_eq!(all(&run), ["checkpoints", "experiment.ron", "metrics.jsonl", "run.json"]);
                }
            }
        }
    }

    #[test]
    fn a_folder_where_a_run_was_to_begin_is_free_whatever_a_kill_left_in_it() {
        let root = tempfile::tempdir().expect("a folder");
        let run =
            run_with(root.path(), &["run.lock", "cost.json", "cost.json.tmp7", "experiment.ron.tmp7", "run.json.tmp7"]);
        assert!(is_free(&run) && check_replaceable(&run).is_ok());
        fs::write(run.join("notes.txt"), "mine").expect("writable");
        assert!(!is_free(&run) && check_replaceable(&run).is_err());
    }

    #[test]
    fn what_another_process_replaces_is_left_to_it() {
        let root = tempfile::tempdir().expect("a folder");
        let run = run_with(root.path(), &FILES);
        let lock = RunLock::take(&run).expect("free");
        let aside = ReplacedRun::put_aside(&run).expect("movable");
        assert!(matches!(end_replacement(&run), Err(RunError::Busy(_))));
        drop(lock);
        aside.put_back();
        assert_eq!(all(root.path()), ["a"]);
    }

    #[test]
    fn what_may_have_been_meant_is_said_and_no_file_of_ours_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("runs");
        let error = |path: &Path| check_is_run(path).expect_err("no run").to_string();
        let alone = error(&root.join("none"));
        assert!(alone.contains("there is no such folder") && !alone.contains("runs ls"), "{alone}");
        for (run, file) in [("first", "run.json"), ("second", "experiment.ron")] {
            fs::create_dir_all(root.join(run)).expect("writable");
            fs::write(root.join(run).join(file), "").expect("writable");
            assert!(check_is_run(&root.join(run)).is_ok(), "{run}");
        }
        fs::create_dir_all(root.join("empty")).expect("writable");
        fs::write(root.join("file"), "").expect("writable");
        for (path, words) in [
            (root.join("fist"), "first?"),
            (root.join("none"), "lists the existing runs"),
            (root.join("empty"), "no training began in it; `playbot train --run "),
            (root.join("file"), "it is a file"),
            (root.join("file"), "`playbot train --run FOLDER` starts one"),
            (root.clone(), "name one of them"),
        ] {
            let text = error(&path);
            assert!(text.starts_with(&format!("no run at {}", path.display())), "{text}");
            assert!(text.contains(words) && !text.contains(".ron") && !text.contains(".json"), "{text}");
        }
    }

    #[test]
    fn ancestors_of_older_versions_are_read_and_written_as_before() {
        let old = r#"{"run":"runs/a","step":512}"#;
        let ancestor: Ancestor = serde_json::from_str(old).expect("readable");
        assert_eq!(serde_json::to_string(&ancestor).expect("writable"), old);
        let child = Ancestor { run: "runs/b".into(), begun_from: Some(Box::new(ancestor.clone())), ..ancestor };
        assert_eq!(child.chain().map(|run| run.run.display().to_string()).collect::<Vec<_>>(), ["runs/b", "runs/a"]);
    }
}
