//! What an examination found, for people and for programs.

use serde::Serialize;

use super::{finding::Finding, observed::ObservationReport, safety::Safety, types::TypesReport};

/// Which copies of the game are held side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Comparison {
    /// Two Worlds on one thread, one after the other in every tick.
    Repeat,
    /// Two Worlds, in one of which Bevy's `Time<Real>` runs slower, as on a machine that is.
    Clock,
    /// A World as usual, and some with more archetypes, as a recorder, a window or another plugin brings them. What differs
    /// counts only if agents notice it: the order of things alone does no harm.
    Archetypes,
    /// A World on this thread, and two that are ticked at the same time on two threads.
    Threads,
    /// Two arenas in one World, and each of them alone in a World.
    Arenas,
    /// The first episode of a World, and the second episode of the same level in another one.
    Restart,
}

impl Comparison {
    /// All of them, in the order in which they are made.
    pub const ALL: [Self; 6] =
        [Self::Repeat, Self::Archetypes, Self::Clock, Self::Threads, Self::Arenas, Self::Restart];

    /// What is held side by side, for people.
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

    /// What the left value of a difference is of, and the right one.
    pub fn sides(self) -> (&'static str, &'static str) {
        match self {
            Self::Repeat => ("first copy", "second copy"),
            Self::Clock => ("usual clock", "slower clock"),
            Self::Archetypes => ("usual World", "more archetypes"),
            Self::Threads => ("one thread", "two threads"),
            Self::Arenas => ("alone", "with another arena"),
            Self::Restart => ("first episode", "second episode"),
        }
    }
}

/// What kind of thing differs.
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

/// One thing that is not the same in two copies of the game.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The tick of the comparison, from 0.
    pub tick: u32,
    /// What kind of thing.
    pub kind: DifferenceKind,
    /// Path of the component's or resource's type; what agents have by name, such as `reward`.
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

/// What one comparison found.
#[derive(Clone, Debug, Serialize)]
pub struct ComparisonReport {
    /// Which.
    pub comparison: Comparison,
    /// Why it was not made, if it was not.
    pub skipped: Option<String>,
    /// Ticks compared.
    pub ticks: u32,
    /// Episodes that began in these ticks, in the copy on the left; the last one need not have come to its end.
    pub episodes: u32,
    /// The first difference, the one nearest to its cause if a tick has several.
    pub first: Option<Difference>,
    /// Further differences of that tick, a few of them.
    pub others: Vec<Difference>,
    /// The first difference in what agents observe, get or end with, if it came to that.
    pub effect: Option<Difference>,
    /// Entities that could not be matched with one of the other copy.
    pub unmatched: usize,
    /// What the game did wrong so that the comparison ended early: a fault, or a panic.
    pub fault: Option<String>,
}

impl ComparisonReport {
    /// Whether the copies played the same game to the end; `None` if they were not compared.
    pub fn same(&self) -> Option<bool> {
        self.skipped.is_none().then(|| self.first.is_none() && self.effect.is_none() && self.fault.is_none())
    }

    /// The first difference of any kind.
    pub fn difference(&self) -> Option<&Difference> {
        self.first.as_ref().or(self.effect.as_ref())
    }
}

/// What an examination found.
#[derive(Clone, Debug, Serialize)]
pub struct DoctorReport {
    /// Name of the game.
    pub game: String,
    /// Version of its rules.
    pub version: u32,
    /// Its mode.
    pub mode: String,
    /// Level that was played, and seed of the actions.
    pub seed: u64,
    /// Ticks that each comparison was to play.
    pub ticks: u32,
    /// What was compared.
    pub comparisons: Vec<ComparisonReport>,
    /// What agents saw.
    pub observation: ObservationReport,
    /// Which types could be compared.
    pub types: TypesReport,
    /// What the game is safe for.
    pub safety: Safety,
    /// What is wrong, worst first.
    pub findings: Vec<Finding>,
    /// Ticks per second of one arena, if somebody measured it: the examination itself reads no clock.
    pub ticks_per_second: Option<f64>,
}

impl DoctorReport {
    /// Whether nothing is wrong.
    pub fn is_healthy(&self) -> bool {
        self.findings.is_empty()
    }

    /// What a comparison found.
    pub fn of(&self, comparison: Comparison) -> Option<&ComparisonReport> {
        self.comparisons.iter().find(|report| report.comparison == comparison)
    }
}
