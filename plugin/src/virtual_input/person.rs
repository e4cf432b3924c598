//! A person's devices, and the action that they mean.

use crate::{
    action::ActionValue,
    virtual_input::{
        Mapping, VirtualInput,
        button::{VirtualAxis, VirtualButton},
        devices::{ActionAxis, HeldInput},
    },
};
use bevy::prelude::*;

/// The state of a person's devices in a frame: held inputs, and what happened since the frame before.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::{prelude::*, virtual_input::PersonInput};
///
/// let input = VirtualInput::keys([vec![], vec![]]).mouse_buttons([vec![], vec![MouseButton::Left]]);
/// let mut person = PersonInput::default();
/// person.press(MouseButton::Left);
/// let (action, missing) = input.meant_by(&person, Vec2::new(1280.0, 720.0), None);
/// assert_eq!((action, missing), (ActionValue::Discrete(1), None));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct PersonInput {
    held: Vec<VirtualButton>,
    /// Buttons that went down since the frame before, even if they are up by now.
    pressed: Vec<VirtualButton>,
    motion: Vec2,
    wheel: Vec2,
    pushed: Vec<(VirtualAxis, f32)>,
    cursor: Option<Vec2>,
    tap: Option<Vec2>,
}

impl PersonInput {
    /// Notes a button that goes down. A repetition of a held key changes nothing.
    pub fn press(&mut self, button: impl Into<VirtualButton>) {
        let button = button.into();
        if !self.held.contains(&button) {
            self.held.push(button);
            self.pressed.push(button);
        }
    }

    /// Notes a button that goes up.
    pub fn release(&mut self, button: impl Into<VirtualButton>) {
        let button = button.into();
        self.held.retain(|held| *held != button);
    }

    /// Adds a motion of the mouse, in pixels to the right and downwards.
    pub fn move_by(&mut self, delta: Vec2) {
        self.motion += delta;
    }

    /// Adds a turn of the wheel, in lines.
    pub fn turn(&mut self, lines: Vec2) {
        self.wheel += lines;
    }

    /// Notes the position of the mouse cursor in logical pixels; `None` outside of the window.
    pub fn point(&mut self, cursor: Option<Vec2>) {
        self.cursor = cursor;
    }

    /// Returns the noted position of the mouse cursor.
    pub fn pointed(&self) -> Option<Vec2> {
        self.cursor
    }

    /// Notes a finger that touches the screen, in logical pixels.
    pub fn tap(&mut self, position: Vec2) {
        self.tap = Some(position);
    }

    /// Notes the value of a stick or trigger.
    pub fn push(&mut self, axis: impl Into<VirtualAxis>, value: f32) {
        let axis = axis.into();
        match self.pushed.iter_mut().find(|(pushed, _)| *pushed == axis) {
            Some((_, pushed)) => *pushed = value,
            None => self.pushed.push((axis, value)),
        }
    }

    /// Forgets what happened in the frame before: presses, motions and taps. Held buttons and sticks stay.
    pub fn begin_frame(&mut self) {
        self.pressed.clear();
        (self.motion, self.wheel, self.tap) = (Vec2::ZERO, Vec2::ZERO, None);
    }

    /// Releases the keyboard and the mouse, as a window without focus does.
    pub fn lose_focus(&mut self) {
        self.held.retain(|button| matches!(button, VirtualButton::Gamepad(_)));
        self.begin_frame();
    }

    /// Releases all buttons, sticks and triggers of gamepads.
    pub fn release_gamepads(&mut self) {
        self.held.retain(|button| !matches!(button, VirtualButton::Gamepad(_)));
        self.pushed.clear();
    }

    /// Returns whether a button acts in this frame. Clicks count in the frame of their press only.
    fn has(&self, button: VirtualButton, clicks: bool) -> bool {
        let is_click = clicks && matches!(button, VirtualButton::Mouse(_));
        self.pressed.contains(&button) || !is_click && self.held.contains(&button)
    }

    /// Returns the value of a motion, stick or trigger in this frame.
    fn value(&self, axis: VirtualAxis) -> f32 {
        match axis {
            VirtualAxis::MouseX => self.motion.x,
            VirtualAxis::MouseY => self.motion.y,
            VirtualAxis::WheelX => self.wheel.x,
            VirtualAxis::WheelY => self.wheel.y,
            VirtualAxis::Stick(_) | VirtualAxis::Trigger(_) => {
                self.pushed.iter().find(|(pushed, _)| *pushed == axis).map_or(0.0, |(_, value)| *value)
            }
        }
    }

    /// Returns the value of a continuous action that moves this axis, -1 to 1.
    fn value_for(&self, axis: &ActionAxis) -> f32 {
        let value = match axis {
            ActionAxis::Buttons { negative, positive, .. } => {
                let all = |buttons: &[VirtualButton]| {
                    let is_held = !buttons.is_empty() && buttons.iter().all(|&button| self.has(button, false));
                    f32::from(u8::from(is_held))
                };
                all(positive) - all(negative)
            }
            ActionAxis::Analog { scale, .. } if *scale == 0.0 => 0.0,
            ActionAxis::Analog { axis, scale } => self.value(*axis) / scale,
        };
        if value.is_finite() { value.clamp(-1.0, 1.0) } else { 0.0 }
    }

    /// Returns how well a discrete action fits, if the person does all that it needs.
    fn fit(&self, action: &HeldInput, window: Vec2) -> Option<Fit> {
        let has_buttons = action.buttons.iter().all(|&button| self.has(button, action.clicks));
        // Half of a motion counts: people do not hit a value exactly.
        let is_moved = |&(axis, wanted): &(VirtualAxis, f32)| {
            let value = self.value(axis);
            wanted == 0.0 || value * wanted > 0.0 && value.abs() >= wanted.abs() / 2.0
        };
        if !has_buttons || !action.axes.iter().all(is_moved) || !action.text.is_empty() {
            return None;
        }
        let mut fit = Fit { inputs: action.buttons.len(), is_placed: false, distance: 0.0 };
        fit.inputs += action.axes.iter().filter(|(_, wanted)| *wanted != 0.0).count();
        if let Some(position) = action.cursor {
            fit.is_placed = true;
            fit.distance += inside(self.cursor, window)?.distance(position.within(window)?);
        }
        if let Some(position) = action.tap {
            fit.inputs += 1;
            // The mouse stands in for a finger.
            let is_clicked = self.pressed.contains(&MouseButton::Left.into());
            let tap = self.tap.or(self.cursor.filter(|_| is_clicked));
            fit.distance += inside(tap, window)?.distance(position.within(window)?);
        }
        Some(fit)
    }
}

/// Returns a position of a person if it lies inside of a window of this size.
fn inside(position: Option<Vec2>, window: Vec2) -> Option<Vec2> {
    position.filter(|at| at.cmpge(Vec2::ZERO).all() && at.cmplt(window).all())
}

/// The quality of an action for what a person does.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fit {
    /// Buttons, motions and taps of the action.
    inputs: usize,
    /// True if it has a position of the mouse cursor.
    is_placed: bool,
    /// Pixels between its position and the person's.
    distance: f32,
}

impl Fit {
    fn is_better_than(self, other: Self) -> bool {
        let rank = |fit: Self| (fit.inputs, fit.is_placed);
        rank(self) > rank(other) || rank(self) == rank(other) && self.distance < other.distance
    }
}

/// The buttons of a user interface that discrete actions of an agent click on, as a person sees them. A click of a
/// person on one of them means its action.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct ClickAreas {
    /// Number of the first action that is a click. All later ones are, too.
    pub first: u32,
    /// The action and the area of each button in logical pixels, from the front to the back.
    pub areas: Vec<(u32, Rect)>,
}

impl ClickAreas {
    fn action_at(&self, position: Vec2) -> Option<u32> {
        self.areas.iter().find(|(_, area)| area.contains(position)).map(|(action, _)| *action)
    }
}

impl PersonInput {
    /// Returns the action that holds the most of what the person holds, and the buttons that the person holds without an
    /// action for all of them.
    fn best_of(&self, actions: &[HeldInput], window: Vec2) -> (u32, Option<Vec<VirtualButton>>) {
        let mut best: Option<(usize, Fit)> = None;
        for (index, action) in actions.iter().enumerate() {
            if let Some(fit) = self.fit(action, window)
                && best.is_none_or(|(_, best)| fit.is_better_than(best))
            {
                best = Some((index, fit));
            }
        }
        let mut acting: Vec<VirtualButton> = Vec::new();
        for action in actions {
            for &button in &action.buttons {
                if self.has(button, action.clicks) && !acting.contains(&button) {
                    acting.push(button);
                }
            }
        }
        let is_whole =
            best.is_some_and(|(index, _)| acting.iter().all(|button| actions[index].buttons.contains(button)));
        let action = best.map_or(0, |(index, _)| index as u32);
        (action, (!is_whole).then_some(acting))
    }
}

impl VirtualInput {
    /// Returns the action that a person means, in a window of this size, and the buttons that the person holds without
    /// an action for them: see [`MissingSet`](crate::key_bindings::MissingSet).
    ///
    /// Of the discrete actions that hold nothing else than the person does, the one with the most inputs counts. Of
    /// several positions, the one nearest to the cursor counts. Where nothing fits, action 0 does. So it is in each of
    /// several choices. Values of continuous actions are those of the axes divided by their scales, limited to -1 to 1.
    pub fn meant_by(
        &self,
        person: &PersonInput,
        window: Vec2,
        clicks: Option<&ClickAreas>,
    ) -> (ActionValue, Option<Vec<VirtualButton>>) {
        let actions = match &self.mapping {
            Mapping::Discrete(actions) => actions,
            Mapping::Continuous(axes) => {
                return (ActionValue::Continuous(axes.iter().map(|axis| person.value_for(axis)).collect()), None);
            }
            Mapping::Mixed { choices, axes } => {
                // Keys of one choice mean nothing to another one.
                let meant = choices.iter().map(|options| person.best_of(options, window));
                let (choices, missing): (Vec<u32>, Vec<Option<_>>) = meant.unzip();
                let numbers = axes.iter().map(|axis| person.value_for(axis)).collect();
                return (ActionValue::Mixed { choices, numbers }, missing.into_iter().flatten().next());
            }
        };
        let clicked = inside(person.cursor, window).filter(|_| person.pressed.contains(&MouseButton::Left.into()));
        if let Some(action) = clicked.and_then(|cursor| clicks?.action_at(cursor)) {
            return (ActionValue::Discrete(action), None);
        }
        let first_click = clicks.map_or(actions.len(), |clicks| clicks.first as usize);
        let actions = &actions[..first_click.min(actions.len())];
        let (action, missing) = person.best_of(actions, window);
        (ActionValue::Discrete(action), missing)
    }

    /// Returns false if each discrete action before number `end` needs an input: a person without any then gets
    /// action 0.
    pub fn has_idle_action(&self, end: usize) -> bool {
        match &self.mapping {
            Mapping::Discrete(actions) => actions.iter().take(end).any(holds_nothing),
            Mapping::Continuous(_) => true,
            Mapping::Mixed { choices, .. } => choices.iter().all(|options| options.iter().any(holds_nothing)),
        }
    }
}

fn holds_nothing(action: &HeldInput) -> bool {
    let is_moved = action.axes.iter().any(|(_, wanted)| *wanted != 0.0);
    let is_pointed = action.cursor.is_some() || action.tap.is_some();
    action.buttons.is_empty() && action.text.is_empty() && !is_moved && !is_pointed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_input::PointerPosition;

    const WINDOW: Vec2 = Vec2::new(1000.0, 500.0);

    /// Returns the action, and the buttons without one.
    fn meant(input: &VirtualInput, person: &PersonInput) -> (u32, Option<Vec<VirtualButton>>) {
        let (action, missing) = input.meant_by(person, WINDOW, None);
        let ActionValue::Discrete(action) = action else { panic!("a discrete action: {action:?}") };
        (action, missing)
    }

    /// Returns nothing, a click on the left half, and one on the right half.
    fn board() -> VirtualInput {
        let [left, right] = [0.25, 0.75].map(|x| PointerPosition::fraction(x, 0.5));
        VirtualInput::keys([[]; 3]).mouse_buttons([vec![], vec![MouseButton::Left], vec![MouseButton::Left]]).cursor([
            None,
            Some(left),
            Some(right),
        ])
    }

    #[test]
    fn a_click_means_the_nearest_position_and_counts_once() {
        let mut person = PersonInput::default();
        person.point(Some(Vec2::new(600.0, 20.0)));
        assert_eq!(meant(&board(), &person), (0, None), "no button is down");
        person.press(MouseButton::Left);
        assert_eq!(meant(&board(), &person), (2, None));
        person.point(Some(Vec2::new(400.0, 20.0)));
        assert_eq!(meant(&board(), &person), (1, None));
        person.begin_frame();
        assert_eq!(meant(&board(), &person), (0, None), "a held button is no second click");
    }

    #[test]
    fn a_click_outside_of_the_window_means_no_position_and_is_named() {
        let mut person = PersonInput::default();
        person.press(MouseButton::Left);
        for outside in [None, Some(Vec2::new(-1.0, 20.0)), Some(Vec2::new(1000.0, 20.0))] {
            person.point(outside);
            assert_eq!(meant(&board(), &person), (0, Some(vec![MouseButton::Left.into()])), "{outside:?}");
        }
    }

    #[test]
    fn positions_by_fraction_do_not_depend_on_the_size_of_the_window() {
        let mut person = PersonInput::default();
        person.press(MouseButton::Left);
        for size in [WINDOW, 2.0 * WINDOW, 0.5 * WINDOW] {
            person.point(Some(0.8 * size));
            assert_eq!(board().meant_by(&person, size, None).0, ActionValue::Discrete(2), "{size}");
        }
    }

    #[test]
    fn buttons_of_all_devices_choose_the_action_that_holds_them() {
        let input = VirtualInput::keys([vec![], vec![KeyCode::KeyA]])
            .mouse_buttons([vec![], vec![MouseButton::Right], vec![MouseButton::Right]])
            .gamepad_buttons([vec![], vec![], vec![], vec![GamepadButton::South]]);
        let [key, mouse] = [VirtualButton::from(KeyCode::KeyA), MouseButton::Right.into()];
        let pad = VirtualButton::from(GamepadButton::South);
        for (held, expected) in [
            (vec![], (0, None)),
            (vec![mouse], (2, None)),
            (vec![mouse, key], (1, None)),
            (vec![pad], (3, None)),
            (vec![pad, mouse], (2, Some(vec![mouse, pad]))),
            (vec![key], (0, Some(vec![key]))),
            (vec![VirtualButton::from(KeyCode::KeyQ)], (0, None)),
        ] {
            let mut person = PersonInput::default();
            held.iter().for_each(|&button| person.press(button));
            assert_eq!(meant(&input, &person), expected, "{held:?}");
            person.begin_frame();
            assert_eq!(meant(&input, &person), expected, "buttons without a position stay held: {held:?}");
        }
    }

    #[test]
    fn a_click_on_a_button_of_the_interface_comes_before_one_on_the_board() {
        let areas = vec![(4, Rect::new(0.0, 0.0, 50.0, 50.0)), (3, Rect::new(0.0, 0.0, 300.0, 100.0))];
        let areas = ClickAreas { first: 3, areas };
        let input = board().and_actions([HeldInput::default(), HeldInput::default()]);
        let mut person = PersonInput::default();
        person.press(MouseButton::Left);
        for (x, action) in [(20.0, 4), (200.0, 3), (400.0, 1), (700.0, 2)] {
            person.point(Some(Vec2::new(x, 20.0)));
            assert_eq!(input.meant_by(&person, WINDOW, Some(&areas)), (ActionValue::Discrete(action), None), "{x}");
        }
        person.begin_frame();
        assert_eq!(input.meant_by(&person, WINDOW, Some(&areas)).0, ActionValue::Discrete(0));
    }

    #[test]
    fn sticks_mouse_and_wheel_become_values_within_their_range() {
        let input = VirtualInput::axes([
            ActionAxis::stick(GamepadAxis::LeftStickX),
            ActionAxis::mouse_x(8.0),
            ActionAxis::wheel(2.0),
            ActionAxis::keys([KeyCode::KeyA], [KeyCode::KeyD]),
            ActionAxis::trigger(GamepadButton::RightTrigger2),
        ]);
        let mut person = PersonInput::default();
        let values = |person: &PersonInput| match input.meant_by(person, WINDOW, None) {
            (ActionValue::Continuous(values), None) => values,
            other => panic!("a continuous action: {other:?}"),
        };
        assert_eq!(values(&person), [0.0; 5]);
        person.push(GamepadAxis::LeftStickX, -0.75);
        person.push(VirtualAxis::Trigger(GamepadButton::RightTrigger2), 0.5);
        person.move_by(Vec2::new(1.0, 7.0));
        person.move_by(Vec2::new(1.0, 0.0));
        person.turn(Vec2::new(0.0, -9.0));
        person.press(KeyCode::KeyD);
        assert_eq!(values(&person), [-0.75, 0.25, -1.0, 1.0, 0.5]);
        person.press(KeyCode::KeyA);
        person.begin_frame();
        assert_eq!(values(&person), [-0.75, 0.0, 0.0, 0.0, 0.5], "opposite keys cancel out, and motion has ended");
        person.release_gamepads();
        assert_eq!(values(&person), [0.0; 5]);
    }

    #[test]
    fn a_notch_of_the_wheel_and_a_tap_choose_their_actions() {
        let right = PointerPosition::fraction(0.75, 0.5);
        let input = VirtualInput::keys([[]; 4]).wheel([0.0, 1.0, -1.0]).taps([None, None, None, Some(right)]);
        let mut person = PersonInput::default();
        assert_eq!(meant(&input, &person), (0, None));
        person.turn(Vec2::new(0.0, 3.0));
        assert_eq!(meant(&input, &person), (1, None));
        person.begin_frame();
        person.turn(Vec2::new(0.0, -1.0));
        assert_eq!(meant(&input, &person), (2, None));
        person.begin_frame();
        person.tap(Vec2::new(10.0, 10.0));
        assert_eq!(meant(&input, &person), (3, None));
        person.begin_frame();
        person.point(Some(Vec2::new(10.0, 10.0)));
        person.press(MouseButton::Left);
        assert_eq!(meant(&input, &person), (3, None), "the mouse stands in for a finger");
    }

    #[test]
    fn a_lost_focus_releases_keys_and_mouse_and_leaves_the_gamepad() {
        let mut person = PersonInput::default();
        person.press(KeyCode::KeyA);
        person.press(MouseButton::Left);
        person.press(GamepadButton::South);
        person.lose_focus();
        let mut gamepad = PersonInput::default();
        gamepad.press(GamepadButton::South);
        gamepad.begin_frame();
        assert_eq!(person, gamepad);
    }

    #[test]
    fn an_action_that_needs_nothing_is_idle() {
        assert!(board().has_idle_action(3));
        let click = VirtualInput::discrete([HeldInput::new([MouseButton::Left]), HeldInput::default()]);
        assert!(click.has_idle_action(2) && !click.has_idle_action(1), "the second one clicks on the interface");
        assert!(!VirtualInput::keys([[KeyCode::KeyA]]).has_idle_action(1));
        assert!(VirtualInput::axes([ActionAxis::mouse_x(1.0)]).has_idle_action(1));
    }
}
