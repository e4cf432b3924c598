//! Tests of verdicts on games that break, and on games that are built anew for each episode.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::{
    eval::Player,
    foreign::{EditorLevel, Restart},
};
use playbot_test::{
    detectors::Detectors,
    verdict::{
        LevelOutcome, LevelVerdict, TestEnd, TestError, TestObserver, TestPlan, Tester, TesterRecord, run_tests,
    },
};
use playbot_tests::{as_corridor, corridor_plugin, faulty::Fault as Planted, foreign::stubborn::stubborn_game};

fn tester(name: &str, bot: BlindBot) -> Tester {
    Tester {
        record: TesterRecord::bot(name),
        player: Player::Blind(bot),
        observation_config: ObservationConfig::default(),
    }
}

/// Returns a tester that goes right, and a random one.
fn testers() -> Vec<Tester> {
    let right = BlindBot::Constant(ActionValue::Discrete(1));
    vec![tester("right", right), tester("random", BlindBot::Uniform)]
}

fn plan(levels: &str, testers: Vec<Tester>, threads: usize) -> TestPlan {
    let (split, detectors) = (levels.parse().expect("levels"), Detectors::default());
    TestPlan { split, testers, episodes: 3, seed: 2, detectors, shard: None, threads }
}

/// Returns all verdicts, in the order of the levels.
fn verdicts(game: &dyn Game, plan: &TestPlan) -> Vec<LevelVerdict> {
    let mut found = Vec::new();
    let mut keep = |verdict: LevelVerdict| -> Result<(), TestError> {
        found.push(verdict);
        Ok(())
    };
    let watch = TestObserver { progress: &|_| {}, stop: &|| false };
    let end = run_tests(game, plan, &BTreeSet::new(), &mut keep, &watch).expect("it can be played");
    assert_eq!(end, TestEnd::Done);
    found.sort_by_key(|verdict| verdict.index);
    found
}

#[test]
fn levels_of_an_editor_have_their_names_in_results() {
    let level = |name: &str| EditorLevel::of_rows(name, vec!["S.G".to_owned()], Vec2::ONE);
    let game = ForeignGame::new("rooms", 1, |_: &mut App| {})
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["x"], || [0.0])
        .end(|| Some(EpisodeEnd::WON))
        .editor_levels(Ok(vec![level("Pantry"), level("Cave")]));
    let found = verdicts(&game, &plan("default:0..1", vec![tester("random", BlindBot::Uniform)], 1));
    let titles: Vec<String> = found.iter().map(LevelVerdict::title).collect();
    assert_eq!(titles, ["default:0 Pantry", "default:1 Cave"]);
    let line = serde_json::to_value(&found[1]).expect("JSON");
    assert_eq!((&line["level"], &line["name"]), (&"default:1".into(), &"Cave".into()));
    let mut older = line.clone();
    older.as_object_mut().expect("an object").remove("name");
    let older: LevelVerdict = serde_json::from_value(older).expect("results of an older version");
    assert_eq!(older, LevelVerdict { name: None, ..found[1].clone() });
}

/// The corridor, which panics on level 3 when the agent stands at its last cell but one, and breaks its contract on
/// level 6.
struct Cursed;

fn curse(mut agents: Query<(&Episode, &playbot_tests::Cell, &mut Reward)>) {
    for (episode, cell, mut reward) in &mut agents {
        if !episode.is_running() {
            continue;
        }
        assert!(episode.level != 3 || cell.0 != 5, "the corridor burns");
        if episode.level == 6 && episode.tick == 1 {
            reward.add(f32::NAN);
        }
    }
}

impl Game for Cursed {
    fn name(&self) -> &'static str {
        "cursed"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["plain"]
    }

    as_corridor! {
        fn tick_hz() -> f64;
        fn actions() -> ActionSpace;
        fn observation() -> ObservationSpace;
        fn spawn_agent(world: &mut World, index: u32) -> Entity;
    }

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
        app.add_systems(FixedPostUpdate, curse.before(PlaybotSystems::Judge));
    }
}

#[test]
fn a_level_that_breaks_the_game_is_found_and_the_others_are_played_as_if_nothing_had_been() {
    let cursed = verdicts(&Cursed, &plan("plain:0..9", testers(), 1));
    let sound = verdicts(&playbot_tests::Corridor, &plan("plain:0..9", testers(), 1));
    for (level, healthy) in cursed.iter().zip(&sound) {
        if ![3, 6].contains(&level.index) {
            assert_eq!(level, healthy);
            assert_eq!((level.outcome, level.score.episodes), (LevelOutcome::Solved, 6));
        }
    }
    let burning = &cursed[3].findings[0];
    assert_eq!((burning.detector.as_str(), burning.tester.as_deref()), ("panic", Some("right")));
    // From cell 3 the second step leads to cell 5: tick 1.
    assert_eq!((burning.episode, burning.tick), (Some(0), Some(1)));
    assert!(burning.message.starts_with("the corridor burns"), "{}", burning.message);
    assert_eq!((cursed[3].testers[0].score.broken, cursed[3].testers[0].exact), (3, true));
    let unpaid = &cursed[6].findings[0];
    assert_eq!((unpaid.detector.as_str(), cursed[6].outcome), ("fault", LevelOutcome::BotFailed));
    assert!(unpaid.message.contains("the reward is NaN"), "{}", unpaid.message);
    assert_eq!(cursed, verdicts(&Cursed, &plan("plain:0..9", testers(), 2)), "threads change nothing");
}

#[test]
fn a_game_that_always_breaks_has_a_finding_on_every_level() {
    let found = verdicts(&Planted::Panic, &plan("bed:0..4", vec![tester("random", BlindBot::Uniform)], 2));
    assert_eq!(found.len(), 5);
    for level in &found {
        assert_eq!((level.outcome, level.score.broken), (LevelOutcome::BotFailed, 3));
        assert_eq!((level.findings.len(), level.findings[0].tick), (1, Some(5)), "{level:?}");
    }
}

#[test]
fn draws_depend_on_seed_tester_and_level_alone() {
    let all = verdicts(&playbot_tests::Corridor, &plan("plain:0..19", testers(), 2));
    let random = vec![tester("random", BlindBot::Uniform)];
    let alone = verdicts(&playbot_tests::Corridor, &plan("plain:7..12", random.clone(), 1));
    for level in &alone {
        assert_eq!(level.testers[0], all[level.index as usize + 7].testers[1], "{}", level.level);
    }
    let other = TestPlan { seed: 3, ..plan("plain:7..12", random, 1) };
    assert_ne!(verdicts(&playbot_tests::Corridor, &other), alone);
    assert!(all.iter().all(|level| level.testers[0].exact && !level.testers[1].exact));
}

/// The stubborn game keeps state beyond its levels, so its Worlds are built anew.
#[test]
fn a_game_that_is_built_anew_has_the_same_verdicts_whatever_was_played_before() {
    let game = stubborn_game(Restart::Rebuild);
    let random = vec![tester("random", BlindBot::Uniform)];
    let all = verdicts(&game, &plan("default:0..19", random.clone(), 2));
    let some = verdicts(&game, &plan("default:10..13", random, 1));
    for level in &some {
        assert_eq!(level.testers, all[level.index as usize + 10].testers, "{}", level.level);
    }
}
