//! The plugin of virtual input, and its two routes.

use bevy::{
    input::{
        InputPlugin, InputSystems,
        gamepad::{
            GamepadConnectionEvent, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent, RawGamepadEvent,
            gamepad_connection_system, gamepad_event_processing_system,
        },
        keyboard::{Key, KeyboardInput, keyboard_input_system},
        mouse::{
            AccumulatedMouseMotion, AccumulatedMouseScroll, MouseButtonInput, MouseMotion, MouseWheel,
            accumulate_mouse_motion_system, accumulate_mouse_scroll_system, mouse_button_input_system,
        },
    },
    prelude::*,
};

use super::{
    act,
    claims::check_claims,
    devices::VirtualDevices,
    direct::{self, DirectInput},
    gamepad::connect_gamepads,
};
use crate::{action::check_actions, fault::Faults, panics::note_actions, systems::PlaybotSystems};

/// The way from an action to the game.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum InputRoute {
    /// For ticks that are frames: in `PreUpdate`, before [`InputSystems`], messages are sent as a window would, and Bevy's
    /// own systems, input managers and the game do the rest in the same frame.
    Messages,
    /// For fixed ticks: in `FixedPreUpdate` what games read is written at once, so that a game in `FixedUpdate` sees
    /// `just_pressed` in the same tick, and exactly once, however many ticks a frame runs. Systems in `Update` see
    /// everything that happened in the frame. Of gamepads the state changes and no messages are sent.
    #[default]
    Direct,
}

/// Lets the actions of agents with a [`VirtualInput`](super::VirtualInput) play through Bevy's own input. Needs
/// [`InputPlugin`], which is part of Bevy's `DefaultPlugins`.
#[derive(Clone, Copy, Debug, Default)]
pub struct VirtualInputPlugin {
    /// The way from an action to the game.
    pub route: InputRoute,
}

impl Plugin for VirtualInputPlugin {
    fn build(&self, app: &mut App) {
        add_what_is_written(app);
        app.init_resource::<VirtualDevices>()
            .init_resource::<DirectInput>()
            .add_observer(act::release_at_start)
            .add_observer(act::release_at_end)
            .add_systems(PreUpdate, connect_gamepads.before(InputSystems).before(act::send_messages));
        match self.route {
            InputRoute::Messages => {
                app.add_systems(
                    PreUpdate,
                    (check_claims.before(note_actions), act::send_messages)
                        .chain()
                        .after(check_actions)
                        .in_set(PlaybotSystems::Act)
                        .before(InputSystems),
                );
            }
            InputRoute::Direct => {
                app.add_systems(
                    FixedPreUpdate,
                    (check_claims.before(note_actions), direct::write_directly)
                        .chain()
                        .after(check_actions)
                        .in_set(PlaybotSystems::Act),
                )
                .add_systems(RunFixedMainLoop, direct::show_frame.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop))
                .add_systems(
                    PreUpdate,
                    direct::settle
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

/// What the systems write, whether or not Bevy's plugin is there: whoever adds nothing else gets an error and no panic.
fn add_what_is_written(app: &mut App) {
    app.add_message::<KeyboardInput>()
        .add_message::<MouseButtonInput>()
        .add_message::<MouseMotion>()
        .add_message::<MouseWheel>()
        .add_message::<GamepadConnectionEvent>()
        .add_message::<RawGamepadEvent>()
        .add_message::<RawGamepadButtonChangedEvent>()
        .add_message::<RawGamepadAxisChangedEvent>()
        .init_resource::<ButtonInput<KeyCode>>()
        .init_resource::<ButtonInput<Key>>()
        .init_resource::<ButtonInput<MouseButton>>()
        .init_resource::<AccumulatedMouseMotion>()
        .init_resource::<AccumulatedMouseScroll>();
}
