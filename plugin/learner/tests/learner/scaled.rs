//! Observations whose numbers differ in scale, seen through the skill model's frozen normaliser by everything that is
//! tied to it.

use crate::files::{Contents, after, describe};
use crate::toy::Plays;
use playbot_learner::rng::{Streams, normal, unit};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DemoEpisode, DeviceKind, EndStates, FileError, ImageShape, LearnError, ObsKind,
    Policy, PolicyCard, PolicyFile, PpoConfig, PpoLearner, Prior, Rollout, SacConfig, SacLearner, ScoreConfig,
    SkillConfig, SkillDraw, SkillMetrics, SkillModel, SkillSource, SkillTrainer, StdKind,
};
use std::ops::ControlFlow;
use std::path::Path;

const OBS: usize = 4;
const PLANE: ActionSpace = ActionSpace::Continuous(2);
const CHOICE: ActionSpace = ActionSpace::Discrete(2);
/// Deviation of the noise on the players' continuous actions.
const NOISE: f32 = 0.1;

/// Observations of players in a hall: a place up to 50 m, an angle around 0.1, and a number that never changes.
fn hall(n: usize, stream: u64) -> Vec<f32> {
    let mut rng = Streams::new(3).stream("hall", stream);
    let mut row = || [50.0 * unit(&mut rng) as f32, 50.0 * unit(&mut rng) as f32, 0.1 * normal(&mut rng), 1.25];
    (0..n).flat_map(|_| row()).collect()
}

/// What the players mean to do: turn against the angle, and move to the middle of the hall.
fn meant(row: &[f32]) -> [f32; 2] {
    [-6.0 * row[2], 1.0 - row[0] / 25.0]
}

/// Their recordings: vectors with noise, or the sign of the turn.
fn demos(space: ActionSpace) -> Dataset {
    let episodes = (0..60).map(|i| {
        let mut rng = Streams::new(4).stream("noise", i);
        let observations = hall(20, i);
        let wanted = observations.chunks_exact(OBS).map(meant);
        let actions = match space {
            ActionSpace::Discrete(_) => Actions::Discrete(wanted.map(|a| u32::from(a[0] > 0.0)).collect()),
            ActionSpace::Continuous(dim) => {
                let values = wanted.flatten().map(|a| a + NOISE * normal(&mut rng)).collect();
                Actions::Continuous { dim, values }
            }
        };
        DemoEpisode { observations: observations.into(), actions }
    });
    Dataset::new(OBS, space, episodes.collect()).expect("consistent")
}

fn config(norm_obs: bool) -> SkillConfig {
    SkillConfig { norm_obs, ..crate::skill::config() }
}

fn trainer(config: SkillConfig, space: ActionSpace) -> SkillTrainer {
    SkillTrainer::new(config, demos(space), 1, DeviceKind::Flex).expect("windows fit")
}

/// The metrics of the last of some epochs.
fn train(trainer: &mut SkillTrainer, epochs: usize) -> SkillMetrics {
    let epochs = (0..epochs).map(|_| trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite"));
    epochs.last().flatten().expect("not stopped")
}

fn model(space: ActionSpace) -> SkillModel {
    let mut trainer = trainer(config(true), space);
    train(&mut trainer, 3);
    trainer.into_model()
}

fn skills(model: &SkillModel, obs: &[f32]) -> Vec<f32> {
    model.prior().sample(obs, obs.len() / OBS, SkillDraw::Mean, &mut |_| 0.0).expect("finite")
}

#[test]
fn normalised_numbers_are_learned_from_faster() {
    for decoder_std in [StdKind::Vector, StdKind::State] {
        let last = |norm_obs| {
            let mut trainer = trainer(SkillConfig { decoder_std, ..config(norm_obs) }, PLANE);
            (train(&mut trainer, 20).nll, trainer.into_model())
        };
        let ((raw, _), (normalised, model)) = (last(false), last(true));
        // Five steps of two dimensions; -8.8 would leave nothing but the noise.
        assert!(normalised < raw - 2.5, "{decoder_std:?}: {normalised} normalised, {raw} raw");
        // In use, as in training, they are given raw.
        let obs = hall(50, 1000);
        let output = model.policy().forward(&skills(&model, &obs), &obs, 50).expect("finite");
        let wanted: Vec<f32> = obs.chunks_exact(OBS).flat_map(meant).collect();
        let error = output.head.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).sum::<f32>() / 100.0;
        assert!(error < 0.15, "{decoder_std:?}: mean error {error}");
    }
}

#[test]
fn a_value_that_no_demonstration_holds_stays_small() {
    let model = model(PLANE);
    let mut seen = Vec::new();
    model.obs_stats().expect("normalised").normalize_into(&[1e9, -1e9, 30.0, 3.25], &mut seen);
    assert_eq!(seen[..3], [10.0, -10.0, 10.0]);
    assert!((seen[3] - 2.0).abs() < 1e-5, "a constant is centred only: {}", seen[3]);
    let bare = trainer(config(false), PLANE).into_model();
    assert!(bare.obs_stats().is_none() && !bare.policy().normalises() && model.policy().normalises());
}

fn score(init_from_decoder: bool) -> ScoreConfig {
    ScoreConfig { init_from_decoder, ..ScoreConfig::default() }
}

fn ppo(score: ScoreConfig, model: &SkillModel) -> PpoLearner {
    let config = PpoConfig { lr: 1e-3, minibatches: 2, hidden: vec![32, 32], ..PpoConfig::default() };
    PpoLearner::with_skill(config, score, model, 1, DeviceKind::Flex).expect("good settings")
}

fn sac_config() -> SacConfig {
    SacConfig { learning_starts: 1, batch: 32, hidden: vec![32, 32], ..SacConfig::default() }
}

fn sac(score: ScoreConfig, model: &SkillModel) -> SacLearner {
    SacLearner::with_skill(sac_config(), score, model, 1, DeviceKind::Flex).expect("good settings")
}

#[test]
fn the_first_policy_is_the_decoder_exactly() {
    for decoder_std in [StdKind::Vector, StdKind::State] {
        let mut trainer = trainer(SkillConfig { decoder_std, ..config(true) }, PLANE);
        train(&mut trainer, 2);
        let model = trainer.into_model();
        for n in [1, 2, 33] {
            let obs = hall(n, 50);
            let z = skills(&model, &obs);
            let (tied, free) = (ppo(score(true), &model), ppo(score(false), &model));
            assert_eq!(tied.initial_kl(&z, &obs, n).expect("a copy"), Some(0.0));
            assert!(free.initial_kl(&z, &obs, n).expect("no copy") > Some(0.0));
        }
    }
    let model = model(CHOICE);
    let obs = hall(33, 50);
    let tied = sac(score(true), &model);
    assert_eq!(tied.initial_kl(&skills(&model, &obs), &obs, 33).expect("a copy"), Some(0.0));
}

/// A rollout of states that have nothing to do with one another, where turning right is rewarded.
fn rollout(learner: &impl Plays, space: ActionSpace, number: u64) -> Rollout {
    let (steps, envs) = (8, 4);
    let rows = steps * envs;
    let (prior, obs) = (learner.prior().expect("skills"), hall(rows, 100 + number));
    let mut rng = Streams::new(2).stream("rollout", number);
    let z = prior.sample(&obs, rows, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite");
    let output = learner.policy().forward(&z, &obs, rows).expect("finite");
    let (mut actions, mut log_probs) = (Actions::empty(&space), Vec::new());
    for row in 0..rows {
        let (action, log_prob) = output.sample(row, &mut rng);
        actions.push(&action).expect("of the space");
        log_probs.push(log_prob);
    }
    let rewards = match &actions {
        Actions::Discrete(choices) => choices.iter().map(|&a| a as f32).collect(),
        Actions::Continuous { values, .. } => values.chunks_exact(2).map(|a| a[0]).collect(),
    };
    let next_z = z[..envs * prior.latent()].to_vec();
    let ends = EndStates { next_obs: hall(envs, 200 + number).into(), next_z, ..EndStates::new(&ObsKind::Vector(OBS)) };
    Rollout {
        steps,
        obs: obs.into(),
        z,
        actions,
        log_probs,
        values: output.values,
        rewards,
        terminated: vec![false; rows],
        truncated: vec![false; rows],
        final_values: vec![0.0; rows],
        next_values: vec![0.0; envs],
        ends,
        ..Rollout::new(envs, OBS, prior.latent(), &space)
    }
}

/// A learner goes on bit for bit from the file that `save` writes; `update` reports something of an update.
fn goes_on<L: Plays, M: PartialEq + std::fmt::Debug>(
    mut learner: L,
    space: ActionSpace,
    update: impl Fn(&mut L, &Rollout) -> M,
    save: impl Fn(&L, &Path),
    load: impl Fn(&Path) -> Result<L, FileError>,
) {
    let folder = tempfile::tempdir().expect("a folder");
    let [path, first, second] = ["checkpoint", "a", "b"].map(|name| folder.path().join(name));
    for number in 0..2 {
        let rollout = rollout(&learner, space, number);
        update(&mut learner, &rollout);
    }
    save(&learner, &path);
    let mut loaded = load(&path).expect("read");
    for number in 2..4 {
        let mine = rollout(&learner, space, number);
        assert_eq!(mine, rollout(&loaded, space, number), "they play alike");
        assert_eq!(update(&mut learner, &mine), update(&mut loaded, &mine));
    }
    save(&learner, &first);
    save(&loaded, &second);
    assert!(std::fs::read(&first).expect("readable") == std::fs::read(&second).expect("readable"), "whole states");
    for name in ["skill.obs_norm.mean", "skill.obs_norm.inv_std"] {
        let mut contents = Contents::read(&path);
        contents.tensors.remove(name);
        contents.write(&second);
        let error = load(&second).map(drop).expect_err("not whole");
        assert!(matches!(&error, FileError::MissingTensor { name: missing, .. } if missing == name), "{error}");
    }
}

#[test]
fn loaded_learners_go_on_bit_for_bit() {
    let device = DeviceKind::Flex;
    for (space, tie) in [(PLANE, score(true)), (PLANE, score(false)), (CHOICE, score(true))] {
        goes_on(
            ppo(tie, &model(space)),
            space,
            |learner, rollout| learner.update(rollout).expect("finite"),
            |learner, path| learner.save(path).expect("written"),
            |path| PpoLearner::load(path, device),
        );
    }
    for (space, tie) in [(PLANE, score(false)), (CHOICE, score(true))] {
        goes_on(
            sac(tie, &model(space)),
            space,
            |learner, rollout| learner.update(rollout).expect("finite"),
            |learner, path| learner.save(path).expect("written"),
            |path| SacLearner::load(path, device),
        );
    }
}

#[test]
fn a_loaded_training_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let [path, first, second] = ["trainer", "a", "b"].map(|name| folder.path().join(name));
    let mut whole = trainer(config(true), PLANE);
    train(&mut whole, 1);
    whole.train_batch().expect("finite");
    whole.save(&path).expect("written");
    let mut loaded = SkillTrainer::load(&path, demos(PLANE), DeviceKind::Flex).expect("read");
    assert_eq!(train(&mut loaded, 2), train(&mut whole, 2));
    whole.save(&first).expect("written");
    loaded.save(&second).expect("written");
    assert!(std::fs::read(&first).expect("readable") == std::fs::read(&second).expect("readable"), "whole states");
}

#[test]
fn a_model_comes_back_from_its_file_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skill");
    let model = model(PLANE);
    model.save(&path).expect("written");
    let back = SkillModel::load(&path, DeviceKind::Flex).expect("read");
    assert!(back.config().norm_obs);
    assert_eq!(back.obs_stats(), model.obs_stats());
    let obs = hall(5, 60);
    let z = skills(&model, &obs);
    assert_eq!(skills(&back, &obs), z);
    assert_eq!(
        back.policy().forward(&z, &obs, 5).expect("finite"),
        model.policy().forward(&z, &obs, 5).expect("finite")
    );
    let load = |path: &Path| SkillModel::load(path, DeviceKind::Flex).map(drop);
    let error = after(&path, load, |c| describe(c, "/skill/config/norm_obs", false.into()));
    assert!(matches!(&error, FileError::ExtraTensor { name, .. } if name.starts_with("obs_norm")), "{error}");
    let error = after(&path, load, |c| {
        c.tensors.get_mut("obs_norm.inv_std").expect("there").2[8..16].copy_from_slice(&(-0.5f64).to_le_bytes());
    });
    assert!(error.to_string().contains("`obs_norm` cannot normalise number 1: -0.5"), "{error}");
    // A file from before there was the key.
    let old = folder.path().join("old");
    trainer(config(false), PLANE).into_model().save(&old).expect("written");
    let mut contents = Contents::read(&old);
    let text = contents.description.replacen(r#","norm_obs":false"#, "", 1);
    assert_ne!(text, contents.description);
    contents.description = text;
    contents.write(&old);
    assert!(!SkillModel::load(&old, DeviceKind::Flex).expect("an older file").config().norm_obs);
}

#[test]
fn a_policy_file_needs_no_skill_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy");
    let (plane, choice) = (model(PLANE), model(CHOICE));
    let (mut learner, actor) = (ppo(score(true), &plane), sac(score(true), &choice));
    learner.update(&rollout(&learner, PLANE, 0)).expect("finite");
    let cloning = (plane.policy(), learner.skills());
    for (policy, skills) in [(learner.policy(), learner.skills()), (actor.policy(), actor.skills()), cloning] {
        let file = PolicyFile { card: PolicyCard::default(), policy, skills };
        let (obs, z) = (hall(4, 70), vec![0.25; 8]);
        file.save(&path, &obs, &z, 4).expect("written");
        let back = PolicyFile::load(&path, DeviceKind::Flex).expect("read");
        let (ours, theirs) = (file.skills.expect("skills"), back.skills.expect("skills"));
        assert!(back.policy.normalises() && theirs.decoder.normalises());
        assert_eq!(
            back.policy.forward(&z, &obs, 4).expect("finite"),
            file.policy.forward(&z, &obs, 4).expect("finite")
        );
        let decoded = |decoder: &Policy| decoder.forward(&z, &obs, 4).expect("finite");
        assert_eq!(decoded(&theirs.decoder), decoded(&ours.decoder));
        let means = |prior: &Prior| prior.sample(&obs, 4, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
        assert_eq!(means(&theirs.prior), means(&ours.prior));
        let load = |path: &Path| PolicyFile::load(path, DeviceKind::Flex).map(drop);
        let error = after(&path, load, |c| drop(c.tensors.remove("skill.obs_norm.mean")));
        assert!(matches!(error, FileError::MissingTensor { .. }), "{error}");
    }
    let skills =
        SkillSource { prior: trainer(config(false), PLANE).into_model().prior(), ..learner.skills().expect("some") };
    let file = PolicyFile { card: PolicyCard::default(), policy: learner.policy(), skills: Some(skills) };
    let error = file.save(&path, &hall(4, 70), &[0.25; 8], 4).expect_err("two ways to see").to_string();
    assert!(error.contains("prior and decoder normalise observations in different ways"), "{error}");
}

#[test]
fn what_cannot_be_normalised_is_refused() {
    for init_from_decoder in [true, false] {
        let running = PpoConfig { norm_obs: true, ..PpoConfig::default() };
        let error = PpoLearner::with_skill(running, score(init_from_decoder), &model(PLANE), 1, DeviceKind::Flex);
        let error = error.expect_err("two normalisers");
        assert!(matches!(&error, LearnError::Config(text) if text.contains("same frozen normaliser")), "{error}");
        let running = SacConfig { norm_obs: true, ..sac_config() };
        let error = SacLearner::with_skill(running, score(init_from_decoder), &model(CHOICE), 1, DeviceKind::Flex);
        assert!(error.expect_err("two normalisers").to_string().contains("same frozen normaliser"));
    }
    let image = ImageShape { channels: 1, height: 12, width: 12 };
    let episode = DemoEpisode { observations: vec![0u8; 8 * 144].into(), actions: Actions::Discrete(vec![0; 8]) };
    let data = Dataset::new(ObsKind::Image(image), CHOICE, vec![episode]).expect("consistent");
    let error = SkillTrainer::new(config(true), data, 1, DeviceKind::Flex).expect_err("pixels");
    assert!(matches!(&error, LearnError::Config(text) if text.contains("norm_obs is for vectors")), "{error}");
}
