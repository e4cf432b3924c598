//! Continuous actions with Gaussian noise: their effect on the decoder, and the start of a copy of it.

use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    ActionSpace, Actions, ConfidenceKind, Dataset, DatasetEpisode, DeviceKind, LearnError, Learner, PpoConfig,
    PpoLearner, Rollout, ScoreConfig, SkillConfig, SkillDraw, SkillModel, SkillTrainer, StdKind,
};
use std::ops::ControlFlow;

const PLANE: ActionSpace = ActionSpace::Continuous(2);
/// Deviation of the demonstrators' noise in each dimension.
const NOISE: [f32; 2] = [0.2, 0.5];

/// Returns demonstrations that mean (x, -x / 2) with noise, in windows of the mazes' length.
fn demos() -> Dataset {
    let episodes = (0..60).map(|i| {
        let mut rng = Streams::new(6).stream("demo", i);
        let observations: Vec<f32> = (0..30).map(|_| normal(&mut rng)).collect();
        let mut noisy = |x: &f32| [x + NOISE[0] * normal(&mut rng), -0.5 * x + NOISE[1] * normal(&mut rng)];
        let values = observations.iter().flat_map(&mut noisy).collect();
        DatasetEpisode { observations: observations.into(), actions: Actions::Continuous { dim: 2, values } }
    });
    Dataset::new(1, PLANE, episodes.collect()).expect("consistent")
}

fn config(decoder_std: StdKind) -> SkillConfig {
    SkillConfig { window: 10, decoder_std, lr: 1e-2, beta: 1.0, ..crate::skill::config() }
}

fn model(decoder_std: StdKind) -> SkillModel {
    let mut trainer = SkillTrainer::new(config(decoder_std), demos(), 1, DeviceKind::Flex).expect("windows fit");
    for _ in 0..30 {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

#[test]
fn the_decoder_is_as_noisy_as_the_players_and_so_is_its_copy() {
    for decoder_std in [StdKind::Vector, StdKind::State] {
        let model = model(decoder_std);
        let n = 64;
        let mut rng = Streams::new(7).stream("probe", 0);
        let obs: Vec<f32> = (0..n).map(|_| normal(&mut rng)).collect();
        let z = model.prior().sample(&obs, n, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite");
        let decoded = model.policy().forward(&z, &obs, n).expect("finite");
        for (dim, noise) in NOISE.iter().enumerate() {
            let mean = decoded.log_std.iter().skip(dim).step_by(2).sum::<f32>() / n as f32;
            assert!((mean.exp() / noise - 1.0).abs() < 0.25, "{decoder_std:?}, dimension {dim}: σ = {}", mean.exp());
        }

        let ppo = PpoConfig { lr: 1e-7, epochs: 1, minibatches: 1, ..PpoConfig::default() };
        let score = ScoreConfig { confidence: ConfidenceKind::OwnSample, ..ScoreConfig::default() };
        let learner = PpoLearner::with_skill(ppo, score, &model, 1, DeviceKind::Flex);
        let mut learner = learner.expect("good settings");
        let played = learner.policy().forward(&z, &obs, n).expect("finite");
        assert_eq!((&played.head, &played.log_std), (&decoded.head, &decoded.log_std), "{decoder_std:?}");
        let (mut actions, mut log_probs) = (Actions::empty(&PLANE), Vec::new());
        for row in 0..n {
            let (action, log_prob) = played.sample(row, &mut rng);
            actions.push(&action).expect("of the plane");
            log_probs.push(log_prob);
        }
        let rollout = Rollout {
            steps: n,
            obs: obs.into(),
            z,
            actions,
            log_probs,
            values: played.values,
            rewards: (0..n).map(|_| normal(&mut rng)).collect(),
            terminated: vec![false; n],
            truncated: vec![false; n],
            final_values: vec![0.0; n],
            next_values: vec![0.0],
            ..Rollout::new(1, 1, 2, &PLANE)
        };
        let metrics = learner.update(&rollout).expect("finite");
        // Σ (ln σ + ½ ln 2πe), the mean over rows; the densities of the update are those of the draws.
        let entropy = played.log_std.iter().sum::<f32>() / n as f32 + 2.0 * 1.418_938_5;
        assert!((metrics.entropy - entropy).abs() < 1e-3, "{decoder_std:?}: {} of {entropy}", metrics.entropy);
        assert!(metrics.approx_kl.abs() < 1e-6 && metrics.clip_fraction == 0.0, "{metrics:?}");
        assert_eq!(metrics.decoder_kl, Some(0.0));
        // Around (1 + 1/2)^(-1) in every state.
        let alpha = metrics.confidence.expect("penalised");
        assert!((alpha - 1.0 / 1.5).abs() < 0.1, "{alpha}");
    }
}

#[test]
fn a_share_of_continuous_actions_cannot_have_been_replaced() {
    let config = SkillConfig { action_noise: 0.2, ..config(StdKind::Vector) };
    let error = SkillTrainer::new(config, demos(), 1, DeviceKind::Flex).expect_err("no share");
    assert!(matches!(&error, LearnError::Setting(error) if error.why.contains("must be 0 for continuous")), "{error}");
}
