//! Tests of foreign games: played, recorded, measured and trained like any other.

use std::path::Path;

use bevy::prelude::*;
use bevy_playbot::{episode::Tick, vision::ObservationConfig};
use playbot::prelude::*;
use playbot_harness::{
    demo::verify_file,
    eval::{EvalPlan, Player, evaluate, summarize},
    foreign::ForeignGame,
    worlds::build_world,
};
use playbot_learner::DeviceKind;
use playbot_tests::{
    foreign::{
        catch::{Apple, catch_game},
        rooms::{PlayedFrames, Stage, rooms_game},
        traces,
    },
    measuring::plan,
    recording::record_demonstrator,
    training::{check_resuming, train},
};
use playbot_train::{
    Trainer,
    demo::Demonstrations,
    experiment::file::parse_experiment,
    run_dir::{OpenedRun, RunDir},
};

fn measure(game: &ForeignGame, player: Player, threads: usize) -> Vec<(u64, u32, f64)> {
    let plan = EvalPlan { threads, ..plan("default:0..7") };
    let results = evaluate(game, &player, &plan, |_| {}).expect("can be played");
    assert_eq!(results.len(), 8);
    let summary = summarize("player", &plan.split, &results);
    assert!(summary.return_mean.is_finite());
    results.iter().map(|result| (result.level, result.ticks, result.total_reward)).collect()
}

#[test]
fn a_bot_that_follows_catches_and_a_random_one_does_not() {
    let game = catch_game();
    let total = |results: &[(u64, u32, f64)]| results.iter().map(|result| result.2).sum::<f64>() / 8.0;
    let followed = measure(&game, Player::Demonstrator, 2);
    assert_eq!(followed, measure(&game, Player::Demonstrator, 1), "threads do not count");
    assert!(followed.iter().all(|(_, ticks, _)| *ticks == 600), "time is up after 600 ticks: {followed:?}");
    let random = measure(&game, Player::Blind(BlindBot::Uniform), 2);
    assert!(total(&followed) > 8.0 && total(&random) < 3.0, "{followed:?} {random:?}");
    assert!(random.iter().any(|(_, ticks, _)| *ticks < 600), "somebody has lost");
}

#[test]
fn scripted_bots_play_each_in_its_own_way_on_any_number_of_threads() {
    let game = catch_game().bot("left", || 1).bot(
        "dreamer",
        |apples: Query<&Transform, With<Apple>>, mut ticks: Local<u32>| {
            *ticks += 1;
            // It looks for a second, and sleeps for another one.
            let is_awake = (*ticks / 60).is_multiple_of(2);
            let apple = apples.iter().next().filter(|_| is_awake).map_or(4.0, |apple| apple.translation.x);
            if apple > 4.0 { 2 } else { u32::from(apple < 4.0) }
        },
    );
    let play = |name: &str| {
        let player = Player::bot(&game, name).expect("a bot of the game");
        let results = measure(&game, player.clone(), 2);
        assert_eq!(results, measure(&game, player, 1), "threads do not count");
        results
    };
    let [left, dreamer, follower] = ["left", "dreamer", "follower"].map(play);
    let still = Player::Blind(BlindBot::Constant(ActionValue::Discrete(1)));
    assert_eq!(left, measure(&game, still, 1), "it holds the key");
    assert!(left != dreamer && dreamer != follower, "{left:?} {dreamer:?}");
    assert_eq!(follower, measure(&catch_game(), Player::Demonstrator, 1), "as without other bots");
}

#[test]
fn recordings_replay_and_are_learned_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("catch.demo");
    // Three rounds, so that episodes also follow each other in one World, which a replay does in another order.
    record_demonstrator(&catch_game(), "default", 0.3, &path, (0..9).chain(0..3));
    let report = verify_file(&catch_game(), &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, &report.divergences), (12, &Vec::new()));
    let demos = Demonstrations::read(&catch_game(), &ObservationConfig::default(), &path, None).expect("readable");
    let steps = demos.steps();
    let dataset = demos.dataset(&catch_game(), 2, |_| {}).expect("replays");
    assert!(steps > 1000 && dataset.steps() as u64 == steps);
}

#[test]
fn states_and_loading_screens_pass_before_the_first_tick() {
    let game = rooms_game();
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([1, 2, 3])));
    let mut lengths = Vec::new();
    let mut count = 0;
    while Control::of(&world, agents[0]).is_active() {
        let ended = world.get::<EpisodeCount>(agents[0]).expect("an agent").finished;
        world.tick().expect("sound");
        count += 1;
        if world.get::<EpisodeCount>(agents[0]).expect("an agent").finished > ended {
            lengths.push(count);
            count = 0;
        }
    }
    // Three fixed steps of 50 ms to lose, in frames of 16.7 ms. The fixed clock begins with the frame in which the
    // level is entered, one before the first tick. So the steps fall into ticks 2, 5 and 8, whatever state the episode
    // before has left.
    assert_eq!(lengths, [8, 8, 8], "no ghosts, and no loading in an episode");
    assert_eq!(world.resource::<Tick>().0, 25, "loading frames are no ticks; the last one has no agent");
    assert_eq!(*world.resource::<State<Stage>>(), Stage::Over);
    let played = world.resource::<PlayedFrames>().0;
    assert_eq!(played, 27, "eight ticks, and the frame in which the level is entered");
}

#[test]
fn the_first_episode_and_a_later_one_of_a_level_are_the_same() {
    for game in [catch_game(), rooms_game()] {
        let traces = traces(&game, 1, &[5, 8, 5, 8]);
        assert_eq!(traces[0], traces[2], "{}: level 5", game.name());
        assert_eq!(traces[1], traces[3], "{}: level 8", game.name());
        let distinct: std::collections::BTreeSet<_> = traces[0].iter().collect();
        assert!(distinct.len() > traces[0].len() / 4, "{}: the hash sees the game", game.name());
    }
}

const EXPERIMENT: &str = r#"(
    game: "catch", train: "default:0..7", test: "default:8..15", demos: "unused",
    steps: 2048, arenas: 8, worlds: 2, algorithm: "ppo",
    ppo: (num_steps: 64, minibatches: 4, hidden: [16, 16], lr: 0.003),
)"#;

fn fresh(game: &ForeignGame, threads: usize) -> Trainer {
    let experiment = parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid");
    Trainer::new(game, &experiment, None, DeviceKind::Flex, threads).expect("fits")
}

#[test]
fn training_that_was_killed_in_the_middle_of_episodes_goes_on_bit_for_bit() {
    let game = catch_game();
    assert_eq!(fresh(&game, 2).worlds_mut().count(), 8, "one arena in each World");
    check_resuming(&game, |threads| fresh(&game, threads), 2);
}

#[test]
fn a_game_with_hidden_state_says_at_resume_what_it_may_be() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path().join("run");
    // The apple's position depends on the number of starts of the game in this World.
    fn hang(mut begun: Local<u32>, mut apple: Single<&mut Transform, With<Apple>>) {
        *begun += 1;
        apple.translation.x = (*begun % 9) as f32;
    }
    let forgetful = catch_game().level(hang);
    train(&folder, fresh(&forgetful, 1), Some(3));
    let OpenedRun { run, experiment, .. } = RunDir::open(&folder).expect("readable");
    let error = run.resume(&forgetful, &experiment, DeviceKind::Flex, 1).err().expect("the apple hangs elsewhere");
    let text = error.to_string();
    for part in [
        "did not replay",
        "resources that a restart does not reset",
        "`Local`",
        "`static`",
        "playbot doctor",
        "`#[reflect(ignore)]`",
        "`Restart::Rebuild`",
    ] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}
