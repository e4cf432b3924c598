//! An agent's action presses keys: when games see it, on both routes, however ticks and frames fall.

use std::time::Duration;

use bevy::{
    input::{
        InputPlugin,
        keyboard::{Key, KeyboardInput},
        mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseMotion},
    },
    prelude::*,
    time::TimeUpdateStrategy,
};
use bevy_playbot::{
    headless::set_tick_rate,
    prelude::*,
    test_app::test_app,
    virtual_input::{
        ActionAxis, InputRoute, PressesForPeople, VirtualDevices, VirtualGamepad, VirtualInput, VirtualInputPlugin,
    },
};

const STEP: Duration = Duration::from_millis(16);

/// The actions of the ticks to come; the last one stays.
#[derive(Resource)]
struct Script(Vec<ActionValue>);

fn follow(mut script: ResMut<Script>, mut agents: Query<(&Control, &Episode, &mut Action)>) {
    for (control, episode, mut action) in &mut agents {
        if *control == Control::Bot && episode.is_running() {
            action.0 = script.0[0].clone();
            if script.0.len() > 1 {
                script.0.remove(0);
            }
        }
    }
}

/// What a game reads of the key in one run of its system: `P`ressed, `d`own just now, `u`p just now.
fn read(keys: &ButtonInput<KeyCode>) -> String {
    let mut text = String::new();
    let key = KeyCode::ArrowLeft;
    for (mark, is) in [('P', keys.pressed(key)), ('d', keys.just_pressed(key)), ('u', keys.just_released(key))] {
        if is {
            text.push(mark);
        }
    }
    text
}

#[derive(Resource, Default)]
struct InTicks(Vec<String>);

#[derive(Resource, Default)]
struct InFrames(Vec<String>);

fn app_with(route: InputRoute, input: VirtualInput, script: Vec<ActionValue>) -> (App, Entity) {
    let mut app = test_app();
    app.add_plugins((InputPlugin, VirtualInputPlugin { route }))
        .insert_resource(Script(script))
        .init_resource::<InTicks>()
        .init_resource::<InFrames>()
        .add_systems(FixedPreUpdate, follow.in_set(PlaybotSystems::Decide).ambiguous_with_all())
        .add_systems(FixedUpdate, |keys: Res<ButtonInput<KeyCode>>, mut seen: ResMut<InTicks>| seen.0.push(read(&keys)))
        .add_systems(Update, |keys: Res<ButtonInput<KeyCode>>, mut seen: ResMut<InFrames>| seen.0.push(read(&keys)));
    set_tick_rate(&mut app, 1.0 / STEP.as_secs_f64());
    app.insert_resource(Time::<Fixed>::from_duration(STEP));
    frames_of(&mut app, STEP);
    let agent = app.world_mut().spawn((Agent::new(0, input.space()), input, Control::Bot)).id();
    // The first frame only starts the clock.
    app.update();
    app.world_mut().resource_mut::<InFrames>().0.clear();
    (app, agent)
}

fn frames_of(app: &mut App, length: Duration) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(length));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(1));
}

fn left() -> VirtualInput {
    VirtualInput::keys([vec![], vec![KeyCode::ArrowLeft]])
}

fn actions(list: &[u32]) -> Vec<ActionValue> {
    list.iter().map(|&index| ActionValue::Discrete(index)).collect()
}

fn ticks(app: &App) -> &[String] {
    &app.world().resource::<InTicks>().0
}

fn frames(app: &App) -> &[String] {
    &app.world().resource::<InFrames>().0
}

/// What every run of a fixed tick must see of the script nothing, left, left, nothing, nothing, left.
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
fn people_press_by_their_actions_where_their_own_keys_are_kept_from_the_game() {
    for route in [InputRoute::Direct, InputRoute::Messages] {
        let (mut app, agent) = app_with(route, left(), actions(&[0]));
        let left = Action(ActionValue::Discrete(1));
        app.world_mut().entity_mut(agent).insert((Control::Human, PressesForPeople, left));
        (0..2).for_each(|_| app.update());
        assert!(app.world().resource::<ButtonInput<KeyCode>>().pressed(KeyCode::ArrowLeft), "{route:?}");
    }
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
    assert!(fault.contains("agent 0") && fault.contains("Discrete(2)") && fault.contains("Discrete(5)"), "{fault}");
}

#[test]
fn without_bevys_input_there_is_a_fault_and_no_panic() {
    let mut app = headless_app();
    app.add_plugins(VirtualInputPlugin::default());
    app.finish();
    let fault = app.tick().expect_err("no input").to_string();
    assert!(fault.contains("`InputPlugin`"), "{fault}");
}

#[derive(Resource, Default)]
struct Motions {
    ticks: Vec<Vec2>,
    frames: Vec<Vec2>,
    messages: Vec2,
}

fn mouse() -> VirtualInput {
    VirtualInput::axes([ActionAxis::mouse_x(10.0), ActionAxis::wheel(2.0)])
}

fn note_motions(app: &mut App) {
    let in_ticks =
        |motion: Res<AccumulatedMouseMotion>, wheel: Res<AccumulatedMouseScroll>, mut seen: ResMut<Motions>| {
            seen.ticks.push(Vec2::new(motion.delta.x, wheel.delta.y));
        };
    let in_frames = |motion: Res<AccumulatedMouseMotion>,
                     wheel: Res<AccumulatedMouseScroll>,
                     mut read: MessageReader<MouseMotion>,
                     mut seen: ResMut<Motions>| {
        seen.frames.push(Vec2::new(motion.delta.x, wheel.delta.y));
        seen.messages += read.read().map(|message| message.delta).sum::<Vec2>();
    };
    app.init_resource::<Motions>()
        .add_systems(FixedUpdate, in_ticks.ambiguous_with_all())
        .add_systems(Update, in_frames);
}

#[test]
fn each_tick_sees_its_own_motion_and_the_frame_their_sum() {
    let values = |x: f32| ActionValue::Continuous(vec![x, -x]);
    let script = vec![values(1.0), values(2.0), values(0.0), values(0.5), values(0.0)];
    let (mut app, _) = app_with(InputRoute::Direct, mouse(), script);
    note_motions(&mut app);
    frames_of(&mut app, STEP * 3);
    app.update();
    frames_of(&mut app, STEP);
    (0..3).for_each(|_| app.update());
    let seen = app.world().resource::<Motions>();
    let at = |x: f32| Vec2::new(10.0 * x, -2.0 * x);
    assert_eq!(seen.ticks, [at(1.0), at(2.0), at(0.0), at(0.5), at(0.0), at(0.0)]);
    assert_eq!(seen.frames, [at(3.0), at(0.5), at(0.0), at(0.0)]);
    assert_eq!(seen.messages, Vec2::new(35.0, 0.0));
}

#[test]
fn a_motion_by_messages_lasts_one_frame() {
    let (mut app, agent) = app_with(InputRoute::Messages, mouse(), vec![ActionValue::Continuous(vec![0.0, 0.0])]);
    app.update();
    note_motions(&mut app);
    for x in [1.0, 0.0] {
        app.world_mut().resource_mut::<Script>().0 = vec![ActionValue::Continuous(vec![x, 0.0])];
        app.world_mut().entity_mut(agent).insert(Action(ActionValue::Continuous(vec![x, 0.0])));
        app.update();
    }
    assert_eq!(app.world().resource::<Motions>().frames, [Vec2::new(10.0, 0.0), Vec2::ZERO]);
}

#[test]
fn an_agent_plays_on_a_gamepad_of_its_own() {
    for route in [InputRoute::Direct, InputRoute::Messages] {
        let pad = |index: u32| {
            let input = VirtualInput::axes([
                ActionAxis::stick(GamepadAxis::LeftStickX),
                ActionAxis::buttons([GamepadButton::West], [GamepadButton::South]),
                ActionAxis::trigger(GamepadButton::RightTrigger2),
            ]);
            (Agent::new(index, input.space()), input, Control::Bot)
        };
        let (mut app, first) = app_with(route, pad(0).1, vec![ActionValue::Continuous(vec![-0.5, 1.0, 0.9])]);
        let second = app.world_mut().spawn(pad(1)).id();
        // One frame to plug it in, and one for the action of the tick before.
        (0..4).for_each(|_| app.update());
        let mut pads = app.world_mut().query::<(&VirtualGamepad, &Gamepad)>();
        let owners: Vec<Entity> = pads.iter(app.world()).map(|(owner, _)| owner.agent).collect();
        assert!(owners.len() == 2 && owners.contains(&first) && owners.contains(&second), "{route:?}");
        for (_, pad) in pads.iter(app.world()) {
            assert_eq!(pad.get(GamepadAxis::LeftStickX), Some(-0.5), "{route:?}");
            assert!(pad.pressed(GamepadButton::South) && !pad.pressed(GamepadButton::West), "{route:?}");
            assert!(pad.pressed(GamepadButton::RightTrigger2), "{route:?}");
        }
        app.world_mut().entity_mut(first).insert(Control::Idle);
        app.world_mut().entity_mut(second).despawn();
        (0..2).for_each(|_| app.update());
        let pads: Vec<_> = pads.iter(app.world()).collect();
        let [(owner, pad)] = pads.as_slice() else { panic!("{route:?}: {} gamepads", pads.len()) };
        assert_eq!(owner.agent, first);
        assert_eq!((pad.get(GamepadAxis::LeftStickX), pad.get_pressed().count()), (Some(0.0), 0), "{route:?}");
    }
}
