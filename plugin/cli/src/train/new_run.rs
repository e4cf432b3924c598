//! The folder of a new run.

use std::path::Path;

use playbot_lab::{
    game::Game,
    train::{
        Experiment,
        checksum::file_checksum,
        run_dir::{RunDir, RunError, RunInfo},
    },
};
use playbot_learner::DeviceKind;

/// Makes the folder of a run, which says what file its skills are from.
///
/// # Errors
///
/// It exists and `force` is off, it is in use or no run, or it cannot be written.
pub fn create_run(
    path: &Path,
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&Path>,
    device: DeviceKind,
    force: bool,
) -> Result<RunDir, RunError> {
    let info = run_info(game, experiment, skills, device)?;
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
    skills: Option<&Path>,
    device: DeviceKind,
) -> Result<RunInfo, RunError> {
    let skills = skills.filter(|_| experiment.algorithm.needs_skills());
    Ok(RunInfo {
        algorithm: experiment.algorithm,
        seed: experiment.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        revision: env!("PLAYBOT_REVISION").to_owned(),
        game_version: game.version(),
        skills: skills.map(file_checksum).transpose()?,
        device,
    })
}
