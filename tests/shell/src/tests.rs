//! Functions of a program's game as tests of its crate.

/// Makes a test of each function of a [`GameProgram`](crate::GameProgram) that tests a verb, under its name. The one
/// that needs a window is made with the feature `screen` of the crate that is tested.
#[macro_export]
macro_rules! tests {
    ($game:ident) => {
        $crate::tests! {
            $game:
            recordings_replay,
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
