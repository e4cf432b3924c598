//! Tests of the names of a program's games.

use std::path::Path;

use playbot_harness::{
    game::Game,
    games::{Artifact, Games, GamesError},
};
use playbot_tests::{Corridor, faulty::Fault, foreign::catch::catch_game};

#[test]
fn games_are_found_by_name_in_the_order_in_which_they_were_given() {
    let catch = catch_game();
    let all: [&dyn Game; 2] = [&catch, &Corridor];
    let games = Games::new(&all).expect("two names");
    assert_eq!(games.iter().map(Game::name).collect::<Vec<_>>(), ["catch", "corridor"]);
    assert_eq!(games.first().name(), "catch");
    assert_eq!(games.get("corridor").map(Game::name).ok(), Some("corridor"));
    let error = games.get("coridor").map(Game::name).expect_err("no such game").to_string();
    assert!(error.contains("corridor") && error.contains("catch"), "{error}");
}

#[test]
fn a_file_of_a_game_that_the_program_does_not_have_is_named_with_what_to_do() {
    let all: [&dyn Game; 1] = [&Corridor];
    let games = Games::new(&all).expect("one name");
    let path = Path::new("runs/first");
    assert_eq!(games.of_file(Artifact::Run, path, "corridor").map(Game::name).ok(), Some("corridor"));
    let words = |kind| games.of_file(kind, path, "lander").map(Game::name).expect_err("no such game").to_string();
    assert_eq!(
        words(Artifact::Run),
        "runs/first: a run of the game `lander`, which this program does not have (it has corridor): use the program \
         of that game"
    );
    assert!(words(Artifact::Experiment).contains("correct `game` in it"), "{}", words(Artifact::Experiment));
}

#[test]
fn two_games_of_one_name_are_refused() {
    let all: [&dyn Game; 3] = [&Corridor, &Fault::None, &Corridor];
    let error = Games::new(&all).map(|_| ()).expect_err("corridor stands there twice");
    assert_eq!(error, GamesError::Twice("corridor"));
    assert!(error.to_string().contains("`corridor`"), "{error}");
}

#[test]
fn a_program_without_a_game_is_refused() {
    let error = Games::new(&[]).map(|_| ()).expect_err("there is none");
    assert_eq!(error, GamesError::None);
}
