//! A person's gamepads, kept from the game while another decider plays it.
//!
//! Their input arrives within a frame, after the window's messages, and each message names its gamepad: those of
//! virtual input are let through.

use bevy::{
    input::{
        InputSystems,
        gamepad::{
            Gamepad, GamepadInput, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent, RawGamepadEvent,
            gamepad_connection_system, gamepad_event_processing_system,
        },
    },
    prelude::*,
};
use bevy_playbot::virtual_input::VirtualGamepad;

use super::devices::Devices;

pub(super) fn build(app: &mut App) {
    app.add_message::<RawGamepadEvent>()
        .add_message::<RawGamepadButtonChangedEvent>()
        .add_message::<RawGamepadAxisChangedEvent>()
        .add_systems(
            PreUpdate,
            (let_go.run_if(resource_changed::<Devices>), keep_events, keep_buttons, keep_axes)
                .in_set(InputSystems)
                .before(gamepad_connection_system)
                .before(gamepad_event_processing_system)
                .run_if(resource_equals(Devices::Kept)),
        );
}

/// Lets go of all buttons of gamepads that have just been kept away.
fn let_go(mut gamepads: Query<&mut Gamepad, Without<VirtualGamepad>>) {
    for mut gamepad in &mut gamepads {
        gamepad.digital_mut().release_all();
        let moved: Vec<GamepadInput> = gamepad.get_analog_axes().copied().collect();
        for input in moved {
            gamepad.analog_mut().set(input, 0.0);
        }
    }
}

type VirtualGamepads<'w, 's> = Query<'w, 's, (), With<VirtualGamepad>>;

fn keep_events(events: ResMut<Messages<RawGamepadEvent>>, virtual_gamepads: VirtualGamepads) {
    keep(events, |event| match event {
        // A game may show the connected gamepads; only their input is kept from it.
        RawGamepadEvent::Connection(_) => true,
        RawGamepadEvent::Button(change) => virtual_gamepads.contains(change.gamepad),
        RawGamepadEvent::Axis(change) => virtual_gamepads.contains(change.gamepad),
    });
}

fn keep_buttons(events: ResMut<Messages<RawGamepadButtonChangedEvent>>, virtual_gamepads: VirtualGamepads) {
    keep(events, |change| virtual_gamepads.contains(change.gamepad));
}

fn keep_axes(events: ResMut<Messages<RawGamepadAxisChangedEvent>>, virtual_gamepads: VirtualGamepads) {
    keep(events, |change| virtual_gamepads.contains(change.gamepad));
}

/// Drops messages that are not let through. Messages from before this frame have been read.
fn keep<M: Message + Clone>(mut events: ResMut<Messages<M>>, is_let_through: impl Fn(&M) -> bool) {
    if events.iter_current_update_messages().all(&is_let_through) {
        return;
    }
    let rest: Vec<M> = events.iter_current_update_messages().filter(|event| is_let_through(event)).cloned().collect();
    events.clear();
    events.write_batch(rest);
}

#[cfg(test)]
mod tests {
    use bevy::input::{
        InputPlugin,
        gamepad::{GamepadConnection, GamepadConnectionEvent},
    };

    use super::*;

    /// Input of the next frame, as from a plugin: gamepad and value.
    #[derive(Resource, Default)]
    struct Next(Vec<(Entity, f32)>);

    fn press(world: &mut World) {
        for (gamepad, value) in std::mem::take(&mut world.resource_mut::<Next>().0) {
            let south = RawGamepadButtonChangedEvent { gamepad, button: GamepadButton::South, value };
            let stick = RawGamepadAxisChangedEvent { gamepad, axis: GamepadAxis::LeftStickX, value };
            world.write_message(RawGamepadEvent::Button(south));
            world.write_message(RawGamepadEvent::Axis(stick));
            world.write_message(south);
            world.write_message(stick);
        }
    }

    fn plug_in(world: &mut World, pad: Entity) {
        let connection = GamepadConnection::Connected { name: "pad".into(), vendor_id: None, product_id: None };
        let event = GamepadConnectionEvent { gamepad: pad, connection };
        world.write_message(event.clone());
        world.write_message(RawGamepadEvent::Connection(event));
    }

    #[test]
    fn a_persons_gamepad_rests_while_it_is_kept_and_virtual_ones_play() {
        let mut app = App::new();
        app.add_plugins(InputPlugin).insert_resource(Devices::Open).init_resource::<Next>();
        app.add_systems(PreUpdate, press.before(InputSystems));
        build(&mut app);
        let world = app.world_mut();
        let real = world.spawn_empty().id();
        let agent = world.spawn_empty().id();
        let own = world.spawn(VirtualGamepad { agent }).id();
        [real, own].into_iter().for_each(|pad| plug_in(world, pad));
        app.update();
        let play = |app: &mut App, devices: Devices, pressed: &[(Entity, f32)]| {
            app.insert_resource(devices);
            app.world_mut().resource_mut::<Next>().0 = pressed.to_vec();
            app.update();
            [real, own].map(|pad| {
                let pad = app.world().get::<Gamepad>(pad).expect("plugged in");
                (pad.pressed(GamepadButton::South), pad.get(GamepadAxis::LeftStickX).unwrap_or(0.0))
            })
        };

        assert_eq!(play(&mut app, Devices::Open, &[(real, 1.0), (own, 1.0)]), [(true, 1.0), (true, 1.0)]);
        assert_eq!(play(&mut app, Devices::Kept, &[]), [(false, 0.0), (true, 1.0)], "let go of");
        assert_eq!(play(&mut app, Devices::Kept, &[(real, 1.0), (own, 0.0)]), [(false, 0.0), (false, 0.0)], "kept");
        assert_eq!(play(&mut app, Devices::Open, &[(real, 1.0)]), [(true, 1.0), (false, 0.0)]);
    }
}
