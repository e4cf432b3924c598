//! The penalty of SCORE: divergences, α, and the gradient with respect to the policy.

use crate::case::{Case, host, number};
use burn::tensor::Tensor;
use playbot_learner::nn::Dist;
use playbot_learner::score::{alphas, decoder_kl};
use playbot_learner::{AlphaKind, DeviceKind, KlDirection};

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
    (Dist::Gaussian { mean, log_std }, leaves)
}

fn check(name: &str, kinds: &[(&str, AlphaKind)]) {
    let case = Case::load(name);
    for device in DeviceKind::ALL {
        let plain = device.plain();
        let decoder = if case.has("in.dec_logits") {
            Dist::categorical(case.tensor("in.dec_logits", &plain))
        } else {
            Dist::Gaussian { mean: case.tensor("in.dec_mean", &plain), log_std: case.tensor("in.dec_log_std", &plain) }
        };
        let rows = decoder.clone().to_host().expect("readable");
        for (alpha_name, alpha_kind) in kinds {
            let actions = match alpha_kind {
                AlphaKind::OwnSample => case.actions("in.decoder_action"),
                _ => case.actions("in.policy_action"),
            };
            let alpha = alphas(*alpha_kind, &rows, &actions).expect("they fit");
            if *alpha_kind != AlphaKind::Off {
                case.check(&format!("out.alpha.{alpha_name}"), &alpha);
            }
            for (direction, short) in [(KlDirection::DecoderPolicy, "dec_pol"), (KlDirection::PolicyDecoder, "pol_dec")]
            {
                let (policy, leaves) = policy(&case, device);
                let kl = decoder_kl(&decoder, &policy, direction).expect("same kind");
                case.check(&format!("out.kl_{short}"), &host(kl.clone()));
                let alpha = Tensor::<1>::from_floats(alpha.as_slice(), &plain);
                let penalty = (kl * alpha).mean();
                case.check_number(&format!("reg.{short}.{alpha_name}"), number(penalty.clone()));
                let term = number(penalty.clone() * case.number("kl_coef"));
                case.check_number(&format!("loss_term.{short}.{alpha_name}"), term);
                let grads = penalty.backward();
                for (leaf_name, leaf) in leaves {
                    let got = host(leaf.grad(&grads).expect("tracked"));
                    case.check(&format!("grad.{short}.{alpha_name}.{leaf_name}"), &got);
                }
            }
        }
    }
    // The released code's terms are not reproduced.
    case.finish(&["legacy_", "grad.legacy_"]);
}

#[test]
fn golden_kl_gaussian() {
    check(
        "kl_gaussian",
        &[
            ("off", AlphaKind::Off),
            ("score_policy_action", AlphaKind::PolicyAction),
            ("score_own_sample", AlphaKind::OwnSample),
            ("density_policy_action", AlphaKind::Density),
        ],
    );
}

#[test]
fn golden_kl_categorical() {
    check(
        "kl_categorical",
        &[
            ("off", AlphaKind::Off),
            ("prob_policy_action", AlphaKind::PolicyAction),
            ("prob_own_sample", AlphaKind::OwnSample),
        ],
    );
}
