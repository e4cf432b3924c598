//! Snapshots of a foreign game, with the keys that are held and the clocks.
//!
//! A game saves its state with systems of its own, or the plugin saves all of it: each component and resource that has
//! changed since the episode began. Entities have other ids in the next episode and in other Worlds. A level begins with
//! the same entities each time, so they are counted in an order that is the same each time.

mod value;

use crate::{
    foreign::{
        ForeignGame,
        clocks::LastFrame,
        observe::{KeptState, kept_state, put_state},
        runtime::{Baseline, ForeignCell, OwnedReader, ReaderFactory},
        snapshot::value::{EntityMap, Made, Owner, Value, Way, Ways, forget_engines},
    },
    game::{Snapshot, SnapshotTools},
    saved_episode::AgentState,
};
use bevy::{
    ecs::{
        change_detection::{ComponentTicks, Tick},
        component::{ComponentId, Mutable},
        entity::EntityHashSet,
        message::MessageRegistry,
        system::ReadOnlySystem,
    },
    input::{
        keyboard::{Key, KeyboardInput},
        mouse::MouseButtonInput,
    },
    prelude::*,
    window::WindowEvent,
};
use bevy_playbot::{
    agent::{AgentOrder, Control},
    bot::HeldAction,
    engine::panics,
    virtual_input::VirtualDevices,
};
use std::{
    any::{Any, TypeId},
    hash::{DefaultHasher, Hash, Hasher},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

pub(super) use value::{Part, queued};

/// The function that puts a saved state into a World. Returns false if the state is of another type.
pub(super) type Load = Arc<dyn Fn(&mut World, &Snapshot) -> bool + Send + Sync>;

/// How a game is saved and loaded.
#[derive(Clone)]
pub(super) enum SnapshotParts {
    /// By its own systems.
    Own { save: ReaderFactory<Snapshot>, load: Load },
    /// The plugin saves all state.
    Whole,
}

impl SnapshotParts {
    /// Returns the game's own system for one World, if there is one.
    pub(super) fn reader(&self) -> Option<OwnedReader<Snapshot>> {
        match self {
            Self::Own { save, .. } => Some(save.make()),
            Self::Whole => None,
        }
    }
}

impl ForeignGame {
    /// Declares how the state of a running episode is saved, and put back: explorers then return to a known state at
    /// once, instead of restarting the game and playing the path again.
    ///
    /// `save` is a system that only reads, and returns all state of the game that decides how an episode goes on, by
    /// value and without ids of entities. While it is skipped, because an entity that it asks for does not exist, nothing
    /// is saved. `load` puts such a state into the World, where the same level was played before, perhaps to its end. It
    /// spawns and despawns entities if their number differs. Held keys and mouse buttons, the clocks and the last values
    /// of rewards are restored as well, and messages that the game [forgets](Self::forget_messages) at a restart are
    /// dropped. A game with other inputs saves nothing.
    ///
    /// Explorers compare snapshots with replays, and do without them if they differ.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::ForeignGame;
    ///
    /// #[derive(Component, Clone)]
    /// struct Hero {
    ///     speed: f32,
    /// }
    ///
    /// fn saved(game: ForeignGame) -> ForeignGame {
    ///     game.snapshot(
    ///         |hero: Single<(&Transform, &Hero)>| (*hero.0, hero.1.clone()),
    ///         |world: &mut World, (place, hero): &(Transform, Hero)| {
    ///             let mut heroes = world.query::<(&mut Transform, &mut Hero)>();
    ///             if let Ok((mut at, mut now)) = heroes.single_mut(world) {
    ///                 (*at, *now) = (*place, hero.clone());
    ///             }
    ///         },
    ///     )
    /// }
    /// ```
    pub fn snapshot<State, M>(
        self,
        save: impl IntoSystem<(), State, M, System: ReadOnlySystem> + Clone + Send + Sync + 'static,
        load: impl Fn(&mut World, &State) + Send + Sync + 'static,
    ) -> Self
    where
        State: Send + Sync + 'static,
        M: 'static,
    {
        let load: Load = Arc::new(move |world, snapshot| {
            let state = snapshot.get::<State>();
            state.into_iter().for_each(|state| load(world, state));
            state.is_some()
        });
        let save = ReaderFactory::converting(save, Snapshot::new::<State>);
        self.with(|description| description.snapshot = Some(SnapshotParts::Own { save, load }))
    }

    /// Lets the plugin save all state of a running episode: what [`snapshot`](Self::snapshot) does for games that name
    /// their state. The game's types may be private.
    ///
    /// Saved is each component of an entity that the game has spawned, and each resource of the game, as soon as it has
    /// changed in the episode. A type is copied by the first of these that it has: [`snapshot_of`](Self::snapshot_of),
    /// `Reflect`, `Clone`, or its bytes if it needs no drop, has no hooks and is aligned to less than a pointer, like
    /// numbers of 32 bits. Entities that are gone are spawned again, and others are despawned. With the features
    /// `bevy_rapier2d` and `bevy_rapier3d` the worlds of that engine are saved.
    ///
    /// Once a value of another type has changed, nothing is saved, and explorers name the type. While messages of the
    /// game, or removed components, wait to be read, a tick is not saved. Neither are the game's [`Local`]s, values that
    /// hide a change from Bevy, and ids of entities in types without [`MapEntities`](bevy::ecs::entity::MapEntities).
    /// Explorers compare snapshots with replays, and do without them if they differ. `playbot doctor` names what is
    /// forgotten.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::ForeignGame;
    ///
    /// /// Neither `Clone` nor `Reflect`, and more than numbers.
    /// #[derive(Resource, Default)]
    /// struct Doors {
    ///     open: Vec<bool>,
    /// }
    ///
    /// fn saved(game: ForeignGame) -> ForeignGame {
    ///     game.snapshots().snapshot_of(|doors: &Doors| doors.open.clone(), |doors, open| doors.open.clone_from(open))
    /// }
    /// ```
    pub fn snapshots(self) -> Self {
        self.with(|description| description.snapshot = Some(SnapshotParts::Whole))
    }

    /// Declares how [`snapshots`](Self::snapshots) saves one type of component or resource, and loads it into a value that
    /// is there. A type whose state is `()` is left out.
    pub fn snapshot_of<T, State>(
        self,
        save: impl Fn(&T) -> State + Send + Sync + 'static,
        load: impl Fn(&mut T, &State) + Send + Sync + 'static,
    ) -> Self
    where
        T: Component<Mutability = Mutable>,
        State: Any + Send + Sync,
    {
        let part = Part::new(save, move |value, state, _| load(value, state));
        self.with(|description| description.snapshot_parts.push(part))
    }
}

/// What the plugin keeps of an agent that plays along: its control and held action besides.
type KeptAgent = (AgentState, Control, HeldAction);

/// Returns what the plugin keeps of the other agents of a World. The caller knows the one that it plays.
fn others(world: &World, agent: Entity) -> Vec<(Entity, KeptAgent)> {
    let all = world.get_resource::<AgentOrder>().map_or(&[][..], |order| order.entities());
    let kept = |other: Entity| -> Option<(Entity, KeptAgent)> {
        let control = *world.get::<Control>(other)?;
        let held = world.get::<HeldAction>(other).cloned().unwrap_or_default();
        Some((other, (AgentState::of(world, other)?, control, held)))
    };
    all.iter().filter(|other| **other != agent).filter_map(|&other| kept(other)).collect()
}

/// The state of a game, and that of the plugin about it.
struct SavedGame {
    game: Snapshot,
    agent: Entity,
    /// Position and cell of the agent.
    state: KeptState,
    /// The other agents of the World.
    others: Vec<(Entity, KeptAgent)>,
    /// The last value of each part of the reward.
    rewards: Vec<Option<f32>>,
    devices: Option<VirtualDevices>,
    keys: Option<ButtonInput<KeyCode>>,
    letters: Option<ButtonInput<Key>>,
    mouse: Option<ButtonInput<MouseButton>>,
    time: Option<Time>,
    virtual_time: Option<Time<Virtual>>,
    fixed_time: Option<Time<Fixed>>,
}

impl SnapshotTools for ForeignGame {
    fn save(&self, world: &World, agent: Entity) -> Option<Snapshot> {
        if self.description.input.unsaved().is_some() {
            return None;
        }
        let cell = world.get_resource::<ForeignCell>()?;
        let mut foreign = cell.lock();
        let foreign = &mut *foreign;
        let game = match (world.get_resource::<WholeCell>(), &foreign.baseline) {
            (Some(whole), Some(baseline)) => Snapshot::new(save_whole(world, whole, baseline)?),
            // An error of the system is not one of the game: it is played without snapshots.
            _ => foreign.save.as_mut()?.read(world).ok()??,
        };
        Some(Snapshot::new(SavedGame {
            game,
            agent,
            state: kept_state(world, agent),
            others: others(world, agent),
            rewards: foreign.rewards().map(|part| part.last).collect(),
            devices: world.get_resource().cloned(),
            keys: world.get_resource().cloned(),
            letters: world.get_resource().cloned(),
            mouse: world.get_resource().cloned(),
            time: world.get_resource().copied(),
            virtual_time: world.get_resource().copied(),
            fixed_time: world.get_resource().copied(),
        }))
    }

    fn load(&self, world: &mut World, agent: Entity, snapshot: &Snapshot) -> bool {
        let (Some(saved), Some(parts)) = (snapshot.get::<SavedGame>(), &self.description.snapshot) else {
            return false;
        };
        let Some(cell) = world.get_resource::<ForeignCell>().cloned() else { return false };
        // Before its first episode the game has no level. Held keys are noted by the agent that holds them.
        if cell.lock().begun.is_none() || saved.agent != agent {
            return false;
        }
        // After a panic the level is started again.
        let is_loaded = match parts {
            SnapshotParts::Own { load, .. } => panics::hear(|| load(world, &saved.game)).unwrap_or(false),
            SnapshotParts::Whole => load_whole(world, &cell, &saved.game),
        };
        if !is_loaded {
            return false;
        }
        world.flush();
        cell.lock().rewards().zip(&saved.rewards).for_each(|(part, last)| part.last = *last);
        put_state(world, agent, &saved.state);
        for (other, (state, control, held)) in &saved.others {
            if let Ok(mut other) = world.get_entity_mut(*other) {
                state.put(&mut other);
                other.insert((*control, held.clone()));
            }
        }
        put(world, saved.devices.clone());
        put(world, saved.keys.clone());
        put(world, saved.letters.clone());
        put(world, saved.mouse.clone());
        put(world, saved.time);
        put(world, saved.virtual_time);
        put(world, saved.fixed_time);
        // The end of an episode releases its keys by messages that no frame has read yet.
        forget::<KeyboardInput>(world);
        forget::<MouseButtonInput>(world);
        forget::<WindowEvent>(world);
        self.description.forgotten.iter().for_each(|(_, forget)| forget(world));
        true
    }

    fn prepare(&self, world: &mut World) {
        if let Some(whole) = world.get_resource::<WholeCell>() {
            whole.lock().is_prepared = self.description.input.unsaved().is_none();
        }
    }

    fn obstacle(&self, world: &World) -> Option<String> {
        let of_input = self.description.snapshot.as_ref().and_then(|_| self.description.input.unsaved());
        of_input.or_else(|| world.get_resource::<WholeCell>()?.lock().obstacle())
    }
}

/// Saves the whole state. After a panic of a game's own function that copies a type, nothing is saved any more.
fn save_whole(world: &World, whole: &WholeCell, baseline: &Baseline) -> Option<SavedWhole> {
    let mut whole = whole.lock();
    let saved = panics::hear(|| whole.save(world, baseline));
    saved.unwrap_or_else(|words| {
        whole.obstacle.get_or_insert(words);
        None
    })
}

/// Loads the whole state.
fn load_whole(world: &mut World, cell: &ForeignCell, saved: &Snapshot) -> bool {
    let Some(saved) = saved.get::<SavedWhole>() else { return false };
    let Some(baseline) = cell.lock().baseline.clone() else { return false };
    let Some(whole) = world.get_resource::<WholeCell>().cloned() else { return false };
    let mut whole = whole.lock();
    let loaded = panics::hear(|| whole.load(world, &baseline, saved)).unwrap_or_else(Err);
    let is_loaded = loaded.is_ok();
    whole.obstacle = whole.obstacle.take().or(loaded.err());
    is_loaded
}

/// Drops all messages of a type.
fn forget<M: Message>(world: &mut World) {
    if let Some(mut messages) = world.get_resource_mut::<Messages<M>>() {
        messages.clear();
    }
}

/// Replaces a resource of the World by a saved one.
fn put<R: Resource>(world: &mut World, saved: Option<R>) {
    if let Some(saved) = saved {
        world.insert_resource(saved);
    }
}

// All state of a game.

/// The [`WholeGame`] of a World. It is shared, so that it can be used while it changes the World.
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
struct WholeCell(Arc<Mutex<WholeGame>>);

impl WholeCell {
    fn lock(&self) -> MutexGuard<'_, WholeGame> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Prepares an app whose state is saved as a whole, by these parts for single types.
pub(super) fn add_whole(app: &mut App, parts: &[Part]) {
    app.insert_resource(WholeCell(Arc::new(Mutex::new(WholeGame::new(parts)))));
}

/// Notes that a frame begins.
pub(super) fn note_frame(world: &mut World) {
    if let Some(whole) = world.get_resource::<WholeCell>().cloned() {
        whole.lock().frame = world.increment_change_tick();
    }
}

/// Notes that an episode begins.
pub(super) fn note_start(world: &mut World, baseline: &Baseline) {
    if let Some(whole) = world.get_resource::<WholeCell>().cloned() {
        let mut whole = whole.lock();
        let begun = panics::hear(|| whole.begin(world, baseline));
        whole.obstacle = whole.obstacle.take().or(begun.err());
    }
}

/// What the plugin knows of a game in one World to save it as a whole.
struct WholeGame {
    ways: Ways,
    /// Whether episodes are saved in this World. Most verbs save none, and then nothing is copied.
    is_prepared: bool,
    /// The change tick at which this frame began.
    frame: Tick,
    start: Option<Start>,
    has_saved: bool,
    /// Why nothing can be saved or loaded.
    obstacle: Option<String>,
    /// The type for which the last save has waited.
    waited_for: Option<String>,
}

/// The game when its episode began.
struct Start {
    tick: Tick,
    /// A hash of the types of each entity: equal for the same entity of another start.
    kinds: Vec<u64>,
    /// Sorted by their kinds and places.
    entities: Vec<StartEntity>,
    resources: StartValues,
}

/// The values of an entity. Those that cannot be copied are missing.
type StartValues = Vec<(Arc<Way>, Option<Value>)>;

struct StartEntity {
    /// Its id at the start, and the one of the entity that has taken its place.
    first: Entity,
    now: Entity,
    values: StartValues,
}

/// The state of an episode.
struct SavedWhole {
    /// The frame at whose end it was saved.
    frame: LastFrame,
    kinds: Vec<u64>,
    /// The entities of the start that still exist.
    entities: Vec<Option<SavedEntity>>,
    /// Entities that were spawned later.
    others: Vec<SavedEntity>,
    resources: SavedEntity,
}

/// The values that have changed since the start.
struct SavedEntity {
    at: Entity,
    values: Vec<SavedValue>,
    /// Types that it no longer has.
    gone: Vec<TypeId>,
}

struct SavedValue {
    of: TypeId,
    value: Value,
    /// Change ticks since it has changed.
    age: u32,
}

impl SavedEntity {
    fn has(&self, of: TypeId) -> bool {
        self.values.iter().any(|value| value.of == of)
    }
}

impl WholeGame {
    /// Prepares for a game with these parts.
    fn new(parts: &[Part]) -> Self {
        let (frame, obstacle) = (Tick::new(0), None);
        let (ways, is_prepared) = (Ways::new(parts), false);
        Self { ways, is_prepared, frame, start: None, has_saved: false, obstacle, waited_for: None }
    }

    /// Notes the start of an episode.
    fn begin(&mut self, world: &mut World, baseline: &Baseline) {
        self.start = None;
        if !self.is_prepared || self.obstacle.is_some() {
            return;
        }
        let tick = world.increment_change_tick();
        let ways = &mut self.ways;
        let spawned = baseline.spawned(world).into_iter();
        let mut entities: Vec<_> = spawned.map(|entity| (kind(ways, world, entity), entity)).collect();
        // Entities that are alike stay in the order of their storage.
        entities.sort_by_key(|(kind, _)| *kind);
        let kinds = entities.iter().map(|((types, _), _)| *types).collect();
        let entities = entities.into_iter().map(|(_, entity)| {
            let values = components(world, entity).into_iter().filter_map(|id| start_value(ways, world, entity, id));
            StartEntity { first: entity, now: entity, values: values.collect() }
        });
        let entities = entities.collect();
        let resources = resources(world).into_iter().filter_map(|(id, entity)| start_value(ways, world, entity, id));
        self.start = Some(Start { tick, kinds, entities, resources: resources.collect() });
    }

    /// Returns the state after a tick; `None` if it cannot be saved, or not in this tick.
    fn save(&mut self, world: &World, baseline: &Baseline) -> Option<SavedWhole> {
        if self.obstacle.is_some() {
            return None;
        }
        let Self { ways, start, frame, .. } = self;
        let start = start.as_ref()?;
        self.waited_for = pending(ways, world, *frame);
        if self.waited_for.is_some() {
            return None;
        }
        match saved(ways, start, world, baseline, LastFrame::since(*frame, world)) {
            Ok(saved) => {
                self.has_saved = true;
                Some(saved)
            }
            Err(why) => {
                self.obstacle.get_or_insert(why);
                None
            }
        }
    }

    /// Returns why nothing is saved, if there is a reason.
    fn obstacle(&self) -> Option<String> {
        let waited_for = self.waited_for.as_ref().filter(|_| !self.has_saved);
        self.obstacle.clone().or_else(|| waited_for.map(|name| format!("`{name}` waits to be read after each tick")))
    }

    /// Puts the World into a state of an episode of the same level.
    ///
    /// # Errors
    ///
    /// Why that is impossible. The World is then in no state at all, and the level must be started again.
    fn load(&mut self, world: &mut World, baseline: &Baseline, saved: &SavedWhole) -> Result<(), String> {
        // Hooks and observers make the clock go on below, and no system of the game runs meanwhile: what has changed a
        // frame ago must not seem newer to it.
        let now = world.read_change_tick();
        let ages = saved.frame.ages_in(LastFrame::since(self.frame, world));
        let Self { ways, start, .. } = self;
        let start = start.as_mut().filter(|start| start.kinds == saved.kinds);
        let start = start.ok_or("the level does not begin with the same entities each time")?;
        let pairs = |start: &Start| -> EntityHashSet {
            let pairs = start.entities.iter().zip(&saved.entities);
            pairs.filter(|(_, saved)| saved.is_some()).map(|(live, _)| live.now).collect()
        };
        despawn_others(world, baseline, &pairs(start));
        // Ids first, since values name entities.
        let mut map = EntityMap::default();
        for (live, saved) in start.entities.iter_mut().zip(&saved.entities) {
            let Some(saved) = saved else { continue };
            if world.get_entity(live.now).is_err() {
                live.now = world.spawn_empty().id();
            }
            map.insert(saved.at, live.now);
        }
        let others: Vec<Entity> = saved.others.iter().map(|_| world.spawn_empty().id()).collect();
        map.extend(saved.others.iter().zip(&others).map(|(saved, now)| (saved.at, *now)));
        let mut own: EntityMap = start.entities.iter().map(|live| (live.first, live.now)).collect();
        let mut maps = (&mut map, &mut own);
        let all = start.entities.iter().zip(&saved.entities);
        let all: Vec<(Entity, &[(Arc<Way>, Option<Value>)], &SavedEntity)> = all
            .filter_map(|(live, saved)| Some((live.now, &*live.values, saved.as_ref()?)))
            .chain(others.iter().zip(&saved.others).map(|(now, saved)| (*now, &[][..], saved)))
            .collect();
        for (now, values, saved) in &all {
            complete(ways, world, *now, values, saved, &mut maps)?;
        }
        complete_resources(ways, world, &start.resources, &saved.resources, &mut maps)?;
        world.flush();
        // Observers of the game may have spawned some.
        despawn_others(world, baseline, &all.iter().map(|(now, ..)| *now).collect());
        let clock = (start.tick, now, &ages as Ages<'_>);
        for (now, values, saved) in &all {
            write(ways, world, |_, _| Some(*now), values, saved, &mut maps, clock)?;
        }
        let place = |world: &World, id| world.resource_entities().get(id);
        write(ways, world, place, &start.resources, &saved.resources, &mut maps, clock)?;
        forget_what_waits(world, start.tick);
        Ok(())
    }
}

/// Returns the components of an entity; none if it does not exist.
fn components(world: &World, entity: Entity) -> Vec<ComponentId> {
    world.get_entity(entity).map_or_else(|_| Vec::new(), |entity| entity.archetype().components().to_vec())
}

/// Returns all resources, with their entities.
fn resources(world: &World) -> Vec<(ComponentId, Entity)> {
    world.resource_entities().iter().collect()
}

/// Returns when a value was added, and when it has changed.
pub(super) fn ticks(world: &World, entity: Entity, id: ComponentId) -> Option<ComponentTicks> {
    world.get_entity(entity).ok()?.get_change_ticks_by_id(id)
}

/// Returns what is the same for the same entity at the start of a level, in each World: a hash of its types, and its
/// place.
fn kind(ways: &mut Ways, world: &World, entity: Entity) -> (u64, [u32; 3]) {
    let ways = components(world, entity).into_iter().filter_map(|id| ways.of(world, id));
    let mut types: Vec<TypeId> = ways.map(|way| way.type_id).collect();
    types.sort_unstable();
    let mut hasher = DefaultHasher::new();
    types.hash(&mut hasher);
    let place = world.get::<Transform>(entity).map_or([0; 3], |at| at.translation.to_array().map(f32::to_bits));
    (hasher.finish(), place)
}

fn start_value(ways: &mut Ways, world: &World, entity: Entity, id: ComponentId) -> Option<(Arc<Way>, Option<Value>)> {
    let way = ways.of(world, id).filter(|way| way.owner != Owner::Messages)?;
    let value = ways.copy(&way, world, entity);
    Some((way, value))
}

/// Returns a type of the game of which something was written or removed in this frame: systems that ran before have not
/// read it yet.
fn pending(ways: &mut Ways, world: &World, frame: Tick) -> Option<String> {
    let now = world.read_change_tick();
    for (id, entity) in resources(world) {
        if let Some(way) = ways.of(world, id).filter(|way| way.owner == Owner::Messages)
            && ticks(world, entity, id).is_some_and(|ticks| ticks.changed.is_newer_than(frame, now))
        {
            return Some(way.name.clone());
        }
    }
    let mut removed = world.removed_components().iter().filter(|(_, messages)| !messages.is_empty());
    removed.find_map(|(id, _)| ways.of(world, *id).filter(|way| way.owner == Owner::Game).map(|way| way.name.clone()))
}

fn saved(
    ways: &mut Ways,
    start: &Start,
    world: &World,
    baseline: &Baseline,
    frame: LastFrame,
) -> Result<SavedWhole, String> {
    let mut entities = Vec::with_capacity(start.entities.len());
    for live in &start.entities {
        let exists = world.get_entity(live.now).is_ok();
        let all = components(world, live.now).into_iter().map(|id| (id, live.now)).collect();
        let saved = saved_entity(ways, world, live.now, all, &live.values, Some(start.tick))?;
        entities.push(exists.then_some(saved));
    }
    let known: EntityHashSet = start.entities.iter().map(|live| live.now).collect();
    let mut others = Vec::new();
    for other in baseline.spawned(world).into_iter().filter(|entity| !known.contains(entity)) {
        let all = components(world, other).into_iter().map(|id| (id, other)).collect();
        others.push(saved_entity(ways, world, other, all, &[], None)?);
    }
    let all = resources(world);
    let resources = saved_entity(ways, world, Entity::PLACEHOLDER, all, &start.resources, Some(start.tick))?;
    Ok(SavedWhole { frame, kinds: start.kinds.clone(), entities, others, resources })
}

/// Returns the values that have changed since a tick, or all.
///
/// # Errors
///
/// One of them cannot be copied.
fn saved_entity(
    ways: &mut Ways,
    world: &World,
    at: Entity,
    all: Vec<(ComponentId, Entity)>,
    start: &[(Arc<Way>, Option<Value>)],
    since: Option<Tick>,
) -> Result<SavedEntity, String> {
    let now = world.read_change_tick();
    let mut saved = SavedEntity { at, values: Vec::new(), gone: Vec::new() };
    let lost = start.iter().filter(|(way, _)| !all.iter().any(|(id, _)| *id == way.id));
    saved.gone.extend(lost.map(|(way, _)| way.type_id));
    for (id, entity) in all {
        let Some(way) = ways.of(world, id).filter(|way| way.owner != Owner::Messages) else { continue };
        let Some(ticks) = ticks(world, entity, id) else { continue };
        if since.is_some_and(|since| !ticks.changed.is_newer_than(since, now)) && !way.is_engines {
            continue;
        }
        match ways.copy(&way, world, entity) {
            Some(value) => {
                let age = now.get().wrapping_sub(ticks.changed.get());
                saved.values.push(SavedValue { of: way.type_id, value, age });
            }
            None => demand(&way, since.is_none())?,
        }
    }
    Ok(saved)
}

/// Refuses to do without a value, unless it is one of Bevy's. An entity that is spawned again also needs its observers.
fn demand(way: &Way, is_spawned: bool) -> Result<(), String> {
    let Way { name, owner, .. } = way;
    if *owner != Owner::Game && !(is_spawned && name.ends_with("::Observer")) {
        return Ok(());
    }
    let way_out = match name.split("::").next() {
        Some(engine @ ("bevy_rapier2d" | "bevy_rapier3d")) => {
            format!("build `playbot` with the feature `{engine}`")
        }
        _ => "derive `Clone` or `Reflect` for it, or declare it with `.snapshot_of`".to_owned(),
    };
    Err(format!("`{name}` has changed or is gone, and cannot be copied: {way_out}"))
}

/// Despawns all entities of the game but these.
fn despawn_others(world: &mut World, baseline: &Baseline, kept: &EntityHashSet) {
    for entity in baseline.spawned(world).into_iter().filter(|entity| !kept.contains(entity)) {
        // Some are despawned with their parents.
        if let Ok(entity) = world.get_entity_mut(entity) {
            entity.despawn();
        }
    }
    world.flush();
}

/// Returns values that are missing: those of the state, and those of the start that have not changed. `present` are the
/// types that are there. The second result are the types that belong there.
fn missing(
    ways: &mut Ways,
    world: &World,
    present: &[ComponentId],
    start: &[(Arc<Way>, Option<Value>)],
    saved: &SavedEntity,
    (map, own): &mut (&mut EntityMap, &mut EntityMap),
) -> Result<(Vec<Made>, Vec<ComponentId>), String> {
    let (mut made, mut wanted) = (Vec::new(), Vec::new());
    for (way, value) in start.iter().filter(|(way, _)| !saved.gone.contains(&way.type_id)) {
        wanted.push(way.id);
        if !present.contains(&way.id) && !saved.has(way.type_id) {
            match value.as_ref().and_then(|value| way.make(value, own)) {
                Some(value) => made.push(value),
                None => demand(way, true)?,
            }
        }
    }
    for value in &saved.values {
        let way = ways.of_type(world, value.of).ok_or("a type of the state was never used in this World")?;
        wanted.push(way.id);
        if !present.contains(&way.id) {
            match way.make(&value.value, map) {
                Some(value) => made.push(value),
                None => demand(&way, true)?,
            }
        }
    }
    Ok((made, wanted))
}

/// Adds the components that an entity does not have, and removes others.
fn complete(
    ways: &mut Ways,
    world: &mut World,
    entity: Entity,
    start: &[(Arc<Way>, Option<Value>)],
    saved: &SavedEntity,
    maps: &mut (&mut EntityMap, &mut EntityMap),
) -> Result<(), String> {
    let present = components(world, entity);
    let (made, wanted) = missing(ways, world, &present, start, saved, maps)?;
    for id in present.into_iter().filter(|id| !wanted.contains(id)) {
        if ways.of(world, id).is_some()
            && let Ok(mut entity) = world.get_entity_mut(entity)
        {
            entity.remove_by_id(id);
        }
    }
    Made::insert(made, world, entity);
    Ok(())
}

/// Adds the resources that are missing, and removes others.
fn complete_resources(
    ways: &mut Ways,
    world: &mut World,
    start: &[(Arc<Way>, Option<Value>)],
    saved: &SavedEntity,
    maps: &mut (&mut EntityMap, &mut EntityMap),
) -> Result<(), String> {
    let present: Vec<ComponentId> = resources(world).into_iter().map(|(id, _)| id).collect();
    let (made, wanted) = missing(ways, world, &present, start, saved, maps)?;
    for id in present.into_iter().filter(|id| !wanted.contains(id)) {
        if ways.of(world, id).is_some_and(|way| way.owner == Owner::Game) {
            world.remove_resource_by_id(id);
        }
    }
    made.into_iter().for_each(|value| value.insert_resource(world));
    Ok(())
}

/// The age that a saved change has in this World.
type Ages<'a> = &'a dyn Fn(u32) -> u32;

/// Writes the values of a state, and those of the start over values that have changed since. `place` returns the entity
/// of a component or resource. The clock is the episode's start, the end of the last frame, and ages of changes by it.
fn write(
    ways: &mut Ways,
    world: &mut World,
    place: impl Fn(&World, ComponentId) -> Option<Entity>,
    start: &[(Arc<Way>, Option<Value>)],
    saved: &SavedEntity,
    (map, own): &mut (&mut EntityMap, &mut EntityMap),
    (begun, now, ages): (Tick, Tick, Ages<'_>),
) -> Result<(), String> {
    let since_begun = now.get().wrapping_sub(begun.get());
    for value in &saved.values {
        let Some(way) = ways.of_type(world, value.of) else { continue };
        let Some(entity) = place(world, way.id) else { continue };
        // What has changed in the episode stays newer than its start.
        let age = ages(value.age).min(since_begun.saturating_sub(1));
        way.write(world, entity, &value.value, map, Tick::new(now.get().wrapping_sub(age)));
    }
    // Values that hooks and observers have changed during the load are later than the last frame.
    let present = world.read_change_tick();
    for (way, value) in start.iter().filter(|(way, _)| !saved.gone.contains(&way.type_id) && !saved.has(way.type_id)) {
        let Some(entity) = place(world, way.id) else { continue };
        if ticks(world, entity, way.id).is_some_and(|ticks| ticks.changed.is_newer_than(begun, present)) {
            match value {
                Some(value) => way.write(world, entity, value, own, begun),
                None => demand(way, false)?,
            }
        }
    }
    Ok(())
}

/// Drops all messages, and the records of removed components. Those of the state were read before it was saved.
fn forget_what_waits(world: &mut World, begun: Tick) {
    if world.contains_resource::<MessageRegistry>() {
        world.resource_scope(|world, mut registry: Mut<MessageRegistry>| {
            // Two buffers of each type.
            registry.run_updates(world, begun);
            registry.run_updates(world, begun);
        });
    }
    forget_engines(world);
    world.clear_trackers();
    world.clear_trackers();
}
