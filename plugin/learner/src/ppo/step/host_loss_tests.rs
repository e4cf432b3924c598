//! Tests against the loss as a graph of tensors.

use crate::{
    ActionSpace, DeviceKind,
    legal::logit_offsets,
    nn::{ActionBatch, matrix, vector},
    policy::NetInput,
    ppo::{
        objective::PpoBatch,
        step::{Losses, *},
    },
    rng::{ChaCha8Rng, Streams, normal},
    score::{ScoreConfig, TeacherBatch},
};
use burn::tensor::{Device, Gradients};
use rand::RngExt;

fn numbers(rng: &mut ChaCha8Rng, n: usize, scale: f32) -> Vec<f32> {
    (0..n).map(|_| normal(rng) * scale).collect()
}

/// Returns a policy or decoder: choices, a Gaussian with ln σ for all rows or for each, or two choices and a vector.
fn dist(rng: &mut ChaCha8Rng, kind: u8, n: usize, dim: usize, device: &Device) -> Dist {
    let head = matrix(numbers(rng, n * dim, 0.7), n, dim, device);
    let std_rows = if kind == 1 { 1 } else { n };
    match kind {
        0 => Dist::categorical(head),
        3 => Dist::Joint(vec![dist(rng, 0, n, dim, device), dist(rng, 0, n, 3, device), dist(rng, 1, n, 2, device)]),
        _ => {
            let log_std = matrix(numbers(rng, std_rows * dim, 0.3), std_rows, dim, device);
            // In some rows of half of them the numbers are held.
            let is_held = rng.random::<bool>();
            let of_row = |_| if is_held && rng.random_ratio(1, 3) { 0.0 } else { 1.0 };
            let free = is_held.then(|| vector((0..n).map(of_row).collect(), device));
            Dist::Gaussian { mean: head, log_std, free }
        }
    }
}

/// Returns the rows whose numbers are held.
fn free(dist: &Dist) -> Option<&Tensor<1>> {
    match dist {
        Dist::Categorical { .. } => None,
        Dist::Gaussian { free, .. } => free.as_ref(),
        Dist::Joint(parts) => parts.iter().find_map(free),
    }
}

fn tracked(dist: Dist) -> Dist {
    match dist {
        Dist::Categorical { log_probs } => Dist::Categorical { log_probs: log_probs.require_grad() },
        Dist::Gaussian { mean, log_std, free } => {
            Dist::Gaussian { mean: mean.require_grad(), log_std: log_std.require_grad(), free }
        }
        Dist::Joint(parts) => Dist::Joint(parts.into_iter().map(tracked).collect()),
    }
}

/// Returns the gradients by all numbers of the distribution and by the values, where there are any.
fn gradients(loss: Tensor<1>, dist: &Dist, values: &Tensor<1>) -> Vec<Option<Vec<f32>>> {
    fn of_parts(dist: &Dist, grads: &Gradients) -> Vec<Option<Vec<f32>>> {
        let of = |grad: Option<Tensor<2>>| grad.map(|grad| host(grad).expect("readable"));
        match dist {
            Dist::Categorical { log_probs } => vec![of(log_probs.grad(grads))],
            Dist::Gaussian { mean, log_std, .. } => vec![of(mean.grad(grads)), of(log_std.grad(grads))],
            Dist::Joint(parts) => parts.iter().flat_map(|part| of_parts(part, grads)).collect(),
        }
    }
    let grads = loss.backward();
    let mut all = of_parts(dist, &grads);
    all.push(values.grad(&grads).map(|grad| host(grad).expect("readable")));
    all
}

fn close(got: f64, want: f64) -> bool {
    (got - want).abs() <= 2e-5 * want.abs().max(0.05)
}

#[test]
fn loss_metrics_and_gradient_are_those_of_the_tensors() {
    for case in 0..128 {
        let device = DeviceKind::Flex.plain();
        let mut rng = Streams::new(7).stream("loss", case);
        let (kind, n, dim) = ((case % 4) as u8, rng.random_range(1..150), rng.random_range(1..17));
        let [penalised, from_policy, clip_value] = [(); 3].map(|()| rng.random::<bool>());
        let policy = tracked(dist(&mut rng, kind, n, dim, &device.clone().autodiff()));
        let decoder = dist(&mut rng, kind, n, dim, &device).with_free(free(&policy));
        let actions = match kind {
            0 => Actions::Discrete((0..n).map(|i| (i % dim) as u32).collect()),
            3 => Actions::Mixed {
                choices: 2,
                options: (0..n).flat_map(|i| [i % dim, i % 3].map(|option| option as u32)).collect(),
                dim: 2,
                values: numbers(&mut rng, n * 2, 1.0),
            },
            _ => Actions::Continuous { dim, values: numbers(&mut rng, n * dim, 1.0) },
        };
        let actions = ActionBatch::new(&actions, &device);
        let near = host(policy.log_prob(&actions).expect("fits").inner()).expect("readable");
        let mut column = |scale: f32| numbers(&mut rng, n, scale);
        let old_log_probs = near.iter().zip(column(0.2)).map(|(new, by)| new + by).collect();
        let confidence = column(1.0).iter().map(|x| x.abs()).collect();
        let [advantages, old_values, returns] = [1.0, 0.3, 1.0].map(|scale| vector(column(scale), &device));
        let values = vector(column(0.3), &device.clone().autodiff()).require_grad();
        let batch = Minibatch {
            augmented: None,
            recall: None,
            left: None,
            logit_offsets: None,
            free: None,
            inputs: NetInput::Joined(matrix(vec![0.0], 1, 1, &device)),
            ppo: PpoBatch { actions, old_log_probs: vector(old_log_probs, &device), advantages, old_values, returns },
            intrinsic_returns: None,
            teacher: penalised.then(|| TeacherBatch {
                dist: decoder,
                confidence: vector(confidence, &device),
                mean_confidence: 0.0,
            }),
        };
        let direction = if from_policy { KlDirection::PolicyDecoder } else { KlDirection::DecoderPolicy };
        let score = ScoreConfig { kl_coef: 0.3, kl_direction: direction, ..ScoreConfig::default() };
        let config = PpoConfig { clip_value_loss: clip_value, ent_coef: 0.02, ..PpoConfig::default() };
        let moment =
            UpdateSettings { lr: 1e-3, score: penalised.then_some(&score), is_warming_up: rng.random_ratio(1, 4) };

        let ours = HostLoss::of(&policy, &values, &batch, &config, &moment, 0).expect("finite");
        let theirs = Losses::of(&policy, values.clone(), &batch, &config, &moment).expect("fits");
        let (got, want) = (ours.metrics, theirs.metrics(&batch, &config, 0).expect("finite"));
        for (name, got, want) in [
            ("policy_loss", got.policy_loss, want.policy_loss),
            ("value_loss", got.value_loss, want.value_loss),
            ("entropy", got.entropy, want.entropy),
            ("approx_kl", got.approx_kl, want.approx_kl),
            ("clip_fraction", got.clip_fraction, want.clip_fraction),
            ("decoder_kl", got.decoder_kl, want.decoder_kl),
            ("kl_penalty", got.kl_penalty, want.kl_penalty),
            ("total_loss", got.total_loss, want.total_loss),
        ] {
            assert!(close(got, want), "case {case}: {name} {got}, expected {want}");
        }
        let got = gradients(ours.tensor(&policy, values.clone()), &policy, &values);
        let want = gradients(theirs.total, &policy, &values);
        for (got, want) in got.iter().zip(&want) {
            let want = want.clone().unwrap_or_else(|| vec![0.0; got.as_ref().map_or(0, Vec::len)]);
            let got = got.clone().unwrap_or_else(|| vec![0.0; want.len()]);
            let largest = want.iter().fold(1e-3f32, |most, x| most.max(x.abs()));
            for (got, want) in got.iter().zip(&want) {
                assert!((got - want).abs() <= 1e-4 * largest, "case {case}: {got}, expected {want}");
            }
        }
    }
}

/// Returns the loss with a penalty for policy and decoder with these logits, and its gradient by the policy's.
fn penalised(
    [policy, decoder]: [Vec<f32>; 2],
    offsets: Option<&Tensor<2>>,
    actions: Vec<u32>,
    columns: &[Vec<f32>; 6],
) -> (StepMetrics, Vec<f32>) {
    let device = DeviceKind::Flex.plain();
    let (n, choices) = (actions.len(), policy.len() / actions.len());
    let of = |logits: Tensor<2>| match offsets {
        Some(offsets) => Dist::categorical(logits + offsets.clone()),
        None => Dist::categorical(logits),
    };
    let logits = matrix(policy, n, choices, &device.clone().autodiff()).require_grad();
    let dist = of(logits.clone());
    let [old_log_probs, advantages, old_values, returns, confidence, values] = columns;
    let column = |numbers: &[f32]| vector(numbers.to_vec(), &device);
    let values = vector(values.clone(), &device.clone().autodiff()).require_grad();
    let batch = Minibatch {
        augmented: None,
        recall: None,
        left: None,
        logit_offsets: offsets.cloned(),
        free: None,
        inputs: NetInput::Joined(matrix(vec![0.0], 1, 1, &device)),
        ppo: PpoBatch {
            actions: ActionBatch::new(&Actions::Discrete(actions), &device),
            old_log_probs: column(old_log_probs),
            advantages: column(advantages),
            old_values: column(old_values),
            returns: column(returns),
        },
        intrinsic_returns: None,
        teacher: Some(TeacherBatch {
            dist: of(matrix(decoder, n, choices, &device)),
            confidence: column(confidence),
            mean_confidence: 0.0,
        }),
    };
    let score = ScoreConfig { kl_coef: 0.3, ..ScoreConfig::default() };
    let config = PpoConfig { ent_coef: 0.02, ..PpoConfig::default() };
    let moment = UpdateSettings { lr: 1e-3, score: Some(&score), is_warming_up: false };
    let loss = HostLoss::of(&dist, &values, &batch, &config, &moment, 0).expect("finite");
    let metrics = loss.metrics;
    let grads = loss.tensor(&dist, values).backward();
    (metrics, host(logits.grad(&grads).expect("tracked")).expect("readable"))
}

#[test]
fn the_loss_under_a_mask_is_that_of_the_legal_choices_alone() {
    let device = DeviceKind::Flex.plain();
    let mut rng = Streams::new(3).stream("loss", 0);
    let n = 40;
    let fewer = [0.7, 0.5].map(|scale| numbers(&mut rng, 2 * n, scale));
    // Between the two legal choices there is an illegal one with the largest logit.
    let more = fewer.clone().map(|logits| logits.chunks(2).flat_map(|row| [row[0], 9.0, row[1]]).collect::<Vec<f32>>());
    let columns = [0.2, 1.0, 0.3, 1.0, 0.5, 0.3].map(|scale| numbers(&mut rng, n, scale));
    let rows: Vec<usize> = (0..n).collect();
    let offsets =
        logit_offsets(&[true, false, true].repeat(n), &rows, &ActionSpace::Discrete(3), &device).expect("a mask");
    let actions = |step: u32| (0..n as u32).map(|row| row % 2 * step).collect::<Vec<u32>>();
    let (want, want_grads) = penalised(fewer, None, actions(1), &columns);
    let (got, grads) = penalised(more, Some(&offsets), actions(2), &columns);
    for (name, got, want) in [
        ("policy_loss", got.policy_loss, want.policy_loss),
        ("entropy", got.entropy, want.entropy),
        ("decoder_kl", got.decoder_kl, want.decoder_kl),
        ("total_loss", got.total_loss, want.total_loss),
    ] {
        assert!(close(got, want), "{name} {got}, expected {want}");
    }
    for (got, want) in grads.chunks(3).zip(want_grads.chunks(2)) {
        assert!((got[0] - want[0]).abs() < 1e-6 && (got[2] - want[1]).abs() < 1e-6, "{got:?}, expected {want:?}");
        assert!(got[1].abs() < 1e-20, "{got:?}");
    }
}

#[test]
fn actions_of_the_other_kind_are_refused() {
    let device = DeviceKind::Flex.plain();
    let mut rng = Streams::new(1).stream("loss", 0);
    let column = || vector(vec![0.0; 2], &device);
    let actions = ActionBatch::new(&Actions::Discrete(vec![0, 1]), &device);
    let batch = Minibatch {
        augmented: None,
        recall: None,
        left: None,
        logit_offsets: None,
        free: None,
        inputs: NetInput::Joined(matrix(vec![0.0], 1, 1, &device)),
        ppo: PpoBatch {
            actions,
            old_log_probs: column(),
            advantages: column(),
            old_values: column(),
            returns: column(),
        },
        teacher: None,
        intrinsic_returns: None,
    };
    let moment = UpdateSettings { lr: 1e-3, score: None, is_warming_up: false };
    let gaussian = dist(&mut rng, 1, 2, 3, &device);
    let error = HostLoss::of(&gaussian, &column(), &batch, &PpoConfig::default(), &moment, 0);
    assert!(error.expect_err("another kind").to_string().contains("differ in kind"));
}
