//! Tests of truncation: at the time limit, a rollout keeps the next state, with its value and the skill under which it
//! is valued.

use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_learner::{Actions, Observations, Policy, PpoConfig, Prior, Rollout, SkillDraw};
use playbot_tests::{Corridor, training::untrained};
use playbot_train::collect::Collector;

const AGENTS: usize = 8;
const TICKS: usize = 400;

fn policy() -> Policy {
    let config = PpoConfig { hidden: vec![8], ..PpoConfig::default() };
    untrained(&Corridor, &ObservationConfig::default(), config)
}

/// Returns a rollout of untrained agents, so that time is up for some. Skills are held for `skill_interval` ticks.
fn rollout(policy: &Policy, skill_interval: u32) -> Rollout {
    let split: LevelSplit = "plain:0..7".parse().expect("a split");
    let prior = SkillPrior { prior: Prior::standard_normal(2, false), skill_interval, draw: SkillDraw::Sample };
    let observation_config = ObservationConfig::default();
    let mut collector =
        Collector::new(&Corridor, &split, &observation_config, 3, 0, AGENTS as u32, Some(prior)).expect("can be seen");
    collector.collect(policy, 2, TICKS).expect("sound").0
}

fn numbers(observations: &Observations) -> &[f32] {
    match observations {
        Observations::Vector(numbers) => numbers,
        Observations::Image(_) => panic!("the corridor has no pictures here"),
    }
}

/// Returns the observed cell of an agent and the ticks that it has played.
fn cell_and_tick(seen: &[f32]) -> (i32, i32) {
    (((seen[0] + 1.0) * 3.0).round() as i32, (seen[1] * 20.0).round() as i32)
}

fn action(actions: &Actions, row: usize) -> usize {
    match actions.get(row) {
        Some(ActionValue::Discrete(index)) => index as usize,
        other => panic!("the corridor's actions are discrete: {other:?}"),
    }
}

#[test]
fn the_last_state_of_a_cut_episode_is_the_one_after_its_last_action() {
    let policy = policy();
    let rollout = rollout(&policy, 8);
    let obs = numbers(&rollout.obs);
    let cut: Vec<usize> = (0..AGENTS * TICKS).filter(|&row| rollout.truncated[row]).collect();
    assert!(cut.len() > 3, "time was up for {} episodes only", cut.len());
    assert_eq!(rollout.ends.cut_rows, cut);
    let last = numbers(&rollout.ends.cut_obs);
    assert_eq!(last.len(), 2 * cut.len());
    for (i, &row) in cut.iter().enumerate() {
        let (cell, tick) = cell_and_tick(&obs[row * 2..row * 2 + 2]);
        assert_eq!(tick, 19, "the last action is taken in the 20th tick, on the state before it");
        let cell = cell + [-1, 1, 0][action(&rollout.actions, row)];
        assert_eq!(last[i * 2..i * 2 + 2], [cell as f32 / 3.0 - 1.0, 1.0], "row {row}: one step later, after 20 ticks");
        let value = policy.values(&[], &last[i * 2..i * 2 + 2], 1).expect("fits");
        assert_eq!(rollout.final_values[row], value[0], "row {row}");
        assert!(!rollout.terminated[row], "row {row}");
        // The next row of the agent is the first state of another episode.
        if let Some(next) = obs.get((row + AGENTS) * 2..(row + AGENTS) * 2 + 2) {
            assert_eq!(cell_and_tick(next).1, 0, "row {row}");
        }
    }
    assert!(cut.iter().any(|&row| rollout.final_values[row] != 0.0), "the critic has an opinion");
    for row in (0..AGENTS * TICKS).filter(|row| !rollout.truncated[*row]) {
        assert_eq!(rollout.final_values[row], 0.0, "row {row}: nothing was cut off here");
    }
}

#[test]
fn the_state_is_valued_under_the_skill_that_is_held_or_one_that_is_drawn() {
    let policy = policy();
    // Skills of 8 ticks are drawn in ticks 0, 8 and 16: after tick 19 the third one has 4 ticks to go.
    let held = rollout(&policy, 8);
    assert!(held.ends.cut_rows.len() > 3);
    for (i, &row) in held.ends.cut_rows.iter().enumerate() {
        assert_eq!(held.ends.cut_z[i * 2..i * 2 + 2], held.z[row * 2..row * 2 + 2], "row {row}");
        assert_eq!((held.left[row], held.ends.cut_left[i]), (5.0 / 8.0, 4.0 / 8.0), "row {row}");
    }
    // Skills of 5 ticks are drawn in ticks 0, 5, 10 and 15. After tick 19 the fourth has run out, and another one is
    // drawn from a copy of the agent's stream. The next episode gets the next draws of the stream, so both rollouts see
    // the same stream. This prior does not depend on the state, so it is the same skill.
    let run_out = rollout(&policy, 5);
    assert_eq!(run_out.ends.cut_rows, held.ends.cut_rows, "the policy ignores skills");
    for (i, &row) in run_out.ends.cut_rows.iter().enumerate() {
        let cut = &run_out.ends.cut_z[i * 2..i * 2 + 2];
        assert_ne!(cut, &run_out.z[row * 2..row * 2 + 2], "row {row}: the old skill has run out");
        assert_eq!((run_out.left[row], run_out.ends.cut_left[i]), (1.0 / 5.0, 1.0), "row {row}");
        if let Some(next) = run_out.z.get((row + AGENTS) * 2..(row + AGENTS) * 2 + 2) {
            assert_eq!(cut, next, "row {row}");
        }
    }
    for agent in 0..AGENTS {
        let drawn = |rollout: &Rollout| {
            let mut skills: Vec<[f32; 2]> = Vec::new();
            for tick in 0..TICKS {
                let at = (tick * AGENTS + agent) * 2;
                let z = [rollout.z[at], rollout.z[at + 1]];
                if skills.last() != Some(&z) {
                    skills.push(z);
                }
            }
            skills
        };
        let (of_5, of_8) = (drawn(&run_out), drawn(&held));
        assert!(of_5.len() > of_8.len(), "agent {agent}");
        assert_eq!(of_5[..of_8.len()], of_8[..], "agent {agent}: one stream, draw after draw");
    }
}
