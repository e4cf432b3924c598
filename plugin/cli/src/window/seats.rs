//! The deciders in a window: the person, and the autopilot.

use crate::window::Playlist;
use bevy::{input::InputSystems, prelude::*};
use bevy_playbot::episode::EpisodeResult;
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
pub(super) struct Seats {
    /// The agent.
    pub agent: Entity,
    autopilot: Option<(String, Control)>,
}

impl Seats {
    /// Prepares the agent for the autopilot; no decider is set yet.
    pub fn new(game: &dyn Game, world: &mut World, agent: Entity, autopilot: Option<Autopilot>) -> Self {
        let autopilot = autopilot.map(|Autopilot { name, player }| {
            player.install(world);
            (name, player.seat(game, world, agent))
        });
        Self { agent, autopilot }
    }

    /// Returns the decider after a change; `None` without an autopilot.
    pub fn other(&self, control: Control) -> Option<Control> {
        let (_, autopilot) = self.autopilot.as_ref()?;
        Some(if control == Control::Human { *autopilot } else { Control::Human })
    }

    /// Names the decider.
    pub fn who(&self, control: Control) -> String {
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

/// The set in which they are read, in `PreUpdate`, where the game sees the same keyboard.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct OwnKeysRead;

/// Reads the keys in games that see the person's keyboard.
pub(super) fn build(app: &mut App) {
    let read = |keys: Res<ButtonInput<KeyCode>>, mut own: ResMut<OwnKeys>| own.0.clone_from(&keys);
    app.init_resource::<OwnKeys>().add_systems(PreUpdate, read.in_set(OwnKeysRead).after(InputSystems));
}

// Result of the last episode, and the next level.

pub(super) fn build_score(app: &mut App) {
    app.init_resource::<LastEpisode>().add_observer(note_end);
}

/// The last finished episode.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct LastEpisode(Option<EpisodeResult>);

impl LastEpisode {
    /// Describes its end.
    pub fn words(&self) -> Option<String> {
        let EpisodeResult { level, end, success, ticks, .. } = self.0?;
        let how = match end {
            EpisodeEnd::Terminated { success: true } => "won",
            EpisodeEnd::Terminated { success: false } => "lost",
            EpisodeEnd::Truncated if success => "reached the goal, time was up",
            EpisodeEnd::Truncated => "out of time",
        };
        Some(format!("level {level} {how} after {ticks} ticks"))
    }
}

/// Plays the next level after a won one, and any other again.
fn note_end(
    event: On<EpisodeEnded>,
    mut last: ResMut<LastEpisode>,
    mut playlist: ResMut<Playlist>,
    seats: Res<Seats>,
    mut queues: Query<&mut LevelQueue>,
) {
    last.0 = Some(event.result);
    if event.success {
        playlist.advance();
    }
    if let Ok(mut queue) = queues.get_mut(seats.agent) {
        *queue = playlist.queue();
    }
}
