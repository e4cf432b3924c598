//! The contract of a game: what every game has, and the optional tools that it can bring along.
//!
//! [`Game`] has what a game needs in order to be built headless and played by bots. [`GameTools`] has everything beyond
//! that, in groups that are traits of their own. Examples are level files and floor plans ([`LevelTools`]), pictures
//! ([`PictureTools`]) and bots ([`BotTools`]). A game implements the groups it has something for and names them in
//! [`Game::tools`]:
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_harness::{game::{BotTools, GameTools}, prelude::*};
//!
//! struct Coin;
//!
//! impl Game for Coin {
//!     fn name(&self) -> &'static str { "coin" }
//!     fn version(&self) -> u32 { 1 }
//!     fn modes(&self) -> &'static [&'static str] { &["default"] }
//!     fn tick_hz(&self) -> f64 { 60.0 }
//!     fn actions(&self) -> ActionSpace { ActionSpace::Discrete(2) }
//!     fn observation(&self) -> ObservationSpace { ObservationSpace { names: vec!["side".into()] } }
//!     fn build(&self, _app: &mut App, _mode: &str) {}
//!     fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
//!         world.spawn((Agent::new(index, self.actions()), VectorSensor::new(["side"]))).id()
//!     }
//!     fn tools(&self) -> GameTools<'_> {
//!         GameTools { bots: self, ..GameTools::default() }
//!     }
//! }
//!
//! impl BotTools for Coin {
//!     fn demonstrator(&self) -> Option<&'static str> {
//!         Some("tosser")
//!     }
//! }
//!
//! assert_eq!(Coin.tools().bots.demonstrator(), Some("tosser"));
//! assert!(Coin.tools().levels.floor_plan("default", 0).is_none());
//! ```
//!
//! A game that wraps another one copies its tools and replaces the groups in which it differs:
//! `GameTools { benchmarks: self, ..self.0.tools() }`.

use crate::{
    benchmark::Benchmark,
    defect::DefectKind,
    detector::{Detector, LevelProof},
    floor_plan::FloorPlan,
    inspect::{ExperimentText, InspectError, LevelRequest, LevelView, Print, TraceRequest},
    level_files::{LevelDesign, LevelDesigns, LevelFileError, LevelTextError, is_level_files, read::Parse},
    mode::ModeError,
};
use bevy::{app::PluginGroupBuilder, prelude::*};
use bevy_playbot::{
    action::{ActionSpace, ActionValue, MixedSpace},
    bot::BlindBot,
    demo::file::DemoHeader,
    engine::{GameCall, has_no_actions},
    headless::HeadlessPlugins,
    key_bindings::KeyBindings,
    observation::{Observation, ObservationSpace},
    placement::TickPlacement,
    policy_file::GameMetadata,
    state_hash::StateHash,
    unknown_name::UnknownName,
    vision::Picture,
};
use std::{any::Any, sync::Arc};

/// Words that begin the names of actions that do nothing.
const IDLE_WORDS: [&str; 8] = ["none", "nothing", "noop", "no-op", "idle", "stay", "wait", "stand"];

/// A game that can be trained on and tested without a window.
///
/// The first eight methods describe the game. [`aliases`](Self::aliases) and [`tools`](Self::tools) name what it has
/// beyond that, and [`built_anew`](Self::built_anew) copies a game that cannot be reset. The others follow from these:
/// a game leaves them as they are.
pub trait Game: Send + Sync {
    /// Returns the name in files and on the command line.
    fn name(&self) -> &'static str;

    /// Returns the version of the rules; raise it whenever an old recording would no longer replay.
    fn version(&self) -> u32;

    /// Returns the modes, such as difficulties: at least one. Where modes take options, these are the names in front of
    /// them.
    fn modes(&self) -> &'static [&'static str];

    /// Returns the ticks per second of game time.
    fn tick_hz(&self) -> f64;

    /// Returns the actions of every agent.
    fn actions(&self) -> ActionSpace;

    /// Returns the observation of every agent.
    fn observation(&self) -> ObservationSpace;

    /// Adds the game's plugins to a headless app, in a mode that [`check_mode`](Self::check_mode) accepts.
    fn build(&self, app: &mut App, mode: &str);

    /// Adds one arena with one agent, which must carry [`Agent`](bevy_playbot::agent::Agent) with this number and its
    /// sensor, under [`Control::Idle`](bevy_playbot::agent::Control::Idle).
    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity;

    /// Returns other names that the command line and experiments accept. Files keep [`name`](Self::name).
    fn aliases(&self) -> &'static [&'static str] {
        &[]
    }

    /// Returns the optional part of the game; by default nothing.
    fn tools(&self) -> GameTools<'_> {
        GameTools::default()
    }

    /// Returns the game again, if its Worlds must be built anew for each episode, because it keeps state that cannot be
    /// reset. Returns `None` for a game that restarts in the World it has.
    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        None
    }

    /// Checks that there is such a mode. It is one of [`modes`](Self::modes), or a mode with options that
    /// [`LevelTools::check_options`] accepts. Or it names level files, each of which [`parse_level`](Self::parse_level)
    /// can read.
    ///
    /// # Errors
    ///
    /// [`ModeError`] with what is valid.
    fn check_mode(&self, mode: &str) -> Result<(), ModeError> {
        if is_level_files(mode) {
            read_level_designs(self, mode)?;
            return Ok(());
        }
        self.tools().levels.check_options(mode).unwrap_or_else(|| {
            let valid = self.modes();
            if valid.contains(&mode) { Ok(()) } else { Err(UnknownName::new("mode", mode, valid).into()) }
        })
    }

    /// Reads a level that somebody drew, in the game's own format, with [`LevelTools::parse`].
    ///
    /// # Errors
    ///
    /// The text is no level of the game: what is wrong, and on which line. Or the game has no level files.
    fn parse_level(&self, text: &str) -> Result<LevelDesign, LevelTextError> {
        self.tools().levels.parse(text).unwrap_or_else(|| {
            Err(LevelTextError::whole(format!("`{}` has no level files: name one of its modes", self.name())))
        })
    }

    /// Returns a hash of the layout of a level, by which equal levels under different numbers are found:
    /// [`LevelTools::layout_hash`]. For a level file it is that of the level in it, or the hash of its content if the
    /// game does not compute any.
    fn layout(&self, mode: &str, level: u64) -> Option<u64> {
        if is_level_files(mode) {
            return level_designs(self, mode).ok()?.layout(level);
        }
        self.tools().levels.layout_hash(mode, level)
    }

    /// Shows a level with [`LevelTools::show`].
    ///
    /// # Errors
    ///
    /// There is no such level, or the game cannot show any.
    fn show_level(&self, request: &LevelRequest) -> Result<LevelView, InspectError> {
        self.tools()
            .levels
            .show(request)
            .unwrap_or_else(|| Err(InspectError::Usage(format!("`{}` has no levels to show", self.name()))))
    }

    /// Returns the reason that the game cannot be played at all, if there is one: [`HostTools::unplayable`], or that it
    /// has no actions.
    fn problem(&self) -> Option<String> {
        self.tools().host.unplayable().or_else(|| {
            has_no_actions(&self.actions())
                .then(|| format!("the game `{}` has no actions: say what an agent can do", self.name()))
        })
    }

    /// Builds the head of a recording of the game in this mode.
    fn demo_header(&self, mode: &str) -> DemoHeader {
        let header = DemoHeader::new(self.name(), self.version(), mode, self.tick_hz(), self.actions());
        if is_level_files(mode) { header.with_level_files() } else { header }
    }

    /// Builds the metadata of the game for policy files.
    fn metadata(&self) -> GameMetadata<'_> {
        let GameTools { input, pictures, .. } = self.tools();
        GameMetadata {
            name: self.name(),
            version: self.version(),
            observations: self.observation().names,
            actions: self.actions(),
            action_names: input.action_names(),
            has_picture: pictures.picture().is_some() || pictures.has_camera(),
        }
    }
}

/// The optional part of a game, in groups. By default each group is the one of a game that has nothing of the kind.
///
/// It holds references only: [`Game::tools`] is cheap enough to be called in every tick.
#[derive(Clone, Copy)]
pub struct GameTools<'a> {
    /// Set-up of Worlds.
    pub host: &'a dyn HostTools,
    /// Levels without agents: modes with options, files, floor plans, proofs.
    pub levels: &'a dyn LevelTools,
    /// The state of an agent that plays.
    pub state: &'a dyn StateTools,
    /// Episodes that are saved in the middle.
    pub snapshots: &'a dyn SnapshotTools,
    /// Steps as lines of numbers.
    pub trace: &'a dyn TraceTools,
    /// Pictures for agents and windows.
    pub pictures: &'a dyn PictureTools,
    /// Actions for people.
    pub input: &'a dyn InputTools,
    /// Bots that come with the game.
    pub bots: &'a dyn BotTools,
    /// Detectors and planted defects.
    pub tests: &'a dyn TestTools,
    /// The experiment that is the default.
    pub training: &'a dyn TrainTools,
    /// Measurements of speed.
    pub benchmarks: &'a dyn BenchmarkTools,
}

/// No tools: all groups with their defaults.
struct NoTools;

impl HostTools for NoTools {}

impl LevelTools for NoTools {}

impl StateTools for NoTools {}

impl SnapshotTools for NoTools {}

impl TraceTools for NoTools {}

impl PictureTools for NoTools {}

impl InputTools for NoTools {}

impl BotTools for NoTools {}

impl TestTools for NoTools {}

impl TrainTools for NoTools {}

impl BenchmarkTools for NoTools {}

impl Default for GameTools<'_> {
    fn default() -> Self {
        Self {
            host: &NoTools,
            levels: &NoTools,
            state: &NoTools,
            snapshots: &NoTools,
            trace: &NoTools,
            pictures: &NoTools,
            input: &NoTools,
            bots: &NoTools,
            tests: &NoTools,
            training: &NoTools,
            benchmarks: &NoTools,
        }
    }
}

/// Set-up of the Worlds of a game.
pub trait HostTools: Send + Sync {
    /// Returns the place in the schedule where ticks run. Under [`TickPlacement::Frame`] the game is built into a World
    /// with [`HeadlessPlugins`], as [`headless_plugins`](Self::headless_plugins) returns them; otherwise into one with
    /// time and nothing more.
    fn placement(&self) -> TickPlacement {
        TickPlacement::Fixed
    }

    /// Returns Bevy's plugins for a headless World under [`TickPlacement::Frame`]: all of these, unless the game leaves
    /// some out.
    fn headless_plugins(&self, plugins: HeadlessPlugins) -> PluginGroupBuilder {
        plugins.build()
    }

    /// Returns Bevy's plugins for a window under [`TickPlacement::Frame`]: these, unless the game changes some.
    fn windowed_plugins(&self, plugins: PluginGroupBuilder) -> PluginGroupBuilder {
        plugins
    }

    /// Returns the game alone, in an app without playbot whose frames are ticks, to measure what playbot adds to them. `None`
    /// if it has no such form. Nobody plays, and no episode ends.
    fn bare_app(&self) -> Option<App> {
        None
    }

    /// Returns the most arenas that one World can hold: 1 for a game with one player or with global resources. Returns
    /// `None` for any number. More arenas are spread over more Worlds; one agent too many is a fault.
    fn arenas_per_world(&self) -> Option<u32> {
        None
    }

    /// Returns the number of agents that share each arena: its level, its episode and its ticks. In a World of trainings
    /// and evaluations all of them play. Everything else plays the first one, and the others
    /// [play along](Self::add_agents_along).
    fn agents_per_arena(&self) -> u32 {
        1
    }

    /// Returns the names of the seats of an arena that several agents share, in the order in which
    /// [`spawn_agent`](Game::spawn_agent) gives them away. By default there are none, for a game of one agent.
    fn seats(&self) -> Vec<String> {
        Vec::new()
    }

    /// Returns the team of each seat, as a number: seats of one team win together. By default each seat is a team of its
    /// own.
    fn teams(&self) -> Vec<usize> {
        (0..self.seats().len()).collect()
    }

    /// Returns the game again, with its first agent on this seat, so that each seat can be played while the others
    /// [play along](Self::add_agents_along). Returns `None`, by default, for a game of one agent.
    fn seated(&self, _seat: usize) -> Option<Arc<dyn Game>> {
        None
    }

    /// Returns the seat of an agent, as a place in [`seats`](Self::seats); by default the first one.
    fn seat_of(&self, _world: &World, _agent: Entity) -> usize {
        0
    }

    /// Adds the agents that are missing in a World of fewer agents than share an arena. They play along, as
    /// [`PlaysAlong`](bevy_playbot::engine::PlaysAlong) says, in a way that depends on nothing but the level and what the
    /// others do. So a recording of the first agent replays.
    fn add_agents_along(&self, _world: &mut World) {}

    /// Returns the ticks after which episodes end, if they end then for agents without
    /// [`NoTimeLimit`](bevy_playbot::episode::NoTimeLimit) only. Limits that are rules of the game are none of these.
    fn time_limit(&self) -> Option<u32> {
        None
    }

    /// Returns the reason that the game cannot be played at all, if there is one. That it has no actions is checked for
    /// every game.
    fn unplayable(&self) -> Option<String> {
        None
    }
}

/// Asks a game for [`LevelTools::prove`]. The call is noted, so that a proof that does not return is named with its level.
pub fn prove_level(game: &dyn Game, mode: &str, level: u64) -> LevelProof {
    let _call = GameCall::begin("proving", [level]);
    game.tools().levels.prove(mode, level)
}

/// Levels without agents in them.
pub trait LevelTools: Send + Sync {
    /// Checks a mode with options behind its name. Returns `None`, by default, for a game whose modes are
    /// [`Game::modes`] as they are. Level files are no concern of it.
    fn check_options(&self, _mode: &str) -> Option<Result<(), ModeError>> {
        None
    }

    /// Returns the family of a mode: the mode itself, unless the game has options that change rules only. In all modes
    /// of a family one seed draws the same level or a related one. So an agent that has trained on the level in one
    /// mode has seen it in all of them.
    fn family(&self, mode: &str) -> String {
        mode.to_owned()
    }

    /// Returns the largest number of a level of the game's own, in any mode; `None` if every number is valid. Level files
    /// are numbered apart. Verbs refuse higher numbers, and their default levels end here.
    fn last_level(&self) -> Option<u64> {
        None
    }

    /// Returns a hash of the layout of a level that the game draws itself: of all that play meets, without pictures and
    /// without random numbers that only break ties. Returns `None`, by default, if the game does not compare its levels,
    /// or if all levels of the mode have the same layout. [`LevelDesign::with_layout`] is the same for level files.
    fn layout_hash(&self, _mode: &str, _level: u64) -> Option<u64> {
        None
    }

    /// Returns the name of a level for people, such as its identifier in a level editor. Returns `None`, by default: the
    /// level has no name but its mode and number.
    fn level_name(&self, _mode: &str, _level: u64) -> Option<String> {
        None
    }

    /// Returns the [names](Self::level_name) of all levels of a mode, in the order of their numbers from 0, for command
    /// lines that name a level. By default there is none.
    fn level_names(&self, _mode: &str) -> Vec<String> {
        Vec::new()
    }

    /// Reads a level in the game's own format, or says what is wrong with it and on which line. Returns `None`, by
    /// default: the game has no level files.
    ///
    /// Worlds of level files have the result as the resource [`LevelDesigns`] before the game is built. The game plays
    /// its level number i instead of making one.
    fn parse(&self, _text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        None
    }

    /// Reads a level from the bytes of a file, as [`parse`](Self::parse) does from its text, in a format that is not text.
    /// Returns `None`, by default: files are texts. It must be `None` for all files or for none.
    fn parse_bytes(&self, _bytes: &[u8]) -> Option<Result<LevelDesign, LevelTextError>> {
        None
    }

    /// Returns a level from above, for pictures of agents' paths; `None` if there is no such picture.
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        None
    }

    /// Returns what is certain about a level: whether its goal can be reached at all. Called for levels that no bot has
    /// solved, so it may take some milliseconds. Only a search to its end is a proof; a search that gave up proves
    /// nothing. By default nothing is proved.
    fn prove(&self, _mode: &str, _level: u64) -> LevelProof {
        LevelProof::Unknown
    }

    /// Returns a level for people and programs, or the reason that there is none. Returns `None`, by default: the game
    /// cannot show levels.
    fn show(&self, _request: &LevelRequest) -> Option<Result<LevelView, InspectError>> {
        None
    }
}

/// The likely position of an agent, by the entity that it probably is.
#[derive(Clone, Debug, PartialEq)]
pub struct GuessedPosition {
    /// The position.
    pub position: Vec2,
    /// Description of the entity, such as "the entity with `Player`".
    pub entity: String,
}

/// Readings of the state of an agent that plays.
pub trait StateTools: Send + Sync {
    /// Returns the position of an agent on the [floor plan](LevelTools::floor_plan); `None` if there is no plan, or no
    /// level is played.
    fn position(&self, _world: &World, _agent: Entity) -> Option<Vec2> {
        None
    }

    /// Returns the height of an agent in a game whose [positions](Self::position) are seen from above. Returns `None`, by
    /// default: the plan shows heights, or there are none.
    fn height(&self, _world: &World, _agent: Entity) -> Option<f32> {
        None
    }

    /// Returns the likely position of an agent in a game that does not declare [`position`](Self::position). Reports of
    /// unsolved levels use it and name the entity; detectors and explorers do not. By default nothing is guessed.
    fn guessed_position(&self, _world: &World, _agent: Entity) -> Option<GuessedPosition> {
        None
    }

    /// Returns the reason that the episode of an agent has just ended without the goal, for people, such as `saw` or
    /// `lava`. Called after its last tick, before the next episode begins.
    fn end_cause(&self, _world: &World, _agent: Entity) -> Option<&'static str> {
        None
    }

    /// Returns the state of an agent in a few whole numbers. An explorer treats states with the same numbers as the
    /// same: see `playbot_test::explore`. Returns `None`, by default, for squares of the grid by
    /// [`position`](Self::position), or, if that is not known, for the downscaled observation.
    fn explore_cell(&self, _world: &World, _agent: Entity) -> Option<Vec<i32>> {
        None
    }

    /// Returns a hash of all that is known of the state that decides how the agent's episode goes on; `None` if nothing but
    /// its observation is known. Levels are compared by it: see [`AlikeLevels`](crate::held_out::AlikeLevels). By default
    /// it is the [`StateHash`] that the game keeps.
    fn known_state(&self, world: &World, agent: Entity) -> Option<u64> {
        world.get::<StateHash>(agent).map(|hash| hash.0).filter(|hash| *hash != 0)
    }

    /// Returns whether held-out levels without a [layout hash](LevelTools::layout_hash) are compared with seen ones by
    /// [`known_state`](Self::known_state), which takes some ticks of each level. By default they are not.
    fn compares_levels(&self) -> bool {
        false
    }

    /// Returns what is certain about the state of an agent that plays: whether its goal can still be reached. Called
    /// now and then during an episode, so it takes a millisecond at most. By default nothing is proved.
    fn prove_from(&self, _world: &World, _agent: Entity) -> LevelProof {
        LevelProof::Unknown
    }

    /// Returns whether [`prove_from`](Self::prove_from) proves anything: reports name the detector `soft-lock` only then if
    /// it could not look. By default it does not.
    fn proves_states(&self) -> bool {
        false
    }
}

/// The game's state of an episode at the end of a tick, of a type that only the game knows.
///
/// It is shared: a copy costs nothing.
#[derive(Clone)]
pub struct Snapshot(Arc<dyn Any + Send + Sync>);

impl Snapshot {
    /// Keeps a state of the game.
    pub fn new<State: Any + Send + Sync>(state: State) -> Self {
        Self(Arc::new(state))
    }

    /// Returns the state; `None` if it is of another type.
    pub fn get<State: Any>(&self) -> Option<&State> {
        self.0.downcast_ref()
    }
}

/// Saving of an episode at the end of a tick, and going on from there.
///
/// An explorer then returns to a cell at once, instead of playing the path again. Save all state of the game that
/// decides how the episode goes on: after a load each tick must equal the tick of the first time to the bit. State of
/// the plugin is saved with it by [`SavedEpisode`](crate::saved_episode::SavedEpisode). The explorer compares both ways
/// of returning now and then, and does without snapshots if they differ.
pub trait SnapshotTools: Send + Sync {
    /// Returns the game's state of an agent's running episode. It must name no entities: another agent, in another
    /// World, may go on from it. Returns `None`, by default, for a game that saves nothing.
    fn save(&self, _world: &World, _agent: Entity) -> Option<Snapshot> {
        None
    }

    /// Notes that episodes of this World will be saved: see
    /// [`SavedEpisode::prepare`](crate::saved_episode::SavedEpisode::prepare). By default this does nothing.
    fn prepare(&self, _world: &mut World) {}

    /// Puts an agent into a saved state. The agent has played the same level before, to its end or not. Returns false if
    /// that is impossible, for instance because no level was built yet; the level is then started again.
    fn load(&self, _world: &mut World, _agent: Entity, _snapshot: &Snapshot) -> bool {
        false
    }

    /// Returns why nothing was saved or loaded in this World, in words; `None`, by default, if there is no reason to name.
    fn obstacle(&self, _world: &World) -> Option<String> {
        None
    }
}

/// Steps of an agent as lines of numbers: see [`trace_actions`](crate::trace::trace_actions).
pub trait TraceTools: Send + Sync {
    /// Returns the names of the numbers that a trace prints after each step. Returns `None`, by default, for the names
    /// of the observation.
    fn columns(&self) -> Option<Vec<String>> {
        None
    }

    /// Returns these numbers for an agent; by default its observation.
    fn row(&self, world: &World, agent: Entity) -> Vec<f32> {
        world.get::<Observation>(agent).map_or_else(Vec::new, |observation| observation.vector.clone())
    }

    /// Plays given actions in the game's own way, and prints the state after each. Returns a last remark, if there is
    /// one. Returns `None` where [`trace_actions`](crate::trace::trace_actions) does it.
    fn run(&self, _request: &TraceRequest, _print: Print) -> Option<Result<Option<String>, InspectError>> {
        None
    }
}

/// Pictures of a game, for agents that see them and for windows.
pub trait PictureTools: Send + Sync {
    /// Returns the drawing of the game for agents that see pictures; `None` if it cannot be drawn.
    fn picture(&self) -> Option<Picture> {
        None
    }

    /// Adds what is drawn to an app, after [`Game::build`]: sprites, tiles and transforms for everything that the game
    /// spawns, brought up to date in [`VisionSystems::Sync`](bevy_playbot::vision::VisionSystems::Sync). Needs a
    /// [`picture`](Self::picture).
    fn build_picture(&self, _app: &mut App) {}

    /// Returns true if agents can see the game through a camera of its own, without a [`picture`](Self::picture).
    fn has_camera(&self) -> bool {
        false
    }

    /// Returns true if windows can show the game in three dimensions, too.
    fn has_space_view(&self) -> bool {
        false
    }

    /// Adds the three-dimensional view to a window's app, with a [`CameraFocus`](crate::inspect::CameraFocus) on
    /// agents.
    fn build_space_view(&self, _app: &mut App) {}
}

/// Actions for people.
pub trait InputTools: Send + Sync {
    /// Returns the names of the discrete choices, or of the dimensions of continuous actions; may be empty.
    fn action_names(&self) -> Vec<String> {
        Vec::new()
    }

    /// Returns the keys with which a person plays; `None` if the game cannot be played by hand.
    fn key_bindings(&self) -> Option<KeyBindings> {
        None
    }

    /// Returns true if a person's play in a window can be recorded as actions.
    fn records_people(&self) -> bool {
        self.key_bindings().is_some()
    }

    /// Returns false if a person without any input gets action 0, since no action holds nothing.
    fn has_idle_action(&self) -> bool {
        self.key_bindings().is_none_or(|keys| keys.has_idle_action())
    }
}

/// Bots that come with a game.
pub trait BotTools: Send + Sync {
    /// Returns the bots that every learner is compared with, by name.
    fn blind_bots(&self) -> Vec<(&'static str, BlindBot)> {
        vec![("random", BlindBot::Uniform)]
    }

    /// Returns the name of the bot that demonstrates the game, if there is one.
    fn demonstrator(&self) -> Option<&'static str> {
        None
    }

    /// Hands an agent over to the demonstrator. For discrete actions, `noise` is the probability with which an action
    /// is replaced by a uniformly random one. For continuous ones, it is the standard deviation of the normal noise on
    /// each value.
    fn attach_demonstrator(&self, _world: &mut World, _agent: Entity, _noise: f64) {}

    /// Returns the reason for which the demonstrator cannot be asked for its action in states that it has not led to;
    /// `None`, by default, if it can, because it decides by the state alone, or notices that others have acted. A bot that
    /// follows a fixed plan step by step cannot be asked.
    fn cannot_be_asked(&self) -> Option<String> {
        None
    }

    /// Returns the names of further scripted bots, which test the game. They differ from all other names of bots.
    fn scripted_bots(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// Hands an agent over to one of the [`scripted_bots`](Self::scripted_bots).
    fn attach_scripted(&self, _world: &mut World, _agent: Entity, _name: &'static str) {}

    /// Takes an agent away from its demonstrator or scripted bot, before another player gets it. By default this does
    /// nothing, for bots that leave agents alone which are not under [`Control::Bot`](bevy_playbot::agent::Control::Bot).
    fn detach(&self, _world: &mut World, _agent: Entity) {}
}

/// Detectors and planted defects of a game.
pub trait TestTools: Send + Sync {
    /// Returns the game's own detectors, which look for defects in tests beside those that all games have
    /// (`playbot_test::detectors`). A detector with the name of another one takes its place.
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        Vec::new()
    }

    /// Returns the defects that can be planted into this game, beside those of all games (`playbot_mutation::bugs`). A
    /// defect with the class of another one takes its place.
    fn defects(&self) -> Vec<DefectKind> {
        Vec::new()
    }
}

/// The experiment of a game.
pub trait TrainTools: Send + Sync {
    /// Returns the experiment that is the default of the game; `None` for the plainest one, see
    /// `playbot_train::experiment::default_experiment`.
    fn experiment(&self) -> Option<ExperimentText> {
        None
    }
}

/// Measurements of a game's speed.
pub trait BenchmarkTools: Send + Sync {
    /// Returns the measurements. Returns `None`, by default, for random actions and PPO, on state vectors, in the
    /// game's first mode.
    fn benchmarks(&self) -> Option<Vec<Benchmark>> {
        None
    }

    /// Returns another game that is played for one of the [`benchmarks`](Self::benchmarks), such as the same one with
    /// physics; `None` for the game itself.
    fn benchmarked(&self, _benchmark: &Benchmark) -> Option<&dyn Game> {
        None
    }
}

/// Returns the level files of a mode, as they were when they were read last: [`LevelDesigns::of`] this game.
///
/// # Errors
///
/// The mode names no files, or one of them cannot be read or is no level of this game.
pub fn level_designs(game: &(impl Game + ?Sized), mode: &str) -> Result<LevelDesigns, LevelFileError> {
    with_parser(game, |parse| LevelDesigns::of_with(game.name(), mode, parse))
}

/// Returns the level files of a mode, as they are on disk now: [`LevelDesigns::read`] for this game.
///
/// # Errors
///
/// As for [`level_designs`].
pub fn read_level_designs(game: &(impl Game + ?Sized), mode: &str) -> Result<LevelDesigns, LevelFileError> {
    with_parser(game, |parse| LevelDesigns::read_with(game.name(), mode, parse))
}

/// Returns the level of one file as level 0, or that of standard input for the path `-`.
///
/// # Errors
///
/// As for [`level_designs`].
pub(crate) fn design_of_file(game: &(impl Game + ?Sized), path: &str) -> Result<LevelDesigns, LevelFileError> {
    with_parser(game, |parse| LevelDesigns::of_file_with(path, parse))
}

/// Calls a function with the game's parser of level files: of bytes if it has one, else of texts.
fn with_parser<Out>(game: &(impl Game + ?Sized), read: impl FnOnce(Parse) -> Out) -> Out {
    let levels = game.tools().levels;
    if levels.parse_bytes(&[]).is_none() {
        return read(Parse::Text(&|text| game.parse_level(text)));
    }
    let parse = |bytes: &[u8]| {
        let no_level = || Err(LevelTextError::whole("it is no level of the game".to_owned()));
        levels.parse_bytes(bytes).unwrap_or_else(no_level)
    };
    read(Parse::Bytes(&parse))
}

/// Returns the game's idle action: the first option with an idle name, else option 0, of each choice; zeros for numbers.
pub fn idle_action(game: &dyn Game) -> ActionValue {
    let (space, names) = (game.actions(), game.tools().input.action_names());
    let choices = space.choices();
    let idle = choices.ranges().map(|mut at| {
        let first = at.start;
        (at.find(|&option| is_named_idle(&names, option as u32)).unwrap_or(first) - first) as u32
    });
    let mut idle: Vec<u32> = idle.collect();
    match space {
        ActionSpace::Discrete(_) => ActionValue::Discrete(idle.pop().unwrap_or(0)),
        ActionSpace::Continuous(count) => ActionValue::Continuous(vec![0.0; count]),
        ActionSpace::Mixed(MixedSpace { numbers, .. }) => {
            ActionValue::Mixed { choices: idle, numbers: vec![0.0; numbers] }
        }
    }
}

/// Returns what is wrong and what to add if a person who holds no key gets an action that holds one.
pub fn without_idle_action(game: &dyn Game) -> Option<String> {
    let input = game.tools().input;
    if input.has_idle_action() {
        return None;
    }
    let (held, remedy) = match input.key_bindings() {
        Some(_) => ("hold no key", "`vec![]` to its keys"),
        None => ("do nothing", "one, such as `vec![]` in its keys"),
    };
    let first = input.action_names().into_iter().next().map_or_else(String::new, |name| format!(" ({name})"));
    Some(format!("no action of {} holds nothing: while you {held}, it gets action 0{first}; add {remedy}", game.name()))
}

/// Returns whether a discrete action, or an option of all choices counted through, does nothing, by its name.
pub fn is_named_idle(names: &[String], choice: u32) -> bool {
    let name = names.get(choice as usize).and_then(|name| name.split_whitespace().next()).unwrap_or("");
    IDLE_WORDS.contains(&name.to_lowercase().as_str())
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{App, KeyCode, MouseButton};

    use super::*;
    use crate::foreign::ForeignGame;

    #[test]
    fn names_say_what_does_nothing() {
        let keys = ForeignGame::new("keys", 1, |_: &mut App| {});
        let named = keys.clone().keys_by_name([vec!["ArrowUp"], vec![], vec!["ArrowLeft"]]);
        assert_eq!(idle_action(&named), ActionValue::Discrete(1));
        let unnamed = keys.keys_by_name([vec!["ArrowUp"], vec!["ArrowLeft"]]);
        assert_eq!(idle_action(&unnamed), ActionValue::Discrete(0));
        assert!(is_named_idle(&["None (D)".to_owned()], 0) && !is_named_idle(&[], 3));
    }

    #[test]
    fn a_game_in_which_no_action_holds_nothing_is_known_with_the_remedy() {
        let game = ForeignGame::new("hop", 1, |_: &mut App| {});
        let keys = without_idle_action(&game.clone().keys([vec![KeyCode::ArrowLeft], vec![KeyCode::Space]]));
        let words = "no action of hop holds nothing: while you hold no key, it gets action 0 (ArrowLeft); add `vec![]` to its \
                     keys";
        assert_eq!(keys.as_deref(), Some(words));
        assert_eq!(without_idle_action(&game.clone().keys([vec![], vec![KeyCode::Space]])), None);
        let mouse =
            without_idle_action(&game.mouse_buttons([[MouseButton::Left]])).expect("its only action is a button");
        assert!(
            mouse.contains("while you do nothing, it gets action 0 (MouseLeft); add one, such as `vec![]`"),
            "{mouse}"
        );
    }
}
