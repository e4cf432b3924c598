//! The verbs of the command line, as users call them.

use playbot_shell::GameProgram;

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_gem_hop"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "gem_hop",
    demonstrator: "runner",
    key: "Right",
};

playbot_shell::tests! {
    GAME:
    recordings_replay,
    moments_are_drawn,
    a_killed_training_goes_on_bit_for_bit,
    a_policy_file_plays_as_its_run,
    the_doctor_finds_nothing,
    what_a_window_records_replays,
}
