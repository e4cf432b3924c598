//! Tests of detectors on games with planted defects, and on unmutated ones.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_games::{antmaze::AntMaze, coinrun::CoinRun, maze2d::Maze2d};
use playbot_harness::{detector::LevelProof, eval::Player, foreign::ForeignGame};
use playbot_mutation::bugs::{Mutant, defect_kinds};
use playbot_test::detectors::{DetectorChoice, Detectors};
use playbot_tests::{Corridor, faulty::Fault as Garden};

use crate::corridor_defects::{Defect, always, assert_silent, findings, only, random, tester, verdicts};

#[test]
fn what_is_wrong_in_a_shared_world_is_reported_of_the_episode_that_did_it() {
    let testers = || vec![always(2), random()];
    for (defect, detector, words) in
        [(Defect::FlyingBody, "runaway", "`Crate`"), (Defect::LoggedError, "error-log", "the door has no key")]
    {
        let found = findings(&defect, "plain:0..7", testers(), only(&defect, &[detector], &[]));
        let of_resting = &found.first().expect("it is found").1;
        assert!(found.iter().all(|(index, finding)| *index == 2 && finding.detector == detector), "{found:?}");
        assert_eq!(
            (of_resting.tester.as_deref(), of_resting.episode, of_resting.tick),
            (Some("always 2"), Some(0), Some(1))
        );
        assert!(of_resting.message.contains(words), "{}", of_resting.message);

        let one = verdicts(&defect, "plain:0..7", testers(), only(&defect, &[detector], &[]), 1);
        assert_eq!(one, verdicts(&defect, "plain:0..7", testers(), only(&defect, &[detector], &[]), 2), "threads");
        let sound = findings(&Defect::None, "plain:0..7", testers(), only(&defect, &[detector], &[]));
        assert_silent(&sound);
    }
}

#[test]
fn a_games_own_detector_looks_with_the_others() {
    let found = findings(&Defect::None, "plain:0..1", vec![always(1), always(2)], Detectors::defaults(&Defect::None));
    let who: Vec<_> = found.iter().map(|(index, finding)| (*index, finding.detector.as_str(), finding.tick)).collect();
    assert_eq!(who, [(0, "late", Some(10)), (1, "late", Some(10))]);
    assert!(found.iter().all(|(_, finding)| finding.tester.as_deref() == Some("always 2")), "{found:?}");
}

#[test]
fn entities_that_stay_are_a_leak() {
    let leaks = |game: Garden| findings(&game, "bed:0..1", vec![random()], only(&game, &["entity-leak"], &[]));
    let found = leaks(Garden::LeftOvers);
    assert_eq!(found.len(), 1, "only the first of a thousand levels is looked at");
    assert_eq!((found[0].0, found[0].1.detector.as_str(), &found[0].1.tester), (0, "entity-leak", &None));
    assert_silent(&leaks(Garden::None));
}

#[test]
fn a_game_that_plays_differently_each_time_is_found() {
    let breaches = |game: Garden| {
        let detectors = only(&game, &["determinism"], &["determinism.every=2"]);
        findings(&game, "bed:0..2", vec![random()], detectors)
    };
    let found = breaches(Garden::UnseededRandomness);
    assert_eq!(found.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [0, 2]);
    assert!(found.iter().all(|(_, finding)| finding.message.contains("doctor")), "{found:?}");
    assert_silent(&breaches(Garden::None));
}

#[test]
fn what_a_world_keeps_from_one_episode_to_the_next_is_a_breach_of_determinism() {
    let kinds = defect_kinds(&Corridor);
    let leak = kinds.iter().find(|kind| kind.class == "state-leak").expect("every game can have it");
    let seen = |game: &dyn Game, settings: &[&str]| {
        let mut found = findings(game, "plain:0..1", vec![random()], only(game, &["determinism"], settings));
        found.pop().map(|(_, finding)| finding.message)
    };
    for (variant, episode) in [(0, 2), (1, 2), (2, 3)] {
        let message = seen(&Mutant::new(&Corridor as &dyn Game, leak, variant), &[]).expect("it is found");
        assert!(message.starts_with(&format!("episode {episode} of a World differed")), "{variant}: {message}");
    }
    let late = Mutant::new(&Corridor as &dyn Game, leak, 2);
    assert_eq!(seen(&late, &["determinism.episodes=2"]), None, "that is too soon for it");
    assert_eq!(seen(&Corridor, &[]), None);
}

#[test]
fn a_level_that_is_solved_too_fast_has_a_shortcut() {
    let solve = |par: &str| findings(&Corridor, "plain:1", vec![always(1)], only(&Corridor, &["shortcut"], &[par]));
    let found = solve("shortcut.par=20");
    // From cell 3 to cell 6.
    assert!(found[0].1.message.contains("solved in 3 ticks"), "{found:?}");
    assert_eq!(found[0].1.tick, Some(2));
    assert_silent(&solve("shortcut.par=5"));
    // The corridor has no demonstrator.
    assert_silent(&solve("shortcut.factor=0.9"));
}

#[test]
fn rewards_for_doing_nothing_are_found() {
    let names = ["reward-farm", "reward-loop"];
    let testers = || vec![always(1), always(2)];
    let found = findings(&Defect::PaidRest, "plain:1", testers(), only(&Defect::PaidRest, &names, &[]));
    let who: Vec<_> = found.iter().map(|(_, finding)| (finding.detector.as_str(), finding.tick)).collect();
    // Staying is paid for the tenth time in tick 10; time is up after 20 ticks.
    assert_eq!(who, [("reward-loop", Some(10)), ("reward-farm", Some(19))], "{found:?}");
    assert_silent(&findings(&Defect::None, "plain:1", testers(), only(&Defect::None, &names, &[])));
}

#[test]
fn a_wing_out_of_reach_is_found() {
    let explore = |game: Defect| {
        // Cells on which an episode ends may not count as reached.
        let settings = ["unreachable-region.steps=3000", "unreachable-region.share=0.4"];
        findings(&game, "plain:1", vec![always(1)], only(&game, &["unreachable-region"], &settings))
    };
    let found = explore(Defect::ClosedWing);
    assert!(found.len() == 1 && found[0].1.message.contains("of the open tiles"), "{found:?}");
    assert_silent(&explore(Defect::None));
}

#[test]
fn detectors_by_the_plan_and_the_clock_are_silent_on_sound_levels() {
    let (coinrun, maze, ants) = (CoinRun::default(), Maze2d::default(), AntMaze);
    let names =
        ["soft-lock", "through-wall", "goal-ignored", "far-goal", "short-time", "uneven-time", "clock-end", "too-long"];
    let games: [(&dyn Game, &str); 5] = [
        (&coinrun, "hard:0..19"),
        (&coinrun, "easy:0..9"),
        (&maze, "medium+goal=random:0..2"),
        (&maze, "random+size=9x9+sparse+end-at-goal:0..4"),
        (&ants, "umaze:0"),
    ];
    for (game, levels) in games {
        let mut testers = vec![random()];
        if game.name() != ants.name() {
            testers.push(tester("demonstrator", Player::Demonstrator));
        }
        let found = findings(game, levels, testers, only(game, &names, &[]));
        assert!(found.is_empty(), "{} {levels}: {found:?}", game.name());
    }
}

#[test]
fn actions_of_sound_levels_do_not_fade() {
    let (coinrun, maze) = (CoinRun::default(), Maze2d::default());
    let games: [(&dyn Game, &str); 4] = [
        (&coinrun, "hard:0..3"),
        (&coinrun, "easy:0..1"),
        (&maze, "medium+goal=random:0..1"),
        (&Corridor, "plain:0..1"),
    ];
    for (game, levels) in games {
        let settings = ["fading-action.every=1", "fading-action.tries=12", "fading-action.last=2"];
        let found = findings(game, levels, vec![random()], only(game, &["fading-action"], &settings));
        assert!(found.is_empty(), "{} {levels}: {found:?}", game.name());
    }
}

#[test]
fn default_detectors_are_silent_on_sound_levels() {
    let (coinrun, maze, ants) = (CoinRun::default(), Maze2d::default(), AntMaze);
    let games: [(&dyn Game, u64); 3] = [(&coinrun, 9), (&maze, 1), (&ants, 0)];
    for (game, last) in games {
        let levels = format!("{}:0..{last}", game.modes()[0]);
        let mut testers = vec![random()];
        if game.name() != ants.name() {
            testers.push(tester("demonstrator", Player::Demonstrator));
        }
        let found = findings(game, &levels, testers, Detectors::defaults(game));
        assert!(found.is_empty(), "{} {levels}: {found:?}", game.name());
    }
}

#[test]
fn mistakes_are_reported_with_what_would_be_right() {
    let said = |with: &str, setting: &str| {
        let words = |word: &str| if word.is_empty() { Vec::new() } else { vec![word.to_owned()] };
        let choice = DetectorChoice { with: words(with), without: Vec::new(), settings: words(setting) };
        Detectors::choose(&Corridor, &choice).map(drop).expect_err("it is wrong").to_string()
    };
    for (words, part) in [
        (said("stuk", ""), "did you mean `stuck`?"),
        (said("", "stuck.tick=3"), "did you mean `ticks`?"),
        (said("", "stuck"), "stuck.ticks=200"),
        (said("", "stuck.ticks=0"), "at least 1"),
        (said("", "stuck.ticks=many"), "at least 1"),
        (said("", "shortcut.par=3"), "--detect shortcut"),
    ] {
        assert!(words.contains(part), "{words}");
    }
    let record = only(&Corridor, &["stuck"], &["stuck.ticks=200"]).record().to_vec();
    assert_eq!(record, ["stuck ticks=200 distance=0.01"]);
}

/// The screens of a game with a menu.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
enum Screen {
    #[default]
    Title,
    Playing,
}

/// A game that starts in a menu, which `Enter` leaves. No mouse is needed.
fn titled(keys: [KeyCode; 1]) -> ForeignGame {
    let game = |app: &mut App| {
        let leave = |keys: Res<ButtonInput<KeyCode>>, mut next: ResMut<NextState<Screen>>| {
            if keys.just_pressed(KeyCode::Enter) {
                next.set(Screen::Playing);
            }
        };
        let menu = |mut commands: Commands| {
            commands.spawn((Button, children![Text::new("New game")]));
            commands.spawn((Button, Name::new("QuitButton")));
        };
        let play = |mut clock: Local<u32>, mut commands: Commands| {
            *clock += 1;
            commands.spawn(Transform::from_xyz(*clock as f32, 0.0, 0.0));
        };
        app.init_state::<Screen>()
            .register_type_state::<Screen>()
            .add_systems(Startup, menu)
            .add_systems(Update, leave.run_if(in_state(Screen::Title)))
            .add_systems(Update, play.run_if(in_state(Screen::Playing)));
    };
    ForeignGame::new("titled", 1, game).keys([Vec::new(), keys.to_vec()]).observe(["nothing"], || [0.0]).time_limit(60)
}

#[test]
fn a_menu_that_no_action_leaves_is_found_with_its_state_and_its_buttons() {
    let found = |key: KeyCode| {
        let game = titled([key]);
        findings(&game, "default:0..0", vec![random()], Detectors::defaults(&game))
    };
    let frozen = found(KeyCode::Space);
    assert_eq!(frozen.len(), 1, "{frozen:?}");
    let words = "nothing has changed since the start of the episode, for 59 ticks, whatever the agent did: the state \
                 `Screen` is `Title`; the buttons are `New game`, `QuitButton`";
    assert_eq!((frozen[0].1.message.as_str(), frozen[0].1.tick), (words, Some(59)), "time was up");
    assert_silent(&found(KeyCode::Enter));
}

#[test]
fn detectors_for_which_episodes_are_too_short_say_what_they_need() {
    let game = titled([KeyCode::Enter]);
    let short = |names: &[&str], settings: &[&str]| {
        let mut tested = verdicts(&game, "default:0..0", vec![random()], only(&game, names, settings), 1);
        tested.pop().map(|verdict| verdict.too_short).expect("a level")
    };
    let names = ["stuck", "frozen-world", "dead-action", "fading-action"];
    let found = short(&names, &[]);
    let had: Vec<_> = found.iter().map(|it| (it.detector.as_str(), it.needs, it.had, it.setting.as_deref())).collect();
    let expected = [
        ("dead-action", 7 * 20, 60, Some("dead-action.ticks=8")),
        ("fading-action", 40 + 8 * 45, 60, Some("fading-action.rest=2")),
    ];
    assert_eq!(had, expected, "`stuck` misses a position, and `frozen-world` is content with half the time limit");
    let settings: Vec<&str> = found.iter().filter_map(|it| it.setting.as_deref()).collect();
    assert_eq!(short(&names, &settings), [], "they can look with these");
    let placed = titled([KeyCode::Enter]).position(|| Vec2::ZERO).prove_from(|| LevelProof::Unknown);
    let tested = verdicts(&placed, "default:0..0", vec![random()], Detectors::defaults(&placed), 1);
    let had: Vec<_> = tested[0].too_short.iter().map(|it| (it.detector.as_str(), it.needs)).collect();
    assert_eq!(had, [("stuck", 301), ("soft-lock", 101), ("fell-through", 61)]);
}

#[test]
fn a_fall_in_space_is_one_along_the_height() {
    #[derive(Component)]
    struct Stone;
    let falling = |way: Vec3| {
        let game = move |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| _ = commands.spawn((Stone, Transform::default())))
                .add_systems(Update, move |mut at: Single<&mut Transform, With<Stone>>| at.translation += way);
        };
        let game = ForeignGame::new("stone", 1, game)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["nothing"], || [0.0])
            .position(|at: Single<&Transform, With<Stone>>| at.translation)
            .time_limit(100);
        let detectors = only(&game, &["fell-through"], &["fell-through.depth=50"]);
        findings(&game, "default:0..0", vec![random()], detectors)
    };
    let found = falling(Vec3::NEG_Y);
    assert_eq!(found.iter().map(|(_, finding)| finding.tick).collect::<Vec<_>>(), [Some(60)], "{found:?}");
    assert_silent(&falling(Vec3::NEG_Z));
}
