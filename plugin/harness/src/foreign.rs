//! Games that are not written for this plugin.
//!
//! A [`ForeignGame`] wraps the function that adds a game to an app, as it is, and declares the agent's actions,
//! observations and rewards. In such a game one tick is one frame of a fixed length, headless and in a window: the
//! game's own schedules run as always. The agent's action presses keys before Bevy's own input systems run; reward and
//! end are read in `Last`. A pause of the game's clock is part of the game: ticks go on.
//!
//! The files of the folder, in reading order:
//!
//! - `runtime`: the plugin's state of a foreign game in its World, and the systems of its description.
//! - `levels`: modes, level files, levels of an editor, plans and proofs.
//! - `ldtk`, `tiled`: levels of these two editors, with the features of the same names.
//! - `restart`, `clocks`: the start of an episode, and the game's clocks at that time.
//! - `input`: the path from an action into the game, the mask of actions, and the ticks that a decision and its keys
//!   hold.
//! - `agents`: several agents in one World, their inputs, and those that play along.
//! - `clicks`: clicks on buttons of Bevy's UI.
//! - `snapshot`: the state of an episode, saved and loaded.
//! - `entities`: sets of things that agents see.
//! - `observe`, `paths`, `guess`: observation, position, reward and end after a tick, observations by the paths of
//!   their values, and the position that is not declared.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_harness::{foreign::{ForeignGame, Restart}, prelude::*};
//!
//! #[derive(Component)]
//! struct Walker;
//!
//! /// The game, which is not changed.
//! fn game(app: &mut App) {
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Walker, Transform::default()));
//!     })
//!     .add_systems(Update, |keys: Res<ButtonInput<KeyCode>>, mut walker: Single<&mut Transform, With<Walker>>| {
//!         walker.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
//!     });
//! }
//!
//! fn walk() -> impl Game {
//!     ForeignGame::new("walk", 1, game)
//!         .keys([vec![], vec![KeyCode::ArrowRight]])
//!         .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
//!         .reward_delta(|walker: Single<&Transform, With<Walker>>| walker.translation.x)
//!         .end(|walker: Single<&Transform, With<Walker>>| (walker.translation.x >= 5.0).then_some(EpisodeEnd::WON))
//!         .time_limit(20)
//!         .restart(Restart::Startup)
//! }
//!
//! let (mut world, agents) = playbot_harness::worlds::build_world(&walk(), "default", 0, 0, 1);
//! let right = BlindBot::Constant(ActionValue::Discrete(1));
//! world.entity_mut(agents[0]).insert((Control::Bot, right, LevelQueue::list([7])));
//! while world.get::<Control>(agents[0]) != Some(&Control::Idle) {
//!     world.tick().expect("the game keeps its contract");
//! }
//! let count = world.get::<EpisodeCount>(agents[0]).expect("an agent");
//! assert_eq!((count.finished, count.successes), (1, 1));
//! ```

mod agents;
#[cfg(feature = "ui")]
mod clicks;
mod clocks;
mod description;
mod entities;
mod guess;
mod input;
#[cfg(feature = "ldtk")]
mod ldtk;
mod levels;
mod observe;
mod restart;
mod runtime;
mod snapshot;
#[cfg(feature = "tiled")]
mod tiled;

use crate::{
    defect::DefectKind,
    detector::Detector,
    foreign::{
        agents::{SharingAgents, add_agents_along, place_of},
        description::{Description, ForeignPlugin, nothing_seen},
        entities::problem_of,
        input::{ForeignBot, Input},
        levels::LevelParts,
        runtime::{AgentPlace, SystemFactory},
    },
    game::{BotTools, Game, GameTools, HostTools, PictureTools, TestTools},
};
use bevy::{app::PluginGroupBuilder, prelude::*};
use bevy_playbot::{
    action::ActionSpace,
    agent::Agent,
    engine::{Renewal, has_no_actions, tasks_in_order},
    headless::{HeadlessPlugins, set_frame_rate},
    legal::{DecisionPeriod, LegalActions},
    observation::{ObservationSpace, VectorSensor},
    placement::TickPlacement,
    virtual_input::{ActionAxis, VirtualInput},
};
use std::{any::TypeId, sync::Arc};

pub(crate) use crate::foreign::restart::LeftMessages;

#[cfg(feature = "ui")]
pub use crate::foreign::clicks::ButtonClicks;
#[cfg(any(feature = "ldtk", feature = "tiled"))]
pub use crate::foreign::levels::MapLegend;
pub use crate::foreign::{
    entities::IntoThings,
    guess::{PLAYER_NAMES, PlayerGuess},
    levels::{EditorLevel, IntoLevelTextError, LevelFromFile, PlayedMode},
    observe::IntoPlanPosition,
    runtime::{IntoActionValue, IntoValues, LevelSeed, PlayedAgent, Restart},
};
pub use crate::reflected_path::PathError;

/// Default number of frames that a level may take to load.
const PATIENCE: u32 = 3600;

/// A game without this plugin, with the actions, observations and rewards of its agent: see the
/// [module](self).
///
/// Its player and its resources are global, so each World has one arena, with one agent or with the
/// [`agents`](Self::agents) that play together. An experiment with more arenas gets more Worlds. Its mode is called `default`, unless it names [`modes`](Self::modes).
#[derive(Clone)]
pub struct ForeignGame {
    description: Arc<Description>,
}

impl ForeignGame {
    /// Creates a game that `plugin` adds to an app with Bevy's `DefaultPlugins`. Raise the version whenever old
    /// recordings no longer replay.
    pub fn new(name: &'static str, version: u32, plugin: impl Fn(&mut App) + Send + Sync + 'static) -> Self {
        let description = Description {
            name,
            version,
            plugin: Arc::new(plugin),
            hz: 60.0,
            modes: &["default"],
            levels: None,
            level_parts: LevelParts::default(),
            input: Input::default(),
            agents: SharingAgents::default(),
            act: None,
            legal: None,
            agent: Vec::new(),
            names: Vec::new(),
            observe: None,
            paths: Vec::new(),
            entities: Vec::new(),
            has_camera: false,
            position: None,
            cell: None,
            proof: None,
            snapshot: None,
            snapshot_parts: Vec::new(),
            rewards: Vec::new(),
            end: None,
            end_cause: None,
            limit: None,
            restart: Restart::Startup,
            forgotten: Vec::new(),
            waits_for_tasks: false,
            ready: None,
            patience: PATIENCE,
            level: None,
            loaded: None,
            demonstrator: None,
            cannot_be_asked: None,
            bots: Vec::new(),
            hash: None,
            default_plugins: None,
            headless_plugins: None,
            detectors: Vec::new(),
            defects: Vec::new(),
        };
        Self { description: Arc::new(description) }
    }

    fn with(mut self, change: impl FnOnce(&mut Description)) -> Self {
        change(Arc::make_mut(&mut self.description));
        self
    }

    /// Sets the frames, and so ticks, in a second of game time. Default: 60.
    pub fn hz(self, hz: f64) -> Self {
        self.with(|description| description.hz = hz)
    }

    /// Declares discrete actions, by the keys that each of them holds.
    pub fn keys(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>) -> Self {
        self.with(|description| description.input.set_keys(sets))
    }

    /// Declares discrete actions as [`keys`](Self::keys) does, by the names of keys, such as those in a settings file.
    /// Names are `ArrowLeft`, `KeyW`, `Space`, and those that
    /// [`VirtualButton`](bevy_playbot::virtual_input::VirtualButton) has for buttons of mouse and gamepad. With a name
    /// that does not exist the game has a [`problem`](crate::game::Game::problem), and cannot be played.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let game = |key: &str| {
    ///     let game = ForeignGame::new("walk", 1, |_: &mut App| {}).observe(["x"], || [0.0]);
    ///     game.keys_by_name([vec![], vec![key]])
    /// };
    /// assert_eq!(game("ArrowRight").problem(), None);
    /// let problem = game("ArowRight").problem().expect("there is no such key");
    /// assert!(problem.contains("in action 1") && problem.contains("did you mean `ArrowRight`?"));
    /// ```
    pub fn keys_by_name(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = impl AsRef<str>>>) -> Self {
        self.with(|description| description.input.name_keys(sets))
    }

    /// Adds mouse buttons that discrete actions hold, in the order of the actions.
    pub fn mouse_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = MouseButton>>) -> Self {
        self.with(|description| description.input.mouse = lists(sets))
    }

    /// Adds gamepad buttons that discrete actions hold, in the order of the actions.
    pub fn gamepad_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = GamepadButton>>) -> Self {
        self.with(|description| description.input.pads = lists(sets))
    }

    /// Declares continuous actions, by the axis that each of their values moves. Buttons belong to them by
    /// [`ActionAxis::buttons`].
    pub fn axes(self, axes: impl IntoIterator<Item = ActionAxis>) -> Self {
        self.with(|description| description.input.axes = Some(axes.into_iter().collect()))
    }

    /// Declares actions that press this input.
    pub fn input(self, input: VirtualInput) -> Self {
        self.with(|description| description.input.whole = Some(input))
    }

    /// Declares actions that a system passes on to the game. It reads the agent's
    /// [`Action`](bevy_playbot::action::Action) and runs in every tick before the game, unless a person plays.
    pub fn actions<M: 'static>(
        self,
        space: ActionSpace,
        system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| {
            description.input.space = Some(space);
            description.act = Some(SystemFactory::new(system, |()| ()));
        })
    }

    /// Gives the agent components, whenever it is spawned: in each World, and in each that [`Restart::Rebuild`] builds.
    /// Several calls add up.
    ///
    /// This is how an agent drives actions of an input manager that no key is bound to. It does so with the feature
    /// `leafwing-input-manager` of this crate by `LeafwingActions`, with `bevy_enhanced_input` by an `EnhancedAction`.
    /// The game's function adds their plugins, for `InputRoute::Messages`. [`actions`](Self::actions) with a system
    /// that does nothing declares how many actions the agent has.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*, worlds::build_world};
    ///
    /// /// The length of the agent's next step.
    /// #[derive(Component, Debug, PartialEq)]
    /// struct Stride(f32);
    ///
    /// let game = ForeignGame::new("walk", 1, |_: &mut App| {})
    ///     .actions(ActionSpace::Discrete(2), || {})
    ///     .observe(["x"], || [0.0])
    ///     .agent(|agent| {
    ///         agent.insert(Stride(0.5));
    ///     });
    /// let (world, agents) = build_world(&game, "default", 0, 0, 1);
    /// assert_eq!(world.get::<Stride>(agents[0]), Some(&Stride(0.5)));
    /// ```
    pub fn agent(self, equip: impl Fn(&mut EntityWorldMut) + Send + Sync + 'static) -> Self {
        self.with(|description| description.agent.push(Arc::new(equip)))
    }

    /// Adds a detector of the game's own, which looks for defects in tests: see [`detector`](crate::detector). Each
    /// test creates a new one.
    pub fn detector<D: Detector + 'static>(self, make: impl Fn() -> D + Send + Sync + 'static) -> Self {
        let make = move || -> Box<dyn Detector> { Box::new(make()) };
        self.with(|description| description.detectors.push(Arc::new(make)))
    }

    /// Adds a defect that can be planted into the game: see `playbot_mutation::bugs`.
    pub fn defect(self, kind: DefectKind) -> Self {
        self.with(|description| description.defects.push(kind))
    }

    /// Sets the names of the actions, for people. Actions of keys, of the mouse and of clicks have names by default.
    pub fn action_names(self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.input.names = names.into_iter().map(Into::into).collect())
    }

    /// Declares the observation: one value per name. The system may run more than once in a tick, so it must change
    /// nothing.
    pub fn observe<Values: IntoValues, M: 'static>(
        self,
        names: impl IntoIterator<Item = impl Into<String>>,
        system: impl IntoSystem<(), Values, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| {
            description.names = names.into_iter().map(Into::into).collect();
            description.observe = Some(SystemFactory::new(system, Values::into_values));
        })
    }

    /// Declares the observation by paths of numbers. `Paddle.Transform.translation.x` is the field of a component of
    /// the one entity that has another component or this `Name`. `Score.0` is the field of a resource, or of the only
    /// component of its type. Types that are read must derive `Reflect`. A component that only finds an entity need
    /// not, if Bevy is built with its feature `debug`.
    pub fn observe_paths(self, paths: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.paths = paths.into_iter().map(Into::into).collect())
    }

    /// Lets agents see pictures (`observation: Camera` of an experiment) through the game's own camera: of several
    /// active ones, the one that draws first. It needs the feature `camera` of this crate. Without the feature, a game
    /// with no other observation is refused.
    pub fn camera(self) -> Self {
        self.with(|description| description.has_camera = true)
    }

    /// Ends episodes after this many ticks, as [`Truncated`](bevy_playbot::episode::EpisodeEnd::Truncated). A person
    /// may play without it (`playbot play --no-time-limit`), and such recordings replay to their end.
    pub fn time_limit(self, ticks: u32) -> Self {
        self.with(|description| description.limit = Some(ticks))
    }

    /// Sets how the game restarts. Default: [`Restart::Startup`].
    pub fn restart(self, restart: Restart) -> Self {
        self.with(|description| description.restart = restart)
    }

    /// Drops all messages of this type at a restart, so that the game does not read in an episode what happened in the
    /// last one. Several calls add up.
    ///
    /// An observer of despawned entities writes such messages while [`Restart::Startup`] takes the game down; the
    /// messages of `Startup` are kept. With a restart of the game's own, those that it writes are dropped as well. The
    /// systems of [`reward`](Self::reward) and [`end`](Self::end) do not need this: messages and removed components from
    /// before the first tick do not count for them.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// #[derive(Message)]
    /// struct Died;
    ///
    /// let game = ForeignGame::new("walk", 1, |app: &mut App| _ = app.add_message::<Died>());
    /// let game = game.keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]).forget_messages::<Died>();
    /// assert_eq!(game.problem(), None);
    /// ```
    pub fn forget_messages<M: Message>(self) -> Self {
        let forget = |world: &mut World| {
            if let Some(mut messages) = world.get_resource_mut::<Messages<M>>() {
                messages.clear();
            }
        };
        self.with(|description| description.forgotten.push((TypeId::of::<Messages<M>>(), Arc::new(forget))))
    }

    /// Declares whether a level can be played. The system runs in each frame from the second one after the restart, and
    /// no tick passes until it returns true. The game's clock stands meanwhile, so timers and fixed steps do not
    /// advance. The clock of the first tick is always two frames after the restart.
    ///
    /// Without a window, each frame also waits for the assets that the game has asked for. They arrive in the next
    /// frame on every machine. Tasks of the game's own take any number of frames, unless the game
    /// [waits for them](Self::wait_for_tasks).
    ///
    /// A level that needs the clock to get ready, such as one behind a splash screen, gets it in the second half of the
    /// frames of [`ready_within`](Self::ready_within).
    pub fn ready<M: 'static>(self, system: impl IntoSystem<(), bool, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.ready = Some(SystemFactory::new(system, |is_ready| is_ready)))
    }

    /// Sets the frames that a level may take to load. Default: 3600.
    pub fn ready_within(self, frames: u32) -> Self {
        self.with(|description| description.patience = frames)
    }

    /// Lets each frame end only when the tasks that were spawned in Bevy's `AsyncComputeTaskPool` have run. A task that
    /// is spawned in a frame has its result in the next one, on every machine. No game time passes meanwhile. It is for
    /// games that compute paths, levels or parts of a landscape beside their frames.
    ///
    /// Tasks run one after the other, in the order in which they are spawned. A task that waits for other tasks of this
    /// pool is waited for, but not one that waits for a file, a timer or a thread. After ten seconds the game goes on
    /// without a task, and a warning says so. A person who plays without a recording does not wait.
    ///
    /// ```
    /// use bevy::{prelude::*, tasks::{AsyncComputeTaskPool, Task, block_on, poll_once}};
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// #[derive(Component)]
    /// struct Search(Task<Vec2>);
    ///
    /// fn game(app: &mut App) {
    ///     app.add_systems(Startup, |mut commands: Commands| {
    ///         commands.spawn(Search(AsyncComputeTaskPool::get().spawn(async { Vec2::X })));
    ///     })
    ///     .add_systems(Update, |mut commands: Commands, mut searches: Query<(Entity, &mut Search)>| {
    ///         for (entity, mut search) in &mut searches {
    ///             if let Some(found) = block_on(poll_once(&mut search.0)) {
    ///                 commands.entity(entity).remove::<Search>().insert(Transform::from_translation(found.extend(0.0)));
    ///             }
    ///         }
    ///     });
    /// }
    ///
    /// let game = ForeignGame::new("search", 1, game).keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]);
    /// assert_eq!(game.wait_for_tasks().problem(), None);
    /// ```
    pub fn wait_for_tasks(self) -> Self {
        self.with(|description| description.waits_for_tasks = true)
    }

    /// Creates the level after the restart, with a system that runs once. It finds the level's number in
    /// [`LevelSeed`], to seed the game's generator, and to reset what the restart leaves unchanged. A level of a file is
    /// in [`LevelFromFile`], and the mode in [`PlayedMode`].
    pub fn level<M: 'static>(self, system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.level = Some(SystemFactory::new(system, |()| ())))
    }

    /// Prepares the level once it can be played, with a system that runs once: after [`ready`](Self::ready) has returned
    /// true, and before the first observation. It places entities that a file brings after [`level`](Self::level) has
    /// run.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::{ForeignGame, LevelSeed};
    ///
    /// #[derive(Component)]
    /// struct Hero;
    ///
    /// fn placed(game: ForeignGame) -> ForeignGame {
    ///     game.ready(|heroes: Query<&Hero>| !heroes.is_empty()).loaded(
    ///         |level: Res<LevelSeed>, mut hero: Single<&mut Transform, With<Hero>>| {
    ///             hero.translation.x = 10.0 * level.0 as f32;
    ///         },
    ///     )
    /// }
    /// ```
    pub fn loaded<M: 'static>(self, system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.loaded = Some(SystemFactory::new(system, |()| ())))
    }

    /// Sets the number of levels, which are numbered from 0. Default: endless.
    pub fn levels(self, number: u64) -> Self {
        self.with(|description| description.levels = Some(number))
    }

    /// Declares a scripted bot that reads the whole World and shows how to play: a system that returns the action of each
    /// tick.
    pub fn demonstrator<Wanted: IntoActionValue, M: 'static>(
        self,
        name: &'static str,
        system: impl IntoSystem<(), Wanted, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| {
            description.demonstrator = Some((name, SystemFactory::new(system, Wanted::into_action)));
        })
    }

    /// Declares that the [`demonstrator`](Self::demonstrator) cannot be asked for its action in states that it has not led
    /// to, for this reason, such as a plan that it follows step by step. `playbot imitate --dagger` then refuses it.
    pub fn demonstrator_cannot_be_asked(self, why: &'static str) -> Self {
        self.with(|description| description.cannot_be_asked = Some(why))
    }

    /// Adds a scripted bot that tests the game, such as one that walks everywhere, or one that plays badly on purpose. Its
    /// system returns the action of each tick, as that of the [`demonstrator`](Self::demonstrator) does. Several calls add
    /// up. A name that another bot has is a [`problem`](crate::game::Game::problem).
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let game = ForeignGame::new("walk", 1, |_: &mut App| {})
    ///     .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
    ///     .observe(["x"], || [0.0])
    ///     .demonstrator("walker", || 2)
    ///     .bot("backwards", || 1)
    ///     .bot("pacer", |mut ticks: Local<u32>| {
    ///         *ticks += 1;
    ///         1 + *ticks / 30 % 2
    ///     });
    /// assert_eq!(game.tools().bots.scripted_bots(), ["backwards", "pacer"]);
    /// let problem = game.bot("walker", || 0).problem().expect("the demonstrator has that name");
    /// assert!(problem.contains("named `walker`, as its demonstrator is"), "{problem}");
    /// ```
    pub fn bot<Wanted: IntoActionValue, M: 'static>(
        self,
        name: &'static str,
        system: impl IntoSystem<(), Wanted, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.bots.push((name, SystemFactory::new(system, Wanted::into_action))))
    }

    /// Sets the hash that a replay compares after each tick, instead of the transforms of all entities that the game
    /// has spawned. It is for games that spawn or move some of them by the wall clock, or when a file is loaded.
    /// Observation and reward are always compared.
    pub fn state_hash<M: 'static>(self, system: impl IntoSystem<(), u64, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.hash = Some(SystemFactory::new(system, |hash| hash)))
    }

    /// Changes Bevy's plugins in a window and in headless Worlds, where it is called after [`headless`](Self::headless).
    /// It sets up plugins as the game's `main` does. The window itself is playbot's.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let game = ForeignGame::new("walk", 1, |_: &mut App| {})
    ///     .default_plugins(|plugins| plugins.set(ImagePlugin::default_nearest()));
    /// let window = game.tools().host.windowed_plugins(DefaultPlugins.build());
    /// assert!(window.enabled::<ImagePlugin>());
    /// ```
    pub fn default_plugins(
        self,
        change: impl Fn(PluginGroupBuilder) -> PluginGroupBuilder + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.default_plugins = Some(Arc::new(change)))
    }

    /// Changes Bevy's plugins for headless Worlds, to leave out some default ones:
    /// `|plugins| plugins.build().disable::<TextPlugin>()`. Their window has 1280 by 720 pixels; a system in `PreStartup`
    /// gives it another size. For the window as well, there is
    /// [`default_plugins`](Self::default_plugins).
    pub fn headless(self, plugins: impl Fn(HeadlessPlugins) -> PluginGroupBuilder + Send + Sync + 'static) -> Self {
        self.with(|description| description.headless_plugins = Some(Arc::new(plugins)))
    }
}

impl ForeignGame {
    /// Returns the number of levels, if the game declares it.
    pub fn level_count(&self) -> Option<u64> {
        self.description.levels
    }

    /// Returns the level that is played for this number. Higher ones are refused where levels are named
    /// ([`check_level`](crate::split::check_level)). Recordings of earlier builds of a game may show them, and so may
    /// Worlds that a program builds: levels begin again there.
    fn level_of(&self, level: u64) -> u64 {
        self.level_count().map_or(level, |levels| level % levels.max(1))
    }
}

impl Game for ForeignGame {
    fn name(&self) -> &'static str {
        self.description.name
    }

    fn version(&self) -> u32 {
        self.description.version
    }

    fn modes(&self) -> &'static [&'static str] {
        self.description.modes
    }

    fn tick_hz(&self) -> f64 {
        self.description.hz
    }

    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        matches!(self.description.restart, Restart::Rebuild).then(|| Arc::new(self.clone()) as Arc<dyn Game>)
    }

    fn actions(&self) -> ActionSpace {
        self.description.first_input().space()
    }

    fn observation(&self) -> ObservationSpace {
        self.description.observation()
    }

    fn build(&self, app: &mut App, mode: &str) {
        app.add_plugins(ForeignPlugin { game: self.clone(), mode: mode.to_owned() });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let sensor = VectorSensor::new(self.description.observation().names);
        let place = self.description.agents.place_after(world.query::<&Agent>().iter(world).count());
        let mut agent = world.spawn((Agent::new(index, self.actions()), sensor, AgentPlace(place)));
        if let Some(input) = self.description.input_of(place).pressed() {
            agent.insert(input);
        }
        let space = self.actions();
        if self.description.legal.is_some() && space.options() > 0 {
            agent.insert(LegalActions::all(&space));
        }
        if self.description.input.holds() {
            agent.insert(DecisionPeriod::new(self.description.input.every.unwrap_or(1)));
        }
        #[cfg(feature = "ui")]
        clicks::equip(&mut agent, self);
        self.description.agent.iter().for_each(|equip| equip(&mut agent));
        agent.id()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools {
            host: self,
            levels: self,
            state: self,
            snapshots: self,
            pictures: self,
            input: self,
            bots: self,
            tests: self,
            ..GameTools::default()
        }
    }
}

impl HostTools for ForeignGame {
    fn placement(&self) -> TickPlacement {
        TickPlacement::Frame
    }

    fn headless_plugins(&self, plugins: HeadlessPlugins) -> PluginGroupBuilder {
        let plugins = if self.description.waits_for_tasks { plugins.with_tasks_in_order() } else { plugins };
        let plugins = match &self.description.headless_plugins {
            Some(change) => change(plugins),
            None => plugins.build(),
        };
        self.description.changed_plugins(plugins)
    }

    fn windowed_plugins(&self, plugins: PluginGroupBuilder) -> PluginGroupBuilder {
        let plugins = if self.description.waits_for_tasks { plugins.set(tasks_in_order(default())) } else { plugins };
        self.description.changed_plugins(plugins)
    }

    fn bare_app(&self) -> Option<App> {
        let mut app = App::new();
        app.add_plugins(self.headless_plugins(HeadlessPlugins::default()));
        set_frame_rate(&mut app, self.tick_hz());
        self.description.add_to(self, &mut app);
        Some(app)
    }

    fn arenas_per_world(&self) -> Option<u32> {
        Some(1)
    }

    fn agents_per_arena(&self) -> u32 {
        u32::try_from(self.description.agents.count()).unwrap_or(u32::MAX)
    }

    fn seats(&self) -> Vec<String> {
        self.description.agents.seats()
    }

    fn teams(&self) -> Vec<usize> {
        self.description.agents.teams()
    }

    fn seated(&self, seat: usize) -> Option<Arc<dyn Game>> {
        let name = self.description.agents.seats().get(seat)?.clone();
        Some(Arc::new(self.clone().first_agent(name)))
    }

    fn seat_of(&self, world: &World, agent: Entity) -> usize {
        place_of(world, agent)
    }

    fn add_agents_along(&self, world: &mut World) {
        add_agents_along(self, world);
    }

    fn time_limit(&self) -> Option<u32> {
        self.description.limit
    }

    fn unplayable(&self) -> Option<String> {
        let Description { name, input, agents, observe, paths, has_camera, names, entities, .. } = &*self.description;
        if let Some(problem) = agents.problem(input) {
            return Some(format!("the game `{name}` {problem}"));
        }
        if has_no_actions(&self.actions()) {
            return Some(format!(
                "the game `{name}` has no actions: say what an agent can do, for instance with `.keys`"
            ));
        }
        if observe.is_none() && paths.is_empty() && entities.is_empty() {
            let unseen = nothing_seen(name, *has_camera, cfg!(feature = "camera"));
            if unseen.is_some() {
                return unseen;
            }
        }
        if observe.is_some() && names.is_empty() {
            return Some(format!("`.observe` of the game `{name}` names no values"));
        }
        if let Some(problem) = problem_of(entities) {
            return Some(format!("the game `{name}`: {problem}"));
        }
        if self.description.modes.is_empty() {
            return Some(format!("`.modes` of the game `{name}` names no mode: name one, or leave it out"));
        }
        let problem = self.description.level_parts.problem(name).or_else(|| self.description.problem_of_bots());
        if problem.is_some() {
            return problem;
        }
        let is_sound = self.description.hz.is_finite() && self.description.hz > 0.0;
        (!is_sound).then(|| format!("`.hz` of the game `{name}` is {}, not a number of frames", self.description.hz))
    }
}

impl PictureTools for ForeignGame {
    fn has_camera(&self) -> bool {
        self.description.has_camera
    }
}

impl BotTools for ForeignGame {
    fn demonstrator(&self) -> Option<&'static str> {
        self.description.demonstrator.as_ref().map(|(name, _)| *name)
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, noise: f64) {
        Renewal::carry_component::<ForeignBot>(world);
        world.entity_mut(agent).insert(ForeignBot { name: None, noise });
    }

    fn cannot_be_asked(&self) -> Option<String> {
        self.description.cannot_be_asked.map(str::to_owned)
    }

    fn scripted_bots(&self) -> Vec<&'static str> {
        self.description.bots.iter().map(|(name, _)| *name).collect()
    }

    fn attach_scripted(&self, world: &mut World, agent: Entity, name: &'static str) {
        Renewal::carry_component::<ForeignBot>(world);
        world.entity_mut(agent).insert(ForeignBot { name: Some(name), noise: 0.0 });
    }

    fn detach(&self, world: &mut World, agent: Entity) {
        Renewal::carry_component::<ForeignBot>(world);
        world.entity_mut(agent).remove::<ForeignBot>();
    }
}

impl TestTools for ForeignGame {
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        self.description.detectors.iter().map(|make| make()).collect()
    }

    fn defects(&self) -> Vec<DefectKind> {
        self.description.defects.clone()
    }
}

fn lists<T>(sets: impl IntoIterator<Item = impl IntoIterator<Item = T>>) -> Vec<Vec<T>> {
    sets.into_iter().map(|set| set.into_iter().collect()).collect()
}
