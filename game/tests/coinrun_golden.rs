//! Tests of the generator, the rules and whole episodes against numbers measured on Procgen.

#![allow(clippy::disallowed_methods, reason = "tests compare with the system's functions")]

#[path = "shared/golden.rs"]
mod golden;

use std::sync::Arc;

use playbot_games::coinrun::{CoinRunEnd, Level, Mode, Sim, generator::generate};
use rand_mt::Mt;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Returns the objects of a file of JSON lines, at least one.
fn golden_lines<T: DeserializeOwned>(fixture: &str) -> Vec<T> {
    let parse = |line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{fixture}: {error}"));
    let all: Vec<T> = golden::text(fixture).lines().map(parse).collect();
    assert!(!all.is_empty(), "{fixture} is empty");
    all
}

#[derive(Deserialize)]
struct Trace {
    mode: Mode,
    seed: u32,
    policy: String,
    n: usize,
    outcome: String,
    constant_action: Option<u8>,
    #[serde(default)]
    actions: Vec<u8>,
    #[serde(default)]
    steps: Vec<[f32; 6]>,
    #[serde(default)]
    on_crate: String,
    #[serde(default)]
    enemies_x: Vec<Vec<f32>>,
    r#final: Option<[f32; 6]>,
    #[serde(default)]
    final_enemies_x: Vec<f32>,
}

impl Trace {
    fn actions(&self) -> Vec<u8> {
        match self.constant_action {
            Some(action) => vec![action; self.n],
            None => self.actions.clone(),
        }
    }

    /// Returns the recorded agent state, reward and end after step `k`, if there is one.
    fn recorded(&self, k: usize) -> Option<[f32; 6]> {
        let last = if k + 1 == self.n { self.r#final } else { None };
        self.steps.get(k).copied().or(last)
    }

    fn name(&self) -> String {
        format!("{} {} {}", self.mode, self.seed, self.policy)
    }
}

fn outcome_name(end: Option<CoinRunEnd>) -> &'static str {
    match end {
        None => "running",
        Some(CoinRunEnd::Coin) => "coin",
        Some(CoinRunEnd::Saw) => "saw",
        Some(CoinRunEnd::Enemy) => "enemy",
        Some(CoinRunEnd::Lava) => "lava",
        Some(CoinRunEnd::LeftMap) => "left_map",
        Some(CoinRunEnd::Timeout) => "timeout",
    }
}

fn start(mode: Mode, seed: u32) -> Sim {
    Sim::new(Arc::new(generate(mode, seed)))
}

#[test]
fn all_levels_are_equal() {
    let levels: Vec<Value> = golden_lines("coinrun/coinrun_levels.jsonl");
    for expected in levels {
        let mode: Mode = serde_json::from_value(expected["mode"].clone()).expect("a mode");
        let seed = expected["seed"].as_u64().expect("a seed") as u32;
        let own = serde_json::to_value(generate(mode, seed).to_golden_json()).expect("plain data");
        assert_eq!(own, expected, "{mode} {seed}");
    }
}

#[test]
fn all_traces_are_bit_equal() {
    for trace in golden_lines::<Trace>("coinrun/coinrun_traces.jsonl") {
        replay(&trace);
    }
}

fn replay(trace: &Trace) {
    let name = trace.name();
    let last = trace.n.checked_sub(1).and_then(|last| trace.recorded(last));
    assert!(last.is_some(), "{name}: no state after its last step");
    let mut sim = start(trace.mode, trace.seed);
    for (k, action) in trace.actions().into_iter().enumerate() {
        let result = sim.step(action);
        if let Some(expected) = trace.recorded(k) {
            let done = f32::from(u8::from(result.end.is_some()));
            let own = [sim.x(), sim.y(), sim.vx(), sim.vy(), result.reward, done];
            assert_eq!(own, expected, "{name}, step {k}");
        }
        if let Some(expected) = trace.enemies_x.get(k) {
            assert_eq!(&enemies_x(&sim), expected, "{name}, step {k}");
        }
        if let Some(expected) = trace.on_crate.as_bytes().get(k) {
            let own = sim.player_state().on_crate;
            assert_eq!(own, *expected == b'1', "{name}, step {k}");
        }
    }
    assert_eq!(outcome_name(sim.end()), trace.outcome, "{name}");
    assert_eq!(sim.steps() as usize, trace.n, "{name}");
    if trace.constant_action.is_some() {
        assert_eq!(enemies_x(&sim), trace.final_enemies_x, "{name}");
    }
}

fn enemies_x(sim: &Sim) -> Vec<f32> {
    sim.enemies().iter().map(|enemy| enemy.x).collect()
}

#[derive(Deserialize)]
struct Scores {
    aggregate: Vec<Score>,
    per_level_hold8: std::collections::BTreeMap<String, PerLevel>,
}

#[derive(Deserialize)]
struct Score {
    mode: Mode,
    levels: [u32; 2],
    policy: String,
    /// Number of plays of each level by the original.
    passes: u32,
    mean_return: f64,
    se_policy_noise_only: Option<f64>,
    mean_length: f64,
    frac_coin: f64,
    frac_timeout: f64,
}

#[derive(Deserialize)]
struct PerLevel {
    first_seed: u32,
    r#return: Vec<f32>,
    length: Vec<u32>,
}

fn scores() -> Scores {
    golden::json("coinrun/coinrun_scores.json")
}

impl Score {
    /// Returns the actions of its policy, each as likely as the others in every step: `hold8`, `uniform15` (0 to 14),
    /// `mix_7_8`.
    fn actions(&self) -> Vec<u8> {
        let action = |text: &str| text.parse::<u8>().unwrap_or_else(|_| panic!("unknown policy {}", self.policy));
        if let Some(held) = self.policy.strip_prefix("hold") {
            vec![action(held)]
        } else if let Some(number) = self.policy.strip_prefix("uniform") {
            (0..action(number)).collect()
        } else {
            self.policy.strip_prefix("mix_").unwrap_or_default().split('_').map(action).collect()
        }
    }
}

/// Plays an episode; returns its return and length.
fn play(mut sim: Sim, mut policy: impl FnMut() -> u8) -> (Sim, f64) {
    loop {
        let result = sim.step(policy());
        if result.end.is_some() {
            return (sim, f64::from(result.reward));
        }
    }
}

#[test]
fn holding_right_and_jump_scores_the_same_on_every_level() {
    let levels = scores().per_level_hold8;
    assert!(!levels.is_empty());
    for (mode, expected) in levels {
        let mode: Mode = mode.parse().expect("a mode");
        assert_eq!(expected.r#return.len(), expected.length.len(), "{mode}");
        for (offset, (&paid, &length)) in expected.r#return.iter().zip(&expected.length).enumerate() {
            let seed = expected.first_seed + offset as u32;
            let (sim, own) = play(start(mode, seed), || 8);
            assert_eq!((own as f32, sim.steps()), (paid, length), "{mode} {seed}");
        }
    }
}

#[test]
fn constant_policies_have_exact_means() {
    let mut compared = 0;
    for expected in scores().aggregate {
        let [action] = expected.actions()[..] else { continue };
        let own = Means::over(&expected, 1, || action);
        let context = format!("{} {:?} {}", expected.mode, expected.levels, expected.policy);
        assert!((own.paid - expected.mean_return).abs() < 1e-4, "{context}: {}", own.paid);
        assert!((own.length - expected.mean_length).abs() < 0.01, "{context}: {}", own.length);
        assert!((own.coins - expected.frac_coin).abs() < 1e-4, "{context}");
        assert!((own.timeouts - expected.frac_timeout).abs() < 1e-4, "{context}");
        compared += 1;
    }
    assert!(compared > 0);
}

/// Means over levels and passes; `error` is the standard error of `paid` for fixed levels.
struct Means {
    paid: f64,
    length: f64,
    coins: f64,
    timeouts: f64,
    error: f64,
}

impl Means {
    fn over(score: &Score, passes: u32, mut policy: impl FnMut() -> u8) -> Self {
        let [first, last] = score.levels;
        let (mut sums, mut variance) = ([0.0; 4], 0.0);
        for seed in first..=last {
            let level: Arc<Level> = Arc::new(generate(score.mode, seed));
            let mut wins = 0.0;
            for _ in 0..passes {
                let (sim, paid) = play(Sim::new(level.clone()), &mut policy);
                wins += paid / 10.0;
                sums[0] += paid;
                sums[1] += f64::from(sim.steps());
                sums[2] += f64::from(u8::from(sim.end().is_some_and(CoinRunEnd::is_success)));
                sums[3] += f64::from(u8::from(sim.end() == Some(CoinRunEnd::Timeout)));
            }
            let share = wins / f64::from(passes);
            variance += 100.0 * share * (1.0 - share) / f64::from(passes);
        }
        let levels = f64::from(last - first + 1);
        let [paid, length, coins, timeouts] = sums.map(|sum| sum / (levels * f64::from(passes)));
        Self { paid, length, coins, timeouts, error: variance.sqrt() / levels }
    }
}

#[test]
fn random_policies_have_the_same_mean_return() {
    let mut draws = Mt::new(20_260_101);
    let mut compared = 0;
    for expected in scores().aggregate {
        let actions = expected.actions();
        if actions.len() == 1 {
            continue;
        }
        // One pass has no error of its own: it is then judged from a few of ours.
        let passes = expected.passes.max(12);
        let own = Means::over(&expected, passes, || actions[(draws.next_u32() >> 8) as usize % actions.len()]);
        let of_as_many = own.error * f64::from(passes).sqrt() / f64::from(expected.passes).sqrt();
        let reference = expected.se_policy_noise_only.unwrap_or(of_as_many);
        // Four standard errors: of many means of a right game none is outside by chance.
        let limit = 4.0 * reference.hypot(own.error);
        let difference = (own.paid - expected.mean_return).abs();
        assert!(
            difference <= limit,
            "{} {:?} {}: {} instead of {} (limit {limit})",
            expected.mode,
            expected.levels,
            expected.policy,
            own.paid,
            expected.mean_return
        );
        compared += 1;
    }
    assert!(compared > 0);
}
