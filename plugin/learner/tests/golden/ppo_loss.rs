//! The losses of PPO and their gradients.

use crate::case::{Case, host, number};
use burn::tensor::Tensor;
use playbot_learner::DeviceKind;
use playbot_learner::nn::{ActionBatch, Dist};
use playbot_learner::ppo::{PpoBatch, normalize_advantages, ppo_loss, ratio_stats};

fn check(name: &str) {
    let case = Case::load(name);
    case.assert_fixed("adv_eps", 1e-8);
    case.assert_fixed("adv_std", "unbiased");
    for kind in DeviceKind::CPU {
        let device = kind.plain();
        let leaf = |t: Tensor<2>| t.autodiff().require_grad();
        let values = case.tensor::<1>("param.values", &device).autodiff().require_grad();
        let (dist, leaves) = if case.has("param.logits") {
            let logits = leaf(case.tensor("param.logits", &device));
            (Dist::categorical(logits.clone()), vec![("grad.logits", logits)])
        } else {
            let mean = leaf(case.tensor("param.mean", &device));
            let log_std = leaf(case.tensor::<1>("param.log_std", &device).unsqueeze());
            let leaves = vec![("grad.mean", mean.clone()), ("grad.log_std", log_std.clone())];
            (Dist::Gaussian { mean, log_std, free: None }, leaves)
        };
        let raw = case.f32s("in.advantages");
        let mut normalized = raw.clone();
        normalize_advantages(&mut normalized);
        case.check("out.normalized_advantages", &normalized);
        let advantages = |v: &[f32]| Tensor::<1>::from_floats(v, &device);
        let batch = PpoBatch {
            actions: ActionBatch::new(&case.actions("in.actions"), &device),
            old_log_probs: case.tensor("in.old_log_probs", &device),
            advantages: advantages(&normalized),
            old_values: case.tensor("in.old_values", &device),
            returns: case.tensor("in.returns", &device),
        };
        let clip = case.number("clip");
        let other = PpoBatch { advantages: advantages(&raw), ..batch.clone() };
        let plain = ppo_loss(&dist, values.clone(), &other, clip, false).expect("same kind");
        case.check_number("policy_loss_without_advantage_normalisation", number(plain.policy_loss));
        case.check_number("value_loss_without_clipping", number(plain.value_loss));

        let loss = ppo_loss(&dist, values.clone(), &batch, clip, true).expect("same kind");
        case.check("out.log_probs", &host(dist.log_prob(&batch.actions).expect("same kind")));
        case.check("out.ratio", &host(loss.log_ratio.clone().exp()));
        let stats = ratio_stats(&host(loss.log_ratio), clip);
        case.check_number("approx_kl", stats.approx_kl);
        case.check_number("old_approx_kl", stats.old_approx_kl);
        case.check_number("clip_fraction", stats.clip_fraction);
        case.check_number("policy_loss", number(loss.policy_loss.clone()));
        case.check_number("value_loss", number(loss.value_loss.clone()));
        case.check_number("entropy", number(loss.entropy.clone()));
        let total =
            loss.policy_loss - loss.entropy * case.number("ent_coef") + loss.value_loss * case.number("vf_coef");
        case.check_number("total_loss", number(total.clone()));
        let grads = total.backward();
        case.check("grad.values", &host(values.grad(&grads).expect("tracked")));
        for (name, leaf) in leaves {
            case.check(name, &host(leaf.grad(&grads).expect("tracked")));
        }
    }
    case.finish(&[]);
}

#[test]
fn golden_ppo_loss_gaussian() {
    check("ppo_loss_gaussian");
}

#[test]
fn golden_ppo_loss_categorical() {
    check("ppo_loss_categorical");
}
