//! The rivals of one arena of a training, episode by episode.

use bevy::prelude::*;
use bevy_playbot::episode::Episode;
use playbot_harness::{
    eval::Player,
    rivals::{
        Opposed,
        matches::{MatchEnds, MatchOutcome},
    },
};
use playbot_learner::{Streams, rng::unit};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Bits of the number of an episode, in the number of its random stream. Those above are of the arena.
const EPISODE_BITS: u32 = 40;

/// The rivals that are drawn, each with its number on the ladder.
#[derive(Clone)]
pub(crate) struct RivalPool {
    pub(crate) seed: u64,
    /// Probability of the newest snapshot.
    pub(crate) latest: f64,
    pub(crate) newest: (usize, Player),
    /// All of them: bots, then snapshots.
    pub(crate) all: Vec<(usize, Player)>,
}

impl RivalPool {
    /// Returns the rival of an episode of an arena: a function of its numbers and the seed.
    fn draw(&self, arena: u64, episode: u64) -> &(usize, Player) {
        let mut stream = Streams::new(self.seed).stream("rival", (arena << EPISODE_BITS) ^ episode);
        let (is_latest, place) = (unit(&mut stream) < self.latest, unit(&mut stream));
        let drawn = self.all.get((place * self.all.len() as f64) as usize).filter(|_| !is_latest);
        drawn.unwrap_or(&self.newest)
    }
}

/// What decides the rivals of an arena.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ArenaRivals {
    /// Episodes that have begun.
    episodes: u64,
    /// Numbers of the rival and of the mate of the last one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    playing: Option<[usize; 2]>,
}

impl ArenaRivals {
    /// Returns whether the last episode was begun with the player of this number.
    pub(crate) fn needs(&self, number: usize) -> bool {
        self.playing.is_some_and(|playing| playing.contains(&number))
    }
}

/// The rivals of the arena of one World, in which one agent learns.
pub(crate) struct RivalSeats {
    game: Arc<Opposed>,
    arena: u64,
    pool: Option<Arc<RivalPool>>,
    state: ArenaRivals,
    outcomes: Vec<MatchOutcome>,
}

impl RivalSeats {
    pub(crate) fn new(game: Arc<Opposed>, arena: u64) -> Self {
        Self { game, arena, pool: None, state: ArenaRivals::default(), outcomes: Vec::new() }
    }

    /// Lets the next episodes have rivals of this pool.
    pub(crate) fn set_pool(&mut self, pool: &Arc<RivalPool>) {
        self.pool = Some(pool.clone());
    }

    pub(crate) fn state(&self) -> ArenaRivals {
        self.state
    }

    /// Goes on with the count of episodes of another World of the same arena.
    pub(crate) fn set_state(&mut self, state: ArenaRivals) {
        self.state = state;
    }

    /// Seats the rivals of the next episode, if it begins in the next tick for this agent.
    pub(crate) fn before_tick(&mut self, world: &mut World, agent: Entity) {
        let is_playing = |episode: &Episode| episode.is_running() || episode.is_loading();
        let Some(pool) = &self.pool else { return };
        if world.get::<Episode>(agent).is_some_and(is_playing) {
            return;
        }
        let (rival, player) = pool.draw(self.arena, self.state.episodes);
        let (mate, of_team) = &pool.newest;
        self.game.seat_others(world, player, of_team);
        self.state = ArenaRivals { episodes: self.state.episodes + 1, playing: Some([*rival, *mate]) };
    }

    /// Notes the result of the agent's episode, if it ended in the last tick.
    pub(crate) fn after_tick(&mut self, world: &mut World, agent: Entity) {
        self.outcomes.extend(MatchEnds::take(world, &self.game, agent).map(|(outcome, _)| outcome));
    }

    /// Returns the results of the episodes that have ended since the last call, in order.
    pub(crate) fn take_outcomes(&mut self) -> Vec<MatchOutcome> {
        std::mem::take(&mut self.outcomes)
    }

    /// Seats the rivals of an episode in whose middle a checkpoint was saved, before it is replayed. `find` returns the
    /// player of a number.
    pub(crate) fn restore(
        &mut self,
        world: &mut World,
        state: ArenaRivals,
        find: impl Fn(usize) -> Option<Player>,
    ) -> Result<(), usize> {
        self.state = state;
        if let Some([rival, mate]) = state.playing {
            let rival = find(rival).ok_or(rival)?;
            let mate = find(mate).ok_or(mate)?;
            self.game.seat_others(world, &rival, &mate);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_playbot::bot::BlindBot;

    fn pool(latest: f64) -> RivalPool {
        let player = || Player::Blind(BlindBot::Uniform);
        RivalPool { seed: 7, latest, newest: (4, player()), all: (0..5).map(|number| (number, player())).collect() }
    }

    fn shares(latest: f64) -> Vec<f64> {
        let pool = pool(latest);
        let mut counts = [0.0; 5];
        (0..4000).for_each(|episode| counts[pool.draw(episode % 4, episode / 4).0] += 1.0 / 4000.0);
        counts.to_vec()
    }

    #[test]
    fn the_newest_snapshot_has_its_probability_and_all_rivals_share_the_rest() {
        // Half of the episodes, and a fifth of the others.
        for (share, expected) in shares(0.5).iter().zip([0.1, 0.1, 0.1, 0.1, 0.6]) {
            assert!((share - expected).abs() < 0.03, "{share} instead of {expected}");
        }
        assert!(shares(0.0).iter().all(|share| (share - 0.2).abs() < 0.03));
        assert_eq!(shares(1.0), [0.0, 0.0, 0.0, 0.0, shares(1.0)[4]]);
    }

    #[test]
    fn a_draw_depends_on_arena_and_episode_alone() {
        let drawn = |arena| (0..50).map(|episode| pool(0.0).draw(arena, episode).0).collect::<Vec<_>>();
        assert_eq!(drawn(3), drawn(3));
        assert_ne!(drawn(3), drawn(4));
    }
}
