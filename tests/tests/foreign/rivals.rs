//! Tests of Pong for two players: seats that mirror one another, rivals, self-play, and the policy that it brings.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy_playbot::{
    demo::file::DemoWriter,
    policy_file::{PolicyFile, check_policy},
    vision::ObservationConfig,
};
use foreign_pong::{follow, game::Table, pong};
use playbot::prelude::*;
use playbot_harness::{
    demo::verify_file,
    doctor::{DoctorOptions, examine},
    eval::Player,
    randomise::Randomise,
    rivals::{
        Opposed, RivalError, check_rivals, find_seat,
        matches::{Match, MatchOutcome, MatchPlan, play_matches},
        scripted_rival,
    },
    worlds::build_world,
};
use playbot_learner::{DeviceKind, Policy, PpoConfig};
use playbot_tests::training::{check_resuming, run_info, train, untrained};
use playbot_train::{
    Trainer,
    checkpoint::{self, CheckpointChoice},
    experiment::file::{parse_experiment, read_experiment},
    policy_export::{Provenance, export_policy, policy_file},
    run_dir::RunDir,
    run_observer::Unobserved,
    self_play::ladder::Ladder,
    train_run::Training,
};

/// The folder of the game.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("foreign/pong")
}

/// Returns the policy that the game brings, trained by self-play as its README says.
fn shipped() -> PolicyFile {
    PolicyFile::load(&folder().join("pong.policy"), DeviceKind::Flex).expect("the file that the README makes")
}

fn drawn(policy: Policy) -> Player {
    Player::Policy { policy, prior: None, draw: ActionDraw::Sample }
}

fn fresh_policy(seed: u64) -> Policy {
    let config = PpoConfig { hidden: vec![16, 16], ..PpoConfig::default() };
    // Another number of layers makes another policy.
    let config = if seed == 0 { config } else { PpoConfig { hidden: vec![16], ..config } };
    untrained(&pong(), &ObservationConfig::default(), config)
}

fn follower() -> Player {
    scripted_rival(&pong(), "follower").expect("it has one")
}

fn matches(levels: std::ops::Range<u64>, threads: usize) -> MatchPlan {
    MatchPlan {
        mode: "default".to_owned(),
        levels: levels.collect(),
        seats: Vec::new(),
        seed: 3,
        threads,
        randomise: Randomise::default(),
    }
}

fn share(played: &[Match], is_counted: impl Fn(&Match) -> bool) -> f64 {
    let counted: Vec<&Match> = played.iter().filter(|it| is_counted(it)).collect();
    counted.iter().map(|it| it.outcome.points()).sum::<f64>() / counted.len() as f64
}

// The rules are the same from both sides.

#[test]
fn the_rules_are_their_own_mirror_image() {
    let mut ended = 0;
    for number in 0..20 {
        let (mut table, mut seen) = (Table::of(number), Table::of(number ^ 1));
        assert_eq!(seen, table.mirrored(), "the serve");
        // Any pushes: both follow the ball, with mistakes.
        for tick in 0..2000_u64 {
            let push = |table: &Table, side: u64| match (tick * 7 + side * 3 + number) % 5 {
                0 => 0,
                1 => -1,
                _ => [0, 1, -1][follow(table) as usize],
            };
            let [left, right] = [push(&table, 0), push(&table.mirrored(), 1)];
            table.step([left, right]);
            seen.step([right, left]);
            assert_eq!(seen, table.mirrored(), "match {number}, tick {tick}");
        }
        ended += usize::from(table.winner().is_some());
    }
    assert!(ended > 10, "{ended} of 20 matches come to their end, the others are rallies without one");
}

/// Plays a level with this policy on both sides, greedily, and returns the match after each tick.
fn played_by(policy: &Policy, level: u64) -> Vec<Table> {
    let player = Player::Policy { policy: policy.clone(), prior: None, draw: ActionDraw::Greedy };
    let game = Opposed::new(&pong(), 0).expect("a seat").against(player.clone(), player.clone());
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    player.install(&mut world);
    world.entity_mut(agents[0]).insert((Control::Policy, LevelQueue::list([level])));
    let mut tables = Vec::new();
    while Control::of(&world, agents[0]).is_active() && tables.len() < 400 {
        world.tick().expect("sound");
        tables.push(*world.resource::<Table>());
    }
    tables
}

#[test]
fn one_policy_on_both_sides_plays_the_mirrored_serve_as_in_a_mirror_to_the_bit() {
    let policy = shipped().policy;
    for level in [100_006, 100_008] {
        let (one, other) = (played_by(&policy, level), played_by(&policy, level + 1));
        assert!(one.len() > 30 && one.iter().any(|table| table.paddles != [0, 0]), "{} ticks", one.len());
        assert!(one.iter().map(|table| table.mirrored()).eq(other.iter().copied()), "level {level}");
    }
}

#[test]
fn the_game_is_sound_and_its_seats_are_known_by_name() {
    let game = pong();
    assert_eq!((game.problem(), check_rivals(&game, "default")), (None, Ok(())));
    assert_eq!(game.tools().host.seats(), ["left", "right"]);
    assert_eq!((find_seat(&game, "right"), game.tools().host.teams()), (Ok(1), vec![0, 1]));
    let error = find_seat(&game, "rihgt").expect_err("no such seat").to_string();
    assert_eq!(error, "unknown seat `rihgt` (did you mean `right`?); valid: left, right");
    let error = scripted_rival(&game, "folower").map(drop).expect_err("no such rival").to_string();
    assert!(error.starts_with("unknown rival `folower` (did you mean `follower`?)"), "{error}");
    assert!(matches!(Opposed::new(&game, 2), Err(RivalError::Alone { .. })), "there are two seats");
    let report = examine(&game, &DoctorOptions { ticks: 300, ..DoctorOptions::new("default") }, |_| {});
    let report = report.expect("a mode");
    assert!(report.is_healthy(), "{report}");
}

// Rivals in a World.

#[test]
fn an_episode_beside_a_policy_replays_to_the_same_hashes_beside_it_and_to_others_beside_another_one() {
    let folder = tempfile::tempdir().expect("a folder");
    for seat in [0, 1] {
        let path = folder.path().join(format!("{seat}.demo"));
        let beside =
            |policy: Policy| Opposed::new(&pong(), seat).expect("a seat").against(drawn(policy.clone()), drawn(policy));
        let game = beside(fresh_policy(0));
        let (mut world, agents) = build_world(&game, "default", 5, 0, 1);
        let writer = DemoWriter::create(&path, game.demo_header("default")).expect("a fresh file");
        world.insert_resource(Recorder::new(writer));
        let levels = LevelQueue::list([3, 8, 21]);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Chaos, Recording::default(), levels));
        while Control::of(&world, agents[0]).is_active() {
            world.tick().expect("sound");
        }
        world.remove_resource::<Recorder>();
        let same = verify_file(&game, &path, |_| {}).expect("readable");
        assert_eq!((same.episodes, same.divergences), (3, Vec::new()), "seat {seat}");
        // Untrained policies hardly differ from one another.
        let follower = scripted_rival(&pong(), "follower").expect("a bot of Pong");
        let other = Opposed::new(&pong(), seat).expect("a seat").against(follower.clone(), follower);
        let other = verify_file(&other, &path, |_| {}).expect("readable");
        assert!(!other.divergences.is_empty(), "another rival plays another game");
    }
}

#[test]
fn matches_have_the_same_results_on_any_number_of_threads_and_both_sides_share_the_points() {
    let (one, other) = (drawn(fresh_policy(0)), drawn(fresh_policy(1)));
    let play = |player: &Player, rival: &Player, threads| {
        play_matches(&pong(), player, rival, &matches(0..4, threads), |_| {}).expect("playable")
    };
    let alone = play(&one, &other, 1);
    assert_eq!(alone.len(), 8, "four levels on two seats");
    assert_eq!(alone, play(&one, &other, 3));
    // A match between two bots is the same whichever of them counts as the player.
    let (a, b) = (follower(), Player::Blind(BlindBot::Constant(ActionValue::Discrete(1))));
    let (forth, back) = (play(&a, &b, 1), play(&b, &a, 1));
    for level in 0..4 {
        for seat in 0..2 {
            let find = |played: &[Match], seat| {
                let found = played.iter().find(|it| it.episode.level == level && it.seat == seat).expect("played");
                (found.outcome.points(), found.episode.ticks)
            };
            let ((points, ticks), (others, others_ticks)) = (find(&forth, seat), find(&back, 1 - seat));
            assert_eq!((points + others, ticks), (1.0, others_ticks), "level {level}, seat {seat}");
        }
    }
    assert_eq!(share(&forth, |_| true), 1.0, "who follows beats who goes up");
}

// Self-play.

fn experiment() -> playbot_train::Experiment {
    let text = r#"(
        game: "pong", train: "default:0..999", test: "default:1000..1003", algorithm: "ppo", seed: 4,
        steps: 1536, arenas: 4, worlds: 4,
        ppo: (num_steps: 64, minibatches: 2, epochs: 1, hidden: [8], lr: 0.001),
        self_play: (every: Some(512), pool: 2, latest: 0.4, rivals: ["follower"], rated: ["chaos"], matches: 1),
    )"#;
    parse_experiment(text, Path::new("test.ron")).expect("valid")
}

fn trainer(threads: usize) -> Trainer {
    Trainer::new(&pong(), &experiment(), None, DeviceKind::Flex, threads).expect("it fits")
}

#[test]
fn self_play_that_was_stopped_goes_on_bit_for_bit_on_any_number_of_threads() {
    for stop_after in [1, 4] {
        check_resuming(&pong(), trainer, stop_after);
    }
}

#[test]
fn self_play_with_memory_or_by_sac_goes_on_bit_for_bit() {
    check_resuming(&pong(), with_memory, 3);
    let sac = |threads| {
        let text = experiment().to_ron().expect("text").replace("\"ppo\"", "\"sac\"");
        let experiment = parse_experiment(&text, Path::new("sac.ron")).expect("valid");
        let sets = ["sac.num_steps=64", "sac.hidden=[8]", "sac.learning_starts=256", "sac.batch=32", "sac.buffer=2000"];
        let experiment = experiment.with_set(&sets).expect("valid");
        Trainer::new(&pong(), &experiment, None, DeviceKind::Flex, threads).expect("it fits")
    };
    check_resuming(&pong(), sac, 3);
}

fn with_memory(threads: usize) -> Trainer {
    let experiment = experiment().with_set(&["ppo.memory=Gru(hidden: 8)"]).expect("valid");
    Trainer::new(&pong(), &experiment, None, DeviceKind::Flex, threads).expect("it fits")
}

#[test]
fn snapshots_join_the_ladder_and_the_checkpoint_keeps_those_that_play() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run");
    let trained = train(&path, trainer(1), None);
    let ladder = Ladder::read(&path).expect("readable").expect("it has one");
    assert_eq!(Some(&ladder), trained.ladder().as_ref());
    let names: Vec<&str> = ladder.members.iter().map(|member| member.name.as_str()).collect();
    assert_eq!(names, ["follower", "chaos", "step 0", "step 512", "step 1,024", "step 1,536"]);
    let drawn: Vec<bool> = ladder.members.iter().map(|member| member.is_drawn).collect();
    assert_eq!(drawn, [true, false, false, false, true, true], "`chaos` is rated only, and two snapshots stay");
    // Each new snapshot meets both bots, and up to two before it, on two seats of one level.
    let met: Vec<u64> = ladder.members.iter().map(|member| member.matches).collect();
    assert_eq!(met, [6, 6, 4, 10, 10, 8]);
    assert_eq!(ladder.members[0].rating.map(|rating| (rating.elo, rating.error)), Some((1000.0, 0.0)));
    let last = RunDir::open(&path).expect("a run").run.checkpoint(CheckpointChoice::Last).expect("saved").path;
    assert!(last.join("snapshot-0003.policy").exists() && last.join("snapshot-0002.policy").exists());
    let metrics = std::fs::read_to_string(path.join("metrics.jsonl")).expect("written");
    let last = metrics.lines().last().expect("updates");
    for tag in ["self_play/elo\"", "self_play/win_rate\"", "self_play/snapshots\":4.0"] {
        assert!(last.contains(tag), "{tag}: {last}");
    }
}

#[test]
fn each_snapshot_is_a_checkpoint_and_the_best_has_the_highest_rating() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run");
    let experiment = experiment().with_set(&["checkpoints.every=1000", "checkpoints.keep=9"]).expect("valid");
    let run = RunDir::create(&path, &experiment, &run_info(&experiment), false).expect("fresh");
    let trainer = Trainer::new(&pong(), &experiment, None, DeviceKind::Flex, 1).expect("it fits");
    let mut training = Training { run, trainer, started: None };
    assert!(training.drive(&mut Unobserved).expect("it learns"));
    let saved = checkpoint::list(&path).expect("readable");
    let rated: Vec<(u64, f64)> = saved.iter().filter_map(|it| Some((it.summary.step, it.summary.elo?))).collect();
    let steps: Vec<u64> = rated.iter().map(|(step, _)| *step).collect();
    assert_eq!(steps, [512, 1024, 1536]);
    let ladder = training.trainer.ladder().expect("it has one");
    let newest = ladder.members.last().and_then(|member| member.rating).expect("rated");
    assert_eq!(rated[2].1, newest.elo);
    let best = training.run.checkpoint(CheckpointChoice::Best).expect("saved").summary;
    let highest = rated.iter().map(|(_, elo)| *elo).fold(f64::NEG_INFINITY, f64::max);
    assert_eq!(best.elo, Some(highest));
}

#[test]
fn each_seat_learns_in_as_many_arenas_and_rivals_are_no_rows_of_the_rollout() {
    let mut trainer = trainer(1);
    let seats: Vec<Vec<usize>> = trainer
        .worlds_mut()
        .map(|world| {
            let host = pong();
            let mut agents = world.query_filtered::<Entity, (With<Agent>, Without<bevy_playbot::engine::PlaysAlong>)>();
            let agents: Vec<Entity> = agents.iter(world).collect();
            agents.into_iter().map(|agent| host.tools().host.seat_of(world, agent)).collect()
        })
        .collect();
    assert_eq!(seats, [[0], [1], [0], [1]]);
    let report = trainer.update().expect("it learns");
    assert_eq!(report.step, 4 * 64, "one row for each arena and tick");
}

#[test]
fn a_checkpoint_without_a_policy_of_a_rival_is_passed_over_with_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run");
    train(&path, trainer(1), Some(4));
    let opened = RunDir::open(&path).expect("a run");
    let last = opened.run.checkpoint(CheckpointChoice::Last).expect("saved").path;
    std::fs::remove_file(last.join("snapshot-0001.policy")).expect("it was there");
    let error = opened.run.resume(&pong(), &opened.experiment, DeviceKind::Flex, 1).map(drop);
    let error = error.expect_err("a rival is missing").to_string();
    assert!(error.contains("snapshot-0001.policy"), "{error}");
}

// The policy that the game brings.

#[test]
fn the_policy_that_was_trained_by_self_play_beats_the_follower_from_both_sides_on_unseen_levels() {
    let file = shipped();
    check_policy(&pong().metadata(), &file).expect("it is of this game");
    let trained = read_experiment(&folder().join("experiment.ron")).expect("readable");
    assert!(trained.self_play.rivals.is_empty(), "it never learned from the follower");
    let plan = matches(300_000..300_040, 2);
    let played = play_matches(&pong(), &drawn(file.policy), &follower(), &plan, |_| {}).expect("playable");
    let [left, right] = [0, 1].map(|seat| share(&played, |it| it.seat == seat));
    // The README has the measurement: 98 % of 256 matches. Here 40 on each side bound it from below.
    assert!(share(&played, |_| true) >= 0.9 && left.min(right) >= 0.85, "left {left}, right {right}");
    // Four standard errors of the difference of two shares of 90 %.
    assert!((left - right).abs() < 4.0 * (2.0 * 0.9 * 0.1 / 40.0_f64).sqrt(), "left {left}, right {right}");
    let losses = played.iter().filter(|it| it.outcome == MatchOutcome::Loss).count();
    assert!(losses <= 8, "{losses} of 80 matches are lost");
}

#[test]
fn a_policy_of_a_game_of_two_agents_is_exported_from_one_seat() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("small.policy");
    let config = ObservationConfig::default();
    let file = policy_file(&pong(), &config, fresh_policy(0), None, Provenance::default());
    let levels = "default:0..9".parse().expect("levels");
    export_policy(&pong(), &file, &levels, 1, &path).expect("its examples are played beside the demonstrator");
    PolicyFile::load(&path, DeviceKind::Flex).expect("it reads back");
}
