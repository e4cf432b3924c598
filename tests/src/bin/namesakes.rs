//! A program with several games of one name: their number is in the variable `GAMES`. With the variable `PRINTS` the game
//! prints to standard output.

#![allow(clippy::print_stdout, reason = "as games do while they are developed")]

use std::process::ExitCode;

use bevy::prelude::*;
use playbot_harness::game::Game;
use playbot_tests::foreign::catch::{adapted, catch_game, game};

fn main() -> ExitCode {
    let count = std::env::var("GAMES").ok().and_then(|count| count.parse().ok()).unwrap_or(1);
    let catch = match std::env::var_os("PRINTS") {
        None => catch_game(),
        Some(_) => adapted(|app: &mut App| {
            game(app);
            app.add_systems(Startup, || print!("the apples are ")).add_systems(Update, || println!("falling"));
        }),
    };
    let games: Vec<&dyn Game> = vec![&catch; count];
    playbot::main(&games)
}
