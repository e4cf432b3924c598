//! AntMaze: a quadruped walks through a maze to a goal that it does not see.
//!
//! The task is D4RL's, on its maps and on generated ones; the body is [`ant`](crate::ant)'s. A mode ([`AntMazeMode`])
//! and a seed make a level ([`generate`]); each agent has a physics world of its own. Episodes end at the goal or at
//! the time limit, never because the ant has fallen over. [`AntMazeWithRays`] is the same game with rays to the walls
//! and the direction of the goal, [`AntMazeWithMap`] with a map, and [`AntMazeWithPositionalEncoding`] with positional
//! encoding.
//!
//! The folder, in reading order:
//!
//! - [`mode`] and [`level`]: the map with its options, and a level of it; `level_text`: level files.
//! - [`geometry`]: conversion between cells and metres.
//! - [`arena`]: a level as entities, and the tick; [`senses`]: more observations.
//! - [`picture`]: what sensors and people see.
//! - [`demonstrator`]: the bot.
//! - `against_rules`: a detector; `defects`: the defects that can be planted.

mod against_rules;
pub mod arena;
mod defects;
pub mod demonstrator;
pub mod geometry;
pub mod level;
mod level_text;
pub mod mode;
pub mod picture;
pub mod senses;

use crate::{
    ant::{ANT_HZ, action_names, skeleton::JOINTS, view::VIEW, walk, walk::key_bindings},
    antmaze::{
        against_rules::AgainstRules,
        arena::{AntMazeRules, MazeAnt, PlaysIn, level_of},
        level_text::LevelText,
        picture::AntMazePicturePlugin,
    },
    maze::{
        Map, MazeSpec,
        planner::prove,
        read_mode, show_level,
        show_level::{MazeSource, ShownMaze, unfit},
    },
};
use bevy::prelude::*;
use bevy_playbot::vision::{ObservationKind, Picture, VisionSystems};
use playbot_harness::{
    benchmark::Benchmark,
    defect::DefectKind,
    detector::{Detector, LevelProof},
    floor_plan::FloorPlan,
    game::{BenchmarkTools, BotTools, InputTools, LevelTools, PictureTools, StateTools, TestTools, TrainTools},
    inspect::{ExperimentText, InspectError, LevelRequest, LevelView},
    level_files::{LevelDesign, LevelDesigns, LevelTextError, is_level_files},
    mode::ModeError,
    prelude::*,
};
use playbot_test::detectors::{FarGoal, GoalIgnored, ThroughWall};
use std::sync::{Arc, LazyLock};

pub use crate::antmaze::{
    demonstrator::{DemonstratorBot, Waypoints},
    geometry::wall_boxes,
    level::{AntMazeLevel, generate},
    mode::{AntMazeMode, GoalNoise, Goals, Pay},
    senses::{AntMazeWithMap, AntMazeWithPositionalEncoding, AntMazeWithRays},
};

/// AntMaze under its name `antmaze`.
#[derive(Clone, Copy, Debug, Default)]
pub struct AntMaze;

static SPACE: LazyLock<Arc<ObservationSpace>> = LazyLock::new(|| Arc::new(ObservationSpace { names: arena::names() }));

/// Makes an arena with an idle agent, and returns the agent.
pub fn spawn_agent(world: &mut World, index: u32) -> Entity {
    let arena = world.spawn_empty().id();
    world
        .spawn((
            Agent::new(index, ActionSpace::Continuous(JOINTS)),
            VectorSensor::from_space(SPACE.clone()),
            PlaysIn(arena),
        ))
        .id()
}

impl Game for AntMaze {
    fn name(&self) -> &'static str {
        "antmaze"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &Map::NAMES
    }

    fn tick_hz(&self) -> f64 {
        ANT_HZ
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Continuous(JOINTS)
    }

    fn observation(&self) -> ObservationSpace {
        (**SPACE).clone()
    }

    fn build(&self, app: &mut App, mode: &str) {
        // Levels from files bring their rules.
        let is_drawn = is_level_files(mode);
        let mode = if is_drawn { Ok(AntMazeMode::on(Map::Random(MazeSpec::default()))) } else { mode.parse() };
        let mode = mode.expect("callers check the mode with `check_mode`");
        app.add_plugins(AntMazePlugin { mode });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        spawn_agent(world, index)
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools {
            levels: self,
            state: self,
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

impl LevelTools for AntMaze {
    fn check_options(&self, mode: &str) -> Option<Result<(), ModeError>> {
        Some(read_mode::<AntMazeMode>(mode).map(drop))
    }

    fn family(&self, mode: &str) -> String {
        let Ok(mode) = mode.parse::<AntMazeMode>() else { return mode.to_owned() };
        mode.map.family().unwrap_or_else(|| mode.to_string())
    }

    fn layout_hash(&self, mode: &str, level: u64) -> Option<u64> {
        mode.parse::<AntMazeMode>().ok()?.map.fingerprint(level)
    }

    fn parse(&self, text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        Some(level_text::parse(text))
    }

    fn floor_plan(&self, mode: &str, level: u64) -> Option<FloorPlan> {
        Some(level_of(self, mode, level).ok()?.floor_plan())
    }

    fn prove(&self, mode: &str, level: u64) -> LevelProof {
        let level = level_of(self, mode, level);
        level.map_or(LevelProof::Unknown, |level| prove(&level.maze, level.start, level.goal))
    }

    fn show(&self, request: &LevelRequest) -> Option<Result<LevelView, InspectError>> {
        let axes =
            "x goes along the columns and y down the rows; plots and windows have y up, so that row 0 is at the bottom";
        let source = MazeSource { map: Map::antmaze, level: shown_level, drawn: shown_drawn, axes };
        Some(show_level::show(self, request, &source))
    }
}

impl StateTools for AntMaze {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        let [x, y, ..] = world.get::<MazeAnt>(agent)?.0.state().qpos;
        Some(Vec2::new(x, y))
    }
}

impl PictureTools for AntMaze {
    fn picture(&self) -> Option<Picture> {
        Some(Picture { width: VIEW, least_height: 0.0 })
    }

    fn build_picture(&self, app: &mut App) {
        app.add_plugins(AntMazePicturePlugin);
    }

    fn has_space_view(&self) -> bool {
        true
    }

    #[cfg(feature = "view3d")]
    fn build_space_view(&self, app: &mut App) {
        app.add_plugins(crate::ant::view::SolidViewPlugin);
    }
}

impl InputTools for AntMaze {
    fn action_names(&self) -> Vec<String> {
        action_names()
    }

    fn key_bindings(&self) -> Option<KeyBindings> {
        Some(key_bindings())
    }
}

impl BotTools for AntMaze {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("waypoints")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, noise: f64) {
        world.entity_mut(agent).insert(DemonstratorBot::new(noise));
    }
}

impl TestTools for AntMaze {
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        // In tiles: the goal's radius is half a metre, and walls are as thick as a tile.
        let (ignored, far) = (GoalIgnored::within(0.11), FarGoal::beyond(0.2));
        let walls = ThroughWall::deeper_than(0.3);
        vec![Box::new(ignored), Box::new(far), Box::new(walls), Box::<AgainstRules>::default()]
    }

    fn defects(&self) -> Vec<DefectKind> {
        defects::defects()
    }
}

impl TrainTools for AntMaze {
    fn experiment(&self) -> Option<ExperimentText> {
        let file = playbot_assets::experiments::ANTMAZE;
        Some(ExperimentText { origin: file.path.into(), text: file.text.into() })
    }
}

impl BenchmarkTools for AntMaze {
    fn benchmarks(&self) -> Option<Vec<Benchmark>> {
        let vector = Benchmark::simulate("vector", "medium");
        let training = Benchmark::train("vector", "medium");
        Some(vec![vector, training, Benchmark::simulate("raster", "medium").seeing(ObservationKind::Raster)])
    }
}

/// Returns a level of a mode, with its metadata.
fn shown_level(game: &dyn Game, mode: &str, seed: u64) -> Result<ShownMaze, InspectError> {
    game.check_mode(mode)?;
    let level = level_of(game, mode, seed).map_err(InspectError::Usage)?;
    shown(&level)
}

/// Returns the level of a file, with its metadata.
fn shown_drawn(designs: &LevelDesigns) -> Result<ShownMaze, InspectError> {
    let level = designs.get::<AntMazeLevel>(0).map_err(InspectError::Usage)?;
    shown(&level)
}

fn shown(level: &AntMazeLevel) -> Result<ShownMaze, InspectError> {
    let maze = level.maze.clone().with_any_ends(level.start, level.goal).map_err(unfit)?;
    Ok(ShownMaze { maze, json: serde_json::json!(LevelText::of(level)) })
}

/// The tick of AntMaze, in `FixedUpdate`. Add what your game adds before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AntMazeSystems;

/// Adds the rules of AntMaze. Agents are made by [`spawn_agent`].
#[derive(Clone, Debug)]
pub struct AntMazePlugin {
    /// Mode of the levels.
    pub mode: AntMazeMode,
}

impl Plugin for AntMazePlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(AntMazeRules(self.mode.clone()))
            .add_observer(arena::start_episode)
            .add_systems(ObserveSchedule, arena::observe.before(VisionSystems::Sync))
            .add_systems(
                FixedPreUpdate,
                (demonstrator::decide, walk::steer::<MazeAnt>.run_if(resource_exists::<ButtonInput<KeyCode>>))
                    .chain()
                    .after(PlaybotSystems::Decide)
                    .before(PlaybotSystems::Act),
            )
            .add_systems(FixedUpdate, arena::play.in_set(AntMazeSystems));
    }
}
