//! The plugin of virtual input.

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
    },
    prelude::*,
};

use super::{
    act::{self, InputReleaser},
    claims::check_claims,
    devices::VirtualDevices,
    direct::{self, DirectInput},
    gamepad::connect_gamepads,
    route::InputRoute,
};
use crate::{
    action::check_actions,
    episode::{EpisodeEnded, StartEpisode},
    fault::Faults,
    panics::note_actions,
    systems::PlaybotSystems,
};

/// Lets the actions of agents with a [`VirtualInput`](super::VirtualInput) play through Bevy's own input. Needs
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
            .add_systems(PreUpdate, connect_gamepads.before(InputSystems).before(act::send_messages));
        match route {
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

/// Adds the resources that the systems write, even without Bevy's plugin: an app without it gets an error instead of
/// a panic.
fn add_what_is_written(app: &mut App) {
    app.add_message::<KeyboardInput>()
        .add_message::<MouseButtonInput>()
        .add_message::<MouseMotion>()
        .add_message::<MouseWheel>()
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
