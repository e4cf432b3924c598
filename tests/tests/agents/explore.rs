//! Tests of exploring levels without training.

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicU64, Ordering},
};

use bevy::prelude::*;
use bevy_playbot::{
    demo::file::{DemoReader, DemoWriter},
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_games::GAMES;
use playbot_harness::{
    demo::verify_file,
    foreign::{ForeignGame, Restart},
    game::StateTools,
    games::Games,
};
use playbot_learner::{Actions, PpoConfig, Prior, SkillDraw};
use playbot_test::explore::{
    Exhaustion, Exploration, ExploreError, ExplorePlan, ExploredCell, Explorer, Stop, Until, explore, explore_until,
    follow_route, record_route,
};
use playbot_tests::{
    Cell, Corridor, Drift, as_corridor, corridor_plugin, foreign::stubborn::stubborn_game, spawn_walker,
    training::untrained,
};

/// The corridor, which gives the explorer its cells.
struct Cells;

impl Game for Cells {
    as_corridor!();

    fn tools(&self) -> GameTools<'_> {
        GameTools { state: self, ..GameTools::default() }
    }
}

impl StateTools for Cells {
    fn explore_cell(&self, world: &World, agent: Entity) -> Option<Vec<i32>> {
        world.get::<Cell>(agent).map(|cell| vec![cell.0])
    }
}

/// The corridor, whose state depends on the age of the program.
struct Drifting;

fn drift(mut drift: ResMut<Drift>) {
    drift.0 += 7;
}

impl Game for Drifting {
    as_corridor! {
        fn name() -> &'static str;
        fn version() -> u32;
        fn modes() -> &'static [&'static str];
        fn tick_hz() -> f64;
        fn actions() -> ActionSpace;
        fn observation() -> ObservationSpace;
    }

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
        app.insert_resource(Drift(0)).add_systems(FixedPreUpdate, drift);
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        spawn_walker(world, index)
    }
}

fn plan(mode: &str, level: u64, steps: u64) -> ExplorePlan {
    ExplorePlan { steps, until: Until::Spent, threads: 2, ..ExplorePlan::new(mode, level) }
}

fn explored(game: &dyn Game, plan: &ExplorePlan) -> Result<Exploration, ExploreError> {
    explore(game, plan, |_| {}, |_| ControlFlow::Continue(()))
}

fn found(game: &dyn Game, plan: &ExplorePlan) -> Exploration {
    explored(game, plan).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(game: &dyn Game, plan: &ExplorePlan) -> ExploreError {
    match explored(game, plan) {
        Ok(found) => panic!("{} cells were found", found.cells().len()),
        Err(error) => error,
    }
}

/// Returns the whole result, with every path.
fn everything(game: &dyn Game, plan: &ExplorePlan) -> String {
    let found = found(game, plan);
    let ways: Vec<_> = found.cells().iter().map(|(cell, reached)| (cell, reached, found.route_to(cell))).collect();
    format!("{:?} {ways:?}", found.summary(game))
}

#[test]
fn every_cell_of_the_corridor_is_reached_by_its_shortest_way() {
    let found = found(&Cells, &plan("plain", 1, 5000));
    let cells: Vec<_> = found.cells().iter().map(|(cell, reached)| (cell.0[0], reached.ticks())).collect();
    // The agent starts in cell 3, and comes to it in one tick by staying.
    assert_eq!(cells, [(0, 3), (1, 2), (2, 1), (3, 1), (4, 1), (5, 2), (6, 3)]);
    let over: Vec<_> = found.cells().iter().filter(|(_, reached)| reached.is_over).map(|(cell, _)| cell.0[0]).collect();
    assert_eq!(over, [0, 6], "there the episode is over");
    let solution = found.solution().expect("a short way");
    assert_eq!((solution.actions, solution.hashes), (Actions::Discrete(vec![1, 1, 1]), vec![4, 5, 6]));
    assert!(found.ends.won > 0 && found.ends.lost > 0, "{:?}", found.ends);
    assert_eq!((found.stop, found.coverage(), found.grid), (Stop::Spent, None, None));
    let visits: u64 = found.cells().values().map(|reached| reached.visits).sum();
    assert!(visits > found.visits && found.steps >= 4800, "{visits} {}", found.steps);
}

#[test]
fn observations_are_cells_where_nothing_else_is_known() {
    let found = found(&Corridor, &plan("plain", 1, 5000));
    assert_eq!(found.solution_ticks(), Some(3));
    // The observation before the first action is the start.
    let start = found.cells().values().find(|reached| reached.ticks() == 0);
    assert!(start.is_some(), "the start is seen, too");
    assert!(found.cells().keys().all(|cell| cell.0.len() == 2), "place and time");
}

#[test]
fn threads_arenas_and_worlds_change_nothing() {
    let one = ExplorePlan { threads: 1, ..plan("plain", 1, 3000) };
    let two = ExplorePlan { threads: 2, ..one.clone() };
    let few = ExplorePlan { arenas: 3, worlds: 1, ..one.clone() };
    let expected = everything(&Cells, &one);
    assert_eq!(everything(&Cells, &two), expected);
    assert_eq!(everything(&Cells, &few), expected);
    assert_ne!(everything(&Cells, &ExplorePlan { seed: 1, ..one }), expected);
}

#[test]
fn snapshots_lead_to_the_same_result_as_replays() {
    let games = Games::new(&GAMES).expect("each has a name of its own");
    for (name, mode, level) in [("coinrun", "hard", 1), ("maze2d", "random+size=7x7", 3)] {
        let game = games.get(name).expect("a game");
        let restoring = plan(mode, level, 40_000);
        let replaying = ExplorePlan { snapshots: false, ..restoring.clone() };
        let few = ExplorePlan { arenas: 3, worlds: 1, ..restoring.clone() };
        let restored = found(game, &restoring);
        assert_eq!(restored.snapshot_fault, None, "{name}");
        assert!(restored.restored_steps > 1000, "{name}: {} steps", restored.restored_steps);
        assert_eq!(found(game, &replaying).restored_steps, 0, "{name}");
        let expected = everything(game, &replaying);
        assert!(everything(game, &restoring) == expected, "{name} finds something else");
        assert!(everything(game, &few) == expected, "{name} finds something else with fewer arenas");
    }
}

#[test]
fn a_level_is_exhausted_once_each_action_was_tried_from_each_cell() {
    let plan = ExplorePlan { until: Until::Exhausted, ..plan("plain", 1, 50_000) };
    let all = found(&Cells, &plan);
    let rests_on = "the game's own cells; states within one cell are taken as equal".to_owned();
    // The episode is over in cells 0 and 6.
    assert_eq!((all.stop, all.cells().len()), (Stop::Exhausted, 7));
    assert_eq!(all.exhausted, Some(Exhaustion { actions: 3, cells: 5, rests_on }));
    assert!(all.steps < plan.steps);
    // Fewer ticks than there are cells and actions.
    let few = found(&Cells, &ExplorePlan { explore_ticks: 1, batch: 1, steps: 10, ..plan });
    assert_eq!((few.exhausted, few.stop), (None, Stop::Spent));
}

#[test]
fn levels_of_continuous_actions_are_never_exhausted() {
    let maze = Games::new(&GAMES).expect("each has a name of its own").get("maze2d").expect("a game");
    let found = found(maze, &ExplorePlan { until: Until::Exhausted, ..plan("random+size=7x7", 3, 4000) });
    assert_eq!((found.exhausted, found.stop), (None, Stop::Spent));
}

#[test]
fn policies_and_skills_explore_too() {
    let policy = untrained(&Corridor, &ObservationConfig::default(), PpoConfig::default());
    let prior = SkillPrior { prior: Prior::standard_normal(2, false), skill_interval: 4, draw: SkillDraw::Sample };
    let alone = Explorer::Policy { policy: policy.clone(), prior: None, draw: ActionDraw::Sample };
    for explorer in [alone, Explorer::skills(prior, policy)] {
        let plan = ExplorePlan { explorer, threads: 1, ..plan("plain", 1, 4000) };
        let found = found(&Cells, &plan);
        assert_eq!((found.cells().len(), found.solution_ticks()), (7, Some(3)), "{}", plan.explorer.describe());
        assert_eq!(everything(&Cells, &plan), everything(&Cells, &ExplorePlan { threads: 2, ..plan.clone() }));
    }
}

#[test]
fn a_game_that_does_not_replay_is_reported_at_the_first_tick_that_differs() {
    let error = refused(&Drifting, &plan("plain", 1, 5000));
    assert!(matches!(&error, ExploreError::Diverged { divergence, .. } if divergence.tick == 0), "{error}");
    let text = error.to_string();
    for words in ["level 1, tick 0", "the state hash is", "`playbot doctor corridor --mode plain --level 1`"] {
        assert!(text.contains(words), "`{words}` is missing in: {text}");
    }
}

#[test]
fn games_that_are_built_anew_for_each_episode_can_be_explored() {
    let plan = ExplorePlan { arenas: 2, until: Until::Solved, ..plan("default", 1, 1500) };
    let found = found(&stubborn_game(Restart::Rebuild), &plan);
    assert_eq!(found.stop, Stop::Solved);
    // A new episode without a new World takes more: then it does not replay.
    let plan = ExplorePlan { until: Until::Spent, ..plan };
    let error = refused(&stubborn_game(Restart::Startup), &plan);
    assert!(matches!(error, ExploreError::Diverged { .. }), "{error}");
}

#[test]
fn a_way_that_was_found_is_a_recording_that_replays() {
    let folder = tempfile::tempdir().expect("a folder");
    let found = found(&Cells, &plan("plain", 0, 2000));
    let record = |name: &str, actions: &Actions| {
        let path = folder.path().join(name);
        let writer = DemoWriter::create(&path, Cells.demo_header("plain")).expect("a fresh file");
        record_route(&Cells, "plain", 0, actions, writer).expect("sound");
        let report = verify_file(&Cells, &path, |_| {}).expect("readable");
        assert_eq!((report.episodes, &report.divergences), (1, &Vec::new()));
        DemoReader::open(&path).and_then(DemoReader::read_all).expect("sound").remove(0)
    };
    let solved = record("solution.demo", &found.solution().expect("a short way").actions);
    assert!(solved.is_success() && solved.len() == 2, "level 0 starts in cell 4");
    let way = found.route_to(&ExploredCell(vec![2])).expect("reached");
    let stopped = record("way.demo", &way.actions);
    assert_eq!((stopped.len(), stopped.is_success()), (2, false));
    assert_eq!(stopped.state_hashes, way.hashes);
    assert_eq!(stopped.state_hashes.last(), Some(&2), "the agent is in cell 2");
}

#[test]
fn a_small_maze_is_reached_as_a_whole() {
    let maze = Games::new(&GAMES).expect("each has a name of its own").get("maze2d").expect("a game");
    let plan = ExplorePlan { until: Until::Covered, ..plan("random+size=7x7", 3, 1_000_000) };
    let found = found(maze, &plan);
    let open = found.open.as_ref().expect("the maze has a floor plan");
    assert!(open.len() >= 17, "9 rooms and at least 8 ways between them, not {}", open.len());
    assert_eq!((found.stop, found.coverage()), (Stop::Covered, Some(1.0)), "missed: {:?}", found.missed().next());
    assert!(found.steps < plan.steps);
    let grid = found.grid.expect("cells are places");
    assert_eq!(grid.size, 1.0);
    let solution = found.solution().expect("a goal in reach");
    let places = follow_route(maze, "random+size=7x7", 3, &solution.actions).expect("sound");
    let goal = maze.tools().levels.floor_plan("random+size=7x7", 3).expect("a plan").goal;
    assert_eq!(places.len(), solution.len());
    assert!(places.last().is_some_and(|place| place.distance(goal) < 0.51), "{:?} is not {goal}", places.last());
}

#[test]
fn an_observer_can_stop_it_after_a_round() {
    let mut rounds = Vec::new();
    let heard = AtomicU64::new(0);
    let progress = |ticks| {
        heard.fetch_add(ticks, Ordering::Relaxed);
    };
    let stopped = explore(&Cells, &plan("plain", 1, 100_000), progress, |round| {
        rounds.push(round);
        if rounds.len() == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let stopped = stopped.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((stopped.stop, stopped.visits, rounds.len()), (Stop::Asked, 64, 2));
    assert_eq!((stopped.steps, stopped.cells().len()), (rounds[1].steps, rounds[1].cells));
    assert_eq!(heard.into_inner(), stopped.steps);
}

#[test]
fn a_stop_within_a_round_keeps_what_its_visits_have_seen() {
    let (asked, heard) = (AtomicU64::new(0), AtomicU64::new(0));
    let progress = |ticks| {
        heard.fetch_add(ticks, Ordering::Relaxed);
    };
    // The first World is in its third tick then, and the others have not begun.
    let stop = || asked.fetch_add(1, Ordering::Relaxed) >= 3;
    let plan = ExplorePlan { threads: 1, ..plan("plain", 1, 100_000) };
    let stopped = explore_until(&Cells, &plan, progress, |_| ControlFlow::Continue(()), &stop);
    let stopped = stopped.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(stopped.stop, Stop::Asked);
    assert!((1..=8).contains(&stopped.visits), "{} of 32 visits", stopped.visits);
    assert_eq!(stopped.curve, [(stopped.steps, stopped.cells().len() as u64)]);
    assert_eq!(heard.into_inner(), stopped.steps);
    for (cell, reached) in stopped.cells() {
        let route = stopped.route_to(cell).expect("reached");
        assert_eq!(route.len(), reached.ticks() as usize);
        assert_eq!(route.hashes.last().copied(), u32::try_from(cell.0[0]).ok(), "the hash is the cell");
    }
    assert!(stopped.cells().len() > 1, "{:?}", stopped.cells());
    // A stop that never comes changes nothing.
    let plan = ExplorePlan { steps: 3000, ..plan };
    let whole = explore_until(&Cells, &plan, |_| {}, |_| ControlFlow::Continue(()), &|| false);
    let whole = whole.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(format!("{:?}", whole.summary(&Cells)), format!("{:?}", found(&Cells, &plan).summary(&Cells)));
}

#[test]
fn plans_that_make_no_sense_are_refused() {
    let sound = || plan("plain", 1, 100);
    for (wrong, words) in [
        (plan("plane", 1, 100), "did you mean `plain`?"),
        (plan("plain", 1, 0), "at least one step"),
        (ExplorePlan { explore_ticks: 0, ..sound() }, "a visit one tick"),
        (ExplorePlan { batch: 0, ..sound() }, "a round one visit"),
        (ExplorePlan { sticky: 1.5, ..sound() }, "is repeated is 1.5: write a number from 0 to 1"),
        (ExplorePlan { cell_size: Some(0.0), ..sound() }, "the size of a cell is 0"),
        (ExplorePlan { cell_size: Some(f32::NAN), ..sound() }, "the size of a cell is NaN"),
    ] {
        let text = refused(&Cells, &wrong).to_string();
        assert!(text.contains(words), "`{words}` is missing in: {text}");
    }
}

/// The turn of a game in which actions take turns.
#[derive(Resource)]
struct Turn(u32);

#[test]
fn explorers_take_legal_actions_only() {
    static LEGAL: AtomicU64 = AtomicU64::new(0);
    static ILLEGAL: AtomicU64 = AtomicU64::new(0);
    let game = |app: &mut App| {
        app.insert_resource(Turn(0)).add_systems(Startup, |mut turn: ResMut<Turn>| turn.0 = 0).add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, mut turn: ResMut<Turn>| {
                let wanted = if turn.0.is_multiple_of(2) { KeyCode::KeyA } else { KeyCode::KeyB };
                // Frames in which a level loads hold no key.
                if keys.get_pressed().next().is_some() {
                    let count = if keys.pressed(wanted) { &LEGAL } else { &ILLEGAL };
                    count.fetch_add(1, Ordering::Relaxed);
                    turn.0 += 1;
                }
            },
        );
    };
    let game = ForeignGame::new("turns", 1, game)
        .keys([vec![KeyCode::KeyA], vec![KeyCode::KeyB], vec![KeyCode::KeyC]])
        .legal(|turn: Res<Turn>| [turn.0.is_multiple_of(2), !turn.0.is_multiple_of(2), false])
        .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
        .time_limit(20)
        .restart(Restart::Startup);
    found(&game, &plan("default", 0, 200));
    assert!(LEGAL.load(Ordering::Relaxed) > 50, "{LEGAL:?}");
    assert_eq!(ILLEGAL.load(Ordering::Relaxed), 0);
}
