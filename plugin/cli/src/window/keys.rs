//! The keys that are the window's own: the game's are in its [`KeyBindings`](bevy_playbot::key_bindings::KeyBindings).

use bevy::{
    ecs::schedule::{IntoScheduleConfigs, ScheduleConfigs},
    ecs::system::ScheduleSystem,
    prelude::*,
};
use bevy_playbot::{demo::recorder::flush_unfinished, fault::Faults};
use playbot_lab::prelude::*;

use super::{
    Playlist,
    camera::Zoom,
    ending::Ending,
    own_keys::{OwnKeys, OwnKeysRead},
    pace::Pace,
    seats::Seats,
    title::Notice,
};

pub(super) fn build(app: &mut App) {
    app.add_systems(PreUpdate, systems().after(OwnKeysRead));
}

/// What the keys do.
pub(super) fn systems() -> ScheduleConfigs<ScheduleSystem> {
    (hand_over, change_level, other_keys).into_configs()
}

/// Has V say why it does nothing, where the game could be seen in space by another build of the program.
pub(super) fn excuse_view(app: &mut App) {
    let says = |keys: Res<OwnKeys>, mut notice: ResMut<Notice>| {
        if keys.just_pressed(KeyCode::KeyV) {
            notice.say("no view in space: this program was built without --features view3d");
        }
    };
    app.add_systems(PreUpdate, says.after(OwnKeysRead));
}

/// Tab: the autopilot takes over, or gives back.
fn hand_over(
    keys: Res<OwnKeys>,
    seats: Res<Seats>,
    mut agents: Query<(&mut Control, &mut ActiveSkill)>,
    mut notice: ResMut<Notice>,
) {
    let Ok((mut control, mut skill)) = agents.get_mut(seats.agent) else { return };
    if !keys.just_pressed(KeyCode::Tab) || !control.is_active() {
        return;
    }
    match seats.other(*control) {
        Some(other) => {
            *control = other;
            // A skill that was drawn for another state says nothing about this one.
            skill.ticks_left = 0;
        }
        None => notice.say("nobody to hand over to: start with --policy, --run or --bot"),
    }
}

/// R plays the level again, N the next one.
fn change_level(keys: Res<OwnKeys>, mut playlist: ResMut<Playlist>, mut pace: ResMut<Pace>, mut commands: Commands) {
    let next = keys.just_pressed(KeyCode::KeyN);
    if !next && !keys.just_pressed(KeyCode::KeyR) {
        return;
    }
    if next {
        playlist.advance();
    }
    pace.go_on();
    commands.queue(leave_level);
}

/// Leaves the running level; a recording keeps what was played of it, as aborted.
fn leave_level(world: &mut World) {
    if let Err(error) = flush_unfinished(world) {
        world.resource_mut::<Faults>().report(error.to_string());
    }
    let (agent, queue) = (world.resource::<Seats>().agent, world.resource::<Playlist>().queue());
    let mut agent = world.entity_mut(agent);
    agent.insert(queue);
    if let Some(mut episode) = agent.get_mut::<Episode>() {
        episode.abandon();
    }
}

/// P pauses, plus and minus change how much is seen, Escape and Ctrl-Q end.
fn other_keys(keys: Res<OwnKeys>, mut pace: ResMut<Pace>, zoom: Option<ResMut<Zoom>>, mut ending: ResMut<Ending>) {
    if keys.just_pressed(KeyCode::KeyP) {
        pace.toggle_pause();
    }
    // Games with cameras of their own know no zoom.
    if let Some(mut zoom) = zoom {
        if keys.any_just_pressed([KeyCode::Minus, KeyCode::NumpadSubtract]) {
            zoom.out();
        }
        if keys.any_just_pressed([KeyCode::Equal, KeyCode::NumpadAdd]) {
            zoom.closer();
        }
    }
    let control = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    if keys.just_pressed(KeyCode::Escape) || control && keys.just_pressed(KeyCode::KeyQ) {
        ending.ask();
    }
}
