//! The window's own keys. The game's are in its [`KeyBindings`].

use crate::window::{
    Playlist,
    camera::Zoom,
    ending::Ending,
    notice::Notice,
    session::{Deciders, OwnKeys, OwnKeysRead, leave_level},
    teaching::teach,
    title::Pace,
};
use bevy::{
    ecs::{
        schedule::{IntoScheduleConfigs, ScheduleConfigs},
        system::ScheduleSystem,
    },
    prelude::*,
};
use bevy_playbot::overlay::Overlay;
use playbot_harness::prelude::*;

pub(super) fn build(app: &mut App) {
    app.add_systems(PreUpdate, systems().after(OwnKeysRead));
}

/// Returns the systems of the keys.
pub(super) fn systems() -> ScheduleConfigs<ScheduleSystem> {
    (teach, hand_over, change_level, other_keys).chain()
}

/// Makes V explain itself, where another build of the program has a view in space of the game.
pub(super) fn excuse_view(app: &mut App) {
    let says = |keys: Res<OwnKeys>, mut notice: ResMut<Notice>| {
        if keys.just_pressed(KeyCode::KeyV) {
            notice.say("no view in space: this program was built without --features view3d");
        }
    };
    app.add_systems(PreUpdate, says.after(OwnKeysRead));
}

/// Hands over to the autopilot and back with Tab.
fn hand_over(
    keys: Res<OwnKeys>,
    deciders: Res<Deciders>,
    mut agents: Query<(&mut Control, &mut ActiveSkill)>,
    mut notice: ResMut<Notice>,
) {
    let Ok((mut control, mut skill)) = agents.get_mut(deciders.agent) else { return };
    if !keys.just_pressed(KeyCode::Tab) || !control.is_active() {
        return;
    }
    match deciders.other(*control) {
        Some(other) => {
            *control = other;
            // A skill that was drawn for another state does not fit this one.
            skill.ticks_left = 0;
        }
        None => notice
            .say("no autopilot to hand over to: F9 records and F10 learns, or start with --policy, --run or --bot"),
    }
}

/// Plays the level again with R, the next one with N.
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

/// Pauses with P, zooms with plus and minus, hides the overlay with F8, ends with Escape and Ctrl-Q.
fn other_keys(
    keys: Res<OwnKeys>,
    mut pace: ResMut<Pace>,
    zoom: Option<ResMut<Zoom>>,
    overlay: Option<ResMut<Overlay>>,
    mut ending: ResMut<Ending>,
) {
    if let Some(mut overlay) = overlay.filter(|_| keys.just_pressed(KeyCode::F8)) {
        overlay.toggle();
    }
    if keys.just_pressed(KeyCode::KeyP) {
        pace.toggle_pause();
    }
    // Games with cameras of their own have no zoom.
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
