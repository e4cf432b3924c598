//! Tests of two agents in one World of a foreign game: two paddles that play against each other.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::{
    demo::verify_file,
    doctor::{DoctorOptions, examine},
    eval::{EvalPlan, Player, evaluate},
    foreign::{ForeignGame, PlayedAgent, Restart},
    saved_episode::SavedEpisode,
    worlds::{EndedEpisodes, build_world},
};
use playbot_learner::DeviceKind;
use playbot_tests::{
    foreign::pong::{Ball, Loser, Paddle, pong_game},
    measuring::plan,
    recording::record_random,
    training::check_resuming,
};
use playbot_train::{Trainer, demo::Demonstrations, experiment::file::parse_experiment};

/// The episodes that have ended, in order.
#[derive(Resource, Default)]
struct Ended(Vec<EpisodeEnded>);

/// Builds a World with a left agent that goes up, and a right one that goes down, with the levels of each.
fn world_of(game: &ForeignGame, levels: [&[u64]; 2]) -> (World, Vec<Entity>) {
    let (mut world, agents) = build_world(game, "default", 0, 0, 2);
    for ((&agent, action), levels) in agents.iter().zip([1, 2]).zip(levels) {
        let bot = BlindBot::Constant(ActionValue::Discrete(action));
        world.entity_mut(agent).insert((Control::Bot, bot, LevelQueue::list(levels)));
    }
    world.init_resource::<Ended>();
    world.add_observer(|event: On<EpisodeEnded>, mut ended: ResMut<Ended>| ended.0.push(*event));
    (world, agents)
}

/// Plays all levels, and returns level, end, ticks and return of each episode, with the place of its agent.
fn results(game: &ForeignGame, levels: [&[u64]; 2]) -> Vec<(usize, u64, EpisodeEnd, u32, f64)> {
    let (mut world, agents) = world_of(game, levels);
    while agents.iter().any(|&agent| Control::of(&world, agent).is_active()) {
        world.tick().expect("sound");
    }
    let place = |agent: Entity| agents.iter().position(|other| *other == agent).expect("one of them");
    let ended = &world.resource::<Ended>().0;
    ended.iter().map(|it| (place(it.entity), it.level, it.end, it.ticks, it.total_reward)).collect()
}

/// Returns the heights of the left and the right paddle.
fn heights(world: &mut World) -> [f32; 2] {
    let mut paddles = world.query::<(&Paddle, &Transform)>();
    let mut heights = [0.0; 2];
    for (paddle, at) in paddles.iter(world) {
        heights[paddle.side] = at.translation.y;
    }
    heights
}

#[test]
fn both_agents_act_in_the_same_tick_and_see_their_own_side() {
    let (mut world, agents) = world_of(&pong_game(), [&[0], &[0]]);
    world.tick().expect("sound");
    assert_eq!(heights(&mut world), [0.5, -0.5]);
    world.tick().expect("sound");
    assert_eq!(heights(&mut world), [1.0, -1.0]);
    // Before the second tick, two frames of 0.5 to the left after the serve.
    let seen = |agent: Entity| world.get::<Observation>(agent).expect("an agent").vector.clone();
    assert_eq!(seen(agents[0]), [0.5, -0.5, 7.0, 0.0, 0.0]);
    assert_eq!(seen(agents[1]), [-0.5, 0.5, 9.0, 0.0, 0.0]);
}

#[test]
fn an_episode_ends_for_both_agents_with_a_result_for_each() {
    // The ball is at a paddle after 16 frames, one of which passes before the first tick.
    let expected = [
        (0, 0, EpisodeEnd::LOST, 15, -1.0),
        (1, 0, EpisodeEnd::WON, 15, 1.0),
        (0, 1, EpisodeEnd::WON, 15, 1.0),
        (1, 1, EpisodeEnd::LOST, 15, -1.0),
    ];
    assert_eq!(results(&pong_game(), [&[0, 1], &[0, 1]]), expected);
}

#[test]
fn both_agents_play_the_level_of_the_first_one() {
    let levels: Vec<u64> = results(&pong_game(), [&[4], &[9]]).iter().map(|result| result.1).collect();
    assert_eq!(levels, [4, 4]);
}

#[test]
fn an_agent_without_an_end_of_its_own_is_truncated_with_the_others() {
    let game = pong_game().end(|loser: Res<Loser>, agent: Res<PlayedAgent>| {
        (agent.0 == 0 && loser.0.is_some()).then_some(EpisodeEnd::LOST)
    });
    let ends: Vec<_> = results(&game, [&[0], &[0]]).iter().map(|result| (result.0, result.2, result.3)).collect();
    assert_eq!(ends, [(0, EpisodeEnd::LOST, 15), (1, EpisodeEnd::Truncated, 15)]);
}

#[test]
fn a_rebuilt_world_has_both_agents() {
    let game = pong_game().restart(Restart::Rebuild);
    let (mut world, agents) = world_of(&game, [&[0, 1], &[0, 1]]);
    while agents.iter().any(|&agent| Control::of(&world, agent).is_active()) {
        world.tick().expect("sound");
    }
    for agent in agents {
        let count = world.get::<EpisodeCount>(agent).expect("an agent");
        assert_eq!((count.finished, count.successes), (2, 1));
    }
}

/// Plays these levels with one agent, the left one, which goes up. Returns the heights after each tick of each level.
fn along(game: &ForeignGame, seed: u64, levels: &[u64]) -> Vec<Vec<[f32; 2]>> {
    let (mut world, agents) = build_world(game, "default", seed, 7, 1);
    EndedEpisodes::note_in(&mut world);
    let up = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, up, LevelQueue::list(levels)));
    let mut all = vec![Vec::new(); levels.len()];
    loop {
        let level = world.get::<EpisodeCount>(agents[0]).expect("an agent").finished as usize;
        world.tick().expect("sound");
        if !Control::of(&world, agents[0]).is_active() {
            break;
        }
        all[level].push(heights(&mut world));
    }
    assert_eq!(EndedEpisodes::take(&mut world).len(), levels.len(), "the results of the other agent do not count");
    all
}

#[test]
fn where_one_agent_plays_the_other_plays_along_in_a_way_that_depends_on_the_level_alone() {
    for restart in [Restart::Startup, Restart::Rebuild] {
        let game = pong_game().restart(restart);
        let levels: Vec<u64> = (0..16).collect();
        let played = along(&game, 0, &levels);
        assert!(played.iter().all(|level| level[..3].iter().map(|[left, _]| *left).eq([0.5, 1.0, 1.5])));
        let others = |level: &Vec<[f32; 2]>| level[..8].iter().map(|[_, right]| *right).collect::<Vec<f32>>();
        assert!(played.iter().any(|level| others(level) != others(&played[0])), "chaos");
        for level in [3, 10] {
            assert_eq!(
                along(&game, 9, &[level])[0],
                played[level as usize],
                "in another World, without the levels before"
            );
        }
    }
}

#[test]
fn a_recording_of_one_agent_replays_with_the_other_one_and_is_learned_from() {
    for restart in [Restart::Startup, Restart::Rebuild] {
        let game = pong_game().restart(restart);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pong.demo");
        record_random(&game, "default", 5, &path, 0..8);
        let report = verify_file(&game, &path, |_| {}).expect("readable");
        assert_eq!((report.episodes, report.divergences), (8, Vec::new()));
        let demos = Demonstrations::read(&game, &ObservationConfig::default(), folder.path(), None).expect("readable");
        let dataset = demos.dataset(&game, 2, |_| {}).expect("it replays beside the other one");
        assert_eq!(dataset.steps() as u64, report.ticks);
    }
}

#[test]
fn the_other_agent_is_played_where_it_is_called_the_first_one() {
    let game = pong_game().first_agent("right");
    assert_eq!(game.problem(), None);
    let played = along(&game, 0, &[0, 1]);
    for level in &played {
        assert!(level[..3].iter().map(|[_, right]| *right).eq([0.5, 1.0, 1.5]), "{level:?}");
    }
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    EndedEpisodes::note_in(&mut world);
    let still = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, still, LevelQueue::list([1])));
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
    }
    let ended: Vec<_> = EndedEpisodes::take(&mut world).iter().map(|(_, it)| (it.end, it.ticks)).collect();
    assert_eq!(ended, [(EpisodeEnd::LOST, 15)], "the ball comes to the right first, two above the middle");
    let text = pong_game().first_agent("rihgt").problem().expect("no such agent");
    assert!(text.contains("`.first_agent` for an agent `rihgt` (did you mean `right`?)"), "{text}");
}

#[test]
fn a_panic_that_the_other_agent_brings_about_is_found_and_happens_again() {
    let game = pong_game().end(|loser: Res<Loser>, agent: Res<PlayedAgent>, paddles: Query<(&Paddle, &Transform)>| {
        let is_high = |(paddle, at): (&Paddle, &Transform)| paddle.side == 1 && at.translation.y >= 2.0;
        assert!(!paddles.iter().any(is_high), "the right paddle is too high");
        loser.0.map(|side| if side == agent.0 { EpisodeEnd::LOST } else { EpisodeEnd::WON })
    });
    let folder = tempfile::tempdir().expect("a folder");
    let test = playbot::test(&game).levels("default:0..31").bot("chaos").findings_in(folder.path());
    let found = catch_unwind(AssertUnwindSafe(|| test.assert_no_findings()));
    let words = found.expect_err("it goes up on some level").downcast::<String>().expect("a message");
    assert!(
        words.contains("panic (chaos, episode 0, tick ") && words.contains("the right paddle is too high"),
        "{words}"
    );
    playbot::test(&game).assert_replays(folder.path());
}

/// Follows the ball.
fn keep(agent: Res<PlayedAgent>, paddles: Query<(&Paddle, &Transform)>, ball: Single<&Transform, With<Ball>>) -> u32 {
    let own = paddles.iter().find(|(paddle, _)| paddle.side == agent.0);
    let height = own.map_or(0.0, |(_, at)| at.translation.y);
    match ball.translation.y.total_cmp(&height) {
        std::cmp::Ordering::Greater => 1,
        std::cmp::Ordering::Less => 2,
        std::cmp::Ordering::Equal => 0,
    }
}

#[test]
fn a_demonstrator_plays_along_where_there_is_one() {
    let (mut world, agents) = build_world(&pong_game().demonstrator("keeper", keep), "default", 0, 0, 1);
    EndedEpisodes::note_in(&mut world);
    let still = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, still, LevelQueue::list([1])));
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
    }
    let ends: Vec<_> = EndedEpisodes::take(&mut world).iter().map(|(_, result)| result.end).collect();
    assert_eq!(ends, [EpisodeEnd::LOST], "the ball came back, two above the middle");
}

/// The heights of both paddles, the ball's velocity and position, and the side that lost.
type State = ([f32; 2], Vec2, Vec3, Option<usize>);

fn save(paddles: Query<(&Paddle, &Transform)>, ball: Single<(&Ball, &Transform)>, loser: Res<Loser>) -> State {
    let mut heights = [0.0; 2];
    paddles.iter().for_each(|(paddle, at)| heights[paddle.side] = at.translation.y);
    (heights, ball.0.0, ball.1.translation, loser.0)
}

fn load(world: &mut World, (heights, velocity, place, loser): &State) {
    let mut paddles = world.query::<(&Paddle, &mut Transform)>();
    for (paddle, mut at) in paddles.iter_mut(world) {
        at.translation.y = heights[paddle.side];
    }
    let mut balls = world.query::<(&mut Ball, &mut Transform)>();
    for (mut ball, mut at) in balls.iter_mut(world) {
        (ball.0, at.translation) = (*velocity, *place);
    }
    world.resource_mut::<Loser>().0 = *loser;
}

#[test]
fn a_snapshot_of_one_agent_brings_the_other_one_back_as_well() {
    let game = pong_game().snapshot(save, load);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    let up = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, up, LevelQueue::list((0..12).collect::<Vec<u64>>())));
    for level in 0..12 {
        while world.get::<Episode>(agents[0]).is_none_or(|episode| (episode.level, episode.tick) != (level, 4)) {
            world.tick().expect("sound");
        }
        let saved = SavedEpisode::of(&game, &world, agents[0]).expect("keys alone are pressed");
        let mut go_on = || (0..8).map(|_| world.tick().map(|()| heights(&mut world))).collect::<Result<Vec<_>, _>>();
        let before = go_on().expect("sound");
        assert!(saved.restore(&game, &mut world, agents[0]));
        let mut go_on = || (0..8).map(|_| world.tick().map(|()| heights(&mut world))).collect::<Result<Vec<_>, _>>();
        assert_eq!(go_on().expect("sound"), before, "level {level}");
    }
}

#[test]
fn the_doctor_plays_all_agents_and_names_the_one_that_sees_no_number() {
    let options = DoctorOptions { ticks: 60, ..DoctorOptions::new("default") };
    let report = examine(&pong_game(), &options, |_| {}).expect("a mode");
    assert!(report.is_healthy(), "{report}");
    assert_eq!((report.observation.ticks, report.other_observations.len()), (60, 1));
    assert_eq!(report.other_observations[0].ticks, 60);
    let lost = pong_game().observe(["height"], |agent: Res<PlayedAgent>, paddles: Query<(&Paddle, &Transform)>| {
        let own = paddles.iter().find(|(paddle, _)| paddle.side == agent.0);
        [if agent.0 == 1 { f32::NAN } else { own.map_or(0.0, |(_, at)| at.translation.y) }]
    });
    let report = examine(&lost, &options, |_| {}).expect("a mode");
    let said: Vec<&str> = report.findings.iter().map(|finding| finding.what.as_str()).collect();
    assert!(said.iter().any(|what| what.starts_with("agent 1: observation `height` is NaN at tick 0")), "{said:?}");
}

#[test]
fn a_third_agent_is_a_fault() {
    let (mut world, agents) = build_world(&pong_game(), "default", 0, 0, 3);
    for agent in agents {
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform));
    }
    let text = world.tick().expect_err("room for two").to_string();
    assert!(text.contains("`pong` has room for 2 agents,") && text.contains("it has 3"), "{text}");
}

#[test]
fn an_evaluation_plays_each_level_once_by_both_agents_on_any_number_of_threads() {
    let measure = |threads| {
        let plan = EvalPlan { threads, ..plan("default:0..7") };
        let results = evaluate(&pong_game(), &Player::Blind(BlindBot::Uniform), &plan, |_| {}).expect("playable");
        results.iter().map(|result| (result.level, result.ticks, result.total_reward)).collect::<Vec<_>>()
    };
    let results = measure(1);
    assert_eq!(results, measure(2), "threads do not count");
    assert_eq!(results.len(), 16);
    for (level, pair) in results.chunks(2).enumerate() {
        assert!(pair.iter().all(|result| result.0 == level as u64), "{results:?}");
        assert_eq!(pair[0].1, pair[1].1, "one episode has one length");
        assert_eq!(pair[0].2 + pair[1].2, 0.0, "one wins as much as the other loses");
    }
    assert!(results.iter().any(|result| result.2 == 1.0), "an agent has won: {results:?}");
}

fn fresh(arenas: &str, threads: usize) -> Result<Trainer, String> {
    let text = format!(
        r#"(
            game: "pong", train: "default:0..7", test: "default:8..15",
            steps: 2048, {arenas}, algorithm: "ppo",
            ppo: (num_steps: 64, minibatches: 4, hidden: [16, 16], lr: 0.003),
        )"#
    );
    let experiment = parse_experiment(&text, Path::new("test.ron")).expect("valid");
    Trainer::new(&pong_game(), &experiment, None, DeviceKind::Flex, threads).map_err(|error| error.to_string())
}

#[test]
fn self_play_that_was_killed_goes_on_bit_for_bit() {
    let trainer = |threads| fresh("arenas: 8, worlds: 2", threads).expect("fits");
    assert_eq!(trainer(2).worlds_mut().count(), 4, "two agents in each World");
    check_resuming(&pong_game(), trainer, 2);
}

#[test]
fn a_training_without_an_agent_for_each_paddle_is_refused() {
    let text = fresh("arenas: 7, worlds: 1", 1).err().expect("one is left over");
    let expected = "`arenas` is 7: must be a multiple of 2, since that many agents of `pong` play together in each World; \
                    8 is";
    assert_eq!(text, expected);
}
