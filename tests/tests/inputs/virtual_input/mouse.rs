//! Tests of the mouse.

use bevy::{
    input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseMotion},
    prelude::*,
    window::PrimaryWindow,
};
use bevy_playbot::{
    prelude::*,
    virtual_input::{ActionAxis, InputRoute, PointerPosition, VirtualInput},
};

use super::scripted::{STEP, Script, actions, app_with, frames_of};

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

/// Returns the error when agent 4 has this input, too.
fn second(input: VirtualInput, other: VirtualInput, script: Vec<ActionValue>) -> String {
    let action = Action(script[0].clone());
    let (mut app, _) = app_with(InputRoute::Direct, input, script);
    let second = app.world_mut().spawn((Agent::new(4, other.space()), other, Control::Policy, action)).id();
    let fault = app.tick().expect_err("both claim it").to_string();
    assert_eq!(app.world().get::<Control>(second), Some(&Control::Idle), "only one of them plays on");
    fault
}

#[test]
fn two_agents_that_claim_one_mouse_button_are_a_fault_that_names_both() {
    let click = |button| VirtualInput::keys([vec![], vec![]]).mouse_buttons([vec![], vec![button]]);
    let other = click(MouseButton::Left).mouse_buttons([vec![MouseButton::Right]]);
    let fault = second(click(MouseButton::Right), other, actions(&[0]));
    assert!(fault.contains("agents 0 and 4 both claim MouseRight"), "{fault}");
}

#[test]
fn two_agents_that_claim_one_motion_are_a_fault_that_names_both() {
    let other = VirtualInput::axes([ActionAxis::mouse_y(1.0), ActionAxis::wheel(1.0)]);
    let fault = second(mouse(), other, vec![ActionValue::Continuous(vec![0.0, 0.0])]);
    assert!(fault.contains("agents 0 and 4 both claim WheelY"), "{fault}");
}

/// The cursor, and whether the left button was pressed just now, in each tick.
#[derive(Resource, Default)]
struct Clicks(Vec<(Option<Vec2>, bool)>);

#[test]
fn each_fixed_tick_sees_its_own_click() {
    let [left, right] = [PointerPosition::fraction(0.25, 0.5), PointerPosition::pixels(900.0, 10.0)];
    let input = VirtualInput::keys([[]; 3])
        .mouse_buttons([vec![], vec![MouseButton::Left], vec![MouseButton::Left]])
        .cursor([None, Some(left), Some(right)]);
    let (mut app, _) = app_with(InputRoute::Direct, input, actions(&[1, 2, 0]));
    app.world_mut().spawn((Window::default(), PrimaryWindow));
    let note = |window: Single<&Window>, buttons: Res<ButtonInput<MouseButton>>, mut clicks: ResMut<Clicks>| {
        clicks.0.push((window.cursor_position(), buttons.just_pressed(MouseButton::Left)));
    };
    app.init_resource::<Clicks>().add_systems(FixedUpdate, note.ambiguous_with_all());
    frames_of(&mut app, STEP * 3);
    app.update();
    let [left, right] = [Vec2::new(320.0, 360.0), Vec2::new(900.0, 10.0)];
    let expected = [(Some(left), true), (Some(right), true), (Some(right), false)];
    assert_eq!(app.world().resource::<Clicks>().0, expected);
}

#[test]
fn two_agents_that_claim_the_cursor_are_a_fault_that_names_both() {
    let at = |x: f32| VirtualInput::keys([vec![]]).cursor([Some(PointerPosition::pixels(x, 1.0))]);
    let (mut app, _) = app_with(InputRoute::Direct, at(1.0), actions(&[0]));
    app.world_mut().spawn((Window::default(), PrimaryWindow));
    app.world_mut().spawn((Agent::new(4, ActionSpace::Discrete(1)), at(2.0), Control::Policy));
    let fault = app.tick().expect_err("both claim it").to_string();
    assert!(fault.contains("agents 0 and 4 both claim the mouse cursor"), "{fault}");
}

#[test]
fn a_position_in_an_app_without_a_window_is_a_fault() {
    let input = VirtualInput::keys([vec![]]).cursor([Some(PointerPosition::pixels(1.0, 1.0))]);
    let (mut app, _) = app_with(InputRoute::Direct, input, actions(&[0]));
    let fault = app.tick().expect_err("there is no window").to_string();
    assert!(fault.contains("pixel (1, 1)") && fault.contains("no primary window"), "{fault}");
}
