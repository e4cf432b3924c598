//! Tests of what a person does with mouse, keys and gamepad in a foreign game, as actions that press the game's inputs.

use bevy::{input::keyboard::KeyboardInput, prelude::*, window::PrimaryWindow};
use bevy_playbot::virtual_input::{ClickAreas, PersonInput, PointerPosition, PressesForPeople, VirtualInput};
use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_world};

use crate::pointers::played;

/// The game's view of its devices in each frame.
#[derive(Resource, Default)]
struct Seen {
    /// Position of the cursor, and whether the left button was pressed just now.
    mouse: Vec<(Option<Vec2>, bool)>,
    /// Lines of the wheel.
    wheel: Vec<f32>,
    /// The text of each frame with any.
    typed: Vec<String>,
    clicked: u32,
}

fn note(
    window: Single<&Window, With<PrimaryWindow>>,
    buttons: Res<ButtonInput<MouseButton>>,
    scroll: Res<bevy::input::mouse::AccumulatedMouseScroll>,
    mut keys: MessageReader<KeyboardInput>,
    interactions: Query<&Interaction, Changed<Interaction>>,
    mut seen: ResMut<Seen>,
) {
    seen.mouse.push((window.cursor_position(), buttons.just_pressed(MouseButton::Left)));
    seen.wheel.push(scroll.delta.y);
    let typed: String = keys.read().filter_map(|message| message.text.as_deref()).collect();
    if !typed.is_empty() {
        seen.typed.push(typed);
    }
    seen.clicked += interactions.iter().filter(|it| **it == Interaction::Pressed).count() as u32;
}

/// A game with a button from (0, 0) to (200, 50).
fn game() -> ForeignGame {
    let game = |app: &mut App| {
        app.init_resource::<Seen>().add_systems(Update, note).add_systems(Startup, |mut commands: Commands| {
            commands.spawn(Camera2d);
            let node = Node { width: Val::Px(200.0), height: Val::Px(50.0), ..default() };
            commands.spawn((Button, Name::new("Start"), node));
        });
    };
    ForeignGame::new("board", 1, game).observe(["nothing"], || [0.0])
}

/// Returns nothing, and clicks on the two halves of the window.
fn board() -> ForeignGame {
    let [left, right] = [0.25, 0.75].map(|x| Some(PointerPosition::fraction(x, 0.5)));
    let clicks = [vec![], vec![MouseButton::Left], vec![MouseButton::Left]];
    game().cursor([None, left, right]).mouse_buttons(clicks).clicks(["Start"])
}

/// Plays a tick by hand: the person's devices become the action, as they do in a window.
fn play_by_hand(world: &mut World, agent: Entity, person: &PersonInput) -> ActionValue {
    let mut windows = world.query_filtered::<&Window, With<PrimaryWindow>>();
    let size = windows.single(world).expect("one window").size();
    let input = world.get::<VirtualInput>(agent).expect("a mapping");
    let (action, _) = input.meant_by(person, size, world.get::<ClickAreas>(agent));
    world.entity_mut(agent).insert(Action(action.clone()));
    world.tick().expect("sound");
    action
}

fn sit_down(game: &ForeignGame) -> (World, Entity) {
    assert_eq!(game.problem(), None);
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Human, PressesForPeople, LevelQueue::Always(0)));
    world.tick().expect("sound");
    world.tick().expect("sound");
    (world, agents[0])
}

#[test]
fn a_click_of_a_person_reaches_the_game_as_one_on_the_nearest_position() {
    let (mut world, agent) = sit_down(&board());
    let mut person = PersonInput::default();
    person.point(Some(Vec2::new(900.0, 700.0)));
    person.press(MouseButton::Left);
    assert_eq!(play_by_hand(&mut world, agent, &person), ActionValue::Discrete(2));
    assert_eq!(world.resource::<Seen>().mouse.last(), Some(&(Some(Vec2::new(960.0, 360.0)), true)));
    person.begin_frame();
    assert_eq!(play_by_hand(&mut world, agent, &person), ActionValue::Discrete(0));
    assert_eq!(world.resource::<Seen>().mouse.last().map(|(_, down)| *down), Some(false));
}

#[test]
fn a_click_of_a_person_on_a_button_of_the_interface_presses_it() {
    let (mut world, agent) = sit_down(&board());
    let areas = world.get::<ClickAreas>(agent).expect("the game has clicks");
    assert_eq!((areas.first, areas.areas.as_slice()), (3, [(3, Rect::new(0.0, 0.0, 200.0, 50.0))].as_slice()));
    let mut person = PersonInput::default();
    person.point(Some(Vec2::new(190.0, 5.0)));
    person.press(MouseButton::Left);
    assert_eq!(play_by_hand(&mut world, agent, &person), ActionValue::Discrete(3));
    assert_eq!(world.resource::<Seen>().clicked, 1);
}

#[test]
fn choices_are_combined_and_named_after_all_their_keys() {
    let [left, right, jump] = [KeyCode::ArrowLeft, KeyCode::ArrowRight, KeyCode::Space];
    let game = game().choices([vec![vec![], vec![left], vec![right]], vec![vec![], vec![jump]]]);
    let sets = [vec![], vec![jump], vec![left], vec![left, jump], vec![right], vec![right, jump]];
    let (world, agents) = build_world(&game, "default", 0, 0, 1);
    assert_eq!(world.get::<VirtualInput>(agents[0]), Some(&VirtualInput::keys(sets)));
    let names = ["nothing", "Space", "ArrowLeft", "ArrowLeft+Space", "ArrowRight", "ArrowRight+Space"];
    assert_eq!(game.tools().input.action_names(), names);
    let keys = game.tools().input.key_bindings().expect("keys alone play it");
    assert_eq!(keys.action(|key| key == right || key == jump), ActionValue::Discrete(5));
}

#[test]
fn choices_that_cannot_be_combined_are_a_problem() {
    let none: Vec<Vec<KeyCode>> = Vec::new();
    let text = game().choices([vec![vec![KeyCode::KeyA]], none]).problem().expect("nothing to choose");
    assert!(text.contains("the game `board` has `.choices` with nothing to choose in choice 1"), "{text}");
    let many = std::iter::repeat_n(vec![vec![], vec![KeyCode::KeyA]], 13);
    let text = game().choices(many).problem().expect("8192 combinations");
    assert!(text.contains("more than 4096 combinations"), "{text}");
    let both = game().keys([vec![KeyCode::KeyA]]).choices([vec![vec![KeyCode::KeyB]]]);
    let text = both.problem().expect("both name every action");
    assert!(text.contains("has `.keys` and `.choices`") && text.contains("keep one"), "{text}");
}

#[test]
fn a_text_is_typed_once_in_each_tick_of_its_action() {
    let game = game().keys([Vec::<KeyCode>::new()]).types(["Ada", "b"]);
    assert_eq!(Game::actions(&game), ActionSpace::Discrete(3));
    let (world, _) = played(&game, &[1, 0, 2, 2]);
    assert_eq!(world.resource::<Seen>().typed, ["Ada", "b", "b"]);
    let held = world.resource::<ButtonInput<KeyCode>>().get_pressed().count();
    assert_eq!(held, 0, "each character goes down and up");
    let text = game.types([""]).problem().expect("nothing to type");
    assert!(text.contains("`.types` with an empty text"), "{text}");
}

#[test]
fn a_notch_of_the_wheel_is_an_action() {
    let (world, _) = played(&game().wheel([0.0, 1.0, -1.0]), &[1, 0, 2]);
    let seen = &world.resource::<Seen>().wheel;
    assert!(seen.ends_with(&[1.0, 0.0, -1.0]), "{seen:?}");
    let text = game().wheel([f32::NAN]).problem().expect("no number of lines");
    assert!(text.contains("`.wheel` with a number that is not finite"), "{text}");
}

#[test]
fn an_action_with_the_cursor_and_a_finger_is_a_problem() {
    let at = PointerPosition::fraction(0.5, 0.5);
    assert_eq!(game().cursor([None, Some(at), None]).taps([None, None, Some(at)]).problem(), None);
    let text = game().cursor([None, Some(at)]).taps([None, Some(at)]).problem().expect("two pointers");
    assert!(text.contains("moves the mouse cursor and taps on the screen in action 1"), "{text}");
    assert!(text.contains("give each an action of its own"), "{text}");
}

#[test]
fn games_whose_actions_are_passed_on_by_a_system_are_not_recorded_by_hand() {
    assert!(board().tools().input.records_people() && board().tools().input.has_idle_action());
    assert!(!game().actions(ActionSpace::Discrete(2), || {}).tools().input.records_people());
    assert!(!game().clicks(["Start"]).tools().input.has_idle_action(), "each action is a click");
}
