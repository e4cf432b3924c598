//! Tests with Worlds that consist of rows only, each on a thread.

use crate::policy_batch::*;
use playbot_learner::{ActionSpace, DeviceKind, Learner as _, PolicySpec, PpoConfig, PpoLearner};

fn policy() -> Policy {
    let spec = PolicySpec { obs: 2.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
    PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex).expect("good settings").policy()
}

fn rows(world: usize, tick: usize) -> PolicyRows {
    let count = 1 + world % 3;
    let numbers = (0..2 * count).map(|i| (world * 100 + tick * 10 + i) as f32 * 0.01).collect();
    PolicyRows { observations: Observations::Vector(numbers), count, ..PolicyRows::default() }
}

/// Worlds that play `ticks(world)` ticks each.
fn play(worlds: usize, threads: usize, ticks: impl Fn(usize) -> usize + Sync) -> Vec<Vec<PolicyOutput>> {
    let policy = policy();
    std::thread::scope(|scope| {
        let ticks = &ticks;
        let play = |(world, seat): (usize, SharedBatch)| {
            scope.spawn(move || {
                let _playing = seat.play();
                let tick = |tick| {
                    let mut rows = rows(world, tick);
                    let output = seat.decide(&mut rows).expect("it can be computed");
                    assert_eq!(rows.count, output.len(), "its rows came back");
                    output
                };
                (0..ticks(world)).map(tick).collect::<Vec<_>>()
            })
        };
        let threads: Vec<_> = SharedBatch::seats(&policy, worlds, threads).into_iter().enumerate().map(play).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    })
}

#[test]
fn everybody_gets_what_it_would_get_alone() {
    let policy = policy();
    for (worlds, threads) in [(1, 1), (2, 1), (5, 2), (8, 8)] {
        let played = play(worlds, threads, |_| 20);
        for (world, outputs) in played.iter().enumerate() {
            for (tick, output) in outputs.iter().enumerate() {
                assert_eq!(*output, rows(world, tick).decide(&policy).expect("fits"), "world {world}, tick {tick}");
            }
        }
    }
}

#[test]
fn masks_hold_for_their_own_rows_in_shared_passes_too() {
    let policy = policy();
    let masked = PolicyRows { legal: vec![true, false, true, false, true, false], ..rows(1, 0) };
    assert_eq!((masked.count, rows(0, 0).count), (2, 1));
    let mut all = PolicyRows { observations: Observations::empty(&policy.observation()), ..PolicyRows::default() };
    for world in [&rows(0, 0), &masked, &rows(0, 1)] {
        all.append(world).expect("of one kind");
    }
    assert_eq!(all.legal[..3], [true; 3]);
    assert_eq!(all.legal[9..], [true; 3]);
    let outputs = all.decide(&policy).expect("fits").split(&[1, 2, 1]);
    assert_eq!(outputs[0], rows(0, 0).decide(&policy).expect("fits"), "without a mask");
    assert_eq!(outputs[1], masked.decide(&policy).expect("fits"));
    assert_eq!(outputs[1].greedy(1), playbot_learner::ActionValue::Discrete(1), "the only legal action");
}

#[test]
fn worlds_that_have_left_are_not_waited_for() {
    let played = play(7, 3, |world| 3 * world);
    assert_eq!(played.iter().map(Vec::len).collect::<Vec<_>>(), [0, 3, 6, 9, 12, 15, 18]);
}

#[test]
fn rows_that_do_not_fit_are_reported_to_all_of_the_group() {
    let policy = policy();
    let failed: Vec<String> = std::thread::scope(|scope| {
        let play = |(world, seat): (usize, SharedBatch)| {
            scope.spawn(move || {
                let _playing = seat.play();
                let mut rows = rows(world, 0);
                if world == 2 {
                    rows.observations = Observations::Vector(vec![0.0]);
                }
                seat.decide(&mut rows).err().unwrap_or_default()
            })
        };
        let threads: Vec<_> = SharedBatch::seats(&policy, 4, 1).into_iter().enumerate().map(play).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert!(failed[0].contains("observations") && failed[0] == failed[2], "{failed:?}");
    assert_eq!([&failed[1], &failed[3]], ["", ""], "the other group goes on");
}
