//! Findings for tests.

use crate::findings::{CourseEnd, FindingHead, RecordedCourse, StoredFinding};
use bevy_playbot::action::{ActionSpace, Actions};
use bevy_playbot::demo::file::{Decider, DemoEpisode, DemoHeader};

/// A finding of this detector in `hard:7`, at tick 2.
pub(super) fn head(detector: &str) -> FindingHead {
    let head = FindingHead::new("hard:7", detector, "it burns (src/fire.rs:3:9)");
    let tester = Some("random".to_owned());
    FindingHead { tester, seed: 5, tick: Some(2), state_hash: Some(0x1f), original_ticks: 9, ..head }
}

/// A panic after three actions, in a game that need not exist.
pub(super) fn stored() -> StoredFinding {
    let header = DemoHeader::new("garden", 1, "hard", 20.0, ActionSpace::Discrete(2));
    let mut episode = DemoEpisode::new(7, ActionSpace::Discrete(2));
    episode.actions = Actions::Discrete(vec![1, 0, 1]);
    episode.rewards = vec![0.0; 3];
    episode.state_hashes = vec![3, 0x1f, 0x1f];
    episode.deciders = vec![Decider::Bot; 3];
    StoredFinding { header, head: head("panic"), episode }
}

/// Makes the course of a recording that was won in 120 ticks, and is won in so many now.
pub(crate) fn course(ticks: u64) -> RecordedCourse {
    let differs = (ticks != 120).then(|| ticks as u32 - 1);
    RecordedCourse {
        recorded_ticks: 120,
        ticks,
        end: CourseEnd::Solved,
        differs,
        action: None,
        position: None,
        furthest: None,
    }
}
