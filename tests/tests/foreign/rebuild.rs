//! Tests of `Restart::Rebuild`: episodes of a game that cannot be reset otherwise, each in a World of its own.

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use bevy_playbot::{
    demo::{
        file::{DemoEpisode, DemoReader},
        replay::Divergence,
    },
    engine::Renewal,
};
use playbot::prelude::*;
use playbot_harness::{
    demo::{EpisodeReplayer, verify_file},
    eval::{EpisodeResult, EvalPlan, Player, evaluate},
    foreign::{ForeignGame, Restart},
    worlds::build_world,
};
use playbot_learner::DeviceKind;
use playbot_tests::{
    foreign::{
        stubborn::{Gusts, Planted, stubborn_game},
        traces,
    },
    measuring::plan,
    recording::record_demonstrator,
    training::check_resuming,
};
use playbot_train::{Trainer, experiment::file::parse_experiment};

#[test]
fn an_episode_is_the_same_whenever_it_is_played() {
    let rebuilt = traces(&stubborn_game(Restart::Rebuild), 0, &[1, 2, 1, 2]);
    assert_eq!(rebuilt[0], rebuilt[2]);
    assert_eq!(rebuilt[1], rebuilt[3]);
    assert_ne!(rebuilt[0], rebuilt[1], "the hash sees the level");
    let restarted = traces(&stubborn_game(Restart::Startup), 0, &[1, 2, 1, 2]);
    assert_eq!(restarted[0].len(), 20, "no agent pushes the ball: only the clock ends the episode");
    assert_ne!(restarted[0], restarted[2], "the gusts outlive `Restart::Startup`");
}

#[test]
fn each_episode_has_a_world_of_its_own_with_the_same_agent() {
    #[derive(Resource, Default)]
    struct Ends(u32);
    let (mut world, agents) = build_world(&stubborn_game(Restart::Rebuild), "default", 0, 0, 1);
    Renewal::set_up(&mut world, |world| {
        world.init_resource::<Ends>();
        world.add_observer(|_: On<EpisodeEnded>, mut ends: ResMut<Ends>| ends.0 += 1);
    });
    Renewal::carry_resource::<Ends>(&mut world);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([3, 5, 8])));
    let mut seen = vec![world.id()];
    let mut ticks = 0;
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
        ticks += 1;
        if seen.last() != Some(&world.id()) {
            seen.push(world.id());
        }
        let episode = world.get::<Episode>(agents[0]).expect("the same agent");
        assert_eq!(*world.resource::<Planted>(), Planted(episode.level), "`Startup` knows the level");
        // A frame that starts the clock, one that begins the level, and at most 20 ticks, or 21 for the last World.
        assert!(world.resource::<Gusts>().0 <= 4, "the gusts begin anew");
    }
    assert_eq!((ticks, seen.len()), (61, 3), "20 ticks in each World; the last tick has no agent");
    assert_eq!(world.resource::<Ends>().0, 3);
    assert_eq!(world.resource::<bevy_playbot::episode::Tick>().0, 61);
    assert_eq!(world.get::<EpisodeCount>(agents[0]).expect("an agent").finished, 3);
}

/// As in a window, which keeps its World.
#[test]
fn a_world_that_cannot_be_built_anew_says_what_to_do() {
    let (mut world, agents) = build_world(&stubborn_game(Restart::Rebuild), "default", 0, 0, 1);
    world.remove_resource::<Renewal>();
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::Always(3)));
    let fault = world.tick().expect_err("there is no other World").to_string();
    for words in ["`Restart::Rebuild`", "without a window", "`Restart::Startup`"] {
        assert!(fault.contains(words), "`{words}` is missing in: {fault}");
    }
}

/// Replays a recording, the last episode first.
pub(crate) fn replayed_backwards(game: &ForeignGame, path: &Path) -> Vec<Option<Divergence>> {
    let reader = DemoReader::open_for_game(path, game.name(), game.version(), None).expect("readable");
    let mut episodes: Vec<DemoEpisode> = reader.map(|episode| episode.expect("whole")).collect();
    episodes.reverse();
    let mut replayer = EpisodeReplayer::new(game, "default");
    let play = |episode| replayer.play(Arc::new(episode), |_, _| {}).expect("sound");
    episodes.into_iter().map(play).collect()
}

#[test]
fn recordings_replay_in_any_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("rebuilt.demo");
    let game = stubborn_game(Restart::Rebuild);
    record_demonstrator(&game, "default", 0.4, &path, [0, 1, 2, 3, 0, 1]);
    let report = verify_file(&game, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, &report.divergences), (6, &Vec::new()));
    assert_eq!(replayed_backwards(&game, &path), vec![None; 6]);
    let path = folder.path().join("restarted.demo");
    let game = stubborn_game(Restart::Startup);
    record_demonstrator(&game, "default", 0.4, &path, [0, 1, 2, 3, 0, 1]);
    let divergences = replayed_backwards(&game, &path);
    assert!(divergences.iter().any(Option::is_some), "the order counts with `Restart::Startup`");
}

#[test]
fn what_is_measured_does_not_depend_on_what_was_played_before() {
    // This bot turns round every seven ticks, wherever an episode of twenty ticks ends.
    let game = stubborn_game(Restart::Rebuild).bot("pacer", |mut ticks: Local<u32>| {
        *ticks += 1;
        1 + *ticks / 7 % 2
    });
    for name in ["sometimes", "pacer"] {
        let player = Player::bot(&game, name).expect("a bot of the game");
        let measure = |arenas, threads| -> Vec<EpisodeResult> {
            let plan = EvalPlan { episodes_per_level: 2, arenas, worlds: 1, threads, ..plan("default:0..5") };
            evaluate(&game, &player, &plan, |_| {}).expect("can be played")
        };
        let alone = measure(1, 1);
        assert_eq!(alone.len(), 12);
        assert!(alone.chunks(2).all(|pair| pair[0] == pair[1]), "both episodes of a level are the same: {alone:?}");
        assert_eq!(alone, measure(4, 2), "{name}");
    }
}

const EXPERIMENT: &str = r#"(
    game: "stubborn", train: "default:0..7", test: "default:8..15", demos: "unused",
    steps: 512, arenas: 4, worlds: 2, algorithm: "ppo",
    ppo: (num_steps: 32, minibatches: 2, hidden: [8], lr: 0.003),
)"#;

fn fresh(game: &ForeignGame, threads: usize) -> Trainer {
    let experiment = parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid");
    Trainer::new(game, &experiment, None, DeviceKind::Flex, threads).expect("fits")
}

#[test]
fn a_training_that_was_stopped_in_the_middle_of_episodes_goes_on_bit_for_bit() {
    let game = stubborn_game(Restart::Rebuild);
    // Two updates are 64 ticks in each arena: at least two Worlds have been replaced in each by then.
    check_resuming(&game, |threads| fresh(&game, threads), 2);
}

#[test]
fn a_world_that_cannot_be_built_anew_names_the_other_restarts() {
    let (mut world, agents) = build_world(&stubborn_game(Restart::Rebuild), "default", 0, 0, 1);
    // A resource that a window's World lacks.
    world.remove_resource::<Renewal>();
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(3)));
    let text = world.tick().expect_err("a fault").to_string();
    for part in ["level 3", "`stubborn`", "`Restart::Rebuild`", "a window", "`Restart::Startup`", "`Restart::state`"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}
