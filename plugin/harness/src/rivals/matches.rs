//! Matches of a player with a rival, on all seats, with the result of each.
//!
//! A match is one episode. Its random draws depend on the plan's seed, the level and the seat alone, so that matches may
//! be played on any number of threads.

use crate::{
    eval::{EpisodeResult, EvalError, Player},
    game::Game,
    parallel::on_threads,
    randomise::Randomise,
    rivals::{Opposed, RivalError},
    worlds::build_world,
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    engine::{EpisodeSeeds, Renewal, tick_world},
    episode::{EpisodeEnd, EpisodeEnded},
    level::LevelQueue,
    state_hash::StateHash,
};
use playbot_learner::HasExitCode;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The result of a match for one side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MatchOutcome {
    /// The player's side won.
    Win,
    /// Neither side won.
    Draw,
    /// A rival won.
    Loss,
}

impl MatchOutcome {
    /// Returns the points of a match: 1 for a win, half a point for a draw.
    pub fn points(self) -> f64 {
        match self {
            Self::Win => 1.0,
            Self::Draw => 0.5,
            Self::Loss => 0.0,
        }
    }

    /// Returns the result of an episode that has ended for a player and for its rivals. It is won if the player reached
    /// the goal and no rival did. It is lost if a rival did and the player did not, or if the game ended as lost for the
    /// player alone. Everything else is a draw: time was up, or both sides won or lost.
    pub fn of<'a>(own: &EpisodeResult, rivals: impl IntoIterator<Item = &'a EpisodeResult>) -> Self {
        let (mut beaten, mut lost_too) = (false, false);
        for rival in rivals {
            beaten |= rival.success;
            lost_too |= !rival.success && rival.end == EpisodeEnd::LOST;
        }
        let is_lost = own.end == EpisodeEnd::LOST && !own.success;
        match (own.success, beaten) {
            (true, false) => Self::Win,
            (true, true) => Self::Draw,
            (false, true) => Self::Loss,
            (false, false) if is_lost && !lost_too => Self::Loss,
            (false, false) => Self::Draw,
        }
    }
}

/// The matches to play.
#[derive(Clone, Debug)]
pub struct MatchPlan {
    /// Mode of the levels.
    pub mode: String,
    /// Levels, each played once on each seat.
    pub levels: Vec<u64>,
    /// Seats of the player, as places in [`seats`](crate::game::HostTools::seats); all if it is empty.
    pub seats: Vec<usize>,
    /// Random seed of the player's draws.
    pub seed: u64,
    /// Threads. They change no result.
    pub threads: usize,
    /// Values of the game that each level draws anew.
    pub randomise: Randomise,
}

/// A match that was played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The seat of the player.
    pub seat: usize,
    /// Its result for the player.
    pub outcome: MatchOutcome,
    /// The player's episode.
    pub episode: EpisodeResult,
}

/// The reason why matches cannot be played.
#[derive(Debug, Error)]
pub enum MatchError {
    /// Game and rival do not fit one another.
    #[error(transparent)]
    Rival(#[from] RivalError),
    /// The game broke its contract.
    #[error(transparent)]
    Play(#[from] EvalError),
}

impl HasExitCode for MatchError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Rival(error) => error.exit_code(),
            Self::Play(error) => error.exit_code(),
        }
    }
}

/// Plays the matches of a plan, and returns them by level and seat. `progress` receives the number of matches that have
/// ended, from several threads. Agents of the player's own team are played by the same player.
///
/// # Errors
///
/// [`MatchError`]: the game has no rivals, or broke its contract.
pub fn play_matches(
    game: &dyn Game,
    player: &Player,
    rival: &Player,
    plan: &MatchPlan,
    progress: impl Fn(u64) + Sync,
) -> Result<Vec<Match>, MatchError> {
    let host = game.tools().host;
    let seats: Vec<usize> = if plan.seats.is_empty() { (0..host.seats().len()).collect() } else { plan.seats.clone() };
    let worlds = plan.threads.max(1).div_ceil(seats.len().max(1));
    let share = plan.levels.len().div_ceil(worlds).max(1);
    let mut work = Vec::new();
    for &seat in &seats {
        let opposed = Opposed::new(game, seat)?.against(rival.clone(), player.clone());
        work.extend(plan.levels.chunks(share).map(|levels| (opposed.clone(), levels)));
    }
    let parts = on_threads(&mut work, plan.threads.max(1), |(opposed, levels)| {
        play_in_one_world(opposed, player, plan, levels, &progress)
    });
    let mut all = Vec::new();
    for part in parts {
        all.extend(part?);
    }
    all.sort_by_key(|played: &Match| (played.episode.level, played.seat));
    Ok(all)
}

/// Plays some levels of a plan on one seat.
fn play_in_one_world(
    opposed: &Opposed,
    player: &Player,
    plan: &MatchPlan,
    levels: &[u64],
    progress: &(impl Fn(u64) + Sync),
) -> Result<Vec<Match>, EvalError> {
    if let Some(problem) = opposed.problem() {
        return Err(bevy_playbot::fault::Fault(problem).into());
    }
    let (mut world, agents) = build_world(opposed, &plan.mode, plan.seed, 0, 1);
    MatchEnds::note_in(&mut world);
    plan.randomise.install(&mut world);
    let seed_of = |level: u64| StateHash::of([plan.seed, level, opposed.seat() as u64]).0;
    let seeds: Vec<u64> = levels.iter().map(|&level| seed_of(level)).collect();
    let agent = agents[0];
    world.entity_mut(agent).insert((LevelQueue::list(levels.to_vec()), EpisodeSeeds::new(seeds)));
    let control = player.seat(opposed, &mut world, agent);
    world.entity_mut(agent).insert(control);
    player.install(&mut world);
    let mut played = Vec::new();
    while Control::of(&world, agent).is_active() {
        tick_world(&mut world)?;
        if let Some((outcome, episode)) = MatchEnds::take(&mut world, opposed, agent) {
            played.push(Match { seat: opposed.seat(), outcome, episode });
            progress(1);
        }
    }
    Ok(played)
}

/// The ends of the last tick's episodes, of all agents of a World, those that play along included. The list outlives
/// Worlds that are rebuilt.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub struct MatchEnds(Vec<(Entity, EpisodeResult)>);

impl MatchEnds {
    /// Makes the World collect them from now on.
    pub fn note_in(world: &mut World) {
        Renewal::set_up(world, |world| {
            world.init_resource::<Self>();
            world.add_observer(|event: On<EpisodeEnded>, mut ends: ResMut<Self>| {
                ends.0.push((event.entity, event.result));
            });
        });
        Renewal::carry_resource::<Self>(world);
    }

    /// Returns the result of the match that ended in the last tick for this agent, if one did, and empties the list.
    pub fn take(world: &mut World, opposed: &Opposed, agent: Entity) -> Option<(MatchOutcome, EpisodeResult)> {
        let mut ends = world.get_resource_mut::<Self>().filter(|ends| !ends.0.is_empty())?;
        let ended = std::mem::take(&mut ends.0);
        let own = ended.iter().find(|(entity, _)| *entity == agent).map(|(_, result)| *result)?;
        let others = opposed.others(world);
        let is_rival = |entity: Entity| others.iter().any(|(other, is_mate)| *other == entity && !is_mate);
        let rivals = ended.iter().filter(|(entity, _)| is_rival(*entity)).map(|(_, result)| result);
        Some((MatchOutcome::of(&own, rivals), own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(end: EpisodeEnd) -> EpisodeResult {
        EpisodeResult { level: 0, end, success: end.is_success(), ticks: 9, clipped: 0, total_reward: 0.0 }
    }

    #[test]
    fn a_match_is_won_drawn_or_lost_by_the_ends_of_both_sides() {
        let (won, lost, truncated) = (EpisodeEnd::WON, EpisodeEnd::LOST, EpisodeEnd::Truncated);
        for (own, rivals, expected) in [
            (won, vec![lost], MatchOutcome::Win),
            (won, vec![truncated], MatchOutcome::Win),
            (lost, vec![won], MatchOutcome::Loss),
            (truncated, vec![won], MatchOutcome::Loss),
            // A game that has no end of its own for the rival.
            (lost, vec![truncated], MatchOutcome::Loss),
            (truncated, vec![truncated], MatchOutcome::Draw),
            (lost, vec![lost], MatchOutcome::Draw),
            (won, vec![won], MatchOutcome::Draw),
            // One of two rivals is out of the game, and the other one has won.
            (lost, vec![lost, won], MatchOutcome::Loss),
        ] {
            let rivals: Vec<EpisodeResult> = rivals.into_iter().map(result).collect();
            assert_eq!(MatchOutcome::of(&result(own), &rivals), expected, "{own:?} against {rivals:?}");
        }
    }

    #[test]
    fn a_goal_that_was_reached_before_time_was_up_is_a_win() {
        let reached = EpisodeResult { success: true, ..result(EpisodeEnd::Truncated) };
        assert_eq!(MatchOutcome::of(&reached, &[result(EpisodeEnd::Truncated)]), MatchOutcome::Win);
        assert_eq!(MatchOutcome::of(&result(EpisodeEnd::Truncated), &[reached]), MatchOutcome::Loss);
    }
}
