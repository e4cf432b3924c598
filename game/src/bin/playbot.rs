//! The program `playbot`.

fn main() -> std::process::ExitCode {
    playbot_cli::main(&playbot_games::registry::GAMES)
}
