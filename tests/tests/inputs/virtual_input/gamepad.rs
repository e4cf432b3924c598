//! Tests of gamepads.

use bevy::{
    input::gamepad::{
        GamepadAxisChangedEvent, GamepadButtonChangedEvent, GamepadButtonStateChangedEvent, GamepadEvent,
        RawGamepadButtonChangedEvent,
    },
    prelude::*,
};
use bevy_playbot::{
    prelude::*,
    virtual_input::{ActionAxis, InputRoute, VirtualGamepad, VirtualInput},
};

use super::scripted::{STEP, Script, app_with, frames_of};

#[test]
fn an_agent_plays_on_a_gamepad_of_its_own() {
    for route in [InputRoute::Direct, InputRoute::Messages] {
        let pad = |index: u32| {
            let input = VirtualInput::axes([
                ActionAxis::stick(GamepadAxis::LeftStickX),
                ActionAxis::buttons([GamepadButton::West], [GamepadButton::South]),
                ActionAxis::trigger(GamepadButton::RightTrigger2),
            ]);
            (Agent::new(index, input.space()), input, Control::Bot)
        };
        let (mut app, first) = app_with(route, pad(0).1, vec![ActionValue::Continuous(vec![-0.5, 1.0, 0.9])]);
        let second = app.world_mut().spawn(pad(1)).id();
        // One frame to plug it in, and one for the action of the tick before.
        (0..4).for_each(|_| app.update());
        let mut pads = app.world_mut().query::<(&VirtualGamepad, &Gamepad)>();
        let owners: Vec<Entity> = pads.iter(app.world()).map(|(owner, _)| owner.agent).collect();
        assert!(owners.len() == 2 && owners.contains(&first) && owners.contains(&second), "{route:?}");
        for (_, pad) in pads.iter(app.world()) {
            assert_eq!(pad.get(GamepadAxis::LeftStickX), Some(-0.5), "{route:?}");
            assert!(pad.pressed(GamepadButton::South) && !pad.pressed(GamepadButton::West), "{route:?}");
            assert!(pad.pressed(GamepadButton::RightTrigger2), "{route:?}");
        }
        app.world_mut().entity_mut(first).insert(Control::Idle);
        app.world_mut().entity_mut(second).despawn();
        (0..2).for_each(|_| app.update());
        let pads: Vec<_> = pads.iter(app.world()).collect();
        let [(owner, pad)] = pads.as_slice() else { panic!("{route:?}: {} gamepads", pads.len()) };
        assert_eq!(owner.agent, first);
        assert_eq!((pad.get(GamepadAxis::LeftStickX), pad.get_pressed().count()), (Some(0.0), 0), "{route:?}");
    }
}

/// The game's gamepad events in each fixed tick.
#[derive(Resource, Default)]
struct Heard(Vec<Vec<String>>);

fn hear(
    mut all: MessageReader<GamepadEvent>,
    mut states: MessageReader<GamepadButtonStateChangedEvent>,
    mut raw: MessageReader<RawGamepadButtonChangedEvent>,
    mut buttons: MessageReader<GamepadButtonChangedEvent>,
    mut axes: MessageReader<GamepadAxisChangedEvent>,
    mut heard: ResMut<Heard>,
) {
    let event = |event: &GamepadEvent| match event {
        GamepadEvent::Button(event) => Some(format!("{:?} {:?} {}", event.button, event.state, event.value)),
        GamepadEvent::Axis(event) => Some(format!("{:?} {}", event.axis, event.value)),
        GamepadEvent::Connection(_) => None,
    };
    let mut tick: Vec<String> = all.read().filter_map(event).collect();
    tick.extend(states.read().map(|event| format!("now {:?}", event.state)));
    tick.extend(raw.read().map(|event| format!("raw {}", event.value)));
    tick.push(format!("{} and {}", buttons.read().count(), axes.read().count()));
    heard.0.push(tick);
}

/// Returns a stick, and a button that is pressed.
fn pushed(stick: f32, button: f32) -> ActionValue {
    ActionValue::Continuous(vec![stick, button])
}

/// Returns an app in fixed ticks whose agent has plugged its gamepad in, and pushes `first`.
fn hearing(first: ActionValue) -> (App, Entity) {
    let input = VirtualInput::axes([
        ActionAxis::stick(GamepadAxis::LeftStickX),
        ActionAxis::buttons([GamepadButton::West], [GamepadButton::South]),
    ]);
    let (mut app, agent) = app_with(InputRoute::Direct, input, vec![first]);
    app.init_resource::<Heard>().add_systems(FixedUpdate, hear.ambiguous_with_all());
    (0..4).for_each(|_| app.update());
    app.world_mut().resource_mut::<Heard>().0.clear();
    (app, agent)
}

#[test]
fn each_fixed_tick_hears_its_own_messages_of_a_gamepad_and_hears_them_once() {
    let (mut app, _) = hearing(pushed(0.0, 0.0));
    app.world_mut().resource_mut::<Script>().0 = vec![pushed(0.0, 1.0), pushed(0.0, 0.0), pushed(1.0, 0.0)];
    frames_of(&mut app, STEP * 3);
    app.update();
    frames_of(&mut app, STEP);
    (0..2).for_each(|_| app.update());
    let expected: [&[&str]; 5] = [
        &["South Pressed 1", "now Pressed", "raw 1", "1 and 0"],
        &["South Released 0", "now Released", "raw 0", "1 and 0"],
        &["LeftStickX 1", "0 and 1"],
        &["0 and 0"],
        &["0 and 0"],
    ];
    assert_eq!(app.world().resource::<Heard>().0, expected);
}

#[test]
fn a_gamepad_is_heard_to_be_let_go_of_between_two_episodes() {
    let (mut app, agent) = hearing(pushed(0.0, 1.0));
    app.world_mut().get_mut::<Episode>(agent).expect("an agent").terminate(true);
    // Both ticks lie in one frame, and Bevy's own system runs in the next.
    frames_of(&mut app, STEP * 2);
    app.update();
    frames_of(&mut app, STEP);
    app.update();
    let expected: [&[&str]; 3] = [
        &["0 and 0"],
        &["South Released 0", "South Pressed 1", "now Released", "now Pressed", "raw 0", "raw 1", "2 and 0"],
        &["0 and 0"],
    ];
    assert_eq!(app.world().resource::<Heard>().0, expected);
}
