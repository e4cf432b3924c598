//! Generalised advantage estimation.

use crate::case::Case;
use playbot_learner::ppo::gae;
use playbot_learner::{ActionSpace, Actions, Rollout, TimeLimit};

fn check(name: &str) {
    let case = Case::load(name);
    let (steps, envs) = (case.dim("T"), case.dim("N"));
    let rows = steps * envs;
    let rollout = Rollout {
        steps,
        obs: vec![0.0; rows].into(),
        actions: Actions::Discrete(vec![0; rows]),
        log_probs: vec![0.0; rows],
        values: case.f32s("in.values"),
        rewards: case.f32s("in.rewards"),
        terminated: case.bools("in.terminations"),
        truncated: case.bools("in.truncations"),
        final_values: case.f32s("in.final_values"),
        next_values: case.f32s("in.next_value"),
        ..Rollout::new(envs, 1, 0, &ActionSpace::Discrete(1))
    };
    rollout.check().expect("the case fits together");
    for (limit, variant) in [(TimeLimit::Bootstrap, "bootstrap"), (TimeLimit::Legacy, "legacy")] {
        let got = gae(&rollout, &rollout.rewards, case.number("gamma"), case.number("gae_lambda"), limit);
        case.check(&format!("out.{variant}.advantages"), &got.advantages);
        case.check(&format!("out.{variant}.returns"), &got.returns);
    }
    case.finish(&[]);
}

#[test]
fn golden_gae_gamma_0990() {
    check("gae_gamma_0990");
}

#[test]
fn golden_gae_gamma_0999() {
    check("gae_gamma_0999");
}
