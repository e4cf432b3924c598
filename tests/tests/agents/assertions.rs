//! Tests of assertions about levels, recordings and findings: those that hold, and the messages of the others.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

use bevy::prelude::*;
use bevy_playbot::demo::file::DemoWriter;
use playbot::prelude::*;
use playbot_harness::{
    detector::LevelProof,
    eval::Player,
    foreign::ForeignGame,
    game::{BotTools, LevelTools},
};
use playbot_test::findings::list_findings;
use playbot_tests::{Cell, Corridor, Drift, as_corridor, corridor_plugin, recording::record_random};

/// The corridor with bots that walk to the right and to the left, and perhaps with a fault.
enum Lane {
    Sound,
    /// It panics on level 3 when the agent stands at its last cell but one.
    Burning,
    /// Each World differs.
    Drifting,
    /// It has the corridor's name, and other states.
    Impostor,
}

fn burn(agents: Query<(&Episode, &Cell)>) {
    for (episode, cell) in &agents {
        assert!(!episode.is_running() || episode.level != 3 || cell.0 != 5, "the corridor burns");
    }
}

impl Game for Lane {
    fn name(&self) -> &'static str {
        if matches!(self, Self::Impostor) { "corridor" } else { "lane" }
    }

    fn version(&self) -> u32 {
        3
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
        static WORLDS: AtomicU64 = AtomicU64::new(1);
        corridor_plugin(app);
        match self {
            Self::Sound => {}
            Self::Burning => {
                app.add_systems(FixedPostUpdate, burn.before(PlaybotSystems::Judge));
            }
            Self::Drifting => {
                app.insert_resource(Drift(WORLDS.fetch_add(1, Ordering::Relaxed)));
            }
            Self::Impostor => {
                app.insert_resource(Drift(1));
            }
        }
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, bots: self, ..GameTools::default() }
    }
}

impl LevelTools for Lane {
    fn prove(&self, _mode: &str, level: u64) -> LevelProof {
        let why = "walled in".to_owned();
        if level == 4 { LevelProof::Unsolvable { why } } else { LevelProof::Unknown }
    }
}

impl BotTools for Lane {
    fn blind_bots(&self) -> Vec<(&'static str, BlindBot)> {
        let walks = |action| BlindBot::Constant(ActionValue::Discrete(action));
        vec![("right", walks(1)), ("left", walks(0))]
    }
}

/// Returns the message of a failing assertion.
fn message(assertion: impl FnOnce()) -> String {
    let panic = catch_unwind(AssertUnwindSafe(assertion)).expect_err("it must not hold");
    *panic.downcast::<String>().expect("words")
}

/// Returns the file in a folder of findings whose name begins so.
fn file(folder: &Path, begin: &str) -> PathBuf {
    let found = list_findings(folder).expect("findings");
    found.into_iter().find(|(name, _)| name.starts_with(begin)).unwrap_or_else(|| panic!("no {begin}")).1
}

#[test]
fn assertions_hold_for_what_is_sound() {
    playbot::test(&Lane::Sound).levels("plain:0..9").assert_levels_solvable();
    playbot::test(&Lane::Sound).levels("plain:0..9").bot("right").assert_levels_solved();
    playbot::test(&Lane::Sound).levels("plain:5..9").assert_no_findings();
    playbot::test(&Lane::Sound).levels("plain:0..3").assert_deterministic();
    let right = Player::Blind(BlindBot::Constant(ActionValue::Discrete(1)));
    playbot::test(&Corridor)
        .levels("plain:7")
        .player("mine", right)
        .episodes(2)
        .seed(5)
        .threads(1)
        .assert_levels_solved();
    let verdicts = playbot::test(&Lane::Sound).levels("plain:2..5").bot("left").verdicts().expect("levels");
    let levels: Vec<&str> = verdicts.iter().map(|level| level.level.as_str()).collect();
    assert_eq!(levels, ["plain:2", "plain:3", "plain:4", "plain:5"]);
    playbot::test(&Lane::Sound).levels("plain:2..5").bots(["left", "right"]).assert_levels_solvable();
}

#[test]
fn a_failure_says_where_the_episodes_stopped() {
    #[derive(Component)]
    struct Hero;

    let game = |app: &mut App| {
        app.add_systems(Startup, |mut commands: Commands| {
            commands.spawn((Hero, Transform::default()));
        })
        .add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, mut hero: Single<&mut Transform, With<Hero>>| {
                let step = f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
                hero.translation.x = (hero.translation.x + step).min(3.0);
            },
        );
    };
    let walled = ForeignGame::new("walled", 1, game)
        .keys([vec![], vec![KeyCode::ArrowRight]])
        .observe(["x"], |hero: Single<&Transform, With<Hero>>| [hero.translation.x])
        .position(|hero: Single<&Transform, With<Hero>>| hero.translation.truncate())
        .end(|hero: Single<&Transform, With<Hero>>| (hero.translation.x >= 6.0).then_some(EpisodeEnd::WON))
        .time_limit(20)
        .demonstrator("runner", || 1);
    let folder = tempfile::tempdir().expect("a folder");
    let test = playbot::test(&walled).levels("default:0..0").bot("runner").findings_in(folder.path());
    let found = message(|| test.assert_levels_solved());
    assert!(found.contains("\n  the only episode got no further from its start than (3.0, 0.0)\n"), "{found}");
}

#[test]
fn a_failure_names_each_level_with_its_proof_and_the_commands_that_show_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let test = |levels: &str| {
        let test = playbot::test(&Lane::Sound).levels(levels).bot("left").episodes(2).seed(3);
        test.without_detector("all").findings_in(folder.path()).program("jump")
    };
    let found = message(|| test("plain:4..5").assert_levels_solvable());
    let of = |begin: &str| file(folder.path(), begin).display().to_string();
    let again = |level: &str| {
        let place = level.replace(':', "-");
        format!(
            "  the level again:\n    \
             jump test lane --levels {level} --bot left --episodes 2 --seed 3 --no-detect all --out again-{place}\n    \
             jump view lane --levels {level} --bot left --episode --out again-{place}.png"
        )
    };
    let expected = [
        "2 of 2 levels were not solved by any tester (`lane`, plain:4..5, left, 2 episodes each, seed 3):".to_owned(),
        "plain:4: proved-unsolvable".to_owned(),
        "  left: solved 0 of 2, 2 lost".to_owned(),
        "  unreachable-goal: walled in".to_owned(),
        format!("    jump replay {}", of("plain-4.unreachable-goal-")),
        "  an episode that failed:".to_owned(),
        format!("    jump replay {}", of("plain-4.lost.left-")),
        again("plain:4"),
        "plain:5: bot-failed".to_owned(),
        "  left: solved 0 of 2, 2 lost".to_owned(),
        "  an episode that failed:".to_owned(),
        format!("    jump replay {}", of("plain-5.lost.left-")),
        again("plain:5"),
    ];
    assert_eq!(found, expected.join("\n"));
    playbot::test(&Lane::Sound).assert_replays(folder.path());
    // The first levels are reported in full, all others by name.
    let many = message(|| test("plain:10..21").assert_levels_solvable());
    assert!(many.starts_with("12 of 12 levels ") && many.ends_with("\nand plain:20, plain:21"), "{many}");
    let mixed = message(|| test("plain:5..6").bot("right").assert_levels_solved());
    assert!(mixed.contains("  left: solved 0 of 2, 2 lost\n  right: solved 2 of 2\n"), "{mixed}");
    assert!(
        message(|| playbot::test(&Lane::Sound).levels("plain:7").bot("left").assert_levels_solved())
            .contains("1 of 1 level was not")
    );
}

#[test]
fn a_finding_is_reported_until_it_is_mended() {
    let folder = tempfile::tempdir().expect("a folder");
    let test = playbot::test(&Lane::Burning).levels("plain:0..3").bot("right").findings_in(folder.path()).minimise();
    let found = message(|| test.assert_no_findings());
    let file = file(folder.path(), "plain-3.panic.right-");
    assert!(found.starts_with("something was found on 1 of 4 levels (`lane`, plain:0..3, right, "), "{found}");
    assert!(found.contains("\n  panic (right, episode 0, tick 1): the corridor burns"), "{found}");
    assert!(found.contains(&format!("\n    playbot replay {}\n", file.display())), "{found}");
    assert!(!found.contains("plain:2"), "{found}");
    assert!(
        found.ends_with("`playbot::test(&game).assert_replays(\"FILE\")` in a test plays such a file again"),
        "{found}"
    );

    playbot::test(&Lane::Burning).assert_replays(&file);
    playbot::test(&Lane::Sound).assert_findings_gone(folder.path());
    let mended = message(|| playbot::test(&Lane::Sound).assert_replays(&file));
    assert!(mended.contains(": it does not happen again (plain:3: panic: the corridor burns"), "{mended}");
    let there = message(|| playbot::test(&Lane::Burning).assert_findings_gone(folder.path()));
    assert!(there.contains("1 of 1 finding is not gone:") && there.contains("(still-there): plain:3"), "{there}");
    assert!(there.ends_with(&format!("playbot replay {}", file.display())), "{there}");
    let empty = tempfile::tempdir().expect("a folder");
    let own = message(|| playbot::test(&Lane::Burning).program("jump").assert_findings_gone(folder.path()));
    assert!(own.ends_with(&format!("\n    jump replay {}", file.display())), "{own}");
    let none = message(|| playbot::test(&Lane::Sound).assert_findings_gone(empty.path()));
    assert!(none.contains("has no findings"), "{none}");
}

#[test]
fn a_game_that_does_not_play_the_same_is_reported_with_the_tick() {
    let found = message(|| playbot::test(&Lane::Drifting).levels("plain:1..2").assert_deterministic());
    assert!(found.starts_with("2 of 2 levels did not play the same again (`lane`, plain:1..2, right + left + "));
    assert!(found.contains("\n  determinism (right, episode 0, tick 0): the episode differed"), "{found}");
    let options = "--detect determinism --no-detect all --detector determinism.every=1";
    assert!(found.contains(options), "{found}");
}

#[test]
fn what_cannot_be_tested_is_a_failure_in_words() {
    for (levels, words) in [
        ("plain:5..2", "cannot test plain:5..2 of `lane`: `plain:5..2`: first level 5 is after last level 2"),
        ("plain", "is not a range of levels"),
        ("plane:0..3", "did you mean `plain`?"),
        ("files:none/*.json", "files:none/*.json matches no file"),
    ] {
        let found = message(|| playbot::test(&Lane::Sound).levels(levels).assert_levels_solvable());
        assert!(found.contains(words), "{found}");
    }
    let none = message(|| playbot::test(&Lane::Sound).assert_no_findings());
    assert!(
        none.starts_with("cannot test `lane`: no levels are named: write `.levels(\"MODE:first..last\")`"),
        "{none}"
    );
    let test = || playbot::test(&Lane::Sound).levels("plain:0..1");
    for (test, words) in [
        (test().bot("right2"), "did you mean `right`?"),
        (test().bot("right").bot("right"), "two testers are called `right`"),
        (test().policy("none.policy"), "none.policy"),
        (test().detect("stuck2"), "did you mean `stuck`?"),
        (test().set_detector("stuck.ticks=-1"), "at least 1"),
    ] {
        let found = message(|| test.assert_levels_solvable());
        assert!(found.starts_with("cannot test plain:0..1 of `lane`: ") && found.contains(words), "{found}");
    }
}

#[test]
fn recordings_play_again_or_the_first_tick_that_differs_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    record_random(&Corridor, "plain", 3, &path, 0..4);
    playbot::test(&Corridor).assert_replays(&path);
    playbot::test(&Corridor).assert_replays(folder.path());
    let other = message(|| playbot::test(&Lane::Impostor).assert_replays(&path));
    assert!(
        other.contains("walk.demo: 4 of 4 episodes do not play the same game again:\n  episode 0: level 0, tick 0")
    );
    assert!(other.ends_with(&format!("\n    playbot demo verify {}", path.display())), "{other}");
    let foreign = message(|| playbot::test(&Lane::Sound).assert_replays(&path));
    assert!(foreign.contains("walk.demo: a recording of the game `corridor`, not of `lane`"), "{foreign}");

    let bytes = fs::read(&path).expect("written");
    fs::write(&path, &bytes[..bytes.len() - 3]).expect("writable");
    let cut = message(|| playbot::test(&Corridor).assert_replays(&path));
    assert!(cut.contains("walk.demo") && cut.contains("is cut off"), "{cut}");
    drop(DemoWriter::replace(&path, Corridor.demo_header("plain")).expect("writable"));
    let empty = message(|| playbot::test(&Corridor).assert_replays(folder.path()));
    assert!(empty.ends_with("walk.demo holds no episode: nothing was replayed"), "{empty}");
    fs::remove_file(&path).expect("it is there");
    let none = message(|| playbot::test(&Corridor).assert_replays(folder.path()));
    assert!(none.contains("has neither recordings nor findings"), "{none}");
    assert!(message(|| playbot::test(&Corridor).assert_replays(&path)).contains("walk.demo"));
}
