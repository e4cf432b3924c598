//! A program with several games of one name: their number is in the variable `GAMES`.

use std::process::ExitCode;

use playbot_harness::game::Game;
use playbot_tests::foreign::catch::catch_game;

fn main() -> ExitCode {
    let count = std::env::var("GAMES").ok().and_then(|count| count.parse().ok()).unwrap_or(1);
    let game = catch_game();
    let games: Vec<&dyn Game> = vec![&game; count];
    playbot::main(&games)
}
