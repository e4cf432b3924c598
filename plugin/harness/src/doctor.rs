//! The examination of a game: does it play the same for the same actions? If not, it names the first difference, its
//! tick, and advice.
//!
//! Recording, replay, resume and training in many arenas need games that are a function of their level and their
//! actions. [`examine`] plays copies of a game with the same random actions and compares them after every tick, by
//! reflection: see [`DoctorComparison`] for the pairs. One level is examined in full. Further levels are played twice, and
//! each level is played after another one, to find state that a level leaves to the next. No finding in some ticks of
//! some levels is no proof: more ticks and other levels show more.
//!
//! A difference in state is a finding if agents notice it before the episode ends: in observations, rewards, ends of
//! episodes or the state hash. Otherwise it is a note. Components and resources that are `Reflect` and have
//! `#[reflect(Component)]` or `#[reflect(Resource)]` are compared field by field. The rest shows only in observations,
//! rewards and ends of episodes.
//!
//! The files of the folder, in reading order:
//!
//! - `trial`: one comparison, tick by tick.
//! - `game_copy`: a running copy of the game, with its entities and types.
//! - `compare`, `field`: the comparison of two copies, down to the first field that differs.
//! - `cause`, `observed`: causes of a difference, observations of the agents, and the uses that the game is safe for.
//! - `steps`: frames and fixed steps of different lengths.
//! - `text`: the report for people.

mod cause;
mod compare;
mod field;
mod game_copy;
mod observed;
mod steps;
mod text;
mod trial;

use crate::{
    doctor::{
        cause::causes,
        game_copy::{KnownTypes, Plan, bare_world},
        observed::{ObservationMonitor, assess_safety},
        trial::{LeftOut, Trial},
    },
    foreign::LeftMessages,
    game::{Game, without_idle_action},
    mode::ModeError,
    split::check_level,
};
use serde::Serialize;
use std::collections::BTreeSet;

pub use crate::doctor::{
    cause::{Cause, CauseKind},
    game_copy::TypesReport,
    observed::{ConstantValue, FullSet, NonFiniteValue, ObservationReport, Safety, Verdict},
    steps::UnequalSteps,
};

/// Plays copies of a game with the same random actions, compares them after every tick, and reports the differences.
/// `progress` receives the next comparison, in words.
///
/// # Errors
///
/// The game has no such mode. Every other problem of the game is in the report.
pub fn examine(
    game: &dyn Game,
    options: &DoctorOptions,
    mut progress: impl FnMut(&str),
) -> Result<DoctorReport, ModeError> {
    game.check_mode(&options.mode)?;
    let mut known_types = KnownTypes::new(&bare_world(), options.default_ignores);
    let mut comparisons: Vec<ComparisonReport> = Vec::new();
    let (mut observations, mut types) = (Vec::new(), TypesReport::default());
    let (mut suspicions, mut unequal_steps, mut holds_keys) = (Vec::new(), None, false);
    let mut left = LeftMessages::default();
    for planned in options.planned() {
        if let Some(why) = reason_to_skip(planned.comparison, game, &comparisons) {
            comparisons.push(ComparisonReport { skipped: Some(why), ..planned });
            continue;
        }
        progress(&planned.describe(options.level));
        let plan = Plan { mode: &options.mode, level: planned.level, before: planned.before, seed: options.seed };
        let is_first = comparisons.is_empty();
        let mut trial = Trial::new(planned, game, &plan, options.ticks);
        let monitored = if is_first { trial.copies[0].agents.len() } else { 0 };
        let monitor = |_| ObservationMonitor::new(trial.copies[0].observed_names());
        let mut monitors: Vec<ObservationMonitor> = (0..monitored).map(monitor).collect();
        let noted = comparisons.iter().filter(|of| of.comparison == DoctorComparison::Repeat && of.is_note());
        let noted = noted.flat_map(ComparisonReport::names).map(str::to_owned).collect();
        let left_out = LeftOut { ignored: &options.ignored, noted };
        let result = trial.run(options.ticks, &mut known_types, &left_out, &mut monitors);
        trial.copies.iter().filter_map(|copy| copy.world.get_resource()).for_each(|more| left.add(more));
        if is_first {
            observations = monitors.into_iter().map(ObservationMonitor::report).collect();
            types = known_types.report(&trial.copies[0], &result.incomparable);
            suspicions = known_types.suspicions(&trial.copies[0]);
            unequal_steps = UnequalSteps::of(&trial.copies[0].world);
            holds_keys = trial.copies[0].holds_keys();
        }
        comparisons.push(result.report);
    }
    left.retain(|message| !is_of_library(message) && !options.ignored.iter().any(|part| message.contains(part)));
    let of_messages = left.unread.union(&left.recent).map(|message| (CauseKind::SurvivesRestart, hint_of(message)));
    suspicions.extend(of_messages);
    let mut observations = observations.into_iter();
    let observation: ObservationReport = observations.next().unwrap_or_default();
    let other_observations: Vec<ObservationReport> = observations.collect();
    let (findings, notes) = findings(options.level, &comparisons, (&observation, &other_observations), &suspicions);
    Ok(DoctorReport {
        game: game.name().to_owned(),
        version: game.version(),
        mode: options.mode.clone(),
        level: options.level,
        further_levels: options.levels().split_off(1),
        another_level: options.another_level(game),
        seed: options.seed,
        ticks: options.ticks,
        safety: assess_safety(options.level, &comparisons, &observation),
        findings,
        notes,
        comparisons,
        observation,
        other_observations,
        without_idle: without_idle_action(game),
        types,
        left_messages: left.unread.into_iter().collect(),
        unequal_steps,
        holds_keys,
        ticks_per_second: None,
    })
}

/// The settings of an examination.
#[derive(Clone, Debug)]
pub struct DoctorOptions {
    /// Mode of the game.
    pub mode: String,
    /// Ticks that each comparison plays.
    pub ticks: u32,
    /// The level that is examined in full.
    pub level: u64,
    /// Further levels. Each is played twice, and after the level before it; the first one is played after the last.
    pub further_levels: Vec<u64>,
    /// Random seed of the World and of the actions.
    pub seed: u64,
    /// Components and resources whose path contains one of these are ignored, such as a high score that should last.
    pub ignored: Vec<String>,
    /// True if diagnostics, counters and clocks of known engines are left out, such as avian's. The report names them.
    pub default_ignores: bool,
}

impl DoctorOptions {
    /// Creates options for 300 ticks of level 0 of a mode.
    pub fn new(mode: impl Into<String>) -> Self {
        Self {
            mode: mode.into(),
            ticks: 300,
            level: 0,
            further_levels: Vec::new(),
            seed: 0,
            ignored: Vec::new(),
            default_ignores: true,
        }
    }

    /// Returns all levels, each once.
    fn levels(&self) -> Vec<u64> {
        let mut levels = vec![self.level];
        for level in &self.further_levels {
            if !levels.contains(level) {
                levels.push(*level);
            }
        }
        levels
    }

    /// Returns the level after those that are played, or else the first one that is not played; `None` if all are.
    fn another_level(&self, game: &dyn Game) -> Option<u64> {
        let levels = self.levels();
        let next = levels.iter().max().and_then(|last| last.checked_add(1));
        // One of so many is not among the levels.
        let all = next.into_iter().chain(0..=levels.len() as u64);
        all.filter(|level| !levels.contains(level)).find(|level| check_level(game, &self.mode, *level).is_ok())
    }

    /// Returns the comparisons to make, in order. Further levels get the two that find most, so that each of them takes
    /// a fourth of the time of the first one.
    fn planned(&self) -> Vec<ComparisonReport> {
        let of_first = |comparison| ComparisonReport::new(comparison, self.level, None);
        let mut planned: Vec<_> = DoctorComparison::OF_ONE_LEVEL.map(of_first).into();
        let levels = self.levels();
        let earlier = levels.iter().cycle().skip(levels.len() - 1);
        for (place, (&level, &before)) in levels.iter().zip(earlier).enumerate().filter(|_| levels.len() > 1) {
            if place > 0 {
                planned.push(ComparisonReport::new(DoctorComparison::Repeat, level, None));
            }
            planned.push(ComparisonReport::new(DoctorComparison::OtherLevel, level, Some(before)));
        }
        planned
    }
}

/// The result of an examination.
#[derive(Clone, Debug, Serialize)]
pub struct DoctorReport {
    /// Name of the game.
    pub game: String,
    /// Version of its rules.
    pub version: u32,
    /// Its mode.
    pub mode: String,
    /// The level that was examined in full.
    pub level: u64,
    /// Further levels, which were played twice and after another level.
    pub further_levels: Vec<u64>,
    /// A level that was not played, if the game has any.
    #[serde(skip)]
    pub another_level: Option<u64>,
    /// Random seed of the World and of the actions.
    pub seed: u64,
    /// Ticks that each comparison was to play.
    pub ticks: u32,
    /// The comparisons.
    pub comparisons: Vec<ComparisonReport>,
    /// The observations of the first agent.
    pub observation: ObservationReport,
    /// Those of the agents that share its arena.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_observations: Vec<ObservationReport>,
    /// What is wrong and what to add if no action holds nothing, so that a person who holds no key plays action 0.
    pub without_idle: Option<String>,
    /// The types that could be compared.
    pub types: TypesReport,
    /// Types of messages of a foreign game that are written while a restart takes an episode down, so that its systems
    /// read them in the next one. This is a note. Messages of libraries are left out: they may be work still to be done.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_messages: Vec<String>,
    /// Lengths of frames and of fixed steps, if they differ and the game may notice it.
    pub unequal_steps: Option<UnequalSteps>,
    /// True if actions hold keys or buttons. Reflection cannot show whether the game reads `pressed` or `just_pressed`.
    pub holds_keys: bool,
    /// The uses that the game is safe for.
    pub safety: Safety,
    /// The findings, worst first.
    pub findings: Vec<DoctorFinding>,
    /// State that differs, and that no agent noticed to the end of the episodes: each type once.
    pub notes: Vec<DoctorFinding>,
    /// Ticks per second of one arena, if they were measured: the examination itself reads no clock.
    pub ticks_per_second: Option<f64>,
}

impl DoctorReport {
    /// Returns whether there is no finding. Notes are none.
    pub fn is_healthy(&self) -> bool {
        self.findings.is_empty()
    }

    /// Returns the report of a comparison, on the first level that it was made on.
    pub fn of(&self, comparison: DoctorComparison) -> Option<&ComparisonReport> {
        self.comparisons.iter().find(|report| report.comparison == comparison)
    }
}

/// The result of one comparison.
#[derive(Clone, Debug, Serialize)]
pub struct ComparisonReport {
    /// The comparison.
    pub comparison: DoctorComparison,
    /// The level.
    pub level: u64,
    /// The other level that one copy has played before, in [`DoctorComparison::OtherLevel`].
    pub before: Option<u64>,
    /// The reason that it was skipped, if it was.
    pub skipped: Option<String>,
    /// Ticks compared. If state differs and no agent has noticed it, an episode is played on to its end.
    pub ticks: u32,
    /// Episodes that started in these ticks, in the copy on the left; the last one may be unfinished.
    pub episodes: u32,
    /// The first difference, the one nearest to its cause if a tick has several.
    pub first: Option<DoctorDifference>,
    /// Further fields that differ, until agents notice it. Earlier ticks come first, and in a tick likelier causes:
    /// clocks, randomness, the order of entities and systems, then state that is left over.
    pub others: Vec<DoctorDifference>,
    /// The first difference in observations, rewards or ends of episodes, if there is one.
    pub effect: Option<DoctorDifference>,
    /// Entities without a match in the other copy.
    pub unmatched: usize,
    /// The fault or panic of the game that ended the comparison early.
    pub fault: Option<String>,
}

impl ComparisonReport {
    /// Makes the report of a comparison that has not begun.
    pub(crate) fn new(comparison: DoctorComparison, level: u64, before: Option<u64>) -> Self {
        Self {
            comparison,
            level,
            before,
            skipped: None,
            ticks: 0,
            episodes: 0,
            first: None,
            others: Vec::new(),
            effect: None,
            unmatched: 0,
            fault: None,
        }
    }

    /// Returns whether agents played the same game to the end; `None` if it was not compared.
    pub fn same(&self) -> Option<bool> {
        self.skipped.is_none().then(|| self.effect.is_none() && self.fault.is_none())
    }

    /// Returns whether state differs, and no agent noticed it.
    pub fn is_note(&self) -> bool {
        self.first.is_some() && self.same() == Some(true)
    }

    /// Returns the comparison in words. They name the level, unless it is the `first` one by itself.
    pub(crate) fn describe(&self, first: u64) -> String {
        match self.before {
            Some(before) => format!("level {} after level {before}", self.level),
            None if self.level == first => self.comparison.describe().to_owned(),
            None => format!("level {}, {}", self.level, self.comparison.describe()),
        }
    }

    /// Returns the types that differ, and kinds of entities.
    fn names(&self) -> impl Iterator<Item = &str> {
        self.first.iter().chain(&self.others).map(|difference| difference.name.as_str())
    }

    /// Returns the first difference of any kind.
    pub fn difference(&self) -> Option<&DoctorDifference> {
        self.first.as_ref().or(self.effect.as_ref())
    }
}

/// The copies of the game that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DoctorComparison {
    /// Two Worlds on one thread, one after the other in every tick.
    Repeat,
    /// Two Worlds. In one of them Bevy's `Time<Real>` runs slower, as on a slow machine.
    Clock,
    /// A default World, and some with more archetypes, as a recorder, a window or another plugin adds them. A
    /// difference counts only if agents notice it: another order alone does no harm.
    Archetypes,
    /// A World on this thread, and two that are ticked at the same time on two threads.
    Threads,
    /// Two arenas in one World, and each of them alone in a World.
    Arenas,
    /// The first episode of a World, and the second episode of the same level in another one.
    Restart,
    /// A World that plays on, and one that returns to the same tick by a snapshot of the game, as explorers do.
    Snapshots,
    /// The first episode of a World, and an episode of the same level in a World that has played another level before.
    OtherLevel,
}

impl DoctorComparison {
    /// The comparisons that need no other level, in the order in which they are made.
    pub const OF_ONE_LEVEL: [Self; 7] =
        [Self::Repeat, Self::Archetypes, Self::Clock, Self::Threads, Self::Arenas, Self::Restart, Self::Snapshots];

    /// Returns the comparison in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Repeat => "twice in one thread",
            Self::Clock => "with another wall clock",
            Self::Archetypes => "with more archetypes",
            Self::Threads => "on two threads",
            Self::Arenas => "two arenas in one World",
            Self::Restart => "again after a restart",
            Self::Snapshots => "after loading a snapshot",
            Self::OtherLevel => "after another level",
        }
    }

    /// Returns whether the copy on the right has played something else before the ticks that are compared.
    pub(crate) fn returns(self) -> bool {
        matches!(self, Self::Restart | Self::Snapshots | Self::OtherLevel)
    }

    /// Returns the names of the left and the right copy.
    pub fn sides(self) -> (&'static str, &'static str) {
        match self {
            Self::Repeat => ("first copy", "second copy"),
            Self::Clock => ("normal clock", "slower clock"),
            Self::Archetypes => ("default World", "more archetypes"),
            Self::Threads => ("one thread", "two threads"),
            Self::Arenas => ("alone", "with another arena"),
            Self::Restart => ("first episode", "second episode"),
            Self::Snapshots => ("played on", "snapshot loaded"),
            Self::OtherLevel => ("first level", "after another level"),
        }
    }
}

/// A difference between two copies of the game.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DoctorDifference {
    /// The tick of the comparison, from 0.
    pub tick: u32,
    /// The kind of value.
    pub kind: DifferenceKind,
    /// Path of the component's or resource's type; the name of other values, such as `reward`.
    pub name: String,
    /// The entity: its name, or how the two were matched.
    pub entity: Option<String>,
    /// The field, such as `.position.x`; empty if the whole differs.
    pub field: String,
    /// The value in the left copy, see [`DoctorComparison::sides`].
    pub left: String,
    /// The value in the right copy.
    pub right: String,
    /// Path of the type of both values; empty for values without one, such as a length.
    pub value_type: String,
}

/// The kind of value that differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DifferenceKind {
    /// A resource.
    Resource,
    /// A component of an entity.
    Component,
    /// The number of entities of a kind.
    Entities,
    /// A value that the agent observes.
    Observation,
    /// The agent's reward.
    Reward,
    /// The end of the agent's episode, if it ends.
    End,
    /// The game's own hash of its state.
    StateHash,
}

/// A finding.
#[derive(Clone, Debug, Serialize)]
pub struct DoctorFinding {
    /// The kind.
    pub kind: FindingKind,
    /// The message, in a sentence.
    pub what: String,
    /// The comparison that showed it.
    pub comparison: Option<DoctorComparison>,
    /// The level of the comparison.
    pub level: Option<u64>,
    /// The first difference.
    pub difference: Option<DoctorDifference>,
    /// Causes that fit, likeliest first.
    pub causes: Vec<Cause>,
}

/// The kind of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Two copies did not play the same game.
    Differs,
    /// State differs, and no agent noticed it: a note.
    Unnoticed,
    /// The game broke its contract, or panicked.
    Fault,
    /// An observed value was not a finite number.
    NotFinite,
    /// The number of observed values changed.
    LengthChanges,
    /// No observed value ever changed.
    Blind,
}

/// A game that differs from itself differs in every comparison, and no comparison could name a cause.
fn reason_to_skip(comparison: DoctorComparison, game: &dyn Game, done: &[ComparisonReport]) -> Option<String> {
    if comparison == DoctorComparison::Arenas && game.tools().host.arenas_per_world() == Some(1) {
        return Some("a World of this game holds only one arena (its `arenas_per_world` is 1)".to_owned());
    }
    if comparison == DoctorComparison::Snapshots && game.built_anew().is_some() {
        return Some("a game that is built anew for each episode is explored by replays".to_owned());
    }
    let differing = |wanted| done.iter().find(|of| of.comparison == wanted && of.same() == Some(false));
    if comparison == DoctorComparison::OtherLevel && differing(DoctorComparison::Restart).is_some() {
        return Some("the game already differs after a restart of one level, which must be repaired first".to_owned());
    }
    let broken = differing(DoctorComparison::Repeat)?;
    Some(match broken.fault.is_some() {
        true => "the game has a fault, which must be repaired first".to_owned(),
        false => "the game already differs from itself without this, which must be repaired first".to_owned(),
    })
}

// Findings of an examination.

/// Returns all findings, worst first, and all notes.
fn findings(
    first_level: u64,
    comparisons: &[ComparisonReport],
    (observation, others): (&ObservationReport, &[ObservationReport]),
    suspicions: &[(CauseKind, String)],
) -> (Vec<DoctorFinding>, Vec<DoctorFinding>) {
    let has_fault = comparisons.iter().any(|report| report.fault.is_some());
    let (mut findings, mut notes) = (of_observation(observation), Vec::new());
    for (number, seen) in (1..).zip(others) {
        let named = |of: DoctorFinding| DoctorFinding { what: format!("agent {number}: {}", of.what), ..of };
        findings.extend(of_observation(seen).into_iter().map(named));
    }
    // A game that stops early has not shown all that it does.
    findings.retain(|finding| finding.kind != FindingKind::Blind || !has_fault);
    let clock = comparisons.iter().filter(|of| of.comparison == DoctorComparison::Clock);
    let of_clock: BTreeSet<&str> = clock.flat_map(ComparisonReport::names).collect();
    let mut noted: BTreeSet<&str> = BTreeSet::new();
    let is_of_observation = !findings.is_empty();
    for report in comparisons {
        let differs = |kind, difference: &DoctorDifference| {
            let follows_clock =
                report.comparison != DoctorComparison::Clock && of_clock.contains(difference.name.as_str());
            DoctorFinding {
                kind,
                what: sentence(&report.describe(first_level), difference),
                comparison: Some(report.comparison),
                level: Some(report.level),
                difference: Some(difference.clone()),
                causes: causes(report.comparison, Some(difference), suspicions, follows_clock),
            }
        };
        if report.is_note() {
            let all = report.first.iter().chain(&report.others);
            let new: Vec<_> = all.filter(|difference| noted.insert(difference.name.as_str())).collect();
            notes.extend(new.into_iter().map(|difference| differs(FindingKind::Unnoticed, difference)));
        } else if let Some(difference) = report.difference() {
            // What one level leaves to the next shows after each level.
            let is_known = |finding: &DoctorFinding| {
                let known = finding.difference.as_ref().filter(|_| finding.comparison == Some(report.comparison));
                report.before.is_some() && known.is_some_and(|known| known.has_field_of(difference))
            };
            if !findings.iter().any(is_known) {
                findings.push(differs(FindingKind::Differs, difference));
            }
        }
        let Some(fault) = &report.fault else { continue };
        // One fault shows in every comparison.
        if findings.iter().any(|finding| finding.kind == FindingKind::Fault && finding.what == *fault) {
            continue;
        }
        let finding = DoctorFinding {
            comparison: Some(report.comparison),
            level: Some(report.level),
            ..plain(FindingKind::Fault, fault.clone())
        };
        match fault.contains("panicked: ") {
            // Everything else may follow from a panic.
            true => findings.insert(0, finding),
            // A bad observation has its own message already.
            false if is_of_observation => {}
            false => findings.push(finding),
        }
    }
    (findings, notes)
}

/// Returns the hint at messages that wait in their queue at a restart.
fn hint_of(message: &str) -> String {
    let call = forget_call(message);
    format!("messages `{message}` of the last episode wait in their queue at a restart, and {call} drops them")
}

/// Returns the call of a `ForeignGame` that drops messages of a type at a restart.
fn forget_call(message: &str) -> String {
    format!("`.forget_messages::<{message}>()`")
}

fn plain(kind: FindingKind, what: String) -> DoctorFinding {
    DoctorFinding { kind, what, comparison: None, level: None, difference: None, causes: Vec::new() }
}

fn of_observation(seen: &ObservationReport) -> Vec<DoctorFinding> {
    let mut findings = Vec::new();
    if let Some(NonFiniteValue { tick, name, value }) = &seen.not_finite {
        let what = format!("observation `{name}` is {value} at tick {tick}: no policy can read that");
        findings.push(plain(FindingKind::NotFinite, what));
    }
    if let Some((tick, got)) = seen.length {
        let what = format!(
            "the observation has {got} values at tick {tick}, its sensor names {}: every value must be there in every tick",
            seen.values
        );
        findings.push(plain(FindingKind::LengthChanges, what));
    }
    if seen.is_blind() {
        let what = format!(
            "none of the {} observed values changed in {} ticks: the agent sees nothing",
            seen.values, seen.ticks
        );
        findings.push(plain(FindingKind::Blind, what));
    }
    findings
}

fn sentence(comparison: &str, difference: &DoctorDifference) -> String {
    use self::DifferenceKind::{Component, End, Entities, Observation, Resource, Reward, StateHash};
    let DoctorDifference { kind, name, entity, field, tick, .. } = difference;
    let thing = match kind {
        Resource => format!("resource `{name}{field}`"),
        Component => format!("component `{name}{field}` of {}", entity.as_deref().unwrap_or("an entity")),
        Entities => format!("the number of {name}"),
        Observation => format!("observation `{name}` of {}", entity.as_deref().unwrap_or("the agent")),
        Reward | End | StateHash => format!("the {name} of {}", entity.as_deref().unwrap_or("the agent")),
    };
    format!("{comparison}: {thing} differs at tick {tick}")
}

// Scope of comparisons: the game's state, without the engine's housekeeping.

/// Path prefixes of the plugin's own types, and of types that the engine creates for itself. It does so on other
/// threads, for the screen, or whenever a file happens to be loaded.
const HOUSEKEEPING: [&str; 34] = [
    "accesskit",
    "bevy_a11y::",
    "bevy_anti_alias::",
    "bevy_app::",
    "bevy_asset::",
    "bevy_audio::",
    "bevy_camera::",
    "bevy_clipboard::",
    "bevy_core_pipeline::",
    "bevy_diagnostic::",
    "bevy_gilrs::",
    "bevy_gizmos",
    "bevy_image::",
    "bevy_input_focus::",
    "bevy_log::",
    "bevy_pbr::",
    "bevy_picking::",
    "bevy_playbot::",
    "bevy_post_process::",
    "bevy_render::",
    "bevy_shader::",
    "bevy_sprite_render::",
    "bevy_text::",
    "bevy_ui",
    "bevy_window::",
    "bevy_winit::",
    "playbot::",
    "playbot_harness::",
    "playbot_learner::",
    "playbot_mutation::",
    "playbot_test::",
    "playbot_train::",
    "wgpu",
    "winit::",
];

/// The parts of the engine's entity system that belong to the game.
const HIERARCHY: [&str; 2] = ["bevy_ecs::hierarchy::ChildOf", "bevy_ecs::hierarchy::Children"];

/// Clocks and keys go on from one episode to the next. The plugin restores those that a snapshot needs.
const GOES_ON: [&str; 4] = ["bevy_time::", "bevy_input::", "leafwing_input_manager::", "bevy_enhanced_input::"];

/// Bevy's wall clock. Without a window it is a mock; [`DoctorComparison::Clock`] reveals its readers.
const WALL_CLOCK: &str = "bevy_time::time::Time<bevy_time::real::Real>";

/// Returns whether a type is the engine's or the plugin's, so that it says little about the cause of a difference.
fn is_engine(path: &str) -> bool {
    path.starts_with("bevy_") || HOUSEKEEPING.iter().any(|prefix| path.starts_with(prefix))
}

/// Beginnings of the types of engines and input managers beside Bevy.
const LIBRARIES: [&str; 3] = ["avian2d::", "avian3d::", "leafwing_input_manager::"];

/// Returns whether messages of this type are those of an engine or of the plugin.
fn is_of_library(path: &str) -> bool {
    is_engine(path) || LIBRARIES.iter().any(|library| path.starts_with(library))
}

/// Returns whether components and resources of this type are compared at all.
fn is_compared(path: &str) -> bool {
    let is_housekeeping = HOUSEKEEPING.iter().any(|prefix| path.starts_with(prefix)) || path == WALL_CLOCK;
    !is_housekeeping && (!path.starts_with("bevy_ecs::") || HIERARCHY.contains(&path))
}

/// Returns whether they are part of this comparison.
fn is_compared_in(comparison: DoctorComparison, path: &str) -> bool {
    !comparison.returns() || !GOES_ON.iter().any(|prefix| path.starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;
    use bevy::prelude::App;

    #[test]
    fn another_level_is_one_that_the_game_has_and_that_was_not_played() {
        let another = |game: &ForeignGame, level, further_levels: &[u64]| {
            let further_levels = further_levels.to_vec();
            DoctorOptions { level, further_levels, ..DoctorOptions::new("default".to_owned()) }.another_level(game)
        };
        let endless = || ForeignGame::new("walk", 1, |_: &mut App| {});
        assert_eq!(another(&endless(), 7, &[3]), Some(8));
        assert_eq!(another(&endless(), u64::MAX, &[0]), Some(1));
        let three = endless().levels(3);
        assert_eq!(another(&three, 0, &[1]), Some(2));
        assert_eq!(another(&three, 2, &[0]), Some(1), "level 3 does not exist");
        assert_eq!(another(&three, 2, &[1, 0]), None);
        assert_eq!(another(&endless().levels(1), 0, &[]), None);
    }

    #[test]
    fn the_games_state_is_compared_and_the_engines_housekeeping_is_not() {
        for path in ["breakout::Score", "bevy_transform::components::transform::Transform", HIERARCHY[0]] {
            assert!(is_compared(path), "{path}");
        }
        for path in [WALL_CLOCK, "bevy_render::sync_world::RenderEntity", "bevy_playbot::agent::Control"] {
            assert!(!is_compared(path), "{path}");
        }
    }

    #[test]
    fn clocks_are_no_state_that_a_restart_resets() {
        let clock = "bevy_time::time::Time<bevy_time::fixed::Fixed>";
        assert!(is_compared(clock) && is_compared_in(DoctorComparison::Repeat, clock));
        assert!(!is_compared_in(DoctorComparison::Restart, clock));
    }
}
