//! Tests of episodes: start, end, counting, and deciders.

use bevy::prelude::*;
use bevy_playbot::test_app::{PlaybotTestExt, test_app};
use playbot::prelude::*;
use playbot_tests::{Cell, PoisonAt, corridor_plugin, spawn_walker};

#[derive(Resource, Default)]
struct Ends(Vec<EpisodeEnded>);

fn app_with(action: u32, levels: &[u64]) -> (App, Entity) {
    let mut app = test_app();
    corridor_plugin(&mut app);
    app.init_resource::<Ends>();
    app.add_observer(|event: On<EpisodeEnded>, mut ends: ResMut<Ends>| ends.0.push(*event));
    let agent = spawn_walker(app.world_mut(), 0);
    app.world_mut().entity_mut(agent).insert((
        Control::Bot,
        BlindBot::Constant(ActionValue::Discrete(action)),
        LevelQueue::list(levels.to_vec()),
    ));
    (app, agent)
}

#[test]
fn termination_and_truncation_are_distinguished() {
    for (action, end, ticks, total) in [
        (1, EpisodeEnd::Terminated { success: true }, 3, 1.0),
        (0, EpisodeEnd::Terminated { success: false }, 3, 0.0),
        (2, EpisodeEnd::Truncated, 20, 0.0),
    ] {
        let (mut app, _) = app_with(action, &[1]);
        app.play_episodes(1, 30).expect("ends in time");
        let ended = &app.world().resource::<Ends>().0;
        assert_eq!(ended.len(), 1);
        assert_eq!((ended[0].end, ended[0].ticks, ended[0].total_reward), (end, ticks, total));
    }
}

/// Reports at tick 5 that the goal is reached, and from then on that actions are clipped.
fn reach(mut episodes: Query<&mut Episode>) {
    for mut episode in &mut episodes {
        if episode.tick == 5 {
            episode.reach();
        }
        if episode.tick >= 5 {
            episode.note_clipped();
        }
    }
}

#[test]
fn a_goal_reached_before_time_was_up_is_a_success_and_no_termination() {
    for (reaches, success, clipped) in [(true, true, 15), (false, false, 0)] {
        let (mut app, agent) = app_with(2, &[1, 1]);
        app.add_systems(FixedPostUpdate, reach.before(PlaybotSystems::Judge).run_if(move || reaches));
        app.play_episodes(2, 50).expect("ends in time");
        let ended = &app.world().resource::<Ends>().0;
        assert!(ended.iter().all(|ended| ended.end == EpisodeEnd::Truncated && ended.ticks == 20));
        assert!(ended.iter().all(|ended| (ended.success, ended.clipped) == (success, clipped)), "of each episode anew");
        let count = app.world().get::<EpisodeCount>(agent).expect("an agent");
        assert_eq!((count.finished, count.successes), (2, 2 * u64::from(success)));
    }
}

#[test]
fn levels_are_played_in_order_and_then_the_agent_idles() {
    let (mut app, agent) = app_with(1, &[1, 2, 5]);
    app.play_episodes(99, 100).expect("idles");
    let ended: Vec<_> = app.world().resource::<Ends>().0.iter().map(|end| (end.level, end.ticks)).collect();
    assert_eq!(ended, [(1, 3), (2, 2), (5, 3)]);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Idle));
}

#[test]
fn control_can_change_hands_in_the_middle_of_an_episode() {
    let (mut app, agent) = app_with(1, &[1]);
    app.tick().expect("sound");
    app.world_mut().entity_mut(agent).insert((Control::Human, Action(ActionValue::Discrete(0))));
    app.tick().expect("sound");
    assert_eq!(app.world().get::<Cell>(agent).expect("a walker").0, 3);
    app.world_mut().entity_mut(agent).insert(Control::Idle);
    app.ticks(50).expect("sound");
    assert_eq!(app.world().get::<Episode>(agent).expect("an agent").tick, 2, "an idle agent's time stands still");
    app.world_mut().entity_mut(agent).insert(Control::Bot);
    app.play_episodes(1, 10).expect("goes on");
    assert_eq!(app.world().resource::<Ends>().0[0].ticks, 5);
}

#[test]
fn nan_in_an_observation_names_agent_level_tick_and_value() {
    let (mut app, _) = app_with(1, &[7]);
    app.insert_resource(PoisonAt(2));
    app.ticks(2).expect("sound so far");
    let fault = app.tick().expect_err("poisoned").to_string();
    for part in ["agent 0", "level 7", "tick 2", "`x`", "NaN"] {
        assert!(fault.contains(part), "`{part}` is missing in: {fault}");
    }
}

#[test]
fn an_action_outside_its_space_is_reported() {
    let (mut app, agent) = app_with(1, &[7]);
    app.world_mut().entity_mut(agent).insert((Control::Human, Action(ActionValue::Discrete(9))));
    let fault = app.tick().expect_err("no such action").to_string();
    assert!(fault.contains("agent 0") && fault.contains("action 9 is outside of the numbers from 0 to 2"), "{fault}");
}

#[test]
fn an_observation_of_the_wrong_length_is_reported() {
    let (mut app, agent) = app_with(1, &[7]);
    app.world_mut().entity_mut(agent).insert(VectorSensor::new(["x", "time", "colour"]));
    let fault = app.tick().expect_err("one value is missing").to_string();
    assert!(fault.contains("the observation has 2 values, its sensor names 3"), "{fault}");
}

#[test]
fn the_same_seed_plays_the_same_game() {
    let trace = |seed: u64| {
        let (mut app, agent) = app_with(1, &[]);
        app.insert_resource(PlaybotSeed(seed));
        app.world_mut().entity_mut(agent).insert((BlindBot::Uniform, LevelQueue::Uniform { first: 0, last: 9 }));
        app.hash_trace(200).expect("sound")
    };
    assert_eq!(trace(1), trace(1));
    assert_ne!(trace(1), trace(2));
}
