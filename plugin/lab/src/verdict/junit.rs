//! Results as JUnit XML for build servers: a test case for each level.

use std::path::Path;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::{
    error::TestError,
    level_verdict::{LevelOutcome, LevelVerdict},
    plan::TestRecord,
    rerun::rerun_commands,
    results::ResultLines,
};

/// Converts the results in a folder. A level that was not solved, or that has a finding, has failed.
pub(super) fn junit(folder: &Path, program: &str) -> Result<String, TestError> {
    let mut lines = ResultLines::open(folder)?;
    let record = lines.record().clone();
    let name = format!("{} {}", record.game, record.range);
    let mut suite = TestSuite::new(name.as_str());
    while let Some(level) = lines.next_level()? {
        suite.add_test_case(test_case(&record, &level, program));
    }
    let mut report = Report::new(name.as_str());
    report.add_test_suite(suite);
    report.to_string().map_err(|error| TestError::Junit(error.to_string()))
}

fn test_case(record: &TestRecord, level: &LevelVerdict, program: &str) -> TestCase {
    let status = if level.is_sound() {
        TestCaseStatus::success()
    } else {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_type(kind(level)).set_message(message(level));
        status.set_description(description(record, level, program));
        status
    };
    let mut case = TestCase::new(level.level.as_str(), status);
    case.set_classname(record.game.as_str());
    case
}

/// Returns the kind of a failure, in a word.
fn kind(level: &LevelVerdict) -> &str {
    match level.outcome {
        LevelOutcome::Solved => level.findings.first().map_or("finding", |finding| finding.detector.as_str()),
        outcome => outcome.name(),
    }
}

/// Describes the failure of a level in one line.
pub(super) fn message(level: &LevelVerdict) -> String {
    let solved = format!("solved {} of {} episodes", level.score.solved, level.score.episodes);
    let finding = level.findings.first().map(|finding| format!("{}: {}", finding.detector, finding.message));
    let more = level.findings.len().saturating_sub(1);
    let more = if more > 0 { format!(" (and {more} more)") } else { String::new() };
    format!("{solved}{}{more}", finding.map_or_else(String::new, |finding| format!("; {finding}")))
}

fn description(record: &TestRecord, level: &LevelVerdict, program: &str) -> String {
    let mut lines = vec![format!("{}: {}", level.level, level.outcome.name())];
    for tester in &level.testers {
        let score = &tester.score;
        lines.push(format!(
            "{}: solved {} of {}, lost {}, timed out {}, broken {}",
            tester.tester, score.solved, score.episodes, score.lost, score.timed_out, score.broken
        ));
    }
    for finding in &level.findings {
        let tester = finding.tester.as_ref().map_or_else(String::new, |tester| format!(" ({tester})"));
        let tick = finding.tick.map_or_else(String::new, |tick| format!(", tick {tick}"));
        lines.push(format!("{}{tester}{tick}: {}", finding.detector, finding.message));
    }
    lines.extend(rerun_commands(program, record, level));
    lines.join("\n")
}
