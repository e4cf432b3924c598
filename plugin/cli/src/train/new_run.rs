//! The folder of a new run.

use std::path::Path;

use playbot_lab::{
    game::Game,
    held_out::seen_by_training,
    train::{
        Experiment,
        checksum::file_checksum,
        run_dir::{RunDir, RunError, RunInfo},
    },
};
use playbot_learner::{DeviceKind, SeenLevels, SkillModel};

/// What a run learns from besides playing.
pub struct Source<'a> {
    /// The file of the skill model, if there is one.
    skills: Option<&'a Path>,
    /// The levels of the recordings that the skills were learned from, or that are trained on.
    seen: Option<SeenLevels>,
}

impl<'a> Source<'a> {
    /// A skill model and its file, if there is one, else what the recordings show that are trained on.
    pub fn new(file: Option<&'a Path>, skills: Option<&SkillModel>, recorded: Option<SeenLevels>) -> Self {
        Self { skills: file, seen: skills.and_then(SkillModel::demos).cloned().or(recorded) }
    }
}

/// Makes the folder of a run, which says what file its skills are from.
///
/// # Errors
///
/// It exists and `force` is off, it is in use or no run, or it cannot be written.
pub fn create_run(
    path: &Path,
    game: &dyn Game,
    experiment: &Experiment,
    source: &Source,
    device: DeviceKind,
    force: bool,
) -> Result<RunDir, RunError> {
    let info = run_info(game, experiment, source, device)?;
    RunDir::create(path, &experiment.without_study(), &info, force)
}

/// What the folder of a run says of it.
///
/// # Errors
///
/// The skill model's file cannot be read.
pub fn run_info(
    game: &dyn Game,
    experiment: &Experiment,
    source: &Source,
    device: DeviceKind,
) -> Result<RunInfo, RunError> {
    let skills = source.skills.filter(|_| experiment.algorithm.needs_skills());
    let mut seen = experiment.algorithm.is_trained().then(|| seen_by_training(game, &experiment.train));
    if let Some(recorded) = &source.seen {
        seen.get_or_insert_with(|| recorded.clone()).extend(recorded);
    }
    Ok(RunInfo {
        algorithm: experiment.algorithm,
        seed: experiment.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        revision: env!("PLAYBOT_REVISION").to_owned(),
        game_version: game.version(),
        skills: skills.map(file_checksum).transpose()?,
        seen,
        device,
    })
}
