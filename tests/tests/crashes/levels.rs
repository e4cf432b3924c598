//! Tests of interrupted tests of levels.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::eval::Player;
use playbot_learner::disk::DiskRecording;
use playbot_test::{
    detectors::Detectors,
    verdict::{
        Earlier, RESULTS, TestEnd, TestError, TestFolder, TestObserver, TestPlan, Tester, TesterRecord, run_tests,
    },
};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, power_cuts},
};

use super::tree::tree;

fn plan(seed: u64) -> TestPlan {
    let tester = Tester {
        record: TesterRecord::bot("random"),
        player: Player::Blind(BlindBot::Uniform),
        observation_config: ObservationConfig::default(),
    };
    let split = "plain:0..19".parse().expect("levels");
    TestPlan {
        split,
        testers: vec![tester],
        episodes: 1,
        seed,
        detectors: Detectors::default(),
        shard: None,
        threads: 1,
    }
}

/// Tests the untested levels, to the end.
fn test(folder: &Path, seed: u64, earlier: Earlier) -> Result<Vec<u8>, TestError> {
    let plan = plan(seed);
    let (mut opened, _) = TestFolder::open(folder, &plan.record(&Corridor), earlier)?;
    let finished = opened.finished();
    let watch = TestObserver { progress: &|_| {}, stop: &|| false };
    assert_eq!(run_tests(&Corridor, &plan, &finished, &mut |verdict| opened.keep(&verdict), &watch)?, TestEnd::Done);
    opened.finish()?;
    Ok(std::fs::read(folder.join(RESULTS)).expect("written"))
}

#[test]
fn a_test_in_the_place_of_another_gives_the_same_results_wherever_the_power_failed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("test");
    let old = test(&path, 1, Earlier::Keep).expect("fresh");
    let before = PaperDisk::of(folder.path());
    let recording = DiskRecording::of(folder.path());
    let new = test(&path, 2, Earlier::Replace).expect("replaceable");
    assert_ne!(old, new);
    let (operations, files) = (recording.operations(), tree(folder.path()));
    let (mut untouched, mut gone_on) = (0, 0);
    for cut in power_cuts(&operations) {
        let left = tempfile::tempdir().expect("a folder");
        before.clone().after(&operations, &cut).write(folder.path(), left.path());
        let path = left.path().join("test");
        let results = match test(&path, 2, Earlier::Resume) {
            Ok(results) => {
                gone_on += 1;
                results
            }
            Err(TestError::OtherPlan { .. }) => {
                untouched += 1;
                assert_eq!(test(&path, 1, Earlier::Resume).expect("whole"), old, "{cut:?}: the old test has changed");
                assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
                continue;
            }
            // Without the record of the old test its results are as good as gone.
            Err(TestError::Exists(_)) => test(&path, 2, Earlier::Replace).expect("replaceable"),
            Err(error) => panic!("{cut:?}: {error}"),
        };
        assert!(results == new, "{cut:?}: other results");
        assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
    }
    assert!(untouched > 0 && gone_on > 50, "{untouched}, {gone_on}");
}
