//! A CoinRun episode without an engine: fast, exact and cheap to copy.

use crate::coinrun::{
    level::Level,
    rules::{
        ACTIONS, Body, COIN_REWARD, CoinRunEnd, PlayerState, begin_step, hash_state, motion::touch, move_player, patrol,
    },
};
use std::sync::Arc;

/// The result of one step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StepResult {
    /// 10 in the step that reaches the coin, otherwise 0.
    pub reward: f32,
    /// The end of the episode, once it has ended.
    pub end: Option<CoinRunEnd>,
}

/// The state of one episode.
#[derive(Clone, Debug)]
pub struct Sim {
    level: Arc<Level>,
    player: Body,
    state: PlayerState,
    enemies: Vec<Body>,
    steps: u32,
    end: Option<CoinRunEnd>,
}

impl Sim {
    /// Returns the start of an episode.
    pub fn new(level: Arc<Level>) -> Self {
        let enemies = level.enemies();
        Self { level, player: Body::player(), state: PlayerState::default(), enemies, steps: 0, end: None }
    }

    /// Continues an episode from the given state: the player, its memory, the enemies in creation order, and the number
    /// of steps already made.
    pub fn resume(level: Arc<Level>, player: Body, state: PlayerState, enemies: Vec<Body>, steps: u32) -> Self {
        Self { level, player, state, enemies, steps, end: None }
    }

    /// Makes one step with `action` (0 to 14; larger numbers do nothing, like 4). After the end of
    /// the episode nothing moves any more and the reward is 0.
    #[inline]
    pub fn step(&mut self, action: u8) -> StepResult {
        if self.end.is_some() {
            return StepResult { reward: 0.0, end: self.end };
        }
        let x_wins_tie = self.level.x_wins_tie(self.steps);
        self.steps += 1;
        self.advance(action, x_wins_tie);
        let saws = self.level.saws_near(self.player.x);
        self.end = touch(&self.player, &self.level.tiles, saws, &self.enemies, self.steps);
        let won = self.end == Some(CoinRunEnd::Coin);
        StepResult { reward: if won { COIN_REWARD } else { 0.0 }, end: self.end }
    }

    fn advance(&mut self, action: u8, x_wins_tie: bool) {
        let (level, player) = (&*self.level, &mut self.player);
        let action = if action < ACTIONS { action } else { 4 };
        let step = begin_step(player, &mut self.state, &level.tiles, action);
        for enemy in &mut self.enemies {
            let crates = level.crates_near(enemy.x);
            patrol(enemy, &mut self.state, &step, &level.tiles, crates);
        }
        let crates = level.crates_near(player.x);
        move_player(player, &mut self.state, &level.tiles, crates, &step, x_wins_tie);
    }

    /// Returns the level.
    pub fn level(&self) -> &Arc<Level> {
        &self.level
    }

    /// Returns the player's body.
    pub fn player(&self) -> &Body {
        &self.player
    }

    /// Returns the player's memory from step to step.
    pub fn player_state(&self) -> PlayerState {
        self.state
    }

    /// Returns the enemies in creation order.
    pub fn enemies(&self) -> &[Body] {
        &self.enemies
    }

    /// Returns the player's centre, tiles from the left.
    pub fn x(&self) -> f32 {
        self.player.x
    }

    /// Returns the player's centre, tiles from the bottom.
    pub fn y(&self) -> f32 {
        self.player.y
    }

    /// Returns the player's horizontal velocity, tiles per step.
    pub fn vx(&self) -> f32 {
        self.player.vx
    }

    /// Returns the player's vertical velocity, tiles per step, upwards.
    pub fn vy(&self) -> f32 {
        self.player.vy
    }

    /// Returns the number of steps made so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Returns the end of the episode, once it has ended.
    pub fn end(&self) -> Option<CoinRunEnd> {
        self.end
    }

    /// Returns a fingerprint of the state; see [`hash_state`].
    pub fn state_hash(&self) -> u64 {
        hash_state(&self.player, &self.enemies, self.steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::generator::generate;
    use crate::coinrun::level::Mode;

    #[test]
    fn steps_after_the_end_change_nothing() {
        let mut sim = Sim::new(Arc::new(generate(Mode::Hard, 0)));
        while sim.end().is_none() {
            sim.step(8);
        }
        assert_eq!((sim.end(), sim.steps()), (Some(CoinRunEnd::Coin), 63));
        let hash = sim.state_hash();
        let after = sim.step(8);
        assert_eq!((after.reward, after.end), (0.0, Some(CoinRunEnd::Coin)));
        assert_eq!(sim.state_hash(), hash);
    }

    #[test]
    fn a_resumed_episode_continues_the_same() {
        let mut sim = Sim::new(Arc::new(generate(Mode::Hard, 1)));
        for step in 0..40 {
            sim.step(if step % 7 == 0 { 1 } else { 8 });
        }
        let (player, state) = (*sim.player(), sim.player_state());
        let enemies = sim.enemies().to_vec();
        let mut copy = Sim::resume(sim.level().clone(), player, state, enemies, sim.steps());
        for _ in 0..30 {
            assert_eq!(sim.step(7), copy.step(7));
            assert_eq!(sim.state_hash(), copy.state_hash());
        }
    }

    #[test]
    fn the_clock_runs_out() {
        let mut sim = Sim::new(Arc::new(generate(Mode::Hard, 20)));
        for _ in 0..999 {
            assert_eq!(sim.step(4).end, None);
        }
        assert_eq!(sim.step(4).end, Some(CoinRunEnd::Timeout));
    }
}
