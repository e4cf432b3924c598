//! The person's devices, kept from the game or handed on to it.
//!
//! Between two frames the window system writes its messages into empty lists, while those of the game are stashed. This
//! keeps the person's input apart from virtual input, message by message.

use crate::window::session::{OwnDevices, OwnKeys};
use bevy::{
    input::{
        ButtonState, InputSystems,
        gamepad::{
            Gamepad, GamepadConnection, GamepadInput, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent,
            RawGamepadEvent, gamepad_connection_system, gamepad_event_processing_system,
        },
        keyboard::{Key, KeyboardFocusLost, KeyboardInput},
        mouse::{MouseButtonInput, MouseMotion, MouseScrollUnit, MouseWheel},
        touch::{TouchInput, TouchPhase},
    },
    prelude::*,
    window::{CursorEntered, CursorLeft, CursorMoved, Ime, PrimaryWindow, WindowEvent, WindowFocused},
};
use bevy_playbot::virtual_input::{PersonInput, VirtualAxis, VirtualGamepad};
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
    app.init_resource::<OwnKeys>().init_resource::<OwnDevices>();
    add_stash::<KeyboardInput>(app);
    add_stash::<KeyboardFocusLost>(app);
    add_stash::<MouseButtonInput>(app);
    add_stash::<MouseMotion>(app);
    add_stash::<MouseWheel>(app);
    add_stash::<CursorMoved>(app);
    add_stash::<CursorEntered>(app);
    add_stash::<CursorLeft>(app);
    add_stash::<TouchInput>(app);
    add_stash::<Ime>(app);
    add_stash::<WindowFocused>(app);
    add_stash::<WindowEvent>(app);
    app.add_systems(PostUpdate, leave_pointer.ambiguous_with_all());
}

/// Sets the window's cursor to where the person's is. The event loop would move the person's to where an action has set
/// the game's.
fn leave_pointer(devices: Res<Devices>, own: Res<OwnDevices>, mut windows: Query<&mut Window, With<PrimaryWindow>>) {
    let real = own.input.pointed();
    for mut window in windows.iter_mut().filter(|_| *devices == Devices::Kept) {
        if window.cursor_position() != real {
            window.set_cursor_position(real);
        }
    }
}

fn add_stash<M: Message + TypePath>(app: &mut App) {
    app.add_message::<M>()
        .insert_resource(StashedMessages::<M>(Messages::default()))
        .register_type::<StashedMessages<M>>();
}

/// Pixels of a touchpad that are a line of the wheel.
const PIXELS_PER_LINE: f32 = MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR;

/// Reads the person's devices at the start of a frame, and hands on the messages that the game may see.
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
    let is_unfocused = focus.iter().any(|change| !change.focused);
    if is_unfocused {
        own.release_all();
    }
    let mouse = Mouse {
        buttons: lift(world),
        motions: lift(world),
        turns: lift(world),
        moves: lift(world),
        entries: lift(world),
        exits: lift(world),
        touches: lift(world),
    };
    let mut devices = world.resource_mut::<OwnDevices>();
    devices.begin_frame();
    note(&mut devices.input, &keys, &mouse);
    if is_unfocused {
        devices.input.lose_focus();
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
    hand_on(world, mouse.buttons, is_open);
    hand_on(world, mouse.motions, is_open);
    hand_on(world, mouse.turns, is_open);
    hand_on(world, mouse.moves, is_open);
    hand_on(world, mouse.entries, is_open);
    hand_on(world, mouse.exits, is_open);
    hand_on(world, mouse.touches, is_open);
    let composed: Vec<Ime> = lift(world);
    hand_on(world, composed, is_open);
    let events: Vec<WindowEvent> = lift(world);
    hand_on(world, events.into_iter().filter(|event| is_open || !is_of_person(event)).collect(), true);
    if !is_open {
        forget_cursor(world);
    }
}

/// The messages of a person's mouse and touch screen.
struct Mouse {
    buttons: Vec<MouseButtonInput>,
    motions: Vec<MouseMotion>,
    turns: Vec<MouseWheel>,
    moves: Vec<CursorMoved>,
    entries: Vec<CursorEntered>,
    exits: Vec<CursorLeft>,
    touches: Vec<TouchInput>,
}

/// Notes the person's keys, mouse and touch screen, for games in which they become an action.
fn note(person: &mut PersonInput, keys: &[KeyboardInput], mouse: &Mouse) {
    for key in keys {
        match key.state {
            ButtonState::Pressed => person.press(key.key_code),
            ButtonState::Released => person.release(key.key_code),
        }
    }
    for click in &mouse.buttons {
        match click.state {
            ButtonState::Pressed => person.press(click.button),
            ButtonState::Released => person.release(click.button),
        }
    }
    mouse.motions.iter().for_each(|motion| person.move_by(motion.delta));
    for turn in &mouse.turns {
        let lines = match turn.unit {
            MouseScrollUnit::Line => 1.0,
            MouseScrollUnit::Pixel => 1.0 / PIXELS_PER_LINE,
        };
        person.turn(lines * Vec2::new(turn.x, turn.y));
    }
    // A cursor that leaves and comes back sends its position afterwards.
    if !mouse.exits.is_empty() {
        person.point(None);
    }
    if let Some(moved) = mouse.moves.last() {
        person.point(Some(moved.position));
    }
    let starts = mouse.touches.iter().filter(|touch| touch.phase == TouchPhase::Started);
    starts.for_each(|touch| person.tap(touch.position));
}

/// Makes room for the window system's messages at the end of a frame.
pub(super) fn give_back(world: &mut World) {
    swap::<KeyboardInput>(world);
    swap::<KeyboardFocusLost>(world);
    swap::<MouseButtonInput>(world);
    swap::<MouseMotion>(world);
    swap::<MouseWheel>(world);
    swap::<CursorMoved>(world);
    swap::<CursorEntered>(world);
    swap::<CursorLeft>(world);
    swap::<TouchInput>(world);
    swap::<Ime>(world);
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
            (
                let_go.run_if(resource_changed::<Devices>),
                note_gamepads.before(keep_events),
                keep_events,
                keep_buttons,
                keep_axes,
            )
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

/// Values above which a button of a gamepad goes down, and below which it goes up: Bevy's defaults.
const PRESSED: f32 = 0.75;
const RELEASED: f32 = 0.65;

/// Notes the person's gamepads, for games in which they become an action of the next tick.
fn note_gamepads(
    events: Res<Messages<RawGamepadEvent>>,
    virtual_gamepads: VirtualGamepads,
    mut own: ResMut<OwnDevices>,
) {
    for event in events.iter_current_update_messages() {
        match event {
            RawGamepadEvent::Button(change) if !virtual_gamepads.contains(change.gamepad) => {
                own.input.push(VirtualAxis::Trigger(change.button), change.value);
                if change.value >= PRESSED {
                    own.note_gamepad(change.button, ButtonState::Pressed);
                } else if change.value <= RELEASED {
                    own.note_gamepad(change.button, ButtonState::Released);
                }
            }
            RawGamepadEvent::Axis(change) if !virtual_gamepads.contains(change.gamepad) => {
                own.input.push(change.axis, change.value);
            }
            RawGamepadEvent::Connection(change) if matches!(change.connection, GamepadConnection::Disconnected) => {
                own.input.release_gamepads();
            }
            RawGamepadEvent::Button(_) | RawGamepadEvent::Axis(_) | RawGamepadEvent::Connection(_) => {}
        }
    }
}

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

    #[test]
    fn a_persons_mouse_is_noted_and_kept_from_the_game() {
        let mut app = App::new();
        app.add_plugins(InputPlugin).insert_resource(Devices::Kept);
        build(&mut app);
        let (world, window) = (app.world_mut(), Entity::PLACEHOLDER);
        take(world);
        give_back(world);
        let at = Vec2::new(30.0, 40.0);
        world.write_message(CursorMoved { window, position: at, delta: None });
        world.write_message(MouseButtonInput { button: MouseButton::Left, state: ButtonState::Pressed, window });
        world.write_message(MouseMotion { delta: Vec2::new(3.0, 0.0) });
        take(world);
        world.run_schedule(PreUpdate);
        give_back(world);
        let mut expected = PersonInput::default();
        expected.point(Some(at));
        expected.press(MouseButton::Left);
        expected.move_by(Vec2::new(3.0, 0.0));
        assert_eq!(world.resource::<OwnDevices>().input, expected);
        assert!(!world.resource::<ButtonInput<MouseButton>>().pressed(MouseButton::Left));
        world.write_message(WindowFocused { window, focused: false });
        world.write_message(CursorLeft { window });
        take(world);
        assert_eq!(world.resource::<OwnDevices>().input, PersonInput::default(), "nothing is held without focus");
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
        app.init_resource::<OwnDevices>().add_systems(PreUpdate, press.before(InputSystems));
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
        let mut own_devices = app.world().resource::<OwnDevices>().clone();
        own_devices.begin_frame();
        let mut expected = PersonInput::default();
        expected.push(VirtualAxis::Trigger(GamepadButton::South), 1.0);
        expected.push(GamepadAxis::LeftStickX, 1.0);
        expected.press(GamepadButton::South);
        assert_eq!(own_devices.input, expected, "the next decision knows them");
        assert_eq!(play(&mut app, Devices::Open, &[(real, 1.0)]), [(true, 1.0), (false, 0.0)]);
    }
}
