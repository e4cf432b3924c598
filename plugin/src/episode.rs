//! Episodes: their start, their end and their result.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{episode::EpisodeResult, prelude::*};
//!
//! #[derive(Resource, Default)]
//! struct Results(Vec<EpisodeResult>);
//!
//! let mut app = headless_app();
//! app.init_resource::<Results>()
//!     // The game: time is up after three ticks.
//!     .add_systems(FixedUpdate, |mut episodes: Query<&mut Episode>| {
//!         episodes.iter_mut().filter(|episode| episode.tick == 2).for_each(|mut episode| episode.truncate());
//!     })
//!     .add_observer(|event: On<EpisodeEnded>, mut results: ResMut<Results>| results.0.push(event.result));
//! let levels = LevelQueue::list([7, 8]);
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, levels));
//! app.ticks(6).expect("no agent broke its contract");
//! let results = &app.world().resource::<Results>().0;
//! assert!(results.iter().all(|result| result.end == EpisodeEnd::Truncated && result.ticks == 3));
//! assert_eq!(results.iter().map(|result| result.level).collect::<Vec<_>>(), [7, 8]);
//! ```
//!
//! # The count of ticks
//!
//! ```
//! use bevy_playbot::{episode::Tick, prelude::*};
//!
//! let mut app = headless_app();
//! app.ticks(3).expect("no agent broke its contract");
//! assert_eq!(app.world().resource::<Tick>(), &Tick(3));
//! ```

use crate::{
    agent::{Agent, AgentOrder, Control, PlaysAlong},
    calls::GameCall,
    carry_over::ReflectCarryComponent,
    fault::Faults,
    level::LevelQueue,
    reward::Reward,
    streams::{AgentStreams, EpisodeSeeds},
};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use std::{cell::Cell, fmt};

/// Lifts the time limit of an agent's episodes, as for a person, who is slower than a bot. Games that end episodes by
/// rules of their own ignore it.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, Default)]
pub struct NoTimeLimit;

/// The end of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Reflect)]
pub enum EpisodeEnd {
    /// The game is over; no reward could follow.
    Terminated {
        /// True if the agent reached the level's goal.
        success: bool,
    },
    /// Time is up; the game could have gone on.
    Truncated,
}

impl EpisodeEnd {
    /// The game is over, and won.
    pub const WON: Self = Self::Terminated { success: true };
    /// The game is over, and lost.
    pub const LOST: Self = Self::Terminated { success: false };

    /// Returns whether the game is over because the level's goal was reached.
    pub fn is_success(self) -> bool {
        matches!(self, Self::Terminated { success: true })
    }
}

/// The running episode of an agent.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct Episode {
    /// The level that is played.
    pub level: u64,
    /// Ticks played so far; 0 while the first observation is made.
    pub tick: u32,
    /// Sum of rewards so far, undiscounted.
    pub total_reward: f64,
    /// Ticks so far with an action outside the game's range, which was clipped to it.
    pub clipped: u32,
    state: EpisodeState,
    reached: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
enum EpisodeState {
    #[default]
    Waiting,
    Loading,
    Running,
    Ended(EpisodeEnd),
}

impl Episode {
    /// Ends the episode: the game is over. The first call in a tick decides, and termination
    /// outranks truncation. Has no effect between two episodes.
    pub fn terminate(&mut self, success: bool) {
        if self.is_running() && !matches!(self.end(), Some(EpisodeEnd::Terminated { .. })) {
            self.state = EpisodeState::Ended(EpisodeEnd::Terminated { success });
        }
    }

    /// Ends the episode: time is up. Has no effect between two episodes.
    pub fn truncate(&mut self) {
        if self.is_running() && self.end().is_none() {
            self.state = EpisodeState::Ended(EpisodeEnd::Truncated);
        }
    }

    /// Notes that the level's goal has been reached and the game goes on, as in games that only the
    /// time limit ends. The episode counts as a success even if it is truncated. Has no effect
    /// between two episodes.
    pub fn reach(&mut self) {
        self.reached |= self.is_running();
    }

    /// Notes that the action of this tick was clipped to the game's range.
    pub fn note_clipped(&mut self) {
        self.clipped += u32::from(self.is_running());
    }

    /// Returns whether the level's goal was reached, by the end of the episode or before it.
    pub fn is_success(&self) -> bool {
        self.reached || self.end().is_some_and(EpisodeEnd::is_success)
    }

    /// Returns the end, in the tick in which the episode ended.
    pub fn end(&self) -> Option<EpisodeEnd> {
        match self.state {
            EpisodeState::Ended(end) => Some(end),
            _ => None,
        }
    }

    /// Returns whether a level is being played, the tick of its end included.
    pub fn is_running(&self) -> bool {
        matches!(self.state, EpisodeState::Running | EpisodeState::Ended(_))
    }

    /// Delays the start while a level is built over several frames. Call it from the game's
    /// observer of [`StartEpisode`]. Until the episode is [`ready`](Self::ready), the plugin skips
    /// the agent: no observation, decision, reward or recording, and no tick is counted.
    pub fn wait(&mut self) {
        if self.state == EpisodeState::Running {
            self.state = EpisodeState::Loading;
        }
    }

    /// Declares the level built: the episode's first observation may be made. Call it in
    /// [`PlaybotSystems::Load`](crate::systems::PlaybotSystems::Load).
    pub fn ready(&mut self) {
        if self.is_loading() {
            self.state = EpisodeState::Running;
        }
    }

    /// Returns whether the level is still being built.
    pub fn is_loading(&self) -> bool {
        self.state == EpisodeState::Loading
    }

    /// Returns the agent, level and tick in the form of messages: `agent 0, level 3, tick 7`.
    pub fn moment(&self, agent: &Agent) -> String {
        format!("agent {}, level {}, tick {}", agent.index, self.level, self.tick)
    }

    /// Leaves the level at once, without a result; the next one starts with the next tick.
    pub fn abandon(&mut self) {
        self.state = EpisodeState::Waiting;
    }
}

/// Asks the game to build level `level` for agent `entity` now. Triggered by the plugin, observed
/// by the game.
#[derive(EntityEvent, Clone, Copy, Debug, Reflect)]
pub struct StartEpisode {
    /// The agent.
    pub entity: Entity,
    /// Number of the level; for generated levels the seed.
    pub level: u64,
}

/// The result of a finished episode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Reflect)]
pub struct EpisodeResult {
    /// The level that was played.
    pub level: u64,
    /// The end of the episode.
    pub end: EpisodeEnd,
    /// True if the level's goal was reached, at the end or before it: see [`Episode::reach`].
    pub success: bool,
    /// Length in ticks.
    pub ticks: u32,
    /// Ticks with an action that was clipped to the game's range.
    pub clipped: u32,
    /// Sum of rewards, undiscounted.
    pub total_reward: f64,
}

/// An episode has ended: triggered by the plugin after the tick was recorded and before the next level starts.
///
/// The fields of its [`EpisodeResult`] can be read directly: `event.success`.
#[derive(EntityEvent, Deref, Clone, Copy, Debug, Reflect)]
pub struct EpisodeEnded {
    /// The agent.
    pub entity: Entity,
    /// The result.
    #[deref]
    pub result: EpisodeResult,
}

/// Totals of an agent over all its finished episodes.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct EpisodeCount {
    /// Finished episodes.
    pub finished: u64,
    /// Finished episodes that reached the level's goal.
    pub successes: u64,
}

/// Gives every agent an episode.
pub(crate) fn plugin(app: &mut App) {
    app.register_required_components::<Agent, Episode>().register_required_components::<Agent, EpisodeCount>();
}

/// Starts an episode for every agent that has none and is not idle.
pub(crate) fn begin_episodes(
    mut agents: Query<
        (
            (Entity, &Agent, &mut Control, &mut Episode),
            (&mut LevelQueue, &mut AgentStreams, Option<&mut EpisodeSeeds>),
            &mut Reward,
        ),
        Without<PlaysAlong>,
    >,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let mut begun = Vec::new();
    for ((entity, agent, mut control, mut episode), (mut queue, mut streams, seeds), mut reward) in &mut agents {
        if episode.is_running() || episode.is_loading() || !control.is_active() {
            continue;
        }
        let Some(level) = queue.next_level(&mut streams.level) else {
            *control = Control::Idle;
            continue;
        };
        if let Some(seeded) = seeds.and_then(|mut seeds| seeds.next_streams()) {
            *streams = seeded;
        }
        let late = reward.start_episode();
        if late != 0.0 {
            faults.report(format!(
                "agent {}, level {}, after tick {}: a reward of {late} was paid when the episode had ended; pay it no later \
                 than in the tick that ends it, before `PlaybotSystems::Judge`",
                agent.index, episode.level, episode.tick
            ));
        }
        *episode = Episode { level, state: EpisodeState::Running, ..default() };
        GameCall::add_level(level);
        commands.trigger(StartEpisode { entity, level });
        begun.push(LevelTick { level, tick: 0 });
    }
    // The observers that build these levels run next.
    if !begun.is_empty() {
        set_level_tick(begun.into_iter());
    }
}

/// Begins an episode of an agent that [plays along](PlaysAlong), as a bot, on the level of the agent whose episode begins
/// now. Call it where the game hears of the other one's [`StartEpisode`]. An episode that still runs is left.
pub fn begin_beside(world: &mut World, agent: Entity, level: u64) {
    let Ok(mut agent) = world.get_entity_mut(agent) else { return };
    if let Some(mut reward) = agent.get_mut::<Reward>() {
        // Late reward of the episode before counts nowhere.
        let _ = reward.start_episode();
    }
    agent.insert((Control::Bot, Episode { level, state: EpisodeState::Running, ..default() }));
    let entity = agent.id();
    world.trigger(StartEpisode { entity, level });
}

/// Counts the tick and its reward.
pub(crate) fn count_tick_and_reward(
    mut agents: Query<(&Agent, &Control, &mut Reward, &mut Episode)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, control, mut reward, mut episode) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if !reward.get().is_finite() {
            let (moment, reward) = (episode.moment(agent), reward.get());
            faults.report(format!("{moment}: the reward is {reward}; the game must not produce it"));
        }
        episode.tick += 1;
        episode.total_reward += f64::from(reward.get());
        reward.close();
    }
}

/// Announces ended episodes and frees their agents for the next level.
pub(crate) fn end_episodes(
    order: Res<AgentOrder>,
    mut agents: Query<(&mut Episode, &mut EpisodeCount, &mut Reward)>,
    mut commands: Commands,
) {
    for &entity in order.entities() {
        let Ok((mut episode, mut count, mut reward)) = agents.get_mut(entity) else { continue };
        let Some(end) = episode.end() else { continue };
        count.finished += 1;
        count.successes += u64::from(episode.is_success());
        let result = EpisodeResult {
            level: episode.level,
            end,
            success: episode.is_success(),
            ticks: episode.tick,
            clipped: episode.clipped,
            total_reward: episode.total_reward,
        };
        commands.trigger(EpisodeEnded { entity, result });
        reward.end_episode();
        episode.abandon();
    }
}

// The tick that a thread runs, for the messages of games in the log.

/// A tick of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LevelTick {
    /// The level.
    pub level: u64,
    /// The tick, from 0.
    pub tick: u32,
}

impl fmt::Display for LevelTick {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "level {}, tick {}", self.level, self.tick)
    }
}

thread_local! {
    /// True while this thread ticks a World without a window, whose systems all run on it.
    static TICKS: Cell<bool> = const { Cell::new(false) };
    static LEVEL_TICK: Cell<Option<LevelTick>> = const { Cell::new(None) };
}

/// Returns the tick that this thread runs. `None` outside of [`tick_world`](crate::headless::tick_world), or if the agents
/// of the World are in several ticks.
pub fn tick_of_thread() -> Option<LevelTick> {
    LEVEL_TICK.get()
}

/// Runs a tick of a World on this thread, with [`tick_of_thread`].
pub(crate) fn with_tick<T>(tick: impl FnOnce() -> T) -> T {
    TICKS.set(true);
    let ticked = tick();
    TICKS.set(false);
    LEVEL_TICK.set(None);
    ticked
}

/// Notes the tick that this thread runs, if all agents are in the same one.
fn set_level_tick(mut agents: impl Iterator<Item = LevelTick>) {
    if TICKS.get() {
        let first = agents.next();
        LEVEL_TICK.set(first.filter(|first| agents.all(|other| other == *first)));
    }
}

/// Notes the tick that the agents of a World play now.
pub(crate) fn note_level_tick(agents: Query<(&Control, &Episode)>) {
    let playing = agents
        .iter()
        .filter(|(control, episode)| control.is_active() && (episode.is_running() || episode.is_loading()));
    set_level_tick(playing.map(|(_, episode)| LevelTick { level: episode.level, tick: episode.tick }));
}

/// Number of fixed ticks since the World began.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct Tick(pub u64);

pub(crate) fn count_tick(mut tick: ResMut<Tick>) {
    tick.0 += 1;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{headless::run_on_one_thread, prelude::*};
    use std::sync::{Arc, Mutex};

    /// Returns the ticks that a system and the observer that builds levels see, with so many agents.
    fn seen(levels: &[u64]) -> Vec<Option<(u64, u32)>> {
        let seen = Arc::<Mutex<Vec<_>>>::default();
        let note = |seen: &Arc<Mutex<Vec<_>>>| {
            let tick = tick_of_thread().map(|tick| (tick.level, tick.tick));
            seen.lock().expect("no thread panics").push(tick);
        };
        let mut app = headless_app();
        let (in_game, in_start) = (seen.clone(), seen.clone());
        app.add_systems(FixedUpdate, move |mut episodes: Query<&mut Episode>| {
            note(&in_game);
            episodes.iter_mut().filter(|episode| episode.tick == 1).for_each(|mut episode| episode.truncate());
        });
        app.add_observer(move |_: On<StartEpisode>| note(&in_start));
        for (index, level) in (0..).zip(levels) {
            let queue = LevelQueue::list([*level, *level + 1]);
            app.world_mut().spawn((
                Agent::new(index, ActionSpace::Discrete(2)),
                Control::Bot,
                BlindBot::Uniform,
                queue,
            ));
        }
        run_on_one_thread(app.world_mut());
        app.ticks(3).expect("no agent broke its contract");
        assert_eq!(tick_of_thread(), None, "the tick is over");
        let seen = seen.lock().expect("no thread panics");
        seen.clone()
    }

    #[test]
    fn a_thread_knows_level_and_tick_of_the_world_that_it_ticks() {
        let alone = [(7, 0), (7, 0), (7, 1), (8, 0), (8, 0)].map(Some);
        assert_eq!(seen(&[7]), alone, "the start, two ticks, the next start and its first tick");
    }

    #[test]
    fn agents_on_one_level_share_their_tick_and_others_have_none() {
        assert!(seen(&[7, 7]).iter().all(Option::is_some));
        assert!(seen(&[7, 9]).iter().all(Option::is_none));
    }
}
