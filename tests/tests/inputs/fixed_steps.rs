//! Tests of presses that a foreign game reads in its fixed steps, for frames of several lengths.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    doctor::{DoctorOptions, UnequalSteps, examine},
    foreign::ForeignGame,
    worlds::{build_world, check_start_and_look},
};

/// Presses that the game has seen.
#[derive(Resource, Default)]
struct Presses(u32);

fn game(app: &mut App) {
    app.init_resource::<Presses>().add_systems(
        FixedUpdate,
        |keys: Res<ButtonInput<KeyCode>>, mut presses: ResMut<Presses>| {
            presses.0 += u32::from(keys.just_pressed(KeyCode::Space));
        },
    );
}

fn counting(game: fn(&mut App)) -> ForeignGame {
    ForeignGame::new("counting", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["presses"], |presses: Res<Presses>| [presses.0 as f32])
}

/// Presses 100 times, in every other tick from the first one, and returns the presses that the game has seen.
fn seen(game: &ForeignGame) -> u32 {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    // Replay without a recording: no other controller decides.
    world.entity_mut(agents[0]).insert((Control::Replay, LevelQueue::Always(3)));
    for tick in 0..200_u32 {
        world.entity_mut(agents[0]).insert(Action(ActionValue::Discrete(1 - tick % 2)));
        world.tick().expect("sound");
    }
    world.resource::<Presses>().0
}

#[test]
fn a_press_is_seen_once_where_frames_are_as_long_as_fixed_steps() {
    assert_eq!(seen(&counting(game).hz(64.0)), 100, "Bevy's default step");
    for hz in [30.0, 60.0, 128.0] {
        let stepped = ForeignGame::new("counting", 1, move |app: &mut App| {
            game(app);
            app.insert_resource(Time::<Fixed>::from_hz(hz));
        });
        let stepped = stepped.keys([vec![], vec![KeyCode::Space]]).observe(["presses"], || [0.0]).hz(hz);
        assert_eq!(seen(&stepped), 100, "{hz} steps a second");
    }
}

/// Numbers by hand: a press lasts for its frame, and Bevy's default step for 15.625 ms.
#[test]
fn other_frames_show_a_press_in_each_of_their_steps() {
    // Two or three steps in each frame.
    assert!((200..=220).contains(&seen(&counting(game).hz(30.0))));
    // Two steps in the ticks 15, 45, 75, 105, 135, 165 and 195, counted from 1, and in as many without a press.
    assert_eq!(seen(&counting(game).hz(60.0)), 107);
    // A step in every other frame, which is the one without a press.
    assert_eq!(seen(&counting(game).hz(128.0)), 0);
}

#[test]
fn an_action_that_is_repeated_is_one_press_and_the_doctor_says_so() {
    let game = counting(game).hz(64.0);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Replay, LevelQueue::Always(3)));
    // Held for 5 ticks, let go for one, and held for 4.
    for action in [1, 1, 1, 1, 1, 0, 1, 1, 1, 1] {
        world.entity_mut(agents[0]).insert(Action(ActionValue::Discrete(action)));
        world.tick().expect("sound");
    }
    assert_eq!(world.resource::<Presses>().0, 2);
    let words = "Keys: an action that is chosen again holds its keys. `just_pressed` is true in its first tick only,";
    assert!(examined(&game).contains(words));
    let without = ForeignGame::new("still", 1, |app: &mut App| _ = app.init_resource::<Presses>());
    let without = without.actions(ActionSpace::Discrete(2), || {}).observe(["presses"], || [0.0]);
    assert!(!examined(&without).contains("Keys:"), "its actions press nothing");
}

/// The same words as the doctor's, from the World with which a verb checks that the game starts.
#[test]
fn the_first_world_of_a_run_shows_which_clocks_differ_if_actions_press_keys() {
    let line = |game: &ForeignGame| {
        let mut line = None;
        let look =
            |world: &World, agent: Entity| line = UnequalSteps::of_presses(world, agent).map(|steps| steps.line());
        check_start_and_look(game, "default", 0, |_| {}, look).expect("it starts");
        line
    };
    let words = line(&counting(game)).expect("60 frames and 64 steps a second");
    for part in ["a frame is 16.667 ms, a fixed step 15.625 ms", "once or more often", "`.hz(64.0)`"] {
        assert!(words.contains(part) && examined(&counting(game)).contains(part), "`{part}` is missing in: {words}");
    }
    assert!(line(&counting(game).hz(128.0)).expect("128 frames").contains("once or not at all"));
    assert_eq!(line(&counting(game).hz(64.0)), None);
    let still =
        ForeignGame::new("still", 1, game).actions(ActionSpace::Discrete(2), || {}).observe(["presses"], || [0.0]);
    assert_eq!(line(&still), None, "its actions press nothing");
}

/// Returns the doctor's report as text.
fn examined(game: &ForeignGame) -> String {
    let options = DoctorOptions { ticks: 30, ..DoctorOptions::new("default") };
    examine(game, &options, |_| {}).expect("it has the mode").to_string()
}

#[test]
fn the_doctor_says_which_clocks_differ_and_what_to_set() {
    let text = examined(&counting(game));
    for words in ["a frame is 16.667 ms, a fixed step 15.625 ms", "`.hz(64.0)`", "`Time::<Fixed>::from_hz(60.0)`"] {
        assert!(text.contains(words), "`{words}` is missing in: {text}");
    }
}

#[test]
fn the_doctor_says_nothing_of_clocks_that_agree_or_do_not_matter() {
    let without: fn(&mut App) = |app| _ = app.init_resource::<Presses>();
    for game in [counting(game).hz(64.0), counting(without)] {
        let text = examined(&game);
        assert!(!text.contains("a fixed step"), "{text}");
    }
}
