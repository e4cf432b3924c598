//! Episodes of a game's demonstrator under one detector, for tests.

use bevy::prelude::*;
use bevy_playbot::test_app::test_app;
use playbot_harness::{
    defect::{ChangeRules, Plant},
    detector::{Detector, DetectorTick, LevelAhead},
    prelude::*,
};
use std::sync::Arc;

/// Returns a game's defect of the rules with this name.
pub(crate) fn planted(game: &dyn Game, class: &str) -> Arc<ChangeRules> {
    let kind =
        game.tools().tests.defects().into_iter().find(|kind| kind.class == class).expect("there is such a defect");
    match kind.plant {
        Plant::Rules { plant, .. } => plant,
        Plant::Level(_) => panic!("`{class}` is a defect of levels"),
    }
}

/// Returns the first finding of a detector in an episode of the demonstrator, in at most `ticks` ticks: the tick, and
/// its message. `noise` is the standard deviation of the noise on its actions, and `plant` a defect of the rules with
/// its variant.
pub(crate) fn first_finding(
    game: &dyn Game,
    mode: &str,
    level: u64,
    plant: Option<(&ChangeRules, u32)>,
    detector: &dyn Detector,
    noise: f64,
    ticks: u32,
) -> Option<(u32, String)> {
    let mut app = test_app();
    game.build(&mut app, mode);
    if let Some((plant, variant)) = plant {
        plant(&mut app, variant);
    }
    let agent = game.spawn_agent(app.world_mut(), 0);
    app.world_mut().entity_mut(agent).insert((Control::Bot, LevelQueue::list([level])));
    game.tools().bots.attach_demonstrator(app.world_mut(), agent, noise);
    let plan = game.tools().levels.floor_plan(mode, level);
    let mut watch = detector.watch(&LevelAhead { level, plan }).expect("it looks at every level");
    for tick in 0..ticks {
        app.tick().expect("sound");
        let world = app.world();
        let is_over = world.get::<EpisodeCount>(agent)?.finished > 0;
        let moment = DetectorTick {
            agent,
            level,
            tick,
            reward: world.get::<Reward>(agent)?.get(),
            position: game.tools().state.position(world, agent),
            ..DetectorTick::of(world, &world.get::<Action>(agent)?.0)
        };
        if let Some(words) = watch.tick(&moment) {
            return Some((tick, words));
        }
        if is_over {
            break;
        }
    }
    None
}
