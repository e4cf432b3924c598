//! A session: the work of its tools on Worlds and on the episodes so far.
//!
//! - `findings`: the tool that asks the detectors, and stores the model's own findings.

mod findings;

use crate::{
    arrays::Memory,
    lockstep::{Awaited, Lockstep, Settings, StepError},
    mcp::{
        FoundInEpisode, Server, SessionEnd,
        episodes::{
            Levels, PlayedAgent, PlayedEpisode, Records, RowNow, Rows, after_tick, file_of, keep_no_files, reason,
            replay,
        },
        protocol::{Inbox, Incoming, Request, RpcError, agreed, answer},
        tools::{self, Act, Begin, Level, NAMES, Observe, Others, Replay},
        words::{Words, action_bytes, png, seats, short},
    },
    messages::Reset,
};
use base64::{Engine, engine::general_purpose::STANDARD};
use bevy::prelude::*;
use bevy_playbot::{
    action::ActionValue,
    observation::Observation,
    prelude::EpisodeEnd,
    unknown_name::{UnknownName, nearest, question},
    vision::ImageOptions,
};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use std::{collections::BTreeMap, io::Write, sync::Arc, time::Instant};

/// Most observed values that are shown unless they are asked for: more would fill a model's memory in a few calls.
const MOST_VALUES: usize = 100;

/// The name of a client that does not say its own.
const CLIENT: &str = "mcp";

/// The reason for which a session hands its Worlds back, or asks for some.
pub(super) enum Pause {
    /// The client has left.
    Over,
    /// This request needs Worlds.
    NeedsWorlds(Request),
    /// The game has broken its World.
    Broken,
}

/// What became of a request.
enum Handled {
    Answered(Result<Value, RpcError>),
    NeedsWorlds,
    /// The answer, after which the Worlds are gone.
    Broken(Value),
}

/// What a tool answers.
enum Told {
    /// Data, and a picture.
    Shown(Value, Option<Vec<u8>>),
    /// The tool cannot do it, and why.
    Refused(String),
    /// The call is none of the tool's.
    Wrong(RpcError),
    /// It needs Worlds.
    NeedsWorlds,
    /// The game has broken its World, in words.
    Broken(String),
}

/// The observed values that an answer shows.
#[derive(Clone, Copy)]
enum Shows<'a> {
    None,
    All,
    /// Those whose names begin so.
    Named(&'a [String]),
}

/// A session with a client.
pub(super) struct Session<'a> {
    server: &'a Server<'a>,
    settings: &'a Settings<'a>,
    words: Words,
    levels: Levels<'a>,
    memory: Arc<Memory>,
    output: &'a mut dyn Write,
    records: Records,
    client: String,
    is_greeted: bool,
    begun: Instant,
    ticks: u64,
    episodes: Vec<PlayedEpisode>,
    /// Whether the latest episode is in the Worlds as they are now.
    is_on_stage: bool,
    /// Whether the latest episode has been written, or has nothing to write.
    is_kept: bool,
    /// The last action of each seat.
    held: Vec<ActionValue>,
    /// Worlds that were built so far.
    built: u64,
    /// What detectors have found in each episode, and the ticks that they have seen.
    examined: BTreeMap<usize, (usize, Vec<FoundInEpisode>)>,
    reports: Vec<(usize, FoundInEpisode)>,
    /// What went wrong beside the answers, for the next one.
    problems: Vec<String>,
}

impl<'a> Session<'a> {
    pub(super) fn new(
        server: &'a Server<'a>,
        settings: &'a Settings<'a>,
        memory: Arc<Memory>,
        output: &'a mut dyn Write,
    ) -> Self {
        let (game, mode) = (settings.game, settings.levels.mode.as_str());
        let words = Words::of(game, seats(game, mode, settings.agents_per_arena() as u32));
        let mut records = Records::new(server.folder, game.demo_header(mode));
        records.of_client(CLIENT);
        Self {
            server,
            settings,
            held: vec![words.idle.clone(); words.seats.len()],
            words,
            levels: Levels(settings),
            memory,
            output,
            records,
            client: CLIENT.to_owned(),
            is_greeted: false,
            begun: Instant::now(),
            ticks: 0,
            episodes: Vec::new(),
            is_on_stage: false,
            is_kept: true,
            built: 0,
            examined: BTreeMap::new(),
            reports: Vec::new(),
            problems: Vec::new(),
        }
    }

    /// Answers requests, `first` before all others, until the client leaves, Worlds are needed, or the game breaks.
    pub(super) fn talk(
        &mut self,
        inbox: &Inbox,
        mut worlds: Option<&mut Lockstep>,
        mut first: Option<Request>,
    ) -> Pause {
        if worlds.is_some() {
            self.built += 1;
        }
        loop {
            let request = match first.take() {
                Some(request) => request,
                None => match inbox.next(self.server.stops) {
                    None => return Pause::Over,
                    Some(Incoming::Request(request)) => request,
                    Some(Incoming::Wrong(id, error)) => match answer(self.output, &id, Err(error)) {
                        Ok(()) => continue,
                        Err(_) => return Pause::Over,
                    },
                    Some(Incoming::Cancelled(_) | Incoming::Nothing) => continue,
                },
            };
            if inbox.is_cancelled(&request.id) {
                continue;
            }
            let (answered, is_broken) = match self.handle(&request, worlds.as_deref_mut(), inbox) {
                Handled::NeedsWorlds => return Pause::NeedsWorlds(request),
                Handled::Answered(answered) => (answered, false),
                Handled::Broken(answered) => (Ok(answered), true),
            };
            // A cancelled request gets no answer.
            let is_sent = inbox.is_cancelled(&request.id) || answer(self.output, &request.id, answered).is_ok();
            if is_broken {
                return Pause::Broken;
            }
            if !is_sent {
                return Pause::Over;
            }
        }
    }

    /// Answers a request whose Worlds could not be built, and goes on.
    pub(super) fn cannot_play(&mut self, inbox: &Inbox, id: &Value, why: &str) -> Pause {
        let words = format!("no World of the game can be built: {why}; `level` and `findings` still answer");
        match answer(self.output, id, Ok(refusal(&words))) {
            Ok(()) => self.talk(inbox, None, None),
            Err(_) => Pause::Over,
        }
    }

    /// Writes the running episode, and lets detectors look at what they have not seen yet.
    ///
    /// # Errors
    ///
    /// The recording cannot be written, in words.
    pub(super) fn end(mut self) -> Result<SessionEnd, String> {
        self.keep();
        if !(self.server.stops)() {
            self.examine();
        }
        let findings = self.examined.values().map(|(_, found)| found.len()).sum::<usize>() + self.reports.len();
        self.problems.iter().for_each(|problem| (self.server.report)(problem));
        match self.problems.pop() {
            Some(problem) => Err(problem),
            None => Ok(SessionEnd {
                episodes: self.episodes.len(),
                ticks: self.ticks,
                recording: self.records.kept().map(|(path, _)| path),
                findings,
            }),
        }
    }

    fn handle(&mut self, request: &Request, worlds: Option<&mut Lockstep>, inbox: &Inbox) -> Handled {
        let answered = match request.method.as_str() {
            "initialize" => self.greet(&request.params),
            "ping" => Ok(json!({})),
            "tools/list" if self.is_greeted => self.list(&request.params),
            "tools/call" if self.is_greeted => return self.call(request, worlds, inbox),
            "tools/list" | "tools/call" => Err(RpcError::no_request("the first request is `initialize`")),
            other => {
                let known = ["initialize", "ping", "tools/list", "tools/call"];
                let near = question(nearest(other, &known));
                let words = format!("there is no method `{other}`{near} here: only {}", known.join(", "));
                Err(RpcError::no_method(words))
            }
        };
        Handled::Answered(answered)
    }

    fn greet(&mut self, params: &Map<String, Value>) -> Result<Value, RpcError> {
        let Some(wanted) = params.get("protocolVersion").and_then(Value::as_str) else {
            return Err(RpcError::bad_params("`initialize` names its `protocolVersion`, such as 2025-06-18"));
        };
        let client = params.get("clientInfo").and_then(|info| info.get("name")).and_then(Value::as_str);
        if let Some(client) = client.map(str::trim).filter(|client| !client.is_empty()) {
            // It becomes a part of file names and of heads.
            let plain: String = client.chars().filter(|letter| !letter.is_control()).take(60).collect();
            self.records.of_client(&plain);
            self.client = plain;
        }
        self.is_greeted = true;
        let (game, levels) = (self.settings.game, self.settings.levels.to_string());
        (self.server.report)(&format!("{} is connected, and plays {}", self.client, game.name()));
        Ok(json!({
            "protocolVersion": agreed(wanted),
            "capabilities": { "tools": { "listChanged": false } },
            "serverInfo": {
                "name": "playbot", "title": format!("playbot: {}", game.name()), "version": env!("CARGO_PKG_VERSION"),
            },
            "instructions": tools::instructions(game, &levels),
        }))
    }

    fn list(&self, params: &Map<String, Value>) -> Result<Value, RpcError> {
        if params.get("cursor").is_some_and(|cursor| !cursor.is_null()) {
            return Err(RpcError::bad_params("all tools are on the first page: leave `cursor` out"));
        }
        let draws = self.picture_form().is_some();
        Ok(json!({ "tools": tools::list(self.settings.game, &self.words, &self.server.bounds, draws) }))
    }

    fn call(&mut self, request: &Request, worlds: Option<&mut Lockstep>, inbox: &Inbox) -> Handled {
        let Some(name) = request.params.get("name").and_then(Value::as_str) else {
            return Handled::Answered(Err(RpcError::bad_params("`tools/call` has the `name` of a tool")));
        };
        let arguments = match request.params.get("arguments") {
            None | Some(Value::Null) => json!({}),
            Some(arguments) if arguments.is_object() => arguments.clone(),
            Some(other) => {
                let words = format!("the `arguments` of `{name}` are an object, and this is {other}");
                return Handled::Answered(Err(RpcError::bad_params(words)));
            }
        };
        let told = match name {
            "observe" => self.observe(arguments, worlds),
            "act" => self.act(arguments, worlds, &|| inbox.is_cancelled(&request.id)),
            "level" => self.level(arguments),
            "reset" => self.reset(arguments, worlds),
            "findings" => self.findings(arguments),
            "replay" => self.replay(arguments),
            other => Told::Wrong(RpcError::bad_params(UnknownName::new("tool", other, &NAMES).to_string())),
        };
        match told {
            Told::Shown(data, picture) => Handled::Answered(Ok(self.result(&data, picture))),
            Told::Refused(why) => Handled::Answered(Ok(refusal(&why))),
            Told::Wrong(error) => Handled::Answered(Err(error)),
            Told::NeedsWorlds => Handled::NeedsWorlds,
            Told::Broken(why) => Handled::Broken(refusal(&why)),
        }
    }

    /// Returns the result of a tool: data as text and as such, and a picture.
    fn result(&mut self, data: &Value, picture: Option<Vec<u8>>) -> Value {
        let mut content = vec![json!({ "type": "text", "text": data.to_string() })];
        let picture =
            picture.map(|png| json!({ "type": "image", "data": STANDARD.encode(png), "mimeType": "image/png" }));
        content.extend(picture);
        content.extend(self.problems.drain(..).map(|problem| json!({ "type": "text", "text": problem })));
        json!({ "content": content, "structuredContent": data, "isError": false })
    }

    // Looking.

    fn observe(&mut self, arguments: Value, worlds: Option<&mut Lockstep>) -> Told {
        let Observe { picture, names } = match read("observe", arguments) {
            Ok(read) => read,
            Err(error) => return Told::Wrong(error),
        };
        let shows = match self.shows(Some(true), &names) {
            Ok(shows) => shows,
            Err(why) => return Told::Refused(why),
        };
        let Some(worlds) = worlds.filter(|_| self.is_on_stage) else { return Told::Refused(self.no_episode()) };
        let state = self.state(None, shows);
        self.shown(state, picture, worlds)
    }

    /// Returns which of the observed values are shown: those that are named, or all, unless they are many.
    fn shows<'n>(&self, wanted: Option<bool>, names: &'n [String]) -> Result<Shows<'n>, String> {
        let observed = self.words.observed();
        if let Some(name) = names.iter().find(|name| !observed.iter().any(|known| known.starts_with(name.as_str()))) {
            let known: Vec<&str> = observed.iter().map(String::as_str).collect();
            let near = question(nearest(name, &known));
            return Err(format!("the name of no observed value begins with `{name}`{near}: `level` has all names"));
        }
        Ok(match wanted {
            Some(false) => Shows::None,
            _ if !names.is_empty() => Shows::Named(names),
            None if observed.len() > MOST_VALUES => Shows::None,
            _ => Shows::All,
        })
    }

    /// Returns data with a picture, if one is wanted.
    fn shown(&self, data: Map<String, Value>, picture: bool, worlds: &mut Lockstep) -> Told {
        let data = Value::Object(data);
        if !picture {
            return Told::Shown(data, None);
        }
        match self.picture(worlds) {
            Ok(png) => Told::Shown(data, Some(png)),
            Err(why) => Told::Refused(why),
        }
    }

    fn picture_form(&self) -> Option<ImageOptions> {
        let Settings { observation, picture, .. } = self.settings;
        if observation.is_image() { Some(observation.image) } else { *picture }
    }

    /// Returns the newest picture of the first agent.
    fn picture(&self, worlds: &mut Lockstep) -> Result<Vec<u8>, String> {
        let Some(image) = self.picture_form() else {
            let game = self.settings.game.name();
            return Err(format!("`{game}` cannot be drawn here: leave `picture` out, and read the observed values"));
        };
        let seen = |world: &mut World, agent| world.get::<Observation>(agent).map(|seen| seen.image.clone());
        let planes = worlds.begin_call(0, seen).and_then(Awaited::answer).map_err(|error| error.to_string())?;
        png(&image, &planes.unwrap_or_default()).map_err(|error| format!("the picture cannot be written: {error}"))
    }

    fn no_episode(&self) -> String {
        match self.episodes.last() {
            Some(PlayedEpisode { broken: Some(_), .. }) => {
                "the game has broken in the last episode: call `reset` to begin another one".to_owned()
            }
            _ => "no episode has begun: call `reset` to begin one".to_owned(),
        }
    }

    fn rows(&self) -> Rows {
        Rows::read(&self.memory, self.words.seats.len())
    }

    /// Returns the state of the game, with the rewards of a call.
    fn state(&self, rewards: Option<&[f64]>, shows: Shows<'_>) -> Map<String, Value> {
        let rows = self.rows();
        let episode = self.episodes.last();
        let agent = |(at, row): (usize, &RowNow)| {
            let mut agent = Map::new();
            let mut put = |name: &str, value: Value| agent.insert(name.to_owned(), value);
            if let Some(seat) = self.words.seats[at].name.as_ref() {
                put("seat", json!(seat));
            }
            let is_shown = |name: &str| match shows {
                Shows::None => false,
                Shows::All => true,
                Shows::Named(names) => names.iter().any(|begin| name.starts_with(begin.as_str())),
            };
            if !matches!(shows, Shows::None) {
                let (values, things) = self.words.observation(&row.values, &is_shown);
                put("values", Value::Object(values));
                if !things.is_empty() {
                    put("things", Value::Object(things));
                }
            }
            if row.end.is_none() {
                put("legal", json!(self.words.legal(at, &row.legal)));
            }
            let played = episode.and_then(|episode| episode.agents.get(at));
            put("reward", json!(rewards.map_or(0.0, |rewards| rewards[at])));
            put("return", json!(played.map_or(0.0, PlayedAgent::episode_return)));
            put("terminated", json!(matches!(row.end, Some(EpisodeEnd::Terminated { .. }))));
            put("truncated", json!(row.end == Some(EpisodeEnd::Truncated)));
            put("success", json!(row.success));
            Value::Object(agent)
        };
        let agents: Vec<Value> = rows.agents.iter().enumerate().map(agent).collect();
        let is_over = rows.agents.iter().all(|row| row.end.is_some());
        let state = json!({
            "game": self.settings.game.name(), "level": rows.level, "level_name": self.levels.name(rows.level),
            "episode": episode.map_or(0, |episode| episode.number), "tick": rows.tick, "over": is_over, "agents": agents,
            "ticks_left": self.server.bounds.ticks.saturating_sub(self.ticks),
        });
        match state {
            Value::Object(state) => state,
            _ => Map::new(),
        }
    }

    // Playing.

    /// Returns the bound that the session has reached, with what is saved. The running episode is then written.
    fn bound(&mut self) -> Option<String> {
        let bounds = self.server.bounds;
        let why = if self.ticks >= bounds.ticks {
            format!("the session has played its {} ticks (--max-steps)", bounds.ticks)
        } else if self.begun.elapsed() >= bounds.time {
            format!("the session has lasted its {} seconds (--max-seconds)", bounds.time.as_secs())
        } else {
            return None;
        };
        self.keep();
        let saved = self.records.kept().map_or_else(
            || "nothing was played, so nothing is saved".to_owned(),
            |(path, episodes)| match episodes {
                1 => format!("its episode is saved in {}", path.display()),
                _ => format!("its {episodes} episodes are saved in {}", path.display()),
            },
        );
        Some(format!("{why}; {saved}. `observe`, `level`, `findings` and `replay` still answer"))
    }

    fn act(&mut self, arguments: Value, worlds: Option<&mut Lockstep>, is_cancelled: &dyn Fn() -> bool) -> Told {
        let act: Act = match read("act", arguments) {
            Ok(act) => act,
            Err(error) => return Told::Wrong(error),
        };
        let most = self.server.bounds.ticks_per_call;
        if act.ticks == 0 || act.ticks > most {
            let words = format!("`ticks` is {}: a call plays 1 to {most} (--max-ticks-per-call)", act.ticks);
            return Told::Refused(words);
        }
        let shows = match self.shows(act.observation, &act.names) {
            Ok(shows) => shows,
            Err(why) => return Told::Refused(why),
        };
        if let Some(bound) = self.bound() {
            return Told::Refused(bound);
        }
        let Some(worlds) = worlds.filter(|_| self.is_on_stage) else { return Told::Refused(self.no_episode()) };
        if self.episodes.last().is_none_or(PlayedEpisode::is_over) {
            return Told::Refused("the episode is over: call `reset` to begin another one".to_owned());
        }
        let actions = match self.chosen(&act) {
            Ok(actions) => actions,
            Err(why) => return Told::Refused(why),
        };
        if let Some(why) = self.illegal(&actions) {
            return Told::Refused(why);
        }
        self.held.clone_from(&actions);
        let mut rewards = vec![0.0; actions.len()];
        let (mut played, mut stopped) = (0, None);
        while played < act.ticks {
            if let Err(why) = self.tick(worlds, &actions, &mut rewards) {
                return Told::Broken(self.crash(&why, actions));
            }
            played += 1;
            stopped = if self.episodes.last().is_none_or(PlayedEpisode::is_over) {
                self.keep();
                Some("the episode is over".to_owned())
            } else if played == act.ticks {
                None
            } else if let Some(bound) = self.bound() {
                Some(bound)
            } else if is_cancelled() {
                Some("the call was cancelled".to_owned())
            } else if (self.server.stops)() {
                Some("the program was stopped".to_owned())
            } else {
                self.illegal(&actions)
            };
            if stopped.is_some() {
                break;
            }
        }
        let mut state = self.state(Some(&rewards), shows);
        state.insert("ticks".to_owned(), json!(played));
        // All that were asked for are no stop.
        state.insert("stopped".to_owned(), json!(stopped.filter(|_| played < act.ticks)));
        self.shown(state, act.picture, worlds)
    }

    /// Returns the action of each seat.
    fn chosen(&self, act: &Act) -> Result<Vec<ActionValue>, String> {
        let names = self.words.seat_names();
        let usual = match act.others {
            Others::Idle => vec![self.words.idle.clone(); self.words.seats.len()],
            Others::Hold => self.held.clone(),
        };
        match (&act.action, act.actions.is_empty(), names.as_slice()) {
            (Some(action), true, []) => Ok(vec![self.words.read(0, action)?]),
            (None, true, []) => Err(format!("name an `action`: {}", self.words.describe_actions(0))),
            (_, _, []) => Err("this game has one agent: name one `action`, and leave `actions` out".to_owned()),
            (Some(_), ..) => {
                Err(format!("this game has several agents: name `actions` by seat, of {}", names.join(", ")))
            }
            (None, true, _) if act.others == Others::Idle => Err(format!(
                "name the `actions` of some seats, of {}, such as {{\"{}\": …}}",
                names.join(", "),
                names[0]
            )),
            (None, _, _) => {
                let mut actions = usual;
                for (name, action) in &act.actions {
                    let seat = names.iter().position(|known| known == name);
                    let seat = seat.ok_or_else(|| UnknownName::new("seat", name, &names).to_string())?;
                    actions[seat] = self.words.read(seat, action).map_err(|why| format!("`{name}`: {why}"))?;
                }
                Ok(actions)
            }
        }
    }

    /// Returns which action is not legal now, and which are.
    fn illegal(&self, actions: &[ActionValue]) -> Option<String> {
        let rows = self.rows();
        let each = rows.agents.iter().zip(actions).enumerate().filter(|(_, (row, _))| row.end.is_none());
        let mut illegal = each.filter(|(_, (row, action))| !self.words.is_legal(action, &row.legal));
        illegal.next().map(|(seat, (row, action))| {
            let name = self.words.seats[seat].name.as_ref().map_or_else(String::new, |name| format!("`{name}`: "));
            let legal = json!(self.words.legal(seat, &row.legal));
            format!("{name}the action {} is not legal now; legal: {legal}", self.words.write(seat, action))
        })
    }

    /// Plays a tick, and notes it.
    fn tick(&mut self, worlds: &mut Lockstep, actions: &[ActionValue], rewards: &mut [f64]) -> Result<(), String> {
        self.memory.take_actions(&action_bytes(self.memory.layout(), actions));
        let after = worlds.step().and_then(|_| after_tick(worlds)).map_err(|error| error.to_string())?;
        self.ticks += 1;
        let rows = self.rows();
        let Some(episode) = self.episodes.last_mut() else { return Ok(()) };
        for (at, ((agent, row), after)) in episode.agents.iter_mut().zip(&rows.agents).zip(after).enumerate() {
            if agent.end.is_some() {
                continue;
            }
            agent.actions.push(after.action.unwrap_or_else(|| actions[at].clone()));
            agent.rewards.push(row.reward);
            agent.states.push(after.state);
            (agent.end, agent.success) = (row.end, row.success);
            rewards[at] += short(row.reward);
        }
        Ok(())
    }

    /// Notes that the game has broken, and returns the answer.
    fn crash(&mut self, why: &str, actions: Vec<ActionValue>) -> String {
        self.is_on_stage = false;
        let why = reason(why).to_owned();
        let Some(episode) = self.episodes.last_mut() else { return why };
        let tick = episode.ticks();
        for (agent, action) in episode.agents.iter_mut().zip(actions).filter(|(agent, _)| agent.end.is_none()) {
            agent.actions.push(action);
        }
        episode.broken = Some(why.clone());
        let number = episode.number;
        self.keep();
        self.examine();
        let found = self.examined.get(&number).map(|(_, found)| found.as_slice()).unwrap_or_default();
        let files: Vec<String> = found.iter().map(described).collect();
        let stored = if files.is_empty() { "nothing else is known of it".to_owned() } else { files.join("; ") };
        format!(
            "the game has broken in tick {tick} of this episode: {why}. {stored}. Call `reset` to go on with another level"
        )
    }

    fn reset(&mut self, arguments: Value, worlds: Option<&mut Lockstep>) -> Told {
        let Begin { level, picture, names } = match read("reset", arguments) {
            Ok(read) => read,
            Err(error) => return Told::Wrong(error),
        };
        let shows = match self.shows(None, &names) {
            Ok(shows) => shows,
            Err(why) => return Told::Refused(why),
        };
        let level = match level.map(|name| self.levels.number_of(&name)).transpose() {
            Ok(level) => level.or_else(|| self.levels.after(self.episodes.last().map(|episode| episode.level))),
            Err(why) => return Told::Refused(why),
        };
        if let Some(bound) = self.bound() {
            return Told::Refused(bound);
        }
        let Some(worlds) = worlds else { return Told::NeedsWorlds };
        self.keep();
        let is_first = worlds.check_begun().is_err();
        // A World that is built anew would otherwise draw the levels of the one before, with that in which it broke.
        let seed = is_first.then(|| self.settings.seed.wrapping_add(self.built.saturating_sub(1)));
        let begun = worlds.reset(&Reset { arenas: None, levels: level.map(|level| vec![level]), seed });
        let begun = begun.and_then(|_| if is_first { keep_no_files(worlds) } else { Ok(()) });
        let agents = vec![PlayedAgent::default(); self.words.seats.len()];
        let mut episode = PlayedEpisode { number: self.episodes.len(), agents, ..PlayedEpisode::default() };
        (self.is_kept, self.is_on_stage) = (false, begun.is_ok());
        self.held.fill(self.words.idle.clone());
        match begun {
            Ok(()) => {
                episode.level = self.rows().level;
                episode.level_file = file_of(worlds, episode.level);
                self.episodes.push(episode);
                let state = self.state(None, shows);
                self.shown(state, picture, worlds)
            }
            Err(StepError::Refused(refusal)) => Told::Refused(refusal.error),
            Err(StepError::Failed(why)) => {
                episode.level = level.or_else(|| named_level(&why)).unwrap_or(self.settings.levels.first);
                self.episodes.push(episode);
                let idle = vec![self.words.idle.clone(); self.words.seats.len()];
                Told::Broken(self.crash(&why, idle))
            }
        }
    }

    /// Writes the latest episode, unless that is done.
    fn keep(&mut self) {
        if std::mem::replace(&mut self.is_kept, true) {
            return;
        }
        if let Some(episode) = self.episodes.last()
            && let Err(why) = self.records.keep(episode, &self.words)
        {
            self.problems.push(format!("episode {} is not recorded: {why}", episode.number));
        }
    }

    fn level(&self, arguments: Value) -> Told {
        let Level { level } = match read("level", arguments) {
            Ok(read) => read,
            Err(error) => return Told::Wrong(error),
        };
        let played = self.episodes.last().map(|episode| episode.level);
        let level = match level.map(|name| self.levels.number_of(&name)).transpose() {
            Ok(level) => level.or(played).unwrap_or(self.settings.levels.first),
            Err(why) => return Told::Refused(why),
        };
        let picture = self.picture_form().map(|image| [image.width, image.height]);
        let mut data = self.levels.describe(level, &self.words);
        data["played"] = json!(played);
        data["picture"] = json!(picture);
        Told::Shown(data, None)
    }

    fn replay(&mut self, arguments: Value) -> Told {
        let Replay { episode } = match read("replay", arguments) {
            Ok(read) => read,
            Err(error) => return Told::Wrong(error),
        };
        let Some(last) = self.episodes.len().checked_sub(1) else {
            return Told::Refused("nothing was played yet: call `reset` and `act` first".to_owned());
        };
        let number = episode.unwrap_or(last);
        let Some(episode) = self.episodes.get(number) else {
            return Told::Refused(format!("there is no episode {number}: they are numbered from 0 to {last}"));
        };
        match replay(self.settings, episode, &self.words, self.server.stops) {
            Ok(data) => Told::Shown(data, None),
            Err(why) => Told::Refused(why),
        }
    }
}

/// Reads the arguments of a tool.
fn read<T: DeserializeOwned>(tool: &str, arguments: Value) -> Result<T, RpcError> {
    serde_json::from_value(arguments)
        .map_err(|error| RpcError::bad_params(format!("the arguments of `{tool}`: {error}")))
}

/// Returns the result of a tool that could not do it.
fn refusal(why: &str) -> Value {
    json!({ "content": [{ "type": "text", "text": why }], "isError": true })
}

/// Describes a finding in a sentence.
fn described(found: &FoundInEpisode) -> String {
    match &found.file {
        Ok(file) => format!("the finding `{}` is stored in {}", found.detector, file.display()),
        Err(why) => format!("the finding `{}` is not stored: {why}", found.detector),
    }
}

/// Returns the level that a fault names, as `agent 0, level 3, tick 7: …`.
fn named_level(why: &str) -> Option<u64> {
    let (_, rest) = why.split_once("level ")?;
    rest.split(|letter: char| !letter.is_ascii_digit()).next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_names_its_level() {
        assert_eq!(named_level("agent 0, level 31, tick 7: it burns"), Some(31));
        assert_eq!(named_level("it burns at once"), None);
    }
}
