//! What a training run consists of: epochs of skills, the forward pass of a tick, and updates from a rollout.

use std::ops::ControlFlow;

use criterion::Criterion;
use playbot_learner::{
    ActionSpace, Actions, Dataset, DemoEpisode, Learner, PolicySpec, PpoConfig, PpoLearner, Rollout, ScoreConfig,
    SkillConfig, SkillModel, SkillTrainer, nn::CnnKind,
};

use crate::data::{CHOICES, DEVICE, IMAGE, choices, lived, normals, rng, seen, tiles};

/// Numbers that CoinRun's agents see.
const OBS: usize = 563;
const ENVS: usize = 64;
const SPACE: ActionSpace = ActionSpace::Discrete(CHOICES);

fn trainer(episodes: usize) -> SkillTrainer {
    let (mut rng, steps) = (rng("demos"), 500);
    let episodes = (0..episodes).map(|_| DemoEpisode {
        observations: tiles(steps * OBS, &mut rng).into(),
        actions: Actions::Discrete(choices(steps, &mut rng)),
    });
    let dataset = Dataset::new(OBS, SPACE, episodes.collect()).expect("fits");
    SkillTrainer::new(SkillConfig::default(), dataset, 1, DEVICE).expect("fits")
}

/// One epoch over 10,000 steps of demonstrations.
pub fn skill_epoch(criterion: &mut Criterion) {
    let mut trainer = trainer(20);
    criterion.bench_function("epoch/skills/10000", |bencher| {
        bencher.iter(|| trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("learns"));
    });
}

/// SCORE-PPO on vectors, 64 arenas, 256 steps.
pub fn vectors(criterion: &mut Criterion) {
    let model = trainer(1).into_model();
    let (config, steps) = (PpoConfig::default(), 256);
    let learner = PpoLearner::with_skill(config, ScoreConfig::default(), &model, 1, DEVICE).expect("fits");
    let mut rng = rng("rollout");
    let observations = tiles(ENVS * steps * OBS, &mut rng);
    let rollout = Rollout { obs: observations.into(), ..Rollout::new(ENVS, OBS, learner.rollout_latent(), &SPACE) };
    cases(criterion, "score-ppo/vector", learner, rollout, steps, OBS);
}

/// PPO and SCORE-PPO on images, 64 arenas, 32 steps.
pub fn images(criterion: &mut Criterion) {
    for (name, cnn) in [("nature", CnnKind::Nature { feature: 256 }), ("impala", CnnKind::default())] {
        let config = PpoConfig { cnn: cnn.clone(), ..PpoConfig::default() };
        let spec = PolicySpec { obs: IMAGE.into(), latent: 0, action_space: SPACE };
        let ppo = PpoLearner::new(config.clone(), spec, 1, DEVICE).expect("fits");
        let score =
            PpoLearner::with_skill(config, ScoreConfig::default(), &image_skills(cnn), 1, DEVICE).expect("fits");
        for (algorithm, learner) in [("ppo", ppo), ("score-ppo", score)] {
            let (mut rng, steps) = (rng("rollout"), 32);
            let obs = seen(ENVS * steps, &mut rng);
            let rollout = Rollout { obs, ..Rollout::new(ENVS, IMAGE, learner.rollout_latent(), &SPACE) };
            cases(criterion, &format!("{algorithm}/{name}"), learner, rollout, steps, IMAGE.numbers());
        }
    }
}

fn image_skills(cnn: CnnKind) -> SkillModel {
    let episode = DemoEpisode { observations: seen(10, &mut rng("demo")), actions: Actions::Discrete(vec![0; 10]) };
    let dataset = Dataset::new(IMAGE, SPACE, vec![episode]).expect("fits");
    let config = SkillConfig { cnn, ..SkillConfig::default() };
    SkillTrainer::new(config, dataset, 1, DEVICE).expect("fits").into_model()
}

/// The forward pass of one tick, and the update from what was seen in so many. An observation has `width` numbers.
fn cases(criterion: &mut Criterion, name: &str, mut learner: PpoLearner, rollout: Rollout, steps: usize, width: usize) {
    let mut rng = rng("cases");
    let (rows, latent) = (ENVS * steps, learner.rollout_latent());
    let rollout = Rollout {
        steps,
        z: normals(rows * latent, &mut rng),
        actions: Actions::Discrete(choices(rows, &mut rng)),
        log_probs: vec![-(CHOICES as f32).ln(); rows],
        values: vec![0.0; rows],
        ..rollout
    };
    let rollout = lived(rollout, ENVS, &mut rng);
    let (policy, z) = (learner.policy(), &rollout.z[..ENVS * latent]);
    criterion.bench_function(&format!("forward/{name}/{ENVS}"), |bencher| {
        bencher.iter(|| policy.forward(z, rollout.obs.rows(0..ENVS, width), ENVS).expect("fits"));
    });
    criterion.bench_function(&format!("update/{name}/{rows}"), |bencher| {
        bencher.iter(|| learner.update(&rollout).expect("learns"));
    });
}
