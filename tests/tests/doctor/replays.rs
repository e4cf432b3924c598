//! Tests of the replay check on games with planted faults: an accepted recording makes a data set.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{
    demo::{VerifyReport, verify_file},
    foreign::Restart,
    game::Game,
};
use playbot_learner::Dataset;
use playbot_tests::{
    faulty::Fault,
    foreign::{
        faulty_catch::{CatchFault, faulty_catch},
        stubborn::stubborn_game,
    },
    recording::{record_demonstrator, record_random},
};
use playbot_train::demo::Demonstrations;

fn verified(game: &dyn Game, path: &Path) -> VerifyReport {
    verify_file(game, path, |_| {}).expect("readable")
}

fn dataset(game: &dyn Game, path: &Path) -> Result<Dataset, String> {
    let demos = Demonstrations::read(game, &ObservationConfig::default(), path, None).expect("readable");
    demos.dataset(game, 2, |_| {}).map_err(|error| error.to_string())
}

/// Returns whether the recording is accepted, after a check that it then makes a data set.
fn is_accepted(game: &dyn Game, path: &Path) -> bool {
    let report = verified(game, path);
    let is_accepted = report.divergences.is_empty();
    if is_accepted {
        let steps = dataset(game, path).map(|dataset| dataset.steps() as u64);
        assert_eq!(steps, Ok(report.ticks), "{}", game.name());
    }
    is_accepted
}

#[test]
fn an_accepted_recording_of_a_faulty_game_makes_a_data_set() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("garden.demo");
    for (fault, accepted) in [
        (Fault::None, true),
        (Fault::UnseededRandomness, true),
        (Fault::HashOrder, true),
        (Fault::WallClock, true),
        (Fault::SharedScore, true),
        (Fault::Survivor, true),
        (Fault::LastingRecord, true),
        (Fault::Blind, true),
        (Fault::LeftOvers, false),
        (Fault::Hidden, false),
    ] {
        record_random(&fault, "bed", 3, &path, [0, 1, 2, 0, 1]);
        assert_eq!(is_accepted(&fault, &path), accepted, "{fault:?}: neither rewards nor hashes see the others");
        std::fs::remove_file(&path).expect("it is there");
    }
}

#[test]
fn an_accepted_recording_of_a_faulty_foreign_game_makes_a_data_set() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("catch.demo");
    for fault in [
        CatchFault::UnseededWind,
        CatchFault::UnseededGust,
        CatchFault::EndlessSeason,
        CatchFault::EndlessLocal,
        CatchFault::WallClock,
        CatchFault::FirstGale,
        CatchFault::HiddenMood,
    ] {
        let game = faulty_catch(fault);
        record_demonstrator(&game, "default", 0.3, &path, [0, 1, 0]);
        let accepted = is_accepted(&game, &path);
        assert!(accepted || fault != CatchFault::HiddenMood, "no agent sees the mood");
        std::fs::remove_file(&path).expect("it is there");
    }
}

#[test]
fn an_episode_that_replays_only_in_a_new_world_is_reported_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("first.demo");
    let game = stubborn_game(Restart::Startup);
    record_demonstrator(&game, "default", 0.4, &path, [2]);
    let report = verified(&game, &path);
    assert_eq!((report.episodes, report.divergences.len()), (1, 1), "{report:?}");
    let (episode, words) = &report.divergences[0];
    assert_eq!(*episode, 0);
    for part in [
        "replays in a new World, but not after another episode (level 2, tick ",
        "the game keeps something from one episode to the next",
        "`playbot doctor stubborn --mode default --level 2` names it",
    ] {
        assert!(words.contains(part), "`{part}` is missing in: {words}");
    }
    assert!(dataset(&game, &path).is_ok(), "it replays in the World of the data set, which is new");
}

#[test]
fn episodes_that_disturb_one_another_in_a_shared_world_are_observed_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("shared.demo");
    record_random(&Fault::SharedScore, "bed", 3, &path, 0..8);
    assert_eq!(verified(&Fault::SharedScore, &path).divergences, []);
    record_random(&Fault::None, "bed", 3, &folder.path().join("own.demo"), 0..8);
    let (shared, own) = (dataset(&Fault::SharedScore, &path), dataset(&Fault::None, &folder.path().join("own.demo")));
    assert_eq!(shared, own, "the score changes rewards, and nothing that is observed");
}
