//! Tests of a program's game in its crate, written once for all games.

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

/// Makes a test of the planted defects of a game, an `Arc` of it. Each kind changes the play of the game's demonstrator
/// on one of the first levels, in each of the three variants. Without a defect nothing changes. Names of `playbot` are
/// those of the crate that is tested.
#[macro_export]
macro_rules! planted_defects {
    (game: $game:expr, kinds: $kinds:expr, levels: $levels:expr, ticks: $ticks:expr) => {
        #[test]
        fn every_defect_changes_some_run_and_without_one_nothing_changes() {
            use playbot::{
                harness::worlds::build_world,
                mutation::bugs::Mutant,
                prelude::{Control, LevelQueue, PlaybotAppExt as _, Reward, StateHash},
            };

            // The values that a replay compares, after each tick.
            let play = |game: &dyn playbot::Game, level: u64| -> Vec<(u64, f32)> {
                let (mut world, agents) = build_world(game, "default", 0, 0, 1);
                let agent = agents[0];
                world.entity_mut(agent).insert((Control::Bot, LevelQueue::list([level])));
                game.tools().bots.attach_demonstrator(&mut world, agent, 0.0);
                let tick = |_| {
                    world.tick().expect("sound");
                    let (hash, reward) = (world.get::<StateHash>(agent), world.get::<Reward>(agent));
                    (hash.expect("an agent").0, reward.expect("an agent").get())
                };
                (0..$ticks).map(tick).collect()
            };
            let sound: Vec<_> = (0..$levels).map(|level| play(&*$game, level)).collect();
            assert_eq!(play(&Mutant::sound($game), 0), sound[0]);
            for kind in $kinds {
                for variant in 0..3 {
                    let mutant = Mutant::new($game, &kind, variant);
                    let differs = |level: u64| play(&mutant, level) != sound[level as usize];
                    assert!((0..$levels).any(differs), "{} {variant}", kind.class);
                }
            }
        }
    };
}
