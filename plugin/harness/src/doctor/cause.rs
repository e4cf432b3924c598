//! Common causes of a difference, and advice.

use crate::doctor::{DifferenceKind, DoctorComparison, DoctorDifference};
use serde::Serialize;

/// A common cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// Random numbers without a seed.
    Randomness,
    /// The order of a `HashMap` or `HashSet`.
    HashOrder,
    /// The wall clock.
    WallClock,
    /// The order in which queries go over archetypes.
    ArchetypeOrder,
    /// The order in which entities are spawned and despawned.
    EntityOrder,
    /// Something that belongs to a thread or to the whole process.
    ThreadState,
    /// A resource of which two arenas have only one.
    SharedByArenas,
    /// State that a restart does not reset.
    SurvivesRestart,
    /// State that a snapshot does not hold.
    IncompleteSnapshot,
    /// Files that are still loading while the game runs.
    Loading,
}

impl CauseKind {
    /// Returns the cause in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Randomness => "random numbers without a seed",
            Self::HashOrder => "iteration over a HashMap or HashSet of std, whose order differs from run to run",
            Self::WallClock => "the wall clock: Time<Real>, Instant or SystemTime",
            Self::ArchetypeOrder => {
                "the order in which queries go over archetypes, which depends on how many archetypes there were before: a \
                 recorder, a window and other plugins add some"
            }
            Self::EntityOrder => "the order in which entities are spawned and despawned, which decides on their ids",
            Self::ThreadState => "a static, a thread_local! or a task on another thread",
            Self::SharedByArenas => "a resource, static or query that all arenas of a World share",
            Self::SurvivesRestart => {
                "state that survives a restart: a resource, a Local, a static or an entity that is not reset"
            }
            Self::IncompleteSnapshot => "state that the game's snapshot does not hold, or does not put back",
            Self::Loading => "assets that are still loading when the game begins",
        }
    }

    /// Returns the rank of a cause: the likelier, the lower.
    fn rank(self) -> u8 {
        match self {
            Self::WallClock => 0,
            Self::Randomness | Self::HashOrder | Self::ThreadState => 1,
            Self::ArchetypeOrder | Self::EntityOrder | Self::Loading => 2,
            Self::SharedByArenas | Self::SurvivesRestart | Self::IncompleteSnapshot => 3,
        }
    }

    /// Returns the advice against it.
    pub fn advice(self) -> &'static str {
        match self {
            Self::Randomness => {
                "keep a seeded generator in a resource or on the arena, seed it from the level's number when an episode \
                 starts, and draw from nothing else (no thread_rng, no RandomState, no address of anything)"
            }
            Self::HashOrder => {
                "use a BTreeMap, an IndexMap or Bevy's own `bevy::platform::collections::HashMap`, or sort the entries \
                 before anything depends on their order"
            }
            Self::WallClock => {
                "use `Res<Time>` (game time) for everything that moves or counts, and leave Time<Real> and Instant to \
                 what is only shown"
            }
            Self::ArchetypeOrder => {
                "sort what a query finds, or give entities whose order counts one archetype: the same components; a physics \
                 engine is given colliders in such an order, and a body at a seam between two of them may trip or not, so \
                 make ground one collider"
            }
            Self::EntityOrder => {
                "spawn and despawn in an order that is the same in each run, and sort by something else than ids of \
                 entities; an id alone does no harm, and is a note until an agent notices it"
            }
            Self::ThreadState => {
                "put it into the World, as a resource or a component; let a task's result arrive at a tick that does not \
                 depend on when it was ready, for which a foreign game has `.wait_for_tasks`"
            }
            Self::SharedByArenas => {
                "put it on the arena or the agent as a component, or let the game have one arena per World"
            }
            Self::SurvivesRestart => {
                "set it back when an episode starts: insert the resource anew, despawn what the level spawned, keep no \
                 state of the simulation in a Local; what is meant to last, such as a high score, can be left out with \
                 --ignore. For what a foreign game cannot set back there is `Restart::Rebuild`, which builds the World anew \
                 for each episode, and for messages that the end of an episode leaves in a queue `.forget_messages`. State that \
                 this comparison does not see, but agents may: a Local, a static, an asset, a queue of messages, a type that does not derive Reflect, and a field with #[reflect(ignore)]"
            }
            Self::IncompleteSnapshot => {
                "return it in `save`, and put it back in `load` (`.snapshot` of a `ForeignGame`, or `SnapshotTools`), and \
                 despawn in `load` what was spawned since; with `.snapshots()`, declare its type with `.snapshot_of`. Keep a \
                 Local in a resource. Explorers that notice it return by replays, and --no-snapshots always does"
            }
            Self::Loading => {
                "wait for the files before an episode starts, with a `ready` that says when they are there"
            }
        }
    }
}

/// A cause that fits a difference.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Cause {
    /// The cause.
    pub kind: CauseKind,
    /// Hints in the game that point to it.
    pub evidence: Vec<String>,
    /// The advice.
    pub advice: &'static str,
}

/// Returns the causes of a difference in a comparison, likeliest first, if nothing else points to one.
fn kinds(comparison: DoctorComparison) -> &'static [CauseKind] {
    match comparison {
        DoctorComparison::Repeat => &[CauseKind::Randomness, CauseKind::HashOrder, CauseKind::WallClock],
        DoctorComparison::Clock => &[CauseKind::WallClock],
        DoctorComparison::Archetypes => &[CauseKind::ArchetypeOrder],
        DoctorComparison::Threads => &[CauseKind::ThreadState],
        DoctorComparison::Arenas => &[CauseKind::SharedByArenas],
        DoctorComparison::Restart | DoctorComparison::OtherLevel => &[CauseKind::SurvivesRestart],
        DoctorComparison::Snapshots => &[CauseKind::IncompleteSnapshot],
    }
}

/// Parts of the paths of types that hold a time of the wall clock.
const WALL_CLOCKS: [&str; 3] = ["::Instant", "SystemTime", "bevy_time::real::Real"];

/// Parts of the paths of types that hold times. Two runs of the same actions differ in them only if a clock was read.
const TIMES: [&str; 3] = ["::Duration", "bevy_time::", "Diagnostics"];

/// Parts of the paths of random number generators.
const GENERATORS: [&str; 3] = ["Rng", "rand::", "fastrand"];

/// Returns the cause that the type of a value points to, if it does.
fn hint(comparison: DoctorComparison, difference: &DoctorDifference) -> Option<CauseKind> {
    let DoctorDifference { name, value_type, .. } = difference;
    let has = |signs: &[&str]| signs.iter().any(|sign| name.contains(sign) || value_type.contains(sign));
    let is_repeated = matches!(comparison, DoctorComparison::Repeat | DoctorComparison::Threads);
    match comparison {
        DoctorComparison::Clock => None,
        _ if has(&WALL_CLOCKS) => Some(CauseKind::WallClock),
        _ if is_repeated && has(&TIMES) => Some(CauseKind::WallClock),
        _ if is_repeated && has(&GENERATORS) => Some(CauseKind::Randomness),
        _ if is_repeated && value_type.ends_with("entity::Entity") => Some(CauseKind::EntityOrder),
        _ => None,
    }
}

/// Returns the rank of a difference by its likeliest cause: clocks, then randomness, then the order of entities and
/// systems, then state that is left over.
pub(super) fn likelihood(comparison: DoctorComparison, difference: &DoctorDifference) -> u8 {
    hint(comparison, difference).unwrap_or(kinds(comparison)[0]).rank()
}

/// Returns the causes that fit a difference, likeliest first. The comparison that differs matters most, and the type of
/// the value. Among several causes, the types in the game decide. `follows_clock` is true if the same type differs with
/// another wall clock.
pub(super) fn causes(
    comparison: DoctorComparison,
    difference: Option<&DoctorDifference>,
    suspicions: &[(CauseKind, String)],
    follows_clock: bool,
) -> Vec<Cause> {
    let hint = difference.and_then(|difference| hint(comparison, difference));
    let likeliest = if follows_clock { Some(CauseKind::WallClock) } else { hint };
    let kinds = kinds(comparison);
    let counts_differ = difference.is_some_and(|difference| difference.kind == DifferenceKind::Entities);
    let is_of_loading = counts_differ && matches!(comparison, DoctorComparison::Repeat | DoctorComparison::Threads);
    let others = kinds.iter().copied().chain(is_of_loading.then_some(CauseKind::Loading));
    let all = likeliest.into_iter().chain(others.filter(|kind| Some(*kind) != likeliest));
    let mut causes: Vec<_> = all
        .map(|kind| {
            let of_value = difference.filter(|_| hint == Some(kind)).map(evidence);
            let of_clock = (follows_clock && kind == CauseKind::WallClock)
                .then(|| "it differs with another wall clock, too".to_owned());
            let of_types = suspicions.iter().filter(|(of, _)| *of == kind).map(|(_, why)| why.clone());
            let mut evidence: Vec<_> = of_value.into_iter().chain(of_clock).chain(of_types).collect();
            evidence.dedup();
            Cause { kind, evidence, advice: kind.advice() }
        })
        .collect();
    causes.sort_by_key(|cause| (Some(cause.kind) != likeliest, cause.evidence.is_empty()));
    causes
}

/// Returns what a hint is taken from.
fn evidence(difference: &DoctorDifference) -> String {
    let DoctorDifference { name, field, value_type, .. } = difference;
    let short = |path: &str| path.rsplit("::").next().unwrap_or(path).to_owned();
    // The last part of a generic path is that of its argument.
    let owner = if name.contains('<') { name.clone() } else { short(name) };
    match value_type.as_str() {
        "" => format!("it is in a `{name}`"),
        value_type => format!("`{owner}{field}` is a `{value_type}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(comparison: DoctorComparison, suspicions: &[(CauseKind, String)]) -> Vec<CauseKind> {
        causes(comparison, None, suspicions, false).into_iter().map(|cause| cause.kind).collect()
    }

    fn difference(name: &str, value_type: &str) -> DoctorDifference {
        DoctorDifference {
            tick: 0,
            kind: DifferenceKind::Resource,
            name: name.to_owned(),
            entity: None,
            field: ".of".to_owned(),
            left: "1".to_owned(),
            right: "2".to_owned(),
            value_type: value_type.to_owned(),
        }
    }

    #[test]
    fn the_type_of_a_value_points_to_a_cause() {
        let first = |comparison, name: &str, value_type: &str| {
            causes(comparison, Some(&difference(name, value_type)), &[], false).remove(0).kind
        };
        let repeat = DoctorComparison::Repeat;
        assert_eq!(first(repeat, "game::Stats", "core::time::Duration"), CauseKind::WallClock);
        assert_eq!(first(repeat, "game::Began", "std::time::Instant"), CauseKind::WallClock);
        assert_eq!(first(repeat, "game::Dice", "wyrand::WyRng"), CauseKind::Randomness);
        assert_eq!(first(repeat, "game::Target", "bevy_ecs::entity::Entity"), CauseKind::EntityOrder);
        // Each episode leaves times behind, and games with a clock of their own keep them.
        let restart = DoctorComparison::Restart;
        assert_eq!(first(restart, "game::Stats", "core::time::Duration"), CauseKind::SurvivesRestart);
        assert_eq!(first(restart, "game::Began", "std::time::Instant"), CauseKind::WallClock);
    }

    #[test]
    fn a_hint_says_which_value_it_is_taken_from() {
        let of_value = difference("game::Stats", "core::time::Duration");
        let cause = causes(DoctorComparison::Repeat, Some(&of_value), &[], false).remove(0);
        assert_eq!(cause.evidence, ["`Stats.of` is a `core::time::Duration`"]);
    }

    #[test]
    fn state_that_another_clock_changes_is_named_as_a_clock_after_a_restart_too() {
        let of_value = difference("game::Pace", "f32");
        let cause = causes(DoctorComparison::Restart, Some(&of_value), &[], true).remove(0);
        assert_eq!((cause.kind, cause.evidence.len()), (CauseKind::WallClock, 1));
    }

    #[test]
    fn clocks_come_before_randomness_and_order_and_what_is_left_over() {
        let of = |comparison, value_type: &str| likelihood(comparison, &difference("game::Thing", value_type));
        let ranks = [
            of(DoctorComparison::Repeat, "core::time::Duration"),
            of(DoctorComparison::Repeat, "f32"),
            of(DoctorComparison::Repeat, "bevy_ecs::entity::Entity"),
            of(DoctorComparison::Restart, "f32"),
        ];
        assert_eq!(ranks, [0, 1, 2, 3]);
    }

    #[test]
    fn the_comparison_that_differs_tells_causes_apart() {
        assert_eq!(kinds(DoctorComparison::Clock, &[]), [CauseKind::WallClock]);
        assert_eq!(kinds(DoctorComparison::Archetypes, &[]), [CauseKind::ArchetypeOrder]);
        assert_eq!(kinds(DoctorComparison::Arenas, &[]), [CauseKind::SharedByArenas]);
        assert_eq!(kinds(DoctorComparison::Restart, &[]), [CauseKind::SurvivesRestart]);
        assert_eq!(kinds(DoctorComparison::OtherLevel, &[]), [CauseKind::SurvivesRestart]);
        assert_eq!(kinds(DoctorComparison::Snapshots, &[]), [CauseKind::IncompleteSnapshot]);
        assert_eq!(kinds(DoctorComparison::Repeat, &[])[0], CauseKind::Randomness);
    }

    #[test]
    fn what_survives_a_restart_has_a_remedy_and_what_hides_it_is_named() {
        let advice = CauseKind::SurvivesRestart.advice();
        let remedies = ["insert the resource anew", "--ignore", "`Restart::Rebuild`", "`.forget_messages`"];
        for words in remedies.into_iter().chain(["a Local", "a static", "a queue of messages", "Reflect"]) {
            assert!(advice.contains(words), "`{words}` is missing in: {advice}");
        }
    }

    #[test]
    fn what_the_game_holds_comes_first() {
        let suspicions = [(CauseKind::HashOrder, "`Bag.0` is a `HashMap`".to_owned())];
        assert_eq!(kinds(DoctorComparison::Repeat, &suspicions)[0], CauseKind::HashOrder);
    }
}
