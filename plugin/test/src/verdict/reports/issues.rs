//! Issues of levels, in the forms that build servers and editors read.

use crate::verdict::{Finding, LevelOutcome, LevelVerdict, ResultLines, error::TestError, reports::failure};
use bevy_playbot::state_hash::StateHash;
use playbot_harness::level_files::is_level_files;
use serde_json::{Value, json};
use std::{collections::BTreeSet, path::Path};

/// A form of a list of issues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IssueForm {
    /// SARIF 2.1.0, which GitHub's code scanning and editors read.
    Sarif,
    /// GitLab's code quality report.
    CodeQuality,
    /// The form of Jenkins' plugin Warnings Next Generation.
    Warnings,
    /// Commands of a GitHub workflow, a line each, which annotate files of a pull request.
    Github,
}

impl IssueForm {
    /// All forms.
    pub const ALL: [Self; 4] = [Self::Sarif, Self::CodeQuality, Self::Warnings, Self::Github];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sarif => "sarif",
            Self::CodeQuality => "code-quality",
            Self::Warnings => "warnings",
            Self::Github => "github",
        }
    }
}

/// Something wrong with a level.
struct Issue {
    /// What is wrong, in a word: a detector, or `unsolved`.
    rule: String,
    /// The level: the path of its file, or the game with mode and number.
    place: String,
    /// Whether it is a file.
    is_file: bool,
    /// The message.
    message: String,
    /// Whether it is certain that something is wrong.
    is_error: bool,
    /// The same for the same issue in other results.
    fingerprint: String,
}

/// Returns the issues of the results in a folder, in a form.
///
/// # Errors
///
/// The folder has no results, or they are damaged.
pub fn issues(folder: &Path, form: IssueForm) -> Result<String, TestError> {
    let mut lines = ResultLines::open(folder)?;
    let game = lines.record().game.clone();
    let is_files = is_level_files(&lines.record().range.mode);
    let mut all = Vec::new();
    while let Some(level) = lines.next_level()? {
        all.extend(of_level(&game, is_files, &level));
    }
    Ok(match form {
        IssueForm::Sarif => format!("{:#}\n", sarif(&all)),
        IssueForm::CodeQuality => format!("{:#}\n", code_quality(&all)),
        IssueForm::Warnings => format!("{:#}\n", warnings(&all)),
        IssueForm::Github => all.iter().map(github).collect(),
    })
}

fn of_level(game: &str, is_files: bool, level: &LevelVerdict) -> Vec<Issue> {
    let place = if is_files { level.level.clone() } else { format!("{game}/{}", level.level) };
    let issue = |rule: &str, message: String, is_error: bool| Issue {
        rule: rule.to_owned(),
        place: place.clone(),
        is_file: is_files,
        fingerprint: fingerprint(&[rule, &place, &message]),
        message,
        is_error,
    };
    let found = |finding: &Finding| {
        let who = finding.tester.as_ref().map_or_else(String::new, |tester| format!(" ({tester})"));
        issue(&finding.detector, format!("{}{who}", finding.message), true)
    };
    let mut issues: Vec<Issue> = level.findings.iter().map(found).collect();
    if level.outcome == LevelOutcome::BotFailed && issues.is_empty() {
        issues.push(issue("unsolved", format!("no tester solved it, which proves nothing: {}", failure(level)), false));
    }
    if level.is_regression() {
        issues.push(issue("recording", level.recorded_news().unwrap_or_default(), true));
    }
    issues
}

/// Returns a hash of some words.
fn fingerprint(words: &[&str]) -> String {
    // No byte is as large as what stands between two words.
    let bytes = words.iter().flat_map(|word| word.bytes().map(u64::from).chain([u64::MAX]));
    format!("{:016x}", StateHash::of(bytes).0)
}

/// Returns a path as a URI reference: what is no letter, digit or mark is escaped.
fn uri(path: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte);
    path.replace('\\', "/")
        .bytes()
        .map(|byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") })
        .collect()
}

fn sarif(issues: &[Issue]) -> Value {
    let rules: BTreeSet<&str> = issues.iter().map(|issue| issue.rule.as_str()).collect();
    let rules: Vec<&str> = rules.into_iter().collect();
    let results: Vec<Value> = issues
        .iter()
        .map(|issue| {
            let location = if issue.is_file {
                json!({ "physicalLocation": { "artifactLocation": { "uri": uri(&issue.place) }, "region": { "startLine": 1 } } })
            } else {
                json!({ "logicalLocations": [{ "fullyQualifiedName": issue.place, "kind": "resource" }] })
            };
            json!({
                "ruleId": issue.rule,
                "ruleIndex": rules.binary_search(&issue.rule.as_str()).unwrap_or(0),
                "level": if issue.is_error { "error" } else { "warning" },
                "message": { "text": issue.message },
                "locations": [location],
                "partialFingerprints": { "playbot/v1": issue.fingerprint },
            })
        })
        .collect();
    let rules: Vec<Value> = rules
        .iter()
        .map(|rule| json!({ "id": rule, "shortDescription": { "text": rule.replace('-', " ") } }))
        .collect();
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": { "name": "playbot", "version": env!("CARGO_PKG_VERSION"), "rules": rules } },
            "columnKind": "utf16CodeUnits",
            "results": results,
        }],
    })
}

fn code_quality(issues: &[Issue]) -> Value {
    let issue = |issue: &Issue| {
        json!({
            "description": issue.message,
            "check_name": issue.rule,
            "fingerprint": issue.fingerprint,
            "severity": if issue.is_error { "major" } else { "minor" },
            "location": { "path": issue.place, "lines": { "begin": 1 } },
        })
    };
    issues.iter().map(issue).collect()
}

fn warnings(issues: &[Issue]) -> Value {
    let issue = |issue: &Issue| {
        json!({
            "fileName": issue.place,
            "lineStart": 1,
            "severity": if issue.is_error { "ERROR" } else { "NORMAL" },
            "category": issue.rule,
            "type": issue.rule,
            "message": issue.message,
            "fingerprint": issue.fingerprint,
        })
    };
    let all: Vec<Value> = issues.iter().map(issue).collect();
    json!({ "_class": "io.jenkins.plugins.analysis.core.restapi.ReportApi", "size": all.len(), "issues": all })
}

/// Returns the command for an issue, with its escapes for messages and for properties.
fn github(issue: &Issue) -> String {
    let message = |text: &str| text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A");
    let property = |text: &str| message(text).replace(':', "%3A").replace(',', "%2C");
    let kind = if issue.is_error { "error" } else { "warning" };
    let file = if issue.is_file { format!("file={},line=1,", property(&issue.place)) } else { String::new() };
    let place = if issue.is_file { String::new() } else { format!("{}: ", issue.place) };
    format!("::{kind} {file}title={}::{}\n", property(&issue.rule), message(&format!("{place}{}", issue.message)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict_report::testing::{finding, level, record, tested};

    /// Returns the issues of three levels: one with two findings, one unsolved, one sound.
    fn all(range: &str, form: IssueForm) -> String {
        let parent = tempfile::tempdir().expect("a folder");
        let mut bad = level(0, 0, 9, 0);
        bad.level = if range.starts_with("files") { "levels/a b.json" } else { "hard:0" }.to_owned();
        bad.findings = vec![finding("panic", "line one\nline two: 100 %"), finding("stuck", "for long")];
        let levels = [bad, level(1, 0, 9, 0), level(2, 9, 9, 30)];
        issues(&tested(parent.path(), "whole", &record(range, None), &levels), form).expect("results")
    }

    #[test]
    fn issues_have_rules_places_and_fingerprints() {
        let sarif: Value = serde_json::from_str(&all("hard:0..2", IssueForm::Sarif)).expect("JSON");
        let run = &sarif["runs"][0];
        assert_eq!(sarif["version"], "2.1.0");
        let rules: Vec<&str> = run["tool"]["driver"]["rules"]
            .as_array()
            .expect("rules")
            .iter()
            .filter_map(|rule| rule["id"].as_str())
            .collect();
        assert_eq!(rules, ["panic", "stuck", "unsolved"]);
        let results = run["results"].as_array().expect("results");
        assert_eq!((results.len(), &results[1]["ruleIndex"], &results[2]["level"]), (3, &1.into(), &"warning".into()));
        assert_eq!(results[0]["locations"][0]["logicalLocations"][0]["fullyQualifiedName"], "garden/hard:0");
        let quality: Value = serde_json::from_str(&all("hard:0..2", IssueForm::CodeQuality)).expect("JSON");
        assert_eq!((&quality[0]["check_name"], &quality[2]["severity"]), (&"panic".into(), &"minor".into()));
        assert_ne!(quality[0]["fingerprint"], quality[1]["fingerprint"]);
        let warnings: Value = serde_json::from_str(&all("hard:0..2", IssueForm::Warnings)).expect("JSON");
        assert_eq!((&warnings["size"], &warnings["issues"][0]["fileName"]), (&3.into(), &"garden/hard:0".into()));
    }

    #[test]
    fn commands_of_a_workflow_are_a_line_each() {
        let text = all("hard:0..2", IssueForm::Github);
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(text.starts_with("::error title=panic::garden/hard:0: line one%0Aline two: 100 %25"), "{text}");
        assert!(text.contains("::warning title=unsolved::garden/hard:1: no tester solved it"), "{text}");
    }

    #[test]
    fn paths_are_uris() {
        assert_eq!(uri("levels\\a b%.json"), "levels/a%20b%25.json");
        assert_eq!(fingerprint(&["a", "b"]).len(), 16);
        assert_ne!(fingerprint(&["ab", "c"]), fingerprint(&["a", "bc"]));
    }
}
