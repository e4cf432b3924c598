//! Several choices at once with a number beside them: learned by PPO, skills, SCORE, SPiRL and imitation, under masks.

use playbot_learner::rng::{Streams, normal, unit};
use playbot_learner::{
    ActionSpace, ActionValue, Actions, Choices, Dataset, DatasetEpisode, DeviceKind, EndStates, ImitationConfig,
    LabelledSteps, Learner, MixedSpace, ObsKind, PolicySpec, PpoConfig, PpoLearner, Rollout, SacConfig, SacLearner,
    ScoreConfig, SkillConfig, SkillDraw, SkillModel, SkillTrainer, SpirlConfig, SpirlLearner,
};
use std::ops::ControlFlow;

/// Numbers of an observation.
const OBS: usize = 3;
const STEPS: usize = 16;
const ENVS: usize = 16;

/// One of three, one of two, and a number.
fn space() -> ActionSpace {
    ActionSpace::mixed([3, 2], 1)
}

fn observations(n: usize, stream: u64) -> Vec<f32> {
    let mut rng = Streams::new(3).stream("room", stream);
    (0..n * OBS).map(|_| 2.0 * unit(&mut rng) as f32 - 1.0).collect()
}

/// Returns what is right in a state: the first number's third of the range, the sign of the second one, and half of the
/// third.
fn right(row: &[f32]) -> ([u32; 2], f32) {
    let third = if row[0] < -0.33 { 0 } else { 1 + u32::from(row[0] > 0.33) };
    ([third, u32::from(row[1] > 0.0)], 0.5 * row[2])
}

/// Returns the reward of each action: 1 for each right choice, and 1 less the error of the number.
fn rewards(obs: &[f32], actions: &Actions) -> Vec<f32> {
    let rows = obs.chunks_exact(OBS).enumerate();
    let reward = |(row, obs): (usize, &[f32])| {
        let Some(ActionValue::Mixed { choices, numbers }) = actions.get(row) else { panic!("choices and a number") };
        let (wanted, number) = right(obs);
        let hits = wanted.iter().zip(&choices).filter(|(one, other)| one == other).count();
        hits as f32 + 1.0 - (numbers[0] - number).abs().min(1.0)
    };
    rows.map(reward).collect()
}

/// Returns a rollout of independent states, which the learner's own policy plays.
fn rollout(learner: &impl Learner, legal: &[bool], number: u64) -> Rollout {
    let rows = STEPS * ENVS;
    let (obs, latent) = (observations(rows, 100 + number), learner.rollout_latent());
    let mut rng = Streams::new(2).stream("rollout", number);
    let z = learner.prior().map_or_else(Vec::new, |prior| {
        prior.sample(&obs, rows, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite")
    });
    let mut output = learner.policy().forward(&z, &obs, rows).expect("finite");
    let legal = legal.repeat(rows);
    output.restrict(&legal);
    let (mut actions, mut log_probs) = (Actions::empty(&space()), Vec::new());
    for row in 0..rows {
        let (action, log_prob) = output.sample(row, &mut rng);
        assert_eq!(output.log_prob(row, &action).expect("of the space"), log_prob);
        actions.push(&action).expect("of the space");
        log_probs.push(log_prob);
    }
    let next_z = z[..ENVS * latent].to_vec();
    let next_obs = observations(ENVS, 200 + number).into();
    Rollout {
        steps: STEPS,
        rewards: rewards(&obs, &actions),
        obs: obs.into(),
        z,
        actions,
        legal,
        log_probs,
        values: output.values,
        terminated: vec![true; rows],
        truncated: vec![false; rows],
        final_values: vec![0.0; rows],
        next_values: vec![0.0; ENVS],
        ends: EndStates { next_obs, next_z, ..EndStates::new(&ObsKind::Vector(OBS)) },
        ..Rollout::new(ENVS, OBS, latent, &space())
    }
}

fn mean(rewards: &[f32]) -> f32 {
    rewards.iter().sum::<f32>() / rewards.len() as f32
}

fn config() -> PpoConfig {
    PpoConfig { hidden: vec![32], lr: 5e-3, num_steps: STEPS, minibatches: 4, epochs: 6, ..PpoConfig::default() }
}

fn spec() -> PolicySpec {
    PolicySpec { obs: OBS.into(), latent: 0, action_space: space() }
}

fn ppo() -> PpoLearner {
    PpoLearner::new(config(), spec(), 1, DeviceKind::Flex).expect("good settings")
}

#[test]
fn ppo_learns_every_part_of_the_action() {
    let mut learner = ppo();
    let first = mean(&rollout(&learner, &[], 0).rewards);
    for number in 0..60 {
        let rollout = rollout(&learner, &[], number);
        learner.update(&rollout).expect("finite");
    }
    let last = mean(&rollout(&learner, &[], 999).rewards);
    // By chance: ⅓ + ½ and about 0.3 for the number.
    assert!(first < 1.4 && last > 2.5, "{first} to {last}");
}

#[test]
fn an_illegal_option_is_never_taken_and_the_others_learn() {
    let legal = [true, false, true, true, true, true];
    let mut learner = ppo();
    for number in 0..40 {
        let rollout = rollout(&learner, &legal, number);
        let Actions::Mixed { options, .. } = &rollout.actions else { panic!("choices and a number") };
        assert!(options.chunks_exact(2).all(|options| options[0] != 1));
        learner.update(&rollout).expect("finite");
    }
    // The middle third cannot be hit.
    let last = mean(&rollout(&learner, &legal, 999).rewards);
    assert!((2.1..2.75).contains(&last), "{last}");
    let mut wrong = rollout(&learner, &[], 3);
    wrong.legal = legal.repeat(STEPS * ENVS);
    let text = learner.update(&wrong).expect_err("a forbidden option was taken").to_string();
    assert!(text.contains("which its mask forbids"), "{text}");
}

#[test]
fn a_loaded_learner_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let mut learner = ppo();
    learner.update(&rollout(&learner, &[], 0)).expect("finite");
    learner.save(&path).expect("written");
    let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    for number in 1..3 {
        let [one, other] = [&learner, &loaded].map(|learner| rollout(learner, &[], number));
        assert_eq!(one, other);
        let [one, other] = [&mut learner, &mut loaded].map(|learner| learner.update(&one).expect("finite"));
        assert_eq!(one, other);
    }
}

/// Returns recordings of somebody who is right in nine of ten choices.
fn demos() -> Dataset {
    let episodes = (0..60).map(|i| {
        let mut rng = Streams::new(4).stream("noise", i);
        let observations = observations(20, i);
        let mut actions = Actions::empty(&space());
        for row in observations.chunks_exact(OBS) {
            let (mut choices, number) = right(row);
            if unit(&mut rng) < 0.1 {
                choices[0] = (choices[0] + 1) % 3;
            }
            let numbers = vec![number + 0.1 * normal(&mut rng)];
            actions.push(&ActionValue::Mixed { choices: choices.to_vec(), numbers }).expect("of the space");
        }
        DatasetEpisode { observations: observations.into(), actions }
    });
    Dataset::new(OBS, space(), episodes.collect()).expect("consistent")
}

fn model(epochs: usize) -> SkillModel {
    let config = SkillConfig { lr: 5e-3, ..crate::skill::config() };
    let mut trainer = SkillTrainer::new(config, demos(), 1, DeviceKind::Flex).expect("windows fit");
    for _ in 0..epochs {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

#[test]
fn skills_are_learned_from_it_and_score_starts_as_their_decoder() {
    let model = model(20);
    let score = ScoreConfig { kl_coef: 0.01, ..ScoreConfig::default() };
    let mut tied = PpoLearner::with_skill(config(), score, &model, 1, DeviceKind::Flex).expect("good settings");
    let obs = observations(33, 50);
    let z = model.prior().sample(&obs, 33, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
    assert_eq!(tied.initial_kl(&z, (&obs).into(), 33).expect("a copy"), Some(0.0));
    let first = mean(&rollout(&tied, &[], 0).rewards);
    assert!(first > 2.0, "the decoder does what was recorded: {first}");
    for number in 0..10 {
        let rollout = rollout(&tied, &[], number);
        let metrics = tied.update(&rollout).expect("finite");
        let confidence = metrics.confidence.expect("penalised");
        assert!((0.05..1.0).contains(&confidence), "{confidence}");
    }
    assert!(mean(&rollout(&tied, &[], 999).rewards) > first);
}

#[test]
fn spirl_plays_skills_of_it() {
    let score = ScoreConfig { skill_interval: 1, ..ScoreConfig::default() };
    let learner = SpirlLearner::ppo(SpirlConfig::default(), config(), &score, &model(10), 1, DeviceKind::Flex);
    let mut learner = learner.expect("good settings");
    for number in 0..3 {
        let played = rollout(&learner, &[], number);
        // Each skill is used for one tick.
        let ends = EndStates { next_left: vec![1.0; ENVS], ..played.ends.clone() };
        let played = Rollout { left: vec![1.0; STEPS * ENVS], ends, ..played };
        learner.learn(&played).expect("finite");
    }
}

#[test]
fn imitation_learns_it_and_its_steps_survive_their_file() {
    let steps = LabelledSteps::of(&demos()).expect("consistent");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("steps");
    steps.save(&path, &spec()).expect("written");
    assert_eq!(LabelledSteps::load(&path, &spec()).expect("read"), steps);
    let mut learner = ppo();
    let before = mean(&rollout(&learner, &[], 0).rewards);
    let config = ImitationConfig { epochs: 20, batch: 64, ..ImitationConfig::default() };
    learner.imitate(&steps, steps.len(), &config).expect("finite");
    let after = mean(&rollout(&learner, &[], 0).rewards);
    assert!(after > before + 0.7, "{before} to {after}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let sac = SacLearner::new(SacConfig::default(), spec(), 1, DeviceKind::Flex).expect_err("several choices");
    assert!(sac.to_string().contains("learn one choice or a vector"), "{sac}");
    let empty = MixedSpace { choices: Choices::new(&[3, 0]).expect("two"), numbers: 1 };
    let spec = PolicySpec { action_space: ActionSpace::Mixed(empty), ..spec() };
    assert!(PpoLearner::new(config(), spec, 1, DeviceKind::Flex).is_err(), "a choice of nothing");
    let mut wrong = rollout(&ppo(), &[], 0);
    let Actions::Mixed { options, .. } = &mut wrong.actions else { panic!("choices and a number") };
    options[2 * 5 + 1] = 2;
    let text = ppo().update(&wrong).expect_err("there is no option 2").to_string();
    assert!(text.contains("row 5: choice 1 is 2 of 2 options"), "{text}");
}

#[test]
fn nothing_is_learned_from_rows_whose_action_is_held() {
    // In every other row the game holds an action: its options are the only legal ones, and its number is none of the
    // agent's.
    let mut learner = ppo();
    let mut played = rollout(&learner, &[true; 6], 1);
    let Actions::Mixed { options, values, .. } = &mut played.actions else { panic!("choices and a number") };
    for row in (0..STEPS * ENVS).step_by(2) {
        let taken = [options[row * 2] as usize, 3 + options[row * 2 + 1] as usize];
        for (at, legal) in played.legal[row * 6..(row + 1) * 6].iter_mut().enumerate() {
            *legal = taken.contains(&at);
        }
        played.log_probs[row] = 0.0;
        values[row] = 0.5;
    }
    let mut others = played.clone();
    let Actions::Mixed { values, .. } = &mut others.actions else { panic!("choices and a number") };
    values.iter_mut().step_by(2).for_each(|held| *held = -0.9);
    let mut twin = ppo();
    let [one, other] = [(&mut learner, &played), (&mut twin, &others)].map(|(learner, rollout)| {
        learner.update(rollout).expect("finite");
        learner.policy().forward(&[], &observations(8, 3), 8).expect("finite")
    });
    assert_eq!(one, other, "the held number does not matter");
    // What is free is learned from.
    let Actions::Mixed { values, .. } = &mut others.actions else { panic!("choices and a number") };
    values.iter_mut().skip(1).step_by(2).for_each(|number| *number = -0.9);
    twin.update(&others).expect("finite");
    learner.update(&played).expect("finite");
    let [one, other] =
        [&learner, &twin].map(|learner| learner.policy().forward(&[], &observations(8, 3), 8).expect("finite").head);
    assert_ne!(one, other);
}
