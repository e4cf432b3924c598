//! Diagnosis of a training that does not learn: findings with evidence, likely cause and what to try.
//!
//! [`gather`] reads a run, recordings or a game, and plays. [`diagnose`] reads that evidence and says what is wrong, the
//! most likely cause first. [`FirstWarning`] looks at metrics alone, while a training goes on.
//!
//! The folder, in reading order:
//!
//! - `finding`: signs, findings and the diagnosis; `advice`: what to try, as commands and settings that exist.
//! - `evidence`: all that checks read. `play`, `recordings` and `networks` measure it, and `gather` puts it
//!   together.
//! - `metrics`: checks of settings and metrics. `observation`, `agreement`, `actions`, `reward`, `demonstrations` and
//!   `score`: checks of what was played, recorded and learned.

mod actions;
pub mod advice;
mod agreement;
mod demonstrations;
pub mod evidence;
pub mod finding;
pub mod gather;
mod metrics;
pub mod networks;
mod observation;
pub mod play;
pub mod recordings;
mod reward;
mod score;
#[cfg(test)]
mod testing;

use crate::{experiment::Experiment, metrics_log::UpdateReport, runs::RunCurves, train_run::never_learns};
use std::path::Path;

pub use crate::diagnose::{
    advice::{Advice, AdviceContext},
    evidence::Evidence,
    finding::{Diagnosis, LearningFinding, Sign},
    gather::{DiagnoseError, Gathering, of_game, of_recordings, of_run},
};

/// Says what may keep an agent from learning, the most likely cause first.
pub fn diagnose(evidence: &Evidence) -> Diagnosis {
    let mut found = of_game_itself(evidence);
    if let Some(curves) = &evidence.curves {
        // Players say more of rewards than metrics do.
        let has_played = evidence.played.iter().any(|played| !played.episodes.is_empty());
        let known = metrics::check(&evidence.experiment, curves).into_iter();
        found.extend(known.filter(|finding| !(has_played && finding.sign == Sign::NoReward)));
    }
    found.extend(demonstrations::check(evidence));
    found.extend(observation::check(evidence));
    found.extend(actions::check(evidence));
    found.extend(reward::check(evidence));
    found.extend(agreement::check(evidence));
    found.extend(score::check(evidence));
    Diagnosis::new(found, evidence.notes.clone(), evidence.context.clone())
}

/// Says what settings and metrics of a run show, without reading or playing anything else: for reports.
///
/// # Errors
///
/// The metrics cannot be read.
pub fn of_metrics(experiment: &Experiment, run: &Path) -> Result<Diagnosis, DiagnoseError> {
    let curves = RunCurves::read(run)?;
    let context = AdviceContext { run: Some(run.display().to_string()), ..AdviceContext::new(experiment) };
    Ok(Diagnosis::new(metrics::check(experiment, &curves), Vec::new(), context))
}

fn of_game_itself(evidence: &Evidence) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    if let Some(fault) = evidence.faults.first() {
        found.push(LearningFinding::new(
            Sign::GameFault,
            fault,
            "the game breaks its contract or panics, so training cannot go on",
            &[Advice::Doctor],
        ));
    }
    if let Some(difference) = &evidence.doctor {
        found.push(LearningFinding::new(
            Sign::Differs,
            difference,
            "the same actions lead elsewhere, so what is learned does not hold",
            &[Advice::Doctor],
        ));
    }
    found
}

/// The first warning of a training, from its settings and metrics alone.
#[derive(Clone, Debug)]
pub struct FirstWarning {
    context: AdviceContext,
    curves: RunCurves,
    is_given: bool,
}

impl FirstWarning {
    /// Begins to look at a training in the folder of a run.
    pub fn new(experiment: &Experiment, run: &Path) -> Self {
        let context = AdviceContext { run: Some(run.display().to_string()), ..AdviceContext::new(experiment) };
        Self { context, curves: RunCurves::default(), is_given: false }
    }

    /// Adds the metrics of an update. Returns the most likely cause once something is found, and nothing after that.
    pub fn note(&mut self, report: &UpdateReport) -> Option<String> {
        if self.is_given { None } else { self.add(report.step, report.scalars()) }
    }

    fn add(&mut self, step: u64, scalars: Vec<(&'static str, f64)>) -> Option<String> {
        self.curves.push(step, scalars.into_iter());
        let mut found = metrics::check(&self.context.experiment, &self.curves);
        // A training says by itself that it never begins to learn, and at its end in which lesson it was.
        let told = never_learns(&self.context.experiment);
        found.retain(|finding| finding.sign != Sign::LessonNotLearned && told.as_ref() != Some(&finding.evidence));
        found.sort_by_key(|finding| finding.sign);
        let first = found.first()?;
        self.is_given = true;
        Some(first.warning(&self.context))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{evidence, recorded};

    #[test]
    fn evidence_without_a_fault_gives_no_finding() {
        let mut healthy = evidence("score-ppo", "");
        healthy.recordings = Some(recorded(1, true));
        assert!(diagnose(&healthy).is_healthy());
    }

    #[test]
    fn a_fault_of_the_game_comes_before_all_else() {
        let mut broken = evidence("score-ppo", "");
        broken.recordings = Some(recorded(1, false));
        broken.faults = vec!["agent 0, level 3, tick 7: panicked".to_owned()];
        let signs: Vec<_> = diagnose(&broken).findings.iter().map(|finding| finding.sign).collect();
        assert_eq!(signs, [Sign::GameFault, Sign::NeverWon]);
    }

    #[test]
    fn a_training_is_warned_once() {
        let experiment = evidence("ppo", "ppo: (lr: 1.0)").experiment;
        let mut watch = FirstWarning::new(&experiment, Path::new("runs/a"));
        let metrics = || vec![("losses/approx_kl", 0.01)];
        let words = watch.add(100, metrics()).expect("the rate is too high");
        assert!(words.starts_with("the learning rate is too high: `ppo.lr` is 1"), "{words}");
        assert!(words.contains("--experiment runs/a/experiment.ron --run runs/a-next --set ppo.lr=0.0003"), "{words}");
        assert!(watch.is_given, "a second update is not looked at");
        let healthy = evidence("ppo", "").experiment;
        assert_eq!(FirstWarning::new(&healthy, Path::new("runs/a")).add(100, metrics()), None);
    }
}
