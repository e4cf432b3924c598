//! The person's devices, kept from the game or handed on to it.
//!
//! Between two frames the window system writes its messages into empty lists, while those of the game lie aside. So
//! what the person does can be told from what virtual input does, message by message.

use bevy::{
    input::{
        keyboard::{KeyboardFocusLost, KeyboardInput},
        mouse::{MouseButtonInput, MouseMotion, MouseWheel},
    },
    prelude::*,
    window::{CursorMoved, PrimaryWindow, WindowEvent},
};

use super::own_keys::OwnKeys;

/// Whether the game sees the person's devices.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Devices {
    /// It sees them as they are.
    Open,
    /// It sees nothing of them.
    Kept,
}

/// The messages that do not count at the moment: between frames the game's, in frames nobody's.
#[derive(Resource)]
struct Aside<M: Message>(Messages<M>);

pub(super) fn build(app: &mut App) {
    app.init_resource::<OwnKeys>();
    put_aside::<KeyboardInput>(app);
    put_aside::<MouseButtonInput>(app);
    put_aside::<MouseMotion>(app);
    put_aside::<MouseWheel>(app);
    put_aside::<CursorMoved>(app);
    put_aside::<WindowEvent>(app);
}

fn put_aside<M: Message>(app: &mut App) {
    app.add_message::<M>().insert_resource(Aside::<M>(Messages::default()));
}

/// At the start of a frame: reads the person's keys, and hands on what the game may see.
pub(super) fn take(world: &mut World) {
    let is_open = *world.resource::<Devices>() == Devices::Open;
    let keys: Vec<KeyboardInput> = lift(world);
    let mut own = world.resource_mut::<OwnKeys>();
    own.clear();
    for key in &keys {
        if key.state.is_pressed() {
            own.press(key.key_code);
        } else {
            own.release(key.key_code);
        }
    }
    hand_on(world, keys, is_open);
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

/// At the end of a frame: makes room for what the window system writes.
pub(super) fn give_back(world: &mut World) {
    swap::<KeyboardInput>(world);
    swap::<MouseButtonInput>(world);
    swap::<MouseMotion>(world);
    swap::<MouseWheel>(world);
    swap::<CursorMoved>(world);
    swap::<WindowEvent>(world);
    // Whoever looks at another window holds no key of this one. Virtual input does not let go.
    if !world.resource::<Messages<KeyboardFocusLost>>().is_empty() {
        world.resource_mut::<OwnKeys>().release_all();
        if *world.resource::<Devices>() == Devices::Kept {
            world.resource_mut::<Messages<KeyboardFocusLost>>().clear();
        }
    }
}

/// Opens the devices to the game, or keeps them from it, which then sees them at rest.
pub(super) fn set(world: &mut World, devices: Devices) {
    if *world.resource::<Devices>() == devices {
        return;
    }
    world.insert_resource(devices);
    if let Some(mut keys) = world.get_resource_mut::<ButtonInput<KeyCode>>() {
        keys.release_all();
    }
    if let Some(mut buttons) = world.get_resource_mut::<ButtonInput<MouseButton>>() {
        buttons.release_all();
    }
}

fn swap<M: Message>(world: &mut World) {
    world.resource_scope(|world, mut aside: Mut<Aside<M>>| {
        std::mem::swap(&mut aside.0, &mut *world.resource_mut::<Messages<M>>());
    });
}

/// Brings the game's messages back, and returns those of the window system.
fn lift<M: Message>(world: &mut World) -> Vec<M> {
    swap::<M>(world);
    world.resource_mut::<Aside<M>>().0.drain().collect()
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

/// Whether it tells of what a person does to the game, and not to the window.
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
