//! What the plugin needs to know of a game in order to build it headless, many arenas at a time.

use std::sync::Arc;

use bevy::{app::PluginGroupBuilder, prelude::*};

mod drawn;

pub use drawn::{level_designs, read_level_designs};

use crate::{
    benchmark::Benchmark,
    defect::DefectKind,
    detector::Detector,
    experiment_text::ExperimentText,
    floor_plan::FloorPlan,
    inspect::{InspectError, LevelRequest, LevelView, Print, TraceRequest},
    level_files::{LevelDesign, LevelTextError, is_level_files},
    mode::ModeError,
    proof::LevelProof,
};
use bevy_playbot::{
    action::ActionSpace,
    agent::has_no_actions,
    bot::BlindBot,
    demo::{file::DemoHeader, recorder::demo_actions},
    headless_plugins::HeadlessPlugins,
    key_bindings::KeyBindings,
    observation::{Observation, ObservationSpace},
    placement::TickPlacement,
    policy_file::GameCard,
    unknown_name::UnknownName,
    vision::Picture,
};

/// A game that can be trained on and tested without a window.
///
/// The plugin itself knows no game: the trainer, the evaluation and the replay are handed one of these.
pub trait Game: Send + Sync {
    /// Name in files and on the command line.
    fn name(&self) -> &'static str;

    /// Version of the rules; raise it whenever an old recording would no longer replay.
    fn version(&self) -> u32;

    /// Modes, such as difficulties. At least one. Where modes take options, these are the names in front of them.
    fn modes(&self) -> &'static [&'static str];

    /// Checks that there is such a mode: one of [`modes`](Self::modes), unless the game reads options behind the name; or
    /// level files, each of which is read with [`parse_level`](Self::parse_level).
    ///
    /// # Errors
    ///
    /// [`ModeError`] with what is valid.
    fn check_mode(&self, mode: &str) -> Result<(), ModeError> {
        if is_level_files(mode) {
            read_level_designs(self, mode)?;
            return Ok(());
        }
        let valid = self.modes();
        if valid.contains(&mode) { Ok(()) } else { Err(UnknownName::new("mode", mode, valid).into()) }
    }

    /// The family of a mode: in all modes of a family one seed draws the same level or a related one, so that whoever has
    /// learned it has seen it for all of them. The mode itself, unless the game reads options that change rules only.
    fn family(&self, mode: &str) -> String {
        mode.to_owned()
    }

    /// The largest number that a level which the game draws itself can have, in any mode; `None` where every number is one.
    fn last_level(&self) -> Option<u64> {
        None
    }

    /// A hash of the places of a level, where different seeds may happen to draw the same ones. `None` where they cannot, or
    /// where the places are the mode's own. Of a level file it is the hash of the level in it.
    fn fingerprint(&self, mode: &str, level: u64) -> Option<u64> {
        if !is_level_files(mode) {
            return None;
        }
        level_designs(self, mode).ok()?.hash(level)
    }

    /// Reads a level that somebody drew, in the game's own format. Worlds of level files have what was read as the resource
    /// [`LevelDesigns`](crate::level_files::LevelDesigns) before the game is built, and the game plays level number i of it
    /// instead of making one.
    ///
    /// # Errors
    ///
    /// It is no level of the game: what is wrong, and on which line. By default the game has no level files.
    fn parse_level(&self, _text: &str) -> Result<LevelDesign, LevelTextError> {
        Err(LevelTextError::whole(format!("`{}` has no level files: name one of its modes", self.name())))
    }

    /// Ticks per second of game time.
    fn tick_hz(&self) -> f64;

    /// What a tick is made of. Under [`TickPlacement::Frame`] the game is built into a World with
    /// [`HeadlessPlugins`], as [`headless_plugins`](Self::headless_plugins) has them; else into one with time and nothing
    /// more.
    fn placement(&self) -> TickPlacement {
        TickPlacement::Fixed
    }

    /// Bevy's plugins for a headless World under [`TickPlacement::Frame`]: the usual ones, unless the game leaves some
    /// out.
    fn headless_plugins(&self, usual: HeadlessPlugins) -> PluginGroupBuilder {
        usual.build()
    }

    /// Most arenas that one World can hold: 1 for a game with one player or with global resources. `None` for any
    /// number. Whoever plays many arenas at a time builds more Worlds instead; one agent more is a fault.
    fn arenas_per_world(&self) -> Option<u32> {
        None
    }

    /// The game again, if its Worlds are to be built anew for each episode, since it keeps state that nobody can set back.
    /// `None` for a game that restarts in the World it has.
    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        None
    }

    /// What is wrong with the game, so that it cannot be played at all.
    fn problem(&self) -> Option<String> {
        has_no_actions(&self.actions())
            .then(|| format!("the game `{}` has no actions: say what an agent can do", self.name()))
    }

    /// Actions of every agent.
    fn actions(&self) -> ActionSpace;

    /// Names of the discrete choices, or of the dimensions of continuous actions, for people; may be empty.
    fn action_names(&self) -> Vec<String> {
        Vec::new()
    }

    /// The keys with which a person plays; `None` if nobody can.
    fn key_bindings(&self) -> Option<KeyBindings> {
        None
    }

    /// Observation of every agent.
    fn observation(&self) -> ObservationSpace;

    /// How the game is drawn for agents that see pictures; `None` if it cannot be drawn.
    fn picture(&self) -> Option<Picture> {
        None
    }

    /// Whether agents can see it through a camera of its own, without a [`picture`](Self::picture).
    fn has_camera(&self) -> bool {
        false
    }

    /// Adds what is drawn to an app, after [`build`](Self::build): sprites, tiles and transforms for everything that the
    /// game spawns, brought up to date in [`VisionSystems::Sync`](bevy_playbot::vision::VisionSystems::Sync). Needs a
    /// [`picture`](Self::picture).
    fn build_picture(&self, _app: &mut App) {}

    /// Adds the game's plugins to a headless app, in a mode that [`check_mode`](Self::check_mode) takes.
    fn build(&self, app: &mut App, mode: &str);

    /// Adds one arena with one agent, which must carry [`Agent`](bevy_playbot::agent::Agent) with this number and its sensor,
    /// under [`Control::Idle`](bevy_playbot::control::Control::Idle).
    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity;

    /// A level from above, for pictures of where agents went; `None` if it has no such picture.
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        None
    }

    /// Where an agent is on its [`floor_plan`](Self::floor_plan); `None` where there is no plan, or no level is played.
    fn whereabouts(&self, _world: &World, _agent: Entity) -> Option<Vec2> {
        None
    }

    /// Why the episode of an agent has just ended without the aim, for people, such as `saw` or `lava`: asked after its last
    /// tick, before another one begins. By default nothing is said.
    fn end_cause(&self, _world: &World, _agent: Entity) -> Option<&'static str> {
        None
    }

    /// The state of an agent in a few whole numbers, for an explorer to whom states with the same numbers are the same: see
    /// [`explore`](crate::explore). `None`, by default, for squares of the grid in which it [is](Self::whereabouts), or where
    /// that is not known, for its observation, downscaled.
    fn explore_cell(&self, _world: &World, _agent: Entity) -> Option<Vec<i32>> {
        None
    }

    /// What is known for certain of a level: whether its aim can be reached at all. Asked of levels that no bot has solved,
    /// so it may take some milliseconds. Only what a search to its end has shown is a proof; a search that gave up has
    /// shown nothing. By default nothing is known.
    fn prove(&self, _mode: &str, _level: u64) -> LevelProof {
        LevelProof::Unknown
    }

    /// What is known for certain of the state of an agent that plays: whether its aim can still be reached. Asked now and
    /// then during an episode, so it takes a millisecond at most. By default nothing is known.
    fn prove_from(&self, _world: &World, _agent: Entity) -> LevelProof {
        LevelProof::Unknown
    }

    /// The game's own detectors, which look for defects in tests beside [those that all games have](crate::detectors). One
    /// with the name of another takes its place.
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        Vec::new()
    }

    /// Defects that can be planted into this game, beside [those of all games](crate::bugs). One with the class of another
    /// takes its place.
    fn defects(&self) -> Vec<DefectKind> {
        Vec::new()
    }

    /// Bots that every learner is compared with, by name.
    fn blind_bots(&self) -> Vec<(&'static str, BlindBot)> {
        vec![("random", BlindBot::Uniform)]
    }

    /// The seeing bot that demonstrates the game, if there is one: its name.
    fn demonstrator(&self) -> Option<&'static str> {
        None
    }

    /// Hands an agent over to the demonstrator. `noise` is the probability with which a discrete action is replaced by a
    /// uniformly random one, or the standard deviation of the normal noise on each value of a continuous one.
    fn attach_demonstrator(&self, _world: &mut World, _agent: Entity, _noise: f64) {}

    /// The experiment of the game that serves where none is named; `None` for the plainest one, see
    /// [`default_experiment`](crate::train::default_experiment::default_experiment).
    fn experiment(&self) -> Option<ExperimentText> {
        None
    }

    /// What is measured of it when its speed is; by default random actions and PPO, on state vectors, in its first mode.
    fn benchmarks(&self) -> Vec<Benchmark> {
        let modes = self.modes().first();
        modes.map_or_else(Vec::new, |mode| vec![Benchmark::simulate("vector", mode), Benchmark::train("vector", mode)])
    }

    /// Another game that is played for one of its [`benchmarks`](Self::benchmarks), such as the same one with physics;
    /// `None` for itself.
    fn benchmarked(&self, _benchmark: &Benchmark) -> Option<&dyn Game> {
        None
    }

    /// Shows a level.
    ///
    /// # Errors
    ///
    /// There is no such level, or the game cannot show any.
    fn show_level(&self, _request: &LevelRequest) -> Result<LevelView, InspectError> {
        Err(InspectError::Usage(format!("`{}` has no levels to show", self.name())))
    }

    /// Names of the numbers that a trace prints after each step; by default those of the observation.
    fn trace_columns(&self) -> Vec<String> {
        self.observation().names
    }

    /// These numbers of an agent.
    fn trace_row(&self, world: &World, agent: Entity) -> Vec<f32> {
        world.get::<Observation>(agent).map_or_else(Vec::new, |observation| observation.vector.clone())
    }

    /// The game's own way of playing given actions and printing the state after each, with what is to be said about it at
    /// the end, if anything. `None` where [`trace_actions`](crate::trace::trace_actions) does.
    fn trace(&self, _request: &TraceRequest, _print: Print) -> Option<Result<Option<String>, InspectError>> {
        None
    }

    /// Whether windows can show it in space, too.
    fn has_space_view(&self) -> bool {
        false
    }

    /// Adds the view in space to a window's app, with a [`CameraFocus`](crate::space_view::CameraFocus) on agents.
    fn build_space_view(&self, _app: &mut App) {}

    /// The head of a recording of the game in this mode.
    fn demo_header(&self, mode: &str) -> DemoHeader {
        let header = DemoHeader::new(self.name(), self.version(), mode, self.tick_hz(), demo_actions(&self.actions()));
        if is_level_files(mode) { header.with_level_files() } else { header }
    }

    /// What the game says of itself to policy files.
    fn card(&self) -> GameCard<'_> {
        GameCard {
            name: self.name(),
            version: self.version(),
            observations: self.observation().names,
            actions: self.actions(),
            action_names: self.action_names(),
            has_picture: self.picture().is_some() || self.has_camera(),
        }
    }
}
