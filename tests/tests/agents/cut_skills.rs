//! Tests of skills that run out together with the time: the last state is valued under a skill that the prior draws in
//! that state, from a copy of the agent's stream.

use std::{fs, path::Path};

use bevy_playbot::{streams::AgentStreams, vision::ObservationConfig};
use playbot::prelude::*;
use playbot_learner::{
    DeviceKind, Learner, Observations, PpoConfig, PpoLearner, Rollout, SacConfig, SacLearner, ScoreConfig, SkillModel,
    rng::{ChaCha8Rng, normal},
};
use playbot_shell::json_lines;
use playbot_tests::{Corridor, recording::record_random, training::learn_skills};
use playbot_train::{Experiment, collect::Collector, experiment::file::parse_experiment};

const SEED: u64 = 3;
const AGENTS: usize = 8;
const TICKS: usize = 400;
/// Ticks of a skill. The fourth of an episode ends with its time, after 20 ticks.
const SKILL_INTERVAL: usize = 5;
/// Numbers of an observation, and of a skill.
const WIDTH: usize = 2;

/// Returns skills of random walkers, whose prior depends on the state.
fn skills(folder: &Path) -> SkillModel {
    let text = r#"(game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused", steps: 2048,
        skills: (window: 3, epochs: 4, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2, lr: 0.003))"#;
    let path = folder.join("walk.demo");
    record_random(&Corridor, "plain", 5, &path, 16..76);
    let experiment = parse_experiment(text, Path::new("test.ron")).expect("valid");
    let experiment = Experiment { demos: Some(path), ..experiment };
    learn_skills(&Corridor, &experiment, 2)
}

fn score() -> ScoreConfig {
    ScoreConfig { skill_interval: SKILL_INTERVAL, ..ScoreConfig::default() }
}

/// Returns a rollout of a learner's policy with skills of its prior.
fn played(learner: &impl Learner) -> (Rollout, SkillPrior) {
    let split: LevelSplit = "plain:0..7".parse().expect("a split");
    let prior = SkillPrior::from(&learner.skills().expect("it has skills"));
    let config = ObservationConfig::default();
    let collector = Collector::new(&Corridor, &split, &config, SEED, 0, AGENTS as u32, Some(prior.clone()));
    let mut collector = collector.expect("can be seen");
    (collector.collect(&learner.policy(), WIDTH, TICKS).expect("sound").0, prior)
}

/// Returns row `at` of a matrix with two columns.
fn row(values: &[f32], at: usize) -> &[f32] {
    &values[at * WIDTH..][..WIDTH]
}

fn numbers(observations: &Observations) -> &[f32] {
    match observations {
        Observations::Vector(numbers) => numbers,
        Observations::Image(_) => panic!("the corridor has no pictures here"),
    }
}

/// An episode that was cut off, and the skills of its agent's stream there.
struct Cut<'a> {
    row: usize,
    last: &'a [f32],
    /// The skill kept for the last state.
    kept: &'a [f32],
    /// The prior's draw in that state.
    drawn: Vec<f32>,
    /// The draw from the same numbers in the state before the last action.
    elsewhere: Vec<f32>,
}

/// Returns the cut episodes of a rollout. Each agent's stream is followed draw by draw.
fn cuts<'a>(rollout: &'a Rollout, prior: &SkillPrior) -> Vec<Cut<'a>> {
    let (obs, last) = (numbers(&rollout.obs), numbers(&rollout.ends.cut_obs));
    let draw = |seen: &[f32], stream: &mut ChaCha8Rng| -> Vec<f32> {
        prior.prior.sample(seen, 1, prior.draw, &mut |_| normal(stream)).expect("finite")
    };
    let mut cuts = Vec::new();
    for agent in 0..AGENTS {
        let mut stream = AgentStreams::new(SEED, agent as u32).skill;
        for at in (agent..AGENTS * TICKS).step_by(AGENTS) {
            if rollout.left[at] == 1.0 {
                let (z, kept) = (draw(row(obs, at), &mut stream), row(&rollout.z, at));
                assert!(z.iter().zip(kept).all(|(a, b)| (a - b).abs() < 1e-5), "row {at}: {kept:?} instead of {z:?}");
            }
            if let Ok(index) = rollout.ends.cut_rows.binary_search(&at) {
                assert_eq!((rollout.left[at], rollout.ends.cut_left[index]), (0.2, 1.0), "row {at}: it has run out");
                cuts.push(Cut {
                    row: at,
                    last: row(last, index),
                    kept: row(&rollout.ends.cut_z, index),
                    drawn: draw(row(last, index), &mut stream.clone()),
                    elsewhere: draw(row(obs, at), &mut stream.clone()),
                });
            }
        }
    }
    assert_eq!(cuts.len(), rollout.ends.cut_rows.len());
    assert!(cuts.len() > 3, "time was up for {} episodes only", cuts.len());
    assert!(cuts.iter().all(|cut| cut.drawn != cut.elsewhere), "the prior looks at the state");
    cuts
}

#[test]
fn ppo_values_the_last_state_under_a_skill_that_is_drawn_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = PpoConfig { hidden: vec![8], ..PpoConfig::default() };
    let learner = PpoLearner::with_skill(config, score(), &skills(folder.path()), 1, DeviceKind::Flex);
    let learner = learner.expect("good settings");
    let ((rollout, prior), policy) = (played(&learner), learner.policy());
    for Cut { row, last, kept, drawn, elsewhere } in cuts(&rollout, &prior) {
        let value = |z: &[f32]| policy.values_held(z, &[1.0], last, 1).expect("it fits")[0];
        assert_eq!(kept, drawn, "row {row}");
        assert_eq!(rollout.final_values[row], value(&drawn), "row {row}");
        assert_ne!(value(&drawn), value(&elsewhere), "row {row}: another skill has another value");
    }
}

/// Returns a tensor of numbers out of a file of weights.
fn tensor(path: &Path, name: &str) -> Vec<f32> {
    let bytes = fs::read(path).expect("written");
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let (header, data) = bytes[8..].split_at(length);
    let header = json_lines(&String::from_utf8_lossy(header)).remove(0);
    let offset = |at: usize| header[name]["data_offsets"][at].as_u64().expect("it is there") as usize;
    data[offset(0)..offset(1)].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

#[test]
fn sac_keeps_a_skill_that_is_drawn_in_the_last_state_as_the_next_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    // It only observes.
    let config =
        SacConfig { hidden: vec![8], buffer: AGENTS * TICKS, learning_starts: 1_000_000, ..SacConfig::default() };
    let learner = SacLearner::with_skill(config, score(), &skills(folder.path()), 1, DeviceKind::Flex);
    let mut learner = learner.expect("good settings");
    let (rollout, prior) = played(&learner);
    learner.update(&rollout).expect("it fits");
    learner.save(&path).expect("written");
    let (next_obs, next_z) = (tensor(&path, "buffer.next_obs"), tensor(&path, "buffer.next_z"));
    assert_eq!((next_obs.len(), next_z.len()), (AGENTS * TICKS * WIDTH, AGENTS * TICKS * WIDTH));
    for cut in cuts(&rollout, &prior) {
        assert_eq!(row(&next_obs, cut.row), cut.last, "row {}", cut.row);
        assert_eq!(row(&next_z, cut.row), cut.drawn, "row {}", cut.row);
    }
}
