//! Tests of detectors of whole levels and of logs, and of the replay of their findings.

use playbot::prelude::*;
use playbot_harness::eval::Player;
use playbot_test::{
    findings::{Checks, FindingHead, FindingStatus, StoredFinding, keep::recheck},
    verdict::Tester,
};
use playbot_tests::{Corridor, faulty::Fault as Garden};

use crate::corridor_defects::{Defect, always, assert_silent, findings, only, tester};

/// Returns a tester that rests, and some random ones.
fn crowd() -> Vec<Tester> {
    let anybody = ["one", "two", "three", "four"].map(|name| tester(name, Player::Blind(BlindBot::Uniform)));
    std::iter::once(always(2)).chain(anybody).collect()
}

#[test]
fn clocks_that_end_episodes_are_found() {
    let cases: [(Defect, &str, &[&str]); 2] =
        [(Defect::LostByClock, "clock-end", &["clock-end.episodes=2"]), (Defect::ShortTime, "uneven-time", &[])];
    for (game, detector, settings) in cases {
        let looked = |game: Defect| findings(&game, "plain:1", crowd(), only(&game, &[detector], settings));
        let found = looked(game);
        let [(_, finding)] = found.as_slice() else { panic!("{detector}: {found:?}") };
        assert_eq!((finding.detector.as_str(), finding.tick), (detector, Some(4)), "{found:?}");
        assert!(finding.tester.is_some() && finding.episode.is_some(), "{found:?}");
        assert_silent(&looked(Defect::None));
    }
}

#[test]
fn what_is_logged_and_what_whole_levels_show_is_found_again() {
    let rest = vec![ActionValue::Discrete(2); 9];
    let right = vec![ActionValue::Discrete(1); 9];
    let stored = |game: &dyn Game, level: (&str, u64), detector: &str, actions: &[ActionValue]| {
        let head = FindingHead::new(format!("{}:{}", level.0, level.1), detector, "words");
        StoredFinding::of_actions(game, level.0, level.1, head, actions, &Checks::of_game(game))
    };
    let is_found_again =
        |game: &dyn Game, level: (&str, u64), detector: &str, actions: &[ActionValue], tick: Option<u32>| {
            let finding = stored(game, level, detector, actions).unwrap_or_else(|| panic!("{detector} finds it"));
            assert_eq!(finding.head.tick, tick, "{detector}");
            let again = recheck(game, &finding, &Checks::of_game(game)).expect("playable");
            assert_eq!(again.status(&finding), FindingStatus::StillThere, "{detector}");
        };
    let (plain, bed) = (("plain", 2), ("bed", 0));
    is_found_again(&Defect::LoggedError, plain, "error-log", &rest, Some(1));
    is_found_again(&Defect::LostByClock, plain, "clock-end", &rest, Some(4));
    is_found_again(&Defect::ShortTime, plain, "uneven-time", &rest, Some(4));
    // Level 2 starts at cell 4, and the exit is cell 6.
    is_found_again(&Corridor, plain, "shortcut", &right, Some(1));
    is_found_again(&Garden::LeftOvers, bed, "entity-leak", &[], None);
    assert_eq!(stored(&Defect::None, plain, "error-log", &rest), None);
    assert_eq!(stored(&Defect::None, plain, "clock-end", &rest), None);
    assert_eq!(stored(&Garden::None, bed, "entity-leak", &[]), None);
    let known = Checks::of_game(&Corridor);
    assert!(["determinism", "reward-farm", "too-long"].iter().all(|none| known.of(none).is_none()));
}
