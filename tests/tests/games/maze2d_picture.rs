//! Tests of Maze2D's picture: everything that matters is distinct on 64 × 64 pixels, at the game's positions.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
};
use bevy_playbot::vision::{ImageOptions, ObservationConfig, ObservationKind};
use playbot::prelude::*;
use playbot_games::maze2d::{Maze2d, Maze2dLevel, Maze2dMode, arena::MazeBall};
use playbot_harness::worlds::build_observing_world;

const GAME: Maze2d = Maze2d { physics: false };
const SIDE: usize = 64;
const WALL: [u8; 3] = [0x2b, 0x30, 0x3b];
const FLOOR: [u8; 3] = [0xec, 0xef, 0xf4];
const BALL: [u8; 3] = [0xd7, 0x26, 0x3d];
const GOAL: [u8; 3] = [0xf5, 0xb7, 0x00];

/// Returns a World whose agent sees pictures and pushes as the test sets.
fn seeing(mode: &str, level: u64) -> (World, Entity) {
    let observation_config = ObservationConfig { kind: ObservationKind::Raster, image: ImageOptions::default() };
    let (mut world, agents) = build_observing_world(&GAME, mode, &observation_config, 0, 0, 2).expect("can be drawn");
    let still = Action(ActionValue::Continuous(vec![0.0, 0.0]));
    for (agent, level) in agents.iter().zip([level, level + 1]) {
        world.entity_mut(*agent).insert((Control::Human, LevelQueue::Always(level), still.clone()));
    }
    (world, agents[0])
}

/// Returns the columns and rows of the pixels with a colour, from the top left.
fn pixels(world: &World, agent: Entity, colour: [u8; 3]) -> Vec<(usize, usize)> {
    let image = &world.get::<Observation>(agent).expect("an agent").image;
    assert_eq!(image.len(), 3 * SIDE * SIDE);
    let has = |at: &usize| (0..3).all(|channel| image[channel * SIDE * SIDE + at] == colour[channel]);
    (0..SIDE * SIDE).filter(has).map(|at| (at % SIDE, at / SIDE)).collect()
}

/// Returns the mean column and row of some pixels.
fn middle(pixels: &[(usize, usize)]) -> Vec2 {
    let sum = pixels.iter().fold(Vec2::ZERO, |sum, &(x, y)| sum + Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
    sum / pixels.len() as f32
}

/// Returns the position in the picture of a position in the maze, pixels from the top left.
fn in_picture(level: &Maze2dLevel, [x, y]: [f64; 2]) -> Vec2 {
    let (rows, columns, offset) = (level.maze.rows() as f64, level.maze.columns() as f64, level.walls.offset());
    let cell = SIDE as f64 / rows.max(columns);
    let margin = |cells: f64| (SIDE as f64 - cells * cell) / 2.0;
    let at = |along: f64, cells: f64| (margin(cells) + (along + offset + 0.5) * cell) as f32;
    Vec2::new(at(y, columns), at(x, rows))
}

#[test]
fn walls_floor_ball_and_goal_are_where_they_are() {
    for text in ["umaze", "medium", "large", "medium+no-offset", "random", "random+size=15x21+goal=random"] {
        let mode: Maze2dMode = text.parse().expect("a mode");
        // A level on which the goal does not hide the ball, nor the ball the goal.
        let apart = |level: &Maze2dLevel| level.start_cell.row.abs_diff(level.goal_cell.row) > 1;
        let mut levels = (0..).map(|seed| (seed, Maze2dLevel::new(&mode, seed).expect("a level")));
        let (seed, level) = levels.find(|(_, level)| apart(level)).expect("some level");
        let (mut world, agent) = seeing(text, seed);
        world.tick().expect("drawn");
        for (what, colour, place) in [("ball", BALL, level.start.position), ("goal", GOAL, level.goal())] {
            let seen = pixels(&world, agent, colour);
            assert!((6..130).contains(&seen.len()), "{text}: the {what} has {} pixels", seen.len());
            let (at, expected) = (middle(&seen), in_picture(&level, place));
            assert!(at.distance(expected) < 1.0, "{text}: the {what} is seen at {at}, and is at {expected}");
        }
        let (walls, floor) = (pixels(&world, agent, WALL), pixels(&world, agent, FLOOR));
        assert!(walls.len() > 400 && floor.len() > 400, "{text}: {} of wall, {} of floor", walls.len(), floor.len());
        let figures = pixels(&world, agent, BALL).len() + pixels(&world, agent, GOAL).len();
        assert_eq!(walls.len() + floor.len() + figures, SIDE * SIDE, "{text}: nothing else is drawn");
    }
}

#[test]
fn the_ball_goes_where_the_keys_push_it() {
    let keys = GAME.tools().input.key_bindings().expect("people can play");
    // From a cell of the medium map that is open to this side.
    for (key, way, cell) in [
        (KeyCode::ArrowUp, Vec2::new(0.0, -1.0), (3, 4)),
        (KeyCode::ArrowDown, Vec2::new(0.0, 1.0), (3, 4)),
        (KeyCode::KeyA, Vec2::new(-1.0, 0.0), (3, 4)),
        (KeyCode::ArrowRight, Vec2::new(1.0, 0.0), (3, 3)),
    ] {
        let free = (0..).find(|&seed| {
            let level = Maze2dLevel::new(&"medium".parse().expect("a mode"), seed).expect("a level");
            (level.start_cell.row, level.start_cell.col) == cell
        });
        let (mut world, agent) = seeing("medium", free.expect("some level"));
        world.tick().expect("drawn");
        let before = middle(&pixels(&world, agent, BALL));
        world.entity_mut(agent).insert(Action(keys.action(|held| held == key)));
        world.ticks(18).expect("drawn");
        let moved = middle(&pixels(&world, agent, BALL)) - before;
        assert!(moved.dot(way) > 1.5 && moved.perp_dot(way).abs() < 1.5, "{key:?} moved the ball by {moved}");
    }
}

#[test]
fn drawing_changes_nothing_in_the_game_and_has_one_order() {
    let mut app = headless_app();
    app.edit_schedule(ObserveSchedule, |schedule| {
        schedule.set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    });
    GAME.build(&mut app, "medium");
    GAME.tools().pictures.build_picture(&mut app);
    let drawn = GAME.spawn_agent(app.world_mut(), 0);
    let (mut plain, agents) = playbot_harness::worlds::build_world(&GAME, "medium", 0, 0, 1);
    for (world, agent) in [(app.world_mut(), drawn), (&mut plain, agents[0])] {
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Uniform { first: 0, last: 9 }));
        world.ticks(700).expect("sound");
    }
    let ball = |world: &World, agent| *world.get::<MazeBall>(agent).expect("a ball");
    assert_eq!(ball(app.world(), drawn), ball(&plain, agents[0]));
}
