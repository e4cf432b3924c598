//! A foreign game in one World.

use crate::{
    detector::LevelProof,
    foreign::{ForeignGame, clocks::ClockSettings, guess::PlayerGuess},
    game::Snapshot,
    reflected_path::ReflectedPath,
};
use bevy::{
    ecs::{
        archetype::Archetype,
        component::{ComponentId, Mutable},
        entity::EntityHashSet,
        resource::IsResource,
        schedule::InternedScheduleLabel,
        system::{BoxedReadOnlySystem, BoxedSystem, ReadOnlySystem, RunSystemError, SystemIdMarker},
    },
    input::gamepad::Gamepad,
    prelude::*,
    state::state::FreelyMutableState,
    window::{Monitor, Window},
};
use bevy_playbot::{
    action::ActionValue,
    agent::{Agent, AgentOrder, Control},
    engine::system_errors,
    entities::{EntitySlots, SeenThing},
    episode::{Episode, EpisodeEnd},
    fault::Faults,
};
use std::{
    any::{TypeId, type_name},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// The level that is played, for a game that seeds its generator by it. Inserted before every restart.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct LevelSeed(pub u64);

/// The agent that a system of the adapter is asked about: its place in [`ForeignGame::agents`]. In a game with one agent
/// it is 0.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct PlayedAgent(pub usize);

/// The place of an agent among those of its World, in the order in which they were spawned.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub(super) struct AgentPlace(pub(super) usize);

/// The source of the observation.
pub(super) enum Sensor {
    System(OwnedSystem<Vec<f32>>),
    Paths(Vec<ReflectedPath>),
    Nothing,
}

/// A part of the reward.
pub(super) struct RewardPart {
    pub(super) system: OwnedSystem<f32>,
    /// True if the growth of the value since the last tick is paid.
    pub(super) is_delta: bool,
    pub(super) last: Option<f32>,
}

/// The systems that are asked about one agent. Each agent has copies of its own, so each of them reads every message.
pub(super) struct AgentParts {
    pub(super) sensor: Sensor,
    pub(super) entities: Vec<(EntitySlots, OwnedSystem<Vec<SeenThing>>)>,
    pub(super) position: Option<OwnedSystem<PositionAndHeight>>,
    pub(super) cell: Option<OwnedSystem<Vec<i32>>>,
    pub(super) rewards: Vec<RewardPart>,
    pub(super) end: Option<OwnedSystem<Option<EpisodeEnd>>>,
    pub(super) end_cause: Option<OwnedSystem<Option<&'static str>>>,
    pub(super) act: Option<OwnedSystem<()>>,
    pub(super) legal: Option<OwnedSystem<Vec<bool>>>,
    pub(super) demonstrator: Option<OwnedSystem<ActionValue>>,
    /// The other scripted bots, with their names.
    pub(super) bots: Vec<(&'static str, OwnedSystem<ActionValue>)>,
}

impl AgentParts {
    fn new(game: &ForeignGame) -> Self {
        let description = &game.description;
        let part = |(system, is_delta): &(SystemFactory<f32>, bool)| RewardPart {
            system: system.make(),
            is_delta: *is_delta,
            last: None,
        };
        Self {
            sensor: description.sensor(),
            entities: description.entities.iter().map(|(slots, system)| (slots.clone(), system.make())).collect(),
            position: description.position.as_ref().map(|system| system.make()),
            cell: description.cell.as_ref().map(|system| system.make()),
            rewards: description.rewards.iter().map(part).collect(),
            end: description.end.as_ref().map(|system| system.make()),
            end_cause: description.end_cause.as_ref().map(|system| system.make()),
            act: description.act.as_ref().map(|system| system.make()),
            legal: description.legal.as_ref().map(|system| system.make()),
            demonstrator: description.demonstrator.as_ref().map(|(_, system)| system.make()),
            bots: description.bots.iter().map(|(name, system)| (*name, system.make())).collect(),
        }
    }

    /// Returns the scripted bot of this name; the demonstrator for `None`.
    ///
    /// # Errors
    ///
    /// The game has no such bot, in words.
    pub(super) fn bot(&mut self, name: Option<&str>) -> Result<&mut OwnedSystem<ActionValue>, String> {
        match name {
            None => self.demonstrator.as_mut().ok_or_else(|| "it has no demonstrator".to_owned()),
            Some(name) => {
                let bot = self.bots.iter_mut().find(|(known, _)| *known == name).map(|(_, bot)| bot);
                bot.ok_or_else(|| format!("it has no bot `{name}`"))
            }
        }
    }
}

/// The [`Foreign`] of a World. It is shared, so that it can be used while its systems have the whole World.
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
pub(super) struct ForeignCell(Arc<Mutex<Foreign>>);

impl ForeignCell {
    pub(super) fn lock(&self) -> MutexGuard<'_, Foreign> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn new(foreign: Foreign) -> Self {
        Self(Arc::new(Mutex::new(foreign)))
    }
}

/// The plugin's state of a foreign game in its World.
pub(super) struct Foreign {
    pub(super) game: ForeignGame,
    /// The systems of each agent, in the order of the agents.
    agents: Vec<AgentParts>,
    /// The place of the agent that is asked about.
    asked: usize,
    /// The position, if none is declared.
    pub(super) guess: PlayerGuess,
    pub(super) proof: Option<OwnedReader<LevelProof>>,
    pub(super) save: Option<OwnedReader<Snapshot>>,
    /// The error of a proof, until the next tick reports it.
    pub(super) failed_proof: Option<String>,
    pub(super) ready: Option<OwnedSystem<bool>>,
    pub(super) level: Option<OwnedSystem<()>>,
    pub(super) loaded: Option<OwnedSystem<()>>,
    pub(super) restart: Option<OwnedSystem<()>>,
    pub(super) hash: Option<OwnedSystem<u64>>,
    /// The World before the game started.
    pub(super) baseline: Option<Arc<Baseline>>,
    /// The clocks before the game started.
    pub(super) clocks: Option<ClockSettings>,
    /// The clocks when the first episode was about to begin.
    pub(super) begun: Option<ClockSettings>,
    /// The schedules that run once when a program starts, in order.
    pub(super) startup: Vec<InternedScheduleLabel>,
    /// Frames since the last restart.
    pub(super) frames: u32,
    /// True if an episode has started in this World, if each has its own World.
    pub(super) has_begun: bool,
}

impl Foreign {
    pub(super) fn new(game: &ForeignGame, startup: Vec<InternedScheduleLabel>) -> Self {
        let description = &game.description;
        let restart = match &description.restart {
            Restart::Own(own) => match &own.0 {
                OwnRestartKind::System(system) => Some(system.make()),
                OwnRestartKind::State(_) => None,
            },
            Restart::Startup | Restart::Rebuild => None,
        };
        Self {
            agents: (0..description.agents.count()).map(|_| AgentParts::new(game)).collect(),
            asked: 0,
            guess: PlayerGuess::default(),
            proof: description.proof.as_ref().map(|system| system.make()),
            save: description.snapshot.as_ref().and_then(|parts| parts.reader()),
            failed_proof: None,
            ready: description.ready.as_ref().map(|system| system.make()),
            level: description.level.as_ref().map(|system| system.make()),
            loaded: description.loaded.as_ref().map(|system| system.make()),
            restart,
            hash: description.hash.as_ref().map(|system| system.make()),
            game: game.clone(),
            baseline: None,
            clocks: None,
            begun: None,
            startup,
            frames: 0,
            has_begun: false,
        }
    }

    /// Returns the systems of the agent that is asked about.
    pub(super) fn asked(&mut self) -> &mut AgentParts {
        &mut self.agents[self.asked]
    }

    /// Replaces the scripted bots of the agent that is asked about by new ones, which remember no episode.
    pub(super) fn renew_bots(&mut self) {
        let description = self.game.description.clone();
        let parts = self.asked();
        parts.demonstrator = description.demonstrator.as_ref().map(|(_, system)| system.make());
        parts.bots = description.bots.iter().map(|(name, system)| (*name, system.make())).collect();
    }

    /// Returns the parts of the rewards of all agents.
    pub(super) fn rewards(&mut self) -> impl Iterator<Item = &mut RewardPart> {
        self.agents.iter_mut().flat_map(|parts| &mut parts.rewards)
    }
}

/// Returns the agents of the World that have a controller, in the order of their numbers.
pub(super) fn active_agents(world: &World) -> Vec<Entity> {
    let Some(order) = world.get_resource::<AgentOrder>() else { return Vec::new() };
    let is_active = |&agent: &Entity| world.get::<Control>(agent).is_some_and(|control| control.is_active());
    order.entities().iter().copied().filter(is_active).collect()
}

/// Returns the agents of the World that are playing, in the order of their numbers.
pub(super) fn playing_agents(world: &World) -> Vec<Entity> {
    let mut agents = active_agents(world);
    agents.retain(|&agent| world.get::<Episode>(agent).is_some_and(Episode::is_running));
    agents
}

/// Runs a part of the game's description for an agent, which [`PlayedAgent`] names. An error is a fault, and stops the
/// agent.
pub(super) fn with_foreign<T>(
    world: &mut World,
    agent: Entity,
    work: impl FnOnce(&mut World, &mut Foreign) -> Result<T, String>,
) -> Option<T> {
    let cell = world.get_resource::<ForeignCell>()?.clone();
    let mut foreign = cell.lock();
    let place = world.get::<AgentPlace>(agent).map_or(0, |place| place.0);
    foreign.asked = place % foreign.agents.len();
    match world.get_resource_mut::<PlayedAgent>() {
        Some(mut played) => {
            played.set_if_neq(PlayedAgent(foreign.asked));
        }
        None => world.insert_resource(PlayedAgent(foreign.asked)),
    }
    let result = work(world, &mut foreign);
    let name = foreign.game.description.name;
    match result {
        Ok(value) => Some(value),
        Err(why) => {
            report(world, agent, name, &why);
            None
        }
    }
}

/// Replaces a component of the agent, or removes it.
pub(super) fn note<C: Component<Mutability = Mutable>>(world: &mut World, agent: Entity, component: Option<C>) {
    let mut agent = world.entity_mut(agent);
    match (component, agent.get_mut::<C>()) {
        // To insert and to remove takes far longer, and this is done in every tick.
        (Some(component), Some(mut known)) => *known = component,
        (Some(component), None) => {
            agent.insert(component);
        }
        (None, Some(_)) => {
            agent.remove::<C>();
        }
        (None, None) => {}
    }
}

/// Reports a fault of the game, and stops its agent.
fn report(world: &mut World, agent: Entity, game: &str, why: &str) {
    let index = world.get::<Agent>(agent).map_or(0, |agent| agent.index);
    let (level, tick) = world.get::<Episode>(agent).map_or((0, 0), |episode| (episode.level, episode.tick));
    world
        .resource_mut::<Faults>()
        .report(format!("agent {index}, level {level}, tick {tick}: the game `{game}`: {why}"));
    if let Some(mut control) = world.get_mut::<Control>(agent) {
        *control = Control::Idle;
    }
}

/// The way in which a foreign game restarts for each episode.
#[derive(Clone)]
#[non_exhaustive]
pub enum Restart {
    /// Despawns everything that the game has spawned since the program started, resets the clock to 0 at the speed that
    /// the program began with, and runs `PreStartup`, `Startup` and `PostStartup` again. Resources stay unchanged,
    /// unless those systems insert them: reset them in [`ForeignGame::level`]. Messages that the game writes while its
    /// entities are despawned stay as well: see [`ForeignGame::forget_messages`].
    Startup,
    /// Rebuilds the World, as if the program were started again for each episode. It is the last resort, for games
    /// whose resources, `Local`s or timers survive [`Startup`](Self::Startup). It takes far longer, loads assets again,
    /// and works only in Worlds without a window. `Startup` already finds the level in [`LevelSeed`].
    Rebuild,
    /// The game's own restart: see [`Restart::system`] and [`Restart::state`].
    Own(OwnRestart),
}

/// A game's own restart.
#[derive(Clone)]
pub struct OwnRestart(pub(super) OwnRestartKind);

#[derive(Clone)]
pub(super) enum OwnRestartKind {
    System(SystemFactory<()>),
    State(Arc<dyn Fn(&mut World) -> Result<(), String> + Send + Sync>),
}

impl Restart {
    /// Restarts the game with a system. The clock is reset to 0 before it, and runs at the speed of the program's start.
    pub fn system<M: 'static>(system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        Self::Own(OwnRestart(OwnRestartKind::System(SystemFactory::new(system, |()| ()))))
    }

    /// Restarts the game by a state: the state is left, if the game is in it, and entered again, with all systems of
    /// these transitions. The clock is reset to 0 before it, and runs at the speed of the program's start.
    pub fn state<S: FreelyMutableState + Clone>(state: S) -> Self {
        Self::Own(OwnRestart(OwnRestartKind::State(Arc::new(move |world: &mut World| enter(world, state.clone())))))
    }
}

fn enter<S: FreelyMutableState>(world: &mut World, state: S) -> Result<(), String> {
    let Some(mut next) = world.get_resource_mut::<NextState<S>>() else {
        return Err(format!("the game has no state of the type `{}`: it must call `init_state`", type_name::<S>()));
    };
    next.set(state);
    world.try_run_schedule(StateTransition).map_err(|_| "the game has no `StatesPlugin`".to_owned())
}

/// A World before its game has started. Later entities belong to the game.
pub(super) struct Baseline {
    entities: EntityHashSet,
    /// Components of entities that never belong to the game, if they exist.
    kept: Vec<TypeId>,
    /// Components of roots of scenes. The entities below them appear when their file is loaded, not in a fixed tick.
    scenes: Vec<ComponentId>,
}

impl Baseline {
    /// Creates the baseline. Call it before the first systems of the game run.
    pub(super) fn of(world: &mut World) -> Self {
        let kept = vec![
            TypeId::of::<Agent>(),
            TypeId::of::<IsResource>(),
            TypeId::of::<SystemIdMarker>(),
            TypeId::of::<Gamepad>(),
            TypeId::of::<Window>(),
            TypeId::of::<Monitor>(),
            #[cfg(feature = "camera")]
            TypeId::of::<bevy_playbot::camera::SensorCamera>(),
        ];
        Self { entities: entities_of(world.archetypes().iter()).collect(), kept, scenes: scene_roots(world) }
    }

    /// Returns all entities that the game has spawned, in the order of their storage.
    pub(super) fn spawned(&self, world: &World) -> Vec<Entity> {
        self.spawned_in(world, |_| true).collect()
    }

    /// Returns the entities that the game has spawned with this component.
    pub(super) fn spawned_with<C: Component>(&self, world: &World) -> impl Iterator<Item = Entity> {
        let component = world.component_id::<C>();
        self.spawned_in(world, move |archetype| component.is_some_and(|component| archetype.contains(component)))
    }

    fn spawned_in(&self, world: &World, is_wanted: impl Fn(&Archetype) -> bool) -> impl Iterator<Item = Entity> {
        let kept: Vec<ComponentId> = self.kept.iter().filter_map(|id| world.components().get_id(*id)).collect();
        let is_kept = move |archetype: &Archetype| kept.iter().any(|&component| archetype.contains(component));
        // Most archetypes are those of resources.
        let archetypes = world.archetypes().iter().filter(move |of| !of.is_empty() && is_wanted(of) && !is_kept(of));
        entities_of(archetypes).filter(|entity| !self.entities.contains(entity))
    }

    /// Returns whether the game itself decides when and where an entity appears. Parts of a scene do not count: they
    /// appear when their file is loaded.
    pub(super) fn is_placed(&self, world: &World, entity: Entity) -> bool {
        let mut entity = entity;
        while let Some(parent) = world.get::<ChildOf>(entity).map(ChildOf::parent) {
            if self.scenes.iter().any(|&scene| world.entity(parent).contains_id(scene)) {
                return false;
            }
            entity = parent;
        }
        true
    }
}

/// Returns the entities of some archetypes, in the order of their storage.
fn entities_of<'w>(archetypes: impl Iterator<Item = &'w Archetype>) -> impl Iterator<Item = Entity> {
    archetypes.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id()))
}

/// Returns the components of the roots of Bevy's scenes, if this build has them.
fn scene_roots(world: &mut World) -> Vec<ComponentId> {
    let Some(registry) = world.get_resource::<AppTypeRegistry>().cloned() else { return Vec::new() };
    let registry = registry.read();
    let names = ["WorldAssetRoot", "DynamicWorldRoot"];
    let roots = names.iter().filter_map(|name| {
        let component = registry.get_with_short_type_path(name)?.data::<ReflectComponent>()?.clone();
        Some(component.register_component(world))
    });
    roots.collect()
}

/// A factory of copies of a system.
pub(super) struct SystemFactory<Out: 'static> {
    name: &'static str,
    make: Arc<dyn Fn() -> BoxedSystem<(), Out> + Send + Sync>,
}

impl<Out: 'static> Clone for SystemFactory<Out> {
    fn clone(&self) -> Self {
        Self { name: self.name, make: self.make.clone() }
    }
}

impl<Out: 'static> SystemFactory<Out> {
    /// Creates a factory of copies of `system`, whose output is converted.
    pub(super) fn new<S, Given, M>(system: S, convert: fn(Given) -> Out) -> Self
    where
        S: IntoSystem<(), Given, M> + Clone + Send + Sync + 'static,
        Given: 'static,
        M: 'static,
    {
        let make = move || -> BoxedSystem<(), Out> {
            Box::new(IntoSystem::into_system(IntoSystem::<(), Given, M>::map(system.clone(), convert)))
        };
        Self { name: type_name::<S>(), make: Arc::new(make) }
    }

    /// Returns the name of the system, for messages.
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    /// Creates a system for one World.
    pub(super) fn make(&self) -> OwnedSystem<Out> {
        OwnedSystem { name: self.name, system: (self.make)(), is_initialized: false }
    }
}

/// A position on the plan, and the height if the plan is seen from above.
pub(super) type PositionAndHeight = (Vec2, Option<f32>);

/// A system of one World.
pub(super) struct OwnedSystem<Out: 'static> {
    name: &'static str,
    system: BoxedSystem<(), Out>,
    is_initialized: bool,
}

impl<Out: 'static> OwnedSystem<Out> {
    /// Runs the system; `None` if it is skipped, because an entity that it asks for does not exist.
    ///
    /// # Errors
    ///
    /// The reason why it cannot run, in words.
    pub(super) fn run(&mut self, world: &mut World) -> Result<Option<Out>, String> {
        if !self.is_initialized {
            self.system.initialize(world);
            self.is_initialized = true;
        }
        outcome(self.name, self.system.run((), world))
    }

    /// Runs the system as [`run`](Self::run) does, where skipping is an error.
    ///
    /// # Errors
    ///
    /// The reason why it cannot run, in words.
    pub(super) fn demand(&mut self, world: &mut World) -> Result<Out, String> {
        let name = self.name;
        self.run(world)?.ok_or_else(|| {
            format!("system `{name}` was skipped: an entity that it asks for does not exist, or there are several")
        })
    }
}

/// A factory of copies of a system that changes nothing.
pub(super) struct ReaderFactory<Out: 'static> {
    name: &'static str,
    make: Arc<dyn Fn() -> BoxedReadOnlySystem<(), Out> + Send + Sync>,
}

impl<Out: 'static> Clone for ReaderFactory<Out> {
    fn clone(&self) -> Self {
        Self { name: self.name, make: self.make.clone() }
    }
}

impl<Out: 'static> ReaderFactory<Out> {
    /// Creates a factory of copies of `system`.
    pub(super) fn new<S, M>(system: S) -> Self
    where
        S: IntoSystem<(), Out, M, System: ReadOnlySystem> + Clone + Send + Sync + 'static,
    {
        let make = move || -> BoxedReadOnlySystem<(), Out> { Box::new(IntoSystem::into_system(system.clone())) };
        Self { name: type_name::<S>(), make: Arc::new(make) }
    }

    /// Creates a factory of copies of `system`, whose output is converted.
    pub(super) fn converting<S, Given, M>(system: S, convert: fn(Given) -> Out) -> Self
    where
        S: IntoSystem<(), Given, M, System: ReadOnlySystem> + Clone + Send + Sync + 'static,
        Given: 'static,
        M: 'static,
    {
        let make = move || -> BoxedReadOnlySystem<(), Out> {
            Box::new(IntoSystem::into_system(IntoSystem::<(), Given, M>::map(system.clone(), convert)))
        };
        Self { name: type_name::<S>(), make: Arc::new(make) }
    }

    /// Creates a system for one World.
    pub(super) fn make(&self) -> OwnedReader<Out> {
        OwnedReader { name: self.name, system: (self.make)(), is_initialized: false }
    }
}

/// A system of one World that needs no more than a view of it, once it is prepared.
pub(super) struct OwnedReader<Out: 'static> {
    name: &'static str,
    system: BoxedReadOnlySystem<(), Out>,
    is_initialized: bool,
}

impl<Out: 'static> OwnedReader<Out> {
    /// Prepares the system for its World.
    pub(super) fn prepare(&mut self, world: &mut World) {
        if !self.is_initialized {
            self.system.initialize(world);
            self.is_initialized = true;
        }
    }

    /// Runs the system; `None` if it is skipped, because an entity that it asks for does not exist, or if it is not
    /// prepared yet.
    ///
    /// # Errors
    ///
    /// The reason why it cannot run, in words.
    pub(super) fn read(&mut self, world: &World) -> Result<Option<Out>, String> {
        if !self.is_initialized {
            return Ok(None);
        }
        outcome(self.name, self.system.run_readonly((), world))
    }
}

/// Returns the output of a system; `None` if it was skipped.
fn outcome<Out>(name: &str, result: Result<Out, RunSystemError>) -> Result<Option<Out>, String> {
    match result {
        Ok(out) => Ok(Some(out)),
        Err(RunSystemError::Skipped(_)) => Ok(None),
        Err(RunSystemError::Failed(error)) => Err(system_errors::explain(&format!("system `{name}`"), &error)),
    }
}

// Return types of a game's own systems.

/// Values of an observation.
pub trait IntoValues: 'static {
    /// Returns the values in their order.
    fn into_values(self) -> Vec<f32>;
}

impl<const N: usize> IntoValues for [f32; N] {
    fn into_values(self) -> Vec<f32> {
        self.into()
    }
}

impl IntoValues for Vec<f32> {
    fn into_values(self) -> Vec<f32> {
        self
    }
}

/// The action of a scripted bot. An array of whole numbers has the option taken of each of several choices, and numbers
/// may follow it in a pair.
pub trait IntoActionValue: 'static {
    /// Returns the action.
    fn into_action(self) -> ActionValue;
}

impl IntoActionValue for ActionValue {
    fn into_action(self) -> ActionValue {
        self
    }
}

impl IntoActionValue for u32 {
    fn into_action(self) -> ActionValue {
        ActionValue::Discrete(self)
    }
}

impl IntoActionValue for usize {
    fn into_action(self) -> ActionValue {
        // An invalid number is refused as an action that does not exist.
        ActionValue::Discrete(u32::try_from(self).unwrap_or(u32::MAX))
    }
}

impl IntoActionValue for i32 {
    fn into_action(self) -> ActionValue {
        ActionValue::Discrete(u32::try_from(self).unwrap_or(u32::MAX))
    }
}

impl<const N: usize> IntoActionValue for [u32; N] {
    fn into_action(self) -> ActionValue {
        ActionValue::Mixed { choices: self.into(), numbers: Vec::new() }
    }
}

impl<const N: usize, const M: usize> IntoActionValue for ([u32; N], [f32; M]) {
    fn into_action(self) -> ActionValue {
        ActionValue::Mixed { choices: self.0.into(), numbers: self.1.into() }
    }
}

impl<const N: usize> IntoActionValue for [f32; N] {
    fn into_action(self) -> ActionValue {
        ActionValue::Continuous(self.into())
    }
}

impl IntoActionValue for Vec<f32> {
    fn into_action(self) -> ActionValue {
        ActionValue::Continuous(self)
    }
}
