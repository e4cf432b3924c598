//! Bevy's messages about keys, mouse and gamepads, as a window and a gamepad driver would send them.

use crate::{
    agent::Agent,
    virtual_input::{
        VirtualInput,
        button::{VirtualAxis, VirtualButton},
        devices::{Change, Reading, VirtualDevices, Wanted},
        input_state::{Switch, logical_key, typing_key},
        pointer::{Cursor, Finger},
    },
};
use bevy::{
    app::MainScheduleOrder,
    ecs::{query::QueryFilter, schedule::ScheduleLabel, system::SystemParam},
    input::{
        ButtonState,
        gamepad::{
            AxisSettings, ButtonAxisSettings, GamepadAxisChangedEvent, GamepadButtonChangedEvent,
            GamepadButtonStateChangedEvent, GamepadConnection, GamepadConnectionEvent, GamepadEvent,
            RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent, RawGamepadEvent,
        },
        keyboard::KeyboardInput,
        mouse::{MouseButtonInput, MouseMotion, MouseScrollUnit, MouseWheel},
        touch::{TouchInput, TouchPhase},
    },
    prelude::*,
    window::{CursorLeft, CursorMoved, PrimaryWindow, RawHandleWrapper, WindowEvent},
};

/// The writers of messages.
#[derive(SystemParam)]
pub(super) struct InputMessages<'w, 's> {
    keys: MessageWriter<'w, KeyboardInput>,
    mouse: MessageWriter<'w, MouseButtonInput>,
    motion: MessageWriter<'w, MouseMotion>,
    wheel: MessageWriter<'w, MouseWheel>,
    cursor: MessageWriter<'w, CursorMoved>,
    cursor_left: MessageWriter<'w, CursorLeft>,
    touch: MessageWriter<'w, TouchInput>,
    /// All of the above once more, as a window sends them. Bevy's picking reads these.
    events: MessageWriter<'w, WindowEvent>,
    pads: GamepadMessages<'w, 's>,
    windows: Query<'w, 's, (Entity, &'static mut Window), With<PrimaryWindow>>,
}

impl InputMessages<'_, '_> {
    /// Returns the window that messages come from; a placeholder without a window.
    fn window(&self) -> Entity {
        self.windows.single().map_or(Entity::PLACEHOLDER, |(window, _)| window)
    }

    /// Sends a change as a window and a gamepad driver would. Bevy's own systems do the rest.
    pub fn send(&mut self, change: Change) {
        if let Some(event) = of_driver(change) {
            self.pads.send(event);
        } else if let Change::Button { switch, down } = change {
            self.send_button(switch, down);
        }
    }

    /// Sends the messages of a change that is already in the state, in its own tick, with the state before and after.
    ///
    /// Messages for keys and mouse affect only the state, which [`settle`](crate::virtual_input::act::settle) restores.
    /// A `RawGamepadEvent` is left out. Bevy's system for gamepads would read it in the next frame, when it may be
    /// outdated, and would press and announce everything again.
    pub fn send_processed(&mut self, change: Change, before: Reading, after: Reading) {
        match of_driver(change) {
            // A driver sends nothing about an unchanged value.
            Some(_) if before == after => {}
            Some(event) => {
                self.pads.send_part(&event);
                self.pads.process(&event, before, after);
            }
            None => self.send(change),
        }
    }

    /// Sends the messages of a change that is already in the state, where Bevy's own systems run later: the one for
    /// gamepads finds nothing changed.
    pub fn send_with_processed(&mut self, change: Change, before: Reading, after: Reading) {
        if let Some(event) = of_driver(change).filter(|_| before != after) {
            self.pads.process(&event, before, after);
        }
        self.send(change);
    }

    fn send_button(&mut self, Switch { button, .. }: Switch, down: bool) {
        let (state, window) = (if down { ButtonState::Pressed } else { ButtonState::Released }, self.window());
        match button {
            VirtualButton::Key(key_code) => {
                let (logical_key, text) = logical_key(key_code);
                let text = text.filter(|_| down).map(|text| text.as_str().into());
                let input = KeyboardInput { key_code, logical_key, state, text, repeat: false, window };
                self.events.write(input.clone().into());
                self.keys.write(input);
            }
            VirtualButton::Mouse(button) => {
                let input = MouseButtonInput { button, state, window };
                self.events.write(input.into());
                self.mouse.write(input);
            }
            // A call without a gamepad cannot reach this.
            VirtualButton::Gamepad(_) => {}
        }
    }

    /// Types this text: each of its characters goes down and up. Bevy's own system presses the keys.
    pub fn send_text(&mut self, text: &str) {
        let window = self.window();
        for character in text.chars() {
            let (key_code, logical_key, typed) = typing_key(character);
            for state in [ButtonState::Pressed, ButtonState::Released] {
                let text = typed.clone().filter(|_| state.is_pressed()).map(|text| text.as_str().into());
                let logical_key = logical_key.clone();
                let input = KeyboardInput { key_code, logical_key, state, text, repeat: false, window };
                self.events.write(input.clone().into());
                self.keys.write(input);
            }
        }
    }

    /// Sends motion: pixels to the right and downwards, and lines of the wheel.
    pub fn send_motion(&mut self, delta: Vec2, wheel: Vec2) {
        if delta != Vec2::ZERO {
            let motion = MouseMotion { delta };
            self.events.write(motion.into());
            self.motion.write(motion);
        }
        if wheel != Vec2::ZERO {
            let (unit, window) = (MouseScrollUnit::Line, self.window());
            let turn = MouseWheel { unit, x: wheel.x, y: wheel.y, window, phase: TouchPhase::Moved };
            self.events.write(turn.into());
            self.wheel.write(turn);
        }
    }

    /// Returns whether the window has no size, as a minimised one on some systems: no position is in it.
    pub fn is_minimised(&self) -> bool {
        self.windows.single().is_ok_and(|(_, window)| window.size().min_element() <= 0.0)
    }

    /// Moves the mouse cursor and the finger as the agents of this tick want it, in the window and by messages. Those
    /// of agents that do not play any more leave.
    pub fn point(&mut self, devices: &mut VirtualDevices, wanted: &Wanted) {
        if let Some(Cursor { agent, .. }) = devices.cursor.filter(|cursor| !wanted.agents.contains(&cursor.agent)) {
            self.leave(devices, agent);
        }
        let size = self.windows.single().ok().map(|(_, window)| window.size());
        if let Some((agent, position)) = wanted.cursor
            && let Some(at) = size.and_then(|size| position.within(size))
        {
            let before = devices.cursor.replace(Cursor { agent, at }).map(|cursor| cursor.at);
            if before != Some(at) {
                let delta = before.map(|before| at - before);
                let moved = CursorMoved { window: self.window(), position: at, delta };
                self.events.write(moved.clone().into());
                self.cursor.write(moved);
            }
        }
        // A window that keeps a person's devices from the game forgets the position in each frame.
        if let Some(Cursor { at, .. }) = devices.cursor {
            self.show_cursor(Some(at));
        }
        if let Some(Finger { id, at, .. }) = devices.finger.take() {
            self.send_touch(TouchPhase::Ended, id, at);
        }
        if let Some((agent, position)) = wanted.tap
            && let Some(at) = size.and_then(|size| position.within(size))
        {
            let id = devices.next_finger;
            devices.next_finger += 1;
            devices.finger = Some(Finger { agent, id, at });
            self.send_touch(TouchPhase::Started, id, at);
        }
    }

    /// Takes the mouse cursor of this agent out of the window, and its finger from the touch screen.
    pub fn leave(&mut self, devices: &mut VirtualDevices, agent: Entity) {
        if devices.cursor.take_if(|cursor| cursor.agent == agent).is_some() {
            self.show_cursor(None);
            let left = CursorLeft { window: self.window() };
            self.events.write(left.clone().into());
            self.cursor_left.write(left);
        }
        if let Some(Finger { id, at, .. }) = devices.finger.take_if(|finger| finger.agent == agent) {
            self.send_touch(TouchPhase::Canceled, id, at);
        }
        // An episode counts its fingers from 0, so that it replays the same alone.
        devices.next_finger = 0;
    }

    fn show_cursor(&mut self, at: Option<Vec2>) {
        if let Ok((_, mut window)) = self.windows.single_mut()
            && window.cursor_position() != at
        {
            window.set_cursor_position(at);
        }
    }

    fn send_touch(&mut self, phase: TouchPhase, id: u64, position: Vec2) {
        let touch = TouchInput { phase, position, window: self.window(), force: None, id };
        self.events.write(touch.into());
        self.touch.write(touch);
    }
}

// The pointer of a window on a screen, which stays the person's.
//
// A game asks its window where the cursor is, and the event loop moves the real pointer to a position that was set
// there. So the window has the agent's cursor while the game's systems run, and the person's when the event loop looks.

/// After `First`: the window gets the agent's cursor.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct CursorShown;

/// Before `Last`, in which the event loop looks: the window gets the person's cursor.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct CursorGivenBack;

/// Position of the person's cursor in this frame, physical pixels. Without a screen it is `None`.
#[derive(Resource, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct PersonsCursor(Option<Vec2>);

/// Lets the real pointer be where the person has moved it, in windows on a screen.
pub(super) fn leave_pointer(app: &mut App) {
    app.init_resource::<PersonsCursor>();
    leave_pointer_in::<With<RawHandleWrapper>>(app);
    if let Some(mut order) = app.world_mut().get_resource_mut::<MainScheduleOrder>() {
        order.insert_after(First, CursorShown);
        order.insert_before(Last, CursorGivenBack);
    }
}

/// Adds the systems for windows that pass a filter.
fn leave_pointer_in<F: QueryFilter + 'static>(app: &mut App) {
    app.add_systems(CursorShown, show_cursor::<F>).add_systems(CursorGivenBack, give_cursor_back::<F>);
}

type PrimaryWindows<'w, 's, F> = Query<'w, 's, &'static mut Window, (With<PrimaryWindow>, F)>;

fn show_cursor<F: QueryFilter + 'static>(
    devices: Res<VirtualDevices>,
    mut persons: ResMut<PersonsCursor>,
    mut windows: PrimaryWindows<F>,
) {
    let Ok(mut window) = windows.single_mut() else { return };
    persons.0 = window.physical_cursor_position();
    if let Some(Cursor { at, .. }) = devices.cursor {
        window.set_cursor_position(Some(at));
    }
}

/// Leaves a position alone that the game has set.
fn give_cursor_back<F: QueryFilter + 'static>(
    devices: Res<VirtualDevices>,
    persons: Res<PersonsCursor>,
    mut windows: PrimaryWindows<F>,
) {
    let Ok(mut window) = windows.single_mut() else { return };
    let is_agents = match (window.cursor_position(), devices.cursor) {
        // Factors between logical and physical pixels round positions.
        (Some(at), Some(cursor)) => at.distance(cursor.at) < 1.0,
        (None, None) => true,
        _ => false,
    };
    if is_agents && window.physical_cursor_position() != persons.0 {
        window.set_physical_cursor_position(persons.0.map(|at| at.as_dvec2()));
    }
}

/// The gamepad of an agent. Games see it as one that is plugged in.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct VirtualGamepad {
    /// The agent.
    pub agent: Entity,
}

/// Plugs in the gamepads of agents that have none yet, and unplugs those whose agents are gone.
///
/// Runs before Bevy's own input systems, which make them gamepads in the same frame.
pub(super) fn connect_gamepads(
    agents: Query<(Entity, &Agent, &VirtualInput)>,
    pads: Query<(Entity, &VirtualGamepad)>,
    mut messages: GamepadMessages,
    mut commands: Commands,
) {
    for (pad, owner) in &pads {
        if !agents.get(owner.agent).is_ok_and(|(.., input)| input.uses_gamepad()) {
            commands.entity(pad).despawn();
        }
    }
    for (entity, agent, input) in &agents {
        if input.uses_gamepad() && !pads.iter().any(|(_, owner)| owner.agent == entity) {
            let pad = commands.spawn(VirtualGamepad { agent: entity }).id();
            messages.send_connection(pad, format!("gamepad of agent {}", agent.index));
        }
    }
}

// Messages about gamepads.

/// The writers of messages about gamepads.
#[derive(SystemParam)]
pub(super) struct GamepadMessages<'w, 's> {
    connections: MessageWriter<'w, GamepadConnectionEvent>,
    raw: MessageWriter<'w, RawGamepadEvent>,
    raw_buttons: MessageWriter<'w, RawGamepadButtonChangedEvent>,
    raw_axes: MessageWriter<'w, RawGamepadAxisChangedEvent>,
    processed: MessageWriter<'w, GamepadEvent>,
    buttons: MessageWriter<'w, GamepadButtonChangedEvent>,
    button_states: MessageWriter<'w, GamepadButtonStateChangedEvent>,
    axes: MessageWriter<'w, GamepadAxisChangedEvent>,
    settings: Query<'w, 's, &'static GamepadSettings>,
}

impl GamepadMessages<'_, '_> {
    fn send_connection(&mut self, pad: Entity, name: String) {
        let connection = GamepadConnection::Connected { name, vendor_id: None, product_id: None };
        self.send(GamepadConnectionEvent::new(pad, connection).into());
    }

    /// Sends a message as a driver would: Bevy's own system reads it in its next run.
    pub fn send(&mut self, event: RawGamepadEvent) {
        self.send_part(&event);
        self.raw.write(event);
    }

    /// Sends the part of [`send`](Self::send) that Bevy's own system for buttons and sticks does not read.
    pub fn send_part(&mut self, event: &RawGamepadEvent) {
        match event {
            RawGamepadEvent::Connection(connection) => {
                self.connections.write(connection.clone());
            }
            RawGamepadEvent::Button(button) => {
                self.raw_buttons.write(*button);
            }
            RawGamepadEvent::Axis(axis) => {
                self.raw_axes.write(*axis);
            }
        }
    }

    /// Sends the derived messages as Bevy's own system would, with the state before and after the change. Small
    /// changes are sent too, because the state has them. A disconnected gamepad sends nothing.
    pub fn process(&mut self, event: &RawGamepadEvent, before: Reading, after: Reading) {
        match *event {
            RawGamepadEvent::Connection(_) => {}
            RawGamepadEvent::Button(RawGamepadButtonChangedEvent { gamepad, button, value }) => {
                let Ok(settings) = self.settings.get(gamepad) else { return };
                let state = if after.is_down { ButtonState::Pressed } else { ButtonState::Released };
                if before.is_down != after.is_down {
                    self.button_states.write(GamepadButtonStateChangedEvent::new(gamepad, button, state));
                }
                let value = scaled_button(settings.get_button_axis_settings(button), value);
                let event = GamepadButtonChangedEvent::new(gamepad, button, state, value);
                self.buttons.write(event);
                self.processed.write(event.into());
            }
            RawGamepadEvent::Axis(RawGamepadAxisChangedEvent { gamepad, axis, value }) => {
                let Ok(settings) = self.settings.get(gamepad) else { return };
                let value = scaled_axis(settings.get_axis_settings(axis), value);
                let event = GamepadAxisChangedEvent::new(gamepad, axis, value);
                self.axes.write(event);
                self.processed.write(event.into());
            }
        }
    }
}

/// Returns the driver's message for this change, if it is one of a gamepad.
pub(super) fn of_driver(change: Change) -> Option<RawGamepadEvent> {
    match change {
        Change::Button { switch: Switch { button: VirtualButton::Gamepad(button), pad: Some(pad) }, down } => {
            Some(RawGamepadButtonChangedEvent::new(pad, button, if down { 1.0 } else { 0.0 }).into())
        }
        Change::Axis { pad, axis: VirtualAxis::Trigger(button), value } => {
            Some(RawGamepadButtonChangedEvent::new(pad, button, value).into())
        }
        Change::Axis { pad, axis: VirtualAxis::Stick(axis), value } => {
            Some(RawGamepadAxisChangedEvent::new(pad, axis, value).into())
        }
        // Keys, mouse buttons and motions.
        Change::Button { .. } | Change::Axis { .. } => None,
    }
}

/// Scales a button's value to 0 to 1 between the values that count as untouched and fully pressed.
fn scaled_button(settings: &ButtonAxisSettings, value: f32) -> f32 {
    if value <= settings.low {
        0.0
    } else if value >= settings.high {
        1.0
    } else {
        (value - settings.low) / (settings.high - settings.low)
    }
}

/// Scales a stick's value to -1 to 1 between its dead zone and the values that count as fully pushed.
fn scaled_axis(settings: &AxisSettings, value: f32) -> f32 {
    let value = settings.clamp(value);
    if value > 0.0 {
        let (from, to) = (settings.deadzone_upperbound(), settings.livezone_upperbound());
        ((value - from) / (to - from)).min(1.0)
    } else if value < 0.0 {
        let (from, to) = (settings.livezone_lowerbound(), settings.deadzone_lowerbound());
        ((value - from) / (to - from) - 1.0).max(-1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        agent::Control,
        bot::BlindBot,
        headless::{PlaybotAppExt, headless_app},
        level::LevelQueue,
        virtual_input::{PointerPosition, VirtualInputPlugin},
    };
    use bevy::{input::InputPlugin, math::DVec2};
    use playbot_learner::ActionValue;

    /// The cursor that the game sees in `Update`, and the one that the event loop sees in `Last`.
    #[derive(Resource, Default)]
    struct Seen {
        game: Option<Vec2>,
        event_loop: Option<Vec2>,
    }

    #[test]
    fn the_real_pointer_stays_where_the_person_has_it_while_an_agent_points() {
        let mut app = headless_app();
        app.add_plugins((InputPlugin, VirtualInputPlugin::default())).init_resource::<Seen>();
        // The window of this test stands for one on a screen.
        leave_pointer_in::<()>(&mut app);
        app.add_systems(Update, |window: Single<&Window>, mut seen: ResMut<Seen>| seen.game = window.cursor_position())
            .add_systems(Last, |window: Single<&Window>, mut seen: ResMut<Seen>| {
                seen.event_loop = window.cursor_position();
            });
        let world = app.world_mut();
        let window = world.spawn((Window::default(), PrimaryWindow)).id();
        let input = VirtualInput::keys([[]; 2]).cursor([None, Some(PointerPosition::pixels(30.0, 40.0))]);
        let bot = BlindBot::Constant(ActionValue::Discrete(1));
        let agent = (Agent::new(0, input.space()), input, bot, LevelQueue::Always(0));
        let agent = world.spawn((agent, Control::Bot)).id();
        let mut frame = |moved: Option<Vec2>, control: Control| {
            let world = app.world_mut();
            world.entity_mut(agent).insert(control);
            if let Some(at) = moved {
                let at = Some(DVec2::new(at.x.into(), at.y.into()));
                world.get_mut::<Window>(window).expect("a window").set_physical_cursor_position(at);
            }
            app.tick().expect("no agent broke its contract");
            let seen = app.world().resource::<Seen>();
            (seen.game, seen.event_loop)
        };
        let [first, second, aim] = [Vec2::new(5.0, 6.0), Vec2::new(7.0, 8.0), Vec2::new(30.0, 40.0)];
        // The first frame may only start the clock.
        frame(Some(first), Control::Bot);
        assert_eq!(frame(None, Control::Bot), (Some(aim), Some(first)));
        assert_eq!(frame(Some(second), Control::Bot), (Some(aim), Some(second)), "the person moves the mouse");
        assert_eq!(frame(None, Control::Bot), (Some(aim), Some(second)));
        let (_, pointer) = frame(None, Control::Human);
        assert_eq!(pointer, Some(second));
        assert_eq!(frame(None, Control::Human), (Some(second), Some(second)), "the person plays");
        assert_eq!(frame(Some(first), Control::Human), (Some(first), Some(first)));
    }

    #[test]
    fn values_are_scaled_as_bevy_scales_them() {
        let stick = AxisSettings::default();
        for (value, scaled) in [(0.0, 0.0), (0.05, 0.0), (0.525, 0.5), (1.0, 1.0), (-0.525, -0.5), (-1.0, -1.0)] {
            assert!((scaled_axis(&stick, value) - scaled).abs() < 1e-6, "{value}: {}", scaled_axis(&stick, value));
        }
        let button = ButtonAxisSettings::default();
        for (value, scaled) in [(0.0, 0.0), (0.05, 0.0), (0.5, 0.5), (0.96, 1.0), (1.0, 1.0)] {
            assert!(
                (scaled_button(&button, value) - scaled).abs() < 1e-6,
                "{value}: {}",
                scaled_button(&button, value)
            );
        }
    }
}
