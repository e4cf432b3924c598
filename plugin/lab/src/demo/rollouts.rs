//! Rollouts for algorithms that learn from recordings beside their own play.

use bevy_playbot::demo::{
    file::{DemoEnd, DemoEpisode},
    replay::Replay,
};
use playbot_learner::{ActionSpace, Actions, LearnError, ObsKind, Rollout};

use super::{
    dataset::{Demonstrations, learner_actions},
    replay_observations::ObservedEpisode,
    verify::VerifyError,
};
use crate::{game::Game, sensors::GameSensors};

impl Demonstrations {
    /// Returns the episodes with their rewards, as rollouts of one environment each. Every episode is replayed, and its
    /// rewards are those of the current game. Recordings with no rewards or older ones serve as well, if the game still
    /// reaches the recorded states. The last step of an episode that the rules did not end is left out, since its
    /// outcome was not recorded.
    ///
    /// # Errors
    ///
    /// [`VerifyError`] if an episode does not replay, since its rewards are then unknown.
    pub fn rollouts(
        mut self,
        game: &dyn Game,
        threads: usize,
        progress: impl Fn(u64) + Sync,
    ) -> Result<Vec<Rollout>, VerifyError> {
        self.episodes.iter_mut().for_each(|demo| demo.is_seen = false);
        let originals = self.originals();
        let observed =
            self.observe(game, threads, &originals, |episode| Replay::new(episode).paid_anew(), &progress)?;
        let kind = self.observation_config.obs_kind(game);
        let mut rollouts = Vec::new();
        for (demo, original) in self.episodes.iter().zip(originals) {
            if let Some(observed) = observed.get(&original) {
                rollouts.extend(rollout(&demo.episode, observed, &kind, &game.actions())?);
            }
        }
        Ok(rollouts)
    }
}

/// Returns the steps of an episode with a known outcome, if there are any.
fn rollout(
    episode: &DemoEpisode,
    ObservedEpisode { observations, rewards, .. }: &ObservedEpisode,
    kind: &ObsKind,
    space: &ActionSpace,
) -> Result<Option<Rollout>, LearnError> {
    let is_terminated = matches!(episode.end, DemoEnd::Terminated { .. });
    let steps = episode.len().saturating_sub(usize::from(!is_terminated));
    if steps == 0 {
        return Ok(None);
    }
    let (width, mut actions) = (kind.numbers(), Actions::empty(space));
    actions.extend_rows(&learner_actions(episode), 0, steps)?;
    let mut rollout = Rollout { steps, actions, ..Rollout::new(1, *kind, 0, space) };
    rollout.obs.push(observations.rows(0..steps, width))?;
    rollout.rewards = rewards[..steps].to_vec();
    (rollout.log_probs, rollout.values, rollout.final_values) = (vec![0.0; steps], vec![0.0; steps], vec![0.0; steps]);
    (rollout.terminated, rollout.truncated) = (vec![false; steps], vec![false; steps]);
    rollout.terminated[steps - 1] = is_terminated;
    rollout.next_values = vec![0.0];
    rollout.ends.next_obs.push(observations.row(episode.len() - 1, width))?;
    Ok(Some(rollout))
}
