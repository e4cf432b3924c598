//! Tests that agents in a shared World learn the same as agents with a World each.

use std::path::Path;

use playbot_learner::DeviceKind;
use playbot_tests::Corridor;
use playbot_train::{Experiment, Trainer, experiment::file::parse_experiment};

const SEEDS: u64 = 6;

/// Returns the mean success rate over a training, which measures the speed of learning, and that of its end.
fn learned(worlds: u32, seed: u64) -> [f64; 2] {
    let text = r#"(
        game: "corridor", train: "plain:0..7", test: "plain:8..15", algorithm: "ppo", steps: 32768, arenas: 64,
        ppo: (num_steps: 16, minibatches: 4, hidden: [16, 16], lr: 0.003),
    )"#;
    let experiment = Experiment { worlds, seed, ..parse_experiment(text, Path::new("x.ron")).expect("sound") };
    let mut trainer = Trainer::new(&Corridor, &experiment, None, DeviceKind::Flex, 2).expect("it fits");
    let mut rates = Vec::new();
    while !trainer.is_done() {
        rates.push(trainer.update().expect("finite").success_rate.unwrap_or(0.0));
    }
    [rates.iter().sum::<f64>() / rates.len() as f64, *rates.last().expect("updates")]
}

/// Returns the mean and squared standard error over the seeds.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
}

#[test]
fn sixty_four_agents_in_one_world_learn_like_one_in_each_of_sixty_four() {
    let of = |worlds| -> Vec<[f64; 2]> { (1..=SEEDS).map(|seed| learned(worlds, seed)).collect() };
    let (one, many) = (of(1), of(64));
    for (at, what) in ["over the training", "at its end"].into_iter().enumerate() {
        let column = |rows: &[[f64; 2]]| mean(&rows.iter().map(|row| row[at]).collect::<Vec<_>>());
        let ((one, one_error), (many, many_error)) = (column(&one), column(&many));
        let error = (one_error + many_error).sqrt();
        assert!((one - many).abs() < 3.0 * error + 0.01, "{what}: {one} in one World, {many} in 64, ± {error}");
    }
    let untrained = 0.6;
    assert!(mean(&one.iter().map(|row| row[1]).collect::<Vec<_>>()).0 > untrained, "the agents learned nothing");
}
