//! Maze2D: push a ball through a maze to the goal. D4RL's `pointmaze`, and generated mazes.
//!
//! [`ball`], [`walls`] and [`sim`] are the rules, without an engine. With [`ContactModel::Soft`] they reproduce the
//! original (MuJoCo 3.1.6) to within rounding; with [`ContactModel::Rapier`] rapier2d solves the contacts ([`physics`]). A
//! [`Maze2dMode`] names the map and the rules in which the paper and D4RL differ; a [`Maze2dLevel`] is made from it and
//! a seed. [`Maze2dWithRays`] is the same game with rays to the walls and the direction of the goal, [`Maze2dWithMap`]
//! with a map, and [`Maze2dWithPositionalEncoding`] with positional encoding.
//!
//! The folder, in reading order:
//!
//! - [`ball`], [`walls`] and [`sim`]: the rules; [`physics`]: rapier's contacts.
//! - [`mode`] and [`level`]: the map with its options, and a level of it; `level_text`: level files.
//! - [`arena`]: a level as entities, and the tick; [`senses`]: more observations.
//! - [`picture`]: what sensors and people see.
//! - [`demonstrator`]: the bot; `trace`: the ball under given pushes.
//! - `against_rules`: a detector; `defects`: the defects that can be planted.

mod against_rules;
pub mod arena;
pub mod ball;
mod defects;
pub mod demonstrator;
pub mod level;
mod level_text;
pub mod mode;
pub mod physics;
pub mod picture;
pub mod senses;
pub mod sim;
mod trace;
pub mod walls;

use crate::{
    maze::{
        Map, MazeSpec,
        planner::prove,
        read_mode, show_level,
        show_level::{MazeSource, ShownMaze, unfit},
    },
    maze2d::{
        against_rules::AgainstRules,
        arena::{Maze2dRules, MazeArena, MazeBall, OBSERVED, PlaysIn, WithPhysics, drawn, level_of},
        level_text::LevelText,
        picture::{Maze2dPicturePlugin, VIEW, point},
    },
    senses::{WithMap, WithObservations, WithPositionalEncoding, WithRays},
};
use bevy::prelude::*;
use bevy_playbot::vision::{ObservationKind, Picture, VisionSystems};
use playbot_harness::{
    benchmark::Benchmark,
    defect::DefectKind,
    detector::{Detector, LevelProof},
    floor_plan::FloorPlan,
    game::{
        BenchmarkTools, BotTools, InputTools, LevelTools, PictureTools, Snapshot, SnapshotTools, StateTools, TestTools,
        TraceTools, TrainTools,
    },
    inspect::{ExperimentText, InspectError, LevelRequest, LevelView, Print, TraceRequest},
    level_files::{LevelDesign, LevelDesigns, LevelTextError, is_level_files},
    mode::ModeError,
    prelude::*,
};
use playbot_test::detectors::{FarGoal, GoalIgnored, ThroughWall};
use std::sync::{Arc, LazyLock};

pub use crate::maze2d::{
    ball::Ball,
    demonstrator::{Demonstrator, DemonstratorBot},
    level::Maze2dLevel,
    mode::{ContactModel, Maze2dMode},
    senses::{Maze2dWithMap, Maze2dWithPositionalEncoding, Maze2dWithRays},
};

/// Maze2D under its name `maze2d`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Maze2d {
    /// Adds a rapier context to arenas even where the contact does not need it. Training needs none.
    pub physics: bool,
}

/// Axes of the push.
const AXES: usize = 2;

static SPACE: LazyLock<Arc<ObservationSpace>> =
    LazyLock::new(|| Arc::new(ObservationSpace { names: OBSERVED.map(str::to_owned).to_vec() }));

/// Makes an arena with an idle agent, and returns the agent.
pub fn spawn_agent(world: &mut World, index: u32) -> Entity {
    let arena = world.spawn_empty().id();
    world
        .spawn((
            Agent::new(index, ActionSpace::Continuous(AXES)),
            VectorSensor::from_space(SPACE.clone()),
            MazeBall::default(),
            PlaysIn(arena),
        ))
        .id()
}

impl Game for Maze2d {
    fn name(&self) -> &'static str {
        "maze2d"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &Maze2dMode::NAMES
    }

    fn tick_hz(&self) -> f64 {
        100.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Continuous(AXES)
    }

    fn observation(&self) -> ObservationSpace {
        (**SPACE).clone()
    }

    fn build(&self, app: &mut App, mode: &str) {
        // Levels from files bring their rules.
        let is_drawn = is_level_files(mode);
        let mode = if is_drawn { Ok(Maze2dMode::new(Map::Random(MazeSpec::default()))) } else { mode.parse() };
        let mode = mode.expect("callers check the mode with `check_mode`");
        app.add_plugins(Maze2dPlugin { mode, physics: self.physics });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        spawn_agent(world, index)
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools {
            levels: self,
            state: self,
            snapshots: self,
            trace: self,
            pictures: self,
            input: self,
            bots: self,
            tests: self,
            training: self,
            benchmarks: self,
            ..GameTools::default()
        }
    }
}

impl LevelTools for Maze2d {
    fn check_options(&self, mode: &str) -> Option<Result<(), ModeError>> {
        Some(read_mode::<Maze2dMode>(mode).map(drop))
    }

    fn family(&self, mode: &str) -> String {
        let Ok(mode) = mode.parse::<Maze2dMode>() else { return mode.to_owned() };
        mode.map.family().unwrap_or_else(|| mode.to_string())
    }

    fn layout_hash(&self, mode: &str, level: u64) -> Option<u64> {
        mode.parse::<Maze2dMode>().ok()?.map.fingerprint(level)
    }

    fn parse(&self, text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        Some(level_text::parse(text))
    }

    fn floor_plan(&self, mode: &str, level: u64) -> Option<FloorPlan> {
        Some(level_of(self, mode, level).ok()?.0.floor_plan())
    }

    fn prove(&self, mode: &str, level: u64) -> LevelProof {
        let level = level_of(self, mode, level);
        level.map_or(LevelProof::Unknown, |(level, _)| prove(&level.maze, level.start_cell, level.goal_cell))
    }

    fn show(&self, request: &LevelRequest) -> Option<Result<LevelView, InspectError>> {
        let axes = "x goes down the rows and y along the columns; plots have x to the right and y up, a quarter turn from here";
        let source = MazeSource { map: Map::maze2d, level: shown_level, drawn: shown_drawn, axes };
        Some(show_level::show(self, request, &source))
    }
}

impl StateTools for Maze2d {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<MazeBall>(agent).map(|ball| point(ball.0.position))
    }
}

/// The ball is all that moves. With rapier's contacts the solver has a state of its own, and nothing is saved.
impl SnapshotTools for Maze2d {
    fn save(&self, world: &World, agent: Entity) -> Option<Snapshot> {
        let arena = world.get::<MazeArena>(world.get::<PlaysIn>(agent)?.0)?;
        let is_saved = arena.rules.contact == ContactModel::Soft;
        world.get::<MazeBall>(agent).filter(|_| is_saved).copied().map(Snapshot::new)
    }

    fn load(&self, world: &mut World, agent: Entity, snapshot: &Snapshot) -> bool {
        let arena = world.get::<PlaysIn>(agent).map(|plays_in| plays_in.0);
        let has_level = arena.is_some_and(|arena| world.get::<MazeArena>(arena).is_some());
        let Some(ball) = snapshot.get::<MazeBall>().filter(|_| has_level) else { return false };
        world.entity_mut(agent).insert(*ball);
        true
    }
}

impl TraceTools for Maze2d {
    fn run(&self, request: &TraceRequest, print: Print) -> Option<Result<Option<String>, InspectError>> {
        Some(trace::run(self, request, print))
    }
}

impl PictureTools for Maze2d {
    fn picture(&self) -> Option<Picture> {
        Some(Picture { width: VIEW, least_height: VIEW })
    }

    fn build_picture(&self, app: &mut App) {
        app.add_plugins(Maze2dPicturePlugin);
    }
}

impl InputTools for Maze2d {
    fn action_names(&self) -> Vec<String> {
        vec!["push x (down the rows)".to_owned(), "push y (along the columns)".to_owned()]
    }

    fn key_bindings(&self) -> Option<KeyBindings> {
        // The first row of the map is at the top of the picture.
        let rows = KeyAxis::new([KeyCode::ArrowUp, KeyCode::KeyW], [KeyCode::ArrowDown, KeyCode::KeyS]);
        let columns = KeyAxis::new([KeyCode::ArrowLeft, KeyCode::KeyA], [KeyCode::ArrowRight, KeyCode::KeyD]);
        let push = |at: &[i8]| ActionValue::Continuous(at.iter().map(|&axis| axis.into()).collect());
        Some(KeyBindings::new([rows, columns], push, "arrow keys or W, A, S and D push the ball"))
    }
}

impl BotTools for Maze2d {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("waypoints")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, noise: f64) {
        world.entity_mut(agent).insert(DemonstratorBot::new(noise));
    }
}

impl TestTools for Maze2d {
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        // In tiles: the goal's radius is half a metre, and walls are as thick as a tile.
        let (ignored, far) = (GoalIgnored::within(0.45), FarGoal::beyond(0.6));
        vec![Box::new(ignored), Box::new(far), Box::new(ThroughWall::deeper_than(0.3)), Box::new(AgainstRules)]
    }

    fn defects(&self) -> Vec<DefectKind> {
        defects::defects()
    }
}

impl TrainTools for Maze2d {
    fn experiment(&self) -> Option<ExperimentText> {
        let file = playbot_assets::experiments::MAZE2D;
        Some(ExperimentText { origin: file.path.into(), text: file.text.into() })
    }
}

impl BenchmarkTools for Maze2d {
    fn benchmarks(&self) -> Option<Vec<Benchmark>> {
        Some(vec![
            Benchmark::simulate("vector", "medium"),
            Benchmark::simulate("physics", "medium"),
            Benchmark::simulate("rapier", "medium+contact=rapier"),
            Benchmark::simulate("random", "random"),
            Benchmark::simulate("sighted", "random"),
            Benchmark::simulate("mapped", "random"),
            Benchmark::simulate("placed", "medium"),
            Benchmark::simulate("raster", "medium").seeing(ObservationKind::Raster),
            Benchmark::train("vector", "medium"),
        ])
    }

    fn benchmarked(&self, benchmark: &Benchmark) -> Option<&dyn Game> {
        match benchmark.case {
            "physics" => Some(&Maze2d { physics: true }),
            "sighted" => Some(&WithObservations(Maze2d { physics: false }, WithRays)),
            "mapped" => Some(&WithObservations(Maze2d { physics: false }, WithMap)),
            "placed" => Some(&WithObservations(Maze2d { physics: false }, WithPositionalEncoding)),
            _ => None,
        }
    }
}

/// Returns a level of a mode, with its metadata.
fn shown_level(game: &dyn Game, mode: &str, seed: u64) -> Result<ShownMaze, InspectError> {
    game.check_mode(mode)?;
    let (level, rules) = level_of(game, mode, seed).map_err(InspectError::Usage)?;
    shown(&level, &rules)
}

/// Returns the level of a file, with its metadata.
fn shown_drawn(designs: &LevelDesigns) -> Result<ShownMaze, InspectError> {
    let (level, rules) = drawn(designs, 0).map_err(InspectError::Usage)?;
    shown(&level, &rules)
}

fn shown(level: &Maze2dLevel, rules: &Maze2dMode) -> Result<ShownMaze, InspectError> {
    let Maze2dLevel { maze, start_cell, goal_cell, .. } = level;
    let maze = maze.clone().with_any_ends(*start_cell, *goal_cell).map_err(unfit)?;
    Ok(ShownMaze { maze, json: serde_json::json!(LevelText::of(level, rules)) })
}

/// The tick of Maze2D, in `FixedUpdate`. Add what your game adds before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Maze2dSystems;

/// Adds the rules of Maze2D. Agents are made by [`spawn_agent`].
#[derive(Clone, Debug)]
pub struct Maze2dPlugin {
    /// Map and rules.
    pub mode: Maze2dMode,
    /// Adds a rapier context to arenas even where the contact does not need it; see
    /// [`MazePhysics`](crate::maze2d::physics::MazePhysics).
    pub physics: bool,
}

impl Maze2dPlugin {
    /// Takes a mode, and adds a physics context to every arena.
    pub fn new(mode: Maze2dMode) -> Self {
        Self { mode, physics: true }
    }
}

impl Plugin for Maze2dPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Maze2dRules(self.mode.clone()))
            .insert_resource(WithPhysics(self.physics))
            .add_observer(arena::start_episode)
            .add_systems(ObserveSchedule, arena::observe.before(VisionSystems::Sync))
            // Each agent has one decider, so the order of deciders of different agents does not matter.
            .add_systems(
                FixedPreUpdate,
                demonstrator::decide.in_set(PlaybotSystems::Decide).ambiguous_with(PlaybotSystems::Decide),
            )
            .add_systems(FixedUpdate, arena::play.in_set(Maze2dSystems));
    }
}
