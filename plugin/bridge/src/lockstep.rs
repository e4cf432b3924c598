//! Worlds whose agents all wait for their next actions.
//!
//! Each World has a thread. It stops in the middle of a tick, after its agents have observed and before they act, until there
//! are actions for all agents of all Worlds. So a step costs no more than a tick. Numbers do not depend on the threads: each
//! arena is played as it would be alone.
//!
//! There are two ways to drive them. [`with_worlds`] gives the Worlds to a function, which asks for one step after the other.
//! [`led_by`] plays the first World on the thread of the caller, and asks a [`Leader`] for orders whenever all are ready: in a
//! server that saves a change of threads in each step.
//!
//! The folder:
//!
//! - `seats`: one World, its agents between two steps, and what they show.

mod seats;

use crate::{
    arrays::{Layout, Memory, Number, SLOTS},
    lockstep::seats::{Led, Line, Orders, Row, Seats, Stage, build, play, run_world, seated},
    messages::{Refusal, Reset},
};
use bevy::prelude::*;
use bevy_playbot::{
    engine::misfit,
    streams::AgentStreams,
    vision::{ImageOptions, ObservationConfig, ObservationKind},
};
use playbot_harness::{
    game::{Game, level_designs},
    level_files::is_level_files,
    machine::{MemoryError, check_bytes},
    prelude::*,
    split::last_level,
    worlds::Arrangement,
};
use serde::Serialize;
use std::{
    collections::VecDeque,
    ops::Range,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
        mpsc::{Receiver, RecvError, Sender, TryRecvError, channel},
    },
    thread,
    time::{Duration, Instant},
};
use thiserror::Error;

/// What is played, and how.
#[derive(Clone)]
pub struct Settings<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// The levels, unless a reset names others of their mode.
    pub levels: LevelSplit,
    /// The order of the levels.
    pub order: LevelOrder,
    /// What agents see.
    pub observation: ObservationConfig,
    /// Form of the pictures that are drawn for people, beside what agents see; `None` for no pictures.
    pub picture: Option<ImageOptions>,
    /// Number of arenas.
    pub arenas: u32,
    /// Threads, each with a World. Games that need more Worlds have a thread for each of them.
    pub threads: usize,
    /// Seed of the draws of levels, until a reset names another one.
    pub seed: u64,
    /// What follows the end of an episode.
    pub autoreset: Autoreset,
    /// Whether the first agent of each arena is played alone. In a game whose agents share arenas, the others
    /// [play along](bevy_playbot::engine::PlaysAlong), as in tests and recordings.
    pub first_seat: bool,
}

/// The order in which arenas play levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LevelOrder {
    /// Each level is drawn, all with the same probability.
    #[default]
    Uniform,
    /// All levels in turn: arena i of n plays levels i, i + n, i + 2n, again and again.
    Rounds,
}

/// What follows the end of an episode, as Gymnasium names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Autoreset {
    /// The step after the last one ignores the arena's actions, and shows the first observation of the next episode.
    #[default]
    NextStep,
    /// The last step shows the first observation of the next episode. The last observation has an array of its own.
    SameStep,
    /// The arena waits for a reset.
    Disabled,
}

impl Settings<'_> {
    fn arrangement(&self) -> Arrangement {
        if self.first_seat && self.game.tools().host.agents_per_arena() > 1 {
            return Arrangement { worlds: self.arenas.max(1), arenas: 1 };
        }
        let agents = self.arenas.max(1).saturating_mul(self.agents_per_arena() as u32);
        // As many threads as divide the arenas, so that there are as many arenas as were asked for.
        let threads = (1..=self.threads.max(1) as u32).rev().find(|threads| self.arenas.is_multiple_of(*threads));
        Arrangement::of_agents(self.game, agents, threads.unwrap_or(1))
    }

    /// Returns the agents of an arena that are played.
    pub fn agents_per_arena(&self) -> usize {
        if self.first_seat {
            return 1;
        }
        self.game.tools().host.agents_per_arena().max(1) as usize
    }

    /// Checks that the arrays and the Worlds fit into the memory that is free.
    ///
    /// # Errors
    ///
    /// They do not: with the options to lower.
    pub fn check_memory(&self) -> Result<(), MemoryError> {
        let agents = self.arrangement().total();
        let what = format!("the arrays of {agents} agents that see {}", self.observation);
        // What an agent sees is in its World, too.
        let bytes = (self.layout().bytes() as u64).saturating_mul(2);
        check_bytes(what, bytes, "`--arenas`, `--size` or `--stack`", self.arrangement())
    }

    /// Returns where the arrays of all agents lie.
    pub fn layout(&self) -> Layout {
        let agents = self.arrangement().total() as usize;
        let kind = self.observation.obs_kind(self.game);
        Layout::new(agents, &self.game.actions(), &kind, self.autoreset == Autoreset::SameStep)
    }

    /// Returns the observation that Worlds are built with: of pictures, if there are any.
    fn drawn(&self) -> ObservationConfig {
        match self.picture {
            Some(image) if !self.observation.is_image() => ObservationConfig { kind: ObservationKind::Raster, image },
            _ => self.observation,
        }
    }

    /// Returns the agents of each World.
    fn worlds(&self) -> std::vec::IntoIter<Range<usize>> {
        let arrangement = self.arrangement();
        let each = arrangement.arenas as usize;
        let rows = |first: u32| first as usize..first as usize + each;
        arrangement.first_agents().map(rows).collect::<Vec<_>>().into_iter()
    }

    fn plan(&self) -> Plan {
        let mode = &self.levels.mode;
        let last_level = match level_designs(self.game, mode) {
            _ if !is_level_files(mode) => last_level(self.game, mode),
            designs => designs.ok().map(|designs| designs.count() - 1),
        };
        Plan {
            levels: self.levels.clone(),
            last_level: last_level.map(|last| (last, mode.clone())),
            order: self.order,
            seed: self.seed,
            space: self.game.actions(),
            agents: self.arrangement().total() as usize,
            per_arena: self.agents_per_arena(),
        }
    }
}

/// The reason why there is no next step.
#[derive(Debug, Error)]
pub enum StepError {
    /// The request was wrong, and nothing has changed.
    #[error("{}", .0.error)]
    Refused(Refusal),
    /// The game has failed. Its Worlds cannot go on.
    #[error("{0}")]
    Failed(String),
}

/// Worlds that step together, as the giver of their orders sees them.
pub struct Lockstep {
    plan: Plan,
    memory: Arc<Memory>,
    worlds: Vec<Seat>,
    replies: Arc<Replies>,
    all_ready: Receiver<()>,
    /// Replies that are still to come, from other threads.
    awaited: usize,
    slot: usize,
    has_begun: bool,
}

/// A giver of orders to Worlds of which the first is played on its own thread.
pub trait Leader: Send + 'static {
    /// Gives an order, such as [`Lockstep::begin_step`]. All Worlds are ready, and the results of the last one are there.
    /// Returns false at the end.
    fn lead(&mut self, worlds: &mut Lockstep) -> bool;

    /// Learns that the game has failed, and why. Its Worlds cannot go on.
    fn fail(&mut self, why: &str);
}

/// The way of orders to a World.
enum Seat {
    /// It waits for them on another thread.
    Apart(Sender<Order>),
    /// It is played on this thread: the order that it takes next.
    Here(Option<Order>),
}

/// What is to be known about Worlds to give them orders.
struct Plan {
    levels: LevelSplit,
    /// The last level of the mode, if it has one, and the name of the mode.
    last_level: Option<(u64, String)>,
    order: LevelOrder,
    seed: u64,
    space: ActionSpace,
    agents: usize,
    per_arena: usize,
}

/// A World is ready for the next order, or has failed.
type Reply = Result<(), String>;

/// The replies of Worlds on other threads. The last of those that are waited for wakes the caller.
struct Replies {
    awaited: AtomicUsize,
    failed: Mutex<Option<String>>,
    all_ready: Sender<()>,
}

impl Replies {
    fn send(&self, reply: Reply) {
        if let Err(why) = reply {
            self.failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
        }
        // A World that fails between two orders is noticed with the next order.
        let before = self.awaited.fetch_update(Ordering::AcqRel, Ordering::Acquire, |awaited| awaited.checked_sub(1));
        if before == Ok(1) {
            // The caller may be gone.
            let _ = self.all_ready.send(());
        }
    }
}

/// An order to a World.
enum Order {
    /// Begin episodes of these agents, and write the results.
    Begin { begins: Vec<Option<Begin>>, slot: usize },
    /// Act, and write the results.
    Step { actions: Vec<ActionValue>, slot: usize },
    /// Go on with these episodes, the first of which is of this agent, and write the results.
    Load { first: usize, saved: Vec<SavedEpisode> },
    /// Anything else, between two steps.
    Call(Call),
}

/// Work on a World and its agents.
type Call = Box<dyn FnOnce(&mut World, &[Entity], &[Row]) + Send>;

/// An agent's episode: its level and the actions that lead to its state. Games are deterministic, so nothing else is kept.
#[derive(Clone, Debug)]
pub struct SavedEpisode {
    level: u64,
    actions: VecDeque<ActionValue>,
    hash: StateHash,
}

/// The beginning of an agent's next episode.
#[derive(Clone)]
struct Begin {
    /// The level of this one episode; drawn if it is `None`.
    level: Option<u64>,
    /// New streams and queue, from a seed.
    anew: Option<(AgentStreams, LevelQueue)>,
}

/// The answer to a call, which is there once the World has done the work.
#[derive(Debug)]
pub struct Awaited<T>(Receiver<T>);

impl<T> Awaited<T> {
    /// Waits for the answer. A [`Leader`] calls it when it is asked for its next order, not before.
    ///
    /// # Errors
    ///
    /// The World has stopped.
    pub fn answer(self) -> Result<T, StepError> {
        self.0.recv().map_err(|_| StepError::Failed("the World has stopped".to_owned()))
    }
}

/// Builds the Worlds, each on its thread, and calls `work` with them. They end when it returns.
///
/// # Errors
///
/// A World cannot be built.
pub fn with_worlds<T>(
    settings: &Settings<'_>,
    memory: &Arc<Memory>,
    work: impl FnOnce(&mut Lockstep) -> T,
) -> Result<T, String> {
    thread::scope(|scope| {
        let mut lockstep = Lockstep::new(settings, memory);
        let mut worlds = settings.worlds();
        lockstep.expect(worlds.len());
        worlds.try_for_each(|rows| lockstep.play_apart(scope, settings, rows))?;
        lockstep.gather().map_err(|error| error.to_string())?;
        Ok(work(&mut lockstep))
    })
}

/// Builds the Worlds, plays the first one on this thread and each other one on its own, and asks `leader` for orders until
/// it ends. It also learns if a World fails or cannot be built.
pub fn led_by(settings: &Settings<'_>, memory: &Arc<Memory>, leader: impl Leader) {
    let mut leader: Box<dyn Leader> = Box::new(leader);
    thread::scope(|scope| {
        let mut lockstep = Lockstep::new(settings, memory);
        let mut worlds = settings.worlds();
        let first = worlds.next().unwrap_or_default();
        lockstep.worlds.push(Seat::Here(None));
        lockstep.expect(worlds.len());
        let built = worlds
            .try_for_each(|rows| lockstep.play_apart(scope, settings, rows))
            .and_then(|()| build(settings, first.clone()));
        let (world, agents) = match built {
            Ok(built) => built,
            Err(why) => return leader.fail(&why),
        };
        let orders = Orders::Leads(Box::new(Mutex::new(Led { lockstep, leader })));
        let mut world = seated(world, agents, first.start, Line::new(settings, memory, orders));
        let Err(why) = play(&mut world) else { return };
        if let Some(Seats { line: Line { orders: Orders::Leads(led), .. }, .. }) = world.remove_resource() {
            (*led).into_inner().unwrap_or_else(PoisonError::into_inner).leader.fail(&why);
        }
    });
}

impl Lockstep {
    fn new(settings: &Settings<'_>, memory: &Arc<Memory>) -> Self {
        let (ready, all_ready) = channel();
        let replies = Replies { awaited: AtomicUsize::new(0), failed: Mutex::default(), all_ready: ready };
        Self {
            plan: settings.plan(),
            memory: memory.clone(),
            worlds: Vec::new(),
            replies: Arc::new(replies),
            all_ready,
            awaited: 0,
            slot: 0,
            has_begun: false,
        }
    }

    /// Starts a World on a thread of its own.
    fn play_apart<'scope>(
        &mut self,
        scope: &'scope thread::Scope<'scope, '_>,
        settings: &'scope Settings<'_>,
        rows: Range<usize>,
    ) -> Result<(), String> {
        let (order, orders) = channel();
        let (replies, memory) = (self.replies.clone(), self.memory.clone());
        let run = move || run_world(settings, rows, &memory, orders, replies);
        thread::Builder::new().spawn_scoped(scope, run).map_err(|error| {
            format!("the system starts no more than {} threads ({error}): take fewer arenas", self.worlds.len())
        })?;
        self.worlds.push(Seat::Apart(order));
        Ok(())
    }

    /// Checks that episodes have begun.
    ///
    /// # Errors
    ///
    /// They have not.
    pub fn check_begun(&self) -> Result<(), StepError> {
        if self.has_begun { Ok(()) } else { Err(StepError::Refused(not_begun())) }
    }

    /// Returns the number of Worlds.
    pub fn worlds(&self) -> usize {
        self.worlds.len()
    }

    /// Begins episodes, waits for the results, and returns their slot.
    ///
    /// # Errors
    ///
    /// There is no such arena or level, or the game fails.
    pub fn reset(&mut self, reset: &Reset) -> Result<usize, StepError> {
        self.begin_reset(reset)?;
        self.gather().map(|()| self.slot)
    }

    /// Plays one tick with the actions in memory, waits for the results, and returns their slot.
    ///
    /// # Errors
    ///
    /// An action is none of the game's: no agent has acted then. Or the game fails.
    pub fn step(&mut self) -> Result<usize, StepError> {
        self.begin_step()?;
        self.gather().map(|()| self.slot)
    }

    /// Goes on from kept episodes, by playing their actions again, waits for the results, and returns their slot.
    ///
    /// # Errors
    ///
    /// There is no such arena, or its World has failed: it also does if the same actions lead to another state.
    pub fn load(&mut self, arena: usize, saved: Vec<SavedEpisode>) -> Result<usize, StepError> {
        self.begin_load(arena, saved)?;
        self.gather().map(|()| self.slot)
    }

    /// Returns the slot of the newest results.
    pub fn slot(&self) -> usize {
        self.slot
    }

    /// Orders what [`reset`](Self::reset) does.
    ///
    /// # Errors
    ///
    /// There is no such arena or level.
    pub fn begin_reset(&mut self, reset: &Reset) -> Result<(), StepError> {
        let begins = self.begins(reset).map_err(StepError::Refused)?;
        self.has_begun = true;
        self.deal(begins, |begins, slot| Order::Begin { begins, slot });
        Ok(())
    }

    /// Orders what [`step`](Self::step) does.
    ///
    /// # Errors
    ///
    /// An action is none of the game's.
    pub fn begin_step(&mut self) -> Result<(), StepError> {
        self.check_begun()?;
        let bytes = self.memory.actions().map_err(|error| StepError::Failed(error.to_string()))?;
        let actions = read_actions(self.memory.layout(), &self.plan.space, &bytes)
            .map_err(|(agent, why)| StepError::Refused(Refusal::of_arena(agent / self.plan.per_arena, why)))?;
        self.deal(actions, |actions, slot| Order::Step { actions, slot });
        Ok(())
    }

    /// Gives each World an order for its agents, whose results go to the next slot.
    fn deal<T>(&mut self, of_agents: Vec<T>, order: impl Fn(Vec<T>, usize) -> Order) {
        self.slot = (self.slot + 1) % SLOTS;
        let (mut of_agents, each) = (of_agents.into_iter(), self.plan.agents / self.worlds.len());
        self.expect(self.apart());
        for world in 0..self.worlds.len() {
            self.order(world, order(of_agents.by_ref().take(each).collect(), self.slot));
        }
    }

    /// Orders what [`load`](Self::load) does.
    ///
    /// # Errors
    ///
    /// There is no such arena.
    pub fn begin_load(&mut self, arena: usize, saved: Vec<SavedEpisode>) -> Result<(), StepError> {
        let (world, first) = self.place(arena)?;
        self.expect(usize::from(matches!(self.worlds[world], Seat::Apart(_))));
        self.order(world, Order::Load { first, saved });
        Ok(())
    }

    /// Asks for the episodes of the agents of an arena as they are now; `None` if they are over.
    ///
    /// # Errors
    ///
    /// There is no such arena.
    pub fn begin_save(&mut self, arena: usize) -> Result<Awaited<Option<Vec<SavedEpisode>>>, StepError> {
        let per_arena = self.plan.per_arena;
        self.call_rows(arena, move |world, agents, rows| {
            let saved = |(&agent, row): (&Entity, &Row)| {
                let hash = world.get::<StateHash>(agent).copied().unwrap_or_default();
                let level = world.get::<Episode>(agent).filter(|_| row.stage == Stage::Plays)?.level;
                Some(SavedEpisode { level, actions: row.actions.clone(), hash })
            };
            agents.iter().zip(rows).take(per_arena).map(saved).collect()
        })
    }

    /// Has `work` done on the World and the first agent of an arena, between two steps.
    ///
    /// # Errors
    ///
    /// There is no such arena, or no episode has begun.
    pub fn begin_call<T: Send + 'static>(
        &mut self,
        arena: usize,
        work: impl FnOnce(&mut World, Entity) -> T + Send + 'static,
    ) -> Result<Awaited<T>, StepError> {
        self.call_rows(arena, |world, agents, _| work(world, agents[0]))
    }

    /// Has `work` done on each World and its agents, between two steps.
    ///
    /// # Errors
    ///
    /// No episode has begun.
    pub fn begin_calls<T: Send + 'static>(
        &mut self,
        work: impl Fn(usize, &mut World, &[Entity]) -> T + Clone + Send + 'static,
    ) -> Result<Vec<Awaited<T>>, StepError> {
        self.check_begun()?;
        let worlds = 0..self.worlds.len();
        let call = |world| {
            let work = work.clone();
            self.call(world, move |of, agents, _| work(world, of, agents))
        };
        Ok(worlds.map(call).collect())
    }

    /// Returns what to do with each agent.
    fn begins(&self, reset: &Reset) -> Result<Vec<Option<Begin>>, Refusal> {
        let Plan { agents, per_arena, .. } = self.plan;
        let count = agents / per_arena;
        let all = || (0..count).collect();
        let arenas: Vec<usize> = reset.arenas.clone().unwrap_or_else(all);
        if let Some(&arena) = arenas.iter().find(|arena| **arena >= count) {
            return Err(no_arena(arena, count));
        }
        if !self.has_begun && arenas.len() < count {
            return Err(Refusal::new("the first reset begins episodes in all arenas: leave `arenas` out"));
        }
        if let Some(levels) = &reset.levels {
            if levels.len() != arenas.len() {
                let words = format!("{} levels for {} arenas: name one for each", levels.len(), arenas.len());
                return Err(Refusal::new(words));
            }
            for (&level, &arena) in levels.iter().zip(&arenas) {
                if let Some((last, mode)) = self.plan.last_level.as_ref().filter(|(last, _)| level > *last) {
                    let words = format!("there is no level {level}: `{mode}` has levels 0 to {last}");
                    return Err(Refusal::of_arena(arena, words));
                }
            }
        }
        let seed = reset.seed.or((!self.has_begun).then_some(self.plan.seed));
        let mut begins = vec![None; agents];
        for (at, arena) in arenas.into_iter().enumerate() {
            // The agents of an arena draw the same levels.
            let streams = |seed| AgentStreams::new(seed, (arena * per_arena) as u32);
            let begin = Begin {
                level: reset.levels.as_ref().map(|levels| levels[at]),
                anew: seed.map(|seed| (streams(seed), self.plan.queue(arena))),
            };
            begins[arena * per_arena..(arena + 1) * per_arena].fill(Some(begin));
        }
        Ok(begins)
    }

    /// Has `work` done on the World of an arena, with its agents from the first one of this arena on.
    fn call_rows<T: Send + 'static>(
        &mut self,
        arena: usize,
        work: impl FnOnce(&mut World, &[Entity], &[Row]) -> T + Send + 'static,
    ) -> Result<Awaited<T>, StepError> {
        let (world, first) = self.place(arena)?;
        Ok(self.call(world, move |world, agents, rows| work(world, &agents[first..], &rows[first..])))
    }

    fn call<T: Send + 'static>(
        &mut self,
        world: usize,
        work: impl FnOnce(&mut World, &[Entity], &[Row]) -> T + Send + 'static,
    ) -> Awaited<T> {
        let (answer, answers) = channel();
        // The answer is lost if the caller is gone.
        let call: Call = Box::new(move |world, agents, rows| drop(answer.send(work(world, agents, rows))));
        self.order(world, Order::Call(call));
        Awaited(answers)
    }

    /// Returns the World of an arena, and the place of its first agent in it.
    fn place(&self, arena: usize) -> Result<(usize, usize), StepError> {
        let (per_arena, each) = (self.plan.per_arena, self.plan.agents / self.worlds.len());
        if arena >= self.plan.agents / per_arena {
            return Err(StepError::Refused(no_arena(arena, self.plan.agents / per_arena)));
        }
        self.check_begun()?;
        let agent = arena * per_arena;
        Ok((agent / each, agent % each))
    }

    /// Returns the number of Worlds on other threads.
    fn apart(&self) -> usize {
        self.worlds.iter().filter(|seat| matches!(seat, Seat::Apart(_))).count()
    }

    /// Notes how many Worlds on other threads will reply to the next orders.
    fn expect(&mut self, replies: usize) {
        self.awaited = replies;
        self.replies.awaited.store(replies, Ordering::Release);
    }

    /// Sends an order. A World that has stopped cannot take it, and does not reply.
    fn order(&mut self, world: usize, order: Order) {
        let is_call = matches!(order, Order::Call(_));
        match &mut self.worlds[world] {
            Seat::Here(next) => *next = Some(order),
            Seat::Apart(orders) => {
                if orders.send(order).is_err() && !is_call {
                    self.replies.send(Err("a World has stopped".to_owned()));
                }
            }
        }
    }

    /// Waits until all Worlds on other threads that have got an order are ready.
    fn gather(&mut self) -> Result<(), StepError> {
        if std::mem::take(&mut self.awaited) > 0 {
            // This side keeps a sender, too.
            let _ = awake(&self.all_ready);
        }
        let failed = self.replies.failed.lock().unwrap_or_else(PoisonError::into_inner).take();
        failed.map_or(Ok(()), |why| Err(StepError::Failed(why)))
    }

    /// Returns the next order to the World of this thread; `None` at the end.
    fn next_here(&mut self, leader: &mut dyn Leader) -> Option<Order> {
        loop {
            if let Some(Seat::Here(next)) = self.worlds.first_mut()
                && let Some(order) = next.take()
            {
                return Some(order);
            }
            if let Err(why) = self.gather() {
                leader.fail(&why.to_string());
                return None;
            }
            if !leader.lead(self) {
                return None;
            }
        }
    }
}

impl Plan {
    /// Returns the levels of an arena after those that a reset has named.
    fn queue(&self, arena: usize) -> LevelQueue {
        let LevelSplit { first, last, .. } = self.levels;
        match self.order {
            LevelOrder::Uniform => LevelQueue::Uniform { first, last },
            LevelOrder::Rounds => {
                let arenas = self.agents / self.per_arena;
                let levels = self.levels.levels().skip(arena % self.levels.len() as usize);
                LevelQueue::rounds(levels.step_by(arenas).collect::<Vec<u64>>())
            }
        }
    }
}

/// Receives, awake at first.
fn awake<T>(messages: &Receiver<T>) -> Result<T, RecvError> {
    let looked = look_awake(|| match messages.try_recv() {
        Err(TryRecvError::Empty) => None,
        Ok(message) => Some(Ok(message)),
        Err(TryRecvError::Disconnected) => Some(Err(RecvError)),
    });
    looked.unwrap_or_else(|| messages.recv())
}

/// Looks for something for about a tenth of a millisecond, before the thread sleeps until it comes. Most things come soon,
/// and it takes the system longer to wake a thread than to switch to one that is awake.
///
/// Where other programs want the processors, to let them pass takes milliseconds each time, and a thread that sleeps is
/// served sooner. Then the next waits do not look.
pub(crate) fn look_awake<T>(mut look: impl FnMut() -> Option<T>) -> Option<T> {
    static CROWDED: AtomicUsize = AtomicUsize::new(0);
    let crowded = CROWDED.load(Ordering::Relaxed);
    if crowded > 0 {
        CROWDED.store(crowded - 1, Ordering::Relaxed);
        return look();
    }
    for _ in 0..LOOKS {
        if let Some(found) = look() {
            return Some(found);
        }
        let before = Instant::now();
        thread::yield_now();
        if before.elapsed() > LONG {
            CROWDED.store(ASLEEP, Ordering::Relaxed);
            return look();
        }
    }
    None
}

/// Looks before a thread sleeps.
const LOOKS: u32 = 150;

/// Time after which a processor counts as wanted by others.
const LONG: Duration = Duration::from_micros(300);

/// Waits without looks after that.
const ASLEEP: usize = 500;

fn not_begun() -> Refusal {
    Refusal::new("no episode has begun: send a reset first")
}

fn no_arena(arena: usize, count: usize) -> Refusal {
    Refusal::of_arena(arena, format!("there is no arena {arena}: they are numbered from 0 to {}", count - 1))
}

/// Returns the action of each agent, or the number of the first agent whose action does not fit, and why.
fn read_actions(layout: &Layout, space: &ActionSpace, bytes: &[u8]) -> Result<Vec<ActionValue>, (usize, String)> {
    let agents = layout.actions.first().map_or(0, |array| array.shape[0]);
    let (mut whole, mut real) = (Vec::new(), Vec::new());
    for array in &layout.actions {
        let words = bytes[array.offset..array.offset + array.len()].chunks_exact(4);
        let words = words.map(|word| [word[0], word[1], word[2], word[3]]);
        match array.dtype {
            Number::I32 => whole = words.map(i32::from_le_bytes).collect(),
            _ => real = words.map(f32::from_le_bytes).collect(),
        }
    }
    let choices = whole.len() / agents.max(1);
    let action = |agent: usize| {
        let options = &whole[agent * choices..(agent + 1) * choices];
        if let Some(option) = options.iter().find(|option| **option < 0) {
            return Err((agent, format!("action {option} is negative: actions are numbered from 0")));
        }
        let options = || options.iter().map(|&option| option as u32);
        let numbers = || real[agent * space.numbers()..(agent + 1) * space.numbers()].to_vec();
        let action = match space {
            ActionSpace::Discrete(_) => ActionValue::Discrete(options().next().unwrap_or_default()),
            ActionSpace::Continuous(_) => ActionValue::Continuous(numbers()),
            ActionSpace::Mixed(_) => ActionValue::Mixed { choices: options().collect(), numbers: numbers() },
        };
        misfit(&action, space).map_or(Ok(action), |why| Err((agent, why)))
    };
    (0..agents).map(action).collect()
}
