//! Detector of ants whose motion or reward breaks the rules.

use crate::{
    ant::{AntBody, AntState, walk::within_reach},
    antmaze::{
        arena,
        arena::{InMaze, MazeAnt, pay},
        geometry::{distance, wall_boxes},
        level::AntMazeLevel,
    },
    maze::reward_mismatch,
};
use playbot_harness::{
    detector::{Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LevelAhead},
    prelude::*,
};

/// Computes ticks once more, from the ant before them, the action and the map of the level, and compares the results.
///
/// The walls are those of the map, whatever the physics has. Dynamics are most of a tick's cost, so only some ticks are
/// computed. Rewards are checked in all of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct AgainstRules {
    every: f64,
}

impl Default for AgainstRules {
    fn default() -> Self {
        Self { every: 4.0 }
    }
}

/// Largest allowed difference of two results of the same tick in any number, in metres, radians and seconds.
const SLACK: f32 = 1e-4;

/// Watches one ant.
struct Following {
    every: u32,
    /// Another ant, among the walls of the map.
    body: Option<Box<AntBody>>,
    /// The body is at the ant's state before the next tick.
    is_ready: bool,
}

impl Detector for AgainstRules {
    fn name(&self) -> &'static str {
        "against-rules"
    }

    fn describe(&self) -> &'static str {
        "the ant does not move, or is not paid, as the rules say"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        let what = "ticks between two checks of the motion";
        vec![DetectorSetting::new("every", &mut self.every, what).at_least(1.0)]
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(Following { every: self.every as u32, body: None, is_ready: false }))
    }
}

impl EpisodeWatcher for Following {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let ant = &moment.world.get::<MazeAnt>(moment.agent)?.0;
        let level = &moment.world.get::<InMaze>(moment.agent)?.0;
        let ActionValue::Continuous(action) = moment.action else { return None };
        let is_first = self.body.is_none();
        let body = self.body.get_or_insert_with(|| at_start(level));
        let state = ant.state();
        let wrong = (is_first || self.is_ready).then(|| {
            body.step(&within_reach(action));
            moved_otherwise(&state, &body.state())
        });
        self.is_ready = (moment.tick + 1).is_multiple_of(self.every.max(1));
        if self.is_ready {
            body.follow(ant);
        }
        wrong.flatten().or_else(|| reward_mismatch(moment.reward, paid_by_rules(&state, level), SLACK))
    }
}

/// Returns an ant at the start of the level.
fn at_start(level: &AntMazeLevel) -> Box<AntBody> {
    let mut body = AntBody::new(&wall_boxes(&level.maze));
    body.set_state(&level.reset);
    Box::new(body)
}

fn moved_otherwise(after: &AntState, by_rules: &AntState) -> Option<String> {
    // NaN is not near to anything.
    let differs = |(_, (is, should)): &(usize, (f32, f32))| {
        let is_same = (is - should).abs() <= SLACK;
        !is_same
    };
    let (at, (is, should)) = arena::values(after).zip(arena::values(by_rules)).enumerate().find(differs)?;
    // Names are made only for reports.
    let name = &arena::names()[at];
    Some(format!("the ant's `{name}` is {is:.4}; by the rules it is {should:.4}"))
}

/// Returns the reward of a tick that ends in this state.
fn paid_by_rules(state: &AntState, level: &AntMazeLevel) -> f32 {
    let [x, y, ..] = state.qpos;
    pay(level.pay, distance([x, y], level.goal_at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        antmaze::{AntMaze, AntMazeMode, generate},
        watched::{first_finding, planted},
    };

    const MODE: &str = "random+size=7x7";

    #[test]
    fn who_walks_by_the_rules_is_not_found() {
        for level in 0..3 {
            for (noise, every) in [(0.0, 1.0), (1.0, 4.0)] {
                let found = first_finding(&AntMaze, MODE, level, None, &AgainstRules { every }, noise, 200);
                assert_eq!(found, None, "level {level} with noise {noise}");
            }
        }
    }

    #[test]
    fn forces_and_walls_that_the_rules_do_not_know_are_found() {
        for class in ["weak-push", "drift", "runaway", "wrong-gravity", "invisible-wall"] {
            let plant = planted(&AntMaze, class);
            let found =
                |level| first_finding(&AntMaze, MODE, level, Some((&*plant, 0)), &AgainstRules::default(), 0.0, 400);
            let found = (0..2).find_map(found);
            assert!(found.is_some_and(|(_, words)| words.contains("by the rules it is")), "{class}");
        }
    }

    #[test]
    fn what_is_paid_beside_the_rules_is_found() {
        let mode: AntMazeMode = MODE.parse().expect("a mode");
        let level = generate(&mode, 3).expect("a level");
        let [x, y, ..] = level.reset.qpos;
        let right = pay(level.pay, distance([x, y], level.goal_at));
        assert_eq!(reward_mismatch(right, paid_by_rules(&level.reset, &level), SLACK), None);
        let reported =
            reward_mismatch(right + 1.0, paid_by_rules(&level.reset, &level), SLACK).expect("it is too much");
        assert!(reported.contains("by the rules it pays"), "{reported}");
    }
}
