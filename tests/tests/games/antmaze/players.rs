//! Tests of demonstrator, person and policy.

use std::path::Path;

use bevy::prelude::*;
use bevy_playbot::policy::ActionDraw;
use playbot::prelude::*;
use playbot_games::{
    ant::{Ant, walk::Walker},
    antmaze::{AntMaze, DemonstratorBot},
};
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate, summarize},
    worlds::build_world,
};
use playbot_learner::{DeviceKind, PolicyFile};
use playbot_tests::measuring::plan;

use super::arena::place;

#[test]
fn demonstrations_follow_the_noise_that_is_asked_for() {
    let actions = |noise: f64| {
        let (mut world, agents) = build_world(&AntMaze, "umaze", 5, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, DemonstratorBot::new(noise), LevelQueue::Always(1)));
        let mut actions: Vec<f32> = Vec::new();
        for _ in 0..100 {
            world.tick().expect("sound");
            actions.extend(world.get::<Action>(agents[0]).and_then(Action::continuous).expect("continuous"));
        }
        actions
    };
    let (calm, noisy) = (actions(0.0), actions(0.2));
    assert_eq!(calm, actions(0.0));
    assert_ne!(calm, noisy);
    assert!(calm.iter().chain(&noisy).all(|torque| (-1.0..=1.0).contains(torque)));
}

/// Returns an app with keys in which a person has an ant.
fn keyboard_with(game: &dyn Game, mode: &str) -> (App, Entity) {
    let mut app = headless_app();
    game.build(&mut app, mode);
    app.init_resource::<ButtonInput<KeyCode>>();
    let agent = game.spawn_agent(app.world_mut(), 0);
    let keys = game.tools().input.key_bindings().expect("has keys");
    let still = Action(keys.action(|_| false));
    app.world_mut().entity_mut(agent).insert((Control::Human, still, keys, LevelQueue::Always(2)));
    (app, agent)
}

#[test]
fn keys_tell_the_walker_where_to_go() {
    for (key, axis, sign) in [(KeyCode::ArrowUp, 1, 1.0), (KeyCode::KeyD, 0, 1.0)] {
        let (mut app, agent) = keyboard_with(&AntMaze, "large");
        app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(key);
        app.ticks(30).expect("sound");
        let at = place(app.world(), agent);
        assert!(sign * at[axis] > 1.5, "{key:?} led to {at:?}");
    }
    let (mut app, agent) = keyboard_with(&Ant, "goal");
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::ArrowLeft);
    app.ticks(30).expect("sound");
    let at = app.world().get::<Walker>(agent).expect("an ant").body.torso().0;
    assert!(at.x < -1.5, "left led to {at}");
}

#[test]
fn the_demonstrator_walks_to_the_goal() {
    for (levels, least) in [("umaze:0..31", 0.9), ("medium:0..31", 0.8), ("random+goals=random:0..31", 0.8)] {
        let plan = EvalPlan { arenas: 32, ..plan(levels) };
        let episodes = evaluate(&AntMaze, &Player::Demonstrator, &plan, |_| {}).expect("sound");
        let summary = summarize("waypoints", &plan.split, &episodes);
        assert!(summary.success >= least, "{levels}: {summary:?}");
    }
}

#[test]
fn the_shipped_walker_reaches_goals_in_all_directions() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/models/ant-walker.safetensors");
    let policy = PolicyFile::load(&file, DeviceKind::default()).expect("shipped").policy;
    let plan = EvalPlan { arenas: 64, ..plan("goal:0..127") };
    let player = Player::Policy { policy, prior: None, draw: ActionDraw::Greedy };
    let trials = evaluate(&Ant, &player, &plan, |_| {}).expect("sound");
    let fallen = trials.iter().filter(|trial| trial.end == EpisodeEnd::Terminated { success: false }).count();
    // Goals are 8 m away, and reached within half a metre of them.
    let speeds: Vec<f64> =
        trials.iter().filter(|trial| trial.success).map(|trial| 7.5 / (0.1 * f64::from(trial.ticks))).collect();
    let speed = speeds.iter().sum::<f64>() / speeds.len() as f64;
    assert_eq!(trials.len(), 128);
    assert!(speeds.len() >= 116, "nine in ten: {} of 128", speeds.len());
    assert!(speed >= 0.8 && fallen <= 6, "{speed} m/s, {fallen} fell");
}
