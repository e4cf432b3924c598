//! Worlds that are rebuilt for each episode, so that no state of a game outlives one.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{engine::Renewal, prelude::*};
//!
//! /// A game with a counter that it cannot reset. An episode ends after three ticks.
//! fn count(mut ticks: Local<u32>, mut episodes: Query<&mut Episode>) {
//!     *ticks += 1;
//!     if *ticks == 3 {
//!         episodes.iter_mut().for_each(|mut episode| episode.terminate(true));
//!     }
//! }
//!
//! fn build() -> World {
//!     let mut app = headless_app();
//!     app.add_systems(FixedUpdate, count);
//!     app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2)));
//!     std::mem::take(app.world_mut())
//! }
//!
//! let mut world = build();
//! world.insert_resource(Renewal::new(|| Ok(build())));
//! let agent = world.query_filtered::<Entity, With<Agent>>().single(&world).expect("one agent");
//! world.entity_mut(agent).insert(Control::Human);
//! world.ticks(9).expect("it can be built again");
//! assert_eq!(world.get::<EpisodeCount>(agent).expect("it goes over").finished, 3);
//! ```

use crate::{
    agent::{Agent, Control, PlaysAlong},
    carry_over::CarryOver,
    episode::Episode,
    fault::Fault,
    level::LevelQueue,
    streams::{AgentStreams, PlaybotSeed},
};
use bevy::prelude::*;
use std::sync::Arc;

/// The function that builds the World.
type Builder = Arc<dyn Fn() -> Result<World, Fault> + Send + Sync>;

/// Work that was done on the World after it was built.
type Work = Arc<dyn Fn(&mut World) + Send + Sync>;

/// Makes [`tick_world`](crate::headless::tick_world) rebuild the World before each episode but the
/// first. A new World with the same agents takes its place, and the game begins in it as at the
/// start of the program.
///
/// State of the plugin is carried over: the policy, the skill prior, the recorder and faults, and their components on
/// agents. Their types state it at their definition. Add more to such a World with [`set_up`](Self::set_up), and
/// carry state over with [`carry_resource`](Self::carry_resource) and [`carry_component`](Self::carry_component).
/// Queries that are kept from one tick to the next do not fit the new World.
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
pub struct Renewal {
    build: Builder,
    set_up: Vec<Work>,
    carried: CarryOver,
    has_run: bool,
}

/// The level of the first episode of a World that has not begun to run. Triggered before anything
/// of the game runs, in Worlds with a [`Renewal`].
#[derive(EntityEvent, Clone, Copy, Debug, Reflect)]
pub struct NextEpisode {
    /// The agent.
    pub entity: Entity,
    /// Number of the level.
    pub level: u64,
}

impl Renewal {
    /// Creates the renewal of a World that `build` has made, and makes again. Its agents must be
    /// the same entities each time.
    pub fn new(build: impl Fn() -> Result<World, Fault> + Send + Sync + 'static) -> Self {
        Self { build: Arc::new(build), set_up: Vec::new(), carried: CarryOver::default(), has_run: false }
    }

    /// Adds observers, systems and the like to a World now, and to each World that takes its place.
    pub fn set_up(world: &mut World, work: impl Fn(&mut World) + Send + Sync + 'static) {
        work(world);
        if let Some(mut renewal) = world.get_resource_mut::<Self>() {
            renewal.set_up.push(Arc::new(work));
        }
    }

    /// Carries this resource over into each World that takes the place of this one.
    pub fn carry_resource<R: Resource>(world: &mut World) {
        if let Some(mut renewal) = world.get_resource_mut::<Self>() {
            renewal.carried.add_resource::<R>();
        }
    }

    /// Carries this component of agents over into each World that takes the place of this one.
    pub fn carry_component<C: Component>(world: &mut World) {
        if let Some(mut renewal) = world.get_resource_mut::<Self>() {
            renewal.carried.add_component::<C>();
        }
    }
}

/// Rebuilds the World if it has run before and an episode is about to begin in it. Returns whether
/// it did.
///
/// # Errors
///
/// The World cannot be built again. It stays unchanged.
pub(crate) fn renew_if_due(world: &mut World) -> Result<bool, Fault> {
    let Some(has_run) = world.get_resource::<Renewal>().map(|renewal| renewal.has_run) else { return Ok(false) };
    let ahead = episodes_ahead(world);
    let is_due = has_run && !ahead.is_empty();
    if is_due {
        renew(world)?;
    }
    if let Some(mut renewal) = world.get_resource_mut::<Renewal>() {
        renewal.has_run = true;
    }
    if is_due || !has_run {
        ahead.into_iter().for_each(|episode| world.trigger(episode));
    }
    Ok(is_due)
}

/// Returns the episodes that begin in the next tick; empty while another one is being played.
fn episodes_ahead(world: &mut World) -> Vec<NextEpisode> {
    let seed = world.get_resource::<PlaybotSeed>().copied().unwrap_or_default();
    let mut agents =
        world.query_filtered::<(Entity, &Agent, &Control, &Episode, &LevelQueue, &AgentStreams), Without<PlaysAlong>>();
    let mut ahead = Vec::new();
    for (entity, agent, control, episode, queue, streams) in agents.iter(world) {
        if episode.is_running() || episode.is_loading() {
            return Vec::new();
        }
        // A copy is asked, so the agent draws the same level later.
        let mut streams = streams.clone();
        streams.seed(seed, agent.index);
        let level = queue.clone().next_level(&mut streams.level);
        ahead.extend(level.filter(|_| control.is_active()).map(|level| NextEpisode { entity, level }));
    }
    ahead
}

fn renew(world: &mut World) -> Result<(), Fault> {
    let Some(renewal) = world.get_resource::<Renewal>().cloned() else { return Ok(()) };
    let mut agents: Vec<_> =
        world.query::<(Entity, &Agent)>().iter(world).map(|(agent, it)| (agent, it.index)).collect();
    agents.sort_by_key(|(_, index)| *index);
    let mut fresh = (renewal.build)()?;
    if let Some((_, index)) =
        agents.iter().find(|(agent, index)| fresh.get::<Agent>(*agent).is_none_or(|agent| agent.index != *index))
    {
        return Err(Fault(format!(
            "agent {index}: the game's World cannot be built anew, since its entities get other numbers each time: \
             choose another way to restart the game"
        )));
    }
    fresh.insert_resource(renewal.clone());
    renewal.set_up.iter().for_each(|work| work(&mut fresh));
    let mut carried = CarryOver::registered(world);
    carried.extend(&renewal.carried);
    carried.carry(world, &mut fresh, agents.into_iter().map(|(agent, _)| agent));
    *world = fresh;
    Ok(())
}
