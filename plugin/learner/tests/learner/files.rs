//! Errors of files that do not fit, which name the problem.

use crate::corridor::config as ppo_config;
use crate::score::model;
use crate::skill::{config, corridor_demos};
use crate::toy::OBS;
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, FileError, Learner, PolicyFile, PolicyMetadata,
    PpoLearner, ScoreConfig, SkillModel, SkillTrainer,
};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

pub type Load = fn(&Path) -> Result<(), FileError>;

/// Returns a file of each kind, the function that reads it, and the name of a tensor in it.
pub fn files(folder: &Path) -> Vec<(PathBuf, Load, &'static str)> {
    let paths = ["skill", "trainer", "ppo"].map(|name| folder.join(name));
    let model = model(1);
    model.save(&paths[0]).expect("written");
    let mut trainer = SkillTrainer::new(config(), corridor_demos(20), 1, DeviceKind::Flex).expect("windows fit");
    trainer.train_batch().expect("finite");
    trainer.save(&paths[1]).expect("written");
    let learner = PpoLearner::with_skill(ppo_config(), ScoreConfig::default(), &model, 1, DeviceKind::Flex);
    learner.expect("good settings").save(&paths[2]).expect("written");
    let [skill, checkpoint, ppo] = paths;
    vec![
        (skill, |path| SkillModel::load(path, DeviceKind::Flex).map(drop), "encoder.gru.l0.bias_hh"),
        (
            checkpoint,
            |path| SkillTrainer::load(path, corridor_demos(20), DeviceKind::Flex).map(drop),
            "adam.m.decoder.l1.weight",
        ),
        (ppo, |path| PpoLearner::load(path, DeviceKind::Flex).map(drop), "prior.head.weight"),
    ]
}

/// A file's header and tensors, to be changed.
pub struct Contents {
    pub description: String,
    pub tensors: BTreeMap<String, (Vec<usize>, Dtype, Vec<u8>)>,
}

impl Contents {
    pub fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).expect("readable");
        let (_, header) = SafeTensors::read_metadata(&bytes).expect("safetensors");
        let description = header.metadata().as_ref().expect("a description")["playbot"].as_str();
        // A changed file is written as older versions wrote theirs, without a checksum.
        let (_, rest) = description.split_once("\",").expect("a checksum first");
        let description = format!("{{{rest}");
        let file = SafeTensors::deserialize(&bytes).expect("safetensors");
        let tensors = file
            .iter()
            .map(|(name, view)| (name.to_owned(), (view.shape().to_vec(), view.dtype(), view.data().to_vec())))
            .collect();
        Self { description, tensors }
    }

    pub fn write(&self, path: &Path) {
        let views = self.tensors.iter().map(|(name, (shape, dtype, bytes))| {
            (name, TensorView::new(*dtype, shape.clone(), bytes).expect("as many bytes as numbers"))
        });
        let header = HashMap::from([("playbot".to_owned(), self.description.clone())]);
        std::fs::write(path, safetensors::serialize(views, Some(header)).expect("names differ")).expect("written");
    }
}

/// Puts `value` at `pointer` in the JSON of a file's header.
pub fn describe(contents: &mut Contents, pointer: &str, value: Value) {
    let mut json: Value = serde_json::from_str(&contents.description).expect("JSON");
    *json.pointer_mut(pointer).expect(pointer) = value;
    contents.description = json.to_string();
}

/// Returns the error of reading the file after `change`.
pub fn after(path: &Path, load: Load, change: impl Fn(&mut Contents)) -> FileError {
    let mut contents = Contents::read(path);
    change(&mut contents);
    let changed = path.with_extension("changed");
    contents.write(&changed);
    load(&changed).expect_err("changed for the worse")
}

#[test]
fn missing_extra_and_misshapen_tensors_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, load, tensor) in files(folder.path()) {
        load(&path).expect("whole");
        let error = after(&path, load, |c| drop(c.tensors.remove(tensor)));
        assert!(matches!(&error, FileError::MissingTensor { name, .. } if name == tensor), "{error}");
        let error = after(&path, load, |c| {
            c.tensors.insert("decoder.l7.bias".to_owned(), (vec![1], Dtype::F32, vec![0; 4]));
        });
        assert!(matches!(&error, FileError::ExtraTensor { name, .. } if name == "decoder.l7.bias"), "{error}");
        let error = after(&path, load, |c| c.tensors.get_mut(tensor).expect("there").0.insert(0, 1));
        assert!(matches!(&error, FileError::WrongShape { name, .. } if name == tensor), "{error}");
        let error = after(&path, load, |c| c.tensors.get_mut(tensor).expect("there").1 = Dtype::I32);
        assert!(error.to_string().contains(tensor) && error.to_string().contains("I32"), "{error}");
    }
}

#[test]
fn a_file_of_a_newer_version_or_another_kind_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, load, _) in files(folder.path()) {
        let newer = |c: &mut Contents| {
            // The error must not be about additions of a newer version.
            c.description = c.description.replacen(r#""version":1"#, r#""version":2,"colour":"red""#, 1);
        };
        let error = after(&path, load, newer).to_string();
        assert!(error.contains("newer version of playbot") && error.contains("format 2, this one reads 1"), "{error}");
        assert!(error.contains("update"), "{error}");
        let older = |c: &mut Contents| c.description = c.description.replacen(r#""version":1"#, r#""version":0"#, 1);
        let error = after(&path, load, older).to_string();
        assert!(error.contains("older version of playbot"), "{error}");
        let foreign = |c: &mut Contents| c.description = c.description.replacen(r#""kind":""#, r#""kind":"other "#, 1);
        let error = after(&path, load, foreign).to_string();
        assert!(error.contains("kind `other ") && error.contains("` is needed here"), "{error}");
    }
}

#[test]
fn an_entry_that_this_version_does_not_know_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, load, _) in files(folder.path()) {
        let error = after(&path, load, |c| c.description = c.description.replacen('{', r#"{"colour":"red","#, 1));
        assert!(error.to_string().contains("unknown field `colour`"), "{error}");
    }
}

#[test]
fn a_skill_model_from_before_there_were_images_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skill");
    let model = model(1);
    model.save(&path).expect("written");
    let mut contents = Contents::read(&path);
    let old = contents.description.replacen(r#""observation":"#, r#""obs_dim":"#, 1);
    assert_ne!(old, contents.description);
    contents.description = old;
    contents.write(&path);
    let back = SkillModel::load(&path, DeviceKind::Flex).expect("an older file");
    assert_eq!(back.observation(), model.observation());
}

#[test]
fn a_training_does_not_go_on_with_other_demonstrations() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trainer");
    let demos = |at: usize, by: f32| {
        let mut values: Vec<f32> = (0..40).map(|t| t as f32).collect();
        values[at] += by;
        let episode = DatasetEpisode { observations: values.into(), actions: Actions::Discrete(vec![1; 40]) };
        Dataset::new(1, ActionSpace::Discrete(2), vec![episode]).expect("a good episode")
    };
    let trainer = SkillTrainer::new(config(), demos(0, 0.0), 1, DeviceKind::Flex).expect("windows fit");
    trainer.save(&path).expect("written");
    SkillTrainer::load(&path, demos(0, 0.0), DeviceKind::Flex).expect("the same");
    let error = SkillTrainer::load(&path, demos(39, 0.5), DeviceKind::Flex).expect_err("one number differs");
    assert!(error.to_string().contains("not those of this run"), "{error}");
    let mut contents = Contents::read(&path);
    let start = contents.description.find(r#","demo_hash""#).expect("a hash");
    let end = start + contents.description[start..].find('}').expect("the last entry");
    contents.description.replace_range(start..end, "");
    contents.write(&path);
    SkillTrainer::load(&path, demos(39, 0.5), DeviceKind::Flex).expect("an older file says less");
}

/// More than any machine has.
pub const HUGE: u64 = 1 << 40;

#[test]
fn sizes_that_the_file_does_not_hold_are_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(folder.path());
    let skill = [
        ("/skill/config/hidden", json!([HUGE]), "decoder.l0.weight"),
        ("/skill/config/latent", json!(u64::MAX), "decoder"),
        ("/skill/config/gru_hidden", json!(HUGE), "encoder.gru.l0"),
        ("/skill/config/gru_layers", json!(HUGE), "encoder.gru.l1"),
        ("/skill/config/encoder_hidden", json!(HUGE), "encoder.state.l0"),
        ("/skill/action_space", json!({"Discrete": HUGE}), "head.weight"),
    ];
    let ppo = [
        ("/config/hidden", json!([HUGE]), "critic.l0.weight"),
        ("/skill/config/hidden", json!([u64::MAX]), "decoder.l0.weight"),
        ("/spec/obs", json!(HUGE), "its skill model makes it"),
    ];
    for (at, cases) in [(0, &skill[..]), (2, &ppo[..])] {
        let (path, load, _) = &files[at];
        for (pointer, value, text) in cases {
            let error = after(path, *load, |c| describe(c, pointer, value.clone())).to_string();
            assert!(error.contains(text), "{pointer}: {error}");
        }
    }
}

/// A policy file of an untrained policy with skills.
pub fn policy_file(path: &Path, condition: bool) {
    let score = ScoreConfig { condition, init_from_decoder: condition, ..ScoreConfig::default() };
    let learner = PpoLearner::with_skill(ppo_config(), score, &model(1), 1, DeviceKind::Flex).expect("good settings");
    let file = PolicyFile { metadata: PolicyMetadata::default(), policy: learner.policy(), skills: learner.skills() };
    let (obs, z) = (vec![0.5; 3 * OBS], vec![0.25; 3 * learner.rollout_latent()]);
    assert!(file.save(path, &obs, &z, 0).expect_err("no examples").to_string().contains("at least one example row"));
    file.save(path, &obs, &z, 3).expect("written");
}

pub fn load_policy(path: &Path) -> Result<(), FileError> {
    PolicyFile::load(path, DeviceKind::Flex).map(drop)
}

#[test]
fn a_policy_file_whose_parts_do_not_go_together_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy");
    policy_file(&path, true);
    load_policy(&path).expect("whole");
    for (pointer, value, text) in [
        ("/policy/actor/net/hidden", json!([u64::MAX]), "actor.l0.weight"),
        ("/policy/actor/net/hidden", json!([0]), "size of 0"),
        ("/policy/actor/net/latent", json!(u64::MAX), "actor"),
        ("/policy/critic/latent", json!(0), "`critic` reads"),
        ("/policy/critic/hidden", json!([HUGE]), "critic.l0.weight"),
        ("/skills/latent", json!(HUGE), "`decoder` reads"),
        ("/skills/decoder/net/obs_dim", json!(1), "decoder"),
        ("/skills/prior/net/hidden", json!([HUGE]), "prior.l0.weight"),
        ("/skills/horizon", json!(0), "at least 1 tick"),
        ("/examples", json!(0), "no examples"),
    ] {
        let error = after(&path, load_policy, |c| describe(c, pointer, value.clone())).to_string();
        assert!(error.contains(text), "{pointer}: {error}");
    }
}

#[test]
fn a_decoder_that_computes_something_else_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for condition in [true, false] {
        let path = folder.path().join("policy");
        policy_file(&path, condition);
        load_policy(&path).expect("whole");
        let error = after(&path, load_policy, |c| {
            let bias = &mut c.tensors.get_mut("decoder.head.bias").expect("there").2;
            bias[..4].copy_from_slice(&3.0f32.to_le_bytes());
        });
        assert!(matches!(&error, FileError::Example { what: "decoder_head", example: 0, .. }), "{error}");
    }
}
