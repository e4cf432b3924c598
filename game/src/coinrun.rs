//! CoinRun: run, jump, avoid saws, enemies and lava, reach the coin.
//!
//! The rules and the level generator reproduce Procgen's CoinRun exactly and do not depend on an engine. [`generate`]
//! makes a [`Level`] from a mode and a seed, [`Sim`] plays it. The functions in [`rules`] are the single steps of play,
//! for callers that keep the state elsewhere.
//!
//! The folder, in reading order:
//!
//! - [`tile`] and [`level`]: the grid, and a level on it; [`generator`]: levels from a mode and a seed.
//! - [`rules`]: the steps of play; [`sim`]: an episode without an engine.
//! - [`components`] and `play`: a level as entities, and the tick; [`physics`]: colliders for sensors.
//! - [`view`] and [`paths`]: what an agent observes.
//! - [`planner`] and `demonstrator_bot`: plans to the coin, and the bot that follows them; `proof`: proofs about
//!   levels.
//! - [`picture`]: what sensors and people see.
//! - [`text`] and `level_text`: levels as text, and as files and on the command line.
//! - `detectors` and `defects`: the game's own detectors, and the defects that can be planted.

pub mod components;
mod defects;
mod demonstrator_bot;
mod detectors;
pub mod generator;
pub mod level;
mod level_text;
pub mod paths;
pub mod physics;
pub mod picture;
pub mod planner;
mod play;
mod proof;
pub mod rules;
pub mod sim;
pub mod text;
pub mod tile;
pub mod view;

use crate::coinrun::{
    components::{
        ArenaBody, ArenaEntities, CoinRunMode, LastOutcome, PlayerBody, PlayerMemory, PlaysIn, Tiles, level_of,
    },
    physics::CoinRunPhysicsPlugin,
    picture::{CoinRunPicturePlugin, VIEW},
    proof::{prove, prove_from},
    rules::ACTIONS,
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
    inspect::{ExperimentText, InspectError, LevelRequest, LevelView},
    level_files::{LevelDesign, LevelTextError, is_level_files},
    prelude::*,
};
use std::sync::{Arc, LazyLock};

pub use crate::coinrun::{
    demonstrator_bot::DemonstratorBot,
    generator::generate,
    level::{GoldenLevel, Level, LevelParts, LevelSet, Mode, ProcgenLevels, Spawn},
    planner::{Demonstrator, Plan, PlannerConfig, plan},
    play::CoinRunSystems,
    rules::{Body, CoinRunEnd, PlayerState, PlayerStep},
    sim::{Sim, StepResult},
    tile::{SIZE, Tile, TileGrid},
};

/// CoinRun under its name `coinrun`.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoinRun {
    /// Adds rapier colliders to its Worlds. Training needs none.
    pub physics: bool,
}

/// The action "right and jump", the best constant action.
const RIGHT_JUMP: u32 = 8;

static SPACE: LazyLock<Arc<ObservationSpace>> = LazyLock::new(|| Arc::new(ObservationSpace { names: view::names() }));

/// Makes an arena with an idle agent, and returns the agent.
pub fn spawn_agent(world: &mut World, index: u32) -> Entity {
    let arena = world.spawn(Tiles::default()).id();
    world
        .spawn((
            Agent::new(index, ActionSpace::Discrete(usize::from(ACTIONS))),
            VectorSensor::from_space(SPACE.clone()),
            PlayerBody::default(),
            PlaysIn(arena),
            LastOutcome::default(),
        ))
        .id()
}

impl Game for CoinRun {
    fn name(&self) -> &'static str {
        "coinrun"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["easy", "hard"]
    }

    fn tick_hz(&self) -> f64 {
        15.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(usize::from(ACTIONS))
    }

    fn observation(&self) -> ObservationSpace {
        (**SPACE).clone()
    }

    fn build(&self, app: &mut App, mode: &str) {
        // Levels from files have no difficulty.
        let is_drawn = is_level_files(mode);
        let mode = if is_drawn { Ok(Mode::Hard) } else { mode.parse() };
        let mode = mode.expect("callers check the mode with `check_mode`");
        app.add_plugins(CoinRunPlugin { mode, physics: self.physics });
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

impl LevelTools for CoinRun {
    fn last_level(&self) -> Option<u64> {
        Some(u32::MAX.into())
    }

    fn layout_hash(&self, mode: &str, level: u64) -> Option<u64> {
        Some(level_of(self, mode, level).ok()?.layout_hash())
    }

    fn parse(&self, text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        Some(level_text::parse(text))
    }

    fn floor_plan(&self, mode: &str, level: u64) -> Option<FloorPlan> {
        Some(level_of(self, mode, level).ok()?.floor_plan())
    }

    fn prove(&self, mode: &str, level: u64) -> LevelProof {
        level_of(self, mode, level).map_or(LevelProof::Unknown, prove)
    }

    fn show(&self, request: &LevelRequest) -> Option<Result<LevelView, InspectError>> {
        Some(level_text::show(self, request))
    }
}

impl StateTools for CoinRun {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<PlayerBody>(agent).map(|body| Vec2::new(body.0.x, body.0.y))
    }

    fn end_cause(&self, world: &World, agent: Entity) -> Option<&'static str> {
        world.get::<LastOutcome>(agent)?.0?.cause()
    }

    fn proves_states(&self) -> bool {
        true
    }

    fn prove_from(&self, world: &World, agent: Entity) -> LevelProof {
        prove_from(world, agent)
    }
}

/// The state of an arena and its player between two ticks. Colliders follow the bodies, and are no part of it.
struct SavedArena {
    player: (PlayerBody, PlayerMemory, LastOutcome),
    tiles: Tiles,
    /// In creation order, which is the same for all arenas of a level.
    bodies: Vec<ArenaBody>,
}

impl SnapshotTools for CoinRun {
    fn save(&self, world: &World, agent: Entity) -> Option<Snapshot> {
        let arena = world.get::<PlaysIn>(agent)?.0;
        let entities = world.get::<ArenaEntities>(arena)?;
        let bodies = entities.iter().map(|entity| world.get::<ArenaBody>(entity).copied());
        Some(Snapshot::new(SavedArena {
            player: (*world.get(agent)?, *world.get(agent)?, *world.get(agent)?),
            tiles: world.get::<Tiles>(arena)?.clone(),
            bodies: bodies.collect::<Option<_>>()?,
        }))
    }

    fn load(&self, world: &mut World, agent: Entity, snapshot: &Snapshot) -> bool {
        let Some(saved) = snapshot.get::<SavedArena>() else { return false };
        let Some(arena) = world.get::<PlaysIn>(agent).map(|plays_in| plays_in.0) else { return false };
        let entities: Vec<Entity> =
            world.get::<ArenaEntities>(arena).map_or_else(Vec::new, |entities| entities.iter().collect());
        // No level is built yet, or a game on top has added bodies.
        if entities.len() != saved.bodies.len() {
            return false;
        }
        for (entity, body) in entities.into_iter().zip(&saved.bodies) {
            world.entity_mut(entity).insert(*body);
        }
        // Pictures draw tiles again if they are changed.
        if let Some(mut tiles) = world.get_mut::<Tiles>(arena)
            && *tiles != saved.tiles
        {
            tiles.clone_from(&saved.tiles);
        }
        world.entity_mut(agent).insert(saved.player);
        true
    }
}

impl TraceTools for CoinRun {
    fn columns(&self) -> Option<Vec<String>> {
        Some(["x", "y", "vx", "vy"].map(str::to_owned).to_vec())
    }

    fn row(&self, world: &World, agent: Entity) -> Vec<f32> {
        let body = world.get::<PlayerBody>(agent).map(|body| body.0).unwrap_or_default();
        vec![body.x, body.y, body.vx, body.vy]
    }
}

impl PictureTools for CoinRun {
    fn picture(&self) -> Option<Picture> {
        Some(Picture { width: VIEW, least_height: 0.0 })
    }

    fn build_picture(&self, app: &mut App) {
        app.add_plugins(CoinRunPicturePlugin);
    }
}

impl InputTools for CoinRun {
    fn action_names(&self) -> Vec<String> {
        let names = ["left+down", "left", "left+jump", "down", "none", "jump", "right+down", "right", "right+jump"];
        let unused = ["D", "A", "W", "S", "Q", "E"].map(|key| format!("none ({key})"));
        names.map(str::to_owned).into_iter().chain(unused).collect()
    }

    fn key_bindings(&self) -> Option<KeyBindings> {
        let sideways = KeyAxis::new([KeyCode::ArrowLeft, KeyCode::KeyA], [KeyCode::ArrowRight, KeyCode::KeyD]);
        let upwards =
            KeyAxis::new([KeyCode::ArrowDown, KeyCode::KeyS], [KeyCode::ArrowUp, KeyCode::KeyW, KeyCode::Space]);
        let help = "arrow keys or A, D and S run and drop, Up, W or Space jumps";
        Some(KeyBindings::new([sideways, upwards], |at| ActionValue::Discrete(directed(at[0], at[1])), help))
    }
}

impl BotTools for CoinRun {
    fn blind_bots(&self) -> Vec<(&'static str, BlindBot)> {
        vec![("right-jump", BlindBot::Constant(ActionValue::Discrete(RIGHT_JUMP))), ("random", BlindBot::Uniform)]
    }

    fn demonstrator(&self) -> Option<&'static str> {
        Some("search")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, noise: f64) {
        world.entity_mut(agent).insert(DemonstratorBot::new(noise));
    }
}

impl TestTools for CoinRun {
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        detectors::detectors()
    }

    fn defects(&self) -> Vec<DefectKind> {
        defects::defects()
    }
}

impl TrainTools for CoinRun {
    fn experiment(&self) -> Option<ExperimentText> {
        let file = playbot_assets::experiments::COINRUN;
        Some(ExperimentText { origin: file.path.into(), text: file.text.into() })
    }
}

impl BenchmarkTools for CoinRun {
    fn benchmarks(&self) -> Option<Vec<Benchmark>> {
        let mut all = vec![
            Benchmark::simulate("vector", "hard"),
            Benchmark::simulate("physics", "hard"),
            Benchmark::simulate("raster", "hard").seeing(ObservationKind::Raster),
            Benchmark::train("vector", "hard"),
            Benchmark::train("raster", "hard").seeing(ObservationKind::Raster),
        ];
        if cfg!(feature = "camera") {
            all.push(Benchmark::simulate("camera", "hard").seeing(ObservationKind::Camera));
        }
        Some(all)
    }

    fn benchmarked(&self, benchmark: &Benchmark) -> Option<&dyn Game> {
        (benchmark.case == "physics").then_some(&CoinRun { physics: true })
    }
}

/// Returns the action with these directions, each -1, 0 or 1.
fn directed(sideways: i8, upwards: i8) -> u32 {
    (3 * (sideways + 1) + (upwards + 1)).unsigned_abs().into()
}

/// Adds the rules of CoinRun. Agents are made by [`spawn_agent`].
#[derive(Clone, Copy, Debug)]
pub struct CoinRunPlugin {
    /// Difficulty of the generated levels.
    pub mode: Mode,
    /// Adds rapier colliders to bodies; see [`CoinRunPhysicsPlugin`].
    pub physics: bool,
}

impl Default for CoinRunPlugin {
    fn default() -> Self {
        Self { mode: Mode::Hard, physics: true }
    }
}

impl Plugin for CoinRunPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(CoinRunMode(self.mode))
            .add_observer(components::start_episode)
            .add_observer(demonstrator_bot::start_episode)
            .add_systems(ObserveSchedule, play::observe.before(VisionSystems::Sync))
            .add_systems(
                FixedPreUpdate,
                (
                    // Each agent has one decider, so the order of deciders of different agents does not matter.
                    demonstrator_bot::decide.in_set(PlaybotSystems::Decide).ambiguous_with(PlaybotSystems::Decide),
                    demonstrator_bot::follow.after(PlaybotSystems::Act),
                ),
            )
            .add_systems(FixedUpdate, play::play.in_set(CoinRunSystems));
        if self.physics {
            app.add_plugins(CoinRunPhysicsPlugin);
        }
    }
}
