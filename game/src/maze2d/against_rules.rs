//! Detector of balls whose motion or reward breaks the rules.

use crate::{
    maze::reward_mismatch,
    maze2d::{
        arena::{MazeArena, MazeBall, PlaysIn},
        ball::{Ball, FORCE, RADIUS, Vec2d, clip_action, length, scale, sub},
        mode::{ContactModel, Maze2dMode},
        sim::{reward, step_soft},
        walls::Walls,
    },
};
use playbot_harness::{
    detector::{Detector, DetectorTick, EpisodeWatcher, LevelAhead},
    prelude::*,
};

/// Computes each tick once more from the position of the ball before it, the action and the map of the level, and
/// compares the results.
///
/// The walls are those of the map, whatever the arena has. Under [`ContactModel::Rapier`] balls near walls are left out: a
/// solver's result there depends on its memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AgainstRules;

/// Largest allowed difference of two results of the same tick, m and m/s.
const SLACK: f64 = 1e-6;

/// The same for rapier, which computes in single precision.
const SLACK_OF_SOLVER: f64 = 1e-3;

/// A ball this far from all walls, surface to surface, is in free flight, m.
const CLEAR: f64 = 2.0 * RADIUS;

/// Largest allowed difference of two rewards of the same tick.
const SLACK_OF_REWARD: f32 = 1e-5;

/// Watches one ball.
#[derive(Default)]
struct Following {
    walls: Option<Walls>,
    before: Option<Ball>,
}

impl Detector for AgainstRules {
    fn name(&self) -> &'static str {
        "against-rules"
    }

    fn describe(&self) -> &'static str {
        "the ball does not move, or is not paid, as the rules say"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::<Following>::default())
    }
}

impl EpisodeWatcher for Following {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let world = moment.world;
        let ball = world.get::<MazeBall>(moment.agent)?.0;
        let MazeArena { level, rules, .. } = world.get::<MazeArena>(world.get::<PlaysIn>(moment.agent)?.0)?;
        let before = self.before.replace(ball).unwrap_or(level.start);
        let ActionValue::Continuous(action) = moment.action else { return None };
        let &[x, y] = action.as_slice() else { return None };
        let walls = self.walls.get_or_insert_with(|| Walls::new(&level.maze, rules.wall_offset()));
        let paid = reward(ball.position, level.goal(), rules.sparse);
        moved_otherwise(&before, &ball, clip_action([x, y]).0, walls, rules)
            .or_else(|| reward_mismatch(moment.reward, paid, SLACK_OF_REWARD))
    }
}

fn moved_otherwise(before: &Ball, after: &Ball, push: Vec2d, walls: &Walls, rules: &Maze2dMode) -> Option<String> {
    let mut by_rules = *before;
    let slack = match rules.contact {
        ContactModel::Soft => {
            step_soft(&mut by_rules, push, walls);
            SLACK
        }
        ContactModel::Rapier if walls.touches(before.position, CLEAR).as_slice().is_empty() => {
            by_rules.limit_speed();
            by_rules.fly(scale(push, FORCE));
            SLACK_OF_SOLVER
        }
        ContactModel::Rapier => return None,
    };
    let apart = length(sub(after.position, by_rules.position)).max(length(sub(after.velocity, by_rules.velocity)));
    // NaN is not near to anything.
    let is_same = apart <= slack;
    let reported = |ball: &Ball| {
        let Ball { position: [x, y], velocity: [vx, vy] } = ball;
        format!("at {x:.3}, {y:.3} with {vx:.3}, {vy:.3} m/s")
    };
    (!is_same).then(|| format!("the ball is {}; by the rules it is {}", reported(after), reported(&by_rules)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        maze2d::Maze2d,
        watched::{first_finding, planted},
    };

    const MODES: [&str; 3] = ["random+end-at-goal", "medium+sparse", "random+contact=rapier"];

    #[test]
    fn who_plays_by_the_rules_is_not_found() {
        for mode in MODES {
            for level in 0..6 {
                for noise in [0.0, 1.0] {
                    let found = first_finding(&Maze2d::default(), mode, level, None, &AgainstRules, noise, 400);
                    assert_eq!(found, None, "{mode}:{level} with noise {noise}");
                }
            }
        }
    }

    #[test]
    fn pushes_winds_and_walls_that_the_rules_do_not_know_are_found() {
        for class in ["weak-push", "drift", "runaway", "invisible-wall"] {
            for mode in [MODES[0], MODES[2]] {
                // The solver is compared only away from walls, where it stops no ball.
                if class == "invisible-wall" && mode == MODES[2] {
                    continue;
                }
                let plant = planted(&Maze2d::default(), class);
                let found = |level| {
                    first_finding(&Maze2d::default(), mode, level, Some((&*plant, 0)), &AgainstRules, 0.0, 1000)
                };
                let found = (0..4).find_map(found);
                assert!(found.is_some_and(|(_, words)| words.contains("by the rules it is")), "{class} {mode}");
            }
        }
    }

    #[test]
    fn what_is_paid_beside_the_rules_is_found() {
        assert_eq!(reward_mismatch(0.25, 0.25, SLACK_OF_REWARD), None);
        assert_eq!(
            reward_mismatch(1.25, 0.25, SLACK_OF_REWARD).as_deref(),
            Some("the tick paid 1.25; by the rules it pays 0.25")
        );
        assert!(reward_mismatch(f32::NAN, 0.25, SLACK_OF_REWARD).is_some());
    }
}
