//! Policies and checkpoints of images in files, and older files of vectors.

use crate::files::{Contents, HUGE, after, describe, load_policy, policy_file};
use crate::image_task::{Driver, SHAPE, config, image, model};
use crate::pixels::{ppo, score};
use crate::score::model as vector_model;
use playbot_learner::rng::Streams;
use playbot_learner::{
    DeviceKind, FileError, Learner, PictureMetadata, PolicyFile, PolicyMetadata, PpoLearner, ScoreConfig, SkillDraw,
    SkillSource,
};
use safetensors::tensor::Dtype;
use serde_json::json;
use std::path::Path;

fn picture() -> PictureMetadata {
    PictureMetadata { sensor: "eye".to_owned(), stack: 1, grayscale: true, paint_velocity: false }
}

fn file(learner: &PpoLearner) -> PolicyFile {
    let metadata = PolicyMetadata { picture: Some(picture()), ..PolicyMetadata::default() };
    PolicyFile { metadata, policy: learner.policy(), skills: learner.skills() }
}

fn pixels(n: u32) -> Vec<u8> {
    let mut rng = Streams::new(1).stream("image", 0);
    (0..n).flat_map(|i| image(i % 4, &mut rng)).collect()
}

fn save(file: &PolicyFile, path: &Path) -> Result<(), FileError> {
    file.save(path, &pixels(3), &vec![0.25; 3 * file.policy.latent()], 3)
}

#[test]
fn a_policy_comes_back_from_its_file_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy");
    let model = model(1, 1);
    let mut tied = score(config(), &model, 1);
    tied.update(&Driver::new(4, 1).rollout(&tied, 8)).expect("finite");
    for learner in [ppo(config(), 1), tied] {
        save(&file(&learner), &path).expect("written");
        let back = PolicyFile::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!((back.policy.observation(), back.policy.cnn()), (SHAPE.into(), Some(config().cnn)));
        assert_eq!(back.metadata.picture, Some(picture()));
        let (pixels, z) = (pixels(8), vec![-0.5; 8 * back.policy.latent()]);
        let played = |file: &PolicyFile| file.policy.forward(&z, &pixels, 8).expect("finite");
        assert_eq!(played(&back), played(&file(&learner)));
        let source = |skills: &SkillSource| {
            let z = skills.prior.sample(&pixels, 8, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
            (skills.decoder.forward(&z, &pixels, 8).expect("finite"), z)
        };
        assert_eq!(back.skills.as_ref().map(source), learner.skills().as_ref().map(source));
        let (shape, dtype, _) = &Contents::read(&path).tensors["examples.obs"];
        assert_eq!((&shape[..], *dtype), (&[3, 144][..], Dtype::U8));
    }
    // Behaviour cloning.
    let skills =
        SkillSource { prior: model.prior(), decoder: model.policy(), skill_interval: 4, draw: SkillDraw::Sample };
    let cloned = PolicyFile { metadata: PolicyMetadata::default(), policy: model.policy(), skills: Some(skills) };
    save(&cloned, &path).expect("written");
    load_policy(&path).expect("whole");
}

#[test]
fn metadata_of_other_pictures_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy");
    let learner = ppo(config(), 1);
    for metadata in [PictureMetadata { grayscale: false, ..picture() }, PictureMetadata { stack: 2, ..picture() }] {
        let mut wrong = file(&learner);
        wrong.metadata.picture = Some(metadata);
        let error = save(&wrong, &path).expect_err("other channels").to_string();
        assert!(error.contains("but the policy observes images of 1 channels"), "{error}");
    }
    save(&file(&learner), &path).expect("written");
    let error = after(&path, load_policy, |c| describe(c, "/card/picture/stack", json!(4))).to_string();
    assert!(error.contains("4 pictures with 4 channels"), "{error}");
    assert!(save(&file(&learner), &path).is_ok());
    let vector = file(&learner).save(&path, &[0.0; 144], &[], 1).expect_err("a vector").to_string();
    assert!(vector.contains("observations are vectors, not images"), "{vector}");
}

#[test]
fn parts_that_do_not_go_together_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy");
    save(&file(&score(config(), &model(0, 1), 1)), &path).expect("written");
    for (pointer, value, text) in [
        ("/policy/image/channels", json!(3), "actor.cnn.s0.conv.weight"),
        ("/policy/image/width", json!(HUGE), "actor.cnn"),
        ("/policy/image/height", json!(64), "actor.cnn.fc.weight"),
        ("/policy/image", json!(null), "`actor` reads images, but must read vectors"),
        ("/policy/actor/cnn", json!(null), "`actor` reads vectors, but must read images"),
        ("/policy/actor/cnn/Impala/feature", json!(HUGE), "actor.cnn.fc.weight"),
        ("/policy/actor/net/obs_dim", json!(9), "`actor` reads observations of 9"),
        ("/policy/critic/obs_dim", json!(9), "`critic` reads observations of 9"),
        ("/policy/normalised", json!(true), "normalises images"),
        ("/skills/decoder/cnn", json!({"Nature": {"feature": 8}}), "decoder.cnn.conv0.weight"),
        ("/skills/prior/cnn", json!(null), "`prior` reads vectors"),
    ] {
        let error = after(&path, load_policy, |c| describe(c, pointer, value.clone())).to_string();
        assert!(error.contains(text), "{pointer}: {error}");
    }
    for (tensor, what) in [("actor.cnn.s1.conv.bias", "head"), ("prior.cnn.fc.bias", "prior_mean")] {
        let error = after(&path, load_policy, |c| {
            c.tensors.get_mut(tensor).expect("there").2[..4].copy_from_slice(&3.0f32.to_le_bytes());
        });
        assert!(matches!(&error, FileError::Example { what: found, .. } if *found == what), "{tensor}: {error}");
    }
}

#[test]
fn a_checkpoint_that_does_not_hold_its_trunk_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ppo");
    let load = |path: &Path| PpoLearner::load(path, DeviceKind::Flex).map(drop);
    ppo(config(), 1).save(&path).expect("written");
    for (pointer, value, text) in [
        ("/config/cnn/Impala/feature", json!(HUGE), "actor.cnn.fc.weight"),
        ("/config/cnn/Impala/channels", json!([4, 4, HUGE]), "actor.cnn.s2.conv.weight"),
        ("/spec/obs/height", json!(HUGE), "actor.cnn"),
        ("/spec/obs", json!(8), "actor.cnn"),
    ] {
        let error = after(&path, load, |c| describe(c, pointer, value.clone())).to_string();
        assert!(error.contains(text), "{pointer}: {error}");
    }
    score(config(), &model(0, 1), 1).save(&path).expect("written");
    for (pointer, value, text) in [
        ("/spec/obs/channels", json!(3), "its skill model makes it"),
        ("/skill/config/cnn/Impala/feature", json!(HUGE), "decoder.cnn.fc.weight"),
    ] {
        let error = after(&path, load, |c| describe(c, pointer, value.clone())).to_string();
        assert!(error.contains(text), "{pointer}: {error}");
    }
}

#[test]
fn files_of_vectors_from_before_there_were_images_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy");
    policy_file(&path, true);
    let description = Contents::read(&path).description;
    for new in ["image", "cnn", "picture"] {
        assert!(!description.contains(new), "a file of vectors is written as it ever was, without {new}");
    }
    let path = folder.path().join("ppo");
    let config = crate::corridor::config();
    let learner = PpoLearner::with_skill(config, ScoreConfig::default(), &vector_model(0), 1, DeviceKind::Flex);
    learner.expect("good settings").save(&path).expect("written");
    let mut contents = Contents::read(&path);
    let mut header: serde_json::Value = serde_json::from_str(&contents.description).expect("JSON");
    header["config"].as_object_mut().expect("settings").remove("cnn").expect("written");
    let spec = header["spec"].as_object_mut().expect("a spec");
    let width = spec.remove("obs").expect("written");
    spec.insert("obs_dim".to_owned(), width);
    contents.description = header.to_string();
    contents.write(&path);
    let back = PpoLearner::load(&path, DeviceKind::Flex).expect("an older file");
    assert_eq!(back.spec().obs, crate::toy::OBS.into());
}
