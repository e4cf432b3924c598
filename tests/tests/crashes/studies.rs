//! Tests of a run of a study, with its skills and its result.

use std::{fs, path::Path};

use playbot_harness::sealed_file::{read_sealed, write_sealed};
use playbot_learner::{
    DeviceKind, SkillModel,
    disk::{self, DiskRecording},
};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, after_each, distinct_power_cuts},
    small,
    training::{run_info, train, written},
};
use playbot_train::{
    Algorithm, Experiment, Trainer,
    checkpoint::CheckpointChoice,
    run_dir::{RunDir, RunLock, end_replacement, is_unstarted},
    study::{StudyResult, TestResult, TrainingResult},
};

use super::{skills::learn, tree::tree};

const RUN: &str = "full-seed1";
const SKILLS: &str = "skills-seed1";
const RESULT: &str = "result.json";

fn experiment() -> Experiment {
    Experiment { steps: 96, ..small::experiment(Algorithm::ScorePpo) }
}

/// Brings the run to its end from any state, in the order of `playbot study`.
fn study(folder: &Path) {
    let (run, skills, experiment) = (folder.join(RUN), folder.join(SKILLS), experiment());
    end_replacement(&run).expect("writable");
    let is_saved = run.exists() && !is_unstarted(&run);
    let is_known = || run.join(RESULT).exists() && read_sealed::<StudyResult>(&run.join(RESULT)).is_ok();
    if is_saved && is_known() {
        return;
    }
    disk::create_dir_all(&run).expect("writable");
    let lock = RunLock::take(&run).expect("free");
    let begun = is_saved && RunDir::open(&run).expect("a run").run.checkpoint(CheckpointChoice::Last).is_ok();
    let mut trainer = if begun {
        let opened = RunDir::open_with(lock).expect("a run");
        opened.run.resume(&Corridor, &opened.experiment, DeviceKind::Flex, 1).expect("a checkpoint")
    } else {
        learn(&skills);
        let model = SkillModel::load(&skills, DeviceKind::Flex).expect("learned");
        match is_saved {
            true => drop(RunDir::open_with(lock).expect("a run")),
            false => drop(RunDir::begin(lock, &experiment, &run_info(&experiment)).expect("writable")),
        }
        let fresh = Trainer::new(&Corridor, &experiment, Some(&model), DeviceKind::Flex, 1).expect("fits");
        // There is a checkpoint at the start.
        train(&run, fresh, Some(0))
    };
    while !trainer.is_done() {
        let next = trainer.updates() + 1;
        trainer = train(&run, trainer, Some(next));
    }
    write_sealed(&run.join(RESULT), &result(&trainer)).expect("writable");
}

/// Returns the result of a run, for which the policy's action in a state stands.
fn result(trainer: &Trainer) -> StudyResult {
    let policy = trainer.policy();
    let output = policy.forward(&vec![0.25; policy.latent()], &[0.5, 0.25], 1).expect("finite");
    StudyResult {
        variant: "full".to_owned(),
        algorithm: trainer.experiment().algorithm,
        seed: trainer.experiment().seed,
        training: Some(TrainingResult {
            steps: trainer.steps(),
            steps_to_threshold: None,
            success: None,
            episodic_return: None,
        }),
        left_out: Vec::new(),
        with_seen: None,
        test: TestResult {
            layouts: None,
            seen: 0,
            episodes: 1,
            success: 0.0,
            success_se: 0.0,
            return_mean: 0.0,
            return_se: 0.0,
            length_mean: 0.0,
            level_returns: output.head.iter().map(|number| f64::from(*number)).collect(),
        },
    }
}

/// Returns the files of a study that must be the same.
fn files_of(folder: &Path) -> Vec<Vec<u8>> {
    let read = |path: &Path| fs::read(path).expect("written");
    let own = [folder.join(SKILLS), folder.join(RUN).join(RESULT)].map(|path| read(&path));
    own.into_iter().chain(written(&folder.join(RUN))).collect()
}

#[test]
fn a_study_comes_to_the_same_result_wherever_the_power_failed() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = DiskRecording::of(folder.path());
    study(folder.path());
    let (operations, undisturbed, files) = (recording.operations(), files_of(folder.path()), tree(folder.path()));
    let cuts = distinct_power_cuts(&PaperDisk::default(), &operations);
    assert!(cuts.len() > 100, "{} states", cuts.len());
    after_each(&cuts, |cut| {
        let left = tempfile::tempdir().expect("a folder");
        PaperDisk::default().after(&operations, cut).write(folder.path(), left.path());
        study(left.path());
        assert!(files_of(left.path()) == undisturbed, "{cut:?} after {:?}", operations[..cut.operations].last());
        assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
    });
}
