//! Defects that can be planted into AntMaze, to measure testers: see `playbot_mutation`.

use crate::{
    ant::{AntBody, AntState},
    antmaze::{
        AntMazeSystems,
        arena::{InMaze, MazeAnt},
        geometry::{distance, wall_boxes},
        level_text,
    },
    maze::defects::{ChangeMaze, of_levels, of_walls, take_back},
};
use bevy::prelude::*;
use playbot_harness::{
    defect::{DefectKind, pick, place, variants},
    prelude::*,
};

/// Returns the defects of the game, those of levels first.
pub(super) fn defects() -> Vec<DefectKind> {
    let levels = of_levels(|text| level_text::parse(text).is_ok());
    [levels, goal_defects(), wall_defects(), motion_defects()].concat()
}

// Defects of the goal: unnoticed, or reached from afar.

/// Distance within which the goal is noticed, m: never, and hardly. It should be 0.5.
const NEAR: [f32; 3] = [-1.0, 0.05, 0.2];

/// Distance at which the goal counts as reached, m, also through walls.
const FAR: [f32; 3] = [2.0, 5.0, 9.0];

fn goal_defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("goal-does-not-end", "a player at the goal has not reached it", 3, |app, variant| {
            let near = NEAR[variant as usize % NEAR.len()];
            look_at_goal(app, move |episode, away| {
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
                look_at_goal(app, move |episode, away| {
                    if away <= far {
                        episode.terminate(true);
                    }
                });
            },
        ),
    ]
}

/// Calls `look` on each episode after the rules, with the distance from the ant to the goal, m.
fn look_at_goal(app: &mut App, look: impl Fn(&mut Episode, f32) + Send + Sync + 'static) {
    app.add_systems(
        FixedUpdate,
        (move |mut ants: Query<(&Control, &InMaze, &MazeAnt, &mut Episode)>| {
            for (control, level, ant, mut episode) in &mut ants {
                if control.is_active() && episode.is_running() {
                    let [x, y, ..] = ant.0.state().qpos;
                    look(&mut episode, distance([x, y], level.0.goal_at));
                }
            }
        })
        .after(AntMazeSystems),
    );
}

// Defects of the ant's motion.

/// Vertical speed that is added in each tick, m/s. Gravity makes -0.98.
const LIFT: [f32; 2] = [0.6, -1.5];

/// Horizontal speed that is added in each tick, m/s.
const WIND: [f32; 2] = [0.1, 0.4];

/// Factor on the torso's speed in each tick.
const GROWTH: [f32; 2] = [1.2, 1.6];

/// Factor on an action. Powers of two, so that it can be undone to the bit for recordings.
const WEAK: [f32; 3] = [0.5, 0.25, 0.125];

/// Distance from the start at which a defect begins to act, m, by place.
const BEGINS: [f32; 3] = [0.0, 2.0, 4.0];

fn motion_defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules(
            "wrong-gravity",
            "gravity is too weak or too strong",
            variants(LIFT.len()),
            |app, variant| {
                let lift = pick(&LIFT, variant);
                after_each_tick(app, variant, move |ant| ant.qvel[2] += lift);
            },
        ),
        DefectKind::rules("drift", "ants drift to one side", variants(WIND.len()), |app, variant| {
            let wind = pick(&WIND, variant);
            after_each_tick(app, variant, move |ant| ant.qvel[1] += wind);
        }),
        DefectKind::rules("runaway", "ants get faster by themselves", variants(GROWTH.len()), |app, variant| {
            let growth = pick(&GROWTH, variant);
            after_each_tick(app, variant, move |ant| ant.qvel[..3].iter_mut().for_each(|speed| *speed *= growth));
        }),
        DefectKind::rules("weak-push", "joints are too weak", WEAK.len() as u32, |app, variant| {
            let left = WEAK[variant as usize % WEAK.len()];
            let weaken = move |agents: Query<(&Control, &Episode, &mut Action)>| scale_actions(agents, left);
            let restore = move |agents: Query<(&Control, &Episode, &mut Action)>| scale_actions(agents, 1.0 / left);
            app.add_systems(FixedUpdate, (weaken.before(AntMazeSystems), restore.after(AntMazeSystems)));
        }),
    ]
}

fn scale_actions(mut agents: Query<(&Control, &Episode, &mut Action)>, factor: f32) {
    for (control, episode, mut action) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if let ActionValue::Continuous(values) = &mut action.0 {
            values.iter_mut().for_each(|value| *value *= factor);
        }
    }
}

/// Changes the state of each playing ant that is far enough from its start, after each tick.
fn after_each_tick(app: &mut App, variant: u32, change: impl Fn(&mut AntState) + Send + Sync + 'static) {
    let begins = BEGINS[place(variant)];
    app.add_systems(
        FixedUpdate,
        (move |mut ants: Query<(&Control, &Episode, &InMaze, &mut MazeAnt)>| {
            for (control, episode, level, mut ant) in &mut ants {
                let mut state = ant.0.state();
                let ([x, y, ..], [from_x, from_y, ..]) = (state.qpos, level.0.reset.qpos);
                let plays = control.is_active() && episode.is_running();
                if plays && distance([x, y], [from_x, from_y]) >= begins {
                    change(&mut state);
                    ant.0.set_state(&state);
                }
            }
        })
        .after(AntMazeSystems),
    );
}

// Defects of walls in which the physics and the pictures differ.

fn wall_defects() -> Vec<DefectKind> {
    of_walls(stand)
}

/// Gives the physics other walls as soon as a level has been built.
fn stand(app: &mut App, variant: u32, change: ChangeMaze) {
    let exchange = move |mut ants: Query<(&InMaze, &mut MazeAnt), Changed<InMaze>>| {
        for (level, mut ant) in &mut ants {
            let level = &level.0;
            // Coordinates begin at the start of the map, which stays where it is.
            let Some(maze) = change(&level.maze, level.start, level.goal, variant) else { continue };
            let mut body = AntBody::new(&wall_boxes(&maze));
            body.set_state(&level.reset);
            ant.0 = body;
        }
    };
    app.add_systems(FixedUpdate, exchange.before(AntMazeSystems));
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use bevy_playbot::test_app::{PlaybotTestExt, test_app};
    use playbot_harness::{
        defect::PLACES,
        defect::{ChangeRules, Plant},
        prelude::*,
    };
    use playbot_learner::rng::Streams;

    use super::*;
    use crate::{
        ant::WallBox,
        antmaze::{AntMaze, DemonstratorBot, generate, level_text::LevelText, spawn_agent},
        maze::Maze,
    };

    /// Mode of the levels. The game's bot solves nine in ten of them in a few hundred ticks.
    const MODE: &str = "umaze+sparse";
    const TICKS: u64 = 600;

    /// Returns the state hashes of the game's bot, the number of its won episodes, and the fault that stopped it, if
    /// one did.
    fn trace(level: u64, plant: Option<(&ChangeRules, u32)>) -> (Result<Vec<u64>, String>, u64) {
        let mut app = test_app();
        AntMaze.build(&mut app, MODE);
        if let Some((plant, variant)) = plant {
            plant(&mut app, variant);
        }
        let agent = spawn_agent(app.world_mut(), 0);
        let bot = DemonstratorBot::new(0.0);
        app.world_mut().entity_mut(agent).insert((Control::Bot, bot, LevelQueue::Always(level)));
        let hashes = app.hash_trace(TICKS).map_err(|fault| fault.to_string());
        assert_eq!(app.ambiguous_orders(&["playbot_games"]), [""; 0]);
        (hashes, app.world().get::<EpisodeCount>(agent).expect("every agent has one").successes)
    }

    #[test]
    fn every_defect_of_levels_is_planted_and_reads_back() {
        let mode = "random".parse().expect("a mode");
        for kind in defects() {
            let Plant::Level(change) = &kind.plant else { continue };
            let mut planted = 0;
            for seed in 0..20 {
                let text = serde_json::json!(LevelText::of(&generate(&mode, seed).expect("a level"))).to_string();
                let Some(broken) = change(&text, &mut Streams::new(seed).stream("test", 0)) else { continue };
                let design = level_text::parse(&broken).expect("it reads back");
                assert_ne!(design.hash(), level_text::parse(&text).expect("it was printed").hash());
                planted += 1;
            }
            assert!(planted >= 5, "{}: {planted} of 20", kind.class);
        }
    }

    #[test]
    fn every_variant_of_the_rules_changes_an_episode() {
        let mut traces = (0..4).map(|level| (level, trace(level, None)));
        let (level, sound) = traces.find(|(_, sound)| sound.1 > 0).expect("the bot solves one");
        assert_eq!(trace(level, None), sound, "without a defect nothing changes");
        for kind in defects() {
            let Plant::Rules { variants, plant } = &kind.plant else { continue };
            assert!(*variants >= 3, "{}", kind.class);
            for variant in 0..*variants {
                // The bot keeps away from walls, also from missing ones.
                if kind.class != "missing-collider" {
                    assert_ne!(trace(level, Some((&**plant, variant))), sound, "{} {variant}", kind.class);
                }
            }
        }
    }

    /// Returns the level of an agent and the walls around its ant, with this defect planted.
    fn planted(class: &str, variant: u32) -> (Maze, Vec<WallBox>) {
        let mut app = test_app();
        AntMaze.build(&mut app, "medium");
        let kind = wall_defects().into_iter().find(|kind| kind.class == class).expect("there is such a defect");
        let Plant::Rules { plant, .. } = kind.plant else { panic!("`{class}` is one of rules") };
        plant(&mut app, variant);
        let agent = spawn_agent(app.world_mut(), 0);
        let still = Action(ActionValue::Continuous(vec![0.0; 8]));
        app.world_mut().entity_mut(agent).insert((Control::Human, still, LevelQueue::Always(0)));
        app.tick().expect("sound");
        let (level, ant) = (app.world().get::<InMaze>(agent), app.world().get::<MazeAnt>(agent));
        let ant = ant.expect("it plays").0.walls().boxes().to_vec();
        (level.expect("it plays").0.maze.clone(), ant)
    }

    #[test]
    fn the_ant_meets_other_walls_than_its_level_has() {
        let area = |boxes: &[WallBox]| boxes.iter().map(|wall| wall.half[0] * wall.half[1] / 4.0).sum::<f32>();
        for variant in 0..PLACES {
            let (maze, boxes) = planted("invisible-wall", variant);
            assert_ne!(boxes, wall_boxes(&maze), "{variant}");
            let (maze, boxes) = planted("missing-collider", variant);
            assert!(area(&boxes) < area(&wall_boxes(&maze)), "{variant}");
        }
    }
}
