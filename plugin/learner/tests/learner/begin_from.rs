//! The start from another run: the first policy is the old one to the bit, also with more inputs.

use crate::corridor::config;
use crate::norm_obs;
use crate::score::model;
use crate::toy::{Driver, OBS, SPACE};
use playbot_learner::{
    ActionSpace, DeviceKind, InputMap, Learner, PolicyOutput, PolicySpec, PpoConfig, PpoLearner, RolloutStep,
    SacConfig, SacLearner, ScoreConfig, SkillModel, StartFrom,
    rng::{Streams, normal},
};
use std::path::Path;

fn ppo(config: PpoConfig, width: usize, seed: u64) -> PpoLearner {
    let spec = PolicySpec { obs: width.into(), latent: 0, action_space: SPACE };
    PpoLearner::new(config, spec, seed, DeviceKind::Flex).expect("good settings")
}

/// Names of the corridor's values, with two new ones in the middle and one at the end.
fn wide() -> InputMap {
    let old: Vec<String> = (0..OBS).map(|value| format!("v{value}")).collect();
    let mut new = old.clone();
    new.insert(3, "door".to_owned());
    new.insert(1, "fuel".to_owned());
    new.push("clock".to_owned());
    InputMap::by_name(&old, &new).expect("all are there")
}

/// Returns 33 rows of the longer observation, and the old values among them.
fn rows() -> (Vec<f32>, Vec<f32>) {
    let mut rng = Streams::new(9).stream("rows", 0);
    let long: Vec<f32> = (0..33 * (OBS + 3)).map(|_| 3.0 * normal(&mut rng)).collect();
    let fresh: Vec<usize> = wide().fresh().collect();
    assert_eq!(fresh, [1, 4, OBS + 2]);
    let short = long.chunks_exact(OBS + 3).flat_map(|row| {
        row.iter().enumerate().filter(|(place, _)| !fresh.contains(place)).map(|(_, x)| *x).collect::<Vec<_>>()
    });
    let short = short.collect();
    (long, short)
}

fn output(learner: &impl Learner, z: &[f32], obs: &[f32]) -> PolicyOutput {
    learner.policy().forward(z, obs, 33).expect("finite")
}

/// Trains `learner` for two updates in the corridor and saves it.
fn trained(mut learner: PpoLearner, path: &Path) -> PpoLearner {
    let mut driver = Driver::new(4, 1);
    for _ in 0..2 {
        learner.update(&driver.rollout(&learner, 16)).expect("finite");
    }
    learner.save(path).expect("written");
    learner
}

#[test]
fn a_policy_with_more_inputs_is_the_old_one_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.safetensors");
    let (long, short) = rows();
    for norm_obs in [false, true] {
        let config = PpoConfig { norm_obs, ..config() };
        let old = trained(ppo(config.clone(), OBS, 5), &path);
        let mut new = ppo(PpoConfig { lr: 0.01, ..config.clone() }, OBS + 3, 6);
        let map = wide();
        let start = StartFrom { inputs: Some(&map), ..StartFrom::new(&path) };
        let report = new.start_from(&start).expect("it has more inputs");
        assert!(report.is_same_policy && report.new_inputs == 3 && report.anew.is_empty(), "{report}");
        assert_eq!(output(&new, &[], &long), output(&old, &[], &short));
        // It learns to use the new values, and is saved and read with their statistics.
        let mut other = ppo(config, OBS + 3, 7);
        let saved = folder.path().join("new.safetensors");
        new.save(&saved).expect("written");
        other.start_from(&StartFrom::new(&saved)).expect("the same shape");
        assert_eq!(output(&other, &[], &long), output(&new, &[], &long));
        let loaded = PpoLearner::load(&saved, DeviceKind::Flex).expect("readable");
        assert_eq!(output(&loaded, &[], &long), output(&new, &[], &long));
    }
}

#[test]
fn new_inputs_learn() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.safetensors");
    trained(ppo(PpoConfig { norm_obs: true, ..config() }, OBS, 5), &path);
    let mut new = ppo(PpoConfig { norm_obs: true, ..config() }, OBS + 1, 6);
    new.start_from(&StartFrom::new(&path)).expect("a value at the end");
    let mut driver = Driver::new(4, 2);
    let short = ppo(PpoConfig { norm_obs: true, ..config() }, OBS, 5);
    let played = driver.rollout(&short, 16);
    let mut rollout = playbot_learner::Rollout::new(4, OBS + 1, 0, &SPACE);
    let values = played.obs.as_slice();
    let playbot_learner::ObsSlice::Vector(values) = values else { panic!("vectors") };
    for step in 0..16 {
        let obs: Vec<f32> = (0..4)
            .flat_map(|env| {
                let row = (step * 4 + env) * OBS;
                values[row..row + OBS].iter().copied().chain([env as f32]).collect::<Vec<_>>()
            })
            .collect();
        let range = step * 4..step * 4 + 4;
        let playbot_learner::Actions::Discrete(actions) = &played.actions else { panic!("discrete") };
        rollout
            .push_step(RolloutStep {
                obs: (&obs).into(),
                z: &[],
                actions: &playbot_learner::Actions::Discrete(actions[range.clone()].to_vec()),
                log_probs: &played.log_probs[range.clone()],
                values: &played.values[range.clone()],
                rewards: &played.rewards[range.clone()],
                terminated: &[false; 4],
                truncated: &[false; 4],
                final_values: &[0.0; 4],
            })
            .expect("it fits");
    }
    rollout.next_values = vec![0.0; 4];
    rollout.ends.next_obs = vec![0.0; 4 * (OBS + 1)].into();
    let ask = |learner: &PpoLearner, last: f32| {
        let obs: Vec<f32> = [0.5; OBS].into_iter().chain([last]).collect();
        learner.policy().forward(&[], &obs, 1).expect("finite").head
    };
    assert_eq!(ask(&new, 0.0), ask(&new, 3.0), "at first the new value does not count");
    new.update(&rollout).expect("finite");
    assert_ne!(ask(&new, 0.0), ask(&new, 3.0), "then it does");
}

#[test]
fn skills_are_widened_with_the_policy_that_is_tied_to_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.safetensors");
    let with = |skills: &SkillModel, seed| {
        PpoLearner::with_skill(config(), ScoreConfig::default(), skills, seed, DeviceKind::Flex).expect("good settings")
    };
    let old = trained(with(&model(1), 5), &path);
    let map = wide();
    let skills = old.skill_model(Some(&map)).expect("readable").expect("it has skills");
    let mut new = with(&skills, 6);
    let report = new.start_from(&StartFrom { inputs: Some(&map), ..StartFrom::new(&path) }).expect("more inputs");
    assert!(report.is_same_policy, "{report}");
    let (long, short) = rows();
    let mut rng = Streams::new(3).stream("skills", 0);
    let z: Vec<f32> = (0..33 * 2).map(|_| normal(&mut rng)).collect();
    assert_eq!(output(&new, &z, &long), output(&old, &z, &short));
    let decoder = |learner: &PpoLearner, obs: &[f32]| {
        learner.skills().expect("it has skills").decoder.forward(&z, obs, 33).expect("finite")
    };
    assert_eq!(decoder(&new, &long), decoder(&old, &short));
    let draw = |learner: &PpoLearner, obs: &[f32]| {
        let prior = learner.prior().expect("it has skills");
        prior.sample(obs, 33, playbot_learner::SkillDraw::Mean, &mut |_| 0.0).expect("finite")
    };
    assert_eq!(draw(&new, &long), draw(&old, &short));
    let refused = skills.save(&folder.path().join("skills.safetensors")).expect_err("without an encoder").to_string();
    assert!(refused.contains("keeps no encoder"), "{refused}");
    assert!(ppo(config(), OBS, 1).skill_model(None).expect("readable").is_none());
}

#[test]
fn frozen_statistics_of_skills_are_kept() {
    let skills = norm_obs::model(norm_obs::PLANE);
    let old = norm_obs::ppo(norm_obs::score(true), &skills);
    let names = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let map = InputMap::by_name(&names("a b c d"), &names("a b new c d")).expect("all are there");
    let wide = old.skill_model(Some(&map)).expect("readable").expect("it has skills");
    let obs = norm_obs::hall(9, 50);
    let long: Vec<f32> = obs.chunks_exact(4).flat_map(|row| [row[0], row[1], 77.0, row[2], row[3]]).collect();
    let z = norm_obs::skills(&skills, &obs);
    let play = |policy: playbot_learner::Policy, obs: &[f32]| policy.forward(&z, obs, 9).expect("finite");
    assert_eq!(play(wide.policy(), &long), play(skills.policy(), &obs));
}

#[test]
fn moments_of_the_optimiser_are_taken_if_they_are_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.safetensors");
    let mut old = trained(ppo(config(), OBS, 5), &path);
    let rollout = Driver::new(4, 8).rollout(&old, 16);
    let from = |moments| {
        let mut new = ppo(config(), OBS, 5);
        new.start_from(&StartFrom { moments, ..StartFrom::new(&path) }).expect("the same shape");
        // The checkpoint is whole: Adam goes on after it was read, too.
        let saved = folder.path().join("new.safetensors");
        new.save(&saved).expect("written");
        PpoLearner::load(&saved, DeviceKind::Flex).expect("readable")
    };
    let (mut with, mut without) = (from(true), from(false));
    let (with, without) = (with.update(&rollout).expect("finite"), without.update(&rollout).expect("finite"));
    // Minibatches are numbered by the update, so only the first gradient is the same.
    let of_old = old.update(&rollout).expect("finite");
    assert_ne!(with, without);
    assert!(of_old.policy_loss.is_finite());
}

#[test]
fn what_fits_in_part_is_listed_and_what_does_not_fit_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.safetensors");
    let old = trained(ppo(PpoConfig { hidden: vec![8, 8], ..config() }, OBS, 5), &path);
    let mut part = ppo(PpoConfig { hidden: vec![8, 4], ..config() }, OBS, 6);
    let report = part.start_from(&StartFrom::new(&path)).expect("the first layer fits");
    assert_eq!(report.taken, ["actor.l0", "critic.l0"]);
    assert!(!report.is_same_policy);
    let text = report.to_string();
    assert!(
        text.contains("anew: actor.l1 (another shape), actor.head (it is behind a layer that begins anew)"),
        "{text}"
    );
    let mut bare = ppo(PpoConfig { hidden: vec![8, 8], ..config() }, OBS, 6);
    let start = StartFrom { critic: false, ..StartFrom::new(&path) };
    let report = bare.start_from(&start).expect("the policy fits");
    assert!(report.is_same_policy && report.anew.len() == 3, "{report}");
    assert!(report.to_string().contains("critic.l0 (the other run has not trained it)"), "{report}");
    let (_, short) = rows();
    assert_eq!(output(&bare, &[], &short).head, output(&old, &[], &short).head);

    let refused = |mut learner: PpoLearner, words: &str| {
        let error = learner.start_from(&StartFrom::new(&path)).expect_err("it does not fit").to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(ppo(PpoConfig { hidden: vec![4], ..config() }, OBS, 6), "no layer of its policy fits");
    refused(ppo(config(), OBS - 1, 6), "its policy reads 8 observed values, and there are only 7 now");
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: ActionSpace::Discrete(4) };
    let other = PpoLearner::new(config(), spec, 1, DeviceKind::Flex).expect("good settings");
    refused(other, "its actions are");
    let tied = PpoLearner::with_skill(config(), ScoreConfig::default(), &model(1), 5, DeviceKind::Flex);
    refused(tied.expect("good settings"), "it has skills of another width");
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let mut sac = SacLearner::new(SacConfig::default(), spec, 1, DeviceKind::Flex).expect("good settings");
    let error = sac.start_from(&StartFrom::new(&path)).expect_err("not SAC").to_string();
    assert!(error.contains("only ppo, score-ppo and spirl-ppo can start"), "{error}");
}
