//! Tests of the verbs through the command line. Bots and people play with the mouse.

use playbot_shell::{GameProgram, Shell, ended_in};

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_slide"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "slide",
    demonstrator: "solver",
    key: "Right",
    recorded: 1000,
    held_out: "default:100000..100001",
    recorded_ticks: None,
};

playbot_shell::tests!(
    GAME: recordings_replay,
    moments_are_drawn,
    a_killed_training_goes_on_bit_for_bit,
    a_policy_file_plays_as_its_run,
    the_doctor_finds_nothing,
    levels_are_looked_at,
    levels_are_tested,
    methods_are_compared,
    defects_are_planted_and_looked_for,
);

/// Its puzzles have 120 ticks.
#[test]
fn detectors_for_which_120_ticks_are_too_few_say_so() {
    let shell = Shell::new(GAME.program);
    let test = |settings: &[&str]| {
        let call = ["test", "slide", "--levels", "default:4", "--bot", "chaos", "--out", "t", "--force", "--detect"];
        let call = [&call[..], &["dead-action,fading-action"], settings].concat();
        ended_in(shell.command(&call), &[0, 1]).2
    };
    let line = "could not look: dead-action (needs episodes of 140 ticks, and had at most 120: `--detector \
                dead-action.ticks=17`), fading-action (needs episodes of 400 ticks, and had at most 120: `--detector \
                fading-action.rest=8`)\n";
    let messages = test(&[]);
    assert!(messages.contains(line), "{messages}");
    for file in ["summary.md", "report.html"] {
        let text = std::fs::read_to_string(shell.path("t").join(file)).expect("it is written");
        assert!(text.contains("Detectors that could not look: dead-action (needs episodes of 140 ticks"), "{text}");
    }
    let messages = test(&["--detector", "dead-action.ticks=17", "--detector", "fading-action.rest=8"]);
    assert!(!messages.contains("could not look"), "{messages}");
}

/// Plays with the mouse in a window of this scale, and returns the first and the last recorded action. Positions are in
/// pixels.
#[cfg(feature = "screen")]
fn recorded_by_mouse(scale: Option<&str>, start: [u32; 2], cell: [u32; 2]) -> [Option<u64>; 2] {
    use playbot_shell::Desk;

    let (desk, shell) = (Desk::new(GAME.program), Shell::new(GAME.program));
    let args = ["play", "slide", "--levels", "0..0", "--record", "mine.demo", "--no-time-limit"];
    let mut seat = match scale {
        Some(scale) => desk.open_scaled(shell.folder(), &args, scale),
        None => desk.open(shell.folder(), &args),
    };
    seat.tap("r");
    seat.pass_ticks(12);
    seat.click(start[0], start[1]);
    seat.pass_ticks(12);
    seat.click(cell[0], cell[1]);
    seat.pass_ticks(12);
    leave_with(&shell, seat, "mine.demo");
    let episodes = shell.answers(&["demo", "show", "mine.demo", "--json"]).len();
    let ticks = (0..episodes)
        .flat_map(|episode| shell.answers(&["demo", "show", "mine.demo", "--episode", &episode.to_string(), "--json"]));
    // A button that is held for two frames is an action more, in between.
    let actions: Vec<u64> = ticks.filter_map(|tick| tick["action"].as_u64()).filter(|action| *action != 0).collect();
    [actions.first().copied(), actions.last().copied()]
}

/// Closes a window. Its recording replays.
#[cfg(feature = "screen")]
fn leave_with(shell: &playbot_shell::Shell, seat: playbot_shell::Seat, file: &str) {
    seat.tap("Escape");
    let (status, said) = seat.leave();
    assert!(status.success(), "{said}");
    let verified = shell.answer(&["demo", "verify", file, "--json"]);
    assert_eq!(verified["report"]["divergences"].as_array().map(Vec::len), Some(0), "{verified}");
}

/// Plays without a key, and returns the lengths of the episodes that are recorded. An episode of a bot has 120 ticks.
#[cfg(feature = "screen")]
fn lengths_of_a_slow_person(more: &[&str]) -> Vec<u64> {
    use playbot_shell::Desk;

    let (desk, shell) = (Desk::new(GAME.program), Shell::new(GAME.program));
    let args = ["play", "slide", "--levels", "1..1", "--record", "slow.demo"];
    let mut seat = desk.open(shell.folder(), &[&args[..], more].concat());
    if more.is_empty() {
        seat.read("level 1 out of time after 120 ticks (--no-time-limit lifts the limit)");
    } else {
        seat.pass_ticks(140);
    }
    leave_with(&shell, seat, "slow.demo");
    let episodes = shell.answers(&["demo", "show", "slow.demo", "--json"]);
    episodes.iter().filter_map(|episode| episode["steps"].as_u64()).collect()
}

#[cfg(feature = "screen")]
#[test]
fn a_person_may_play_without_the_time_limit_of_bots() {
    assert_eq!(lengths_of_a_slow_person(&[])[0], 120);
    let slow = lengths_of_a_slow_person(&["--no-time-limit"]);
    assert!(slow.len() == 1 && slow[0] >= 140, "{slow:?}");
}

/// The action that clicks on Start, behind nothing and nine cells.
#[cfg(feature = "screen")]
const START: u64 = 10;

#[cfg(feature = "screen")]
#[test]
fn clicks_of_a_person_are_recorded_as_actions_and_replay() {
    assert_eq!(recorded_by_mouse(None, [160, 80], [640, 360]), [Some(START), Some(5)], "the middle cell is the fifth");
}

#[cfg(feature = "screen")]
#[test]
fn clicks_in_a_scaled_window_are_the_same_actions() {
    // The window is larger than the screen, so the test clicks on the first cell.
    assert_eq!(recorded_by_mouse(Some("2"), [320, 160], [320, 160]), [Some(START), Some(1)]);
}
