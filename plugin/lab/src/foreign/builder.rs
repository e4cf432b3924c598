//! Describing a foreign game, part by part.

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

/// Frames that a level may take to be ready, unless the game says otherwise.
const PATIENCE: u32 = 3600;

fn lists<T>(sets: impl IntoIterator<Item = impl IntoIterator<Item = T>>) -> Vec<Vec<T>> {
    sets.into_iter().map(|set| set.into_iter().collect()).collect()
}

impl ForeignGame {
    /// A game that `plugin` adds to an app which has Bevy's `DefaultPlugins`. Raise the version whenever an old recording
    /// would no longer replay.
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

    /// Frames, and so ticks, in a second of game time; 60 unless said otherwise.
    pub fn hz(self, hz: f64) -> Self {
        self.with(|description| description.hz = hz)
    }

    /// Discrete actions: the keys that each of them holds.
    pub fn keys(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>) -> Self {
        self.with(|description| description.input.set_keys(sets))
    }

    /// [`keys`](Self::keys) by their names, such as those in a settings file: `ArrowLeft`, `KeyW`, `Space`, and those that
    /// [`VirtualButton`](bevy_playbot::virtual_input::VirtualButton) has for buttons of mouse and gamepad. With a name that
    /// does not exist the game has a [`problem`](crate::game::Game::problem), and nobody can play it.
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

    /// Mouse buttons that discrete actions hold besides, in the order of the actions.
    pub fn mouse_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = MouseButton>>) -> Self {
        self.with(|description| description.input.mouse = lists(sets))
    }

    /// Gamepad buttons that discrete actions hold besides, in the order of the actions.
    pub fn gamepad_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = GamepadButton>>) -> Self {
        self.with(|description| description.input.pads = lists(sets))
    }

    /// Continuous actions: what each of their values moves. Buttons belong to them by [`ActionAxis::buttons`].
    pub fn axes(self, axes: impl IntoIterator<Item = ActionAxis>) -> Self {
        self.with(|description| description.input.axes = Some(axes.into_iter().collect()))
    }

    /// Actions that press what this says.
    pub fn input(self, input: VirtualInput) -> Self {
        self.with(|description| description.input.whole = Some(input))
    }

    /// Actions that a system hands to the game: it finds the agent's [`Action`](bevy_playbot::action::Action) and runs in
    /// every tick before the game, unless a person plays.
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

    /// Gives the agent components, whenever it is spawned: in each World, and in each that [`Restart::Rebuild`] builds. Said
    /// more than once, all of it is done.
    ///
    /// So an agent drives actions of an input manager that no key is bound to: with the feature `leafwing-input-manager` of
    /// this crate by `LeafwingActions`, with `bevy_enhanced_input` by an `EnhancedAction`. The game's function adds their
    /// plugins, for `InputRoute::Messages`, and [`actions`](Self::actions) with a system that does nothing says how many
    /// actions the agent has.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_lab::{foreign::ForeignGame, prelude::*, worlds::build_world};
    ///
    /// /// Where the agent's next step leads.
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

    /// Adds a detector of the game's own, which looks for defects in tests: see [`detector`](crate::detector). It is made anew
    /// for each test.
    pub fn detector<D: Detector + 'static>(self, make: impl Fn() -> D + Send + Sync + 'static) -> Self {
        let make = move || -> Box<dyn Detector> { Box::new(make()) };
        self.with(|description| description.detectors.push(Arc::new(make)))
    }

    /// Adds a defect that can be planted into the game: see [`bugs`](crate::bugs).
    pub fn defect(self, kind: DefectKind) -> Self {
        self.with(|description| description.defects.push(kind))
    }

    /// Names of the actions, for people. Those of keys name themselves.
    pub fn action_names(self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.input.names = names.into_iter().map(Into::into).collect())
    }

    /// What the agent sees: one value per name. The system may run more than once in a tick, so it must only look.
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

    /// What the agent sees: numbers by their paths, such as `Paddle.Transform.translation.x`, the field of a component of
    /// the one entity that has another component or that has this `Name`; or `Score.0`, the field of a resource, or of the
    /// only component of its kind. What is read must derive `Reflect`; a component that only finds an entity need not, if
    /// Bevy is built with its feature `debug`.
    pub fn observe_paths(self, paths: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.paths = paths.into_iter().map(Into::into).collect())
    }

    /// Agents may see pictures (`observation: Camera` of an experiment) through the game's own camera: of several active
    /// ones, the one that draws first. Needs the feature `camera` of this crate: without it a game that says nothing else of
    /// what agents see is refused.
    pub fn camera(self) -> Self {
        self.with(|description| description.has_camera = true)
    }

    /// Where the agent is, seen from above or from the side, in any units: for detectors that ask whether it gets on, for
    /// explorers, and for pictures. The system may run more than once in a tick, so it must only look; while it is skipped,
    /// since an entity that it asks for does not exist, nobody knows.
    pub fn place<M: 'static>(self, system: impl IntoSystem<(), Vec2, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.place = Some(SystemFactory::new(system, |place| place)))
    }

    /// What a level looks like in the units of [`place`](Self::place), by its number: for pictures of where agents went, and
    /// for detectors that ask for walls, bounds or the goal.
    pub fn plan(self, plan: impl Fn(u64) -> FloorPlan + Send + Sync + 'static) -> Self {
        self.with(|description| description.plan = Some(Arc::new(plan)))
    }

    /// Reward of each tick, on top of other rewards.
    pub fn reward<M: 'static>(self, system: impl IntoSystem<(), f32, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.rewards.push((SystemFactory::new(system, |reward| reward), false)))
    }

    /// Reward by what a value, such as a score, has grown since the last tick, on top of other rewards. It need not begin
    /// at 0 in an episode.
    pub fn reward_delta<M: 'static>(self, system: impl IntoSystem<(), f32, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.rewards.push((SystemFactory::new(system, |value| value), true)))
    }

    /// Whether the game is over after a tick, and how: asked in `Last`.
    pub fn end<M: 'static>(
        self,
        system: impl IntoSystem<(), Option<EpisodeEnd>, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.end = Some(SystemFactory::new(system, |end| end)))
    }

    /// Ends episodes that are not over by then as [`Truncated`](EpisodeEnd::Truncated), after this many ticks.
    pub fn time_limit(self, ticks: u32) -> Self {
        self.with(|description| description.limit = Some(ticks))
    }

    /// How the game begins anew; [`Restart::Startup`] unless said otherwise.
    pub fn restart(self, restart: Restart) -> Self {
        self.with(|description| description.restart = restart)
    }

    /// Whether a level can be played, asked in each frame from the second after the restart on. Until then no tick passes.
    /// The first tick then finds the clock where it is two frames after the restart, however many it has taken: timers stay
    /// as they are, and a time that the game noted meanwhile may lie ahead.
    pub fn ready<M: 'static>(self, system: impl IntoSystem<(), bool, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.ready = Some(SystemFactory::new(system, |is_ready| is_ready)))
    }

    /// Frames that a level may take to be ready; 3600 unless said otherwise.
    pub fn ready_within(self, frames: u32) -> Self {
        self.with(|description| description.patience = frames)
    }

    /// Makes a level of what the restart has left: a system that runs once after it and finds the level's number in
    /// [`LevelSeed`](super::LevelSeed), to seed the game's generator, and to set back what the restart leaves as it was.
    pub fn level<M: 'static>(self, system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.level = Some(SystemFactory::new(system, |()| ())))
    }

    /// The number of levels: level n is the same as level 0, and so on. Endless unless said otherwise.
    pub fn levels(self, number: u64) -> Self {
        self.with(|description| description.levels = Some(number))
    }

    /// A scripted bot that sees the whole World: a system that returns the action of each tick.
    pub fn demonstrator<Wanted: IntoActionValue, M: 'static>(
        self,
        name: &'static str,
        system: impl IntoSystem<(), Wanted, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| {
            description.demonstrator = Some((name, SystemFactory::new(system, Wanted::into_action)));
        })
    }

    /// What a replay compares after each tick, instead of the transforms of everything that the game has spawned: for games
    /// that spawn or move some of it by the clock on the wall, or when a file is loaded. Observation and reward are compared
    /// in any case.
    pub fn state_hash<M: 'static>(self, system: impl IntoSystem<(), u64, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.hash = Some(SystemFactory::new(system, |hash| hash)))
    }

    /// Bevy's plugins for headless Worlds, where some of the usual ones have to be left out:
    /// `|usual| usual.build().disable::<AudioPlugin>()`.
    pub fn headless(self, plugins: impl Fn(HeadlessPlugins) -> PluginGroupBuilder + Send + Sync + 'static) -> Self {
        self.with(|description| description.plugins = Some(Arc::new(plugins)))
    }
}
