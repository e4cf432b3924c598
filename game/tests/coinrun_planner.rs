//! Tests of the planner: it wins every level of the default sets, and its demonstrations survive noise.

use std::sync::Arc;

use playbot_games::coinrun::{
    CoinRunEnd, Demonstrator, Mode, Plan, PlannerConfig, Sim, generator::generate, planner::plan,
};
use rand_mt::Mt;

fn start(mode: Mode, seed: u32) -> Sim {
    Sim::new(Arc::new(generate(mode, seed)))
}

fn wins(sim: &Sim, config: &PlannerConfig) -> bool {
    let Plan::Found(actions) = plan(sim, config) else {
        return false;
    };
    let mut copy = sim.clone();
    for action in actions {
        assert_eq!(copy.end(), None, "the plan goes on after the end");
        copy.step(action);
    }
    copy.end() == Some(CoinRunEnd::Coin)
}

#[test]
fn every_level_is_won() {
    for config in [PlannerConfig::default(), PlannerConfig::cautious()] {
        for (mode, seed) in (0..500).flat_map(|seed| [(Mode::Easy, seed), (Mode::Hard, seed)]) {
            assert!(wins(&start(mode, seed), &config), "{mode} {seed} {config:?}");
        }
    }
}

#[test]
fn plans_can_start_anywhere() {
    let mut draws = Mt::new(3);
    let (mut tried, mut won) = (0, 0);
    for seed in 0..200 {
        let mut sim = start(Mode::Hard, seed);
        for _ in 0..30 {
            sim.step([7, 8, 4][draws.next_u32() as usize % 3]);
        }
        if sim.end().is_none() {
            tried += 1;
            won += i32::from(wins(&sim, &PlannerConfig::default()));
        }
    }
    // Some of these states are already lost: the player is falling towards a saw, for example.
    assert!(won * 100 >= tried * 90, "{won} of {tried}");
}

#[test]
fn an_episode_that_is_over_has_no_plan() {
    let mut sim = start(Mode::Hard, 0);
    while sim.end().is_none() {
        sim.step(8);
    }
    assert_eq!(plan(&sim, &PlannerConfig::default()), Plan::GaveUp { expansions: 0 });
}

/// Returns true if the demonstrator wins while each action is replaced by a random one with probability 1/5.
fn wins_with_noise(mut sim: Sim, draws: &mut Mt) -> bool {
    let mut demonstrator = Demonstrator::default();
    while sim.end().is_none() {
        let mut action = demonstrator.act(&sim);
        if draws.next_u32().is_multiple_of(5) {
            action = (draws.next_u32() % 15) as u8;
        }
        sim.step(action);
    }
    sim.end() == Some(CoinRunEnd::Coin)
}

#[test]
fn demonstrations_survive_noise() {
    let mut draws = Mt::new(11);
    let won = (0..200).filter(|&seed| wins_with_noise(start(Mode::Easy, seed), &mut draws)).count();
    assert!(won >= 170, "{won} of 200");
}
