//! The parts of a training run: epochs of skills, the forward pass of a tick, and updates from a rollout.

use std::cell::{LazyCell, RefCell};
use std::ops::ControlFlow;

use criterion::Criterion;
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, Learner, PolicySpec, PpoConfig, PpoLearner, Rollout, ScoreConfig,
    SkillConfig, SkillModel, SkillTrainer, nn::CnnKind, rng::ChaCha8Rng,
};

use crate::data::{CHOICES, DEVICE, IMAGE, choices, lived, normals, rng, seen, tiles};

/// Width of CoinRun's observations.
const OBS: usize = 563;
const ENVS: usize = 64;
const SPACE: ActionSpace = ActionSpace::Discrete(CHOICES);

fn trainer(episodes: usize) -> SkillTrainer {
    let (mut rng, steps) = (rng("demos"), 500);
    let episodes = (0..episodes).map(|_| DatasetEpisode {
        observations: tiles(steps * OBS, &mut rng).into(),
        actions: Actions::Discrete(choices(steps, &mut rng)),
    });
    let dataset = Dataset::new(OBS, SPACE, episodes.collect()).expect("fits");
    SkillTrainer::new(SkillConfig::default(), dataset, 1, DEVICE).expect("fits")
}

/// One epoch over 10,000 steps of demonstrations.
pub fn skill_epoch(criterion: &mut Criterion) {
    let made = LazyCell::new(|| RefCell::new(trainer(20)));
    criterion.bench_function("epoch/skills/10000", |bencher| {
        let trainer = &mut *made.borrow_mut();
        bencher.iter(|| trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("learns"));
    });
}

/// SCORE-PPO on vectors, 64 arenas, 256 steps.
pub fn vectors(criterion: &mut Criterion) {
    cases(criterion, "score-ppo/vector", 256, OBS, || {
        let model = trainer(1).into_model();
        let score = ScoreConfig::default();
        let learner = PpoLearner::with_skill(PpoConfig::default(), score, &model, 1, DEVICE).expect("fits");
        let obs = tiles(ENVS * 256 * OBS, &mut rng("rollout"));
        let rollout = Rollout { obs: obs.into(), ..Rollout::new(ENVS, OBS, learner.rollout_latent(), &SPACE) };
        (learner, rollout)
    });
}

/// PPO and SCORE-PPO on images, 64 arenas, 32 steps.
pub fn images(criterion: &mut Criterion) {
    for (name, cnn) in [("nature", CnnKind::Nature { feature: 256 }), ("impala", CnnKind::default())] {
        let config = PpoConfig { cnn: cnn.clone(), ..PpoConfig::default() };
        let spec = PolicySpec { obs: IMAGE.into(), latent: 0, action_space: SPACE };
        let ppo = || PpoLearner::new(config.clone(), spec, 1, DEVICE).expect("fits");
        let score = || {
            let (config, skills) = (config.clone(), image_skills(cnn.clone()));
            PpoLearner::with_skill(config, ScoreConfig::default(), &skills, 1, DEVICE).expect("fits")
        };
        let algorithms: [(&str, &dyn Fn() -> PpoLearner); 2] = [("ppo", &ppo), ("score-ppo", &score)];
        for (algorithm, learner) in algorithms {
            cases(criterion, &format!("{algorithm}/{name}"), 32, IMAGE.numbers(), || {
                let (learner, obs) = (learner(), seen(ENVS * 32, &mut rng("rollout")));
                let rollout = Rollout { obs, ..Rollout::new(ENVS, IMAGE, learner.rollout_latent(), &SPACE) };
                (learner, rollout)
            });
        }
    }
}

fn image_skills(cnn: CnnKind) -> SkillModel {
    let episode = DatasetEpisode { observations: seen(10, &mut rng("demo")), actions: Actions::Discrete(vec![0; 10]) };
    let dataset = Dataset::new(IMAGE, SPACE, vec![episode]).expect("fits");
    let config = SkillConfig { cnn, ..SkillConfig::default() };
    SkillTrainer::new(config, dataset, 1, DEVICE).expect("fits").into_model()
}

/// Measures the forward pass of one tick, and the update from a rollout of this many. An observation has `width`
/// numbers. The data are made when the first of them runs.
fn cases(criterion: &mut Criterion, name: &str, steps: usize, width: usize, make: impl Fn() -> (PpoLearner, Rollout)) {
    let made = LazyCell::new(|| {
        let (learner, rollout) = make();
        let (rollout, mut rng) = (Rollout { steps, ..rollout }, rng("cases"));
        let rollout = acted(rollout, learner.rollout_latent(), &mut rng);
        RefCell::new((learner, lived(rollout, ENVS, &mut rng)))
    });
    criterion.bench_function(&format!("forward/{name}/{ENVS}"), |bencher| {
        let (learner, rollout) = &*made.borrow();
        let (policy, z) = (learner.policy(), &rollout.z[..ENVS * learner.rollout_latent()]);
        bencher.iter(|| policy.forward(z, rollout.obs.rows(0..ENVS, width), ENVS).expect("fits"));
    });
    criterion.bench_function(&format!("update/{name}/{}", ENVS * steps), |bencher| {
        let (learner, rollout) = &mut *made.borrow_mut();
        bencher.iter(|| learner.update(rollout).expect("learns"));
    });
}

/// Returns `rollout` with skills and actions.
fn acted(rollout: Rollout, latent: usize, rng: &mut ChaCha8Rng) -> Rollout {
    let rows = ENVS * rollout.steps;
    Rollout {
        z: normals(rows * latent, rng),
        actions: Actions::Discrete(choices(rows, rng)),
        log_probs: vec![-libm::logf(CHOICES as f32); rows],
        values: vec![0.0; rows],
        ..rollout
    }
}
