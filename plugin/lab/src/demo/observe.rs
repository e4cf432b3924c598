//! The replay of recordings whose files lack observations.

use std::{collections::BTreeMap, sync::Arc};

use playbot_learner::Observations;

use super::{
    dataset::{Demonstration, Demonstrations},
    replay_observations::{Job, ObservedEpisode, ReplayError, observe_replays},
    verify::{Replayed, VerifyError},
};
use crate::{game::Game, sensors::GameSensors};
use bevy_playbot::demo::{file::DemoEpisode, replay::Replay};

impl Demonstrations {
    /// Replays the episodes whose observations are not in a file, mode by mode, each distinct demonstration once.
    /// Returns the results by the index of the episode. `replay` says what is compared with the recordings.
    ///
    /// # Errors
    ///
    /// [`VerifyError::Diverged`] for the first episode that does not replay, or [`VerifyError::Fault`].
    pub(super) fn observe(
        &self,
        game: &dyn Game,
        threads: usize,
        originals: &[usize],
        replay: impl Fn(Arc<DemoEpisode>) -> Replay,
        progress: &(impl Fn(u64) + Sync),
    ) -> Result<BTreeMap<usize, ObservedEpisode>, VerifyError> {
        let mut by_mode: BTreeMap<&str, Vec<Job>> = BTreeMap::new();
        for (i, demo) in self.episodes.iter().enumerate() {
            if !demo.is_seen && originals[i] == i && !demo.episode.is_empty() {
                by_mode.entry(&demo.mode).or_default().push((i, replay(demo.episode.clone())));
            }
        }
        let mut all = self.nothing_to_see(game);
        for (mode, jobs) in by_mode {
            let observed = observe_replays(game, &self.observation_config, mode, jobs, threads, progress);
            for observed in observed.map_err(|error| self.explained(error))? {
                if let Some(divergence) = observed.divergence {
                    let Demonstration { file, index, .. } = &self.episodes[observed.id];
                    return Err(VerifyError::Diverged { path: file.to_path_buf(), episode: *index, divergence });
                }
                all.insert(observed.id, observed);
            }
        }
        Ok(all)
    }

    /// Returns an error with the files of the episodes that were played.
    fn explained(&self, error: ReplayError) -> VerifyError {
        let place = |id: usize| (self.episodes[id].file.to_path_buf(), self.episodes[id].index);
        match error {
            ReplayError::Vision(error) => error.into(),
            ReplayError::Fault { ids, fault } => {
                VerifyError::Fault { replayed: Replayed::new(ids.into_iter().map(place)), fault }
            }
        }
    }

    /// Returns empty results for the episodes that were left before their first tick.
    fn nothing_to_see(&self, game: &dyn Game) -> BTreeMap<usize, ObservedEpisode> {
        let kind = self.observation_config.obs_kind(game);
        let empty = self.episodes.iter().enumerate().filter(|(_, demo)| demo.episode.is_empty());
        let nothing = |id| ObservedEpisode {
            id,
            observations: Observations::empty(&kind),
            rewards: Vec::new(),
            divergence: None,
        };
        empty.map(|(id, _)| (id, nothing(id))).collect()
    }
}
