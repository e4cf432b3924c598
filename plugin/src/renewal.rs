//! Worlds that are built anew for each episode, so that nothing of a game outlives one.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{prelude::*, renewal::Renewal};
//!
//! /// A game that counts where nobody can set it back, and ends after three ticks.
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

use std::{any::TypeId, sync::Arc};

use bevy::prelude::*;

use crate::{
    action::Action,
    agent::{Agent, AgentOrder},
    bot::BlindBot,
    control::Control,
    demo::{
        recorder::{Recorder, Recording},
        replay::Replay,
    },
    episode::{Episode, EpisodeCount},
    fault::{Fault, Faults},
    level::LevelQueue,
    observation::VectorSensor,
    panics::{EpisodeTrace, PanicReports},
    policy::{ActivePolicy, Decision},
    skill_prior::{ActiveSkill, SkillPrior},
    state_hash::StateHash,
    streams::{AgentStreams, EpisodeSeeds, PlaybotSeed},
    vision::BlankEpisodes,
};

/// What made the World.
type Builder = Arc<dyn Fn() -> Result<World, Fault> + Send + Sync>;
/// What was done to the World after that.
type Work = Arc<dyn Fn(&mut World) + Send + Sync>;
type MoveResource = fn(&mut World, &mut World);
type MoveComponent = fn(&mut World, &mut World, Entity);

/// Lets [`tick_world`](crate::headless::tick_world) build the World anew before each episode but the first: a new one takes
/// its place, with the same agents, and the game begins in it as it does when the program starts.
///
/// What the plugin keeps goes over: the policy, the skill prior, the recorder and faults, and what agents carry of them.
/// Whoever adds more to such a World does it with [`set_up`](Self::set_up), and names what he stores there with
/// [`carry_resource`](Self::carry_resource) and [`carry_component`](Self::carry_component). Queries that are kept from
/// one tick to the next do not fit the new World.
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
pub struct Renewal {
    build: Builder,
    set_up: Vec<Work>,
    resources: Vec<(TypeId, MoveResource)>,
    components: Vec<(TypeId, MoveComponent)>,
    has_run: bool,
}

/// The World has not begun to run, and its first episode will be on this level: triggered before anything of the game
/// runs, in Worlds with a [`Renewal`].
#[derive(EntityEvent, Clone, Copy, Debug, Reflect)]
pub struct EpisodeAhead {
    /// The agent.
    pub entity: Entity,
    /// Number of the level.
    pub level: u64,
}

impl Renewal {
    /// For a World that `build` has made, and makes again: its agents must be the same entities each time.
    pub fn new(build: impl Fn() -> Result<World, Fault> + Send + Sync + 'static) -> Self {
        let (set_up, resources, components) = (Vec::new(), Vec::new(), Vec::new());
        let mut renewal = Self { build: Arc::new(build), set_up, resources, components, has_run: false };
        renewal
            .resource::<ActivePolicy>()
            .resource::<AgentOrder>()
            .resource::<Faults>()
            .resource::<PanicReports>()
            .resource::<PlaybotSeed>()
            .resource::<Recorder>()
            .resource::<SkillPrior>();
        renewal
            .component::<Action>()
            .component::<ActiveSkill>()
            .component::<AgentStreams>()
            .component::<BlankEpisodes>()
            .component::<BlindBot>()
            .component::<Control>()
            .component::<Decision>()
            .component::<EpisodeCount>()
            .component::<EpisodeSeeds>()
            .component::<EpisodeTrace>()
            .component::<LevelQueue>()
            .component::<Recording>()
            .component::<Replay>()
            .component::<StateHash>()
            .component::<VectorSensor>();
        renewal
    }

    /// Adds observers, systems and the like to a World, now, and to each one that takes its place.
    pub fn set_up(world: &mut World, work: impl Fn(&mut World) + Send + Sync + 'static) {
        work(world);
        if let Some(mut renewal) = world.get_resource_mut::<Self>() {
            renewal.set_up.push(Arc::new(work));
        }
    }

    /// This resource goes over into each World that takes the place of this one.
    pub fn carry_resource<R: Resource>(world: &mut World) {
        if let Some(mut renewal) = world.get_resource_mut::<Self>() {
            renewal.resource::<R>();
        }
    }

    /// This component of agents goes over into each World that takes the place of this one.
    pub fn carry_component<C: Component>(world: &mut World) {
        if let Some(mut renewal) = world.get_resource_mut::<Self>() {
            renewal.component::<C>();
        }
    }

    fn resource<R: Resource>(&mut self) -> &mut Self {
        let id = TypeId::of::<R>();
        if self.resources.iter().all(|(known, _)| *known != id) {
            self.resources.push((id, move_resource::<R>));
        }
        self
    }

    fn component<C: Component>(&mut self) -> &mut Self {
        let id = TypeId::of::<C>();
        if self.components.iter().all(|(known, _)| *known != id) {
            self.components.push((id, move_component::<C>));
        }
        self
    }
}

/// A resource that somebody has taken away is not there afterwards either.
fn move_resource<R: Resource>(old: &mut World, new: &mut World) {
    match old.remove_resource::<R>() {
        Some(resource) => new.insert_resource(resource),
        None => drop(new.remove_resource::<R>()),
    }
}

fn move_component<C: Component>(old: &mut World, new: &mut World, agent: Entity) {
    let carried = old.get_entity_mut(agent).ok().and_then(|mut agent| agent.take::<C>());
    let Ok(mut agent) = new.get_entity_mut(agent) else { return };
    match carried {
        Some(component) => agent.insert(component),
        None => agent.remove::<C>(),
    };
}

/// Builds the World anew if it has run before and an episode is about to begin in it. Returns whether it was done.
///
/// # Errors
///
/// The World cannot be built again. It stays as it was.
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

/// The episodes that begin in the next tick; none while another one is being played.
fn episodes_ahead(world: &mut World) -> Vec<EpisodeAhead> {
    let seed = world.get_resource::<PlaybotSeed>().copied().unwrap_or_default();
    let mut agents = world.query::<(Entity, &Agent, &Control, &Episode, &LevelQueue, &AgentStreams)>();
    let mut ahead = Vec::new();
    for (entity, agent, control, episode, queue, streams) in agents.iter(world) {
        if episode.is_running() || episode.is_loading() {
            return Vec::new();
        }
        // A copy is asked, so that the agent draws the same level.
        let mut streams = streams.clone();
        streams.seed(seed, agent.index);
        let level = queue.clone().next_level(&mut streams.level);
        ahead.extend(level.filter(|_| control.is_active()).map(|level| EpisodeAhead { entity, level }));
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
    renewal.resources.iter().for_each(|(_, carry)| carry(world, &mut fresh));
    for (agent, _) in agents {
        renewal.components.iter().for_each(|(_, carry)| carry(world, &mut fresh, agent));
    }
    *world = fresh;
    Ok(())
}
