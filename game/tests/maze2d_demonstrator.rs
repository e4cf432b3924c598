//! Tests of Maze2D's demonstrator: it reaches its goals on every map, with and without the noise of its recordings.

use std::sync::Arc;

use playbot_games::maze2d::{
    Demonstrator, Maze2dLevel, Maze2dMode,
    sim::{BallSim, is_at_goal, reward},
};
use playbot_learner::{Streams, rng::unit};

/// The result of one episode.
struct Outcome {
    reached: bool,
    total_reward: f64,
    targets: usize,
}

fn play(mode: &Maze2dMode, seed: u64, noise: f64) -> Outcome {
    let level = Arc::new(Maze2dLevel::new(mode, seed).expect("a level"));
    let mut rng = Streams::new(seed).stream("test", 0);
    let mut bot = Demonstrator::new(level.clone(), mode.retarget, &mut rng);
    let mut sim = BallSim::new(mode, &level);
    let mut outcome = Outcome { reached: false, total_reward: 0.0, targets: 0 };
    let mut target = bot.target();
    for _ in 0..mode.limit {
        let push = bot.act(&sim.ball, noise, &mut rng);
        outcome.targets += usize::from(bot.target() != target);
        target = bot.target();
        sim.step(push);
        outcome.total_reward += f64::from(reward(sim.ball.position, level.goal(), mode.sparse));
        outcome.reached |= is_at_goal(sim.ball.position, level.goal());
        if outcome.reached && mode.end_at_goal {
            break;
        }
    }
    outcome
}

const LEVELS: u64 = 300;

#[test]
fn every_goal_is_reached() {
    for map in [
        "umaze",
        "medium",
        "large",
        "xl",
        "large+fixed-start",
        "medium+no-offset",
        "large+goal=random",
        "medium+contact=rapier",
        "random",
        "random+size=15x21+loops=0",
        "random+corridor=2+goal=random",
    ] {
        let mode: Maze2dMode = map.parse().expect("a mode");
        for noise in [0.0, 0.5] {
            let lost: Vec<_> = (0..LEVELS).filter(|&seed| !play(&mode, seed, noise).reached).collect();
            assert!(lost.is_empty(), "{map} with noise {noise}: {} of {LEVELS} lost: {lost:?}", lost.len());
        }
    }
}

/// Returns the mean return over some levels.
fn mean_return(map: &str, play: impl Fn(&Maze2dMode, u64) -> f64) -> f64 {
    let mode: Maze2dMode = map.parse().expect("a mode");
    (0..LEVELS).map(|seed| play(&mode, seed)).sum::<f64>() / LEVELS as f64
}

/// Plays uniformly random pushes, and returns the episode's return.
fn play_at_random(mode: &Maze2dMode, seed: u64) -> f64 {
    let level = Maze2dLevel::new(mode, seed).expect("a level");
    let (mut sim, mut rng) = (BallSim::new(mode, &level), Streams::new(seed).stream("test", 0));
    let mut step = |_| {
        sim.step([(); 2].map(|()| 2.0 * unit(&mut rng) - 1.0));
        f64::from(reward(sim.ball.position, level.goal(), mode.sparse))
    };
    (0..mode.limit).map(&mut step).sum()
}

/// D4RL publishes the mean returns of random play and of its own controller, with dense rewards. Ours is a faster one.
#[test]
fn returns_are_of_the_size_that_d4rl_publishes() {
    for (map, random, expert) in [("umaze", 68.54, 193.66), ("medium", 44.26, 297.46), ("large", 30.57, 303.49)] {
        let ours = mean_return(map, play_at_random);
        let demonstrator = mean_return(map, |mode, seed| play(mode, seed, 0.5).total_reward);
        assert!((random / 1.5..random * 1.5).contains(&ours), "{map}: {ours} instead of about {random}");
        assert!(demonstrator > expert, "{map}: {demonstrator} is less than {expert}");
    }
}

#[test]
fn a_demonstrator_that_retargets_visits_one_cell_after_the_other() {
    let mode: Maze2dMode = "medium+retarget+limit=3000".parse().expect("a mode");
    let targets: Vec<_> = (0..20).map(|seed| play(&mode, seed, 0.5).targets).collect();
    assert!(targets.iter().all(|&targets| targets >= 5), "{targets:?}");
}
