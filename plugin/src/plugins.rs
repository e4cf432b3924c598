//! All plugins of a game that ships with agents.

use bevy::{app::PluginGroupBuilder, prelude::*};

use crate::{
    keyboard::KeyboardPlugin,
    placement::TickPlacement,
    plugin::PlaybotPlugin,
    takeover::{GameIdentity, TakeoverPlugin},
    virtual_input::{InputRoute, VirtualInputPlugin},
};

/// The plugins that a game with agents needs at run time:
///
/// | plugin | what it brings |
/// |---|---|
/// | [`PlaybotPlugin`] | agents, episodes, observations, skills, policies, recording and replay |
/// | [`VirtualInputPlugin`] | actions that press keys, for agents with a [`VirtualInput`](crate::virtual_input::VirtualInput) |
/// | [`KeyboardPlugin`] | keys that become actions, for agents with [`KeyBindings`](crate::key_bindings::KeyBindings) |
/// | [`TakeoverPlugin`] | `PLAYBOT=record:FILE`, `policy:FILE` and `replay:FILE`, and a key, in a shipped build |
///
/// Needs Bevy's time and input, which are part of `DefaultPlugins`.
///
/// ```
/// use bevy::{input::InputPlugin, prelude::*, time::TimePlugin};
/// use bevy_playbot::{plugins::PlaybotPlugins, prelude::*};
///
/// let mut app = App::new();
/// // A game with a window adds `DefaultPlugins` instead of these two.
/// app.add_plugins((TimePlugin, InputPlugin)).add_plugins(PlaybotPlugins::new("walk", 1));
/// app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human));
/// app.update();
/// ```
#[derive(Clone, Debug)]
pub struct PlaybotPlugins {
    game: GameIdentity,
    placement: TickPlacement,
}

impl PlaybotPlugins {
    /// Creates the plugins for a game of this name, at this version of its rules: see
    /// [`GameIdentity`].
    pub fn new(name: &str, version: u32) -> Self {
        Self { game: GameIdentity::new(name, version), placement: TickPlacement::Fixed }
    }

    /// Sets the mode of the game.
    pub fn with_mode(self, mode: &str) -> Self {
        Self { game: self.game.with_mode(mode), ..self }
    }

    /// Adapts to a game whose ticks are whole frames: virtual input then uses messages.
    pub fn in_frames(self) -> Self {
        Self { placement: TickPlacement::Frame, ..self }
    }
}

impl PluginGroup for PlaybotPlugins {
    fn build(self) -> PluginGroupBuilder {
        let route = match self.placement {
            TickPlacement::Fixed => InputRoute::Direct,
            TickPlacement::Frame => InputRoute::Messages,
        };
        PluginGroupBuilder::start::<Self>()
            .add(PlaybotPlugin { placement: self.placement })
            .add(VirtualInputPlugin { route })
            .add(KeyboardPlugin)
            .add(TakeoverPlugin::new(self.game))
    }
}
