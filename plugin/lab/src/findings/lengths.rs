//! The lengths of findings, before and after minimisation.

use bevy_playbot::{action::ActionValue, vision::ObservationConfig};

use super::{
    actions::efforts,
    checks::Checks,
    head::FindingHead,
    minimise::{Budget, minimise},
    play::play_player,
    solo::Setting,
    stored::StoredFinding,
};
use crate::{eval::Player, game::Game, idle::idle_action};

/// Lengths of a finding, in actions with an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lengths {
    /// The whole episode.
    pub played: u32,
    /// Up to the finding.
    pub original: u32,
    /// After minimisation.
    pub minimised: u32,
}

/// Minimises the finding of this head in these actions. `None` if it does not happen again, needs no play, or has no
/// check.
pub(crate) fn lengths(
    game: &dyn Game,
    (mode, level): (&str, u64),
    head: FindingHead,
    actions: &[ActionValue],
    checks: &Checks,
    budget: Budget,
    stop: &dyn Fn() -> bool,
) -> Option<Lengths> {
    if !checks.of(&head.detector)?.needs_play() {
        return None;
    }
    let found = StoredFinding::of_actions(game, mode, level, head, actions, checks)?;
    let shorter = minimise(game, &found, checks, budget, &|_| {}, stop).ok()?;
    let [original, minimised] = shorter.efforts;
    Some(Lengths { played: efforts(actions, &idle_action(game)), original, minimised })
}

/// Returns a player's actions in the episode with this seed; `None` if its observation cannot be drawn.
pub(crate) fn actions_of(
    game: &dyn Game,
    (mode, level): (&str, u64),
    seed: u64,
    player: &Player,
    observation_config: &ObservationConfig,
) -> Option<Vec<ActionValue>> {
    let setting = Setting { game, mode, level, seed };
    play_player(setting, player, observation_config).ok().map(|(actions, _)| actions)
}
