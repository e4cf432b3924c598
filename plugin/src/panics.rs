//! Panics of a game: turned into faults, with a file that replays to the panic.

use crate::{
    action::{Action, check_actions},
    agent::{Agent, AgentOrder, Control},
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
    demo::{
        file::{DemoEpisode, DemoHeader, DemoWriter},
        recorder::{decider, demo_actions, push_action},
    },
    episode::Episode,
    fault::Fault,
    level::LevelFiles,
    placement::TickSchedules,
    reward::Reward,
    state_hash::StateHash,
    systems::PlaybotSystems,
};
use bevy::prelude::*;
use std::{
    cell::{Cell, RefCell},
    panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook},
    path::PathBuf,
    sync::Once,
};

/// Turns panics of the game into a [`Fault`] that [`tick_world`](crate::headless::tick_world) returns. The running
/// episodes of all agents are kept in a file that replays to the panic.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, CarryResource, Clone, Debug)]
pub struct PanicReports {
    header: DemoHeader,
    /// The folder, or `None` if no file is written.
    folder: Option<PathBuf>,
}

/// The actions and outcomes of an agent's running episode, kept for the report of a panic.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug)]
pub struct EpisodeTrace(Option<DemoEpisode>);

/// Marks a World that has panicked: its state may be inconsistent.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Broken;

impl PanicReports {
    /// Reports for recordings with this header, written below `folder`.
    pub fn new(header: DemoHeader, folder: impl Into<PathBuf>) -> Self {
        Self { header, folder: Some(folder.into()) }
    }

    /// Adds the reports to an app that has the [`PlaybotPlugin`](crate::plugin::PlaybotPlugin). Agents need an
    /// [`EpisodeTrace`].
    pub fn add_to(self, app: &mut App) {
        let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
        app.insert_resource(self)
            .add_systems(decide, note_actions.in_set(PlaybotSystems::Act).after(check_actions))
            .add_systems(judge, note_outcomes.in_set(PlaybotSystems::Record));
    }

    /// Writes to another folder from now on.
    pub fn move_to(&mut self, folder: impl Into<PathBuf>) {
        self.folder = Some(folder.into());
    }

    /// Writes no files from now on, for callers that can play the episodes again anyway.
    pub fn keep_no_files(&mut self) {
        self.folder = None;
    }
}

/// Keeps the action of this tick. Systems that hand it on to the game run after this, because they
/// may panic.
pub fn note_actions(mut agents: Query<(&Agent, &Control, &Episode, &Action, &mut EpisodeTrace)>) {
    for (agent, control, episode, action, mut trace) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if episode.tick == 0 {
            trace.0 = Some(DemoEpisode::new(episode.level, demo_actions(&agent.actions)));
        }
        if let Some(trace) = &mut trace.0 {
            push_action(&mut trace.actions, &action.0);
            trace.deciders.push(decider(*control));
        }
    }
}

fn note_outcomes(mut agents: Query<(&Control, &Episode, &Reward, &StateHash, &mut EpisodeTrace)>) {
    for (control, episode, reward, hash, mut trace) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if let Some(trace) = &mut trace.0 {
            trace.rewards.push(reward.get());
            trace.state_hashes.push(hash.folded());
        }
    }
}

thread_local! {
    /// True if this thread runs a World with reported panics.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
    static WORDS: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Captures panics of guarded Worlds instead of printing them.
fn hear_panics() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let default_hook = take_hook();
        set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                return default_hook(panic);
            }
            let words = panic.payload_as_str().unwrap_or("no reason given");
            let place = panic.location().map_or_else(String::new, |place| format!(" ({place})"));
            WORDS.with_borrow_mut(|first| {
                if first.is_empty() {
                    *first = format!("{}{place}", words.split_whitespace().collect::<Vec<_>>().join(" "));
                }
            });
        }));
    });
}

/// Runs a World. A panic in it becomes a fault if it has [`PanicReports`].
pub(crate) fn guard(world: &mut World, work: impl FnOnce(&mut World) -> Result<(), Fault>) -> Result<(), Fault> {
    if !world.contains_resource::<PanicReports>() {
        return work(world);
    }
    if world.contains_resource::<Broken>() {
        return Err(Fault("the game has panicked before, and its World cannot go on".to_owned()));
    }
    hear(|| work(world)).unwrap_or_else(|words| {
        world.insert_resource(Broken);
        Err(Fault(report(world, &words)))
    })
}

/// Runs work that may panic. Returns the message of a panic instead of printing it. After a panic
/// the work may leave inconsistent state behind.
pub fn hear<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    hear_panics();
    let outer = GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(outer);
    result.map_err(|_| WORDS.take())
}

/// Returns a report of where the game has panicked, and writes the recording that leads there.
fn report(world: &mut World, words: &str) -> String {
    let agents = world.get_resource::<AgentOrder>().map_or_else(Vec::new, |order| order.entities().to_vec());
    let mut episodes = Vec::new();
    let mut at = Vec::new();
    for &entity in &agents {
        let (Some(agent), Some(episode), Some(control)) =
            (world.get::<Agent>(entity), world.get::<Episode>(entity), world.get::<Control>(entity))
        else {
            continue;
        };
        if !control.is_active() || !(episode.is_running() || episode.is_loading()) {
            continue;
        }
        at.push(episode.moment(agent));
        let trace = world.get::<EpisodeTrace>(entity).and_then(|trace| trace.0.clone());
        let mut kept = whole(trace.filter(|_| episode.is_running()), agent, episode);
        kept.level_file = world.get_resource::<LevelFiles>().and_then(|files| files.of(episode.level)).cloned();
        episodes.push(kept);
    }
    let place = if at.is_empty() { "before any level was played".to_owned() } else { at.join("; ") };
    let kept = match keep(world, &at, &episodes) {
        Ok(Some(path)) => format!("; the actions so far are in {}, which replays to it", path.display()),
        Ok(None) => String::new(),
        Err(error) => format!("; the actions so far could not be kept: {error}"),
    };
    format!("{place}: the game panicked: {words}{kept}")
}

/// Returns a trace with lists of equal length: the tick that panicked has no outcome yet. A trace
/// without any tick gets its first.
fn whole(trace: Option<DemoEpisode>, agent: &Agent, episode: &Episode) -> DemoEpisode {
    use playbot_learner::{ActionSpace, ActionValue};
    let mut trace = trace.unwrap_or_else(|| DemoEpisode::new(episode.level, demo_actions(&agent.actions)));
    if trace.deciders.is_empty() {
        let nothing = match agent.actions {
            ActionSpace::Discrete(_) => ActionValue::Discrete(0),
            ActionSpace::Continuous(n) => ActionValue::Continuous(vec![0.0; n]),
        };
        push_action(&mut trace.actions, &nothing);
        trace.deciders.push(decider(Control::Idle));
    }
    trace.rewards.resize(trace.deciders.len(), 0.0);
    trace.state_hashes.resize(trace.deciders.len(), 0);
    trace
}

fn keep(
    world: &World,
    at: &[String],
    episodes: &[DemoEpisode],
) -> Result<Option<PathBuf>, crate::demo::file::DemoFileError> {
    let (Some(reports), Some(first)) = (world.get_resource::<PanicReports>(), at.first()) else { return Ok(None) };
    let Some(folder) = &reports.folder else { return Ok(None) };
    let place = first.replace(", ", "-").replace(' ', "");
    // The folder may be shared, and two programs may panic at the same position.
    let name = format!("panic-{}-{place}-{}.demo", reports.header.game, std::process::id());
    let path = folder.join(name);
    let note = "kept when the game panicked in its last tick".to_owned();
    let mut writer = DemoWriter::replace(&path, DemoHeader { note, ..reports.header.clone() })?;
    episodes.iter().try_for_each(|episode| writer.push(episode))?;
    Ok(Some(path))
}
