//! Worlds of a game: headless, with any number of agents, ready to be ticked on any thread.

use crate::{
    benchmark::{StageClock, add_readings},
    game::{Game, idle_action, level_designs},
    level_files::is_level_files,
    randomise::Randomise,
    sensors::GameSensors,
};
use bevy::{app::Main, ecs::schedule::SingleThreadedExecutor, prelude::*};
use bevy_playbot::{
    action::ActionValue,
    agent::{Agent, AgentOrder, Control},
    bot::BlindBot,
    engine::{
        AgentLimit, NextEpisode, PlaysAlong, Renewal, headless_frame_app, into_world,
        panics::{self, EpisodeTrace, PanicReports},
        set_tick_rate, tick_world,
    },
    episode::{EpisodeEnded, EpisodeResult, Tick},
    fault::{Fault, Faults},
    headless::{HeadlessPlugins, PlaybotAppExt, headless_app},
    legal::IdleAction,
    level::LevelQueue,
    observation::{Observation, VectorSensor},
    placement::TickPlacement,
    reward::Reward,
    state_hash::StateHash,
    streams::PlaybotSeed,
    vision::{ObservationConfig, VisionError},
};
use std::{
    collections::BTreeSet,
    fmt,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Instant,
};

/// The number of Worlds that were built, and the time that this took. It is for the log: no result depends on it.
#[derive(Debug, Default)]
pub(crate) struct BuildingCosts {
    worlds: AtomicU64,
    microseconds: AtomicU64,
}

impl BuildingCosts {
    /// Builds a World, on any thread, and counts it.
    pub(crate) fn of<T>(&self, build: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let built = build();
        let spent = u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.worlds.fetch_add(1, Ordering::Relaxed);
        self.microseconds.fetch_add(spent, Ordering::Relaxed);
        built
    }
}

impl fmt::Display for BuildingCosts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let worlds = self.worlds.load(Ordering::Relaxed);
        let each = self.microseconds.load(Ordering::Relaxed) / worlds.max(1);
        let noun = if worlds == 1 { "World" } else { "Worlds" };
        write!(formatter, "{worlds} {noun} built, {:.3} s each", each as f64 / 1e6)
    }
}

/// Builds a World of a game with agents `first..first + count`, all idle, ready to be ticked on any thread. They see
/// vectors.
///
/// Returns the World and its agents in the order of their numbers. If the game panics meanwhile, each tick of the World is
/// a fault that says so.
pub fn build_world(game: &dyn Game, mode: &str, seed: u64, first: u32, count: u32) -> (World, Vec<Entity>) {
    build_observing_world(game, mode, &ObservationConfig::default(), seed, first, count)
        .expect("nothing can be wrong with a vector")
}

/// Builds a World as [`build_world`] does, with agents that see vectors or pictures.
///
/// # Errors
///
/// Pictures cannot be made: see [`VisionError`].
pub fn build_observing_world(
    game: &dyn Game,
    mode: &str,
    observation_config: &ObservationConfig,
    seed: u64,
    first: u32,
    count: u32,
) -> Result<(World, Vec<Entity>), VisionError> {
    let (mut world, agents) = build_once(game, mode, observation_config, seed, first, count)?;
    if let Some(game) = game.built_anew() {
        let (mode, observation_config) = (mode.to_owned(), *observation_config);
        world.insert_resource(Renewal::new(move || {
            let built = build_once(&*game, &mode, &observation_config, seed, first, count);
            let (world, _) = built.map_err(|error| Fault(error.to_string()))?;
            panics::refusal(&world).map_or(Ok(world), Err)
        }));
        Renewal::carry_resource::<StageClock>(&mut world);
    }
    Ok((world, agents))
}

/// Checks that a World of the game can be built and that its startup systems run, and drops it. Verbs call it before they
/// print or write anything, so that a game that cannot start is reported by its first panic, and not by a consequence.
///
/// `report` gets the panic of a startup system at once, before Bevy prints the system's name. A mode that the game does
/// not have is not checked.
///
/// # Errors
///
/// The game panicked: the panic's message, with its file, its line and, if they are known, its plugin or system.
pub fn check_start(game: &dyn Game, mode: &str, level: u64, report: fn(&str)) -> Result<(), Fault> {
    check_start_and_look(game, mode, level, report, |_, _| {})
}

/// Checks as [`check_start`] does. `look` gets the World and its agent after the first tick, unless the game panicked.
///
/// # Errors
///
/// As for [`check_start`].
pub fn check_start_and_look(
    game: &dyn Game,
    mode: &str,
    level: u64,
    report: fn(&str),
    look: impl FnOnce(&World, Entity),
) -> Result<(), Fault> {
    if game.check_mode(mode).is_err() {
        return Ok(());
    }
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    if let Some(fault) = panics::refusal(&world) {
        return Err(fault);
    }
    // Startup systems may read the level, but without an agent that plays it does not begin: a panic belongs to no level.
    world.trigger(NextEpisode { entity: agents[0], level });
    let started = panics::report_at_once(report, || world.tick());
    if panics::refusal(&world).is_some() {
        return started;
    }
    // Other faults are those of a level, too.
    look(&world, agents[0]);
    Ok(())
}

/// Checks that each path of [`Randomise`] leads to a number in a level, in a World of its own. Without paths no World is
/// built.
///
/// # Errors
///
/// The path, and where it leads; or the game's own fault in its first tick.
pub fn check_randomised(randomise: &Randomise, game: &dyn Game, mode: &str, level: u64) -> Result<(), Fault> {
    if randomise.is_empty() {
        return Ok(());
    }
    let (mut world, agents) = build_world(game, mode, 0, 0, game.tools().host.agents_per_arena().max(1));
    randomise.install(&mut world);
    for agent in agents {
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(level)));
    }
    tick_world(&mut world)
}

/// Builds a World. If the game panics meanwhile, the World has no game, and each of its ticks is this fault.
fn build_once(
    game: &dyn Game,
    mode: &str,
    observation_config: &ObservationConfig,
    seed: u64,
    first: u32,
    count: u32,
) -> Result<(World, Vec<Entity>), VisionError> {
    observation_config.check(game)?;
    let build = |plugins: HeadlessPlugins| {
        panics::hear(|| -> Result<(World, Vec<Entity>), VisionError> {
            let mut world = build_game(game, mode, observation_config, seed, plugins)?;
            let agents = spawn_agents(game, &mut world, observation_config, first, count);
            Ok((world, agents))
        })
    };
    let plugins = observation_config.headless_plugins();
    let is_known = asking_games().contains(game.name());
    let mut built = build(if is_known { plugins.with_render_app() } else { plugins });
    if !is_known && built.as_ref().is_err_and(|words| panics::lacks_render_app(words)) {
        asking_games().insert(game.name());
        built = build(plugins.with_render_app());
    }
    let (mut world, agents) = match built {
        Ok(built) => built?,
        Err(words) => refused_world(game, mode, &words, first, count),
    };
    for &agent in &agents {
        world.entity_mut(agent).insert(EpisodeTrace::default());
    }
    Ok((world, agents))
}

/// Returns the games whose plugins have panicked for want of Bevy's `RenderApp`, so that only their first World is built
/// twice. An app that panics while it is built has pictures to load and no loader, so Bevy never frees its assets.
fn asking_games() -> MutexGuard<'static, BTreeSet<&'static str>> {
    static ASKING: Mutex<BTreeSet<&str>> = Mutex::new(BTreeSet::new());
    ASKING.lock().unwrap_or_else(PoisonError::into_inner)
}

fn build_game(
    game: &dyn Game,
    mode: &str,
    observation_config: &ObservationConfig,
    seed: u64,
    plugins: HeadlessPlugins,
) -> Result<World, VisionError> {
    let host = game.tools().host;
    let mut app = match host.placement() {
        TickPlacement::Fixed => {
            let mut app = headless_app();
            set_tick_rate(&mut app, game.tick_hz());
            app
        }
        TickPlacement::Frame => headless_frame_app(host.headless_plugins(plugins), game.tick_hz()),
    };
    add_game(game, &mut app, mode, observation_config, seed)?;
    PanicReports::new(game.demo_header(mode), std::env::temp_dir()).add_to(&mut app);
    Ok(into_world(app))
}

/// Builds a World of a game [alone](crate::game::HostTools::bare_app), to run its frames with [`run_bare`]. Its systems run
/// on the calling thread, as those of all Worlds do. `None` if the game has no such form.
pub fn build_bare_world(game: &dyn Game) -> Option<World> {
    let mut app = game.tools().host.bare_app()?;
    app.finish();
    app.cleanup();
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    Some(std::mem::take(app.world_mut()))
}

/// Runs frames of a World without playbot, as `App::update` does.
pub fn run_bare(world: &mut World, frames: u64) {
    for _ in 0..frames {
        world.run_schedule(Main);
        world.clear_trackers();
    }
}

/// Builds a World with agents and without the game, whose ticks all say how the game panicked.
fn refused_world(game: &dyn Game, mode: &str, words: &str, first: u32, count: u32) -> (World, Vec<Entity>) {
    let mut app = headless_app();
    PanicReports::new(game.demo_header(mode), std::env::temp_dir()).add_to(&mut app);
    let mut world = into_world(app);
    panics::refuse(&mut world, build_panic(game, words).0);
    let sensor = || VectorSensor::new(game.observation().names);
    let agents = (first..first + count).map(|index| world.spawn((Agent::new(index, game.actions()), sensor())).id());
    let agents = agents.collect();
    (world, agents)
}

/// Returns the fault of a game that panicked while it was added to an app, with these words, and what to do.
pub fn build_panic(game: &dyn Game, words: &str) -> Fault {
    let mut fault = format!("the game `{}` panicked when it was added to the app: {words}", game.name());
    if words.contains("plugin was already added") {
        fault += ". Playbot adds Bevy's own plugins: leave `DefaultPlugins`, or this one of them, out of the function that \
                  is given to `ForeignGame::new`";
    }
    if panics::lacks_render_app(words) {
        fault += ". A World without a screen has no renderer when plugins are finished: let the plugin ask with \
                  `get_sub_app_mut(RenderApp)`, or add it only where `app.get_sub_app(RenderApp)` is there";
    }
    Fault(fault)
}

/// Adds a game and the sensors of its agents to an app that has the
/// [`PlaybotPlugin`](bevy_playbot::plugin::PlaybotPlugin), with or without a window.
///
/// # Errors
///
/// Pictures cannot be made: see [`VisionError`].
pub fn add_game(
    game: &dyn Game,
    app: &mut App,
    mode: &str,
    observation_config: &ObservationConfig,
    seed: u64,
) -> Result<(), VisionError> {
    app.insert_resource(PlaybotSeed(seed));
    if let ActionValue::Discrete(idle) = idle_action(game) {
        app.insert_resource(IdleAction(idle));
    }
    let host = game.tools().host;
    if let Some(arenas) = host.arenas_per_world() {
        let most = arenas.saturating_mul(host.agents_per_arena().max(1));
        app.insert_resource(AgentLimit { game: game.name(), most });
    }
    if let (Some(problem), Some(mut faults)) = (game.problem(), app.world_mut().get_resource_mut::<Faults>()) {
        faults.report(problem);
    }
    if is_level_files(mode) {
        match level_designs(game, mode) {
            Ok(designs) => {
                app.insert_resource(designs.files()).insert_resource(designs);
            }
            Err(error) => {
                if let Some(mut faults) = app.world_mut().get_resource_mut::<Faults>() {
                    faults.report(error.to_string());
                }
            }
        }
    }
    add_readings(app);
    game.build(app, mode);
    observation_config.build(game, app)
}

/// Adds agents `first..first + count` with their sensors, all idle, and returns them in the order of their numbers. If
/// more agents share an arena, the others [play along](PlaysAlong).
pub fn spawn_agents(
    game: &dyn Game,
    world: &mut World,
    observation_config: &ObservationConfig,
    first: u32,
    count: u32,
) -> Vec<Entity> {
    let agents: Vec<_> = (first..first + count).map(|index| game.spawn_agent(world, index)).collect();
    for &agent in &agents {
        observation_config.equip(game, world, agent);
    }
    game.tools().host.add_agents_along(world);
    agents
}

/// Returns a fault if the agents of a World are no longer these, whose numbers begin with `first`: the game has despawned
/// or spawned one.
pub fn other_agents(world: &World, agents: &[Entity], first: u32) -> Option<String> {
    let tick = world.get_resource::<Tick>().map_or(0, |tick| tick.0);
    let why = |index: u32, what: &str| {
        format!(
            "agent {index}: the game {what} it in tick {tick} of its World, and a training has the same agents in every \
             tick: end the episode of an agent that dies (`Episode::terminate`), and use the agent again in the next one"
        )
    };
    if let Some(row) = agents.iter().position(|&agent| world.get::<Agent>(agent).is_none()) {
        return Some(why(first + row as u32, "despawned"));
    }
    let order = world.get_resource::<AgentOrder>().filter(|order| order.entities().len() > agents.len())?;
    let is_other = |entity: &&Entity| !agents.contains(entity) && world.get::<PlaysAlong>(**entity).is_none();
    let other = order.entities().iter().find(is_other)?;
    world.get::<Agent>(*other).map(|agent| why(agent.index, "spawned"))
}

/// Returns the hash of a state, with the observation and the reward of an agent. Recordings of foreign games hold it.
pub fn hash_with_agent(state: u64, observation: Option<&Observation>, reward: Option<&Reward>) -> u64 {
    let reward = reward.map_or(0, |reward| u64::from(reward.get().to_bits()));
    let seen = observation.into_iter().flat_map(|seen| seen.vector.iter().map(|value| u64::from(value.to_bits())));
    StateHash::of([state, reward].into_iter().chain(seen)).0
}

/// Returns whether only the thread that built this World may tick it: it holds Bevy's non-send data, such as the
/// registrations of `bevy_ecs_ldtk`.
pub fn is_bound_to_its_thread(world: &World) -> bool {
    world.storages().non_sends.iter().any(|(_, data)| data.is_present())
}

// The distribution of arenas over Worlds.

/// Worlds of equal size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrangement {
    /// Number of Worlds.
    pub worlds: u32,
    /// Arenas in each of them, with one agent each; or the agents that share one arena.
    pub arenas: u32,
}

impl Arrangement {
    /// Distributes `arenas` over `worlds`, or over more of them if one World holds fewer arenas: see
    /// [`HostTools::arenas_per_world`](crate::game::HostTools::arenas_per_world).
    pub fn new(game: &dyn Game, arenas: u32, worlds: u32) -> Self {
        let wanted = (arenas / worlds.max(1)).max(1);
        let most = game.tools().host.arenas_per_world().unwrap_or(u32::MAX).max(1);
        if wanted <= most {
            return Self { worlds: worlds.max(1), arenas: wanted };
        }
        let total = wanted * worlds.max(1);
        let fitting = (1..=most).rev().find(|arenas| total.is_multiple_of(*arenas)).unwrap_or(1);
        Self { worlds: total / fitting, arenas: fitting }
    }

    /// Distributes `agents` over `worlds` as [`new`](Self::new) does. Agents that share an arena, as
    /// [`HostTools::agents_per_arena`](crate::game::HostTools::agents_per_arena) says, share a World. A number that is no
    /// multiple of theirs is rounded up.
    pub fn of_agents(game: &dyn Game, agents: u32, worlds: u32) -> Self {
        match game.tools().host.agents_per_arena() {
            0 | 1 => Self::new(game, agents, worlds),
            sharing => Self { worlds: agents.div_ceil(sharing).max(1), arenas: sharing },
        }
    }

    /// Gives each arena a World of its own, for values that are those of a whole World. The agents and their order stay.
    pub fn apart(self, game: &dyn Game) -> Self {
        if game.tools().host.agents_per_arena() > 1 {
            return self;
        }
        Self { worlds: self.total(), arenas: 1 }
    }

    /// Splits the Worlds into equal parts while there are no more than threads, so that each thread has one. The agents
    /// and their order stay.
    pub fn for_threads(self, game: &dyn Game, threads: usize) -> Self {
        if game.tools().host.agents_per_arena() > 1 {
            return self;
        }
        let most = u32::try_from(threads).unwrap_or(u32::MAX) / self.worlds;
        let parts = (1..=most.min(self.arenas)).rev().find(|parts| self.arenas.is_multiple_of(*parts)).unwrap_or(1);
        Self { worlds: self.worlds * parts, arenas: self.arenas / parts }
    }

    /// Returns the number of the first agent of each World.
    pub fn first_agents(self) -> impl Iterator<Item = u32> {
        (0..self.worlds).map(move |world| world * self.arenas)
    }

    /// Returns the number of arenas of all Worlds together.
    pub fn total(self) -> u32 {
        self.worlds * self.arenas
    }
}

/// Returns the number of arenas, up to `wanted`, that so many Worlds of the game hold. Callers whose results do not need
/// more of them build no further Worlds, each of which takes as long as many episodes.
pub fn arenas_within(game: &dyn Game, wanted: u32, worlds: u32) -> u32 {
    let worlds = worlds.max(1);
    worlds * at_most(game, (wanted / worlds) as usize) as u32
}

/// Returns the largest number of arenas, up to `wanted`, that one World of the game holds.
pub fn at_most(game: &dyn Game, wanted: usize) -> usize {
    game.tools().host.arenas_per_world().map_or(wanted, |most| wanted.min(most.max(1) as usize))
}

// The list of ended episodes in a World, for the callers that tick it.

/// Agents with their ended episodes since the last call, in order. The list outlives Worlds that are rebuilt.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub struct EndedEpisodes(Vec<(Entity, EpisodeResult)>);

impl EndedEpisodes {
    /// Makes the World collect its ended episodes from now on.
    pub fn note_in(world: &mut World) {
        Renewal::set_up(world, |world| {
            world.init_resource::<Self>();
            world.add_observer(note);
        });
        Renewal::carry_resource::<Self>(world);
    }

    /// Returns all of them, and empties the list.
    pub fn take(world: &mut World) -> Vec<(Entity, EpisodeResult)> {
        std::mem::take(&mut world.resource_mut::<Self>().0)
    }

    /// Returns all of them.
    pub fn of(world: &World) -> &[(Entity, EpisodeResult)] {
        world.get_resource::<Self>().map_or(&[], |ended| ended.0.as_slice())
    }
}

fn note(event: On<EpisodeEnded>, others: Query<(), With<PlaysAlong>>, mut ended: ResMut<EndedEpisodes>) {
    if !others.contains(event.entity) {
        ended.0.push((event.entity, event.result));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_costs_of_worlds_are_counted_and_averaged() {
        let costs = BuildingCosts::default();
        assert_eq!(costs.to_string(), "0 Worlds built, 0.000 s each");
        assert_eq!(costs.of(|| 7), 7);
        costs.microseconds.store(408_000, Ordering::Relaxed);
        assert_eq!(costs.to_string(), "1 World built, 0.408 s each");
        costs.worlds.store(4, Ordering::Relaxed);
        assert_eq!(costs.to_string(), "4 Worlds built, 0.102 s each");
    }
}
