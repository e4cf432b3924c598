//! A running copy of a game, whose agents play a script of random actions.

use crate::{
    doctor,
    doctor::{cause::CauseKind, steps::holds_keys},
    foreign::LeftMessages,
    game::Game,
    saved_episode::SavedEpisode,
    worlds::{build_world, other_agents},
};
use bevy::{
    ecs::{
        component::ComponentInfo, entity::EntityHashMap, observer::Observer, reflect::AppTypeRegistry,
        resource::IsResource, system::SystemIdMarker,
    },
    prelude::{ReflectComponent, World, *},
    reflect::{TypeInfo, TypeRegistration},
    time::{Real, TimeSystems},
};
use bevy_playbot::{
    action::{Action, ActionSpace},
    agent::{Agent, Control},
    bot::uniform,
    engine::{Renewal, into_world, tick_world},
    episode::{Episode, EpisodeEnd, EpisodeEnded},
    headless::headless_app,
    legal::RedrawsIllegal,
    level::LevelQueue,
    observation::{Observation, VectorSensor},
    reward::Reward,
    state_hash::StateHash,
    streams::AgentStreams,
};
use serde::Serialize;
use std::{
    any::TypeId,
    collections::{BTreeMap, BTreeSet},
};

/// A World with its agents.
pub(super) struct GameCopy {
    pub world: World,
    pub agents: Vec<Entity>,
    pub census: Census,
    /// The fault or panic after which the copy is not ticked any more.
    pub fault: Option<String>,
    first: u32,
    space: ActionSpace,
    scripts: Vec<AgentStreams>,
    /// Ticks of the script.
    played: u32,
    in_prelude: bool,
}

impl GameCopy {
    /// Builds a World with agents `first..first + count`, all in the same level.
    pub fn new(game: &dyn Game, plan: &Plan, first: u32, count: u32) -> Self {
        let (mut world, agents) = build_world(game, plan.mode, plan.seed, first, count);
        prepare(&mut world);
        for &agent in &agents {
            // Replay without a recording: no other controller decides, and virtual input acts.
            world.entity_mut(agent).insert((Control::Replay, LevelQueue::Always(plan.level)));
        }
        let scripts = (first..first + count).map(|number| AgentStreams::new(plan.seed, number)).collect();
        let (census, fault, space) = (Census::default(), None, game.actions());
        Self { world, agents, census, fault, first, space, scripts, played: 0, in_prelude: false }
    }

    /// Returns the number of an agent.
    pub fn number(&self, agent: usize) -> u32 {
        self.first + agent as u32
    }

    /// Draws the actions of all agents and runs one tick. A fault or a panic ends this copy, as does a game that despawns
    /// or spawns an agent.
    pub fn tick(&mut self) {
        if self.fault.is_some() {
            return;
        }
        for (&agent, script) in self.agents.iter().zip(&mut self.scripts) {
            let draws = if self.in_prelude { &mut script.skill } else { &mut script.action };
            // The mask of the tick is not known yet. Further draws would change the script of games without one.
            let redraw = RedrawsIllegal { random: self.played };
            self.world.entity_mut(agent).insert((Action(uniform(&self.space, draws)), redraw));
        }
        self.played = self.played.wrapping_add(u32::from(!self.in_prelude));
        self.world.resource_mut::<Ends>().0.clear();
        let before = self.world.id();
        let fault = tick_world(&mut self.world).err().map(|fault| fault.to_string());
        self.fault = fault.or_else(|| other_agents(&self.world, &self.agents, self.first));
        if self.world.id() != before {
            // Another World has replaced it, with other entities.
            self.census = Census::default();
        }
        self.census.update(&self.world);
    }

    /// Plays another episode first, with other actions, to its end or for at most `limit` ticks.
    pub fn play_prelude(&mut self, plan: &Plan, limit: u32) {
        self.in_prelude = true;
        self.set_level(plan.before.unwrap_or(plan.level));
        for _ in 0..limit {
            self.tick();
            let ended = |agent: &Entity| self.world.get::<Episode>(*agent).is_some_and(|episode| !episode.is_running());
            if self.fault.is_some() || self.agents.iter().all(ended) {
                break;
            }
        }
        for &agent in &self.agents {
            if let Some(mut episode) = self.world.get_mut::<Episode>(agent) {
                episode.abandon();
            }
        }
        self.set_level(plan.level);
        self.in_prelude = false;
    }

    /// Lets all further episodes be of this level.
    fn set_level(&mut self, level: u64) {
        for &agent in &self.agents {
            // An agent may be gone: that is a fault of the copy.
            if let Ok(mut agent) = self.world.get_entity_mut(agent) {
                agent.insert(LevelQueue::Always(level));
            }
        }
    }

    /// Saves the first agent's episode, plays on with other actions for at most `limit` ticks or to the end, and returns
    /// to the saved tick. A fault on the way stays in this copy.
    pub fn make_detour(&mut self, game: &dyn Game, limit: u32) -> Detour {
        let agent = self.agents[0];
        let Some(saved) = SavedEpisode::of(game, &self.world, agent) else { return Detour::NotSaved };
        self.in_prelude = true;
        for _ in 0..limit {
            self.tick();
            if self.fault.is_some() || self.end(0).is_some() {
                break;
            }
        }
        self.in_prelude = false;
        let is_back = self.fault.is_some() || saved.restore(game, &mut self.world, agent);
        if is_back { Detour::Made } else { Detour::NotLoaded }
    }

    /// Returns an agent's outcome of the tick.
    pub fn outcome(&self, agent: usize) -> Outcome {
        let entity = self.agents[agent];
        let observation = self.world.get::<Observation>(entity).cloned().unwrap_or_default();
        Outcome {
            observation: observation.vector,
            image: observation.image,
            reward: self.world.get::<Reward>(entity).map_or(0.0, Reward::get),
            hash: self.world.get::<StateHash>(entity).map_or(0, |hash| hash.0),
            end: self.end(agent),
        }
    }

    /// Returns how an agent's episode ended in this tick, if it did.
    pub fn end(&self, agent: usize) -> Option<EpisodeEnd> {
        let (entity, ends) = (self.agents[agent], &self.world.resource::<Ends>().0);
        ends.iter().find(|(ended, _)| *ended == entity).map(|(_, end)| *end)
    }

    /// Returns the names of the values that agents observe.
    pub fn observed_names(&self) -> Vec<String> {
        let sensor = self.agents.first().and_then(|&agent| self.world.get::<VectorSensor>(agent));
        sensor.map(|sensor| sensor.space().names.clone()).unwrap_or_default()
    }

    /// Returns whether actions of the first agent hold keys or buttons.
    pub fn holds_keys(&self) -> bool {
        self.agents.first().is_some_and(|&agent| holds_keys(&self.world, agent))
    }

    /// Returns the types of all components and resources in this World.
    pub fn present_types(&self) -> BTreeSet<TypeId> {
        let archetypes = self.world.archetypes().iter().filter(|archetype| !archetype.is_empty());
        archetypes.flat_map(|archetype| types_of(&self.world, archetype.components())).collect()
    }
}

/// The game, mode and level that are played.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan<'a> {
    pub mode: &'a str,
    pub level: u64,
    /// Another level, which a copy plays before this one.
    pub before: Option<u64>,
    /// Random seed of the World and of the actions.
    pub seed: u64,
}

/// The result of leaving an episode and returning to it by a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Detour {
    /// The copy is back, or has a fault.
    Made,
    /// The game saved nothing in this tick, and the copy has not left it.
    NotSaved,
    /// The game could not load the snapshot, so the copy is elsewhere.
    NotLoaded,
}

/// An agent's observation, reward and end in a tick.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outcome {
    pub observation: Vec<f32>,
    pub image: Vec<u8>,
    pub reward: f32,
    pub hash: u64,
    pub end: Option<EpisodeEnd>,
}

/// Ends of episodes in this tick.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct Ends(Vec<(Entity, EpisodeEnd)>);

/// Adds the examination's own systems and components.
fn prepare(world: &mut World) {
    Renewal::set_up(world, |world| {
        world.init_resource::<Ends>();
        world.init_resource::<LeftMessages>();
        world.add_observer(|event: On<EpisodeEnded>, mut ends: ResMut<Ends>| ends.0.push((event.entity, event.end)));
    });
}

/// Builds a World with the plugin and an agent, without a game, to distinguish the game's types from the others.
pub(super) fn bare_world() -> World {
    let mut world = into_world(headless_app());
    prepare(&mut world);
    world.spawn((Agent::new(0, ActionSpace::Discrete(1)), VectorSensor::new(["nothing"])));
    world
}

// Entities of the game, in the order in which they were spawned.

/// The key by which entities of two Worlds are matched: the name, and the game's own components. Components of the
/// engine come and go with the loading of files.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct GroupKey {
    /// Number of the agent, if it is one.
    pub agent: Option<u32>,
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Components of the game.
    pub types: Vec<TypeId>,
}

/// Entities of the same kind, in the order of their spawning.
pub(super) type Groups = BTreeMap<GroupKey, Vec<Entity>>;

/// Numbers entities in the order of their spawning, from tick to tick. Their ids are reused after a despawn, in another
/// order.
#[derive(Default)]
pub(super) struct Census {
    numbers: EntityHashMap<u64>,
    next: u64,
}

impl Census {
    /// Adds new entities and removes despawned ones. Call it after each tick.
    pub fn update(&mut self, world: &World) {
        let mut numbers = EntityHashMap::default();
        let mut new = Vec::new();
        for (place, entity) in game_entities(world).into_iter().enumerate() {
            match self.numbers.get(&entity) {
                Some(&number) => {
                    numbers.insert(entity, number);
                }
                // Entities of one kind lie in the order in which they came.
                None => new.push((world.entity(entity).spawn_tick().get(), place, entity)),
            }
        }
        new.sort();
        for (_, _, entity) in new {
            numbers.insert(entity, self.next);
            self.next += 1;
        }
        self.numbers = numbers;
    }

    /// Returns all entities, by kind.
    pub fn groups(&self, world: &World, known_types: &KnownTypes) -> Groups {
        let mut numbered: Vec<_> = self.numbers.iter().map(|(&entity, &number)| (number, entity)).collect();
        numbered.sort();
        let mut groups = Groups::new();
        for (_, entity) in numbered {
            groups.entry(key(world, entity, known_types)).or_default().push(entity);
        }
        groups
    }
}

/// Returns every entity except those with resources, observers and systems.
fn game_entities(world: &World) -> Vec<Entity> {
    let components = world.components();
    let hidden = [
        components.component_id::<IsResource>(),
        components.component_id::<Observer>(),
        components.component_id::<SystemIdMarker>(),
    ];
    let archetypes = world.archetypes().iter();
    let shown = archetypes.filter(|archetype| !hidden.iter().flatten().any(|&id| archetype.contains(id)));
    shown.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id())).collect()
}

fn key(world: &World, entity: Entity, known_types: &KnownTypes) -> GroupKey {
    let entity = world.entity(entity);
    let types = types_of(world, entity.archetype().components());
    GroupKey {
        agent: entity.get::<Agent>().map(|agent| agent.index),
        name: entity.get::<Name>().map(|name| name.as_str().to_owned()),
        types: types.into_iter().filter(|id| known_types.get(*id).is_some_and(|known| !known.engine)).collect(),
    }
}

/// Returns the types of components, in an order that is the same in all Worlds of a process.
pub(super) fn types_of(world: &World, components: &[bevy::ecs::component::ComponentId]) -> Vec<TypeId> {
    let infos = components.iter().filter_map(|&id| world.components().get_info(id));
    let mut types: Vec<_> = infos.filter_map(|info| info.type_id()).collect();
    types.sort();
    types
}

// Types of components and resources that are compared.

/// The types of the game, by whether they could be compared.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TypesReport {
    /// Components and resources that were compared field by field.
    pub compared: Vec<String>,
    /// Components and resources that were not compared, since they are not reflected. A difference in one of them shows
    /// only later, in observations, rewards and ends of episodes, and in the state hash.
    pub not_reflected: Vec<String>,
    /// Further types without known names, because Bevy is built without its feature `debug`.
    pub unnamed: usize,
    /// Types of fields that are reflected and cannot be compared.
    pub incomparable: Vec<String>,
    /// Diagnostics, counters and clocks of known engines, which are not compared by default.
    pub left_out: Vec<String>,
}

/// One type of component or resource.
pub(super) struct KnownType {
    /// Its path, if it is known.
    pub path: Option<String>,
    /// Its reader, if it is reflected.
    pub reflect: Option<ReflectComponent>,
    /// True if it belongs to the engine or to the plugin.
    pub engine: bool,
    /// True if it is left out by default, and nothing else was asked for.
    pub is_left_out: bool,
    /// Possible causes of a difference in it, and why.
    pub suspicions: Vec<(CauseKind, String)>,
}

impl KnownType {
    /// Returns whether values of this type are compared.
    pub fn is_compared(&self) -> bool {
        self.reflect.is_some() && !self.is_left_out && self.path.as_deref().is_some_and(doctor::is_compared)
    }

    /// Returns the last part of the path.
    pub fn short_name(&self) -> Option<&str> {
        let plain = self.path.as_deref()?.split('<').next()?;
        plain.rsplit("::").next()
    }
}

/// All types so far.
pub(super) struct KnownTypes {
    known: BTreeMap<TypeId, KnownType>,
    /// Types of a World without a game.
    bare: BTreeSet<TypeId>,
    /// True if diagnostics of known engines are left out.
    default_ignores: bool,
}

impl KnownTypes {
    /// Starts with a World without a game, which has only the engine's and the plugin's types.
    pub fn new(bare: &World, default_ignores: bool) -> Self {
        let engine = bare.components().iter_registered().filter_map(ComponentInfo::type_id);
        Self { known: BTreeMap::new(), bare: engine.collect(), default_ignores }
    }

    /// Adds types that are new in a World.
    pub fn learn(&mut self, world: &World) {
        let registry = world.get_resource::<AppTypeRegistry>().map(|registry| registry.read());
        for info in world.components().iter_registered() {
            let Some(id) = info.type_id() else { continue };
            if self.known.contains_key(&id) {
                continue;
            }
            let registration = registry.as_ref().and_then(|registry| registry.get(id));
            let path = registration.map(|known| known.type_info().type_path().to_owned()).or_else(|| named(info));
            let is_engine = self.bare.contains(&id) || path.as_deref().is_some_and(doctor::is_engine);
            let reflect = registration.and_then(|known| known.data::<ReflectComponent>().cloned());
            let is_diagnostic = reflect.is_some() && path.as_deref().is_some_and(is_diagnostic);
            let known = KnownType {
                path,
                reflect,
                engine: is_engine,
                is_left_out: self.default_ignores && is_diagnostic,
                suspicions: registration.map(suspicions).unwrap_or_default(),
            };
            self.known.insert(id, known);
        }
    }

    /// Returns a type by its id.
    pub fn get(&self, id: TypeId) -> Option<&KnownType> {
        self.known.get(&id)
    }

    /// Returns the game's types in a copy, by whether they can be compared.
    pub fn report(&self, copy: &GameCopy, incomparable: &BTreeSet<String>) -> TypesReport {
        let mut report = TypesReport { incomparable: incomparable.iter().cloned().collect(), ..Default::default() };
        for known in copy.present_types().into_iter().filter_map(|id| self.get(id)) {
            match (&known.path, known.is_compared(), known.engine) {
                (Some(path), ..) if known.is_left_out => report.left_out.push(path.clone()),
                (Some(path), true, _) => report.compared.push(path.clone()),
                (_, _, true) => {}
                (Some(path), ..) => report.not_reflected.push(path.clone()),
                (None, ..) => report.unnamed += 1,
            }
        }
        report.compared.sort();
        report.not_reflected.sort();
        report.left_out.sort();
        report
    }

    /// Returns the possible causes of a difference in the types of a copy.
    pub fn suspicions(&self, copy: &GameCopy) -> Vec<(CauseKind, String)> {
        let present = copy.present_types();
        let game = present.into_iter().filter_map(|id| self.get(id)).filter(|known| !known.engine);
        let mut all: Vec<_> = game.flat_map(|known| known.suspicions.clone()).collect();
        all.sort();
        all.dedup();
        all
    }
}

/// Returns the name of a type that is not reflected. Bevy knows it only with its feature `debug`.
fn named(info: &ComponentInfo) -> Option<String> {
    let name = info.name().to_string();
    (!name.starts_with('<')).then_some(name)
}

/// Words in the path of a field's type, and the causes that they point to.
const SIGNS: [(&str, CauseKind); 6] = [
    ("RandomState", CauseKind::HashOrder),
    ("::Instant", CauseKind::WallClock),
    ("SystemTime", CauseKind::WallClock),
    ("Rng", CauseKind::Randomness),
    ("rand::", CauseKind::Randomness),
    ("fastrand", CauseKind::Randomness),
];

fn suspicions(registration: &TypeRegistration) -> Vec<(CauseKind, String)> {
    let info = registration.type_info();
    let fields: Vec<(String, &'static str)> = match info {
        TypeInfo::Struct(parts) => {
            parts.iter().map(|field| (format!(".{}", field.name()), field.type_path())).collect()
        }
        TypeInfo::TupleStruct(parts) => {
            parts.iter().map(|field| (format!(".{}", field.index()), field.type_path())).collect()
        }
        _ => Vec::new(),
    };
    let own = (String::new(), info.type_path());
    let found = fields.into_iter().chain([own]).flat_map(|(field, path)| {
        let signs = SIGNS.iter().filter(move |(sign, _)| path.contains(sign));
        signs.map(move |(_, kind)| (*kind, format!("`{}{field}` is a `{path}`", info.type_path_table().short_path())))
    });
    found.collect()
}

// Additional archetypes, to reveal games that depend on their order.

/// Copies with other numbers of archetypes. One of several shows a difference that another may hide by chance.
pub(super) const VARIANTS: u32 = 7;

#[derive(Component, Reflect)]
#[reflect(Component)]
struct FirstPair;

#[derive(Component, Reflect)]
#[reflect(Component)]
struct Second;

#[derive(Component, Reflect)]
#[reflect(Component)]
struct Third;

/// Creates `count` archetypes, at most 7, before those of the game's start.
///
/// Bevy's queries go over archetypes in an order that depends on their numbers, and these depend on how many archetypes
/// there were before. A recorder, a window and every plugin add some.
pub(super) fn add_archetypes(world: &mut World, count: u32) {
    Renewal::set_up(world, move |world| (1..=count).for_each(|kinds| add_archetype(world, kinds)));
}

/// Creates the archetype of these components, one bit for each.
fn add_archetype(world: &mut World, kinds: u32) {
    let mut entity = world.spawn_empty();
    if kinds & 1 != 0 {
        entity.insert(FirstPair);
    }
    if kinds & 2 != 0 {
        entity.insert(Second);
    }
    if kinds & 4 != 0 {
        entity.insert(Third);
    }
    entity.despawn();
}

// Slower wall clock, to reveal games that read it.

/// `Time<Real>` before this frame, and whether it runs slower in this World.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct WallClock {
    before: Time<Real>,
    is_slow: bool,
}

/// Makes `Time<Real>` of a World run slower than its ticks say if `is_slow`, by a little more in some frames than in
/// others.
///
/// Without a window a frame lasts exactly a tick, so reading the wall clock changes nothing there. In a window it
/// changes everything.
///
/// A World with the normal clock gets the same resource and systems. So two Worlds differ only in the clock, and have
/// the same number of archetypes.
pub(super) fn add_wall_clock(world: &mut World, is_slow: bool) {
    Renewal::set_up(world, move |world| add_one(world, is_slow));
}

fn add_one(world: &mut World, is_slow: bool) {
    let Some(now) = world.get_resource::<Time<Real>>() else { return };
    let clock = WallClock { before: *now, is_slow };
    world.insert_resource(clock);
    let mut schedules = world.resource_mut::<Schedules>();
    schedules.add_systems(First, (keep.before(TimeSystems), slow.after(TimeSystems)));
}

fn keep(real: Res<Time<Real>>, mut clock: ResMut<WallClock>) {
    clock.before = *real;
}

fn slow(mut real: ResMut<Time<Real>>, clock: Res<WallClock>, mut frame: Local<u32>) {
    *frame += 1;
    if !clock.is_slow {
        return;
    }
    let delta = real.delta();
    let mut slower = clock.before;
    slower.advance_by(delta + delta / 8 * (1 + *frame % 3));
    // The next frame's reference stays unchanged, so game time is unaffected.
    *slower.context_mut() = *real.context();
    *real = slower;
}

// Diagnostics, counters and clocks of known engines, which comparisons leave out by default.

/// Crates of physics engines.
const PHYSICS: [&str; 4] = ["avian2d::", "avian3d::", "bevy_rapier2d::", "bevy_rapier3d::"];

/// Types of theirs that count runs or follow the screen, by the last part of the path: modules differ from version to
/// version.
const COUNTERS: [&str; 4] =
    ["LastPhysicsTick", "PhysicsDiagnosticsUiSettings", "SimulationToRenderTime", "DebugRenderContext"];

/// Bevy's overlays, with frame times. `bevy_diagnostic` is never compared.
const OVERLAYS: &str = "bevy_dev_tools::";

/// Returns whether a type holds only measurements of an engine: how long its parts took, how often they ran, or its own
/// copy of a clock.
fn is_diagnostic(path: &str) -> bool {
    let is_of_physics = |path: &str| PHYSICS.iter().any(|engine| path.starts_with(engine));
    // `Time<Physics>` and `Time<Substeps>`.
    if let Some(clock) = path.strip_prefix("bevy_time::time::Time<") {
        return is_of_physics(clock);
    }
    let plain = path.split('<').next().unwrap_or(path);
    let name = plain.rsplit("::").next().unwrap_or(plain);
    path.starts_with(OVERLAYS) || (is_of_physics(path) && (name.ends_with("Diagnostics") || COUNTERS.contains(&name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_playbot::{
        engine::{into_world, tick_world},
        headless::headless_app,
    };

    #[derive(Component)]
    struct Brick;

    fn order(world: &World, census: &Census) -> Vec<Entity> {
        let groups = census.groups(world, &KnownTypes::new(&World::new(), true));
        groups.into_values().flatten().collect()
    }

    #[test]
    fn entities_stand_in_the_order_in_which_they_came_whatever_ids_they_got() {
        let (mut world, mut census) = (World::new(), Census::default());
        let old: Vec<_> = (0..3).map(|_| world.spawn(Brick).id()).collect();
        census.update(&world);
        assert_eq!(order(&world, &census), old);
        world.despawn(old[0]);
        world.despawn(old[1]);
        let new: Vec<_> = (0..2).map(|_| world.spawn(Brick).id()).collect();
        census.update(&world);
        assert_eq!(order(&world, &census), [old[2], new[0], new[1]]);
    }

    #[test]
    fn resources_and_observers_are_no_entities_of_the_game() {
        let (mut world, mut census) = (World::new(), Census::default());
        world.init_resource::<bevy_playbot::episode::Tick>();
        world.add_observer(|_: On<Add, Brick>| {});
        let brick = world.spawn(Brick).id();
        census.update(&world);
        assert_eq!(order(&world, &census), [brick]);
    }

    #[test]
    fn each_number_makes_another_archetype() {
        let mut world = World::new();
        let before = world.archetypes().len();
        add_archetypes(&mut world, 7);
        assert_eq!(world.archetypes().len(), before + 7);
    }

    /// A World with the normal clock and one with the slow one, after five ticks.
    fn ticked() -> [World; 2] {
        [false, true].map(|is_slow| {
            let mut world = into_world(headless_app());
            add_wall_clock(&mut world, is_slow);
            (0..5).for_each(|_| tick_world(&mut world).expect("there is no agent"));
            world
        })
    }

    #[test]
    fn only_the_wall_clock_is_slower() {
        let worlds = ticked();
        let [normal, slower] = worlds.each_ref().map(|world| world.resource::<Time<Real>>().elapsed());
        assert!(slower > normal, "{slower:?} against {normal:?}");
        let [normal, same] = worlds.each_ref().map(|world| world.resource::<Time<Virtual>>().elapsed());
        assert_eq!(normal, same);
    }

    #[test]
    fn the_default_clock_is_as_it_is_without_this() {
        let mut bare = into_world(headless_app());
        (0..5).for_each(|_| tick_world(&mut bare).expect("there is no agent"));
        let [normal, _] = ticked();
        assert_eq!(normal.resource::<Time<Real>>().elapsed(), bare.resource::<Time<Real>>().elapsed());
    }

    #[test]
    fn both_worlds_have_the_same_archetypes() {
        let [normal, slower] = ticked().map(|world| world.archetypes().len());
        assert_eq!(normal, slower);
    }

    #[test]
    fn measurements_of_engines_are_left_out() {
        for path in [
            "avian2d::dynamics::solver::diagnostics::SolverDiagnostics",
            "avian3d::collision::diagnostics::CollisionDiagnostics",
            "avian2d::spatial_query::diagnostics::SpatialQueryDiagnostics",
            "avian2d::diagnostics::total::PhysicsTotalDiagnostics",
            "avian3d::diagnostics::entity_counters::PhysicsEntityDiagnostics",
            "avian3d::picking::PhysicsPickingDiagnostics",
            "avian2d::diagnostics::ui::PhysicsDiagnosticsUiSettings",
            "avian2d::schedule::LastPhysicsTick",
            "bevy_time::time::Time<avian2d::schedule::time::Physics>",
            "bevy_time::time::Time<avian3d::schedule::time::Substeps>",
            "bevy_rapier2d::plugin::context::SimulationToRenderTime",
            "bevy_rapier3d::render::DebugRenderContext",
            "bevy_dev_tools::fps_overlay::FpsOverlayConfig",
        ] {
            assert!(is_diagnostic(path), "{path}");
        }
    }

    #[test]
    fn simulated_state_and_measurements_of_games_are_compared() {
        for path in [
            "avian2d::dynamics::rigid_body::LinearVelocity",
            "avian2d::dynamics::integrator::Gravity",
            "bevy_rapier2d::dynamics::rigid_body::Velocity",
            "bevy_time::time::Time<bevy_time::fixed::Fixed>",
            "my_game::SolverDiagnostics",
            "my_game::LastPhysicsTick",
            "avian2d_extras::Diagnostics",
        ] {
            assert!(!is_diagnostic(path), "{path}");
        }
    }
}
