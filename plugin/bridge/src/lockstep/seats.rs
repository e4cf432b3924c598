//! One World: its agents between two steps, and what they show.

use crate::{
    arrays::{
        Array, FINAL_OBSERVATIONS, LEGAL, LEVEL, Memory, Number, OBSERVATIONS, REWARDS, SUCCESS, TERMINATED, TICK,
        TRUNCATED,
    },
    lockstep::{Autoreset, Begin, Leader, Lockstep, Order, Replies, Reply, SavedEpisode, Settings, awake},
};
use bevy::{ecs::component::Mutable, prelude::*};
use bevy_playbot::{
    engine::{Renewal, TickSchedules, flush_unfinished, record_ticks, run_observe_schedule, tick_world},
    legal::LegalActions,
};
use playbot_harness::{prelude::*, worlds::build_observing_world};
use std::{
    collections::VecDeque,
    io,
    ops::Range,
    sync::{Arc, Mutex, PoisonError, mpsc::Receiver},
};

/// The agents of a World, and where they get their orders.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub(super) struct Seats {
    #[reflect(ignore)]
    agents: Vec<Entity>,
    #[reflect(ignore)]
    first: usize,
    #[reflect(ignore)]
    rows: Vec<Row>,
    #[reflect(ignore)]
    pub(super) line: Line,
}

/// The line to the caller.
pub(super) struct Line {
    pub(super) orders: Orders,
    memory: Arc<Memory>,
    autoreset: Autoreset,
    slot: usize,
    is_over: bool,
}

/// Where the orders come from.
pub(super) enum Orders {
    /// From another thread, which gets replies.
    Follows { orders: Mutex<Receiver<Order>>, replies: Arc<Replies> },
    /// From a leader on this thread, who gives orders to all Worlds.
    Leads(Box<Mutex<Led>>),
}

pub(super) struct Led {
    pub(super) lockstep: Lockstep,
    pub(super) leader: Box<dyn Leader>,
}

impl Line {
    pub(super) fn new(settings: &Settings<'_>, memory: &Arc<Memory>, orders: Orders) -> Self {
        Self { orders, memory: memory.clone(), autoreset: settings.autoreset, slot: 0, is_over: false }
    }

    /// Tells the caller that this World is ready, or has failed.
    pub(super) fn reply(&self, reply: Reply) {
        match &self.orders {
            Orders::Follows { replies, .. } => replies.send(reply),
            Orders::Leads(led) => {
                let led = led.lock().unwrap_or_else(PoisonError::into_inner);
                let mut failed = led.lockstep.replies.failed.lock().unwrap_or_else(PoisonError::into_inner);
                *failed = failed.take().or(reply.err());
            }
        }
    }

    /// Waits for an order; `None` at the end.
    fn next_order(&self) -> Option<Order> {
        match &self.orders {
            Orders::Follows { orders, .. } => awake(&orders.lock().unwrap_or_else(PoisonError::into_inner)).ok(),
            Orders::Leads(led) => {
                let Led { lockstep, leader } = &mut *led.lock().unwrap_or_else(PoisonError::into_inner);
                lockstep.next_here(leader.as_mut())
            }
        }
    }
}

/// An agent between two steps.
#[derive(Default)]
pub(super) struct Row {
    pub(super) stage: Stage,
    reward: f32,
    end: Option<EpisodeEnd>,
    success: bool,
    /// Level and tick of the episode that has ended.
    ended: (u64, u32),
    /// Its last observation.
    last: Option<Observation>,
    /// The queue of levels, while a level of the caller is before it.
    queue: Option<LevelQueue>,
    /// The actions of the episode so far.
    pub(super) actions: VecDeque<ActionValue>,
    /// The kept episode that is played again.
    replayed: Option<SavedEpisode>,
}

/// What becomes of an agent in the next tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Stage {
    /// It begins an episode, or has begun one that is not shown yet.
    #[default]
    Begins,
    /// It acts.
    Plays,
    /// Its episode has ended; the next one begins after this step.
    Ended,
    /// Its episode has ended; the next one begins with a reset.
    Waits,
}

impl Stage {
    fn is_held(self) -> bool {
        matches!(self, Self::Ended | Self::Waits)
    }
}

/// Plays a World on a thread of its own until the caller is gone.
pub(super) fn run_world(
    settings: &Settings<'_>,
    rows: Range<usize>,
    memory: &Arc<Memory>,
    orders: Receiver<Order>,
    replies: Arc<Replies>,
) {
    let farewell = Farewell { replies: replies.clone(), said: false };
    let orders = Orders::Follows { orders: Mutex::new(orders), replies };
    let line = Line::new(settings, memory, orders);
    let first = rows.start;
    let played = build(settings, rows).and_then(|(world, agents)| {
        let mut world = seated(world, agents, first, line);
        // Ready for the first reset.
        world.resource::<Seats>().line.reply(Ok(()));
        play(&mut world)
    });
    farewell.say(played);
}

/// Tells the caller why a World has stopped, even if its thread panics.
struct Farewell {
    replies: Arc<Replies>,
    said: bool,
}

impl Farewell {
    fn say(mut self, ended: Result<(), String>) {
        self.said = true;
        if ended.is_err() {
            self.replies.send(ended);
        }
    }
}

impl Drop for Farewell {
    fn drop(&mut self) {
        if !self.said {
            self.replies.send(Err("the thread of a World has panicked, which is a bug of playbot".to_owned()));
        }
    }
}

/// Builds a World with agents of these numbers, none of which plays yet.
pub(super) fn build(settings: &Settings<'_>, rows: Range<usize>) -> Result<(World, Vec<Entity>), String> {
    let (first, count) = (rows.start as u32, rows.len() as u32);
    let drawn = settings.drawn();
    let built = build_observing_world(settings.game, &settings.levels.mode, &drawn, settings.seed, first, count);
    let (mut world, agents) = built.map_err(|error| error.to_string())?;
    Renewal::set_up(&mut world, |world| {
        let TickSchedules { decide, judge, .. } = *world.resource::<TickSchedules>();
        world.schedule_scope(decide, |_, schedule| {
            schedule.add_systems(meet.in_set(PlaybotSystems::Decide));
        });
        world.schedule_scope(judge, |_, schedule| {
            schedule.add_systems(note.in_set(PlaybotSystems::Record).after(record_ticks));
        });
    });
    Renewal::carry_resource::<Seats>(&mut world);
    if drawn.is_image() && !settings.observation.is_image() {
        // The pictures for people have replaced the numbers that agents see.
        for &agent in &agents {
            world.entity_mut(agent).insert(VectorSensor::new(settings.game.observation().names));
        }
    }
    Ok((world, agents))
}

/// Gives a World its line to the caller.
pub(super) fn seated(mut world: World, agents: Vec<Entity>, first: usize, line: Line) -> World {
    let rows = agents.iter().map(|_| Row::default()).collect();
    world.insert_resource(Seats { agents, first, rows, line });
    world
}

/// Plays a World until there are no more orders.
pub(super) fn play(world: &mut World) -> Result<(), String> {
    world.resource_scope(|world, mut seats: Mut<Seats>| {
        seats.obey(world);
        seats.set_controls(world);
    });
    while !world.resource::<Seats>().line.is_over {
        tick_world(world).map_err(|fault| fault.to_string())?;
        world.resource_scope(|world, mut seats: Mut<Seats>| {
            seats.end_tick();
            if seats.rows.iter().all(|row| row.stage.is_held()) && !seats.line.is_over {
                // No agent plays in the next tick, so it is not run.
                seats.show(world);
                seats.obey(world);
            }
            seats.set_controls(world);
        });
    }
    flush_unfinished(world).map_err(|error| error.to_string())
}

/// Waits for the next actions, once all agents have something to show.
fn meet(world: &mut World) {
    world.resource_scope(|world, mut seats: Mut<Seats>| {
        let waits = |&agent: &Entity| !world.get::<Episode>(agent).is_some_and(Episode::is_running);
        let mut playing = seats.agents.iter().zip(&seats.rows).filter(|(_, row)| !row.stage.is_held());
        if playing.any(|(agent, _)| waits(agent)) {
            return seats.pause(world);
        }
        if seats.replay(world) {
            return;
        }
        seats.show(world);
        seats.obey(world);
    });
}

/// Notes the outcome of the tick, and the last observations of the episodes that it ends.
fn note(world: &mut World) {
    world.resource_scope(|world, mut seats: Mut<Seats>| {
        let Seats { agents, rows, .. } = &mut *seats;
        let mut ended = false;
        for (&agent, row) in agents.iter().zip(rows.iter_mut()) {
            let (Some(episode), Some(reward)) = (world.get::<Episode>(agent), world.get::<Reward>(agent)) else {
                continue;
            };
            if row.stage != Stage::Plays || !Control::of(world, agent).is_active() || !episode.is_running() {
                continue;
            }
            row.reward = reward.get();
            row.end = episode.end();
            row.success = episode.is_success();
            row.ended = (episode.level, episode.tick);
            ended |= row.end.is_some();
        }
        if !ended {
            return;
        }
        run_observe_schedule(world);
        for (&agent, row) in agents.iter().zip(rows.iter_mut()).filter(|(_, row)| row.end.is_some()) {
            row.last = world.get::<Observation>(agent).cloned();
        }
    });
}

impl Seats {
    /// Pauses all agents for the rest of this tick.
    fn pause(&self, world: &mut World) {
        for &agent in &self.agents {
            set(world, agent, Control::Idle);
        }
    }

    /// Lets those agents take part in the next tick that play, or begin to.
    fn set_controls(&self, world: &mut World) {
        for (&agent, row) in self.agents.iter().zip(&self.rows) {
            let control = if row.stage.is_held() { Control::Idle } else { Control::Bot };
            if Control::of(world, agent) != control {
                set(world, agent, control);
            }
        }
    }

    /// Moves agents on whose episodes this tick has ended.
    fn end_tick(&mut self) {
        let next = match self.line.autoreset {
            Autoreset::NextStep => Stage::Ended,
            Autoreset::SameStep => Stage::Begins,
            Autoreset::Disabled => Stage::Waits,
        };
        for row in self.rows.iter_mut().filter(|row| row.stage == Stage::Plays && row.end.is_some()) {
            row.stage = next;
        }
    }

    /// Plays the next actions of kept episodes, while all other agents are paused. Returns whether there were any.
    fn replay(&mut self, world: &mut World) -> bool {
        if !self.rows.iter().any(|row| row.replayed.as_ref().is_some_and(|kept| row.actions.len() < kept.actions.len()))
        {
            return false;
        }
        for (&agent, row) in self.agents.iter().zip(&mut self.rows) {
            let next = row.replayed.as_ref().and_then(|kept| kept.actions.get(row.actions.len()));
            let Some(action) = next.cloned() else {
                set(world, agent, Control::Idle);
                continue;
            };
            row.actions.push_back(action.clone());
            set(world, agent, Action(action));
        }
        true
    }

    /// Returns why a kept episode has not led to its state.
    fn astray(&mut self, world: &World) -> Option<String> {
        let mut why = None;
        for (at, (&agent, row)) in self.agents.iter().zip(&mut self.rows).enumerate() {
            let Some(kept) = row.replayed.take() else { continue };
            if world.get::<StateHash>(agent) != Some(&kept.hash) {
                why = Some(format!(
                    "agent {}, level {}: the same actions have not led to the same state after {} ticks, so the kept episode \
                     is lost; `doctor` names what differs in the game",
                    self.first + at,
                    kept.level,
                    kept.actions.len()
                ));
            }
        }
        why
    }

    /// Writes the results of all agents, and tells the caller.
    fn show(&mut self, world: &mut World) {
        let written = self.astray(world).map_or_else(|| self.write(world), Err);
        for (&agent, row) in self.agents.iter().zip(&mut self.rows) {
            if row.stage == Stage::Begins {
                row.stage = Stage::Plays;
                if let Some(queue) = row.queue.take() {
                    world.entity_mut(agent).insert(queue);
                }
            }
        }
        self.line.reply(written);
    }

    /// Does what the caller orders, until the next step or the end.
    fn obey(&mut self, world: &mut World) {
        loop {
            match self.line.next_order() {
                Some(Order::Call(work)) => work(world, &self.agents, &self.rows),
                Some(Order::Load { first, saved }) => return self.load(world, first, saved),
                Some(Order::Step { actions, slot }) => {
                    self.line.slot = slot;
                    return self.act(world, actions);
                }
                Some(Order::Begin { begins, slot }) => {
                    self.line.slot = slot;
                    return self.begin(world, begins);
                }
                None => {
                    self.line.is_over = true;
                    return self.pause(world);
                }
            }
        }
    }

    fn act(&mut self, world: &mut World, actions: Vec<ActionValue>) {
        for ((&agent, row), action) in self.agents.iter().zip(&mut self.rows).zip(actions) {
            row.reward = 0.0;
            match row.stage {
                Stage::Plays => {
                    if row.end.is_some() {
                        // Of the episode before, in the same step.
                        row.forget(Stage::Plays);
                    }
                    row.actions.push_back(action.clone());
                    set(world, agent, Action(action));
                }
                Stage::Ended => row.forget(Stage::Begins),
                Stage::Begins | Stage::Waits => {}
            }
        }
    }

    /// Plays kept episodes again, from their beginning in the next tick on.
    fn load(&mut self, world: &mut World, first: usize, saved: Vec<SavedEpisode>) {
        let mut begins = vec![None; self.rows.len()];
        for (at, saved) in (first..).zip(&saved) {
            begins[at] = Some(Begin { level: Some(saved.level), anew: None });
        }
        self.begin(world, begins);
        for (row, saved) in self.rows[first..].iter_mut().zip(saved) {
            row.replayed = Some(saved);
        }
    }

    /// Leaves episodes for others, which begin in the next tick. The other agents are paused in this one.
    fn begin(&mut self, world: &mut World, begins: Vec<Option<Begin>>) {
        self.pause(world);
        for ((&agent, row), begin) in self.agents.iter().zip(&mut self.rows).zip(begins) {
            let Some(begin) = begin else {
                row.reward = 0.0;
                continue;
            };
            row.forget(Stage::Begins);
            if let Some(mut episode) = world.get_mut::<Episode>(agent) {
                episode.abandon();
            }
            let mut agent = world.entity_mut(agent);
            if let Some((streams, queue)) = begin.anew {
                row.queue = None;
                agent.insert((streams, queue));
            }
            if let Some(level) = begin.level {
                let queue = agent.get::<LevelQueue>().cloned();
                row.queue = row.queue.take().or(queue);
                agent.insert(LevelQueue::Always(level));
            }
        }
    }

    /// Writes the rows of this World's agents into each array.
    fn write(&self, world: &World) -> Reply {
        let written = self.line.memory.layout().results.iter().try_for_each(|array| self.write_array(world, array));
        written.map_err(|error| format!("the results cannot be written into shared memory: {error}"))
    }

    fn write_array(&self, world: &World, array: &Array) -> io::Result<()> {
        let (Line { memory, slot, .. }, first, width) = (&self.line, self.first, array.row());
        let rows = || self.agents.iter().copied().zip(&self.rows);
        let put = |row: usize, bytes: &[u8]| memory.write(*slot, array.offset + (first + row) * width, bytes);
        let put_flags =
            |flag: fn(&Row) -> bool| put(0, &rows().map(|(_, row)| u8::from(flag(row))).collect::<Vec<u8>>());
        match array.name {
            // Pictures are large, so they are copied once.
            OBSERVATIONS if array.dtype == Number::U8 => rows().enumerate().try_for_each(|(at, (agent, row))| {
                put(at, fitting(bytes_of(row.seen(world, agent), array.dtype), width))
            }),
            OBSERVATIONS => {
                let mut bytes = Vec::with_capacity(width * self.rows.len());
                for (number, (agent, row)) in (1..).zip(rows()) {
                    bytes.extend_from_slice(bytes_of(row.seen(world, agent), array.dtype));
                    // An observation of another length is a fault of the game, which is reported after the tick.
                    bytes.resize(number * width, 0);
                }
                put(0, &bytes)
            }
            // The other rows mean nothing.
            FINAL_OBSERVATIONS => rows().enumerate().try_for_each(|(at, (_, row))| match &row.last {
                Some(last) => put(at, fitting(bytes_of(last, array.dtype), width)),
                None => Ok(()),
            }),
            REWARDS => put(0, &rows().flat_map(|(_, row)| row.reward.to_le_bytes()).collect::<Vec<u8>>()),
            TERMINATED => put_flags(|row| matches!(row.end, Some(EpisodeEnd::Terminated { .. }))),
            TRUNCATED => put_flags(|row| row.end == Some(EpisodeEnd::Truncated)),
            SUCCESS => put_flags(|row| row.end.is_some() && row.success),
            LEVEL => {
                put(0, &rows().flat_map(|(agent, row)| row.place(world, agent).0.to_le_bytes()).collect::<Vec<u8>>())
            }
            TICK => {
                put(0, &rows().flat_map(|(agent, row)| row.place(world, agent).1.to_le_bytes()).collect::<Vec<u8>>())
            }
            LEGAL => {
                let mut bytes = vec![1; width * self.rows.len()];
                for (mask, &agent) in bytes.chunks_exact_mut(width).zip(&self.agents) {
                    let legal = (world.get::<LegalActions>(agent), world.get::<Agent>(agent));
                    if let (Some(legal), Some(Agent { actions, .. })) = legal {
                        mask.iter_mut().zip(legal.entries(actions)).for_each(|(to, is_legal)| *to = u8::from(is_legal));
                    }
                }
                put(0, &bytes)
            }
            _ => Ok(()),
        }
    }
}

/// Replaces a component that every agent has. To insert it takes longer.
fn set<C: Component<Mutability = Mutable>>(world: &mut World, agent: Entity, component: C) {
    if let Some(mut known) = world.get_mut::<C>(agent) {
        *known = component;
    }
}

impl Row {
    /// Forgets the outcome that the caller has seen.
    fn forget(&mut self, stage: Stage) {
        let queue = self.queue.take();
        *self = Self { stage, queue, ..Self::default() };
    }

    /// Returns level and tick of the episode that the caller sees.
    fn place(&self, world: &World, agent: Entity) -> (u64, u32) {
        match world.get::<Episode>(agent) {
            Some(episode) if !self.stage.is_held() => (episode.level, episode.tick),
            _ => self.ended,
        }
    }

    /// Returns what the caller sees of the agent.
    fn seen<'a>(&'a self, world: &'a World, agent: Entity) -> &'a Observation {
        static NOTHING: Observation = Observation { vector: Vec::new(), image: Vec::new() };
        let now = || world.get::<Observation>(agent).unwrap_or(&NOTHING);
        if self.stage.is_held() { self.last.as_ref().unwrap_or_else(now) } else { now() }
    }
}

/// Returns the numbers or the picture of an observation as bytes.
fn bytes_of(seen: &Observation, dtype: Number) -> &[u8] {
    match dtype {
        Number::U8 => &seen.image,
        _ => bytemuck::cast_slice(&seen.vector),
    }
}

/// Returns a row of so many bytes, or nothing: a picture of another size is a fault of the game, which is reported after the
/// tick.
fn fitting(bytes: &[u8], width: usize) -> &[u8] {
    if bytes.len() == width { bytes } else { &[] }
}
