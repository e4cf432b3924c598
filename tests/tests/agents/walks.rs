//! Tests of positions, causes of ends and skills in results.

use std::collections::{BTreeMap, BTreeSet};

use bevy::prelude::*;
use bevy_playbot::action::Actions;
use bevy_playbot::demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoWriter};
use playbot::prelude::*;
use playbot_harness::{
    eval::Player,
    floor_plan::FloorPlan,
    foreign::ForeignGame,
    game::{LevelTools, StateTools},
};
use playbot_learner::{DeviceKind, Learner as _, PolicySpec, PpoConfig, PpoLearner, Prior, SkillDraw};
use playbot_test::{
    detectors::Detectors,
    findings::course_of,
    verdict::{
        Earlier, EpisodePath, LevelMaps, LevelVerdict, Overview, Places, PlanRows, RecordedWins, SquareEnds, TestError,
        TestFolder, TestObserver, TestPlan, Tester, TesterEvents, run_tests,
    },
};
use playbot_tests::{Cell, as_corridor, corridor_plugin};

use crate::corridor_defects::tester;

/// The corridor with a plan: seven squares of side 1 below a wall. Agents start in square 3 or 4 and are through in
/// square 6; in square 0 is an abyss.
struct Charted;

impl Game for Charted {
    fn name(&self) -> &'static str {
        "charted"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["plain"]
    }

    /// Returns a rate at which eight ticks without a new square are two seconds.
    fn tick_hz(&self) -> f64 {
        4.0
    }

    as_corridor! {
        fn actions() -> ActionSpace;
        fn observation() -> ObservationSpace;
        fn spawn_agent(world: &mut World, index: u32) -> Entity;
    }

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, state: self, ..GameTools::default() }
    }
}

impl LevelTools for Charted {
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        Some(FloorPlan {
            bounds: Rect::new(0.0, 0.0, 7.0, 2.0),
            walls: vec![Rect::new(0.0, 1.0, 7.0, 2.0)],
            start: Vec2::new(3.5, 0.5),
            goal: Vec2::new(6.5, 0.5),
            ..FloorPlan::default()
        })
    }
}

impl StateTools for Charted {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<Cell>(agent).map(|cell| Vec2::new(cell.0 as f32 + 0.5, 0.5))
    }

    fn end_cause(&self, world: &World, agent: Entity) -> Option<&'static str> {
        (world.get::<Cell>(agent)?.0 == 0).then_some("abyss")
    }
}

/// Returns a tester with a constant action: 0 goes left, 1 goes right, 2 rests.
fn constant(name: &str, action: u32) -> Tester {
    tester(name, Player::Blind(BlindBot::Constant(ActionValue::Discrete(action))))
}

fn plan(levels: &str, testers: Vec<Tester>, episodes: u32, threads: usize) -> TestPlan {
    let (split, detectors) = (levels.parse().expect("levels"), Detectors::default());
    TestPlan { split, testers, episodes, seed: 2, detectors, shard: None, threads }
}

/// Returns all verdicts on the corridor, in the order of the levels.
fn verdicts(plan: &TestPlan) -> Vec<LevelVerdict> {
    verdicts_of(&Charted, plan)
}

/// Returns all verdicts on a game, in the order of the levels.
fn verdicts_of(game: &dyn Game, plan: &TestPlan) -> Vec<LevelVerdict> {
    let mut found = Vec::new();
    let mut keep = |verdict: LevelVerdict| -> Result<(), TestError> {
        found.push(verdict);
        Ok(())
    };
    let watch = TestObserver { progress: &|_| {}, stop: &|| false };
    run_tests(game, plan, &BTreeSet::new(), &mut keep, &watch).expect("it can be played");
    found.sort_by_key(|verdict| verdict.index);
    found
}

#[test]
fn an_unsolved_level_says_where_most_episodes_stopped() {
    let stop = |testers: Vec<Tester>| verdicts(&plan("plain:0..0", testers, 3, 1))[0].stop.clone();
    // Level 0 starts in square 4, and the first tick leads to square 3: the abyss is 3 squares from there.
    let stopped = |tester| stop(vec![tester]).map(|stop| stop.to_string());
    let left = "all 3 episodes got no further from their start than (0.5, 0.5), within 0.0";
    assert_eq!(stopped(constant("left", 0)).as_deref(), Some(left));
    let rest = "all 3 episodes stayed within 0.0 of (4.5, 0.5)";
    assert_eq!(stopped(constant("rest", 2)).as_deref(), Some(rest));
    assert_eq!(stop(vec![constant("left", 0), constant("right", 1)]), None, "it is solved");
    // Three of six is not most: three rest and three fall.
    let both = stop(vec![constant("rest", 2), constant("left", 0)]).map(|stop| stop.to_string());
    assert_eq!(
        both.as_deref(),
        Some("of 6 episodes, the one that went furthest got no further from its start than (0.5, 0.5)")
    );
}

#[test]
fn a_level_whose_every_episode_is_won_in_its_first_tick_is_known() {
    let at_start = |levels: &str, testers: Vec<Tester>| verdicts(&plan(levels, testers, 1, 1))[0].solved_at_start;
    assert!(!at_start("plain:0..0", vec![constant("right", 1)]), "it takes two ticks");
    let won = ForeignGame::new("won", 1, |_: &mut App| {})
        .keys([vec![], vec![KeyCode::ArrowRight]])
        .observe(["x"], || [0.0])
        .end(|| Some(EpisodeEnd::WON))
        .time_limit(20);
    let found = verdicts_of(&won, &plan("default:0..1", vec![constant("rest", 0), constant("right", 1)], 2, 1));
    let known: Vec<_> = found.iter().map(|level| (level.score.solved, level.solved_at_start)).collect();
    assert_eq!(known, [(4, true); 2]);
}

#[test]
fn an_invisible_wall_shows_in_a_game_without_position_and_plan() {
    #[derive(Component)]
    struct Player;

    let game = |app: &mut App| {
        app.add_systems(Startup, |mut commands: Commands| {
            commands.spawn((Player, Transform::default()));
        })
        .add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, mut at: Single<&mut Transform, With<Player>>| {
                let step = f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
                at.translation.x = (at.translation.x + step).min(3.0);
            },
        );
    };
    let walled = ForeignGame::new("walled", 1, game)
        .keys([vec![], vec![KeyCode::ArrowRight]])
        .observe(["x"], |at: Single<&Transform, With<Player>>| [at.translation.x])
        .end(|at: Single<&Transform, With<Player>>| (at.translation.x >= 6.0).then_some(EpisodeEnd::WON))
        .time_limit(20);
    let entity = "the entity with `Player`";
    let stopped = |game: &ForeignGame, entity: Option<&str>| {
        let found = verdicts_of(game, &plan("default:0..0", vec![constant("right", 1)], 3, 1));
        let reached = found[0].reached.as_ref().expect("its positions are known, and it has no plan");
        // From 1 to 3 there are 17 cells of an eighth, and 33 of a sixteenth.
        assert_eq!((reached.side, reached.cells.last(), reached.entity.as_deref()), (0.125, Some(&[24, 0]), entity));
        found[0].stop.as_ref().map(ToString::to_string).unwrap_or_default()
    };
    let words = "all 3 episodes got no further from their start than (3.0, 0.0), within 0.0";
    assert_eq!(stopped(&walled, Some(entity)), format!("{words}, by the position of {entity}"));
    let declared = walled.position(|at: Single<&Transform, With<Player>>| at.translation.truncate());
    assert_eq!(stopped(&declared, None), words, "a declared position needs no guess");
}

#[test]
fn a_recording_of_an_earlier_build_says_where_its_actions_lead_elsewhere() {
    #[derive(Component)]
    struct Player;

    // The track ends at `end`, and each position pays its distance from the start this often.
    let track = |end: f32, goal: f32, pay: f32| {
        let game = move |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Player, Transform::default()));
            })
            .add_systems(
                Update,
                move |keys: Res<ButtonInput<KeyCode>>, mut at: Single<&mut Transform, With<Player>>| {
                    let step = f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
                    at.translation.x = (at.translation.x + step).min(end);
                },
            );
        };
        ForeignGame::new("track", 1, game)
            .keys([vec![], vec![KeyCode::ArrowRight]])
            .observe(["x"], |at: Single<&Transform, With<Player>>| [at.translation.x])
            .reward(move |at: Single<&Transform, With<Player>>| pay * at.translation.x)
            .end(move |at: Single<&Transform, With<Player>>| (at.translation.x >= goal).then_some(EpisodeEnd::WON))
            .time_limit(20)
    };
    let before = track(9.0, 6.0, 1.0);
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("before.demo");
    let right = constant("right", 1);
    let course = course_of(&before, ("default", 0), 0, &right.player);
    let header = DemoHeader { demonstrator: "right".to_owned(), ..before.demo_header("default") };
    let mut episode = DemoEpisode::new(0, header.actions);
    let ticks = course.rewards.len();
    episode.actions = Actions::Discrete(vec![1; ticks]);
    (episode.rewards, episode.state_hashes) = (course.rewards, course.state_hashes);
    (episode.deciders, episode.end) = (vec![Decider::Bot; ticks], DemoEnd::Terminated { success: true });
    DemoWriter::replace(&recording, header).and_then(|mut writer| writer.push(&episode)).expect("writable");

    let compared = |game: &ForeignGame, name: &str, tester: &Tester| {
        let plan = plan("default:0..1", vec![tester.clone()], 1, 1);
        let results = folder.path().join(name);
        let (mut open, _) = TestFolder::open(&results, &plan.record(game), Earlier::Keep).expect("new");
        verdicts_of(game, &plan).iter().for_each(|level| open.keep(level).expect("writable"));
        let wins = |threads| {
            let wins = RecordedWins::read(game, &plan, &recording).expect("comparable");
            wins.courses(game, threads, &|_| {}, &|| false).expect("nothing stops it")
        };
        let courses = wins(1);
        assert_eq!(wins(2), courses, "threads change nothing");
        open.finish_against(&courses).expect("writable");
        let overview = Overview::read(&results).expect("results");
        assert_eq!(overview.recorded.levels, 1, "the second level is not in the recording");
        (overview.recorded.regressions, overview.recorded.others)
    };
    let words = |end: &str| vec![format!("default:0: the recording solves it in {ticks} ticks; its actions {end}")];
    let rest = constant("rest", 0);
    // After tick 3 the agent was at 4.
    let elsewhere = "lead elsewhere from tick 3 on, after `ArrowRight`, at (3.0, 0.0), and do not reach the goal: they \
                     come no further than (3.0, 0.0)";
    assert_eq!(compared(&track(3.0, 6.0, 1.0), "walled", &right), (words(elsewhere), Vec::new()));
    let weak = words("still do, so the testers are too weak");
    assert_eq!(compared(&before, "weak", &rest), (Vec::new(), weak));
    assert_eq!(compared(&before, "unchanged", &right), (Vec::new(), Vec::new()));
    // Of levels that the tester solves.
    let early = "lead elsewhere from tick 3 on, after `ArrowRight`, at (4.0, 0.0), and reach the goal after 4 ticks";
    assert_eq!(compared(&track(9.0, 4.0, 1.0), "early", &right), (words(early), Vec::new()));
    let far = "lead elsewhere from tick 5 on, after `ArrowRight`, at (6.0, 0.0), and do not reach the goal: they come no \
               further than (6.0, 0.0)";
    assert_eq!(compared(&track(9.0, 8.0, 1.0), "far", &right), (words(far), Vec::new()));
    let paid = "lead elsewhere from tick 0 on, after `ArrowRight`, at (1.0, 0.0), and still reach the goal";
    assert_eq!(compared(&track(9.0, 6.0, 2.0), "paid", &right), (Vec::new(), words(paid)));

    let of_others = |range| plan(range, vec![rest.clone()], 1, 1);
    let wins = RecordedWins::read(&before, &of_others("default:0..1"), &recording).expect("comparable");
    assert!(wins.courses(&before, 1, &|_| {}, &|| true).is_none(), "it was stopped");
    let others = RecordedWins::read(&before, &of_others("default:5..6"), &recording).map(drop);
    let others = others.expect_err("it has level 0").to_string();
    assert!(others.contains("before.demo has no solved episode on a level of default:5..6: name a rec"), "{others}");
}

#[test]
fn visits_lost_time_causes_and_places_are_counted() {
    let testers = || vec![constant("left", 0), constant("rest", 2), constant("right", 1)];
    let found = verdicts(&plan("plain:0..0", testers(), 1, 1));
    let level = &found[0];
    let places = |visited| Some(Places { visited, open: 7 });
    // From square 4: to the left 3, 2, 1 and 0, to the right 5 and 6.
    assert_eq!(level.testers.iter().map(|tester| tester.places).collect::<Vec<_>>(), [places(4), places(1), places(2)]);
    assert_eq!(level.places, places(7));
    let failure = EpisodePath { tester: "left".to_owned(), episode: 0, path: vec![[3, 1], [2, 1], [1, 1], [0, 1]] };
    let expected = LevelMaps {
        side: 1.0,
        columns: 7,
        rows: 2,
        visits: vec![[0, 1], [1, 1], [2, 1], [3, 1], [4, 20], [5, 1], [6, 1]],
        // Of 20 ticks the first one is new, and the eight after it are two seconds.
        lost: vec![[4, 11]],
        failure: Some(failure),
        best: Some(EpisodePath { tester: "right".to_owned(), episode: 0, path: vec![[5, 1], [6, 1]] }),
        plan: Some(PlanRows { side: 1.0, rows: "7#/3.S2.G".to_owned() }),
        ..LevelMaps::default()
    };
    let events = |ends: &[[u64; 3]], lost: &[[u64; 2]], visited: &[[u64; 2]]| {
        Some(TesterEvents { ends: ends.to_vec(), lost: lost.to_vec(), visited: visited.to_vec() })
    };
    let of_testers = [
        events(&[[0, 1, 0]], &[], &[[0, 4]]),
        events(&[[4, 0, 1]], &[[4, 11]], &[[4, 1]]),
        events(&[], &[], &[[5, 2]]),
    ];
    assert_eq!(level.testers.iter().map(|tester| tester.events.clone()).collect::<Vec<_>>(), of_testers);
    assert_eq!((&level.maps, &level.reached), (&Some(expected), &None), "a map has more than cells");
    let abyss = BTreeMap::from([("abyss".to_owned(), 1)]);
    assert_eq!(level.causes, abyss);
    let ended: Vec<(u64, u64, &BTreeMap<String, u64>)> =
        level.ends.iter().map(|SquareEnds { lost, timed_out, causes, .. }| (*lost, *timed_out, causes)).collect();
    assert_eq!(ended, [(1, 0, &abyss), (0, 1, &BTreeMap::new())]);
}

#[test]
fn of_many_levels_only_those_that_failed_have_maps() {
    let random = || vec![constant("right", 1), tester("random", Player::Blind(BlindBot::Uniform))];
    let whole = plan("plain:0..2999", random(), 1, 2);
    let part = TestPlan { shard: Some("3/100".parse().expect("a shard")), ..whole };
    let found = verdicts(&part);
    assert_eq!(found.len(), 30);
    for level in &found {
        assert_eq!(level.maps.is_some(), level.score.solved < level.score.episodes, "{}", level.level);
        assert_eq!(level.maps.is_some(), level.places.is_some(), "{}", level.level);
    }
    let mapped = found.iter().filter(|level| level.maps.is_some()).count();
    assert!((1..30).contains(&mapped), "{mapped} levels with maps");
    assert_eq!(verdicts(&TestPlan { threads: 1, ..part }), found, "threads change nothing");
}

#[test]
fn skills_of_a_policy_are_reported_where_they_were_active() {
    let spec = PolicySpec { obs: 2.into(), latent: 2, action_space: ActionSpace::Discrete(3) };
    let policy = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex).expect("good settings").policy();
    let prior = SkillPrior { prior: Prior::standard_normal(2, false), skill_interval: 3, draw: SkillDraw::Sample };
    let skilled = Player::Policy { policy, prior: Some(prior), draw: ActionDraw::Sample };
    let found = verdicts(&plan("plain:0..3", vec![tester("skilled", skilled)], 8, 2));
    for level in &found {
        let maps = level.maps.as_ref().expect("few levels have maps");
        let visits: u64 = maps.visits.iter().map(|[_, ticks]| ticks).sum();
        assert_eq!(maps.skills.iter().map(|skill| skill.ticks).sum::<u64>(), visits, "{maps:?}");
        assert!(maps.skills.is_sorted_by(|one, other| one.ticks >= other.ticks), "{maps:?}");
        let known = ["z1+", "z1-", "z2+", "z2-"];
        assert!(maps.skills.iter().all(|skill| known.contains(&skill.skill.as_str())), "{maps:?}");
        let squares = |pairs: &[[u64; 2]]| pairs.iter().map(|[square, _]| *square).collect::<Vec<_>>();
        assert_eq!(squares(&maps.skill_at), squares(&maps.visits));
        assert!(maps.skill_at.iter().all(|[_, skill]| (*skill as usize) < maps.skills.len()), "{maps:?}");
    }
    assert!(found.iter().any(|level| level.maps.as_ref().is_some_and(|maps| maps.skills.len() > 1)));
}
