//! The program `playbot`.

fn main() -> std::process::ExitCode {
    playbot::main(&playbot_games::GAMES)
}
