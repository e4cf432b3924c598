//! The program `playbot`.

use std::process::ExitCode;

fn main() -> ExitCode {
    playbot_games::cli::main()
}
