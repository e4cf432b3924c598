//! SPiRL: a policy over skills that start as the prior, learned by PPO and by SAC.

use crate::field::{FAR, Field, RECALL, SPACE, WALK};
use crate::walkers::skills_of_directions;
use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    DeviceKind, LearnError, Learner, MemoryKind, PolicyFile, PolicyMetadata, PpoConfig, Prior, PriorKind, Rollout,
    SacConfig, ScoreConfig, SkillDraw, SkillModel, SpirlConfig, SpirlLearner, TimeLimit,
};
use std::sync::LazyLock;

/// Ticks for which one skill is used.
const SKILL_INTERVAL: usize = 4;

static MODEL: LazyLock<SkillModel> = LazyLock::new(skills_of_directions);

fn score() -> ScoreConfig {
    ScoreConfig { skill_interval: SKILL_INTERVAL, ..ScoreConfig::default() }
}

fn ppo_config() -> PpoConfig {
    PpoConfig {
        lr: 2e-3,
        num_steps: 64,
        minibatches: 4,
        epochs: 6,
        gamma: 0.98,
        hidden: vec![32],
        ..PpoConfig::default()
    }
}

fn ppo(config: SpirlConfig) -> SpirlLearner {
    SpirlLearner::ppo(config, ppo_config(), &score(), &MODEL, 1, DeviceKind::Flex).expect("good settings")
}

fn sac_config() -> SacConfig {
    SacConfig { updates_per_step: 1.0, num_steps: 32, learning_starts: 64, ..crate::point::sac_config() }
}

fn sac(config: SpirlConfig) -> SpirlLearner {
    SpirlLearner::sac(config, sac_config(), &ppo_config(), &score(), &MODEL, 1, DeviceKind::Flex)
        .expect("good settings")
}

/// Returns the metrics of the last of this many updates.
fn train(learner: &mut SpirlLearner, updates: usize, ticks: usize) -> Vec<(&'static str, f64)> {
    let mut walkers = Field::new(&WALK, 16, 1);
    let mut last = Vec::new();
    for _ in 0..updates {
        let rollout = walkers.rollout(learner, ticks);
        last = learner.learn(&rollout).expect("finite").scalars().collect();
    }
    last
}

fn number(scalars: &[(&'static str, f64)], tag: &str) -> f64 {
    scalars.iter().find(|(name, _)| *name == tag).unwrap_or_else(|| panic!("{tag} in {scalars:?}")).1
}

#[test]
fn skills_come_from_the_prior_at_first() {
    let obs: Vec<f32> = (0..12u8).map(|i| f32::from(i) * 0.1 - 0.5).collect();
    let draw = |prior: playbot_learner::Prior| {
        let mut rng = Streams::new(3).stream("z", 0);
        prior.sample(&obs, 3, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite")
    };
    for learner in [ppo(SpirlConfig::default()), sac(SpirlConfig::default())] {
        assert_eq!(learner.initial_kl(&[], (&obs).into(), 3).expect("a copy"), Some(0.0));
        assert_eq!(draw(learner.skills().expect("it has some").prior), draw(MODEL.prior()));
        assert_eq!((learner.rollout_latent(), learner.spec().action_space), (2, SPACE));
    }
}

#[test]
fn it_learns_which_skills_lead_to_the_goal() {
    let success = |learner: &SpirlLearner| Field::new(&WALK, 64, 77).success(learner, 120);
    let before = success(&ppo(SpirlConfig::default()));
    assert!(before < 0.4, "{before} by chance");
    let loose = SpirlConfig { target_kl: Some(3.0), ..SpirlConfig::default() };
    let mut by_ppo = ppo(loose.clone());
    train(&mut by_ppo, 40, 64);
    let mut by_sac = sac(loose);
    train(&mut by_sac, 40, 32);
    for learner in [by_ppo, by_sac] {
        let after = success(&learner);
        assert!(after > 0.8, "{after} after training");
    }
    let tight = SpirlConfig { kl_coef: 1e3, target_kl: None, learn_decoder: false };
    let mut held = ppo(tight);
    let last = train(&mut held, 20, 64);
    assert!(
        success(&held) < 0.4 && number(&last, "spirl/prior_kl") < 0.01,
        "who may not leave the prior learns nothing"
    );
}

/// Returns a learner whose policy over skills remembers the states in which it drew some.
fn remembering(memory: MemoryKind) -> SpirlLearner {
    let (config, ppo) = (SpirlConfig { target_kl: Some(3.0), ..SpirlConfig::default() }, ppo_config());
    let ppo = PpoConfig { memory, ..ppo };
    SpirlLearner::ppo(config, ppo, &score(), &MODEL, 1, DeviceKind::Flex).expect("good settings")
}

const GRU: MemoryKind = MemoryKind::Gru { hidden: 16, sequence: 8, burn_in: 0 };

#[test]
fn a_policy_over_skills_with_memory_goes_on_towards_a_goal_that_it_saw_once() {
    let success = |memory| {
        let mut learner = remembering(memory);
        let mut walkers = Field::new(&RECALL, 16, 1);
        for _ in 0..60 {
            learner.learn(&walkers.rollout(&learner, 64)).expect("finite");
        }
        Field::new(&RECALL, 64, 77).success(&learner, 120)
    };
    let (without, with) = (success(MemoryKind::None), success(GRU));
    assert!(with > 0.7 && with > without + 0.2, "{without} without memory, {with} with");
}

#[test]
fn a_memory_changes_nothing_at_first_and_goes_on_to_the_bit() {
    let obs: Vec<f32> = (0..12u8).map(|i| f32::from(i) * 0.1 - 0.5).collect();
    let learner = remembering(GRU);
    assert_eq!(learner.initial_kl(&[], (&obs).into(), 3).expect("a copy"), Some(0.0));
    let prior = learner.prior().expect("it has one");
    let width = prior.memory();
    let draw =
        |memory: &[f32]| prior.sample_remembering(&obs, memory, 3, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
    let ((first, once), (_, twice)) = (draw(&[]), draw(&draw(&[]).1));
    assert_eq!(first, MODEL.prior().sample(&obs, 3, SkillDraw::Mean, &mut |_| 0.0).expect("finite"));
    assert!(width > 0 && once.len() == 3 * width && once != twice);
    let short = prior.sample_remembering(&obs, &once[1..], 3, SkillDraw::Mean, &mut |_| 0.0);
    assert!(short.expect_err("a number is missing").to_string().contains("memories of the prior"));
    // A lone agent remembers as one among many.
    let alone = prior.sample_remembering(&obs[..4], &once[..width], 1, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
    assert_eq!(alone.1, twice[..width]);

    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    for memory in [GRU, MemoryKind::Stack { ticks: 3 }] {
        let mut learner = remembering(memory);
        train(&mut learner, 2, 32);
        learner.save(&path).expect("written");
        let mut loaded = SpirlLearner::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!(train(&mut learner, 2, 32), train(&mut loaded, 2, 32));
        let file =
            PolicyFile { metadata: PolicyMetadata::default(), policy: learner.policy(), skills: learner.skills() };
        file.save(&path, &obs, &[0.1; 6], 3).expect("written");
        let read = PolicyFile::load(&path, DeviceKind::Flex).expect("read").skills.expect("it has some").prior;
        let twice = |prior: &Prior| {
            let draw = |memory: &[f32]| {
                prior.sample_remembering(&obs, memory, 3, SkillDraw::Mean, &mut |_| 0.0).expect("finite")
            };
            draw(&draw(&[]).1)
        };
        assert_eq!(twice(&read), twice(&learner.prior().expect("it has one")));
    }
}

#[test]
fn the_price_is_tuned_for_the_divergence_that_is_wanted() {
    for target in [0.1, 0.5] {
        let config = SpirlConfig { target_kl: Some(target), ..SpirlConfig::default() };
        let last = train(&mut ppo(config.clone()), 60, 64);
        let kl = number(&last, "spirl/prior_kl");
        assert!((0.4 * target..2.5 * target).contains(&kl), "{kl} nats by PPO, {target} wanted");
        let kl = number(&train(&mut sac(config), 60, 32), "spirl/prior_kl");
        assert!((0.4 * target..2.5 * target).contains(&kl), "{kl} nats by SAC, {target} wanted");
    }
}

#[test]
fn the_price_waits_until_the_policy_moves() {
    let config = PpoConfig { critic_warmup: 3, ..ppo_config() };
    let mut learner = SpirlLearner::ppo(SpirlConfig::default(), config, &score(), &MODEL, 1, DeviceKind::Flex)
        .expect("good settings");
    train(&mut learner, 3, 64);
    assert_eq!(learner.kl_coef().expect("readable"), SpirlConfig::default().kl_coef);
    train(&mut learner, 1, 64);
    assert_ne!(learner.kl_coef().expect("readable"), SpirlConfig::default().kl_coef, "the first step is a short one");
}

#[test]
fn the_decoder_learns_only_if_it_shall() {
    let obs = [0.1, 0.2, 0.3, 0.4];
    let head = |learner: &SpirlLearner| learner.policy().forward(&[0.5, -0.5], &obs, 1).expect("finite").head;
    for learn_decoder in [false, true] {
        let mut learner = ppo(SpirlConfig { learn_decoder, ..SpirlConfig::default() });
        let before = head(&learner);
        let last = train(&mut learner, 2, 64);
        assert_eq!(head(&learner) != before, learn_decoder);
        assert_eq!(last.iter().any(|(tag, _)| *tag == "losses/policy_loss"), learn_decoder, "{last:?}");
    }
}

#[test]
fn a_restart_goes_on_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    for learn_decoder in [false, true] {
        let config = SpirlConfig { learn_decoder, ..SpirlConfig::default() };
        for mut learner in [ppo(config.clone()), sac(config.clone())] {
            train(&mut learner, 3, 32);
            learner.save(&path).expect("written");
            let mut loaded = SpirlLearner::load(&path, DeviceKind::Flex).expect("read");
            assert_eq!((loaded.updates(), loaded.config()), (3, &config));
            assert_eq!(train(&mut learner, 2, 32), train(&mut loaded, 2, 32));
            let bytes = |learner: &SpirlLearner| {
                learner.save(&path).expect("written");
                std::fs::read(&path).expect("readable")
            };
            assert_eq!(bytes(&learner), bytes(&loaded));
        }
    }
}

/// Returns a learner that is paid for nothing but what is new.
fn curious(spirl: SpirlConfig, seed: u64) -> SpirlLearner {
    let lone = r#"{"Rnd":{"extrinsic":0.0,"gamma":0.95}}"#;
    let curiosity = serde_json::from_str(lone).expect("the rest is default");
    let config = PpoConfig { curiosity, ..ppo_config() };
    SpirlLearner::ppo(spirl, config, &score(), &MODEL, seed, DeviceKind::Flex).expect("good settings")
}

#[test]
fn a_curious_policy_over_skills_predicts_what_it_has_seen_and_goes_on_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    for learn_decoder in [false, true] {
        let mut learner = curious(SpirlConfig { learn_decoder, ..SpirlConfig::default() }, 1);
        let first = number(&train(&mut learner, 1, 64), "curiosity/predictor_loss");
        let later = train(&mut learner, 30, 64);
        let last = number(&later, "curiosity/predictor_loss");
        assert!(0.0 < last && last < 0.5 * first, "the error falls from {first} to {last}");
        for tag in ["curiosity/intrinsic_reward", "losses/intrinsic_value_loss"] {
            assert!(number(&later, tag) > 0.0, "{tag}");
        }
        learner.save(&path).expect("written");
        let mut loaded = SpirlLearner::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!(train(&mut learner, 2, 32), train(&mut loaded, 2, 32));
        let bytes = |learner: &SpirlLearner| {
            learner.save(&path).expect("written");
            std::fs::read(&path).expect("readable")
        };
        assert_eq!(bytes(&learner), bytes(&loaded));
    }
}

#[test]
fn curiosity_leads_to_places_that_skills_by_chance_do_not_reach() {
    let reached = |learns: bool, seed: u64| {
        let mut learner = curious(SpirlConfig { target_kl: Some(3.0), ..SpirlConfig::default() }, seed);
        let mut far = Field::new(&FAR, 16, seed);
        for _ in 0..80 {
            let rollout = far.rollout(&learner, 64);
            if learns {
                learner.learn(&rollout).expect("finite");
            }
        }
        far.reached.iter().filter(|reached| **reached).count()
    };
    let of_seeds = |learns| (1..=3).map(|seed| reached(learns, seed)).collect::<Vec<_>>();
    let (by_chance, curious) = (of_seeds(false), of_seeds(true));
    assert!(
        by_chance.iter().all(|count| *count < 5) && curious.iter().all(|count| *count > 40),
        "{by_chance:?} {curious:?}"
    );
}

#[test]
fn what_cannot_work_is_refused() {
    let refused = |score: ScoreConfig, ppo: PpoConfig| {
        let learner = SpirlLearner::ppo(SpirlConfig::default(), ppo, &score, &MODEL, 1, DeviceKind::Flex);
        learner.expect_err("cannot work").to_string()
    };
    assert!(refused(ScoreConfig { skill_draw: SkillDraw::Mean, ..score() }, ppo_config()).contains("skill_draw"));
    assert!(refused(ScoreConfig { prior: PriorKind::StandardNormal, ..score() }, ppo_config()).contains("prior"));
    let legacy = PpoConfig { time_limit: TimeLimit::Legacy, ..ppo_config() };
    assert!(refused(score(), legacy).contains("time_limit"));
    let below = SpirlConfig { learn_decoder: true, ..SpirlConfig::default() };
    let both = PpoConfig { memory: GRU, ..ppo_config() };
    let error = SpirlLearner::ppo(below, both, &score(), &MODEL, 1, DeviceKind::Flex).expect_err("one memory at most");
    assert!(error.to_string().contains("`ppo.memory` is that of the policy over skills"), "{error}");

    let mut learner = ppo(SpirlConfig::default());
    let short: Rollout = Field::new(&WALK, 2, 1).rollout(&learner, SKILL_INTERVAL - 1);
    let error = learner.learn(&short).expect_err("no whole skill");
    assert!(matches!(&error, LearnError::Config(text) if text.contains("twice as long")), "{error}");
}

#[test]
fn what_comes_after_a_skill_that_was_cut_off_is_discounted_by_the_ticks_that_it_was_played() {
    let mut learner = sac(SpirlConfig::default());
    train(&mut learner, 4, 32);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    learner.save(&path).expect("written");
    let bytes = std::fs::read(&path).expect("readable");
    let read = |bytes| safetensors::SafeTensors::deserialize(bytes).expect("safetensors");
    let file = read(&bytes);
    let over_skills = read(file.tensor("over_skills").expect("the learner of skills").data());
    let tensor = over_skills.tensor("buffer.weights").expect("kept");
    let numbers = tensor.data().chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().expect("four")));
    let weights: Vec<f64> = numbers.map(f64::from).collect();
    // γ to the ticks that were not played: 1 for whole skills, more for others.
    let gamma = sac_config().gamma;
    let expected = [0, 1, 2, 3].map(|missed| gamma.powi(-missed));
    assert!(weights.iter().all(|weight| expected.iter().any(|one| (weight / one - 1.0).abs() < 1e-5)), "{weights:?}");
    let whole = weights.iter().filter(|weight| (**weight - 1.0).abs() < 1e-6).count();
    assert!(0 < whole && whole < weights.len(), "{whole} of {} skills were played to their end", weights.len());
    let loaded = SpirlLearner::load(&path, DeviceKind::Flex).expect("read");
    let again = folder.path().join("again.safetensors");
    loaded.save(&again).expect("written");
    assert!(std::fs::read(again).expect("readable") == bytes, "a file keeps them");
}
