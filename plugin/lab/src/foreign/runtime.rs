//! A foreign game in one World.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy::{ecs::schedule::InternedScheduleLabel, prelude::*};

use super::{
    factory::{OwnedSystem, SystemFactory},
    game::ForeignGame,
    kept::Baseline,
    paths::ObservedPath,
    restart_kind::{OwnRestartKind, Restart},
};
use bevy_playbot::{
    action::ActionValue,
    agent::Agent,
    control::Control,
    episode::{Episode, EpisodeEnd},
    fault::Faults,
};

/// The level that is played, for a game that seeds its generator by it. Inserted before every restart.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct LevelSeed(pub u64);

/// The source of the observation.
pub(super) enum Sensor {
    System(OwnedSystem<Vec<f32>>),
    Paths(Vec<ObservedPath>),
    Nothing,
}

/// A part of the reward.
pub(super) struct RewardPart {
    pub(super) system: OwnedSystem<f32>,
    /// Whether the growth of the value since the last tick is paid.
    pub(super) is_delta: bool,
    pub(super) last: Option<f32>,
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
    pub(super) sensor: Sensor,
    pub(super) place: Option<OwnedSystem<Vec2>>,
    pub(super) rewards: Vec<RewardPart>,
    pub(super) end: Option<OwnedSystem<Option<EpisodeEnd>>>,
    pub(super) ready: Option<OwnedSystem<bool>>,
    pub(super) level: Option<OwnedSystem<()>>,
    pub(super) restart: Option<OwnedSystem<()>>,
    pub(super) act: Option<OwnedSystem<()>>,
    pub(super) bot: Option<OwnedSystem<ActionValue>>,
    pub(super) hash: Option<OwnedSystem<u64>>,
    /// The World before the game started.
    pub(super) baseline: Option<Baseline>,
    /// The schedules that run once when a program starts, in order.
    pub(super) startup: Vec<InternedScheduleLabel>,
    /// Frames since the last restart.
    pub(super) frames: u32,
    /// Whether an episode has started in this World, if each has its own World.
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
        let part = |(system, is_delta): &(SystemFactory<f32>, bool)| RewardPart {
            system: system.make(),
            is_delta: *is_delta,
            last: None,
        };
        Self {
            sensor: description.sensor(),
            place: description.place.as_ref().map(|system| system.make()),
            rewards: description.rewards.iter().map(part).collect(),
            end: description.end.as_ref().map(|system| system.make()),
            ready: description.ready.as_ref().map(|system| system.make()),
            level: description.level.as_ref().map(|system| system.make()),
            restart,
            act: description.act.as_ref().map(|system| system.make()),
            bot: description.demonstrator.as_ref().map(|(_, system)| system.make()),
            hash: description.hash.as_ref().map(|system| system.make()),
            game: game.clone(),
            baseline: None,
            startup,
            frames: 0,
            has_begun: false,
        }
    }

    /// Returns the level that is played for this number.
    pub(super) fn level_of(&self, level: u64) -> u64 {
        self.game.level_of(level)
    }
}

/// Returns the agent of the World, if it has a controller.
pub(super) fn active_agent(world: &mut World) -> Option<Entity> {
    let mut agents = world.query_filtered::<(Entity, &Control), With<Agent>>();
    agents.iter(world).find(|(_, control)| control.is_active()).map(|(entity, _)| entity)
}

/// Returns the agent of the World, if it is playing.
pub(super) fn playing_agent(world: &mut World) -> Option<Entity> {
    let agent = active_agent(world)?;
    world.get::<Episode>(agent).filter(|episode| episode.is_running()).map(|_| agent)
}

/// Runs a part of the game's description. An error is a fault, and stops the agent.
pub(super) fn with_foreign<T>(
    world: &mut World,
    agent: Entity,
    work: impl FnOnce(&mut World, &mut Foreign) -> Result<T, String>,
) -> Option<T> {
    let cell = world.get_resource::<ForeignCell>()?.clone();
    let mut foreign = cell.lock();
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
