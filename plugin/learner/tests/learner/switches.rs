//! Each switch of SCORE and its effect, under PPO and under SAC.

use crate::corridor;
use crate::score::model;
use crate::toy::{Driver, OBS};
use playbot_learner::{
    ActionValue, ConfidenceKind, DeviceKind, KlDirection, LearnError, Learner, PenaltyForm, Policy, PpoConfig,
    PpoLearner, PriorKind, Rollout, SacConfig, SacLearner, SacMetrics, ScoreConfig, SkillDraw, SkillModel,
    UpdateMetrics,
};

const CHOICES: u32 = 3;

/// Returns a learner with one gradient step over all rows in each update, and a long one: the policy leaves the
/// decoder at once.
pub fn ppo(score: ScoreConfig, model: &SkillModel) -> PpoLearner {
    let config = PpoConfig { epochs: 1, minibatches: 1, lr: 0.05, ..corridor::config() };
    PpoLearner::with_skill(config, score, model, 1, DeviceKind::Flex).expect("good settings")
}

fn sac(score: ScoreConfig, model: &SkillModel) -> SacLearner {
    let config = SacConfig { learning_starts: 1, ..crate::sac::config() };
    SacLearner::with_skill(config, score, model, 1, DeviceKind::Flex).expect("good settings")
}

/// Returns a rollout of the decoder, which each policy starts as.
pub fn rollout(model: &SkillModel) -> Rollout {
    Driver::new(4, 1).rollout(&ppo(ScoreConfig::default(), model), 16)
}

/// Probabilities of all choices in each row.
fn probabilities(policy: &Policy, rollout: &Rollout) -> Vec<Vec<f64>> {
    let output = policy.forward(&rollout.z, &rollout.obs, rollout.rows()).expect("finite");
    let of = |row, choice| f64::from(output.log_prob(row, &ActionValue::Discrete(choice)).expect("a choice")).exp();
    (0..rollout.rows()).map(|row| (0..CHOICES).map(|choice| of(row, choice)).collect()).collect()
}

fn mean(numbers: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = numbers.len() as f64;
    numbers.sum::<f64>() / n
}

/// Returns the mean of KL(p ‖ q) over all rows.
fn kl(p: &[Vec<f64>], q: &[Vec<f64>]) -> f64 {
    mean(p.iter().zip(q).map(|(p, q)| p.iter().zip(q).map(|(p, q)| p * (p / q).ln()).sum()))
}

fn assert_near(got: f64, want: f64, what: &str) {
    assert!((got - want).abs() < 1e-4 * want.abs().max(0.1), "{what}: {got}, expected {want}");
}

/// Metrics of two updates with the same rollout, and the policy after them.
fn two_updates(score: ScoreConfig, model: &SkillModel, rollout: &Rollout) -> ([UpdateMetrics; 2], Policy) {
    let mut learner = ppo(score, model);
    let metrics = [0, 1].map(|_| learner.update(rollout).expect("finite"));
    (metrics, learner.policy())
}

fn sac_update(score: ScoreConfig, model: &SkillModel, rollout: &Rollout) -> SacMetrics {
    sac(score, model).update(rollout).expect("finite")
}

#[test]
fn the_policy_reads_the_skill_only_if_it_is_conditioned() {
    let model = model(1);
    let unconditioned = ScoreConfig { condition: false, init_from_decoder: false, ..ScoreConfig::default() };
    for (score, reads) in [(ScoreConfig::default(), true), (unconditioned, false)] {
        let (one, other) = (ppo(score.clone(), &model), sac(score, &model));
        assert_eq!((one.rollout_latent(), other.rollout_latent()), (2, 2), "the decoder reads it all the same");
        for policy in [one.policy(), other.policy()] {
            assert_eq!(policy.latent(), if reads { 2 } else { 0 });
            let head = |z: [f32; 2]| policy.forward(&z, &[0.5; OBS], 1).expect("finite").head;
            assert_eq!(head([0.9, -0.9]) != head([-0.9, 0.9]), reads);
        }
    }
}

#[test]
fn skills_come_from_the_prior_that_is_chosen() {
    let model = model(1);
    for (prior, sees) in [(PriorKind::Learned, true), (PriorKind::StandardNormal, false)] {
        let score = ScoreConfig { prior, ..ScoreConfig::default() };
        for prior in [ppo(score.clone(), &model).prior(), sac(score, &model).prior()] {
            let prior = prior.expect("a skill model");
            let draw = |obs: f32, how| prior.sample(&[obs; OBS], 1, how, &mut |_| 0.7).expect("a skill");
            assert_eq!(draw(-1.0, SkillDraw::Sample) != draw(1.0, SkillDraw::Sample), sees);
            assert_eq!(draw(1.0, SkillDraw::Mean) != [0.0, 0.0], sees, "a standard normal has mean 0");
            assert_ne!(draw(1.0, SkillDraw::Mean), draw(1.0, SkillDraw::Sample));
        }
    }
}

#[test]
fn skills_are_held_and_drawn_as_they_say() {
    let model = model(1);
    for (skill_interval, skill_draw) in [(3, SkillDraw::Mean), (11, SkillDraw::Sample)] {
        let score = ScoreConfig { skill_interval, skill_draw, ..ScoreConfig::default() };
        for source in [ppo(score.clone(), &model).skills(), sac(score, &model).skills()] {
            let source = source.expect("a skill model");
            assert_eq!((source.skill_interval, source.draw), (skill_interval, skill_draw));
        }
    }
}

#[test]
fn without_kl_nothing_holds_the_policy() {
    let model = model(1);
    let rollout = rollout(&model);
    let score = |kl| ScoreConfig { kl, kl_coef: 10.0, ..ScoreConfig::default() };
    let (free, freed) = two_updates(score(false), &model, &rollout);
    let (held, kept) = two_updates(score(true), &model, &rollout);
    assert_eq!((free[1].decoder_kl, free[1].confidence), (None, None));
    assert!(held[1].decoder_kl.is_some() && held[1].confidence.is_some());
    assert_ne!(probabilities(&freed, &rollout), probabilities(&kept, &rollout), "it is part of the loss");
    let (free, held) = (sac_update(score(false), &model, &rollout), sac_update(score(true), &model, &rollout));
    assert_eq!((free.decoder_kl, free.confidence), (None, None));
    assert!(held.decoder_kl.is_some() && held.confidence.is_some());
    assert_ne!(free.actor_grad_norm, held.actor_grad_norm, "it is part of the loss");
}

#[test]
fn the_divergence_is_that_of_its_direction() {
    let model = model(1);
    let rollout = rollout(&model);
    let decoder = probabilities(&model.policy(), &rollout);
    let mut measured = Vec::new();
    for kl_direction in [KlDirection::DecoderPolicy, KlDirection::PolicyDecoder] {
        let score = ScoreConfig { kl_direction, ..ScoreConfig::default() };
        let mut learner = ppo(score.clone(), &model);
        assert_eq!(learner.update(&rollout).expect("finite").decoder_kl, Some(0.0), "a copy, before the first step");
        let policy = probabilities(&learner.policy(), &rollout);
        let expected = match kl_direction {
            KlDirection::DecoderPolicy => kl(&decoder, &policy),
            KlDirection::PolicyDecoder => kl(&policy, &decoder),
        };
        let got = learner.update(&rollout).expect("finite").decoder_kl.expect("penalised");
        assert_near(f64::from(got), expected, "the mean over all rows, before the second step");
        measured.push((got, sac_update(score, &model, &rollout).decoder_kl.expect("penalised")));
    }
    let [(one, other_one), (two, other_two)] = measured[..] else { panic!("two directions") };
    assert!((one - two).abs() > 1e-3 * one, "the directions differ: {one} and {two}");
    assert_ne!(other_one, other_two);
}

#[test]
fn the_confidence_is_that_of_its_kind() {
    let model = model(1);
    let rollout = rollout(&model);
    let decoder = probabilities(&model.policy(), &rollout);
    let chosen = |row: usize| match rollout.actions.get(row) {
        Some(ActionValue::Discrete(choice)) => decoder[row][choice as usize],
        other => panic!("a choice, not {other:?}"),
    };
    let largest = |row: usize| decoder[row].iter().copied().fold(0.0, f64::max);
    let by_ppo = |confidence| {
        let score = ScoreConfig { confidence, ..ScoreConfig::default() };
        f64::from(two_updates(score, &model, &rollout).0[0].confidence.expect("penalised"))
    };
    let (rows, by_policy) = (rollout.rows(), by_ppo(ConfidenceKind::PolicyAction));
    assert_eq!(by_ppo(ConfidenceKind::Off), 1.0);
    assert_near(by_policy, mean((0..rows).map(chosen)), "p(a)");
    assert_near(by_ppo(ConfidenceKind::Density), by_policy, "the same where actions are discrete");
    let bounded = by_ppo(ConfidenceKind::BoundedDensity);
    assert_near(bounded, mean((0..rows).map(|row| chosen(row) / largest(row))), "p(a) / max p");
    let own = by_ppo(ConfidenceKind::OwnSample);
    assert!((0.3..1.0).contains(&own) && own != by_policy, "p of the decoder's own choices: {own}, {by_policy}");

    // SAC draws the same rows from its buffer each time.
    let by_sac = |confidence| {
        let score = ScoreConfig { confidence, ..ScoreConfig::default() };
        sac_update(score, &model, &rollout).confidence.expect("penalised")
    };
    let [by_policy, bounded, off] =
        [ConfidenceKind::PolicyAction, ConfidenceKind::BoundedDensity, ConfidenceKind::Off].map(by_sac);
    assert!(by_policy < bounded && bounded < off && off == 1.0, "{by_policy}, {bounded}, {off}");
    assert_ne!(by_sac(ConfidenceKind::OwnSample), by_policy);
}

#[test]
fn the_released_penalty_for_coinrun_is_a_sum_over_rows_of_weighted_divergences() {
    let model = model(1);
    let rollout = rollout(&model);
    let (penalty, kl_coef) = (PenaltyForm::LegacyCoinrun, 5.0 / rollout.rows() as f64);
    let legacy = ScoreConfig { penalty, kl_coef, ..ScoreConfig::default() };
    let (kl_direction, confidence) = (KlDirection::PolicyDecoder, ConfidenceKind::PolicyAction);
    let same = ScoreConfig { kl_direction, confidence, kl_coef: 5.0, ..ScoreConfig::default() };
    let after = |score: &ScoreConfig| {
        let (metrics, policy) = two_updates(score.clone(), &model, &rollout);
        (metrics[1].confidence.expect("penalised"), probabilities(&policy, &rollout).concat())
    };
    let ((weight, sum), (same_weight, mean)) = (after(&legacy), after(&same));
    assert_eq!(weight, same_weight);
    for (sum, mean) in sum.iter().zip(&mean) {
        assert!((sum - mean).abs() < 1e-3, "{sum} and {mean}");
    }
    let (_, other) = after(&ScoreConfig { kl_coef, ..same });
    assert!(sum.iter().zip(&other).any(|(sum, other)| (sum - other).abs() > 1e-3), "a mean of that weight is less");
}

#[test]
fn switches_that_do_not_go_together_are_refused() {
    let model = model(1);
    let base = ScoreConfig::default;
    let refused = |config: PpoConfig, score| {
        let error = PpoLearner::with_skill(config, score, &model, 1, DeviceKind::Flex).expect_err("it cannot work");
        assert!(matches!(error, LearnError::Config(_) | LearnError::Setting(_)), "{error:?}");
        error.to_string()
    };
    let text = refused(corridor::config(), ScoreConfig { penalty: PenaltyForm::LegacyD4rl, ..base() });
    assert!(text.contains("LegacyD4rl is for continuous actions"), "{text}");
    let text = refused(corridor::config(), ScoreConfig { condition: false, ..base() });
    assert!(text.contains("`score.init_from_decoder` needs `score.condition`"), "{text}");
    let text = refused(PpoConfig { norm_obs: true, ..corridor::config() }, base());
    assert!(text.contains("norm_obs"), "{text}");
    let bad = SacConfig { norm_obs: true, ..crate::sac::config() };
    let error = SacLearner::with_skill(bad, base(), &model, 1, DeviceKind::Flex).expect_err("raw observations");
    assert!(error.to_string().contains("norm_obs"), "{error}");
}

/// Returns the heads of each policy after this many updates.
fn heads(learner: &PpoLearner, rollout: &Rollout) -> (Vec<f32>, Vec<f32>) {
    let output = learner.policy().forward(&rollout.z, &rollout.obs, rollout.rows()).expect("finite");
    (output.head, output.values)
}

#[test]
fn while_the_critic_warms_up_the_policy_stays_where_it_is() {
    let model = model(1);
    let rollout = rollout(&model);
    let config = PpoConfig { critic_warmup: 2, weight_decay: 10.0, ..corridor::config() };
    let mut learner =
        PpoLearner::with_skill(config, ScoreConfig::default(), &model, 1, DeviceKind::Flex).expect("good");
    let (start, opinion) = heads(&learner, &rollout);
    for _ in 0..2 {
        let metrics = learner.update(&rollout).expect("finite");
        assert_eq!(metrics.decoder_kl, Some(0.0));
    }
    let (head, values) = heads(&learner, &rollout);
    assert!(head == start && values != opinion, "only the critic learns");
    learner.update(&rollout).expect("finite");
    assert_ne!(heads(&learner, &rollout).0, start, "and then both do");
}

#[test]
fn a_policy_that_has_waited_for_the_critic_takes_no_longer_steps_for_it() {
    let model = model(1);
    let rollout = rollout(&model);
    // The length of the policy's first step. Nothing is clipped, since a trained critic has smaller gradients.
    // Rewards are not normalised, since their scale changes.
    let plain = PpoConfig { max_grad_norm: 1e9, adam_eps: 1e-12, norm_reward: false, ..corridor::config() };
    let moved = |critic_warmup| {
        let config = PpoConfig { critic_warmup, minibatches: 1, ..plain.clone() };
        let mut learner =
            PpoLearner::with_skill(config, ScoreConfig::default(), &model, 1, DeviceKind::Flex).expect("good");
        for _ in 0..critic_warmup {
            learner.update(&rollout).expect("finite");
        }
        let (start, _) = heads(&learner, &rollout);
        learner.update(&rollout).expect("finite");
        let (head, _) = heads(&learner, &rollout);
        start.iter().zip(&head).map(|(from, to)| (to - from).abs()).sum::<f32>()
    };
    let (at_once, later) = (moved(0), moved(100));
    assert!(later < 1.3 * at_once, "{later} after a warm-up, {at_once} without");
}

#[test]
fn the_penalty_goes_where_it_is_sent() {
    let model = model(1);
    let rollout = rollout(&model);
    // After two updates of two: in the second the weight is half way to the end.
    let after = |kl_coef, kl_coef_end| {
        let config = PpoConfig { total_updates: Some(2), epochs: 1, minibatches: 1, lr: 0.05, ..corridor::config() };
        let score = ScoreConfig { kl_coef, kl_coef_end, ..ScoreConfig::default() };
        let mut learner = PpoLearner::with_skill(config, score, &model, 1, DeviceKind::Flex).expect("good");
        let of_decoder = [0, 1, 2].map(|_| learner.update(&rollout).expect("finite").decoder_kl.expect("penalised"));
        of_decoder[2]
    };
    let (kept, freed) = (after(10.0, None), after(10.0, Some(0.0)));
    assert!(freed > kept, "{freed} is further from the decoder than {kept}");
    assert_eq!(after(10.0, Some(10.0)), kept);
    let bad = ScoreConfig { kl_coef_end: Some(-1.0), ..ScoreConfig::default() };
    assert!(bad.validate().expect_err("negative").to_string().contains("kl_coef_end"));
}

#[test]
fn weights_decay_if_they_shall() {
    let model = model(1);
    let rollout = rollout(&model);
    let after = |weight_decay| {
        let config = PpoConfig { weight_decay, lr: 1e-6, ..corridor::config() };
        let score = ScoreConfig::default();
        let mut learner = PpoLearner::with_skill(config, score, &model, 1, DeviceKind::Flex).expect("good");
        learner.update(&rollout).expect("finite");
        heads(&learner, &rollout).1.iter().map(|x| x.abs()).sum::<f32>()
    };
    let (plain, decayed) = (after(0.0), after(1e5));
    assert!(decayed < 0.9 * plain, "{decayed} of {plain}");
    let bad = PpoConfig { weight_decay: -1.0, ..PpoConfig::default() };
    assert!(bad.validate().expect_err("negative").to_string().contains("weight_decay"));
}
