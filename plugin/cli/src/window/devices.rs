//! The person's devices, kept from the game or handed on to it.
//!
//! Between two frames the window system writes its messages into empty lists, while those of the game are stashed. This
//! keeps the person's input apart from virtual input, message by message.

use crate::window::deciders::OwnKeys;
use bevy::{
    input::{
        InputSystems,
        gamepad::{
            Gamepad, GamepadInput, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent, RawGamepadEvent,
            gamepad_connection_system, gamepad_event_processing_system,
        },
        keyboard::{Key, KeyboardFocusLost, KeyboardInput},
        mouse::{MouseButtonInput, MouseMotion, MouseWheel},
    },
    prelude::*,
    window::{CursorMoved, PrimaryWindow, WindowEvent, WindowFocused},
};
use bevy_playbot::virtual_input::VirtualGamepad;
use std::hash::Hash;

/// Visibility of the person's devices for the game.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub(super) enum Devices {
    /// It sees them as they are.
    Open,
    /// The game sees none of their input.
    Kept,
}

/// The stashed messages: between frames the game's, in frames an empty list.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
struct StashedMessages<M: Message>(#[reflect(ignore)] Messages<M>);

pub(super) fn build(app: &mut App) {
    app.init_resource::<OwnKeys>();
    add_stash::<KeyboardInput>(app);
    add_stash::<KeyboardFocusLost>(app);
    add_stash::<MouseButtonInput>(app);
    add_stash::<MouseMotion>(app);
    add_stash::<MouseWheel>(app);
    add_stash::<CursorMoved>(app);
    add_stash::<WindowFocused>(app);
    add_stash::<WindowEvent>(app);
}

fn add_stash<M: Message + TypePath>(app: &mut App) {
    app.add_message::<M>()
        .insert_resource(StashedMessages::<M>(Messages::default()))
        .register_type::<StashedMessages<M>>();
}

/// Reads the person's keys at the start of a frame, and hands on the messages that the game may see.
pub(super) fn take(world: &mut World) {
    let is_open = *world.resource::<Devices>() == Devices::Open;
    let keys: Vec<KeyboardInput> = lift(world);
    let focus: Vec<WindowFocused> = lift(world);
    let mut own = world.resource_mut::<OwnKeys>();
    own.clear();
    for key in &keys {
        if key.state.is_pressed() {
            own.press(key.key_code);
        } else {
            own.release(key.key_code);
        }
    }
    // Without focus no key of this window is held.
    if focus.iter().any(|change| !change.focused) {
        own.release_all();
    }
    hand_on(world, keys, is_open);
    hand_on(world, focus, is_open);
    // Bevy answers the loss of focus by letting go of keys, which virtual input goes on holding.
    let lost: Vec<KeyboardFocusLost> = lift(world);
    if is_open && !lost.is_empty() {
        // Bevy lets go of physical keys only.
        release_all::<Key>(world);
    }
    hand_on(world, lost, is_open);
    take_all::<MouseButtonInput>(world, is_open);
    take_all::<MouseMotion>(world, is_open);
    take_all::<MouseWheel>(world, is_open);
    take_all::<CursorMoved>(world, is_open);
    let events: Vec<WindowEvent> = lift(world);
    hand_on(world, events.into_iter().filter(|event| is_open || !is_of_person(event)).collect(), true);
    if !is_open {
        forget_cursor(world);
    }
}

/// Makes room for the window system's messages at the end of a frame.
pub(super) fn give_back(world: &mut World) {
    swap::<KeyboardInput>(world);
    swap::<KeyboardFocusLost>(world);
    swap::<MouseButtonInput>(world);
    swap::<MouseMotion>(world);
    swap::<MouseWheel>(world);
    swap::<CursorMoved>(world);
    swap::<WindowFocused>(world);
    swap::<WindowEvent>(world);
}

/// Opens the devices to the game, or keeps them from it, which then sees them at rest.
pub(super) fn set(world: &mut World, devices: Devices) {
    if *world.resource::<Devices>() == devices {
        return;
    }
    world.insert_resource(devices);
    release_all::<KeyCode>(world);
    release_all::<Key>(world);
    release_all::<MouseButton>(world);
}

fn release_all<T: Clone + Eq + Hash + Send + Sync + 'static>(world: &mut World) {
    if let Some(mut input) = world.get_resource_mut::<ButtonInput<T>>() {
        input.release_all();
    }
}

fn swap<M: Message>(world: &mut World) {
    world.resource_scope(|world, mut stash: Mut<StashedMessages<M>>| {
        std::mem::swap(&mut stash.0, &mut *world.resource_mut::<Messages<M>>());
    });
}

/// Brings the game's messages back, and returns those of the window system.
fn lift<M: Message>(world: &mut World) -> Vec<M> {
    swap::<M>(world);
    world.resource_mut::<StashedMessages<M>>().0.drain().collect()
}

fn hand_on<M: Message>(world: &mut World, messages: Vec<M>, is_open: bool) {
    if is_open && !messages.is_empty() {
        world.resource_mut::<Messages<M>>().write_batch(messages);
    }
}

fn take_all<M: Message>(world: &mut World, is_open: bool) {
    let messages: Vec<M> = lift(world);
    hand_on(world, messages, is_open);
}

/// Returns true if the event is input to the game, and not to the window.
fn is_of_person(event: &WindowEvent) -> bool {
    use WindowEvent as Event;
    matches!(
        event,
        Event::KeyboardInput(_)
            | Event::KeyboardFocusLost(_)
            | Event::MouseButtonInput(_)
            | Event::MouseMotion(_)
            | Event::MouseWheel(_)
            | Event::CursorEntered(_)
            | Event::CursorLeft(_)
            | Event::CursorMoved(_)
            | Event::TouchInput(_)
            | Event::WindowFocused(_)
            | Event::Ime(_)
    )
}

/// Games may ask the window where the cursor is.
fn forget_cursor(world: &mut World) {
    let mut windows = world.query_filtered::<&mut Window, With<PrimaryWindow>>();
    for mut window in windows.iter_mut(world) {
        if window.physical_cursor_position().is_some() {
            window.set_physical_cursor_position(None);
        }
    }
}

// A person's gamepads, kept from the game while another decider plays it.
//
// Their input arrives within a frame, after the window's messages, and each message names its gamepad: those of
// virtual input are let through.

pub(super) fn build_gamepads(app: &mut App) {
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
        ButtonState, InputPlugin,
        gamepad::{GamepadConnection, GamepadConnectionEvent},
    };

    use super::*;

    fn send(world: &mut World, key_code: KeyCode, state: ButtonState) {
        let (logical_key, window) = (Key::Character("x".into()), Entity::PLACEHOLDER);
        world.write_message(KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window });
    }

    #[test]
    fn kept_keys_are_known_to_the_window_only_and_virtual_ones_to_the_game() {
        let mut app = App::new();
        app.add_plugins(InputPlugin).insert_resource(Devices::Kept);
        build(&mut app);
        let world = app.world_mut();
        let seen = |world: &World, key: KeyCode| world.resource::<ButtonInput<KeyCode>>().pressed(key);
        let own = |world: &World, key: KeyCode| world.resource::<OwnKeys>().pressed(key);

        send(world, KeyCode::KeyA, ButtonState::Pressed);
        take(world);
        send(world, KeyCode::KeyB, ButtonState::Pressed);
        world.run_schedule(PreUpdate);
        give_back(world);
        assert!(own(world, KeyCode::KeyA) && !own(world, KeyCode::KeyB));
        assert!(seen(world, KeyCode::KeyB) && !seen(world, KeyCode::KeyA));

        send(world, KeyCode::KeyA, ButtonState::Released);
        take(world);
        world.run_schedule(PreUpdate);
        give_back(world);
        assert!(!own(world, KeyCode::KeyA) && seen(world, KeyCode::KeyB), "virtual keys stay down");

        set(world, Devices::Open);
        assert!(!seen(world, KeyCode::KeyB), "what was held by others is let go");
        send(world, KeyCode::KeyC, ButtonState::Pressed);
        take(world);
        world.run_schedule(PreUpdate);
        give_back(world);
        assert!(own(world, KeyCode::KeyC) && seen(world, KeyCode::KeyC));
    }

    #[test]
    fn a_window_without_focus_holds_nothing() {
        let mut app = App::new();
        app.add_plugins(InputPlugin).insert_resource(Devices::Kept);
        build(&mut app);
        let world = app.world_mut();
        send(world, KeyCode::KeyA, ButtonState::Pressed);
        take(world);
        give_back(world);
        world.write_message(WindowFocused { window: Entity::PLACEHOLDER, focused: false });
        take(world);
        assert!(!world.resource::<OwnKeys>().pressed(KeyCode::KeyA));
        assert!(world.resource::<Messages<WindowFocused>>().is_empty(), "the game does not hear of it");
    }

    #[test]
    fn a_hand_over_lets_go_of_the_meaning_of_keys_as_of_the_keys() {
        let mut app = App::new();
        app.add_plugins(InputPlugin).insert_resource(Devices::Open);
        build(&mut app);
        let world = app.world_mut();
        send(world, KeyCode::KeyA, ButtonState::Pressed);
        take(world);
        world.run_schedule(PreUpdate);
        give_back(world);
        let x = Key::Character("x".into());
        assert!(world.resource::<ButtonInput<Key>>().pressed(x.clone()));
        set(world, Devices::Kept);
        assert!(!world.resource::<ButtonInput<Key>>().pressed(x));
        assert!(!world.resource::<ButtonInput<KeyCode>>().pressed(KeyCode::KeyA));
    }

    #[test]
    fn a_bot_goes_on_holding_its_keys_when_the_window_loses_the_focus() {
        let mut app = App::new();
        app.add_plugins(InputPlugin).insert_resource(Devices::Kept);
        build(&mut app);
        let world = app.world_mut();
        take(world);
        send(world, KeyCode::KeyB, ButtonState::Pressed);
        world.run_schedule(PreUpdate);
        give_back(world);
        world.write_message(KeyboardFocusLost);
        take(world);
        world.run_schedule(PreUpdate);
        give_back(world);
        assert!(world.resource::<ButtonInput<KeyCode>>().pressed(KeyCode::KeyB));
        assert!(world.resource::<ButtonInput<Key>>().pressed(Key::Character("x".into())));
    }

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
        build_gamepads(&mut app);
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
