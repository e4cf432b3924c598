//! Levels and episodes of a session: what was played, its recording, and its replay.

use crate::{
    arrays::{LEGAL, LEVEL, Memory, Number, OBSERVATIONS, REWARDS, SUCCESS, TERMINATED, TICK, TRUNCATED},
    lockstep::{Awaited, LevelOrder, Lockstep, Settings, StepError, with_worlds},
    mcp::{
        tools::LevelName,
        words::{Seat, Words, action_bytes, short},
    },
    messages::Reset,
};
use bevy::prelude::*;
use bevy_playbot::{
    action::{ActionSpace, ActionValue, Actions},
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoWriter},
    engine::{LevelFiles, panics::PanicReports},
    level::LevelFile,
    prelude::{Action, EpisodeEnd, StateHash},
    unknown_name::UnknownName,
};
use playbot_harness::{game::level_designs, inspect::LevelRequest, level_files::is_level_files, sensors::GameSensors};
use playbot_learner::{ObsKind, disk};
use serde_json::{Value, json};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// An episode that a language model has played, or plays.
#[derive(Clone, Debug, Default)]
pub struct PlayedEpisode {
    /// Its number in the session, from 0.
    pub number: usize,
    /// The level.
    pub level: u64,
    /// The file of the level, for levels from files.
    pub level_file: Option<LevelFile>,
    /// What each agent has done, in the order of their rows: one, unless the model plays all seats of a game.
    pub agents: Vec<PlayedAgent>,
    /// The words of the game's panic or fault, if it broke. The last action of each agent is then that of the tick in
    /// which it did, which has no reward and no state.
    pub broken: Option<String>,
}

/// An agent in an episode. All lists run over its ticks.
#[derive(Clone, Debug, Default)]
pub struct PlayedAgent {
    /// The action of each tick, as it was played.
    pub actions: Vec<ActionValue>,
    /// The reward of each tick.
    pub rewards: Vec<f32>,
    /// The hash of the state after each tick.
    pub states: Vec<StateHash>,
    /// The end of its episode, if that is over.
    pub end: Option<EpisodeEnd>,
    /// Whether it has reached its goal.
    pub success: bool,
}

impl PlayedAgent {
    /// Returns the sum of the rewards.
    pub fn episode_return(&self) -> f64 {
        // A sum of nothing would be -0.
        self.rewards.iter().fold(0.0, |sum, reward| sum + f64::from(*reward))
    }
}

impl PlayedEpisode {
    /// Returns the ticks that were played to their end.
    pub fn ticks(&self) -> usize {
        self.agents.iter().map(|agent| agent.states.len()).max().unwrap_or_default()
    }

    /// Returns whether no agent can act any more.
    pub fn is_over(&self) -> bool {
        self.broken.is_some() || self.agents.iter().all(|agent| agent.end.is_some())
    }

    /// Returns the recording of the first agent; `None` without a tick.
    pub fn recording(&self, space: ActionSpace) -> Option<DemoEpisode> {
        let agent = self.agents.first().filter(|agent| !agent.states.is_empty())?;
        let ticks = agent.states.len();
        let mut episode = DemoEpisode::new(self.level, space);
        episode.level_file.clone_from(&self.level_file);
        let mut actions = Actions::empty(&space);
        for action in agent.actions.iter().take(ticks) {
            actions.push(action).ok()?;
        }
        episode.actions = actions;
        episode.rewards.clone_from(&agent.rewards);
        episode.state_hashes = agent.states.iter().map(StateHash::folded).collect();
        episode.deciders = vec![Decider::Bot; ticks];
        episode.end = match agent.end {
            Some(EpisodeEnd::Terminated { success }) => DemoEnd::Terminated { success },
            Some(EpisodeEnd::Truncated) => DemoEnd::Truncated,
            None => DemoEnd::Aborted,
        };
        Some(episode)
    }

    /// Returns the end in a word, for the first agent.
    pub(super) fn end(&self) -> &'static str {
        match self.agents.first().and_then(|agent| agent.end) {
            _ if self.broken.is_some() => "broken",
            Some(EpisodeEnd::Terminated { .. }) => "terminated",
            Some(EpisodeEnd::Truncated) => "truncated",
            None => "not over",
        }
    }

    /// Describes it in a line of a list.
    pub(super) fn summary(&self) -> Value {
        let first = self.agents.first();
        json!({
            "episode": self.number, "level": self.level, "ticks": self.ticks(), "end": self.end(),
            "success": first.is_some_and(|agent| agent.success),
            "return": first.map(PlayedAgent::episode_return),
        })
    }
}

/// The newest results of the agents.
pub(super) struct Rows {
    pub(super) level: u64,
    pub(super) tick: u32,
    pub(super) agents: Vec<RowNow>,
}

/// The newest results of an agent.
pub(super) struct RowNow {
    pub(super) values: Vec<f32>,
    pub(super) legal: Vec<u8>,
    pub(super) reward: f32,
    pub(super) end: Option<EpisodeEnd>,
    pub(super) success: bool,
}

impl Rows {
    /// Reads the newest results of so many agents.
    pub(super) fn read(memory: &Memory, agents: usize) -> Self {
        let layout = memory.layout();
        memory.with_results(|results| {
            let row = |name: &str, at: usize| -> &[u8] {
                let Some(array) = layout.result(name) else { return &[] };
                let from = array.offset + at * array.row();
                results.get(from..from + array.row()).unwrap_or_default()
            };
            let number = |name: &str, at: usize| {
                let mut word = [0; 8];
                row(name, at).iter().zip(&mut word).for_each(|(from, to)| *to = *from);
                u64::from_le_bytes(word)
            };
            let is_vector = layout.result(OBSERVATIONS).is_some_and(|array| array.dtype == Number::F32);
            let agent = |at: usize| {
                let seen = if is_vector { row(OBSERVATIONS, at) } else { &[] };
                let values = seen.chunks_exact(4).map(|word| f32::from_le_bytes([word[0], word[1], word[2], word[3]]));
                let success = number(SUCCESS, at) != 0;
                let end = match (number(TERMINATED, at) != 0, number(TRUNCATED, at) != 0) {
                    (true, _) => Some(EpisodeEnd::Terminated { success }),
                    (_, true) => Some(EpisodeEnd::Truncated),
                    _ => None,
                };
                let reward = f32::from_bits(number(REWARDS, at) as u32);
                RowNow { values: values.collect(), legal: row(LEGAL, at).to_vec(), reward, end, success }
            };
            Self { level: number(LEVEL, 0), tick: number(TICK, 0) as u32, agents: (0..agents).map(agent).collect() }
        })
    }
}

/// The state of an agent after a tick, as its World has it.
pub(super) struct AfterTick {
    pub(super) action: Option<ActionValue>,
    pub(super) state: StateHash,
}

/// Asks the World for actions and states of its agents.
pub(super) fn after_tick(worlds: &mut Lockstep) -> Result<Vec<AfterTick>, StepError> {
    let asked = worlds.begin_calls(|_, world, agents| -> Vec<AfterTick> {
        let after = |&agent: &Entity| AfterTick {
            action: world.get::<Action>(agent).map(|action| action.0.clone()),
            state: world.get::<StateHash>(agent).copied().unwrap_or_default(),
        };
        agents.iter().map(after).collect()
    })?;
    let answers: Result<Vec<Vec<AfterTick>>, StepError> = asked.into_iter().map(Awaited::answer).collect();
    Ok(answers?.into_iter().flatten().collect())
}

/// Lets a World write no files of its own when the game panics: the session has the actions.
pub(super) fn keep_no_files(worlds: &mut Lockstep) -> Result<(), StepError> {
    let asked = worlds.begin_calls(|_, world, _| {
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
            reports.keep_no_files();
        }
    })?;
    asked.into_iter().try_for_each(Awaited::answer)
}

/// Asks the World for the file of a level.
pub(super) fn file_of(worlds: &mut Lockstep, level: u64) -> Option<LevelFile> {
    let file = move |world: &mut World, _| world.get_resource::<LevelFiles>()?.of(level).cloned();
    worlds.begin_call(0, file).and_then(Awaited::answer).ok().flatten()
}

/// The files of a session's episodes.
pub(super) struct Records {
    folder: PathBuf,
    header: DemoHeader,
    writer: Option<DemoWriter>,
    /// The lines of `episodes.jsonl`, where all seats are played: a recording has the actions of one agent.
    lines: String,
    kept: usize,
}

/// Name of the recording.
const RECORDING: &str = "session.demo";

/// Name of the file of episodes whose seats are all played by the model.
const ALL_SEATS: &str = "episodes.jsonl";

impl Records {
    pub(super) fn new(folder: &Path, header: DemoHeader) -> Self {
        Self { folder: folder.to_owned(), header, writer: None, lines: String::new(), kept: 0 }
    }

    /// Notes the name of the client, which a recording's head has.
    pub(super) fn of_client(&mut self, client: &str) {
        client.clone_into(&mut self.header.demonstrator);
    }

    /// Writes an episode, which is on the disk then.
    ///
    /// # Errors
    ///
    /// The system refuses, in words.
    pub(super) fn keep(&mut self, episode: &PlayedEpisode, words: &Words) -> Result<(), String> {
        if episode.agents.len() > 1 {
            return self.keep_line(episode, words);
        }
        let Some(recording) = episode.recording(words.space) else { return Ok(()) };
        let writer = match &mut self.writer {
            Some(writer) => writer,
            None => {
                let path = self.folder.join(RECORDING);
                let writer = DemoWriter::create(path, self.header.clone()).map_err(|error| error.to_string())?;
                self.writer.insert(writer)
            }
        };
        writer.push(&recording).map_err(|error| error.to_string())?;
        self.kept += 1;
        Ok(())
    }

    fn keep_line(&mut self, episode: &PlayedEpisode, words: &Words) -> Result<(), String> {
        let seat = |(at, agent): (usize, &PlayedAgent)| {
            let actions: Vec<Value> = agent.actions.iter().map(|action| words.write(at, action)).collect();
            let states: Vec<String> = agent.states.iter().map(|state| format!("{:016x}", state.0)).collect();
            json!({
                "seat": words.seats[at].name, "actions": actions, "rewards": agent.rewards, "states": states,
                "success": agent.success,
            })
        };
        let seats: Vec<Value> = episode.agents.iter().enumerate().map(seat).collect();
        let mut line = episode.summary();
        line["seats"] = Value::Array(seats);
        line["broken"] = json!(episode.broken);
        self.add_line(&line)?;
        self.kept += 1;
        Ok(())
    }

    /// Adds a line to the file of episodes of all seats.
    ///
    /// # Errors
    ///
    /// The system refuses, in words.
    pub(super) fn add_line(&mut self, line: &Value) -> Result<PathBuf, String> {
        self.lines.push_str(&format!("{line}\n"));
        let path = self.folder.join(ALL_SEATS);
        let written = disk::write_atomically(&path, self.lines.as_bytes());
        written.map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        Ok(path)
    }

    /// Returns the file of the kept episodes, and their number; `None` without one.
    pub(super) fn kept(&self) -> Option<(PathBuf, usize)> {
        let name = if self.writer.is_some() { RECORDING } else { ALL_SEATS };
        (self.kept > 0).then(|| (self.folder.join(name), self.kept))
    }
}

// Replay of an episode.

/// The first difference of a replay.
struct Difference {
    tick: usize,
    agent: usize,
    what: String,
}

/// Plays an episode again in a World of its own, and says whether it is the same in each tick.
///
/// # Errors
///
/// No World can be built, or it is time to stop, in words.
pub(super) fn replay(
    settings: &Settings<'_>,
    episode: &PlayedEpisode,
    words: &Words,
    stops: &dyn Fn() -> bool,
) -> Result<Value, String> {
    // As tests and `demo verify` play it: pictures are no part of a state.
    let settings = Settings { picture: None, observation: Default::default(), ..settings.clone() };
    let memory = Arc::new(Memory::of_messages(settings.layout()));
    let (ticks, difference) =
        with_worlds(&settings, &memory, |worlds| play_again(worlds, &memory, episode, words, stops))??;
    let shown = difference.map(|Difference { tick, agent, what }| {
        let seat = words.seats.get(agent).and_then(|seat| seat.name.clone());
        json!({ "tick": tick, "seat": seat, "what": what })
    });
    Ok(json!({
        "episode": episode.number, "level": episode.level, "ticks": ticks, "same": shown.is_none(), "difference": shown,
        "end": episode.end(),
    }))
}

/// Plays the actions of an episode. Returns the ticks that were compared, and the first difference.
fn play_again(
    worlds: &mut Lockstep,
    memory: &Memory,
    episode: &PlayedEpisode,
    words: &Words,
    stops: &dyn Fn() -> bool,
) -> Result<(usize, Option<Difference>), String> {
    let differs = |tick, agent, what: String| Ok((tick, Some(Difference { tick, agent, what })));
    let (ticks, breaks) = (episode.ticks(), episode.broken.is_some());
    let reset = Reset { levels: Some(vec![episode.level]), ..Reset::default() };
    match worlds.reset(&reset).and_then(|_| keep_no_files(worlds)) {
        Ok(()) => {}
        Err(StepError::Failed(why)) if breaks && ticks == 0 => return broke_again(episode, 0, why),
        Err(error) => return differs(0, 0, error.to_string()),
    }
    for tick in 0..ticks + usize::from(breaks) {
        if stops() {
            return Err("the program was stopped".to_owned());
        }
        let action = |agent: &PlayedAgent| agent.actions.get(tick).unwrap_or(&words.idle).clone();
        let actions: Vec<ActionValue> = episode.agents.iter().map(action).collect();
        memory.take_actions(&action_bytes(memory.layout(), &actions));
        let after = worlds.step().and_then(|_| after_tick(worlds));
        let after = match after {
            Ok(after) => after,
            Err(error) if breaks && tick == ticks => return broke_again(episode, tick, error.to_string()),
            Err(error) => return differs(tick, 0, error.to_string()),
        };
        let rows = Rows::read(memory, episode.agents.len());
        for (at, (agent, now)) in episode.agents.iter().zip(&after).enumerate() {
            let Some(then) = agent.states.get(tick) else { continue };
            if now.state != *then {
                return differs(
                    tick,
                    at,
                    format!("the state has the hash {:016x}, and had {:016x}", now.state.0, then.0),
                );
            }
            if agent.rewards[tick].to_bits() != rows.agents[at].reward.to_bits() {
                return differs(
                    tick,
                    at,
                    format!("the reward is {}, and was {}", rows.agents[at].reward, agent.rewards[tick]),
                );
            }
        }
    }
    if breaks {
        return differs(ticks, 0, "the game has broken in this tick, and does not now".to_owned());
    }
    Ok((ticks, None))
}

/// Returns the result of a replay in which the game has broken again.
fn broke_again(episode: &PlayedEpisode, tick: usize, why: String) -> Result<(usize, Option<Difference>), String> {
    // A file may be named in the words, and its name has the number of the process.
    let is_same = episode.broken.as_deref().map(reason) == Some(reason(&why));
    Ok((tick, (!is_same).then_some(Difference { tick, agent: 0, what: why })))
}

/// Returns the words of a fault without the file that it names.
pub(super) fn reason(why: &str) -> &str {
    why.split_once("; the actions so far").map_or(why, |(reason, _)| reason)
}

// The levels of a session: their names, the next one, and what the program knows of one.

/// Most names of levels that an answer lists.
const MOST_NAMES: usize = 200;

/// Most characters of a level's description.
const MOST_LETTERS: usize = 20_000;

/// The levels of a session.
pub(super) struct Levels<'a>(pub(super) &'a Settings<'a>);

impl Levels<'_> {
    /// Returns the level after this one, or the first, where levels are played in turn; `None` where they are drawn.
    pub(super) fn after(&self, level: Option<u64>) -> Option<u64> {
        let levels = &self.0.levels;
        let next = level.map_or(levels.first, |level| level.wrapping_add(1));
        let next = if levels.contains(&levels.mode, next) { next } else { levels.first };
        (self.0.order == LevelOrder::Rounds).then_some(next)
    }

    /// Returns the names of the levels that have one, with their numbers.
    fn names(&self) -> Vec<(u64, String)> {
        let Settings { game, levels, .. } = self.0;
        if is_level_files(&levels.mode) {
            let Ok(designs) = level_designs(*game, &levels.mode) else { return Vec::new() };
            let named = levels.levels().map_while(|level| Some((level, designs.path(level)?.to_owned())));
            return named.collect();
        }
        let names = (0..).zip(game.tools().levels.level_names(&levels.mode));
        names.filter(|(level, _)| levels.contains(&levels.mode, *level)).collect()
    }

    /// Returns the name of a level, if it has one.
    pub(super) fn name(&self, level: u64) -> Option<String> {
        let Settings { game, levels, .. } = self.0;
        if is_level_files(&levels.mode) {
            return level_designs(*game, &levels.mode).ok()?.path(level).map(str::to_owned);
        }
        game.tools().levels.level_name(&levels.mode, level)
    }

    /// Returns the number of a level of this session.
    ///
    /// # Errors
    ///
    /// There is no such level: with the nearest name, or the range of numbers.
    pub(super) fn number_of(&self, level: &LevelName) -> Result<u64, String> {
        let levels = &self.0.levels;
        let own = format!("{}:", levels.mode);
        let number = match level {
            LevelName::Number(number) => Some(*number),
            LevelName::Name(name) => name.strip_prefix(&own).unwrap_or(name).trim().parse().ok(),
        };
        if let (LevelName::Name(name), None) = (level, number) {
            let names = self.names();
            if let Some((number, _)) = names.iter().find(|(_, known)| known == name) {
                return Ok(*number);
            }
            let listed: Vec<&str> = names.iter().take(MOST_NAMES).map(|(_, name)| name.as_str()).collect();
            return Err(match listed.as_slice() {
                [] => format!("`{name}` is no level: take a number from {} to {}", levels.first, levels.last),
                listed => UnknownName::new("level", name, listed).to_string(),
            });
        }
        number.filter(|number| levels.contains(&levels.mode, *number)).ok_or_else(|| {
            let number = number.unwrap_or_default();
            format!("level {number} is none of this session's: take one from {} to {}", levels.first, levels.last)
        })
    }

    /// Describes the game and one of its levels.
    pub(super) fn describe(&self, level: u64, words: &Words) -> Value {
        let Settings { game, levels, order, observation, .. } = self.0;
        let tools = game.tools();
        let request = LevelRequest { mode: Some(&levels.mode), level: Some(level), ..LevelRequest::default() };
        let text = game.show_level(&request).map_or_else(|error| error.to_string(), |view| view.text);
        let plan = tools.levels.floor_plan(&levels.mode, level);
        let names = self.names();
        let listed: BTreeMap<String, &String> =
            names.iter().take(MOST_NAMES).map(|(level, name)| (level.to_string(), name)).collect();
        let seat = |(at, seat): (usize, &Seat)| json!({ "seat": seat.name, "actions": words.describe_actions(at) });
        let observed = match observation.obs_kind(*game) {
            ObsKind::Vector(_) => words.observed(),
            ObsKind::Image(_) => &[],
        };
        json!({
            "game": game.name(), "version": game.version(), "mode": levels.mode,
            "levels": {
                "first": levels.first, "last": levels.last, "count": levels.len(), "order": order, "names": listed,
            },
            "shown": {
                "level": level, "name": self.name(level), "text": text.chars().take(MOST_LETTERS).collect::<String>(),
                "goal": plan.map(|plan| plan.goal.to_array().map(short)),
            },
            "seats": words.seats.iter().enumerate().map(seat).collect::<Vec<Value>>(),
            "observation": observed, "sees": observation.to_string(), "ticks_per_second": game.tick_hz(),
            "time_limit": tools.host.time_limit(),
        })
    }
}
