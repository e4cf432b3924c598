//! Files of all networks that see observations through the skill model's frozen normaliser.

use crate::files::{Contents, after, describe};
use crate::norm_obs::{CHOICE, PLANE, config, demos, hall, model, ppo, rollout, sac, score, skills, train, trainer};
use playbot_learner::{
    ActionSpace, DeviceKind, FileError, Learner, Policy, PolicyFile, PolicyMetadata, PpoLearner, Prior, Rollout,
    SacLearner, SkillDraw, SkillModel, SkillSource, SkillTrainer,
};
use std::path::Path;

/// Checks that a learner continues bit for bit from the file that `save` writes; `update` returns metrics of an
/// update.
fn goes_on<L: Learner, M: PartialEq + std::fmt::Debug>(
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
        let file = PolicyFile { metadata: PolicyMetadata::default(), policy, skills };
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
    let file = PolicyFile { metadata: PolicyMetadata::default(), policy: learner.policy(), skills: Some(skills) };
    let error = file.save(&path, &hall(4, 70), &[0.25; 8], 4).expect_err("two ways to see").to_string();
    assert!(error.contains("prior and decoder normalise observations in different ways"), "{error}");
}
