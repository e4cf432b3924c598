//! Tests that the printed form of a level reads back as a file and plays the same.

use std::path::Path;

use playbot::prelude::*;
use playbot_games::{
    antmaze::{AntMaze, AntMazeWithMap, AntMazeWithPositionalEncoding, AntMazeWithRays},
    coinrun::CoinRun,
    maze2d::{Maze2d, Maze2dWithMap, Maze2dWithPositionalEncoding, Maze2dWithRays},
};
use playbot_harness::{
    inspect::{LevelRequest, LevelView},
    level_files::level_files_mode,
    worlds::build_world,
};
use proptest::prelude::*;
use serde_json::json;

const COINRUN: CoinRun = CoinRun { physics: false };
const MAZE2D: Maze2d = Maze2d { physics: false };

/// Returns state hash, bits of the reward and bits of the observation, tick by tick under random actions, to the end of
/// the episode.
fn trace(game: &dyn Game, mode: &str, level: u64, seed: u64, ticks: usize) -> Vec<(u64, u32, Vec<u32>)> {
    game.check_mode(mode).expect("a mode");
    let (mut world, agents) = build_world(game, mode, seed, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(level)));
    let mut trace = Vec::new();
    for _ in 0..ticks {
        world.tick().expect("sound");
        let hash = world.get::<StateHash>(agent).expect("required by Agent").0;
        let reward = world.get::<Reward>(agent).expect("required by Agent").get().to_bits();
        let seen = &world.get::<Observation>(agent).expect("required by Agent").vector;
        trace.push((hash, reward, seen.iter().map(|value| value.to_bits()).collect()));
        if world.get::<Episode>(agent).is_none_or(|episode| !episode.is_running()) {
            break;
        }
    }
    trace
}

fn show(game: &dyn Game, request: &LevelRequest) -> LevelView {
    game.show_level(request).unwrap_or_else(|error| panic!("{request:?}: {error}"))
}

/// Prints a level, reads it back, and compares both prints and both episodes.
fn assert_reads_back(game: &dyn Game, mode: &str, request: &LevelRequest, folder: &Path, seed: u64, ticks: usize) {
    let level = request.level.unwrap_or(0);
    let path = folder.join(format!("level {level}.json"));
    let shown = show(game, request);
    std::fs::write(&path, &shown.json).expect("writable");
    let again = show(game, &LevelRequest { file: Some(&path), ..LevelRequest::default() });
    assert_eq!((&again.json, &again.text), (&shown.json, &shown.text), "{mode}");
    let files = level_files_mode(&path.to_string_lossy());
    assert_eq!(trace(game, &files, 0, seed, ticks), trace(game, mode, level, seed, ticks), "{mode}, level {level}");
    assert_eq!(
        format!("{:?}", game.tools().levels.floor_plan(&files, 0)),
        format!("{:?}", game.tools().levels.floor_plan(mode, level)),
        "{mode}, level {level}"
    );
}

/// As [`assert_reads_back`] for a game of mazes and its variants with more observations, each with so many ticks.
fn assert_mazes_read_back(games: [(&dyn Game, usize); 4], mode: &str, level: u64, seed: u64) {
    let folder = tempfile::tempdir().expect("a folder");
    let request = LevelRequest { map: Some(mode), level: Some(level), ..LevelRequest::default() };
    for (game, ticks) in games {
        assert_reads_back(game, mode, &request, folder.path(), seed, ticks);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn levels_of_coinrun_play_as_their_files(level in any::<u32>(), hard in any::<bool>(), seed in 0u64..1000) {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = if hard { "hard" } else { "easy" };
        let request = LevelRequest { mode: Some(mode), level: Some(level.into()), ..LevelRequest::default() };
        assert_reads_back(&COINRUN, mode, &request, folder.path(), seed, 300);
    }

    #[test]
    fn levels_of_maze2d_play_as_their_files(
        level in 0u64..100_000,
        mode in prop::sample::select(vec![
            "medium+sparse",
            "umaze+goal=random+end-at-goal",
            "large+no-offset+limit=40",
            "xl+contact=rapier",
            "random+size=9x13+goal=random+limit=60",
            "random+fixed-start",
        ]),
        seed in 0u64..1000,
    ) {
        assert_mazes_read_back([(&MAZE2D, 80), (&Maze2dWithRays::default(), 20), (&Maze2dWithMap::default(), 20), (&Maze2dWithPositionalEncoding::default(), 20)], mode, level, seed);
    }

    #[test]
    fn levels_of_antmaze_play_as_their_files(
        level in 0u64..100_000,
        mode in prop::sample::select(vec![
            "medium+sparse",
            "large+goals=demo+goal-noise=d4rl",
            "umaze+random-start+limit=12",
            "random+size=9x9+goals=random+random-start+dense=exp",
        ]),
        seed in 0u64..1000,
    ) {
        assert_mazes_read_back([(&AntMaze, 20), (&AntMazeWithRays::default(), 5), (&AntMazeWithMap::default(), 5), (&AntMazeWithPositionalEncoding::default(), 5)], mode, level, seed);
    }
}

#[test]
fn a_level_has_one_hash_however_its_file_is_laid_out_and_another_one_after_any_change() {
    let shown = show(&COINRUN, &LevelRequest { mode: Some("hard"), level: Some(3), ..LevelRequest::default() }).json;
    let hash = |text: &str| COINRUN.parse_level(text).expect("a level").hash();
    let value: serde_json::Value = serde_json::from_str(&shown).expect("JSON");
    assert_eq!(hash(&serde_json::to_string_pretty(&value).expect("text")), hash(&shown));
    let mut elsewhere = value.clone();
    elsewhere["seed"] = 4.into();
    assert_eq!(hash(&elsewhere.to_string()), hash(&shown), "where a level is from is not played");
    for (key, other) in [("background", json!(61)), ("saws", json!([[9, 9]])), ("tie_breaks", json!("5".repeat(256)))] {
        let mut changed = value.clone();
        changed[key] = other;
        assert_ne!(hash(&changed.to_string()), hash(&shown), "{key}");
    }
}

#[test]
fn small_and_plain_files_are_levels_too() {
    let coinrun = json!({ "rows": ["######", "#A..C#", "#....#"] });
    assert!(COINRUN.parse_level(&coinrun.to_string()).is_ok());
    let maze = json!({ "rows": ["#####", "#SOG#", "#####"] }).to_string();
    let named =
        json!({ "rows": ["#####", "#OOO#", "#####"], "start": [1, 1], "goal": [1, 3], "shortest_path_length": 9 });
    for game in [&MAZE2D as &dyn Game, &AntMaze] {
        let hash = |text: &str| game.parse_level(text).expect("a maze").hash();
        assert_eq!(hash(&maze), hash(&named.to_string()), "{}", game.name());
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("maze.json");
    std::fs::write(&path, &maze).expect("writable");
    let mode = level_files_mode(&path.to_string_lossy());
    MAZE2D.check_mode(&mode).expect("a level");
    let (mut world, agents) = build_world(&MAZE2D, &mode, 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Constant(ActionValue::Continuous(vec![0.0; 2]))));
    world.tick().expect("sound");
    let seen = &world.get::<Observation>(agents[0]).expect("an agent").vector;
    assert_eq!(seen[..], [1.0, 1.0, 0.0, 0.0], "at rest in the middle of the start");
}
