//! Virtual input: an agent's action presses keys, mouse buttons and gamepads, through Bevy's own input.
//!
//! A game that reads `ButtonInput<KeyCode>`, mouse, gamepad or an input manager needs no change to be played by a
//! bot. Its agent carries a [`VirtualInput`]: the inputs that each action holds down. In
//! [`PlaybotSystems::Act`] the plugin presses the new inputs of this tick's
//! action, keeps holding those it still needs, and releases the rest.
//!
//! - It plays for [`Control::Policy`](crate::agent::Control::Policy), [`Bot`](crate::agent::Control::Bot) and
//!   [`Replay`](crate::agent::Control::Replay), never for people: under `Human` and `Idle` everything is released.
//!   The exception are agents with [`PressesForPeople`], for people whose own devices do not reach the game.
//! - Everything is released at the end of an episode and at the start of the next. An episode begins with nothing
//!   held, and replays the same alone.
//! - A World has one keyboard and one mouse: two agents that claim the same key or motion are a fault. Every agent has
//!   a gamepad of its own.
//! - The route is a setting: see [`InputRoute`].
//! - In a window on a screen only the game sees an agent's cursor: the real pointer stays where the person has it.
//! - With the features `leafwing-input-manager` and `bevy_enhanced_input`, actions of these input managers can also be
//!   driven without any key. Keys drive them without these features.
//!
//! The files of the folder, in reading order:
//!
//! - `button`, `pointer`, `devices`: inputs that can be held down, positions in the window, and the inputs that are
//!   held down now.
//! - `act`, `claims`: the way from the actions of a tick to held inputs, and claims to keyboard and mouse.
//! - `person`: a person's devices, and the action that they mean.
//! - `input_state`, `messages`: Bevy's own state of the devices, and its messages.
//! - `leafwing`, `enhanced_input`: actions of input managers, driven without any key.
//!
//! ```
//! use bevy::{input::InputPlugin, prelude::*};
//! use bevy_playbot::{prelude::*, virtual_input::{VirtualInput, VirtualInputPlugin}};
//!
//! /// A game without any knowledge of agents.
//! fn walk(keys: Res<ButtonInput<KeyCode>>, mut player: Single<&mut Transform, With<Agent>>) {
//!     if keys.pressed(KeyCode::ArrowRight) {
//!         player.translation.x += 1.0;
//!     }
//! }
//!
//! let mut app = headless_app();
//! app.add_plugins((InputPlugin, VirtualInputPlugin::default())).add_systems(FixedUpdate, walk);
//! let input = VirtualInput::keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]]);
//! let bot = BlindBot::Constant(ActionValue::Discrete(2));
//! let agent = (Agent::new(0, input.space()), input, Control::Bot, bot, Transform::default());
//! let agent = app.world_mut().spawn(agent).id();
//! app.ticks(3).expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Transform>(agent).expect("spawned with it").translation.x, 3.0);
//! ```

mod act;
mod button;
mod claims;
mod devices;
#[cfg(feature = "bevy_enhanced_input")]
pub mod enhanced_input;
mod input_state;
#[cfg(feature = "leafwing-input-manager")]
pub mod leafwing;
mod messages;
mod person;
mod pointer;

use crate::{
    action::{ActionSpace, ActionValue, Choices, MixedSpace, check_actions},
    episode::{EpisodeEnded, StartEpisode},
    fault::Faults,
    panics::note_actions,
    systems::PlaybotSystems,
    virtual_input::{
        act::{DirectInput, InputReleaser},
        claims::check_claims,
        messages::connect_gamepads,
    },
};
use bevy::{
    input::{
        InputPlugin, InputSystems,
        gamepad::{
            GamepadAxisChangedEvent, GamepadButtonChangedEvent, GamepadButtonStateChangedEvent, GamepadConnectionEvent,
            GamepadEvent, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent, RawGamepadEvent,
            gamepad_connection_system, gamepad_event_processing_system,
        },
        keyboard::{Key, KeyboardInput, keyboard_input_system},
        mouse::{
            AccumulatedMouseMotion, AccumulatedMouseScroll, MouseButtonInput, MouseMotion, MouseWheel,
            accumulate_mouse_motion_system, accumulate_mouse_scroll_system, mouse_button_input_system,
        },
        touch::TouchInput,
    },
    prelude::*,
    window::{CursorLeft, CursorMoved, WindowEvent},
};

pub use crate::virtual_input::{
    button::{UnknownInput, VirtualAxis, VirtualButton},
    devices::{ActionAxis, HeldInput, VirtualDevices},
    messages::VirtualGamepad,
    person::{ClickAreas, PersonInput},
    pointer::PointerPosition,
};

/// The inputs that each action of an agent holds down. It maps the agent's [`Action`](crate::action::Action) to the
/// input that a game reads from Bevy.
///
/// Discrete actions name a set of keys each, continuous ones an [`ActionAxis`] for each value. Of several choices at
/// once, each option of each choice names a set: see [`choices`](Self::choices).
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::{prelude::*, virtual_input::{ActionAxis, VirtualInput}};
///
/// let walk = VirtualInput::keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
///     .mouse_buttons([vec![], vec![], vec![MouseButton::Left]]);
/// assert_eq!(walk.space(), ActionSpace::Discrete(3));
/// assert_eq!(walk.held(&ActionValue::Discrete(2)).buttons.len(), 2);
///
/// let fly = VirtualInput::axes([
///     ActionAxis::stick(GamepadAxis::LeftStickX),
///     ActionAxis::keys([KeyCode::KeyS], [KeyCode::KeyW]),
/// ]);
/// assert_eq!(fly.space(), ActionSpace::Continuous(2));
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component)]
pub struct VirtualInput {
    mapping: Mapping,
    /// True if sets of buttons were added to other than discrete actions, where they have no meaning.
    has_stray_sets: bool,
    /// True while actions hold nothing.
    is_resting: bool,
}

impl VirtualInput {
    fn new(mapping: Mapping) -> Self {
        Self { mapping, has_stray_sets: false, is_resting: false }
    }

    /// Creates a mapping with a set of keys for each discrete action; an empty set presses nothing.
    pub fn keys(sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>) -> Self {
        Self::discrete(sets.into_iter().map(HeldInput::new))
    }

    /// Creates a mapping with inputs of any device for each discrete action.
    pub fn discrete(actions: impl IntoIterator<Item = HeldInput>) -> Self {
        Self::new(Mapping::Discrete(actions.into_iter().collect()))
    }

    /// Creates a mapping with an axis for each value of a continuous action.
    pub fn axes(axes: impl IntoIterator<Item = ActionAxis>) -> Self {
        Self::new(Mapping::Continuous(axes.into_iter().collect()))
    }

    /// Creates a mapping of several choices at once, each with the inputs of its options, and of numbers beside them. It
    /// holds those of all options that were chosen. There are at most
    /// [`MOST_CHOICES`](playbot_learner::MOST_CHOICES); an agent with more is a fault.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_playbot::{prelude::*, virtual_input::{ActionAxis, HeldInput, VirtualInput}};
    ///
    /// let walk = [vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]].map(HeldInput::new);
    /// let jump = [vec![], vec![KeyCode::Space]].map(HeldInput::new);
    /// let aim = ActionAxis::stick(GamepadAxis::RightStickX);
    /// let input = VirtualInput::choices([walk.to_vec(), jump.to_vec()], [aim]);
    /// assert_eq!(input.space(), ActionSpace::mixed([3, 2], 1));
    /// let held = input.held(&ActionValue::Mixed { choices: vec![2, 1], numbers: vec![0.5] });
    /// assert_eq!((held.buttons.len(), held.axes.len()), (2, 1));
    /// ```
    pub fn choices(
        choices: impl IntoIterator<Item = impl IntoIterator<Item = HeldInput>>,
        axes: impl IntoIterator<Item = ActionAxis>,
    ) -> Self {
        let choices = choices.into_iter().map(|options| options.into_iter().collect()).collect();
        Self::new(Mapping::Mixed { choices, axes: axes.into_iter().collect() })
    }

    /// Adds a set of mouse buttons to each discrete action, in order. For continuous actions use
    /// [`ActionAxis::buttons`]; an agent with sets as well is a fault.
    pub fn mouse_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = MouseButton>>) -> Self {
        self.also(sets)
    }

    /// Adds a set of gamepad buttons to each discrete action, in order, as [`mouse_buttons`](Self::mouse_buttons) does.
    pub fn gamepad_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = GamepadButton>>) -> Self {
        self.also(sets)
    }

    /// Adds a position of the mouse cursor to each discrete action, in order; `None` leaves the cursor where it is.
    /// Mouse buttons of actions with a position are pressed anew in each tick, as clicks. Use
    /// [`HeldInput::at`] to drag instead.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_playbot::{prelude::*, virtual_input::{HeldInput, PointerPosition, VirtualInput}};
    ///
    /// // Nothing, and clicks on the two halves of a board.
    /// let [left, right] = [0.25, 0.75].map(|x| PointerPosition::fraction(x, 0.5));
    /// let input = VirtualInput::keys([[]; 3])
    ///     .mouse_buttons([vec![], vec![MouseButton::Left], vec![MouseButton::Left]])
    ///     .cursor([None, Some(left), Some(right)]);
    /// assert_eq!(input.held(&ActionValue::Discrete(2)), HeldInput::default().click(right, MouseButton::Left));
    /// ```
    pub fn cursor(self, positions: impl IntoIterator<Item = impl Into<Option<PointerPosition>>>) -> Self {
        self.each(positions, |held, position| match position.into() {
            Some(position) => HeldInput { clicks: true, ..held.at(position) },
            None => held,
        })
    }

    /// Adds a tap on the touch screen to each discrete action, in order; `None` taps nowhere.
    ///
    /// A finger is down in the tick of its action and up before the next one. `Touches` shows it in the same tick on
    /// the route [`InputRoute::Messages`], and in the next frame on [`InputRoute::Direct`].
    pub fn taps(self, positions: impl IntoIterator<Item = impl Into<Option<PointerPosition>>>) -> Self {
        self.each(positions, |held, position| match position.into() {
            Some(position) => held.tap(position),
            None => held,
        })
    }

    /// Adds a turn of the mouse wheel to each discrete action, in order and in lines: 1 is a notch upwards, -1 one
    /// downwards, 0 none. Each tick turns it anew.
    pub fn wheel(self, lines: impl IntoIterator<Item = f32>) -> Self {
        self.each(lines, |held, lines| if lines == 0.0 { held } else { held.push(VirtualAxis::WheelY, lines) })
    }

    fn also<B: Into<VirtualButton>>(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = B>>) -> Self {
        self.each(sets, HeldInput::hold)
    }

    /// Adds a part to each discrete action, in order.
    fn each<T>(mut self, parts: impl IntoIterator<Item = T>, add: impl Fn(HeldInput, T) -> HeldInput) -> Self {
        let Mapping::Discrete(actions) = &mut self.mapping else {
            self.has_stray_sets |= parts.into_iter().next().is_some();
            return self;
        };
        for (index, part) in parts.into_iter().enumerate() {
            if index == actions.len() {
                actions.push(HeldInput::default());
            }
            actions[index] = add(std::mem::take(&mut actions[index]), part);
        }
        self
    }

    /// Adds discrete actions after the others. Has no effect on continuous actions.
    pub fn and_actions(mut self, more: impl IntoIterator<Item = HeldInput>) -> Self {
        if let Mapping::Discrete(actions) = &mut self.mapping {
            actions.extend(more);
        }
        self
    }

    /// Replaces the inputs of a discrete action, such as a click on something that moves. Has no effect on an action
    /// outside [`space`](Self::space).
    pub fn set_action(&mut self, index: usize, held: HeldInput) {
        if let Mapping::Discrete(actions) = &mut self.mapping
            && let Some(action) = actions.get_mut(index)
        {
            *action = held;
        }
    }

    /// Lets go of everything while true, whatever the action: between two presses of one decision. The mouse cursor stays
    /// where it is.
    pub fn rest(&mut self, is_resting: bool) {
        self.is_resting = is_resting;
    }

    /// Returns the first action that points at a position outside of any window, and that position.
    pub fn impossible_position(&self) -> Option<(usize, PointerPosition)> {
        self.positions().find(|(_, position)| !position.is_possible())
    }

    /// Returns the first discrete action that needs the mouse cursor and a finger at once.
    pub fn two_pointers(&self) -> Option<usize> {
        match &self.mapping {
            Mapping::Discrete(actions) => {
                actions.iter().position(|action| action.cursor.is_some() && action.tap.is_some())
            }
            Mapping::Continuous(_) | Mapping::Mixed { .. } => None,
        }
    }

    /// Returns the positions that discrete actions point at, with the number of the action.
    fn positions(&self) -> impl Iterator<Item = (usize, PointerPosition)> + '_ {
        let actions = match &self.mapping {
            Mapping::Discrete(actions) => actions.as_slice(),
            Mapping::Continuous(_) | Mapping::Mixed { .. } => &[],
        };
        let positions = |held: &HeldInput| [held.cursor, held.tap].into_iter().flatten();
        actions.iter().enumerate().flat_map(move |(index, held)| positions(held).map(move |position| (index, position)))
    }

    /// Returns the actions that it can express: as many as it names.
    pub fn space(&self) -> ActionSpace {
        match &self.mapping {
            Mapping::Discrete(actions) => ActionSpace::Discrete(actions.len()),
            Mapping::Continuous(axes) => ActionSpace::Continuous(axes.len()),
            Mapping::Mixed { choices, axes } => {
                let sizes: Vec<usize> = choices.iter().map(Vec::len).collect();
                // Without choices it has no action if there are too many.
                let choices = Choices::new(&sizes).unwrap_or_default();
                let numbers = if choices.sizes().len() == sizes.len() { axes.len() } else { 0 };
                ActionSpace::Mixed(MixedSpace { choices, numbers })
            }
        }
    }

    /// Returns the inputs that this action holds down; empty for an action outside [`space`](Self::space), and while it
    /// [rests](Self::rest).
    pub fn held(&self, action: &ActionValue) -> HeldInput {
        if self.is_resting {
            return HeldInput::default();
        }
        match (&self.mapping, action) {
            (Mapping::Discrete(actions), ActionValue::Discrete(index)) => {
                actions.get(*index as usize).cloned().unwrap_or_default()
            }
            (Mapping::Continuous(axes), ActionValue::Continuous(values)) => {
                axes.iter().zip(values).fold(HeldInput::default(), |held, (axis, &value)| axis.add_to(held, value))
            }
            (Mapping::Mixed { choices, axes }, ActionValue::Mixed { choices: taken, numbers }) => {
                let options = choices.iter().zip(taken).filter_map(|(options, &option)| options.get(option as usize));
                let held = options.fold(HeldInput::default(), |held, option| held.and(option));
                axes.iter().zip(numbers).fold(held, |held, (axis, &value)| axis.add_to(held, value))
            }
            _ => HeldInput::default(),
        }
    }

    /// Returns whether sets of buttons were added to other than discrete actions.
    fn has_stray_sets(&self) -> bool {
        self.has_stray_sets
    }

    /// Returns all inputs that any of its actions may hold or move.
    fn reach(&self) -> HeldInput {
        let join = |all: HeldInput, part: HeldInput| {
            let all = HeldInput { cursor: all.cursor.or(part.cursor), tap: all.tap.or(part.tap), ..all };
            let all = all.hold(part.buttons);
            part.axes.into_iter().fold(all, |all, (axis, _)| all.push(axis, 0.0))
        };
        match &self.mapping {
            Mapping::Discrete(actions) => actions.iter().cloned().fold(HeldInput::default(), join),
            Mapping::Continuous(axes) => axes.iter().map(ActionAxis::reach).fold(HeldInput::default(), join),
            Mapping::Mixed { choices, axes } => {
                let held = choices.iter().flatten().cloned();
                held.chain(axes.iter().map(ActionAxis::reach)).fold(HeldInput::default(), join)
            }
        }
    }

    /// Returns whether any of its actions uses the gamepad.
    fn uses_gamepad(&self) -> bool {
        let reach = self.reach();
        let is_pad_button = |button: &VirtualButton| matches!(button, VirtualButton::Gamepad(_));
        reach.buttons.iter().any(is_pad_button) || reach.axes.iter().any(|(axis, _)| axis.is_gamepad())
    }
}

#[derive(Clone, Debug, PartialEq, Reflect)]
enum Mapping {
    /// The inputs that each discrete action holds.
    Discrete(Vec<HeldInput>),
    /// The inputs that each value of a continuous action moves.
    Continuous(Vec<ActionAxis>),
    /// The inputs of each option of each choice, and those that each number moves.
    Mixed { choices: Vec<Vec<HeldInput>>, axes: Vec<ActionAxis> },
}

/// Lets the actions of agents with a [`VirtualInput`] play through Bevy's own input. Needs
/// [`InputPlugin`], which is part of Bevy's `DefaultPlugins`.
#[derive(Clone, Copy, Debug, Default)]
pub struct VirtualInputPlugin {
    /// The route from an action to the game.
    pub route: InputRoute,
}

impl Plugin for VirtualInputPlugin {
    fn build(&self, app: &mut App) {
        let route = self.route;
        add_what_is_written(app);
        app.init_resource::<VirtualDevices>()
            .init_resource::<DirectInput>()
            // Releases everything at the end of an episode, and at the start of one, so that it begins with nothing
            // held.
            .add_observer(move |event: On<StartEpisode>, mut releaser: InputReleaser| {
                releaser.release(event.entity, route)
            })
            .add_observer(move |event: On<EpisodeEnded>, mut releaser: InputReleaser| {
                releaser.release(event.entity, route)
            })
            .add_systems(
                PreUpdate,
                connect_gamepads.before(InputSystems).before(PlaybotSystems::Begin).before(act::send_messages),
            );
        messages::leave_pointer(app);
        match route {
            InputRoute::Messages => {
                app.add_systems(
                    PreUpdate,
                    (check_claims.before(note_actions), act::send_messages)
                        .chain()
                        .after(check_actions)
                        .in_set(PressSystems)
                        .in_set(PlaybotSystems::Act)
                        .before(InputSystems),
                );
            }
            InputRoute::Direct => {
                app.add_systems(
                    FixedPreUpdate,
                    (check_claims.before(note_actions), act::write_directly)
                        .chain()
                        .after(check_actions)
                        .in_set(PressSystems)
                        .in_set(PlaybotSystems::Act),
                )
                .add_systems(RunFixedMainLoop, act::show_frame.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop))
                .add_systems(
                    PreUpdate,
                    act::settle
                        .in_set(InputSystems)
                        .after(keyboard_input_system)
                        .after(mouse_button_input_system)
                        .after(accumulate_mouse_motion_system)
                        .after(accumulate_mouse_scroll_system)
                        .after(gamepad_connection_system)
                        .after(gamepad_event_processing_system),
                );
            }
        }
    }

    fn finish(&self, app: &mut App) {
        if !app.is_plugin_added::<InputPlugin>()
            && let Some(mut faults) = app.world_mut().get_resource_mut::<Faults>()
        {
            faults.report(
                "virtual input needs Bevy's `InputPlugin`: add it, or `DefaultPlugins`, which bring it".to_owned(),
            );
        }
    }
}

/// Adds the resources that the systems write, even without Bevy's plugin: an app without it gets an error instead of
/// a panic.
fn add_what_is_written(app: &mut App) {
    app.add_message::<KeyboardInput>()
        .add_message::<MouseButtonInput>()
        .add_message::<MouseMotion>()
        .add_message::<MouseWheel>()
        .add_message::<CursorMoved>()
        .add_message::<CursorLeft>()
        .add_message::<TouchInput>()
        .add_message::<WindowEvent>()
        .add_message::<GamepadConnectionEvent>()
        .add_message::<RawGamepadEvent>()
        .add_message::<RawGamepadButtonChangedEvent>()
        .add_message::<RawGamepadAxisChangedEvent>()
        .add_message::<GamepadEvent>()
        .add_message::<GamepadButtonChangedEvent>()
        .add_message::<GamepadButtonStateChangedEvent>()
        .add_message::<GamepadAxisChangedEvent>()
        .init_resource::<ButtonInput<KeyCode>>()
        .init_resource::<ButtonInput<Key>>()
        .init_resource::<ButtonInput<MouseButton>>()
        .init_resource::<AccumulatedMouseMotion>()
        .init_resource::<AccumulatedMouseScroll>();
}

/// The systems that press the inputs of this tick's actions. A system that changes a [`VirtualInput`] for this tick, as
/// [`set_action`](VirtualInput::set_action) and [`rest`](VirtualInput::rest) do, runs before them, in
/// [`PlaybotSystems::Act`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PressSystems;

/// The route from an action to the game.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum InputRoute {
    /// For ticks that are frames. In `PreUpdate`, before [`InputSystems`], messages are
    /// sent as a window would. Bevy's own systems, input managers and the game do the rest in the same frame.
    Messages,
    /// For fixed ticks. In `FixedPreUpdate` the state that games read is written at once. A game in `FixedUpdate`
    /// sees `just_pressed` in the same tick, and exactly once, however many ticks a frame runs. Systems in `Update`
    /// see everything that happened in the frame.
    ///
    /// Messages are sent in the same tick. Only `RawGamepadEvent` is left out, except for the connection of a gamepad.
    /// Bevy's own system would read it in the next frame and play everything a second time. A driver's values are in
    /// `RawGamepadButtonChangedEvent` and `RawGamepadAxisChangedEvent`; most games read `GamepadEvent` and its parts.
    #[default]
    Direct,
}

/// Presses keys for the agent under [`Control::Human`](crate::agent::Control::Human), too, by its
/// [`Action`](crate::action::Action). For windows that keep a person's own devices from the game and turn them into an
/// action. The game then sees exactly the keys that a replay of these actions presses.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct PressesForPeople;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_input::button::VirtualAxis;

    #[test]
    fn discrete_actions_hold_their_sets() {
        let input = VirtualInput::keys([vec![], vec![KeyCode::KeyA]])
            .mouse_buttons([vec![], vec![MouseButton::Left]])
            .gamepad_buttons([vec![], vec![], vec![GamepadButton::South]]);
        assert_eq!(input.space(), ActionSpace::Discrete(3));
        let held = |index| input.held(&ActionValue::Discrete(index)).buttons;
        assert!(held(0).is_empty() && held(9).is_empty());
        assert_eq!(held(1), [KeyCode::KeyA.into(), MouseButton::Left.into()]);
        assert_eq!(held(2), [GamepadButton::South.into()]);
        assert!(input.held(&ActionValue::Continuous(vec![1.0])).buttons.is_empty(), "of another kind");
        assert!(input.uses_gamepad());
    }

    #[test]
    fn values_press_beyond_their_threshold_and_push_by_their_scale() {
        let input = VirtualInput::axes([
            ActionAxis::keys([KeyCode::KeyA], [KeyCode::KeyD]).with_threshold(0.25),
            ActionAxis::mouse_x(8.0),
            ActionAxis::stick(GamepadAxis::LeftStickY),
            ActionAxis::trigger(GamepadButton::RightTrigger2),
        ]);
        let held = input.held(&ActionValue::Continuous(vec![-0.3, 0.5, 7.0, -1.0]));
        assert_eq!(held.buttons, [KeyCode::KeyA.into()]);
        let axes = [
            (VirtualAxis::MouseX, 4.0),
            (VirtualAxis::Stick(GamepadAxis::LeftStickY), 1.0),
            (VirtualAxis::Trigger(GamepadButton::RightTrigger2), 0.0),
        ];
        assert_eq!(held.axes, axes);
        assert!(input.held(&ActionValue::Continuous(vec![0.25, 0.0, 0.0, 0.0])).buttons.is_empty(), "not beyond it");
        assert_eq!(input.reach().buttons.len(), 2);
    }
}
