//! Tests of keys.

use bevy::{
    input::keyboard::{Key, KeyboardInput},
    prelude::*,
};
use bevy_playbot::{
    engine::PressesForPeople,
    prelude::*,
    virtual_input::{InputRoute, VirtualDevices, VirtualInput, VirtualInputPlugin},
};

use super::scripted::{InFrames, STEP, Script, actions, app_with, frames, frames_of, left, ticks};

/// Views of a fixed tick on the script nothing, left, left, nothing, nothing, left.
const SEEN: [&str; 6] = ["", "Pd", "P", "u", "", "Pd"];

fn script() -> Vec<ActionValue> {
    actions(&[0, 1, 1, 0, 0, 1])
}

#[test]
fn a_key_is_pressed_held_and_released_in_the_tick_of_its_action() {
    let (mut app, _) = app_with(InputRoute::Direct, left(), script());
    (0..6).for_each(|_| app.update());
    assert_eq!(ticks(&app), SEEN);
    assert_eq!(frames(&app), SEEN);
}

#[test]
fn several_ticks_in_a_frame_each_see_a_press_once_and_the_frame_sees_them_all() {
    let (mut app, _) = app_with(InputRoute::Direct, left(), script());
    frames_of(&mut app, STEP * 3);
    app.update();
    app.update();
    assert_eq!(ticks(&app), SEEN);
    // Pressed in the first frame and still held; released in the second and pressed again.
    assert_eq!(frames(&app), ["Pd", "Pdu"]);
}

#[test]
fn frames_between_two_ticks_see_a_press_in_one_of_them() {
    let (mut app, _) = app_with(InputRoute::Direct, left(), script());
    frames_of(&mut app, STEP / 4);
    (0..24).for_each(|_| app.update());
    assert_eq!(ticks(&app), SEEN);
    let marks = |mark| frames(&app).iter().filter(|seen| seen.contains(mark)).count();
    assert_eq!((marks('d'), marks('u')), (2, 1));
    assert_eq!(marks('P'), 9, "eight frames of two ticks, and the last one");
}

#[test]
fn a_tap_within_a_frame_is_not_seen_again_when_its_messages_arrive() {
    let (mut app, _) = app_with(InputRoute::Direct, left(), actions(&[1, 0, 0]));
    frames_of(&mut app, STEP * 2);
    app.update();
    frames_of(&mut app, STEP / 2);
    app.update();
    app.update();
    assert_eq!(ticks(&app), ["Pd", "u", ""]);
    assert_eq!(frames(&app), ["du", "", ""]);
}

#[test]
fn messages_sent_before_bevys_input_systems_are_seen_in_the_same_frame() {
    let (mut app, agent) = app_with(InputRoute::Messages, left(), actions(&[0]));
    app.update();
    app.world_mut().resource_mut::<InFrames>().0.clear();
    // Under frames as ticks, actions are decided before this point of the frame: here they are put there.
    app.world_mut().resource_mut::<Script>().0 = actions(&[1]);
    for index in [0, 1, 1, 0, 0, 1] {
        app.world_mut().entity_mut(agent).insert(Action(ActionValue::Discrete(index)));
        app.world_mut().resource_mut::<Script>().0 = actions(&[index]);
        app.update();
    }
    assert_eq!(frames(&app), SEEN);
}

#[test]
fn messages_say_what_a_window_would_say() {
    let input = VirtualInput::keys([vec![], vec![KeyCode::KeyQ]]);
    let (mut app, agent) = app_with(InputRoute::Messages, input, actions(&[0]));
    app.update();
    let mut cursor = app.world().resource::<Messages<KeyboardInput>>().get_cursor();
    app.world_mut().entity_mut(agent).insert(Action(ActionValue::Discrete(1)));
    app.update();
    let messages: Vec<_> = cursor.read(app.world().resource::<Messages<KeyboardInput>>()).cloned().collect();
    let [message] = messages.as_slice() else { panic!("{messages:?}") };
    assert_eq!((message.key_code, message.logical_key.clone()), (KeyCode::KeyQ, Key::Character("q".into())));
    assert!(message.state.is_pressed() && !message.repeat && message.text.as_deref() == Some("q"));
    assert!(app.world().resource::<ButtonInput<Key>>().pressed(Key::Character("q".into())));
}

#[test]
fn people_and_idle_agents_press_nothing_and_what_was_held_is_let_go() {
    for route in [InputRoute::Direct, InputRoute::Messages] {
        for control in [Control::Human, Control::Idle] {
            let (mut app, agent) = app_with(route, left(), actions(&[1]));
            (0..3).for_each(|_| app.update());
            let is_down = |app: &App| app.world().resource::<ButtonInput<KeyCode>>().pressed(KeyCode::ArrowLeft);
            assert!(is_down(&app));
            app.world_mut().entity_mut(agent).insert(control);
            app.update();
            assert!(!is_down(&app), "{route:?} {control:?}");
            assert_eq!(app.world().resource::<VirtualDevices>().held().count(), 0);
            app.world_mut().entity_mut(agent).insert(Control::Bot);
            (0..2).for_each(|_| app.update());
            assert!(is_down(&app), "pressed again");
            app.world_mut().entity_mut(agent).despawn();
            app.update();
            assert!(!is_down(&app), "an agent that is gone holds nothing");
        }
    }
}

#[test]
fn an_episode_begins_with_nothing_held_whatever_came_before() {
    let (mut app, agent) = app_with(InputRoute::Direct, left(), actions(&[1]));
    (0..3).for_each(|_| app.update());
    app.world_mut().get_mut::<Episode>(agent).expect("an agent").terminate(true);
    app.update();
    app.update();
    assert_eq!(ticks(&app), ["Pd", "P", "P", "P", "Pd"], "as in a first episode");
    // Left in the middle, as a replay does it.
    app.world_mut().get_mut::<Episode>(agent).expect("an agent").abandon();
    app.update();
    assert_eq!(ticks(&app).last().map(String::as_str), Some("Pd"));
}

#[test]
fn two_agents_that_claim_one_key_are_a_fault_that_names_both() {
    let (mut app, _) = app_with(InputRoute::Direct, left(), actions(&[0]));
    let other = VirtualInput::keys([vec![KeyCode::KeyA], vec![KeyCode::KeyA, KeyCode::ArrowLeft]]);
    let other = app.world_mut().spawn((Agent::new(4, other.space()), other, Control::Policy)).id();
    let fault = app.tick().expect_err("both").to_string();
    assert!(fault.contains("agents 0 and 4 both claim ArrowLeft"), "{fault}");
    assert_eq!(app.world().get::<Control>(other), Some(&Control::Idle), "only one of them plays on");
    app.tick().expect("sound");
    app.world_mut().entity_mut(other).insert(Control::Human);
    app.tick().expect("people have hands of their own");
}

#[test]
fn a_mapping_that_does_not_fit_the_actions_is_a_fault() {
    let (mut app, agent) = app_with(InputRoute::Direct, left(), actions(&[0]));
    app.world_mut().entity_mut(agent).insert(Agent::new(0, ActionSpace::Discrete(5)));
    let fault = app.tick().expect_err("three are missing").to_string();
    assert!(
        fault.contains("agent 0") && fault.contains("for 2 discrete") && fault.contains("has 5 discrete"),
        "{fault}"
    );
}

#[test]
fn without_bevys_input_there_is_a_fault_and_no_panic() {
    let mut app = headless_app();
    app.add_plugins(VirtualInputPlugin::default());
    app.finish();
    let fault = app.tick().expect_err("no input").to_string();
    assert!(fault.contains("`InputPlugin`"), "{fault}");
}

#[test]
fn people_press_by_their_actions_where_their_own_keys_are_kept_from_the_game() {
    for route in [InputRoute::Direct, InputRoute::Messages] {
        let (mut app, agent) = app_with(route, left(), actions(&[0]));
        let left = Action(ActionValue::Discrete(1));
        app.world_mut().entity_mut(agent).insert((Control::Human, PressesForPeople, left));
        (0..2).for_each(|_| app.update());
        assert!(app.world().resource::<ButtonInput<KeyCode>>().pressed(KeyCode::ArrowLeft), "{route:?}");
    }
}
