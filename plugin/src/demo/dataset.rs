//! Turning recordings into what the skill model learns from.

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use playbot_learner::{Actions, Dataset, DemoEpisode as LearnerEpisode};

use super::{
    file::{DemoEpisode, DemoReader, EpisodeActions, find_demos},
    replay::Divergence,
    verify::{ReplayStage, VerifyError},
};
use crate::{
    game::{Game, check_mode},
    observation::Observation,
    split::LevelSplit,
};

/// Reads all recordings of a game below a path and pairs each action with the observation that preceded it.
///
/// Observations that a recording keeps are used as they are; otherwise the episode is replayed through the game's
/// sensor, so that a recording survives a change of sensors. `progress` hears the number of steps done. The files may
/// differ in mode; the observation must not depend on it. None may show a level of `held_out`, if there is such a split:
/// what is measured there would be no generalisation.
///
/// # Errors
///
/// [`VerifyError`] for files that cannot be read, belong to another game or version, or show a held-out level.
pub fn load_dataset(
    game: &dyn Game,
    path: &Path,
    held_out: Option<&LevelSplit>,
    mut progress: impl FnMut(u64),
) -> Result<Dataset, VerifyError> {
    let names = game.observation().names;
    let mut episodes = Vec::new();
    let mut steps = 0;
    for file in find_demos(path)? {
        let reader = DemoReader::open_for_game(&file, game.name(), game.version(), None)?;
        let header = reader.header().clone();
        check_mode(game, &header.mode).map_err(|source| VerifyError::Mode { path: file.clone(), source })?;
        let mut stage = ReplayStage::new(game, &header.mode);
        for (index, episode) in reader.enumerate() {
            let episode = Arc::new(episode?);
            let level = episode.level_seed;
            if let Some(split) = held_out.filter(|split| split.contains(&header.mode, level)) {
                return Err(VerifyError::HeldOut { path: file, level, split: split.clone() });
            }
            let observations = if header.observation_names == names {
                episode.observations.clone()
            } else {
                let (observations, divergence) = observe_again(&mut stage, &episode)?;
                if let Some(divergence) = divergence {
                    return Err(VerifyError::Diverged { path: file, episode: index, divergence });
                }
                observations
            };
            steps += episode.len() as u64;
            episodes.push(LearnerEpisode { observations: observations.into(), actions: learner_actions(&episode) });
            progress(steps);
        }
    }
    Ok(Dataset::new(names.len(), game.actions(), episodes)?)
}

/// Replays an episode and collects the observation before each action, `[steps, names]`.
fn observe_again(
    stage: &mut ReplayStage,
    episode: &Arc<DemoEpisode>,
) -> Result<(Vec<f32>, Option<Divergence>), VerifyError> {
    let mut observations = Vec::new();
    // The observation an agent carries after a tick is still the one it acted on.
    let divergence = stage.play(episode.clone(), |world: &World, agent| {
        if let Some(observation) = world.get::<Observation>(agent) {
            observations.extend_from_slice(&observation.vector);
        }
    })?;
    Ok((observations, divergence))
}

fn learner_actions(episode: &DemoEpisode) -> Actions {
    match &episode.actions {
        EpisodeActions::Discrete(list) => Actions::Discrete(list.clone()),
        EpisodeActions::Continuous { dim, values } => Actions::Continuous { dim: *dim, values: values.clone() },
    }
}
