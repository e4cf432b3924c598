//! Gamepads.

use bevy::prelude::*;
use bevy_playbot::{
    prelude::*,
    virtual_input::{ActionAxis, InputRoute, VirtualGamepad, VirtualInput},
};

use super::scripted::app_with;

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
