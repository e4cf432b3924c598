//! An app whose agent plays a script of actions, and a game that notes its input.

use std::time::Duration;

use bevy::{input::InputPlugin, prelude::*, time::TimeUpdateStrategy};
use bevy_playbot::{
    engine::set_tick_rate,
    prelude::*,
    test_app::test_app,
    virtual_input::{InputRoute, VirtualInput, VirtualInputPlugin},
};

pub const STEP: Duration = Duration::from_millis(16);

/// The actions of the ticks to come; the last one stays.
#[derive(Resource)]
pub struct Script(pub Vec<ActionValue>);

fn follow(mut script: ResMut<Script>, mut agents: Query<(&Control, &Episode, &mut Action)>) {
    for (control, episode, mut action) in &mut agents {
        if *control == Control::Bot && episode.is_running() {
            action.0 = script.0[0].clone();
            if script.0.len() > 1 {
                script.0.remove(0);
            }
        }
    }
}

/// Describes the game's view of the key in one run of its system: `P`ressed, `d`own just now, `u`p just now.
fn read(keys: &ButtonInput<KeyCode>) -> String {
    let mut text = String::new();
    let key = KeyCode::ArrowLeft;
    for (mark, is) in [('P', keys.pressed(key)), ('d', keys.just_pressed(key)), ('u', keys.just_released(key))] {
        if is {
            text.push(mark);
        }
    }
    text
}

#[derive(Resource, Default)]
pub struct InTicks(pub Vec<String>);

#[derive(Resource, Default)]
pub struct InFrames(pub Vec<String>);

pub fn app_with(route: InputRoute, input: VirtualInput, script: Vec<ActionValue>) -> (App, Entity) {
    let mut app = test_app();
    app.add_plugins((InputPlugin, VirtualInputPlugin { route }))
        .insert_resource(Script(script))
        .init_resource::<InTicks>()
        .init_resource::<InFrames>()
        .add_systems(FixedPreUpdate, follow.in_set(PlaybotSystems::Decide).ambiguous_with_all())
        .add_systems(FixedUpdate, |keys: Res<ButtonInput<KeyCode>>, mut seen: ResMut<InTicks>| seen.0.push(read(&keys)))
        .add_systems(Update, |keys: Res<ButtonInput<KeyCode>>, mut seen: ResMut<InFrames>| seen.0.push(read(&keys)));
    set_tick_rate(&mut app, 1.0 / STEP.as_secs_f64());
    app.insert_resource(Time::<Fixed>::from_duration(STEP));
    frames_of(&mut app, STEP);
    let agent = app.world_mut().spawn((Agent::new(0, input.space()), input, Control::Bot)).id();
    // The first frame only starts the clock.
    app.update();
    app.world_mut().resource_mut::<InFrames>().0.clear();
    (app, agent)
}

pub fn frames_of(app: &mut App, length: Duration) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(length));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(1));
}

pub fn left() -> VirtualInput {
    VirtualInput::keys([vec![], vec![KeyCode::ArrowLeft]])
}

pub fn actions(list: &[u32]) -> Vec<ActionValue> {
    list.iter().map(|&index| ActionValue::Discrete(index)).collect()
}

pub fn ticks(app: &App) -> &[String] {
    &app.world().resource::<InTicks>().0
}

pub fn frames(app: &App) -> &[String] {
    &app.world().resource::<InFrames>().0
}
