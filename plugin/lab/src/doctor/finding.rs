//! The findings of an examination.

use serde::Serialize;

use super::{
    cause::{Cause, CauseKind, causes},
    observed::{NonFiniteValue, ObservationReport},
    report::{Comparison, ComparisonReport, Difference},
};

/// The kind of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Two copies did not play the same game.
    Differs,
    /// The game broke its contract, or panicked.
    Fault,
    /// An observed value was not a finite number.
    NotFinite,
    /// The number of observed values changed.
    LengthChanges,
    /// No observed value ever changed.
    Blind,
}

/// A finding.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// The kind.
    pub kind: FindingKind,
    /// The message, in a sentence.
    pub what: String,
    /// The comparison that showed it.
    pub comparison: Option<Comparison>,
    /// The first difference.
    pub difference: Option<Difference>,
    /// Causes that fit, likeliest first.
    pub causes: Vec<Cause>,
}

/// Returns all findings, worst first.
pub(super) fn findings(
    comparisons: &[ComparisonReport],
    observation: &ObservationReport,
    suspicions: &[(CauseKind, String)],
) -> Vec<Finding> {
    let mut findings = of_observation(observation);
    let is_of_observation = !findings.is_empty();
    for report in comparisons {
        if let Some(difference) = report.difference() {
            findings.push(Finding {
                kind: FindingKind::Differs,
                what: sentence(report.comparison, difference),
                comparison: Some(report.comparison),
                difference: Some(difference.clone()),
                causes: causes(report.comparison, Some(difference), suspicions),
            });
        }
        let Some(fault) = &report.fault else { continue };
        // A bad observation has its own message already, and one fault shows in every comparison.
        let is_known = findings.iter().any(|finding| finding.kind == FindingKind::Fault && finding.what == *fault);
        if !is_of_observation && !is_known {
            findings.push(plain(FindingKind::Fault, fault.clone(), Some(report.comparison)));
        }
    }
    findings
}

fn plain(kind: FindingKind, what: String, comparison: Option<Comparison>) -> Finding {
    Finding { kind, what, comparison, difference: None, causes: Vec::new() }
}

fn of_observation(seen: &ObservationReport) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(NonFiniteValue { tick, name, value }) = &seen.not_finite {
        let what = format!("observation `{name}` is {value} at tick {tick}: no policy can read that");
        findings.push(plain(FindingKind::NotFinite, what, None));
    }
    if let Some((tick, got)) = seen.length {
        let what = format!(
            "the observation has {got} values at tick {tick}, its sensor names {}: every value must be there in every tick",
            seen.values
        );
        findings.push(plain(FindingKind::LengthChanges, what, None));
    }
    if seen.is_blind() {
        let what = format!(
            "none of the {} observed values changed in {} ticks: the agent sees nothing",
            seen.values, seen.ticks
        );
        findings.push(plain(FindingKind::Blind, what, None));
    }
    findings
}

fn sentence(comparison: Comparison, difference: &Difference) -> String {
    use super::report::DifferenceKind::{Component, End, Entities, Observation, Resource, Reward, StateHash};
    let Difference { kind, name, entity, field, tick, .. } = difference;
    let thing = match kind {
        Resource => format!("resource `{name}{field}`"),
        Component => format!("component `{name}{field}` of {}", entity.as_deref().unwrap_or("an entity")),
        Entities => format!("the number of {name}"),
        Observation => format!("observation `{name}` of {}", entity.as_deref().unwrap_or("the agent")),
        Reward | End | StateHash => format!("the {name} of {}", entity.as_deref().unwrap_or("the agent")),
    };
    format!("{}: {thing} differs at tick {tick}", comparison.describe())
}
