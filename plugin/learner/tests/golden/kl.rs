//! The penalty of SCORE: divergences, the decoder's confidence α, and the gradient with respect to the policy.

use crate::case::{Case, host, number};
use burn::tensor::Tensor;
use playbot_learner::nn::Dist;
use playbot_learner::rng::Streams;
use playbot_learner::score::{confidences, decoder_kl, penalty, penalty_weights};
use playbot_learner::{ConfidenceKind, DeviceKind, KlDirection, PenaltyForm, ScoreConfig};

type Leaves = Vec<(&'static str, Tensor<2>)>;

fn policy(case: &Case, kind: DeviceKind) -> (Dist, Leaves) {
    let device = kind.plain();
    let leaf = |t: Tensor<2>| t.autodiff().require_grad();
    if case.has("param.pol_logits") {
        let logits = leaf(case.tensor("param.pol_logits", &device));
        return (Dist::categorical(logits.clone()), vec![("pol_logits", logits)]);
    }
    let mean = leaf(case.tensor("param.pol_mean", &device));
    let log_std = leaf(case.tensor::<1>("param.pol_log_std", &device).unsqueeze());
    let leaves = vec![("pol_mean", mean.clone()), ("pol_log_std", log_std.clone())];
    (Dist::Gaussian { mean, log_std, free: None }, leaves)
}

fn decoder(case: &Case, kind: DeviceKind) -> Dist {
    let device = kind.plain();
    if case.has("in.dec_logits") {
        return Dist::categorical(case.tensor("in.dec_logits", &device));
    }
    let (mean, log_std) = (case.tensor("in.dec_mean", &device), case.tensor("in.dec_log_std", &device));
    Dist::Gaussian { mean, log_std, free: None }
}

fn check(case: &Case, kinds: &[(&str, ConfidenceKind)]) {
    case.assert_fixed("legacy_clamp", 100.0);
    for device in DeviceKind::CPU {
        let decoder = decoder(case, device);
        let rows = decoder.clone().to_host().expect("readable");
        for (name, confidence_kind) in kinds {
            let actions = match confidence_kind {
                ConfidenceKind::OwnSample => case.actions("in.decoder_action"),
                _ => case.actions("in.policy_action"),
            };
            let weights = confidences(*confidence_kind, &rows, &actions).expect("they fit");
            if *confidence_kind != ConfidenceKind::Off {
                case.check(&format!("out.alpha.{name}"), &weights);
            }
            for (kl_direction, short) in
                [(KlDirection::DecoderPolicy, "dec_pol"), (KlDirection::PolicyDecoder, "pol_dec")]
            {
                let (policy, leaves) = policy(case, device);
                let config = ScoreConfig { kl_direction, ..ScoreConfig::default() };
                let weights = Tensor::<1>::from_floats(weights.as_slice(), &device.plain());
                let penalty = penalty(&config, &decoder, &policy, weights).expect("same kind");
                case.check(&format!("out.kl_{short}"), &host(penalty.kl));
                let term = penalty.term;
                case.check_number(&format!("reg.{short}.{name}"), number(term.clone()));
                let scaled = number(term.clone() * case.number("kl_coef"));
                case.check_number(&format!("loss_term.{short}.{name}"), scaled);
                check_gradients(case, &format!("grad.{short}.{name}"), &leaves, term);
            }
        }
    }
}

fn check_gradients(case: &Case, name: &str, leaves: &Leaves, loss: Tensor<1>) {
    let grads = loss.backward();
    for (leaf_name, leaf) in leaves {
        let got = host(leaf.grad(&grads).expect("tracked"));
        case.check(&format!("{name}.{leaf_name}"), &got);
    }
}

/// Returns the penalty of a legacy form, and its weights, as PPO computes them.
fn legacy(case: &Case, form: PenaltyForm, device: DeviceKind) -> (Tensor<1>, Vec<f32>, Leaves) {
    let config = ScoreConfig { penalty: form, ..ScoreConfig::default() };
    let decoder = decoder(case, device);
    let rows = decoder.clone().to_host().expect("readable");
    let mut rng = Streams::new(0).stream("unused", 0);
    let weights = penalty_weights(&config, &rows, &case.actions("in.policy_action"), &mut rng).expect("they fit");
    let (policy, leaves) = policy(case, device);
    let weight = Tensor::<1>::from_floats(weights.as_slice(), &device.plain());
    (penalty(&config, &decoder, &policy, weight).expect("same kind").term, weights, leaves)
}

#[test]
fn golden_kl_gaussian() {
    let case = Case::load("kl_gaussian");
    check(
        &case,
        &[
            ("off", ConfidenceKind::Off),
            ("score_policy_action", ConfidenceKind::PolicyAction),
            ("score_own_sample", ConfidenceKind::OwnSample),
            ("density_policy_action", ConfidenceKind::Density),
        ],
    );
    for device in DeviceKind::CPU {
        let (term, weights, leaves) = legacy(&case, PenaltyForm::LegacyD4rl, device);
        case.check_number("legacy_d4rl.weight", weights.iter().map(|&w| f64::from(w)).sum());
        let kl = decoder_kl(&decoder(&case, device), &policy(&case, device).0, KlDirection::PolicyDecoder);
        let sum = kl.expect("same kind").sum();
        case.check_number("legacy_d4rl.kl_sum", number(sum.clone()));
        let bound = case.number("legacy_clamp");
        case.check_number("legacy_d4rl.kl_sum_clamped", number(sum.clamp(-bound, bound)));
        let term = term * case.number("legacy_d4rl_coef");
        case.check_number("legacy_d4rl.term", number(term.clone()));
        check_gradients(&case, "grad.legacy_d4rl", &leaves, term);
    }
    case.finish(&[]);
}

#[test]
fn golden_kl_categorical() {
    let case = Case::load("kl_categorical");
    check(
        &case,
        &[
            ("off", ConfidenceKind::Off),
            ("prob_policy_action", ConfidenceKind::PolicyAction),
            ("prob_own_sample", ConfidenceKind::OwnSample),
        ],
    );
    for device in DeviceKind::CPU {
        let (term, _, leaves) = legacy(&case, PenaltyForm::LegacyCoinrun, device);
        case.check_number("legacy_coinrun.sum", number(term.clone()));
        check_gradients(&case, "grad.legacy_coinrun_sum", &leaves, term);
    }
    case.finish(&[]);
}
