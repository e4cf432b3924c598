//! Arenas with pictures, and playing in them.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
};
use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;

pub const RIGHT: u32 = 7;

pub const NOTHING: u32 = 4;

pub const JUMP: u32 = 5;

pub const LEFT: u32 = 1;

/// Returns arenas with pictures, whose observing systems must not be in an ambiguous order.
pub fn drawn(mode: &str, agents: u32) -> (App, Vec<Entity>) {
    let mut app = headless_app();
    app.edit_schedule(ObserveSchedule, |schedule| {
        schedule.set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    });
    let game = CoinRun::default();
    game.build(&mut app, mode);
    game.tools().pictures.build_picture(&mut app);
    let agents = (0..agents).map(|index| game.spawn_agent(app.world_mut(), index)).collect();
    (app, agents)
}

pub fn play(world: &mut World, agent: Entity, level: u64) {
    world.entity_mut(agent).insert((Control::Human, LevelQueue::Always(level)));
}

pub fn press(world: &mut World, agent: Entity, action: u32, ticks: u32) {
    for _ in 0..ticks {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(action)));
        world.tick().expect("sound");
    }
}

/// Updates the picture to the state after the last tick.
pub fn update_picture(world: &mut World) {
    world.run_schedule(ObserveSchedule);
}

pub fn sprite(world: &World, entity: Entity) -> &Sprite {
    world.get(entity).expect("drawn")
}
