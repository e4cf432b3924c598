//! What the plugin needs to know of a game in order to build it headless, many arenas at a time.

use bevy::{app::PluginGroupBuilder, prelude::*};
use thiserror::Error;

use crate::{
    action::{ActionSpace, has_no_actions},
    agent::AgentLimit,
    bot::BlindBot,
    demo::{file::DemoHeader, recorder},
    fault::Faults,
    floor_plan::FloorPlan,
    headless,
    headless_plugins::HeadlessPlugins,
    key_bindings::KeyBindings,
    mode::ModeError,
    observation::ObservationSpace,
    panics::{EpisodeTrace, PanicReports},
    placement::TickPlacement,
    vision::{Picture, Sight, VisionError},
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

    /// Checks that there is such a mode: one of [`modes`](Self::modes), unless the game reads options behind the name.
    ///
    /// # Errors
    ///
    /// [`ModeError`] with what is valid.
    fn check_mode(&self, mode: &str) -> Result<(), ModeError> {
        let valid = self.modes();
        if valid.contains(&mode) { Ok(()) } else { Err(UnknownName::new("mode", mode, valid).into()) }
    }

    /// The family of a mode: in all modes of a family one seed draws the same level or a related one, so that whoever has
    /// learned it has seen it for all of them. The mode itself, unless the game reads options that change rules only.
    fn family(&self, mode: &str) -> String {
        mode.to_owned()
    }

    /// A hash of the places of a level, where different seeds may happen to draw the same ones. `None` where they cannot, or
    /// where the places are the mode's own.
    fn fingerprint(&self, _mode: &str, _level: u64) -> Option<u64> {
        None
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
    /// game spawns, brought up to date in [`VisionSystems::Dress`](crate::vision::VisionSystems::Dress). Needs a
    /// [`picture`](Self::picture).
    fn build_picture(&self, _app: &mut App) {}

    /// Adds the game's plugins to a headless app, in a mode that [`check_mode`](Self::check_mode) takes.
    fn build(&self, app: &mut App, mode: &str);

    /// Adds one arena with one agent, which must carry [`Agent`](crate::agent::Agent) with this number and its sensor,
    /// under [`Control::Idle`](crate::control::Control::Idle).
    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity;

    /// A level from above, for pictures of where agents went; `None` if it has no such picture.
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        None
    }

    /// Where an agent is on its [`floor_plan`](Self::floor_plan); `None` where there is no plan, or no level is played.
    fn whereabouts(&self, _world: &World, _agent: Entity) -> Option<Vec2> {
        None
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
    fn arm_demonstrator(&self, _world: &mut World, _agent: Entity, _noise: f64) {}
}

/// The name is none of those that exist.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("unknown {what} `{name}`{}; {}", hint(.near), choice(.valid))]
pub struct UnknownName {
    /// What was named: `game`, `mode`, `method`.
    pub what: &'static str,
    /// The name that was given.
    pub name: String,
    /// The valid name nearest to it.
    pub near: Option<String>,
    /// All valid names.
    pub valid: Vec<String>,
}

fn hint(near: &Option<String>) -> String {
    near.as_ref().map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"))
}

fn choice(valid: &[String]) -> String {
    if valid.is_empty() { "there is none here".to_owned() } else { format!("valid: {}", valid.join(", ")) }
}

impl UnknownName {
    /// The error for `name`, which is not among `valid`.
    pub fn new(what: &'static str, name: &str, valid: &[&str]) -> Self {
        Self {
            what,
            name: name.to_owned(),
            near: nearest(name, valid).map(str::to_owned),
            valid: valid.iter().map(|name| (*name).to_owned()).collect(),
        }
    }
}

/// The candidate most like `name`, if one is like it at all.
pub fn nearest<'a>(name: &str, candidates: &[&'a str]) -> Option<&'a str> {
    candidates
        .iter()
        .map(|candidate| (strsim::jaro_winkler(name, candidate), *candidate))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// A World of a game with agents `first..first + count`, all idle, ready to be ticked on any thread. They see vectors.
///
/// Returns the World and its agents in the order of their numbers.
pub fn build_world(game: &dyn Game, mode: &str, seed: u64, first: u32, count: u32) -> (World, Vec<Entity>) {
    build_seeing_world(game, mode, &Sight::default(), seed, first, count).expect("nothing can be wrong with a vector")
}

/// [`build_world`] with agents that see vectors or pictures.
///
/// # Errors
///
/// The pictures cannot be made: see [`VisionError`].
pub fn build_seeing_world(
    game: &dyn Game,
    mode: &str,
    sight: &Sight,
    seed: u64,
    first: u32,
    count: u32,
) -> Result<(World, Vec<Entity>), VisionError> {
    sight.check(game)?;
    let mut app = match game.placement() {
        TickPlacement::Fixed => {
            let mut app = headless::headless_app();
            headless::set_tick_rate(&mut app, game.tick_hz());
            app
        }
        TickPlacement::Frame => {
            headless::headless_frame_app(game.headless_plugins(sight.headless_plugins()), game.tick_hz())
        }
    };
    furnish_app(game, &mut app, mode, sight, seed)?;
    let header =
        DemoHeader::new(game.name(), game.version(), mode, game.tick_hz(), recorder::demo_actions(&game.actions()));
    PanicReports::new(header, std::env::temp_dir()).add_to(&mut app);
    let mut world = headless::into_world(app);
    let agents = spawn_agents(game, &mut world, sight, first, count);
    for &agent in &agents {
        world.entity_mut(agent).insert(EpisodeTrace::default());
    }
    Ok((world, agents))
}

/// Adds a game and the sensors of its agents to an app that has the [`PlaybotPlugin`](crate::plugin::PlaybotPlugin),
/// with a window or without.
///
/// # Errors
///
/// The pictures cannot be made: see [`VisionError`].
pub fn furnish_app(game: &dyn Game, app: &mut App, mode: &str, sight: &Sight, seed: u64) -> Result<(), VisionError> {
    app.insert_resource(crate::policy::PlaybotSeed(seed));
    if let Some(most) = game.arenas_per_world() {
        app.insert_resource(AgentLimit { game: game.name(), most });
    }
    if let (Some(problem), Some(mut faults)) = (game.problem(), app.world_mut().get_resource_mut::<Faults>()) {
        faults.report(problem);
    }
    game.build(app, mode);
    sight.build(game, app)
}

/// Adds agents `first..first + count` with their sensors, all idle, and returns them in the order of their numbers.
pub fn spawn_agents(game: &dyn Game, world: &mut World, sight: &Sight, first: u32, count: u32) -> Vec<Entity> {
    let agents: Vec<_> = (first..first + count).map(|index| game.spawn_agent(world, index)).collect();
    for &agent in &agents {
        sight.equip(game, world, agent);
    }
    agents
}
