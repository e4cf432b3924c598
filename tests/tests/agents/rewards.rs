//! Tests that rewards are counted once, whenever they are paid.

use std::time::Duration;

use bevy::{prelude::*, time::TimeUpdateStrategy};
use bevy_playbot::{headless::set_fixed_step, prelude::*, test_app::test_app};

/// Counted rewards of each tick.
#[derive(Resource, Default)]
struct Counted(Vec<f32>);

/// Length of an episode, ticks.
const LENGTH: u32 = 3;

fn app() -> (App, Entity) {
    let mut app = test_app();
    app.init_resource::<Counted>();
    let end = |mut episodes: Query<&mut Episode>| {
        for mut episode in &mut episodes {
            if episode.tick + 1 >= LENGTH {
                episode.truncate();
            }
        }
    };
    let note = |rewards: Query<&Reward>, mut counted: ResMut<Counted>| {
        counted.0.extend(rewards.iter().map(Reward::get));
    };
    app.add_systems(FixedUpdate, end)
        .add_systems(FixedPostUpdate, note.in_set(PlaybotSystems::Record).ambiguous_with_all());
    let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human)).id();
    (app, agent)
}

fn counted(app: &App) -> &[f32] {
    &app.world().resource::<Counted>().0
}

#[test]
fn a_reward_paid_in_update_counts_in_the_next_tick() {
    let (mut app, agent) = app();
    // A game in `Update`: it pays 1, 2, 4 after the ticks, and nothing after the last.
    let pay = |mut rewards: Query<(&mut Reward, &Episode)>| {
        for (mut reward, episode) in &mut rewards {
            if episode.is_running() {
                reward.add((1 << episode.tick) as f32);
            }
        }
    };
    app.add_systems(Update, pay);
    app.ticks(3).expect("sound");
    assert_eq!(counted(&app), [0.0, 2.0, 4.0]);
    assert_eq!(app.world().get::<EpisodeCount>(agent).expect("an agent").finished, 1);
    app.ticks(2).expect("nothing was paid between the episodes");
    assert_eq!(counted(&app)[3..], [0.0, 2.0]);
}

#[test]
fn every_payment_between_two_ticks_is_kept() {
    let (mut app, _) = app();
    let step = set_fixed_step(&mut app, 60.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step / 4 + Duration::from_nanos(1)));
    app.add_systems(Update, |mut rewards: Query<&mut Reward>, mut frames: Local<u32>| {
        *frames += 1;
        // The first frame starts the clock; the tick is in the fifth.
        if (6..9).contains(&*frames) {
            rewards.iter_mut().for_each(|mut reward| reward.add(1.0));
        }
    });
    (0..9).for_each(|_| app.update());
    assert_eq!(counted(&app), [0.0, 3.0], "those of the frames without a tick");
}

#[test]
fn a_reward_after_the_end_of_its_episode_is_a_fault() {
    let (mut app, agent) = app();
    app.ticks(u64::from(LENGTH)).expect("sound");
    app.world_mut().get_mut::<Reward>(agent).expect("an agent").add(5.0);
    let fault = app.tick().expect_err("too late").to_string();
    for words in ["agent 0", "a reward of 5", "when the episode had ended"] {
        assert!(fault.contains(words), "{fault}");
    }
    app.tick().expect("said once");
    assert_eq!(counted(&app), [0.0; 5], "and counted in no episode");
}

#[test]
fn a_level_that_was_left_takes_its_rewards_with_it() {
    let (mut app, agent) = app();
    app.tick().expect("sound");
    let mut agent = app.world_mut().entity_mut(agent);
    agent.get_mut::<Reward>().expect("an agent").add(5.0);
    agent.get_mut::<Episode>().expect("an agent").abandon();
    app.tick().expect("no fault: it was not ended");
    assert_eq!(counted(&app), [0.0, 0.0]);
}
