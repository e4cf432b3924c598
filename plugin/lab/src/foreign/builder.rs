//! The builder methods of a foreign game.

use std::sync::Arc;

use bevy::{app::PluginGroupBuilder, prelude::*};

use super::{
    convert::{IntoActionValue, IntoValues},
    factory::SystemFactory,
    game::{Description, ForeignGame},
    input::Input,
    restart_kind::Restart,
};
use crate::{defect::DefectKind, detector::Detector, floor_plan::FloorPlan};
use bevy_playbot::{
    action::ActionSpace,
    episode::EpisodeEnd,
    headless_plugins::HeadlessPlugins,
    virtual_input::{ActionAxis, VirtualInput},
};

/// Default number of frames that a level may take to load.
const PATIENCE: u32 = 3600;

fn lists<T>(sets: impl IntoIterator<Item = impl IntoIterator<Item = T>>) -> Vec<Vec<T>> {
    sets.into_iter().map(|set| set.into_iter().collect()).collect()
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
            levels: None,
            input: Input::default(),
            act: None,
            agent: Vec::new(),
            names: Vec::new(),
            observe: None,
            paths: Vec::new(),
            has_camera: false,
            place: None,
            plan: None,
            rewards: Vec::new(),
            end: None,
            limit: None,
            restart: Restart::Startup,
            ready: None,
            patience: PATIENCE,
            level: None,
            demonstrator: None,
            hash: None,
            plugins: None,
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

    /// Declares discrete actions as [`keys`](Self::keys) does, by the names of keys, such as those in a settings file:
    /// `ArrowLeft`, `KeyW`, `Space`, and those that [`VirtualButton`](bevy_playbot::virtual_input::VirtualButton) has
    /// for buttons of mouse and gamepad. With a name that does not exist the game has a
    /// [`problem`](crate::game::Game::problem), and cannot be played.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_lab::{foreign::ForeignGame, prelude::*};
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
    /// This is how an agent drives actions of an input manager that no key is bound to: with the feature
    /// `leafwing-input-manager` of this crate by `LeafwingActions`, with `bevy_enhanced_input` by an `EnhancedAction`.
    /// The game's function adds their plugins, for `InputRoute::Messages`. [`actions`](Self::actions) with a system
    /// that does nothing declares how many actions the agent has.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_lab::{foreign::ForeignGame, prelude::*, worlds::build_world};
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

    /// Adds a defect that can be planted into the game: see [`bugs`](crate::bugs).
    pub fn defect(self, kind: DefectKind) -> Self {
        self.with(|description| description.defects.push(kind))
    }

    /// Sets the names of the actions, for people. Actions of keys have names by default.
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

    /// Declares the position of the agent, from above or from the side, in any units, for detectors of progress, for
    /// explorers and for pictures. The system may run more than once in a tick, so it must change nothing. While it is
    /// skipped, because an entity that it asks for does not exist, the position is unknown.
    pub fn place<M: 'static>(self, system: impl IntoSystem<(), Vec2, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.place = Some(SystemFactory::new(system, |place| place)))
    }

    /// Declares the plan of a level by its number, in the units of [`place`](Self::place): for pictures of paths, and
    /// for detectors that need walls, bounds or the goal.
    pub fn plan(self, plan: impl Fn(u64) -> FloorPlan + Send + Sync + 'static) -> Self {
        self.with(|description| description.plan = Some(Arc::new(plan)))
    }

    /// Adds a reward of each tick to other rewards.
    pub fn reward<M: 'static>(self, system: impl IntoSystem<(), f32, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.rewards.push((SystemFactory::new(system, |reward| reward), false)))
    }

    /// Adds a reward by the growth of a value, such as a score, since the last tick. The value need not begin at 0 in
    /// an episode.
    pub fn reward_delta<M: 'static>(self, system: impl IntoSystem<(), f32, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.rewards.push((SystemFactory::new(system, |value| value), true)))
    }

    /// Declares whether and how the game is over after a tick. The system runs in `Last`.
    pub fn end<M: 'static>(
        self,
        system: impl IntoSystem<(), Option<EpisodeEnd>, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.end = Some(SystemFactory::new(system, |end| end)))
    }

    /// Ends episodes after this many ticks, as [`Truncated`](EpisodeEnd::Truncated).
    pub fn time_limit(self, ticks: u32) -> Self {
        self.with(|description| description.limit = Some(ticks))
    }

    /// Sets how the game restarts. Default: [`Restart::Startup`].
    pub fn restart(self, restart: Restart) -> Self {
        self.with(|description| description.restart = restart)
    }

    /// Declares whether a level can be played. The system runs in each frame from the second one after the restart, and
    /// no tick passes until it returns true. The clock of the first tick is always two frames after the restart, for
    /// any number of frames. So timers are unchanged, and a time that the game stored meanwhile may lie ahead.
    pub fn ready<M: 'static>(self, system: impl IntoSystem<(), bool, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.ready = Some(SystemFactory::new(system, |is_ready| is_ready)))
    }

    /// Sets the frames that a level may take to load. Default: 3600.
    pub fn ready_within(self, frames: u32) -> Self {
        self.with(|description| description.patience = frames)
    }

    /// Creates the level after the restart, with a system that runs once. It finds the level's number in
    /// [`LevelSeed`](super::LevelSeed), to seed the game's generator, and to reset what the restart leaves unchanged.
    pub fn level<M: 'static>(self, system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.level = Some(SystemFactory::new(system, |()| ())))
    }

    /// Sets the number of levels: level n is the same as level 0, and so on. Default: endless.
    pub fn levels(self, number: u64) -> Self {
        self.with(|description| description.levels = Some(number))
    }

    /// Declares a scripted bot that reads the whole World: a system that returns the action of each tick.
    pub fn demonstrator<Wanted: IntoActionValue, M: 'static>(
        self,
        name: &'static str,
        system: impl IntoSystem<(), Wanted, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| {
            description.demonstrator = Some((name, SystemFactory::new(system, Wanted::into_action)));
        })
    }

    /// Sets the hash that a replay compares after each tick, instead of the transforms of all entities that the game
    /// has spawned. It is for games that spawn or move some of them by the real-time clock, or when a file is loaded.
    /// Observation and reward are always compared.
    pub fn state_hash<M: 'static>(self, system: impl IntoSystem<(), u64, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.hash = Some(SystemFactory::new(system, |hash| hash)))
    }

    /// Changes Bevy's plugins for headless Worlds, to leave out some default ones:
    /// `|usual| usual.build().disable::<AudioPlugin>()`.
    pub fn headless(self, plugins: impl Fn(HeadlessPlugins) -> PluginGroupBuilder + Send + Sync + 'static) -> Self {
        self.with(|description| description.plugins = Some(Arc::new(plugins)))
    }
}
