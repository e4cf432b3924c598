//! Tests of a program's game in its crate, written once for all games.

/// Makes a test of each function of a [`GameProgram`](crate::GameProgram) that tests a verb, under its name. The one
/// that needs a window is made with the feature `screen` of the crate that is tested.
#[macro_export]
macro_rules! tests {
    ($game:ident) => {
        $crate::tests! {
            $game:
            recordings_replay,
            what_verifies_is_learned_from,
            moments_are_drawn,
            a_killed_training_goes_on_bit_for_bit,
            a_policy_file_plays_as_its_run,
            the_doctor_finds_nothing,
            levels_are_looked_at,
            levels_are_tested,
            methods_are_compared,
        }
        #[cfg(feature = "screen")]
        $crate::tests! { $game: what_a_window_records_replays }
    };
    ($game:ident: $($name:ident),+ $(,)?) => {
        $(
            #[test]
            fn $name() {
                $game.$name();
            }
        )+
    };
}

/// Makes a test of the planted defects of a game: each variant of each kind changes an episode on these levels, and a
/// defect that changes nothing is noticed. Names of `playbot` are those of the crate that is tested.
#[macro_export]
macro_rules! planted_defects {
    (game: $game:expr, levels: $levels:literal) => {
        #[test]
        fn every_defect_changes_some_run_and_without_one_nothing_changes() {
            use playbot::{ForeignGame, harness::defect::DefectKind, mutation::bugs::without_effect};

            let silent = |game: &ForeignGame, levels: &str| without_effect(game, &levels.parse().expect("levels"), 2);
            let without = silent(&add_to($game), $levels);
            assert!(without.is_empty(), "these change nothing: {without:?}");
            let nothing = DefectKind::rules("nothing", "the game is as it is", 1, |_, _| {});
            assert_eq!(silent(&$game.defect(nothing), "default:0..0"), [("nothing", 0)]);
        }
    };
}
