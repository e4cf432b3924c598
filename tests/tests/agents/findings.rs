//! Tests of findings as files: replayed, shortened, and tested again.

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::{eval::Player, games::Games};
use playbot_test::{
    detectors::Detectors,
    findings::{
        Budget, Check, CheckTick, Checks, Date, FINDINGS, FindingFiles, FindingHead, FindingStatus, Minimised, PINS,
        Regress, Regression, StoredFinding, Watcher, keep::recheck, list_findings, minimise, regress, regress_until,
    },
    verdict::{LevelVerdict, TestError, TestObserver, TestPlan, Tester, TesterRecord, run_tests_keeping},
};
use playbot_tests::{Cell, Corridor, as_corridor, corridor_plugin};

/// The corridor, which panics on level 3 when the agent stands at its last cell but one, unless that is mended.
struct Burning {
    is_mended: bool,
}

fn burn(agents: Query<(&Episode, &Cell)>) {
    for (episode, cell) in &agents {
        assert!(!episode.is_running() || episode.level != 3 || cell.0 != 5, "the corridor burns");
    }
}

impl Game for Burning {
    fn name(&self) -> &'static str {
        "burning"
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
        if !self.is_mended {
            app.add_systems(FixedPostUpdate, burn.before(PlaybotSystems::Judge));
        }
    }
}

const BURNING: Burning = Burning { is_mended: false };

/// Returns so many steps to and fro, and then these.
fn after_wandering(times: usize, last: &[u32]) -> Vec<ActionValue> {
    let wander = [1, 0].repeat(times);
    wander.into_iter().chain(last.iter().copied()).map(ActionValue::Discrete).collect()
}

/// Returns a finding on level 3, which begins at cell 3.
fn stored(game: &dyn Game, detector: &str, message: &str, actions: &[ActionValue], checks: &Checks) -> StoredFinding {
    let head = FindingHead::new("plain:3", detector, message);
    StoredFinding::of_actions(game, "plain", 3, head, actions, checks).expect("it happens")
}

fn shortened(game: &dyn Game, finding: &StoredFinding, checks: &Checks) -> Minimised {
    minimise(game, finding, checks, Budget::default(), &|_| {}, &|| false).expect("it happens")
}

/// Checks that a finding replays, and that its shorter form has so many ticks: at most 30 %.
fn is_shortened_to(game: &dyn Game, finding: &StoredFinding, checks: &Checks, ticks: usize) {
    assert!(recheck(game, finding, checks).expect("playable").is_same(finding));
    let Minimised { finding: short, is_minimal, .. } = shortened(game, finding, checks);
    assert_eq!((short.episode.len(), short.head.original_ticks), (ticks, finding.head.original_ticks));
    assert!(is_minimal && 10 * ticks <= 3 * finding.episode.len(), "{ticks} of {}", finding.episode.len());
    assert!(recheck(game, &short, checks).expect("playable").is_same(&short));
    assert_eq!(shortened(game, finding, checks).finding, short, "it is always the same");
}

#[test]
fn a_panic_is_replayed_and_its_actions_made_shorter() {
    let checks = Checks::default();
    let actions = after_wandering(8, &[1, 1]);
    let finding = stored(&BURNING, "panic", "the corridor burns", &actions, &checks);
    // The tick that panics leaves no state: the hash is that of cell 4, before it.
    assert_eq!((finding.head.tick, finding.head.state_hash), (Some(17), Some(4)));
    is_shortened_to(&BURNING, &finding, &checks, 2);
    let mended = recheck(&Burning { is_mended: true }, &finding, &checks).expect("playable");
    assert_eq!(mended.status(&finding), FindingStatus::Gone);
    let head = FindingHead::new("plain:3", "panic", "the corridor freezes");
    assert_eq!(StoredFinding::of_actions(&BURNING, "plain", 3, head, &actions, &checks), None, "another panic");
}

#[test]
fn a_death_and_what_a_detector_of_ones_own_sees_are_made_shorter_too() {
    let checks = Checks::default();
    let finding = stored(&Corridor, "lost", "lost", &after_wandering(4, &[0, 0, 0]), &checks);
    assert_eq!(finding.head.tick, Some(10));
    is_shortened_to(&Corridor, &finding, &checks, 3);

    let watch = |_: &FindingHead| -> Watcher {
        Box::new(|moment: &CheckTick| (moment.world.get::<Cell>(moment.agent)?.0 == 5).then_some(moment.tick))
    };
    let checks = Checks::default().with("near-the-end", Check::Ticks(Arc::new(watch)));
    let finding = stored(&Corridor, "near-the-end", "cell 5", &after_wandering(5, &[1, 2, 1, 0, 0]), &checks);
    assert_eq!((finding.head.tick, finding.episode.len()), (Some(12), 13), "what follows is cut off");
    is_shortened_to(&Corridor, &finding, &checks, 2);
    let unknown = recheck(&Corridor, &finding, &Checks::default()).expect_err("unknown").to_string();
    assert!(unknown.contains("no check of the detector `near-the-end`"), "{unknown}");
}

fn tester(name: &str, action: u32) -> Tester {
    Tester {
        record: TesterRecord::bot(name),
        player: Player::Blind(BlindBot::Constant(ActionValue::Discrete(action))),
        observation_config: ObservationConfig::default(),
    }
}

/// Tests levels 0 to 9 on so many threads, and returns the verdicts in their order.
fn test(game: &dyn Game, testers: Vec<Tester>, folder: &Path, threads: usize) -> Vec<LevelVerdict> {
    test_levels(game, "plain:0..9", testers, folder, threads)
}

fn test_levels(
    game: &dyn Game,
    levels: &str,
    testers: Vec<Tester>,
    folder: &Path,
    threads: usize,
) -> Vec<LevelVerdict> {
    let split = levels.parse().expect("levels");
    let detectors = Detectors::default();
    let plan = TestPlan { split, testers, episodes: 2, seed: 2, detectors, shard: None, threads };
    let files = FindingFiles {
        folder: folder.to_owned(),
        minimise: Some(Budget::default()),
        keep_failures: true,
        checks: Checks::default(),
    };
    let mut found = Vec::new();
    let mut keep = |verdict: LevelVerdict| -> Result<(), TestError> {
        found.push(verdict);
        Ok(())
    };
    let watch = TestObserver { progress: &|_| {}, stop: &|| false };
    run_tests_keeping(game, &plan, &BTreeSet::new(), &mut keep, &watch, Some(&files)).expect("it can be played");
    found.sort_by_key(|verdict| verdict.index);
    found
}

/// Returns the names and bytes of the findings in a folder.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let found = list_findings(folder).expect("findings");
    found.into_iter().map(|(name, path)| (name, fs::read(path).expect("readable"))).collect()
}

#[test]
fn a_test_writes_its_findings_as_files_which_are_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    let verdicts = test(&BURNING, vec![tester("right", 1)], &one, 1);
    assert_eq!(verdicts, test(&BURNING, vec![tester("right", 1)], &two, 2));
    let file = verdicts[3].findings[0].file.as_deref().expect("a file");
    assert!(file.starts_with(&format!("{FINDINGS}/plain-3.panic.right-")), "{file}");
    assert!(one.join(file).is_file() && files(&one).len() == 1);
    assert_eq!(files(&one), files(&two));
    // An agent that goes left never wins, and a constant tester is deterministic.
    let left = folder.path().join("left");
    let verdicts = test(&Corridor, vec![tester("left", 0)], &left, 2);
    assert!(verdicts.iter().all(|verdict| verdict.findings.is_empty()), "a lost episode is no finding");
    let names: Vec<String> = files(&left).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names.len(), 10);
    assert!(names.iter().all(|name| name.contains(".lost.left-")), "{names:?}");
}

/// A game that is lost after six turns, whatever the agent does.
fn doomed() -> ForeignGame {
    let game = |app: &mut App| {
        app.insert_resource(Turn(0)).add_systems(Startup, |mut turn: ResMut<Turn>| turn.0 = 0);
        app.add_systems(Update, |mut turn: ResMut<Turn>| turn.0 += 1);
    };
    ForeignGame::new("doomed", 1, game)
        .keys([vec![], vec![KeyCode::KeyA]])
        .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
        .end(|turn: Res<Turn>| (turn.0 >= 6).then_some(EpisodeEnd::LOST))
        .restart(Restart::Startup)
}

#[derive(Resource)]
struct Turn(u32);

#[test]
fn a_failed_episode_is_kept_of_each_unsolved_level_even_if_all_testers_draw() {
    let random = |name: &str| Tester { player: Player::Blind(BlindBot::Uniform), ..tester(name, 0) };
    let names = |testers: Vec<Tester>| {
        let folder = tempfile::tempdir().expect("a folder");
        let verdicts = test_levels(&doomed(), "default:0..3", testers, folder.path(), 2);
        assert!(verdicts.iter().all(|verdict| verdict.score.lost > 0 && verdict.not_kept.is_none()), "{verdicts:?}");
        files(folder.path()).into_iter().map(|(name, _)| name).collect::<Vec<_>>()
    };
    let drawn = names(vec![random("dice")]);
    assert_eq!(drawn.len(), 4);
    assert!(drawn.iter().all(|name| name.contains(".lost.dice-")), "{drawn:?}");
    let both = names(vec![random("dice"), tester("idle", 0)]);
    assert_eq!(both.len(), 4);
    assert!(both.iter().all(|name| name.contains(".lost.idle-")), "it repeats itself: {both:?}");
}

#[test]
fn stored_findings_are_there_or_gone_or_pinned_for_a_while() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    test(&BURNING, vec![tester("right", 1)], folder, 1);
    let again = |game: &dyn Game, today: &str| -> Regression {
        let today: Date = today.parse().expect("a day");
        let all = [game];
        let games = Games::new(&all).expect("one game");
        let request = Regress { folder, games: &games, checks: &|_| Checks::default(), today, threads: 2 };
        regress(&request, &|_| {}).expect("findings")
    };
    let mended = Burning { is_mended: true };
    let there = again(&BURNING, "2027-01-01");
    let name = there.rows[0].finding.clone();
    assert_eq!((there.rows.len(), there.rows[0].status, there.has_alarms()), (1, FindingStatus::StillThere, true));
    let gone = again(&mended, "2027-01-01");
    assert_eq!((gone.rows[0].status, gone.has_alarms()), (FindingStatus::Gone, false));
    let foreign = again(&Corridor, "2027-01-01");
    assert_eq!((foreign.rows[0].status, foreign.has_alarms()), (FindingStatus::Unplayable, true));
    assert!(foreign.rows[0].message.contains("no game `burning`, only corridor"), "{}", foreign.rows[0].message);

    let pins = format!(
        "[(finding: \"{name}\", reason: \"it is cold\", until: \"2027-01-31\"), \
         (finding: \"other\", reason: \"why not\", until: \"2027-01-31\")]"
    );
    fs::write(folder.join(PINS), pins).expect("writable");
    let pinned = again(&BURNING, "2027-01-31");
    assert_eq!((pinned.rows[0].status, pinned.has_alarms()), (FindingStatus::StillThere, false));
    assert_eq!(pinned.unknown_pins, ["other"]);
    let expired = again(&BURNING, "2027-02-01");
    assert!(expired.has_alarms() && expired.rows[0].pin.as_ref().is_some_and(|pin| pin.expired));

    let path = &there.rows[0].path;
    let bytes = fs::read(path).expect("readable");
    fs::write(path, &bytes[..bytes.len() - 5]).expect("writable");
    let cut = again(&BURNING, "2027-02-01");
    assert_eq!((cut.rows[0].status, cut.rows[0].game.as_deref()), (FindingStatus::Unplayable, None));
    assert!(cut.rows[0].message.contains("is cut off"), "{}", cut.rows[0].message);
}

#[test]
fn a_stop_keeps_what_is_known_by_then() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    test(&Corridor, vec![tester("left", 0)], folder, 1);
    let all: [&dyn Game; 1] = [&Corridor];
    let games = Games::new(&all).expect("one game");
    let today: Date = "2027-01-01".parse().expect("a day");
    let request = Regress { folder, games: &games, checks: &|_| Checks::default(), today, threads: 1 };
    let played = AtomicU64::new(0);
    let count = |more: u64| {
        played.fetch_add(more, Ordering::Relaxed);
    };
    let stopped = regress_until(&request, &count, &|| played.load(Ordering::Relaxed) >= 3).expect("findings");
    assert_eq!((stopped.rows.len(), stopped.left), (3, 7));
    let whole = regress(&request, &|_| {}).expect("findings");
    assert_eq!((whole.left, &whole.rows[..3]), (0, &stopped.rows[..]));
}
