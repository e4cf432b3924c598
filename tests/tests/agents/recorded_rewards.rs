//! Tests of rewards of recordings that are trained on: the game's present rewards, if it still is the recorded game.

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use bevy_playbot::{
    action::{ActionSpace, Actions},
    demo::{
        file::{Decider, DemoEnd, DemoEpisode, DemoReader, DemoWriter},
        replay::Divergence,
    },
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_harness::demo::VerifyError;
use playbot_learner::Rollout;
use playbot_tests::{Corridor, recording::record_random};
use playbot_train::demo::Demonstrations;

/// Writes a recording of a random walker, with each episode changed.
fn recorded(path: &Path, change: impl Fn(usize, &mut DemoEpisode)) {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole.demo");
    record_random(&Corridor, "plain", 5, &whole, 16..46);
    let mut writer = DemoWriter::create(path, Corridor.demo_header("plain")).expect("fresh");
    let episodes = DemoReader::open(&whole).expect("readable").read_all().expect("whole");
    for (index, mut episode) in episodes.into_iter().enumerate() {
        change(index, &mut episode);
        writer.push(&episode).expect("writable");
    }
}

/// Returns the rollouts of a recording with this change, with the name of its file.
fn rollouts(change: impl Fn(usize, &mut DemoEpisode)) -> Result<Vec<Rollout>, VerifyError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    recorded(&path, change);
    let demos = Demonstrations::read(&Corridor, &ObservationConfig::default(), &path, None).expect("readable");
    demos.rollouts(&Corridor, 2, |_| {})
}

#[test]
fn recordings_without_rewards_or_with_others_earn_what_is_paid_now() {
    let expected = rollouts(|_, _| {}).expect("they replay");
    assert_eq!(expected.len(), 30);
    let paid = |rollout: &Rollout| rollout.rewards.iter().sum::<f32>();
    assert!(expected.iter().any(|rollout| paid(rollout) == 1.0), "somebody has found the exit");
    let unpaid = rollouts(|_, episode| episode.rewards.fill(0.0)).expect("the states are the same");
    assert_eq!(unpaid, expected);
    let others = rollouts(|index, episode| episode.rewards.iter_mut().for_each(|reward| *reward += index as f32));
    assert_eq!(others.expect("the states are the same"), expected);
}

#[test]
fn recordings_of_other_states_or_ends_are_refused_by_name() {
    let refused = |change: fn(usize, &mut DemoEpisode), words: &str| {
        let error = rollouts(change).expect_err("another game").to_string();
        for part in ["walk.demo: episode 7 does not replay", words, "record it again"] {
            assert!(error.contains(part), "{error}");
        }
    };
    refused(|index, episode| episode.state_hashes[1] ^= u32::from(index == 7), "tick 1: the state hash is");
    refused(
        |index, episode| {
            if index == 7 {
                let is_over = matches!(episode.end, DemoEnd::Terminated { .. });
                episode.end = if is_over { DemoEnd::Truncated } else { DemoEnd::Terminated { success: true } };
            }
        },
        "the episode's end is",
    );
}

/// Returns the divergence of three ticks without rewards in the recording, of which the second now pays a point, in a
/// game that hashes its states or does not.
fn divergence(hash: u32, replay: fn(Replay) -> Replay) -> Option<Divergence> {
    let mut episode = DemoEpisode::new(7, ActionSpace::Discrete(2));
    episode.actions = Actions::Discrete(vec![1, 0, 1]);
    (episode.rewards, episode.state_hashes, episode.deciders) = (vec![0.0; 3], vec![hash; 3], vec![Decider::Bot; 3]);
    let mut app = headless_app();
    app.add_systems(FixedUpdate, move |mut agents: Query<(&Episode, &mut Reward, &mut StateHash)>| {
        for (episode, mut reward, mut state) in &mut agents {
            reward.add(if episode.tick == 1 { 1.0 } else { 0.0 });
            state.0 = u64::from(hash);
        }
    });
    let agent = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
    replay(Replay::new(Arc::new(episode))).start(&mut app.world_mut().entity_mut(agent));
    app.ticks(3).expect("no agent broke its contract");
    app.world().get::<Replay>(agent).and_then(Replay::divergence).cloned()
}

#[test]
fn rewards_count_where_nothing_else_tells_games_apart() {
    let what = |divergence: Option<Divergence>| divergence.map(|divergence| divergence.to_string());
    let reward = Some("level 7, tick 1: the reward is 1, but 0 in the recording".to_owned());
    assert_eq!(what(divergence(5, |replay| replay)), reward);
    assert_eq!(what(divergence(5, Replay::paid_anew)), None, "the states are the recorded ones");
    assert_eq!(what(divergence(0, Replay::paid_anew)), reward, "no state was hashed");
}
