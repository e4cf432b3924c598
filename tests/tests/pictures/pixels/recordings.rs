//! Tests of recordings replayed with picture sensors.

use playbot_tests::PaintedCorridor;

use super::corridor::{demonstrations, experiment, record};

#[test]
fn recordings_show_the_same_pictures_in_every_replay() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let observation_config = experiment().observation_config();
    let read = || demonstrations(folder.path(), &observation_config);
    assert_eq!((read().episodes(), read().picture_bytes()), (72, read().steps() * 16 * 16 * 4));
    let steps = std::sync::atomic::AtomicU64::new(0);
    let count = |n| {
        steps.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
    };
    let one = read().dataset(&PaintedCorridor, 1, count).expect("replays");
    assert_eq!(one.observation(), observation_config.image.obs_kind());
    assert_eq!(steps.load(std::sync::atomic::Ordering::Relaxed), one.steps() as u64, "progress ends at the end");
    assert!(one == read().dataset(&PaintedCorridor, 3, |_| {}).expect("replays"), "threads");
    // The recordings b and c are the same game.
    let part = |name: &str| {
        let demos = demonstrations(&folder.path().join(name), &observation_config);
        demos.dataset(&PaintedCorridor, 1, |_| {}).expect("replays")
    };
    assert!(part("b.demo") == part("c.demo") && part("a.demo") != part("b.demo"));
}

#[test]
fn a_part_of_the_recordings_is_spread_over_all_of_them() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let read = || demonstrations(folder.path(), &experiment().observation_config());
    let all = read().steps();
    let half = read().at_most(all / 2);
    assert!(half.steps() <= all / 2 && half.steps() > all / 3, "{} of {all}", half.steps());
    assert_eq!(read().at_most(1).episodes(), 1, "at least one");
    assert_eq!(read().at_most(all).episodes(), 72);
}
