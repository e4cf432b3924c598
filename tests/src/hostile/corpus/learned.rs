//! Learned files: skill models, checkpoints and policies.

use std::{fs, path::Path};

use bevy_playbot::policy_file::check_policy;
use playbot::prelude::*;
use playbot_learner::{DeviceKind, FileError, PolicyFile, PolicyMetadata, SkillModel, SkillTrainer};
use playbot_train::{Algorithm, TrainedLearner, checkpoint::CheckpointChoice, run_dir::RunDir};

use crate::{
    Corridor,
    hostile::{
        form::Form,
        kind::{FileKind, Read, words},
        seals::digits,
    },
    small,
    training::train,
};

/// The name of every file here.
const FILE: &str = "learned";
const DEVICE: DeviceKind = DeviceKind::Flex;

/// Returns all kinds of learned files.
pub(super) fn learned(folder: &Path) -> Vec<FileKind> {
    let kind = |name: &'static str, save: &dyn Fn(&Path), read: fn(&Path) -> Read| {
        let own = folder.join(name.replace(' ', "-"));
        fs::create_dir_all(&own).expect("writable");
        save(&own.join(FILE));
        FileKind::new(name, Form::Tensors, &own, FILE, read)
    };
    let run = |algorithm: Algorithm| {
        let run = folder.join(format!("run-{algorithm}"));
        train(&run, small::trainer(algorithm), None);
        let last = RunDir::open(&run).expect("a run").run.checkpoint(CheckpointChoice::Last).expect("saved");
        move |path: &Path| {
            fs::copy(last.learner_file(), path).expect("copied");
        }
    };
    vec![
        kind("skill model", &|path| small::skills().model().save(path).expect("written"), skill_model),
        kind("skill checkpoint", &|path| small::skills().save(path).expect("written"), skill_checkpoint),
        kind("PPO checkpoint", &run(Algorithm::Ppo), |folder| learner(folder, Algorithm::Ppo)),
        kind("SCORE checkpoint", &run(Algorithm::ScorePpo), |folder| learner(folder, Algorithm::ScorePpo)),
        kind("SAC checkpoint", &run(Algorithm::Sac), |folder| learner(folder, Algorithm::Sac)),
        kind("SPiRL checkpoint", &run(Algorithm::SpirlPpo), |folder| learner(folder, Algorithm::SpirlPpo)),
        kind("policy", &save_policy, policy).handled(handle_policy),
    ]
}

fn save_policy(path: &Path) {
    let trainer = small::trainer(Algorithm::ScorePpo);
    let policy = trainer.policy();
    let z = vec![0.25; 2 * policy.latent()];
    let metadata = PolicyMetadata {
        game: Corridor.name().to_owned(),
        game_version: Corridor.version(),
        ..PolicyMetadata::default()
    };
    let file = PolicyFile { metadata, policy, skills: trainer.skill_source() };
    file.save(path, &[0.5; 4][..], &z, 2).expect("written");
}

/// Returns the contents, as they would be written again.
fn again(folder: &Path, save: impl FnOnce(&Path) -> Result<(), FileError>) -> Read {
    let path = folder.join("again");
    save(&path).map_err(words)?;
    Ok(vec![digits(&fs::read(path).map_err(words)?)])
}

fn skill_model(folder: &Path) -> Read {
    let model = SkillModel::load(&folder.join(FILE), DEVICE).map_err(words)?;
    again(folder, |path| model.save(path))
}

fn skill_checkpoint(folder: &Path) -> Read {
    let trainer = SkillTrainer::load(&folder.join(FILE), small::dataset(), DEVICE).map_err(words)?;
    again(folder, |path| trainer.save(path))
}

fn learner(folder: &Path, algorithm: Algorithm) -> Read {
    let learner = TrainedLearner::load(algorithm, &folder.join(FILE), DEVICE).map_err(words)?;
    again(folder, |path| learner.save(path))
}

/// Returns the contents. A policy cannot be written again without the rows by which it was checked: its action in a
/// state stands for it.
fn policy(folder: &Path) -> Read {
    let file = PolicyFile::load(&folder.join(FILE), DEVICE).map_err(words)?;
    let output = file.policy.forward(&vec![0.1; file.policy.latent()], &vec![0.3; file.policy.obs_dim()], 1);
    Ok(vec![format!("{:?}", file.metadata), format!("{output:?}")])
}

fn handle_policy(folder: &Path) {
    if let Ok(file) = PolicyFile::load(&folder.join(FILE), DEVICE) {
        // Its fit is not tested here.
        let _ = check_policy(&Corridor.metadata(), &file);
    }
}
