//! Export of a trained policy as the one file that a game ships with.

use crate::collect::Collector;
use bevy_playbot::{
    engine::policy_observation,
    fault::Fault,
    skill_prior::SkillPrior,
    vision::{ObservationConfig, UnknownObservation, VisionError},
};
use playbot_harness::{game::Game, split::LevelSplit, worlds::at_most};
use playbot_learner::{
    FileError, HasExitCode, Observations, Policy, PolicyFile, PolicyMetadata, SeenLevels, SkillSource,
};
use std::path::Path;
use thiserror::Error;

/// Arenas of the short play from which a file's examples are taken.
const EXAMPLE_ARENAS: usize = 4;

const EXAMPLE_TICKS: usize = 32;

/// Distance of the rows that become examples.
const EXAMPLE_STRIDE: usize = 9;

/// Failure to export a policy.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The game broke its contract while the examples were played.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The file's metadata does not name the policy's observations.
    #[error(transparent)]
    ObservationConfig(#[from] UnknownObservation),
    /// Pictures cannot be made.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl HasExitCode for ExportError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) => 2,
            Self::File(error) => error.exit_code(),
            Self::ObservationConfig(_) | Self::Vision(_) => 3,
        }
    }
}

/// Origin of a policy.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Name of the algorithm.
    pub algorithm: String,
    /// Training levels and length, as text.
    pub training: String,
    /// The levels that it has seen, if known.
    pub seen: Option<SeenLevels>,
    /// Name, version and, if known, revision of the program that trained it.
    pub code: String,
}

/// Returns a policy for this game and these observations, with the metadata filled in from both.
pub fn policy_file(
    game: &dyn Game,
    observation_config: &ObservationConfig,
    policy: Policy,
    skills: Option<SkillSource>,
    provenance: Provenance,
) -> PolicyFile {
    let metadata = policy_metadata(game, observation_config, provenance);
    PolicyFile { metadata, policy, skills }
}

/// Returns the metadata of a policy for this game and these observations.
pub fn policy_metadata(
    game: &dyn Game,
    observation_config: &ObservationConfig,
    provenance: Provenance,
) -> PolicyMetadata {
    let Provenance { algorithm, training, seen, code } = provenance;
    PolicyMetadata {
        game: game.name().to_owned(),
        game_version: game.version(),
        observations: if observation_config.is_image() { Vec::new() } else { game.observation().names },
        picture: observation_config.picture_metadata(),
        actions: game.tools().input.action_names(),
        algorithm,
        training,
        seen,
        code,
    }
}

/// Writes a policy file. Its examples come from a short play on `levels`.
///
/// # Errors
///
/// [`ExportError`].
pub fn export_policy(
    game: &dyn Game,
    file: &PolicyFile,
    levels: &LevelSplit,
    seed: u64,
    path: &Path,
) -> Result<(), ExportError> {
    let ExampleStates { obs, skills, count } = example_states(game, file, levels, seed, None)?;
    Ok(file.save(path, &obs, &skills, count)?)
}

/// Observations out of a short play, with the skills that were active.
#[derive(Clone, Debug, PartialEq)]
pub struct ExampleStates {
    /// `count` observations.
    pub obs: Observations,
    /// `count` times the width of a skill.
    pub skills: Vec<f32>,
    /// Number of observations.
    pub count: usize,
}

/// Plays `levels` with a policy for a short time and returns `wanted` of the observations, or a few.
///
/// # Errors
///
/// [`ExportError`].
pub fn example_states(
    game: &dyn Game,
    file: &PolicyFile,
    levels: &LevelSplit,
    seed: u64,
    wanted: Option<usize>,
) -> Result<ExampleStates, ExportError> {
    let prior = file.skills.as_ref().map(SkillPrior::from);
    let latent = file.policy.latent();
    let arenas = at_most(game, EXAMPLE_ARENAS);
    let ticks = match wanted {
        None => EXAMPLE_TICKS * EXAMPLE_ARENAS / arenas,
        Some(wanted) => wanted.saturating_mul(EXAMPLE_STRIDE).div_ceil(arenas),
    };
    let mut collector = Collector::new(game, levels, &policy_observation(file)?, seed, 0, arenas as u32, prior)?;
    let (rollout, _) = collector.collect(&file.policy, latent, ticks)?;
    let (mut obs, mut skills) = (Observations::empty(&rollout.obs_kind), Vec::new());
    let rows = (0..rollout.rows()).step_by(EXAMPLE_STRIDE).take(wanted.unwrap_or(usize::MAX));
    let count = rows.len();
    for row in rows {
        obs.push(rollout.obs.row(row, rollout.obs_kind.numbers())).map_err(|error| Fault(error.to_string()))?;
        skills.extend_from_slice(&rollout.z[row * latent..(row + 1) * latent]);
    }
    Ok(ExampleStates { obs, skills, count })
}
