//! Tests that keys become actions in ticks, at any frame rate.

use bevy::{
    input::{
        ButtonState, InputPlugin,
        keyboard::{Key, KeyboardInput},
    },
    prelude::*,
    time::TimeUpdateStrategy,
};
use bevy_playbot::{episode::Tick, headless::set_fixed_step, key_bindings::KeyboardPlugin};
use playbot::prelude::*;
use playbot_tests::{Cell, corridor_plugin, spawn_walker};

/// Actions of the corridor.
const STAY: u32 = 2;

/// Returns a corridor with a person in it, and this many frames to a tick.
fn corridor(frames: u32) -> (App, Entity) {
    let mut app = headless_app();
    app.add_plugins((InputPlugin, KeyboardPlugin)).add_plugins(corridor_plugin);
    let step = set_fixed_step(&mut app, 10.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step / frames));
    let keys = KeyAxis::new([KeyCode::ArrowLeft], [KeyCode::ArrowRight]);
    let action = |at: &[i8]| ActionValue::Discrete([0, STAY, 1][(at[0] + 1) as usize]);
    let agent = spawn_walker(app.world_mut(), 0);
    app.world_mut().entity_mut(agent).insert((Control::Human, KeyBindings::new([keys], action, "arrow keys")));
    // The first frame only starts the clock.
    app.update();
    (app, agent)
}

fn key(app: &mut App, key_code: KeyCode, state: ButtonState) {
    let (logical_key, window) = (Key::Dead(None), Entity::PLACEHOLDER);
    app.world_mut().write_message(KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window });
}

fn cell(app: &App, agent: Entity) -> i32 {
    app.world().get::<Cell>(agent).expect("a walker").0
}

#[test]
fn a_tap_between_two_ticks_counts_once() {
    let (mut app, agent) = corridor(4);
    for _ in 0..4 {
        app.update();
    }
    assert_eq!((app.world().resource::<Tick>().0, cell(&app, agent)), (1, 4), "no key was pressed");
    key(&mut app, KeyCode::ArrowRight, ButtonState::Pressed);
    app.update();
    key(&mut app, KeyCode::ArrowRight, ButtonState::Released);
    for _ in 0..3 {
        app.update();
    }
    assert_eq!((app.world().resource::<Tick>().0, cell(&app, agent)), (2, 5), "the tap is not lost");
    for _ in 0..4 {
        app.update();
    }
    assert_eq!((app.world().resource::<Tick>().0, cell(&app, agent)), (3, 5), "and does not count twice");
}

#[test]
fn the_frame_rate_changes_nothing() {
    let play = |frames: u32| {
        let (mut app, agent) = corridor(frames);
        let mut path = Vec::new();
        for (press, release) in
            [(Some(KeyCode::ArrowLeft), None), (None, None), (Some(KeyCode::ArrowRight), Some(KeyCode::ArrowLeft))]
        {
            if let Some(code) = press {
                key(&mut app, code, ButtonState::Pressed);
            }
            if let Some(code) = release {
                key(&mut app, code, ButtonState::Released);
            }
            (0..frames).for_each(|_| app.update());
            path.push(cell(&app, agent));
        }
        path
    };
    assert_eq!(play(1), [3, 2, 3]);
    assert_eq!(play(5), play(1));
}

#[test]
fn keys_move_only_people() {
    let (mut app, agent) = corridor(1);
    app.world_mut().entity_mut(agent).insert((Control::Bot, BlindBot::Constant(ActionValue::Discrete(STAY))));
    key(&mut app, KeyCode::ArrowRight, ButtonState::Pressed);
    app.update();
    assert_eq!(cell(&app, agent), 4);
    app.world_mut().entity_mut(agent).insert(Control::Human);
    app.update();
    assert_eq!(cell(&app, agent), 5, "the key is still held");
}

#[test]
fn a_slow_frame_runs_one_tick() {
    let (mut app, _) = corridor(1);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(std::time::Duration::from_secs(9)));
    app.update();
    assert_eq!(app.world().resource::<Tick>().0, 1);
}
