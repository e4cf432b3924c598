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
    /// The clock on the wall.
    WallClock,
    /// The order in which queries go over archetypes.
    ArchetypeOrder,
    /// Something that belongs to a thread or to the whole process.
    ThreadState,
    /// A resource of which two arenas have only one.
    SharedByArenas,
    /// State that a restart does not reset.
    SurvivesRestart,
    /// Files that are still loading while the game runs.
    Loading,
}

impl CauseKind {
    /// Returns the cause in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Randomness => "random numbers without a seed",
            Self::HashOrder => "iteration over a HashMap or HashSet of std, whose order differs from run to run",
            Self::WallClock => "the clock on the wall: Time<Real>, Instant or SystemTime",
            Self::ArchetypeOrder => {
                "the order in which queries go over archetypes, which depends on how many archetypes there were before: a \
                 recorder, a window and other plugins add some"
            }
            Self::ThreadState => "a static, a thread_local! or a task on another thread",
            Self::SharedByArenas => "a resource, static or query that all arenas of a World share",
            Self::SurvivesRestart => {
                "state that survives a restart: a resource, a Local, a static or an entity that is not reset"
            }
            Self::Loading => "assets that are still loading when the game begins",
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
            Self::ThreadState => {
                "put it into the World, as a resource or a component; let a task's result arrive at a tick that does not \
                 depend on when it was ready"
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

/// Returns the causes that fit a difference, likeliest first. The comparison that differs matters most. Among several
/// causes, the types in the game decide.
pub(super) fn causes(
    comparison: DoctorComparison,
    difference: Option<&DoctorDifference>,
    suspicions: &[(CauseKind, String)],
) -> Vec<Cause> {
    let kinds: &[CauseKind] = match comparison {
        DoctorComparison::Repeat => &[CauseKind::Randomness, CauseKind::HashOrder, CauseKind::WallClock],
        DoctorComparison::Clock => &[CauseKind::WallClock],
        DoctorComparison::Archetypes => &[CauseKind::ArchetypeOrder],
        DoctorComparison::Threads => &[CauseKind::ThreadState],
        DoctorComparison::Arenas => &[CauseKind::SharedByArenas],
        DoctorComparison::Restart => &[CauseKind::SurvivesRestart],
    };
    let counts_differ = difference.is_some_and(|difference| difference.kind == DifferenceKind::Entities);
    let is_of_loading = counts_differ && matches!(comparison, DoctorComparison::Repeat | DoctorComparison::Threads);
    let all = kinds.iter().copied().chain(is_of_loading.then_some(CauseKind::Loading));
    let mut causes: Vec<_> = all
        .map(|kind| {
            let evidence = suspicions.iter().filter(|(of, _)| *of == kind).map(|(_, why)| why.clone()).collect();
            Cause { kind, evidence, advice: kind.advice() }
        })
        .collect();
    causes.sort_by_key(|cause| cause.evidence.is_empty());
    causes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(comparison: DoctorComparison, suspicions: &[(CauseKind, String)]) -> Vec<CauseKind> {
        causes(comparison, None, suspicions).into_iter().map(|cause| cause.kind).collect()
    }

    #[test]
    fn the_comparison_that_differs_tells_causes_apart() {
        assert_eq!(kinds(DoctorComparison::Clock, &[]), [CauseKind::WallClock]);
        assert_eq!(kinds(DoctorComparison::Archetypes, &[]), [CauseKind::ArchetypeOrder]);
        assert_eq!(kinds(DoctorComparison::Arenas, &[]), [CauseKind::SharedByArenas]);
        assert_eq!(kinds(DoctorComparison::Restart, &[]), [CauseKind::SurvivesRestart]);
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
