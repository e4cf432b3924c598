//! The folder of a run.

use std::{fs, path::Path};

use playbot_learner::DeviceKind;
use playbot_train::{Algorithm, checkpoint, run_dir::RunDir, runs::RunCurves};

use crate::{
    Corridor,
    hostile::{
        form::Form,
        kind::{FileKind, Read, words},
        seals::digits,
    },
    small,
    training::run_info,
};

const RUN: &str = "run";

/// Returns all kinds of files of a run but its learner's, which is a kind of its own.
pub(super) fn trained(folder: &Path) -> Vec<FileKind> {
    let mut trainer = small::trainer(Algorithm::Ppo);
    let experiment = trainer.experiment().clone();
    let run = RunDir::create(&folder.join(RUN), &experiment, &run_info(&experiment), false).expect("fresh");
    while !trainer.is_done() {
        let report = trainer.update().expect("learns");
        run.log(&report, experiment.steps_per_update()).expect("writable");
        run.save(&mut trainer).expect("writable");
    }
    drop(run);
    let kind = |name, form, file: &str, read: fn(&Path) -> Read| {
        FileKind::new(name, form, folder, &format!("{RUN}/{file}"), read)
    };
    let last = |file: &str| format!("checkpoints/step-{:012}/{file}", trainer.steps());
    vec![
        kind("run.json", Form::Object, "run.json", read_info),
        kind("experiment.ron of a run", Form::SealedText, "experiment.ron", read_experiment),
        kind("summary.json", Form::Object, &last("summary.json"), read_summaries),
        kind("arenas.json", Form::Object, &last("arenas.json"), go_on).slow(),
        kind("metrics.jsonl", Form::Lines, "metrics.jsonl", read_curves),
        kind("timing.jsonl", Form::Lines, "timing.jsonl", read_curves),
        kind("metrics.jsonl that is gone on with", Form::Lines, "metrics.jsonl", go_on).slow(),
        kind("timing.jsonl that is gone on with", Form::Lines, "timing.jsonl", go_on).slow(),
    ]
}

fn read_info(folder: &Path) -> Read {
    RunDir::open(&folder.join(RUN)).map(|opened| vec![format!("{:?}", opened.info)]).map_err(words)
}

fn read_experiment(folder: &Path) -> Read {
    RunDir::open(&folder.join(RUN)).map(|opened| vec![format!("{:?}", opened.experiment)]).map_err(words)
}

fn read_summaries(folder: &Path) -> Read {
    let known = checkpoint::list(&folder.join(RUN)).map_err(words)?;
    Ok(vec![format!("{:?}", known.iter().map(|checkpoint| checkpoint.summary).collect::<Vec<_>>())])
}

fn read_curves(folder: &Path) -> Read {
    let curves = RunCurves::read(&folder.join(RUN)).map_err(words)?;
    match curves.warnings() {
        [] => Ok(vec![format!("{:?}", curves.iter().collect::<Vec<_>>())]),
        [first, ..] => Err(first.clone()),
    }
}

/// Resumes the run for an update, and returns the result.
fn go_on(folder: &Path) -> Read {
    let run = folder.join(RUN);
    let opened = RunDir::open_to_write(&run).map_err(words)?;
    let resumed = opened.run.resume(&Corridor, &opened.experiment, DeviceKind::Flex, 1);
    let mut trainer = resumed.map_err(words)?;
    let begun = format!("{} steps, {} updates", trainer.steps(), trainer.updates());
    let report = trainer.update().map_err(words)?;
    let mut parts = vec![begun, format!("{:?}", report.scalars())];
    for file in ["metrics.jsonl", "timing.jsonl"] {
        parts.push(digits(&fs::read(run.join(file)).map_err(words)?));
    }
    Ok(parts)
}
