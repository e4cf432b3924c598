//! Panics of a game: turned into faults, with a file that replays to the panic.

mod origin;

use crate::{
    action::{Action, check_actions},
    agent::{Agent, AgentOrder, Control, PlaysAlong},
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
    demo::{
        file::{DemoEpisode, DemoHeader, DemoWriter},
        recorder::{decider, push_action},
    },
    episode::Episode,
    fault::Fault,
    level::{LevelFiles, RandomisedValues},
    panics::origin::panic_origin,
    placement::TickSchedules,
    reward::Reward,
    state_hash::StateHash,
    systems::PlaybotSystems,
};
use bevy::prelude::*;
use std::{
    cell::{Cell, RefCell},
    panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook},
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

/// Marks a World that cannot be ticked, with the reason. A panic may have left an inconsistent state behind.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Broken(String);

/// Makes each tick of a World a fault with this text. It is for Worlds whose game could not be added.
pub fn refuse(world: &mut World, why: String) {
    world.insert_resource(Broken(why));
}

/// Returns the fault of each tick of a World that was refused or has panicked.
pub fn refusal(world: &World) -> Option<Fault> {
    world.get_resource::<Broken>().map(|Broken(why)| Fault(why.clone()))
}

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
            trace.0 = Some(DemoEpisode::new(episode.level, agent.actions));
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
    /// Gets the message of the first panic at once.
    static REPORT: Cell<Option<fn(&str)>> = const { Cell::new(None) };
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
            let is_first = WORDS.with_borrow(String::is_empty);
            if is_first {
                let words = panic.payload_as_str().unwrap_or("no reason given");
                let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
                let place = place_of_panic(panic);
                let words = format!("{words}{place}");
                if let Some(report) = REPORT.get() {
                    report(&words);
                }
                WORDS.set(words);
            }
        }));
    });
}

/// Returns the file and the line of a panic, and its plugin or system if they are known, in parentheses after a space.
pub fn place_of_panic(panic: &PanicHookInfo<'_>) -> String {
    let line = panic.location().map(|place| without_registry(&place.to_string()).to_owned());
    let known: Vec<String> = line.into_iter().chain(panic_origin()).collect();
    if known.is_empty() { String::new() } else { format!(" ({})", known.join(", ")) }
}

/// Returns a path from the name of the package on, if it is in Cargo's registry.
fn without_registry(path: &str) -> &str {
    let package = path.split_once("/registry/src/").and_then(|(_, rest)| rest.split_once('/'));
    package.map_or(path, |(_, package)| package)
}

/// Runs a World. A panic in it becomes a fault if it has [`PanicReports`].
pub(crate) fn guard(world: &mut World, work: impl FnOnce(&mut World) -> Result<(), Fault>) -> Result<(), Fault> {
    if let Some(fault) = refusal(world) {
        return Err(fault);
    }
    if !world.contains_resource::<PanicReports>() {
        return work(world);
    }
    hear(|| work(world)).unwrap_or_else(|words| {
        refuse(world, "the game has panicked before, and its World cannot go on".to_owned());
        Err(Fault(report(world, &words)))
    })
}

/// Runs work that may panic. Returns the message of a panic instead of printing it, with its file, its line and its
/// plugin or system. After a panic the work may leave inconsistent state behind.
pub fn hear<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    hear_panics();
    let outer = GUARDED.replace(true);
    if !outer {
        // The work before may have caught a panic of its own.
        WORDS.take();
    }
    let result = catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(outer);
    result.map_err(|_| WORDS.take())
}

/// Runs work, and passes the message of a captured panic in it on at once. Bevy prints the name of a system that has
/// panicked while the panic leaves the schedule, which is later.
pub fn report_at_once<T>(report: fn(&str), work: impl FnOnce() -> T) -> T {
    let outer = REPORT.replace(Some(report));
    let done = work();
    REPORT.set(outer);
    done
}

/// Returns whether the message of a panic says that Bevy's `RenderApp` does not exist.
pub fn lacks_render_app(words: &str) -> bool {
    words.contains("No sub-app with label 'RenderApp'")
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
        // What plays along is no part of recordings: the game lets it act again.
        let is_beside = world.get::<PlaysAlong>(entity).is_some();
        if is_beside || !control.is_active() || !(episode.is_running() || episode.is_loading()) {
            continue;
        }
        at.push(episode.moment(agent));
        let trace = world.get::<EpisodeTrace>(entity).and_then(|trace| trace.0.clone());
        let mut kept = whole(trace.filter(|_| episode.is_running()), agent, episode);
        kept.level_file = world.get_resource::<LevelFiles>().and_then(|files| files.of(episode.level)).cloned();
        kept.randomised = world.get::<RandomisedValues>(entity).map(|drawn| drawn.0.clone()).unwrap_or_default();
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
    let mut trace = trace.unwrap_or_else(|| DemoEpisode::new(episode.level, agent.actions));
    if trace.deciders.is_empty() {
        push_action(&mut trace.actions, &agent.actions.first());
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
    let header = DemoHeader { note, ..reports.header.clone() };
    let draws = episodes.iter().any(|episode| !episode.randomised.is_empty());
    let header = if draws { header.with_randomised_values() } else { header };
    let mut writer = DemoWriter::replace(&path, header)?;
    episodes.iter().try_for_each(|episode| writer.push(episode))?;
    Ok(Some(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        episode::begin_beside,
        headless::{PlaybotAppExt, headless_app},
        level::LevelQueue,
    };
    use playbot_learner::ActionSpace;

    #[test]
    fn a_path_in_the_registry_begins_with_its_package() {
        let path = "/home/x/.cargo/registry/src/index.crates.io-1949cf8c6b5b557f/bevy_app-0.19.1/src/app.rs:1235:13";
        assert_eq!(without_registry(path), "bevy_app-0.19.1/src/app.rs:1235:13");
        assert_eq!(without_registry("src/game.rs:3:9"), "src/game.rs:3:9");
    }

    #[test]
    fn a_panic_is_reported_at_once_and_only_where_it_is_asked_for() {
        thread_local!(static REPORTED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) });
        fn open() {
            panic!("the door\n is locked");
        }
        let heard =
            report_at_once(|words| REPORTED.with_borrow_mut(|reported| reported.push(words.to_owned())), || hear(open));
        let reported = REPORTED.take();
        assert!(reported.len() == 1 && reported[0].starts_with("the door is locked ("), "{reported:?}");
        assert_eq!(heard, Err(reported[0].clone()));
        assert!(hear(open).is_err());
        assert!(REPORTED.take().is_empty());
    }

    #[test]
    fn only_a_missing_render_app_is_taken_for_one() {
        assert!(lacks_render_app("No sub-app with label 'RenderApp' exists. (bevy_app-0.19.1/src/app.rs:1235:13)"));
        assert!(!lacks_render_app("No sub-app with label 'Physics' exists."));
        assert!(!lacks_render_app("the RenderApp burns"));
    }

    #[test]
    fn the_report_of_a_panic_leaves_out_what_plays_along() {
        let (mut app, space) = (headless_app(), ActionSpace::Discrete(2));
        app.world_mut().spawn((Agent::new(0, space), Control::Human, LevelQueue::Always(7)));
        let beside = app.world_mut().spawn((Agent::new(1, space), PlaysAlong)).id();
        app.tick().expect("no agent broke its contract");
        begin_beside(app.world_mut(), beside, 7);
        app.tick().expect("no agent broke its contract");
        let said = report(app.world_mut(), "it burns");
        assert!(said.starts_with("agent 0, level 7, tick 2: the game panicked: it burns"), "{said}");
    }

    #[test]
    fn a_refused_world_says_why_in_each_tick_and_runs_nothing() {
        let mut world = World::new();
        refuse(&mut world, "the game `x` has no floor".to_owned());
        for _ in 0..2 {
            let ticked = guard(&mut world, |_| panic!("it runs"));
            assert_eq!(ticked, Err(Fault("the game `x` has no floor".to_owned())));
        }
    }

    #[test]
    fn a_panic_that_the_work_caught_itself_is_not_taken_for_a_later_one() {
        let caught = hear(|| catch_unwind(|| panic!("caught")).is_err());
        assert_eq!(caught, Ok(true));
        let words = hear(|| panic!("not\n  caught")).expect_err("it panics");
        assert!(words.starts_with("not caught (") && words.contains("panics.rs:"), "{words}");
    }
}
