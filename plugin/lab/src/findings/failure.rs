//! Failed episodes as findings.

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};

use super::play::Replayed;

/// The game ended the episode before the goal.
pub(super) const LOST: &str = "lost";
/// The time limit ended the episode before the goal.
pub(super) const NOT_SOLVED: &str = "not-solved";

/// Returns the kind of an episode that ended before the goal, and its message; `None` if the goal was reached.
pub(super) fn failure_of(end: &EpisodeResult) -> Option<(&'static str, String)> {
    if end.success {
        return None;
    }
    let ticks = end.ticks;
    match end.end {
        EpisodeEnd::Terminated { success: true } => None,
        EpisodeEnd::Terminated { success: false } => {
            Some((LOST, format!("the game ended the episode after {ticks} ticks")))
        }
        EpisodeEnd::Truncated => Some((NOT_SOLVED, format!("time was up after {ticks} ticks"))),
    }
}

/// Returns the message about a replayed episode with this finding, if it is known: the panic or fault, or the failure.
pub(super) fn message_of(detector: &str, replayed: &Replayed) -> Option<String> {
    let broken = replayed.broken.as_ref().filter(|broken| broken.detector == detector);
    let failed = || replayed.end.as_ref().and_then(failure_of).filter(|(name, _)| *name == detector);
    broken.map(|broken| broken.message.clone()).or_else(|| failed().map(|(_, words)| words))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Breakage;

    fn ended(end: EpisodeEnd) -> EpisodeResult {
        EpisodeResult { level: 3, end, success: end.is_success(), ticks: 47, clipped: 0, total_reward: 0.0 }
    }

    #[test]
    fn each_failure_has_its_name_and_the_ticks_of_this_episode() {
        let (name, words) = failure_of(&ended(EpisodeEnd::Terminated { success: false })).expect("it failed");
        assert_eq!((name, words.as_str()), (LOST, "the game ended the episode after 47 ticks"));
        assert!(!words.contains(name), "told behind its name, it is not told twice");
        let (name, words) = failure_of(&ended(EpisodeEnd::Truncated)).expect("it failed");
        assert_eq!((name, words.as_str()), (NOT_SOLVED, "time was up after 47 ticks"));
        assert_eq!(failure_of(&ended(EpisodeEnd::Terminated { success: true })), None);
    }

    #[test]
    fn only_what_was_looked_for_has_words() {
        let end = Some(ended(EpisodeEnd::Truncated));
        let replayed = Replayed { end, ..Replayed::default() };
        assert_eq!(message_of(NOT_SOLVED, &replayed).as_deref(), Some("time was up after 47 ticks"));
        assert_eq!(message_of(LOST, &replayed), None);
        let broken = Breakage { detector: "panic", tick: 4, message: "value 7 burns".to_owned() };
        let replayed = Replayed { broken: Some(broken), ..Replayed::default() };
        assert_eq!(message_of("panic", &replayed).as_deref(), Some("value 7 burns"));
        assert_eq!(message_of("fault", &replayed), None);
    }
}
