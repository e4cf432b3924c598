//! The deciders in a window: the person, and the autopilot.

use bevy::{
    input::{ButtonState, InputSystems},
    prelude::*,
};
use bevy_playbot::virtual_input::PersonInput;
use playbot_harness::{eval::Player, prelude::*};

/// The player that takes over from the person, and gives back.
pub struct Autopilot {
    /// Its name in messages.
    pub name: String,
    /// A policy or a bot.
    pub player: Player,
}

/// The agent of the window and its deciders.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub(super) struct Deciders {
    /// The agent.
    pub agent: Entity,
    autopilot: Option<(String, Control)>,
}

impl Deciders {
    /// Prepares the agent for the autopilot; no decider is set yet.
    pub fn new(game: &dyn Game, world: &mut World, agent: Entity, autopilot: Option<Autopilot>) -> Self {
        let autopilot = autopilot.map(|Autopilot { name, player }| {
            player.install(world);
            (name, player.seat(game, world, agent))
        });
        Self { agent, autopilot }
    }

    /// Replaces the autopilot, which is installed already. Returns whether it was not this one before.
    pub fn set_autopilot(&mut self, name: &str, control: Control) -> bool {
        let before = self.autopilot.replace((name.to_owned(), control));
        before.is_none_or(|(before, _)| before != name)
    }

    /// Returns the decider after a change; `None` without an autopilot.
    pub fn other(&self, control: Control) -> Option<Control> {
        let (_, autopilot) = self.autopilot.as_ref()?;
        Some(if control == Control::Human { *autopilot } else { Control::Human })
    }

    /// Names the decider.
    pub fn decider_name(&self, control: Control) -> String {
        match (&self.autopilot, control) {
            (_, Control::Human) => "you play".to_owned(),
            (Some((name, autopilot)), control) if *autopilot == control => format!("{name} plays"),
            _ => "no player".to_owned(),
        }
    }
}

// The state of the person's keyboard, whatever keys the game sees.

/// Held and just pressed keys of the person's keyboard, as of this frame of the window.
#[derive(Resource, Clone, Default, Deref, DerefMut, Reflect)]
#[reflect(Resource)]
pub(super) struct OwnKeys(pub(super) ButtonInput<KeyCode>);

/// All devices of the person, as of this frame of the window.
#[derive(Resource, Clone, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct OwnDevices {
    pub input: PersonInput,
    /// Buttons of gamepads that went down or up in this frame. Their messages come after its decision.
    changes: Vec<(GamepadButton, ButtonState)>,
}

impl OwnDevices {
    /// Notes a button of a gamepad that goes down or up, in time for the next decision.
    pub fn note_gamepad(&mut self, button: GamepadButton, state: ButtonState) {
        self.changes.push((button, state));
    }

    /// Forgets what happened in the frame before, except for the buttons of gamepads.
    pub fn begin_frame(&mut self) {
        self.input.begin_frame();
        for (button, state) in std::mem::take(&mut self.changes) {
            match state {
                ButtonState::Pressed => self.input.press(button),
                ButtonState::Released => self.input.release(button),
            }
        }
    }
}

/// The set in which they are read, in `PreUpdate`, where the game sees the same keyboard.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct OwnKeysRead;

/// Reads the keys in games that see the person's keyboard.
pub(super) fn build(app: &mut App) {
    let read = |keys: Res<ButtonInput<KeyCode>>, mut own: ResMut<OwnKeys>| own.0.clone_from(&keys);
    app.init_resource::<OwnKeys>().add_systems(PreUpdate, read.in_set(OwnKeysRead).after(InputSystems));
}
