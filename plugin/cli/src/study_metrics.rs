//! What a study takes from the metrics of its runs.

use std::path::Path;

use playbot_lab::{
    report::{LearningCurves, TrainingResult, statistics::steps_to_reach},
    runs::RunCurves,
    train::{
        Experiment,
        metrics_log::{EPISODIC_RETURN, SUCCESS_RATE},
    },
};

use super::error::CliError;

/// How a run did in training, from its metrics.
///
/// # Errors
///
/// They cannot be read.
pub fn training_result(run: &Path, experiment: &Experiment, steps: u64) -> Result<TrainingResult, CliError> {
    let curves = RunCurves::read(run)?;
    Ok(TrainingResult {
        steps,
        steps_to_threshold: steps_to_reach(curves.settled(SUCCESS_RATE), experiment.study.threshold),
        success: curves.last(SUCCESS_RATE),
        episodic_return: curves.last(EPISODIC_RETURN),
    })
}

/// What was learned, from the metrics of a run.
///
/// # Errors
///
/// They cannot be read.
pub fn learning_curves(run: &Path) -> Result<LearningCurves, CliError> {
    let curves = RunCurves::read(run)?;
    let of = |tag| curves.curve(tag).to_vec();
    Ok(LearningCurves { success: of(SUCCESS_RATE), returns: of(EPISODIC_RETURN) })
}
