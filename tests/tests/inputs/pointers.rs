//! Tests of actions that point at positions: the mouse cursor and the touch screen of foreign games.

use bevy::{
    input::{
        keyboard::{Key, KeyboardInput},
        touch::Touches,
    },
    prelude::*,
    window::PrimaryWindow,
};
use bevy_playbot::virtual_input::{HeldInput, PointerPosition, VirtualInput};
use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_world};

/// The game's view of its devices in each frame.
#[derive(Resource, Default)]
struct Seen {
    /// Position of the cursor, and whether the left button is down and was pressed just now.
    mouse: Vec<(Option<Vec2>, bool, bool)>,
    /// Fingers that have just touched the screen, and whether one has left it.
    touches: Vec<(Vec<Vec2>, bool)>,
    /// Whether the key `q` is down, and the text that was typed.
    typed: Vec<(bool, String)>,
}

fn note(
    window: Single<&Window, With<PrimaryWindow>>,
    buttons: Res<ButtonInput<MouseButton>>,
    touches: Res<Touches>,
    keys: Res<ButtonInput<Key>>,
    mut messages: MessageReader<KeyboardInput>,
    mut seen: ResMut<Seen>,
) {
    let (down, now) = (buttons.pressed(MouseButton::Left), buttons.just_pressed(MouseButton::Left));
    seen.mouse.push((window.cursor_position(), down, now));
    let fingers = touches.iter_just_pressed().map(|touch| touch.position()).collect();
    seen.touches.push((fingers, touches.any_just_released()));
    let text = messages.read().filter_map(|message| message.text.as_deref()).collect();
    seen.typed.push((keys.pressed(Key::Character("q".into())), text));
}

fn game() -> ForeignGame {
    let game = |app: &mut App| {
        app.init_resource::<Seen>().add_systems(Update, note);
    };
    ForeignGame::new("board", 1, game).observe(["nothing"], || [0.0])
}

const LEFT: PointerPosition = PointerPosition::Fraction(Vec2::new(0.25, 0.5));
const RIGHT: PointerPosition = PointerPosition::Pixels(Vec2::new(960.0, 360.0));

/// Positions of both in a window of 1280 by 720.
const LEFT_PIXELS: Vec2 = Vec2::new(320.0, 360.0);
const RIGHT_PIXELS: Vec2 = Vec2::new(960.0, 360.0);

/// Plays these actions, one in each tick. Returns the World and its agent.
pub fn played(game: &ForeignGame, actions: &[u32]) -> (World, Entity) {
    assert_eq!(game.problem(), None);
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
    for &action in actions {
        world.entity_mut(agents[0]).insert(Action(ActionValue::Discrete(action)));
        world.tick().expect("sound");
    }
    (world, agents[0])
}

fn clicking() -> ForeignGame {
    game().cursor([None, Some(LEFT), Some(RIGHT)]).mouse_buttons([
        vec![],
        vec![MouseButton::Left],
        vec![MouseButton::Left],
    ])
}

#[test]
fn the_cursor_moves_before_its_button_is_pressed_and_each_tick_is_a_click() {
    let (world, _) = played(&clicking(), &[1, 2, 2, 0]);
    let expected = [
        (Some(LEFT_PIXELS), true, true),
        (Some(RIGHT_PIXELS), true, true),
        (Some(RIGHT_PIXELS), true, true),
        (Some(RIGHT_PIXELS), false, false),
    ];
    let seen = &world.resource::<Seen>().mouse;
    assert!(seen.ends_with(&expected), "{seen:?}");
}

#[test]
fn a_minimised_window_without_size_gets_no_click_and_the_next_one_when_it_is_restored() {
    let (mut world, agent) = played(&clicking(), &[1]);
    let mut windows = world.query_filtered::<&mut Window, With<PrimaryWindow>>();
    let mut seen = |size: Vec2| {
        windows.single_mut(&mut world).expect("one window").resolution.set(size.x, size.y);
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(2)));
        world.tick().expect("a position in a window without size is no fault");
        world.resource::<Seen>().mouse.last().copied()
    };
    assert_eq!(seen(Vec2::ZERO), Some((None, false, false)));
    assert_eq!(seen(Vec2::new(1280.0, 720.0)), Some((Some(RIGHT_PIXELS), true, true)));
}

#[test]
fn an_episode_begins_with_the_cursor_outside_of_the_window() {
    let (world, _) = played(&clicking().time_limit(1), &[1, 0]);
    let seen = &world.resource::<Seen>().mouse;
    assert_eq!(seen.last(), Some(&(None, false, false)), "{seen:?}");
    assert!(seen.contains(&(Some(LEFT_PIXELS), true, true)), "the episode before has moved it: {seen:?}");
}

#[test]
fn a_button_that_is_held_from_one_position_to_another_drags() {
    let at = |position| HeldInput::default().at(position).hold([MouseButton::Left]);
    let (world, _) = played(&game().input(VirtualInput::discrete([at(LEFT), at(RIGHT)])), &[0, 1]);
    let seen = &world.resource::<Seen>().mouse;
    assert!(seen.ends_with(&[(Some(LEFT_PIXELS), true, true), (Some(RIGHT_PIXELS), true, false)]), "{seen:?}");
}

#[test]
fn a_finger_is_down_for_one_tick_and_each_tick_is_a_tap() {
    let (world, _) = played(&game().taps([None, Some(LEFT)]), &[1, 1, 0, 0]);
    let expected = [(vec![LEFT_PIXELS], false), (vec![LEFT_PIXELS], true), (vec![], true), (vec![], false)];
    let seen = &world.resource::<Seen>().touches;
    assert!(seen.ends_with(&expected), "{seen:?}");
}

#[test]
fn logical_keys_and_typed_text_come_and_go_with_a_key() {
    let (world, _) = played(&game().keys([vec![], vec![KeyCode::KeyQ]]), &[1, 1, 0]);
    let expected = [(true, "q".to_owned()), (true, String::new()), (false, String::new())];
    let seen = &world.resource::<Seen>().typed;
    assert!(seen.ends_with(&expected), "{seen:?}");
}

#[test]
fn a_position_outside_of_any_window_is_a_problem_of_the_game() {
    for (position, name) in [
        (PointerPosition::pixels(-1.0, 10.0), "pixel (-1, 10)"),
        (PointerPosition::fraction(0.5, 1.0), "fraction (0.5, 1)"),
    ] {
        for game in [game().cursor([None, Some(position)]), game().taps([None, Some(position)])] {
            let text = game.problem().expect("it lies outside");
            assert!(text.contains("the game `board` points at") && text.contains(name), "{text}");
            assert!(text.contains("in action 1"), "{text}");
        }
    }
}

#[test]
fn a_position_outside_of_this_window_is_a_fault_of_the_first_tick_with_its_size() {
    let game = game().cursor([Some(PointerPosition::pixels(5000.0, 10.0))]);
    assert_eq!(game.problem(), None, "a larger window would have it");
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
    let text = world.tick().expect_err("it lies outside").to_string();
    for part in ["agent 0", "action 0", "pixel (5000, 10)", "1280 by 720", "`PointerPosition::fraction`"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}
