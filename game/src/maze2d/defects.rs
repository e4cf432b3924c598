//! Defects that can be planted into Maze2D, to measure testers: see `playbot_mutation`.

use crate::{
    maze::defects::{ChangeMaze, of_levels, of_walls, take_back},
    maze2d::{
        Maze2dSystems,
        arena::{MazeArena, MazeBall, PlaysIn},
        ball::{Ball, FORCE, MASS, STEP, Vec2d, clip_action, length, sub},
        level::Maze2dLevel,
        level_text,
        mode::ContactModel,
        physics::MazePhysics,
        walls::Walls,
    },
};
use bevy::prelude::*;
use playbot_harness::{
    defect::{DefectKind, pick, place, variants},
    prelude::*,
};
use std::sync::Arc;

/// Returns the defects of the game, those of levels first.
pub(super) fn defects() -> Vec<DefectKind> {
    let levels = of_levels(|text| level_text::parse(text).is_ok());
    [levels, goal_defects(), wall_defects(), motion_defects()].concat()
}

// Defects of the goal: unnoticed, or reached from afar.

/// Distance from the goal's middle within which it is noticed, m: never, and hardly. It should be 0.5.
const NEAR: [f64; 3] = [-1.0, 0.02, 0.1];

/// Distance at which the goal counts as reached, m, also through walls.
const FAR: [f64; 3] = [1.2, 2.0, 3.5];

fn goal_defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("goal-does-not-end", "a player at the goal has not reached it", 3, |app, variant| {
            let near = NEAR[variant as usize % NEAR.len()];
            look_at_goal(app, move |episode, away, _| {
                if away > near {
                    take_back(episode);
                }
            });
        }),
        DefectKind::rules(
            "goal-far-away",
            "the goal counts as reached from far away, also through walls",
            3,
            |app, variant| {
                let far = FAR[variant as usize % FAR.len()];
                look_at_goal(app, move |episode, away, ends| {
                    if away <= far {
                        episode.reach();
                        if ends {
                            episode.terminate(true);
                        }
                    }
                });
            },
        ),
    ]
}

/// Calls `look` on each episode after the rules, with the distance from the ball to the goal, m, and whether the goal
/// ends it.
fn look_at_goal(app: &mut App, look: impl Fn(&mut Episode, f64, bool) + Send + Sync + 'static) {
    app.add_systems(
        FixedUpdate,
        (move |mut players: Query<(&Control, &PlaysIn, &MazeBall, &mut Episode)>, arenas: Query<&MazeArena>| {
            for (control, plays_in, ball, mut episode) in &mut players {
                let Ok(arena) = arenas.get(plays_in.0) else { continue };
                if control.is_active() && episode.is_running() {
                    let away = length(sub(ball.0.position, arena.level.goal()));
                    look(&mut episode, away, arena.rules.end_at_goal);
                }
            }
        })
        .after(Maze2dSystems),
    );
}

// Defects of the ball's motion.

/// Share of the push that is lost.
const LOST: [f64; 2] = [0.5, 0.8];

/// Added acceleration along the columns, m/s in each tick. A full push makes 0.24.
const WIND: [f64; 2] = [0.03, 0.1];

/// Factor on the speed in each tick.
const GROWTH: [f64; 2] = [1.03, 1.1];

/// Distance from the start at which a defect begins to act, m, by place.
const BEGINS: [f64; 3] = [0.0, 1.5, 3.0];

fn motion_defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("weak-push", "pushes are too weak", variants(LOST.len()), |app, variant| {
            let lost = pick(&LOST, variant);
            after_each_tick(app, variant, move |ball, push| {
                for (speed, push) in ball.velocity.iter_mut().zip(push) {
                    *speed -= lost * push * FORCE * STEP / MASS;
                }
            });
        }),
        DefectKind::rules("drift", "the ball drifts to one side", variants(WIND.len()), |app, variant| {
            let wind = pick(&WIND, variant);
            after_each_tick(app, variant, move |ball, _| ball.velocity[1] += wind);
        }),
        DefectKind::rules("runaway", "the ball gets faster by itself", variants(GROWTH.len()), |app, variant| {
            let growth = pick(&GROWTH, variant);
            after_each_tick(app, variant, move |ball, _| ball.velocity = ball.velocity.map(|speed| speed * growth));
        }),
    ]
}

/// Changes the ball of each playing agent that is far enough from its start, after each tick.
fn after_each_tick(app: &mut App, variant: u32, change: impl Fn(&mut Ball, Vec2d) + Send + Sync + 'static) {
    let begins = BEGINS[place(variant)];
    app.add_systems(
        FixedUpdate,
        (move |mut players: Query<(&Control, &Episode, &Action, &PlaysIn, &mut MazeBall)>,
               arenas: Query<&MazeArena>| {
            for (control, episode, action, plays_in, mut ball) in &mut players {
                let (Ok(arena), Some(&[x, y])) = (arenas.get(plays_in.0), action.continuous()) else { continue };
                let plays = control.is_active() && episode.is_running();
                if plays && length(sub(ball.0.position, arena.level.start.position)) >= begins {
                    change(&mut ball.0, clip_action([x, y]).0);
                }
            }
        })
        .after(Maze2dSystems),
    );
}

// Defects of walls in which the rules and the pictures differ.

fn wall_defects() -> Vec<DefectKind> {
    of_walls(stand)
}

/// Gives the rules other walls as soon as a level has been built.
fn stand(app: &mut App, variant: u32, change: ChangeMaze) {
    let exchange = move |mut arenas: Query<(&mut MazeArena, Option<&mut MazePhysics>), Changed<MazeArena>>| {
        for (mut arena, physics) in &mut arenas {
            let arena = arena.bypass_change_detection();
            let Maze2dLevel { maze, start_cell, goal_cell, start, .. } = &*arena.level;
            let Some(maze) = change(maze, *start_cell, *goal_cell, variant) else { continue };
            let walls = Walls::new(&maze, arena.rules.wall_offset());
            if let Some(mut physics) = physics {
                let solves = arena.rules.contact == ContactModel::Rapier;
                let stand = if solves { MazePhysics::solving } else { MazePhysics::following };
                *physics = stand(&walls, start);
            }
            arena.level = Arc::new(Maze2dLevel { walls, ..Maze2dLevel::clone(&arena.level) });
        }
    };
    app.add_systems(FixedUpdate, exchange.before(Maze2dSystems));
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use bevy_playbot::test_app::{PlaybotTestExt, test_app};
    use playbot_harness::{
        defect::{ChangeRules, Plant},
        prelude::*,
    };
    use playbot_learner::rng::Streams;

    use super::*;
    use crate::maze2d::{
        DemonstratorBot, Maze2d, Maze2dLevel, Maze2dMode, arena::PlaysIn, level_text::LevelText, spawn_agent,
    };

    const MODE: &str = "random";

    /// Returns the state of an episode of the game's bot after each tick, and whether it had reached the goal.
    fn trace(level: u64, plant: Option<(&ChangeRules, u32)>) -> Vec<(Vec<u64>, bool)> {
        let mut app = test_app();
        Maze2d::default().build(&mut app, MODE);
        if let Some((plant, variant)) = plant {
            plant(&mut app, variant);
        }
        let agent = spawn_agent(app.world_mut(), 0);
        let bot = DemonstratorBot::new(0.0);
        app.world_mut().entity_mut(agent).insert((Control::Bot, bot, LevelQueue::Always(level)));
        let mut trace = Vec::new();
        for _ in 0..1500 {
            let hash = app.hash_trace(1).expect("sound");
            trace.push((hash, app.world().get::<Episode>(agent).expect("every agent has one").is_success()));
        }
        assert_eq!(app.ambiguous_orders(&["playbot_games"]), [""; 0]);
        trace
    }

    #[test]
    fn every_defect_of_levels_is_planted_and_the_goal_is_proved_to_be_out_of_reach() {
        let mode: Maze2dMode = MODE.parse().expect("a mode");
        for kind in defects() {
            let Plant::Level(change) = &kind.plant else { continue };
            let mut planted = 0;
            for seed in 0..20 {
                let level = Maze2dLevel::new(&mode, seed).expect("a level");
                let text = serde_json::json!(LevelText::of(&level, &mode)).to_string();
                let Some(broken) = change(&text, &mut Streams::new(seed).stream("test", 0)) else { continue };
                let design = level_text::parse(&broken).expect("it reads back");
                assert_ne!(design.hash(), level_text::parse(&text).expect("it was printed").hash());
                planted += 1;
            }
            assert!(planted >= 5, "{}: {planted} of 20", kind.class);
        }
    }

    #[test]
    fn every_variant_of_the_rules_changes_some_episode() {
        let sound: Vec<_> = (0..6).map(|level| trace(level, None)).collect();
        assert!(sound.iter().all(|ticks| ticks.iter().any(|(_, is_success)| *is_success)), "the bot solves them");
        assert_eq!(trace(0, None), sound[0], "without a defect nothing changes");
        for kind in defects() {
            let Plant::Rules { variants, plant } = &kind.plant else { continue };
            assert!(*variants >= 3, "{}", kind.class);
            for variant in 0..*variants {
                let differs = |level: usize| trace(level as u64, Some((&**plant, variant))) != sound[level];
                // The bot keeps away from walls, also from missing ones.
                assert!(kind.class == "missing-collider" || (0..sound.len()).any(differs), "{} {variant}", kind.class);
            }
        }
    }

    #[test]
    fn the_ball_meets_one_wall_more_or_less_than_its_level_has() {
        for (kind, more) in wall_defects().into_iter().zip([1, -1]) {
            let Plant::Rules { plant, variants } = kind.plant else { panic!("`{}` is one of rules", kind.class) };
            for variant in 0..variants {
                let mut app = test_app();
                Maze2d::default().build(&mut app, "medium+fixed-start");
                plant(&mut app, variant);
                let agent = spawn_agent(app.world_mut(), 0);
                let still = Action(ActionValue::Continuous(vec![0.0; 2]));
                app.world_mut().entity_mut(agent).insert((Control::Human, still, LevelQueue::Always(0)));
                app.tick().expect("sound");
                let arena = app.world().get::<PlaysIn>(agent).expect("it plays").0;
                let level = &app.world().get::<MazeArena>(arena).expect("it plays").level;
                let walls = [level.walls.cells().count(), level.maze.wall_cells().count()].map(|count| count as i64);
                assert_eq!(walls[0] - walls[1], more, "{} {variant}", kind.class);
            }
        }
    }
}
