//! The session in a window: its deciders, who are the person and the autopilot, and its levels.

use bevy::{
    input::{ButtonState, InputSystems},
    prelude::*,
};
use bevy_playbot::{engine::flush_unfinished, episode::EpisodeResult, fault::Faults, virtual_input::PersonInput};
use playbot_harness::{eval::Player, prelude::*};
use playbot_report::counted;

// The deciders, and the keys of the window.

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
pub(super) fn build_own_keys(app: &mut App) {
    let read = |keys: Res<ButtonInput<KeyCode>>, mut own: ResMut<OwnKeys>| own.0.clone_from(&keys);
    app.init_resource::<OwnKeys>().add_systems(PreUpdate, read.in_set(OwnKeysRead).after(InputSystems));
}

// The order of the levels, and the result of the last episode.

/// The levels of a session. A won level is followed by the next, a lost one comes again, and the first follows the
/// last.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct Playlist {
    levels: LevelSplit,
    current: u64,
}

impl Playlist {
    /// Takes levels, and the first one to play.
    pub fn new(levels: LevelSplit, first: u64) -> Self {
        let current = first.clamp(levels.first, levels.last);
        Self { levels, current }
    }

    /// Returns the mode of the levels.
    pub fn mode(&self) -> &str {
        &self.levels.mode
    }

    /// Returns the levels that a policy for this window trains on: at most 64 of them.
    pub fn trained(&self) -> LevelSplit {
        let last = self.levels.last.min(self.levels.first.saturating_add(63));
        LevelSplit { last, ..self.levels.clone() }
    }

    /// Goes on to the next level.
    pub(super) fn advance(&mut self) {
        self.current = if self.current == self.levels.last { self.levels.first } else { self.current + 1 };
    }

    /// Returns the current level, as an agent's queue.
    pub(super) fn queue(&self) -> LevelQueue {
        LevelQueue::Always(self.current)
    }
}

/// `time_limit` is the limit of the game's adapter, in ticks.
pub(super) fn build_last_episode(app: &mut App, time_limit: Option<u32>) {
    app.insert_resource(LastEpisode { result: None, time_limit }).add_observer(note_end);
}

/// The last finished episode.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
pub(super) struct LastEpisode {
    result: Option<EpisodeResult>,
    /// Ticks after which the game's adapter ends an episode.
    time_limit: Option<u32>,
}

impl LastEpisode {
    /// Describes its end.
    pub fn words(&self) -> Option<String> {
        let EpisodeResult { level, end, success, ticks, .. } = self.result?;
        let how = match end {
            EpisodeEnd::Terminated { success: true } => "won",
            EpisodeEnd::Terminated { success: false } => "lost",
            EpisodeEnd::Truncated if success => "reached the goal, time was up",
            EpisodeEnd::Truncated => "out of time",
        };
        // The limit suits bots, so a person has to learn how to play without it.
        let is_cut = end == EpisodeEnd::Truncated && self.time_limit.is_some_and(|limit| ticks == limit);
        let advice = if is_cut { " (--no-time-limit lifts the limit)" } else { "" };
        Some(format!("level {level} {how} after {}{advice}", counted(u64::from(ticks), "tick")))
    }
}

/// Plays the next level after a won one, and any other again.
fn note_end(
    event: On<EpisodeEnded>,
    mut last: ResMut<LastEpisode>,
    mut playlist: ResMut<Playlist>,
    deciders: Res<Deciders>,
    mut queues: Query<&mut LevelQueue>,
) {
    if event.entity != deciders.agent {
        return;
    }
    last.result = Some(event.result);
    if event.success {
        playlist.advance();
    }
    if let Ok(mut queue) = queues.get_mut(deciders.agent) {
        *queue = playlist.queue();
    }
}

/// Leaves the running level; a recording keeps what was played of it, as aborted.
pub(super) fn leave_level(world: &mut World) {
    if let Err(error) = flush_unfinished(world) {
        world.resource_mut::<Faults>().report(error.to_string());
    }
    let (agent, queue) = (world.resource::<Deciders>().agent, world.resource::<Playlist>().queue());
    let mut agent = world.entity_mut(agent);
    agent.insert(queue);
    if let Some(mut episode) = agent.get_mut::<Episode>() {
        episode.abandon();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_episode_that_the_time_limit_ended_names_the_option_that_lifts_it() {
        let words = |end, ticks, time_limit| {
            let result =
                EpisodeResult { level: 1, end, success: end == EpisodeEnd::WON, ticks, clipped: 0, total_reward: 0.0 };
            LastEpisode { result: Some(result), time_limit }.words().expect("an episode")
        };
        let late = words(EpisodeEnd::Truncated, 120, Some(120));
        assert_eq!(late, "level 1 out of time after 120 ticks (--no-time-limit lifts the limit)");
        // The game's own rules end these.
        for time_limit in [None, Some(200)] {
            assert_eq!(words(EpisodeEnd::Truncated, 120, time_limit), "level 1 out of time after 120 ticks");
        }
        assert_eq!(words(EpisodeEnd::WON, 120, Some(120)), "level 1 won after 120 ticks");
    }

    #[test]
    fn after_the_last_level_comes_the_first() {
        let mut playlist = Playlist::new("hard:3..5".parse().expect("a split"), 4);
        let mut levels = Vec::new();
        for _ in 0..4 {
            levels.push(playlist.current);
            playlist.advance();
        }
        assert_eq!(levels, [4, 5, 3, 4]);
    }
}
