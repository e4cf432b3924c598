//! Worlds of a game: headless, with any number of agents, ready to be ticked on any thread.

use crate::{
    game::{Game, level_designs},
    level_files::is_level_files,
    sensors::GameSensors,
};
use bevy::prelude::*;
use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    agent::AgentLimit,
    episode::{EpisodeEnded, EpisodeResult},
    fault::{Fault, Faults},
    headless::{headless_app, headless_frame_app, into_world, set_tick_rate},
    panics::{EpisodeTrace, PanicReports},
    placement::{TickPlacement, TickSchedules},
    renewal::Renewal,
    streams::PlaybotSeed,
    systems::PlaybotSystems,
    vision::{ObservationConfig, VisionError},
};
use std::time::Instant;

/// Builds a World of a game with agents `first..first + count`, all idle, ready to be ticked on any thread. They see
/// vectors.
///
/// Returns the World and its agents in the order of their numbers.
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
            built.map(|(world, _)| world).map_err(|error| Fault(error.to_string()))
        }));
        Renewal::carry_resource::<StageClock>(&mut world);
    }
    Ok((world, agents))
}

fn build_once(
    game: &dyn Game,
    mode: &str,
    observation_config: &ObservationConfig,
    seed: u64,
    first: u32,
    count: u32,
) -> Result<(World, Vec<Entity>), VisionError> {
    observation_config.check(game)?;
    let mut app = match game.tools().host.placement() {
        TickPlacement::Fixed => {
            let mut app = headless_app();
            set_tick_rate(&mut app, game.tick_hz());
            app
        }
        TickPlacement::Frame => headless_frame_app(
            game.tools().host.headless_plugins(observation_config.headless_plugins()),
            game.tick_hz(),
        ),
    };
    add_game(game, &mut app, mode, observation_config, seed)?;
    PanicReports::new(game.demo_header(mode), std::env::temp_dir()).add_to(&mut app);
    let mut world = into_world(app);
    let agents = spawn_agents(game, &mut world, observation_config, first, count);
    for &agent in &agents {
        world.entity_mut(agent).insert(EpisodeTrace::default());
    }
    Ok((world, agents))
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
    if let Some(most) = game.tools().host.arenas_per_world() {
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

/// Adds agents `first..first + count` with their sensors, all idle, and returns them in the order of their numbers.
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
    agents
}

// Clock of the stages of a tick, for benchmarks.

/// Seconds spent in the parts of a tick. Insert the resource to measure; without it no clock is read.
#[derive(Resource, Debug, Clone, Reflect)]
#[reflect(Resource)]
pub struct StageClock {
    last: Instant,
    /// Building levels and the game's own step, seconds.
    pub simulate_s: f64,
    /// Filling observations, seconds.
    pub observe_s: f64,
    /// Drawing skills and choosing actions, seconds.
    pub infer_s: f64,
    /// Counting, recording and collecting, seconds.
    pub record_s: f64,
}

impl Default for StageClock {
    fn default() -> Self {
        Self { last: Instant::now(), simulate_s: 0.0, observe_s: 0.0, infer_s: 0.0, record_s: 0.0 }
    }
}

impl StageClock {
    /// Returns the seconds since the last call.
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = now.duration_since(self.last).as_secs_f64();
        self.last = now;
        seconds
    }
}

/// Adds systems that read the clock between the parts of a tick.
pub(crate) fn add_readings(app: &mut App) {
    let measuring = resource_exists::<StageClock>;
    let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
    app.add_systems(
        decide,
        (
            start.before(PlaybotSystems::Begin),
            after_simulation.after(PlaybotSystems::Begin).before(PlaybotSystems::Observe),
            after_observation.after(PlaybotSystems::Observe).before(PlaybotSystems::Decide),
            after_decision.after(PlaybotSystems::Act),
        )
            // No other system reads this clock.
            .ambiguous_with_all()
            .run_if(measuring),
    )
    .add_systems(
        judge,
        (after_simulation.before(PlaybotSystems::Judge), after_recording.after(PlaybotSystems::Reset))
            .ambiguous_with_all()
            .run_if(measuring),
    );
}

fn start(mut clock: ResMut<StageClock>) {
    clock.lap();
}

fn after_simulation(mut clock: ResMut<StageClock>) {
    clock.simulate_s += clock.lap();
}

fn after_observation(mut clock: ResMut<StageClock>) {
    clock.observe_s += clock.lap();
}

fn after_decision(mut clock: ResMut<StageClock>) {
    clock.infer_s += clock.lap();
}

fn after_recording(mut clock: ResMut<StageClock>) {
    clock.record_s += clock.lap();
}

/// Words that begin the names of actions that do nothing.
const NAMES: [&str; 8] = ["none", "nothing", "noop", "no-op", "idle", "stay", "wait", "stand"];

/// Returns whether a discrete choice does nothing, by its name.
pub fn is_named_idle(names: &[String], choice: u32) -> bool {
    let name = names.get(choice as usize).and_then(|name| name.split_whitespace().next()).unwrap_or("");
    NAMES.contains(&name.to_lowercase().as_str())
}

/// Returns the game's idle action: the first choice with an idle name, else choice 0; zeros for continuous actions.
pub fn idle_action(game: &dyn Game) -> ActionValue {
    match game.actions() {
        ActionSpace::Discrete(count) => {
            let names = game.tools().input.action_names();
            ActionValue::Discrete((0..count as u32).find(|&choice| is_named_idle(&names, choice)).unwrap_or(0))
        }
        ActionSpace::Continuous(count) => ActionValue::Continuous(vec![0.0; count]),
    }
}

// The list of ended episodes in a World, for its callers.

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

fn note(event: On<EpisodeEnded>, mut ended: ResMut<EndedEpisodes>) {
    ended.0.push((event.entity, event.result));
}

#[cfg(test)]
mod idle_tests {
    use bevy::prelude::App;

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
}
