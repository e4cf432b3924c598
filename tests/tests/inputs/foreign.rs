//! Tests of errors in a foreign game's input, in any order.

use bevy::prelude::*;
use bevy_playbot::virtual_input::{ActionAxis, VirtualInput};
use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_world};

fn bare() -> ForeignGame {
    ForeignGame::new("bare", 1, |_: &mut App| {}).observe(["nothing"], || [0.0])
}

const KEYS: [&[KeyCode]; 2] = [&[], &[KeyCode::Space]];
const MOUSE: [&[MouseButton]; 2] = [&[], &[MouseButton::Left]];
const PADS: [&[GamepadButton]; 3] = [&[], &[], &[GamepadButton::South]];

fn keys(game: ForeignGame) -> ForeignGame {
    game.keys(KEYS.map(<[_]>::to_vec))
}

fn mouse(game: ForeignGame) -> ForeignGame {
    game.mouse_buttons(MOUSE.map(<[_]>::to_vec))
}

fn pads(game: ForeignGame) -> ForeignGame {
    game.gamepad_buttons(PADS.map(<[_]>::to_vec))
}

/// Returns the input that the game's agent presses.
fn pressed(game: &ForeignGame) -> VirtualInput {
    assert_eq!(game.problem(), None);
    let (world, agents) = build_world(game, "default", 0, 0, 1);
    world.get::<VirtualInput>(agents[0]).expect("it presses something").clone()
}

#[test]
fn keys_and_buttons_come_in_any_order() {
    let expected = VirtualInput::keys(KEYS.map(<[_]>::to_vec))
        .mouse_buttons(MOUSE.map(<[_]>::to_vec))
        .gamepad_buttons(PADS.map(<[_]>::to_vec));
    assert_eq!(expected.space(), ActionSpace::Discrete(3));
    for said in [
        [keys, mouse, pads],
        [keys, pads, mouse],
        [mouse, keys, pads],
        [mouse, pads, keys],
        [pads, keys, mouse],
        [pads, mouse, keys],
    ] {
        let game = said.into_iter().fold(bare(), |game, say| say(game));
        assert_eq!(pressed(&game), expected);
        assert_eq!(Game::actions(&game), ActionSpace::Discrete(3));
    }
    let twice = keys(bare().keys([vec![KeyCode::KeyA]]));
    assert_eq!(pressed(&twice), VirtualInput::keys(KEYS.map(<[_]>::to_vec)), "what was said last counts");
}

#[test]
fn keys_can_be_said_by_name() {
    let named = bare().keys_by_name([vec![], vec!["Space"]]);
    assert_eq!(pressed(&named), VirtualInput::keys(KEYS.map(<[_]>::to_vec)));
    assert_eq!(named.tools().input.action_names(), ["nothing", "Space"]);
    assert!(named.tools().input.key_bindings().is_some(), "a person plays with these keys");
    let mixed = bare().keys_by_name([vec!["KeyA".to_owned(), "MouseLeft".to_owned()]]);
    let both = VirtualInput::keys([vec![KeyCode::KeyA]]).mouse_buttons([vec![MouseButton::Left]]);
    assert_eq!(pressed(&mixed), both);
    assert_eq!(mixed.tools().input.action_names(), ["KeyA+MouseLeft"]);
    assert!(mixed.tools().input.key_bindings().is_none(), "keys alone do not play it");
}

#[test]
fn a_key_that_does_not_exist_is_reported_with_its_action_and_the_nearest_name() {
    let wrong = bare().keys_by_name([vec![], vec!["Space", "ArowLeft"], vec!["Anykey"]]);
    let text = wrong.problem().expect("there is no such key");
    for part in ["the game `bare`", "in action 1", "`ArowLeft`", "did you mean `ArrowLeft`?"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
    // Playing it gives the same error.
    let (mut world, _) = build_world(&wrong, "default", 0, 0, 1);
    assert!(world.tick().expect_err("a problem").to_string().contains("`ArowLeft`"));
    assert_eq!(keys(wrong).problem(), None, "what was said last counts");
}

#[test]
fn buttons_join_an_input_that_was_said_as_a_whole() {
    let whole = || VirtualInput::keys(KEYS.map(<[_]>::to_vec));
    let expected = whole().mouse_buttons(MOUSE.map(<[_]>::to_vec));
    assert_eq!(pressed(&mouse(bare().input(whole()))), expected);
    assert_eq!(pressed(&mouse(bare()).input(whole())), expected);
}

#[test]
fn settings_that_exclude_each_other_are_reported() {
    let steer = || [ActionAxis::keys([KeyCode::KeyA], [KeyCode::KeyD])];
    let problem = |game: ForeignGame| game.problem().expect("they do not go together");
    for game in [bare().axes(steer()).mouse_buttons([vec![MouseButton::Left]]), mouse(bare()).axes(steer())] {
        let text = problem(game);
        assert!(text.contains("`bare` has `.mouse_buttons`") && text.contains("`ActionAxis::buttons`"), "{text}");
    }
    let text = problem(pads(bare()).input(VirtualInput::axes(steer())));
    assert!(text.contains("`.gamepad_buttons`"), "{text}");
    for game in [keys(bare()).axes(steer()), keys(bare().axes(steer()))] {
        let text = problem(game);
        assert!(text.contains("has `.keys` and `.axes`") && text.contains("keep one"), "{text}");
    }
    // Playing it gives the same error.
    let (mut world, _) = build_world(&keys(bare()).axes(steer()), "default", 0, 0, 1);
    assert!(world.tick().expect_err("a problem").to_string().contains("`.keys` and `.axes`"));
}

#[test]
fn sets_of_buttons_for_continuous_actions_are_a_fault() {
    let mixed =
        VirtualInput::axes([ActionAxis::stick(GamepadAxis::LeftStickX)]).gamepad_buttons([vec![GamepadButton::South]]);
    let (mut world, agents) = build_world(&bare().input(mixed), "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform));
    let text = world.tick().expect_err("they mean nothing").to_string();
    assert!(text.contains("agent 0") && text.contains("`ActionAxis::buttons`"), "{text}");
}
