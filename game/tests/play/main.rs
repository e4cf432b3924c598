//! Tests of `playbot play` with a window, a keyboard, and files.
#![cfg(feature = "screen")]

#[path = "../shared/program.rs"]
mod program;

use std::{collections::BTreeSet, path::Path};

use bevy_playbot::action::Actions;
use bevy_playbot::demo::file::{Decider, DemoEnd, DemoEpisode, DemoReader};
use playbot_shell::Desk;
use program::{code, command, errors, said};

/// The program.
const PLAYBOT: &str = env!("CARGO_BIN_EXE_playbot");
/// Side of the window.
const SIDE: usize = 704;
/// CoinRun's action "right".
const RIGHT: u32 = 7;

fn episodes(folder: &Path, file: &str) -> Vec<DemoEpisode> {
    DemoReader::open(folder.join(file)).and_then(DemoReader::read_all).expect("a sound recording")
}

/// Replays a recording without a display, and returns its row of `demo ls`.
fn verified(folder: &Path, file: &str) -> String {
    let playbot = |verb: &str| {
        let mut command = command(folder, &["demo", verb, file]);
        let output = command.env_remove("DISPLAY").output().expect("the program starts");
        assert_eq!(code(&output), 0, "demo {verb}: {}", errors(&output));
        said(&output)
    };
    assert!(playbot("verify").contains("all as recorded"));
    playbot("ls")
}

#[test]
fn a_person_wins_hands_over_and_takes_over() {
    let (desk, folder) = (Desk::new(PLAYBOT), tempfile::tempdir().expect("a folder"));
    let args = ["play", "coinrun", "--mode", "hard", "--levels", "0..2", "--bot", "search", "--record", "a.demo"];
    let mut seat = desk.open(folder.path(), &args);
    assert!(seat.title().contains("you play"), "{}", seat.title());

    seat.hold(&["Right", "Up"]);
    seat.read("level 0 won");
    seat.release(&["Right", "Up"]);
    seat.read("coinrun hard 1 · tick");
    let picture = desk.pixels(SIDE);
    let colours = picture.iter().collect::<BTreeSet<_>>().len();
    assert!(colours > 6, "a level has more than {colours} colours");
    assert_eq!(episodes(folder.path(), "a.demo").len(), 1, "a finished episode is on disk at once");

    for _ in 0..5 {
        seat.tap("d");
        seat.pass_ticks(4);
    }
    seat.tap("Tab");
    seat.read("search plays");
    seat.pass_ticks(15);
    seat.tap("Tab");
    seat.read("you play");
    assert_ne!(desk.pixels(SIDE), picture, "something has moved");
    seat.tap("p");
    let paused = seat.read("PAUSED");
    seat.sit_out(8);
    assert_eq!(seat.title(), paused, "nothing goes on in a pause");
    seat.tap("Escape");
    let (status, said) = seat.leave();
    assert!(status.success(), "{said}");
    assert!(said.contains("playbot demo verify a.demo"), "{said}");

    let listed = verified(folder.path(), "a.demo");
    assert!(listed.contains("human ") && listed.contains("bot "), "{listed}");
    let episodes = episodes(folder.path(), "a.demo");
    let (won, left) = (&episodes[0], &episodes[1]);
    assert!(won.is_success() && won.deciders.iter().all(|who| *who == Decider::Human));
    assert_eq!((left.level_seed, left.end, episodes.len()), (1, DemoEnd::Aborted, 2));
    let runs = left.deciders.chunk_by(|a, b| a == b).map(|run| run[0]).collect::<Vec<_>>();
    assert_eq!(runs, [Decider::Human, Decider::Bot, Decider::Human]);
    let Actions::Discrete(actions) = &left.actions else { panic!("CoinRun's actions are discrete") };
    let by_hand = left.deciders.iter().take_while(|who| **who == Decider::Human).count();
    let taps = actions[..by_hand].iter().filter(|action| **action == RIGHT).count();
    assert!((5..=10).contains(&taps), "five taps made {taps} steps");
}

#[test]
fn an_ant_on_the_open_floor_is_played_with_keys() {
    let (desk, folder) = (Desk::new(PLAYBOT), tempfile::tempdir().expect("a folder"));
    let mut seat = desk.open(folder.path(), &["play", "ant", "--mode", "goal", "--record", "a.demo"]);
    // From above, as in the bots' pictures, and without the overlay, whose trail ends in the ant.
    seat.tap("v");
    seat.tap("F8");
    seat.hold(&["Left"]);
    seat.pass_ticks(25);
    let picture = desk.pixels(SIDE);
    let colour = |x: usize, y: usize| [16, 8, 0].map(|shift| picture[y * SIDE + x] >> shift & 255);
    // The corners show floor, light grey, in space as from above.
    for (x, y) in [(20, 20), (SIDE - 20, 20), (20, SIDE - 20), (SIDE - 20, SIDE - 20)] {
        assert!(colour(x, y).iter().all(|channel| (170..=225).contains(channel)), "{:?} at {x}, {y}", colour(x, y));
    }
    let [red, _, blue] = colour(SIDE / 2, SIDE / 2);
    assert!(red > blue + 60, "the ant is in the middle");
    seat.release(&["Left"]);
    seat.tap("Escape");
    let (status, said) = seat.leave();
    assert!(status.success(), "{said}");
    verified(folder.path(), "a.demo");
    let Actions::Continuous { .. } = &episodes(folder.path(), "a.demo")[0].actions else {
        panic!("an ant's actions are numbers")
    };
}

#[test]
fn a_crash_costs_the_running_episode_only() {
    let (desk, folder) = (Desk::new(PLAYBOT), tempfile::tempdir().expect("a folder"));
    let args = ["play", "coinrun", "--level", "0", "--record", "a.demo"];
    let mut seat = desk.open(folder.path(), &args);
    seat.tap("Tab");
    seat.read("no autopilot to hand over to");
    seat.hold(&["Right", "Up"]);
    seat.read("level 0 won");
    seat.read("coinrun hard 1 · tick 1");
    seat.kill();
    verified(folder.path(), "a.demo");
    let before = episodes(folder.path(), "a.demo");
    assert!(before.last().is_some_and(DemoEpisode::is_success));

    let again = desk.command(folder.path(), &args).output().expect("the program starts");
    assert_eq!(again.status.code(), Some(3));
    assert!(errors(&again).contains("exists already"), "{}", errors(&again));

    let mut seat = desk.open(folder.path(), &[&args[..], &["--append"]].concat());
    seat.read("tick 3");
    seat.tap("n");
    seat.read("coinrun hard 1 · tick 3");
    seat.tap("r");
    seat.pass_ticks(8);
    seat.hold(&["Control_L", "q"]);
    let (status, said) = seat.leave();
    assert!(status.success(), "{said}");
    verified(folder.path(), "a.demo");
    let levels: Vec<_> =
        episodes(folder.path(), "a.demo")[before.len()..].iter().map(|left| (left.level_seed, left.end)).collect();
    assert_eq!(levels, [(0, DemoEnd::Aborted), (1, DemoEnd::Aborted), (1, DemoEnd::Aborted)]);
}

#[test]
fn a_limit_that_is_a_rule_of_the_game_is_not_lifted() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = command(folder.path(), &["play", "coinrun", "--no-time-limit"]).output().expect("the program starts");
    assert_eq!(code(&output), 3, "{}", errors(&output));
    assert!(errors(&output).contains("`coinrun` has no time limit that could be lifted"), "{}", errors(&output));
}

#[test]
fn a_signal_ends_a_window_with_its_own_exit_code() {
    let (desk, folder) = (Desk::new(PLAYBOT), tempfile::tempdir().expect("a folder"));
    for (signal, expected, args) in
        [("-TERM", 143, &["--record", "a.demo"][..]), ("-INT", 130, &["--record", "b.demo"]), ("-TERM", 143, &[])]
    {
        let mut seat = desk.open(folder.path(), &[&["play", "coinrun", "--level", "0"][..], args].concat());
        seat.pass_ticks(3);
        seat.send(signal);
        let (status, said) = seat.leave();
        assert_eq!(status.code(), Some(expected), "{signal} {args:?}: {said}");
        if let [_, file] = args {
            verified(folder.path(), file);
        }
    }
}

#[test]
fn a_missing_server_and_a_missing_driver_are_named() {
    let (desk, folder) = (Desk::new(PLAYBOT), tempfile::tempdir().expect("a folder"));
    let refuse = |vars: &[(&str, &str)], words: &str| {
        let mut command = desk.command(folder.path(), &["play", "coinrun", "--record", "a.demo"]);
        command.envs(vars.iter().copied());
        let (_, errors) = playbot_shell::ended(command, 3);
        assert!(errors.contains(words), "{errors}");
        assert!(!folder.path().join("a.demo").exists(), "no recording without a window");
    };
    refuse(&[("DISPLAY", ":9999")], "no X server answers at DISPLAY=:9999");
    let no_driver = [("VK_DRIVER_FILES", "none"), ("VK_ICD_FILENAMES", "none"), ("WGPU_BACKEND", "vulkan")];
    refuse(&no_driver, "mesa-vulkan-drivers");
}

/// In space there is light and shadow; from above every surface has one colour.
#[test]
fn an_ant_is_seen_in_space_and_from_above() {
    let (desk, folder) = (Desk::new(PLAYBOT), tempfile::tempdir().expect("a folder"));
    let mut seat = desk.open(folder.path(), &["play", "antmaze", "--mode", "medium", "--bot", "waypoints"]);
    seat.tap("Tab");
    seat.read("waypoints plays");
    seat.pass_ticks(10);
    let colours = || desk.pixels(SIDE).into_iter().collect::<BTreeSet<_>>().len();
    seat.wait("light and shadow", |_| colours() > 1000);
    seat.tap("v");
    seat.wait("flat colours", |_| (5..200).contains(&colours()));
    seat.tap("v");
    seat.wait("light and shadow", |_| colours() > 1000);
    seat.tap("Escape");
    let (status, said) = seat.leave();
    assert!(status.success(), "{said}");
}
