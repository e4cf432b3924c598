//! The report of an examination, for people and for programs.

use serde::Serialize;

use super::{finding::Finding, observed::ObservationReport, safety::Safety, types::TypesReport};

/// The copies of the game that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Comparison {
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
}

impl Comparison {
    /// All comparisons, in the order in which they are made.
    pub const ALL: [Self; 6] =
        [Self::Repeat, Self::Archetypes, Self::Clock, Self::Threads, Self::Arenas, Self::Restart];

    /// Returns the comparison in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Repeat => "twice in one thread",
            Self::Clock => "with another wall clock",
            Self::Archetypes => "with more archetypes",
            Self::Threads => "on two threads",
            Self::Arenas => "two arenas in one World",
            Self::Restart => "again after a restart",
        }
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
        }
    }
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
    /// Whether and how the agent's episode ends.
    End,
    /// The game's own hash of its state.
    StateHash,
}

/// A difference between two copies of the game.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
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
    /// The value in the left copy, see [`Comparison::sides`].
    pub left: String,
    /// The value in the right copy.
    pub right: String,
}

/// The result of one comparison.
#[derive(Clone, Debug, Serialize)]
pub struct ComparisonReport {
    /// The comparison.
    pub comparison: Comparison,
    /// Why it was skipped, if it was.
    pub skipped: Option<String>,
    /// Ticks compared.
    pub ticks: u32,
    /// Episodes that started in these ticks, in the copy on the left; the last one may be unfinished.
    pub episodes: u32,
    /// The first difference, the one nearest to its cause if a tick has several.
    pub first: Option<Difference>,
    /// A few further differences of that tick.
    pub others: Vec<Difference>,
    /// The first difference in observations, rewards or ends of episodes, if there is one.
    pub effect: Option<Difference>,
    /// Entities without a match in the other copy.
    pub unmatched: usize,
    /// The fault or panic of the game that ended the comparison early.
    pub fault: Option<String>,
}

impl ComparisonReport {
    /// Returns whether the copies played the same game to the end; `None` if they were not compared.
    pub fn same(&self) -> Option<bool> {
        self.skipped.is_none().then(|| self.first.is_none() && self.effect.is_none() && self.fault.is_none())
    }

    /// Returns the first difference of any kind.
    pub fn difference(&self) -> Option<&Difference> {
        self.first.as_ref().or(self.effect.as_ref())
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
    /// The level.
    pub level: u64,
    /// Random seed of the World and of the actions.
    pub seed: u64,
    /// Ticks that each comparison was to play.
    pub ticks: u32,
    /// The comparisons.
    pub comparisons: Vec<ComparisonReport>,
    /// The observations of agents.
    pub observation: ObservationReport,
    /// The types that could be compared.
    pub types: TypesReport,
    /// The uses that the game is safe for.
    pub safety: Safety,
    /// The findings, worst first.
    pub findings: Vec<Finding>,
    /// Ticks per second of one arena, if they were measured: the examination itself reads no clock.
    pub ticks_per_second: Option<f64>,
}

impl DoctorReport {
    /// Returns whether there is no finding.
    pub fn is_healthy(&self) -> bool {
        self.findings.is_empty()
    }

    /// Returns the report of a comparison.
    pub fn of(&self, comparison: Comparison) -> Option<&ComparisonReport> {
        self.comparisons.iter().find(|report| report.comparison == comparison)
    }
}
