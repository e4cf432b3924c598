//! Tests of the verbs through the command line.

use playbot_shell::GameProgram;

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_cellar"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "cellar",
    demonstrator: "guide",
    key: "Right",
    recorded: 0,
    held_out: "default:118..119",
};

playbot_shell::tests!(GAME: recordings_replay, a_killed_training_goes_on_bit_for_bit, a_policy_file_plays_as_its_run, the_doctor_finds_nothing);
