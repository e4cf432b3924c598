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

/// Makes a test of what recordings of the sound game say of its own planted defects, without a detector: each leads
/// elsewhere on these levels in some variant, and the tick in which it departs is told. All but the quiet classes also end
/// otherwise, which is a regression. Names of `playbot` are those of the crate that is tested.
#[macro_export]
macro_rules! defects_by_recording {
    (game: $game:expr, levels: $levels:literal, quiet: $quiet:expr) => {
        #[test]
        fn recordings_of_the_sound_game_tell_where_a_broken_one_departs() {
            use playbot::{
                Game,
                harness::defect::Plant,
                mutation::bugs::Mutant,
                test::{
                    detectors::Detectors,
                    verdict::{RecordedWins, TestPlan},
                },
                train::pipeline::record,
            };

            let game = $game;
            let folder = $crate::folder();
            let file = folder.path().join("sound.demo");
            let split: playbot::harness::split::LevelSplit = $levels.parse().expect("levels");
            record(&game, &split, 0.0, &file).expect("it plays");
            let plan = TestPlan {
                split,
                testers: Vec::new(),
                episodes: 1,
                seed: 0,
                detectors: Detectors::default(),
                shard: None,
                threads: 2,
            };
            let courses = |game: &dyn Game| {
                let wins = RecordedWins::read(game, &plan, &file).expect("the demonstrator wins");
                wins.courses(game, plan.threads, &|_| {}, &|| false).expect("nothing stops it").into_values()
            };
            assert!(courses(&game).all(|course| course.differs.is_none()), "the sound game leads nowhere else");
            let mut quiet = Vec::new();
            for kind in game.tools().tests.defects() {
                let Plant::Rules { variants, .. } = kind.plant else { continue };
                let broken = |variant| courses(&Mutant::new(&game as &dyn Game, &kind, variant));
                let mut told = (0..variants).flat_map(broken).filter(|course| course.differs.is_some()).peekable();
                assert!(told.peek().is_some(), "{}: the recorded courses do not show it", kind.class);
                if told.all(|course| course.ends_as_recorded()) {
                    quiet.push(kind.class);
                }
            }
            let expected: &[&str] = &$quiet;
            assert_eq!(quiet, expected, "these change no end");
        }
    };
}
