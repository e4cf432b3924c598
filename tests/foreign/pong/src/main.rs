//! Pong for two players, with every verb of playbot.

use std::process::ExitCode;

fn main() -> ExitCode {
    playbot::main(&[&foreign_pong::pong()])
}
