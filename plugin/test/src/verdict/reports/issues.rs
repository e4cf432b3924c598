//! Issues of levels, in the forms that build servers and editors read.

use crate::{
    findings::{Date, PinState},
    verdict::{
        Finding, LevelOutcome, LevelVerdict, ResultLines,
        error::TestError,
        pinned::{PinnedFindings, pinned_words},
        reports::failure,
    },
};
use bevy_playbot::state_hash::StateHash;
use playbot_harness::level_files::is_level_files;
use playbot_report::escape::uri_path;
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
    /// The pin that holds, with which it does not count.
    pin: Option<PinState>,
    /// The same for the same issue in other results.
    fingerprint: String,
}

impl Issue {
    /// Returns the words of an error, of a warning, or of an issue that does not count.
    fn severity(&self, [error, warning, pinned]: [&'static str; 3]) -> &'static str {
        match (&self.pin, self.is_error) {
            (Some(_), _) => pinned,
            (None, true) => error,
            (None, false) => warning,
        }
    }

    /// Returns the message, with the reason of the pin in front.
    fn words(&self) -> String {
        let pin = self.pin.as_ref().map_or_else(String::new, |pin| format!("{}; ", pinned_words(pin)));
        format!("{pin}{}", self.message)
    }
}

/// Returns the issues of the results in a folder, in a form. Pinned ones have the lowest severity, since `test` does not
/// count them.
///
/// # Errors
///
/// The folder has no results, or they or its pins are damaged.
pub fn issues(folder: &Path, form: IssueForm) -> Result<String, TestError> {
    issues_on(folder, form, Date::today())
}

fn issues_on(folder: &Path, form: IssueForm, today: Date) -> Result<String, TestError> {
    let pinned = PinnedFindings::read(folder, today)?;
    let mut lines = ResultLines::open(folder)?;
    let game = lines.record().game.clone();
    let is_files = is_level_files(&lines.record().range.mode);
    let mut all: Vec<Issue> = Vec::new();
    let mut known = BTreeSet::new();
    while let Some(level) = lines.next_level()? {
        for mut issue in of_level(&game, is_files, &level, &pinned) {
            // Readers take issues with equal fingerprints for one.
            while !known.insert(issue.fingerprint.clone()) {
                issue.fingerprint = fingerprint(&[&issue.fingerprint, "again"]);
            }
            all.push(issue);
        }
    }
    Ok(match form {
        IssueForm::Sarif => format!("{:#}\n", sarif(&all)),
        IssueForm::CodeQuality => format!("{:#}\n", code_quality(&all)),
        IssueForm::Warnings => format!("{:#}\n", warnings(&all)),
        IssueForm::Github => all.iter().map(github).collect(),
    })
}

fn of_level(game: &str, is_files: bool, level: &LevelVerdict, pinned: &PinnedFindings) -> Vec<Issue> {
    // Readers look for files from the root of a repository, and know no folder that is called `.`.
    let file = || level.level.strip_prefix("./").unwrap_or(&level.level).to_owned();
    let place = if is_files { file() } else { format!("{game}/{}", level.level) };
    let issue = |rule: &str, message: String, is_error: bool, pin: Option<&PinState>| Issue {
        rule: rule.to_owned(),
        place: place.clone(),
        is_file: is_files,
        fingerprint: fingerprint(&[rule, &place, &message]),
        message,
        is_error,
        pin: pin.cloned(),
    };
    let found = |finding: &Finding| {
        let who = finding.tester.as_ref().map_or_else(String::new, |tester| format!(" ({tester})"));
        issue(&finding.detector, format!("{}{who}", finding.message), true, pinned.of_finding(finding))
    };
    let mut issues: Vec<Issue> = level.findings.iter().map(found).collect();
    if level.outcome == LevelOutcome::BotFailed && issues.is_empty() {
        let message = format!("no tester solved it, which proves nothing: {}", failure(level));
        issues.push(issue("unsolved", message, false, pinned.of_unsolved(level)));
    }
    if level.is_regression() {
        issues.push(issue("recording", level.recorded_news().unwrap_or_default(), true, None));
    }
    issues
}

/// Returns a hash of some words.
fn fingerprint(words: &[&str]) -> String {
    // No byte is as large as what stands between two words.
    let bytes = words.iter().flat_map(|word| word.bytes().map(u64::from).chain([u64::MAX]));
    format!("{:016x}", StateHash::of(bytes).0)
}

/// Returns a path, of Windows as well, as a URI reference.
fn uri(path: &str) -> String {
    uri_path(&path.replace('\\', "/"))
}

fn sarif(issues: &[Issue]) -> Value {
    let rules: BTreeSet<&str> = issues.iter().map(|issue| issue.rule.as_str()).collect();
    let rules: Vec<&str> = rules.into_iter().collect();
    let results: Vec<Value> = issues
        .iter()
        .map(|issue| {
            // GitHub refuses a whole file if one location has no file and line, so a level without a file has its name as
            // one.
            let artifact = json!({ "uri": uri(&issue.place) });
            let physical = json!({ "artifactLocation": artifact, "region": { "startLine": 1 } });
            let mut location = json!({ "physicalLocation": physical });
            if !issue.is_file {
                location["logicalLocations"] = json!([{ "fullyQualifiedName": issue.place, "kind": "resource" }]);
            }
            let mut result = json!({
                "ruleId": issue.rule,
                "ruleIndex": rules.binary_search(&issue.rule.as_str()).unwrap_or(0),
                "level": issue.severity(["error", "warning", "note"]),
                "message": { "text": issue.message },
                "locations": [location],
                "partialFingerprints": { "playbot/v1": issue.fingerprint },
            });
            if let Some(pin) = &issue.pin {
                let justification = format!("{} (until {})", pin.reason, pin.until);
                result["suppressions"] =
                    json!([{ "kind": "external", "status": "accepted", "justification": justification }]);
            }
            result
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
            "description": issue.words(),
            "check_name": issue.rule,
            "fingerprint": issue.fingerprint,
            "severity": issue.severity(["major", "minor", "info"]),
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
            "severity": issue.severity(["ERROR", "NORMAL", "LOW"]),
            "category": issue.rule,
            "type": issue.rule,
            "message": issue.words(),
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
    let kind = issue.severity(["error", "warning", "notice"]);
    let file = if issue.is_file { format!("file={},line=1,", property(&issue.place)) } else { String::new() };
    let place = if issue.is_file { String::new() } else { format!("{}: ", issue.place) };
    format!("::{kind} {file}title={}::{}\n", property(&issue.rule), message(&format!("{place}{}", issue.words())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{
            LevelOutcome, TestRecord,
            pinned::tests::{in_file, pin},
        },
        verdict_report::testing::{finding, level, record, tested},
    };
    use serde_json::Map;

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

    /// Returns the issues of two levels, with one finding each and one that is pinned.
    fn pinned(form: IssueForm, today: &str) -> String {
        let parent = tempfile::tempdir().expect("a folder");
        let with = |index, names: &[&str]| LevelVerdict {
            findings: names.iter().map(|name| in_file(name)).collect(),
            ..level(index, 0, 9, 0)
        };
        let folder =
            tested(parent.path(), "whole", &record("hard:0..1", None), &[with(0, &["a"]), with(1, &["b", "c"])]);
        pin(&folder, &["a", "b"], "2027-01-31");
        issues_on(&folder, form, today.parse().expect("a day")).expect("results")
    }

    #[test]
    fn pinned_findings_are_no_errors_until_their_pins_expire() {
        let [held, expired] = ["2027-01-31", "2027-02-01"].map(|day| pinned(IssueForm::Github, day));
        let notice = "::notice title=panic::garden/hard:0: pinned until 2027-01-31: drawn anew in spring; a (random)";
        assert_eq!(held.lines().next(), Some(notice));
        let count = |text: &str, kind: &str| text.lines().filter(|line| line.starts_with(kind)).count();
        assert_eq!((count(&held, "::notice "), count(&held, "::error "), held.lines().count()), (2, 1, 3), "{held}");
        assert_eq!((count(&expired, "::notice "), count(&expired, "::error ")), (0, 3), "{expired}");
        let json = |form, day| serde_json::from_str::<Value>(&pinned(form, day)).expect("JSON");
        let results = |day| json(IssueForm::Sarif, day)["runs"][0]["results"].clone();
        let [now, later] = ["2027-01-31", "2027-02-01"].map(results);
        let suppressed = json!([{
            "kind": "external", "status": "accepted", "justification": "drawn anew in spring (until 2027-01-31)",
        }]);
        assert_eq!((&now[0]["level"], &now[0]["suppressions"]), (&"note".into(), &suppressed));
        assert_eq!((&now[2]["level"], &now[2]["suppressions"]), (&"error".into(), &Value::Null));
        assert_eq!(now[0]["partialFingerprints"], later[0]["partialFingerprints"], "it is the same issue");
        assert!(later.as_array().is_some_and(|all| all.iter().all(|result| result["level"] == "error")), "{later}");
        let severities = |value: &Value| [0, 1, 2].map(|number| value[number]["severity"].clone());
        assert_eq!(severities(&json(IssueForm::CodeQuality, "2027-01-31")), ["info", "info", "major"]);
        assert_eq!(severities(&json(IssueForm::Warnings, "2027-01-31")["issues"]), ["LOW", "LOW", "ERROR"]);
    }

    #[test]
    fn commands_of_a_workflow_are_a_line_each() {
        let text = all("hard:0..2", IssueForm::Github);
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(text.starts_with("::error title=panic::garden/hard:0: line one%0Aline two: 100 %25"), "{text}");
        assert!(text.contains("::warning title=unsolved::garden/hard:1: no tester solved it"), "{text}");
    }

    /// The schemas of the forms that are JSON, as far as they are written.
    const SCHEMAS: [(IssueForm, &str); 3] = [
        (IssueForm::Sarif, include_str!("../../../tests/fixtures/sarif.schema.json")),
        (IssueForm::CodeQuality, include_str!("../../../tests/fixtures/code-quality.schema.json")),
        (IssueForm::Warnings, include_str!("../../../tests/fixtures/warnings.schema.json")),
    ];

    /// A JSON Schema, of the keywords that the schemas above have.
    struct Schema(Value);

    impl Schema {
        fn of(text: &str) -> Self {
            Self(serde_json::from_str(text).expect("a schema"))
        }

        /// Returns the faults of a value.
        fn faults(&self, value: &Value) -> Vec<String> {
            let mut faults = Vec::new();
            self.look(&self.0, value, "", &mut faults);
            faults
        }

        fn look(&self, schema: &Value, value: &Value, at: &str, faults: &mut Vec<String>) {
            let none = Map::new();
            let object = value.as_object().unwrap_or(&none);
            for (keyword, wanted) in schema.as_object().expect("a schema is an object") {
                let is_kept = match keyword.as_str() {
                    "$comment" | "definitions" | "properties" => true,
                    "$ref" => {
                        let name =
                            wanted.as_str().and_then(|name| name.strip_prefix("#/definitions/")).expect("a name");
                        self.look(&self.0["definitions"][name], value, at, faults);
                        true
                    }
                    "type" => match wanted.as_str() {
                        Some("object") => value.is_object(),
                        Some("array") => value.is_array(),
                        Some("string") => value.is_string(),
                        Some("integer") => value.is_i64() || value.is_u64(),
                        other => panic!("unknown type {other:?}"),
                    },
                    "const" => value == wanted,
                    "enum" => wanted.as_array().expect("a list").contains(value),
                    "minimum" => value.as_i64() >= wanted.as_i64(),
                    "minLength" => value.as_str().is_some_and(|text| text.chars().count() as u64 >= as_count(wanted)),
                    "minItems" => value.as_array().is_some_and(|items| items.len() as u64 >= as_count(wanted)),
                    "uniqueItems" => {
                        let items: Vec<String> = value.as_array().into_iter().flatten().map(Value::to_string).collect();
                        items.iter().collect::<BTreeSet<_>>().len() == items.len()
                    }
                    "format" => value.as_str().is_some_and(|text| has_format(text, wanted)),
                    "required" => wanted
                        .as_array()
                        .into_iter()
                        .flatten()
                        .all(|key| object.contains_key(key.as_str().expect("a key"))),
                    "additionalProperties" => {
                        let others = object.iter().filter(|(key, _)| schema["properties"].get(key).is_none());
                        match wanted {
                            Value::Bool(false) => others.count() == 0,
                            wanted => {
                                others
                                    .for_each(|(key, inner)| self.look(wanted, inner, &format!("{at}/{key}"), faults));
                                true
                            }
                        }
                    }
                    "items" => {
                        for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                            self.look(wanted, item, &format!("{at}/{index}"), faults);
                        }
                        true
                    }
                    other => panic!("unknown keyword {other}"),
                };
                if !is_kept {
                    faults.push(format!("{at}: {keyword}"));
                }
            }
            for (key, inner) in object {
                if let Some(schema) = schema["properties"].get(key) {
                    self.look(schema, inner, &format!("{at}/{key}"), faults);
                }
            }
        }
    }

    fn as_count(value: &Value) -> u64 {
        value.as_u64().expect("a count")
    }

    /// Returns whether a text has a format, by RFC 3986 for references.
    fn has_format(text: &str, format: &Value) -> bool {
        let is_hex = |byte: &u8| byte.is_ascii_hexdigit();
        match format.as_str() {
            Some("hex") => !text.is_empty() && text.bytes().all(|byte| is_hex(&byte)),
            Some("relative-path") => !text.starts_with(['/', '.']),
            Some("uri-reference") => {
                let marks = b"-._~:/?#[]@!$&'()*+,;=%";
                let is_escaped = |part: &str| part.len() >= 2 && part.as_bytes()[..2].iter().all(is_hex);
                text.bytes().all(|byte| byte.is_ascii_alphanumeric() || marks.contains(&byte))
                    && text.split('%').skip(1).all(is_escaped)
                    && !text.split('/').next().unwrap_or_default().contains(':')
            }
            other => panic!("unknown format {other:?}"),
        }
    }

    /// Letters that have a meaning in JSON, in XML, in a URI, in a path, on a terminal or in a workflow.
    const HOSTILE: &str =
        "a \"quoted\" \\ line\r\n::error file=x,line=1::two: 100 % ü § 🎮 \u{1b}[31m\u{0}\u{2028} <b>]]>&amp;";

    /// Returns the issues of hostile results: names, messages and testers with letters of all kinds.
    fn hostile(is_files: bool, form: IssueForm) -> String {
        let parent = tempfile::tempdir().expect("a folder");
        let range = if is_files { "files:**/*.json:0..3" } else { "hard:0..3" };
        let mut record = record(range, None);
        if !is_files {
            record.game = HOSTILE.to_owned();
        }
        let mut levels = [level(0, 0, 9, 0), level(1, 0, 9, 0), level(2, 0, 9, 0), level(3, 9, 9, 30)];
        let names = ["./levels/a b.json", "levels\\ü:c,d%.json", HOSTILE, "sound.json"];
        if is_files {
            levels.iter_mut().zip(names).for_each(|(level, name)| level.level = name.to_owned());
        }
        let mut by_hostile = finding("a:b,c", HOSTILE);
        by_hostile.tester = Some(HOSTILE.to_owned());
        // The same one twice.
        levels[0].findings = vec![finding("panic", HOSTILE), finding("panic", HOSTILE), by_hostile];
        levels[1].findings = vec![finding("unreachable-goal", "no path")];
        levels[1].outcome = LevelOutcome::ProvedUnsolvable;
        issues(&tested(parent.path(), "hostile", &record, &levels), form).expect("results")
    }

    /// Returns the issues of results without an issue.
    fn of_sound(levels: u64, form: IssueForm) -> String {
        let parent = tempfile::tempdir().expect("a folder");
        let record = TestRecord { ..record("hard:0..2", None) };
        let levels: Vec<_> = (0..levels).map(|index| level(index, 9, 9, 30)).collect();
        issues(&tested(parent.path(), "sound", &record, &levels), form).expect("results")
    }

    #[test]
    fn each_form_fits_its_schema_whatever_the_texts_are() {
        for (form, schema) in SCHEMAS {
            let schema = Schema::of(schema);
            let pinned = pinned(form, "2027-01-31");
            let texts = [hostile(true, form), hostile(false, form), all("hard:0..2", form), of_sound(3, form), pinned];
            for text in texts {
                let value: Value = serde_json::from_str(&text).expect("JSON");
                assert_eq!(schema.faults(&value), Vec::<String>::new(), "{form:?}: {text}");
            }
        }
    }

    #[test]
    fn what_refers_to_another_part_fits_it() {
        for is_files in [true, false] {
            let sarif: Value = serde_json::from_str(&hostile(is_files, IssueForm::Sarif)).expect("JSON");
            let run = &sarif["runs"][0];
            let results = run["results"].as_array().expect("results");
            assert_eq!(results.len(), 5);
            for result in results {
                let rule = &run["tool"]["driver"]["rules"][as_count(&result["ruleIndex"]) as usize];
                assert_eq!(rule["id"], result["ruleId"]);
                let is_logical = result["locations"][0].get("logicalLocations").is_some();
                assert_ne!(is_logical, is_files, "{result}");
            }
            let warnings: Value = serde_json::from_str(&hostile(is_files, IssueForm::Warnings)).expect("JSON");
            assert_eq!((&warnings["size"], warnings["issues"].as_array().map(Vec::len)), (&5.into(), Some(5)));
            let quality: Value = serde_json::from_str(&hostile(is_files, IssueForm::CodeQuality)).expect("JSON");
            let quality = quality.as_array().expect("issues");
            let fingerprints: BTreeSet<_> = quality.iter().filter_map(|issue| issue["fingerprint"].as_str()).collect();
            assert_eq!(fingerprints.len(), 5, "two equal findings are two issues");
            assert_eq!(is_files, quality[0]["location"]["path"] == "levels/a b.json", "{quality:?}");
        }
    }

    #[test]
    fn what_does_not_fit_a_schema_is_found() {
        /// Where the list of issues is, where an issue has its place, and what can be wrong with it.
        type Planted<'a> = (&'a str, &'a [(&'a str, Option<Value>)]);
        let planted: [Planted; 3] = [
            (
                "/runs/0/results/0",
                &[
                    ("/message", None),
                    ("/message/text", Some(1.into())),
                    ("/message/text", Some("".into())),
                    ("/level", Some("fatal".into())),
                    ("/ruleIndex", Some((-2).into())),
                    ("/ruleIndex", Some(0.5.into())),
                    ("/locations", Some(json!([]))),
                    ("/locations/0/physicalLocation", None),
                    ("/locations/0/physicalLocation/region/startLine", Some(0.into())),
                    ("/locations/0/physicalLocation/artifactLocation/uri", Some("a b".into())),
                    ("/locations/0/physicalLocation/artifactLocation/uri", Some("a%2".into())),
                    ("/locations/0/physicalLocation/artifactLocation/uri", Some("hard:0/a".into())),
                    ("/partialFingerprints/more", Some(1.into())),
                    ("/severity", Some("error".into())),
                ],
            ),
            (
                "/0",
                &[
                    ("/fingerprint", None),
                    ("/fingerprint", Some("a b".into())),
                    ("/severity", Some("error".into())),
                    ("/location/path", Some("./a.json".into())),
                    ("/location/path", Some("/a.json".into())),
                    ("/location/lines/begin", Some("1".into())),
                    ("/location/lines", None),
                ],
            ),
            (
                "/issues/0",
                &[
                    ("/message", None),
                    ("/severity", Some("error".into())),
                    ("/lineStart", Some((-1).into())),
                    ("/line", Some(1.into())),
                ],
            ),
        ];
        for ((form, schema), (issue, faults)) in SCHEMAS.into_iter().zip(planted) {
            let schema = Schema::of(schema);
            let sound: Value = serde_json::from_str(&hostile(true, form)).expect("JSON");
            for (place, fault) in faults {
                let mut broken = sound.clone();
                let (parent, key) = place.rsplit_once('/').expect("a place");
                let parent = broken.pointer_mut(&format!("{issue}{parent}")).expect("it is there");
                let object = parent.as_object_mut().expect("an object");
                match fault {
                    Some(value) => drop(object.insert(key.to_owned(), value.clone())),
                    None => drop(object.remove(key).expect("it is there")),
                }
                assert!(!schema.faults(&broken).is_empty(), "{form:?}: {place} {fault:?} is not found");
            }
        }
    }

    /// A command as the runner of GitHub's workflows reads it: kind, properties, message.
    type Command = (String, Vec<(String, String)>, String);

    /// Reads a command.
    fn command(line: &str) -> Option<Command> {
        let unescaped = |text: &str, escapes: &[(&str, &str)]| {
            escapes.iter().fold(text.to_owned(), |text, (code, letter)| text.replace(code, letter))
        };
        let of_message = [("%0D", "\r"), ("%0A", "\n"), ("%25", "%")];
        let of_property = [("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")];
        let (head, message) = line.strip_prefix("::")?.split_once("::")?;
        let (kind, properties) = head.split_once(' ').unwrap_or((head, ""));
        let pairs = properties.split(',').filter(|pair| !pair.is_empty()).map(|pair| pair.split_once('='));
        let pairs = pairs.map(|pair| pair.map(|(key, value)| (key.trim().to_owned(), unescaped(value, &of_property))));
        Some((kind.to_owned(), pairs.collect::<Option<_>>()?, unescaped(message, &of_message)))
    }

    #[test]
    fn workflows_read_every_issue_as_it_was_meant() {
        for is_files in [true, false] {
            let text = hostile(is_files, IssueForm::Github);
            // The runner breaks lines at these two.
            let lines: Vec<&str> = text.split(['\r', '\n']).filter(|line| !line.is_empty()).collect();
            assert_eq!(lines.len(), 5, "{text}");
            let commands: Vec<Command> = lines.into_iter().map(|line| command(line).expect(line)).collect();
            let kinds: Vec<&str> = commands.iter().map(|(kind, ..)| kind.as_str()).collect();
            assert_eq!(kinds, ["error", "error", "error", "error", "warning"]);
            let place = |file: &str| if is_files { String::new() } else { format!("{HOSTILE}/hard:{file}: ") };
            assert_eq!(commands[0].2, format!("{}{HOSTILE} (random)", place("0")));
            assert_eq!(commands[2].2, format!("{}{HOSTILE} ({HOSTILE})", place("0")));
            let title = ("title".to_owned(), "a:b,c".to_owned());
            let of_file =
                |path: &str| [("file", path), ("line", "1")].map(|(key, value)| (key.to_owned(), value.to_owned()));
            let properties = |path: &str| if is_files { of_file(path).to_vec() } else { Vec::new() };
            assert_eq!(commands[2].1, [properties("levels/a b.json"), vec![title]].concat());
            let title = ("title".to_owned(), "unsolved".to_owned());
            assert_eq!(commands[4].1, [properties(HOSTILE), vec![title]].concat());
        }
        assert_eq!(of_sound(3, IssueForm::Github), "", "there is nothing to annotate");
        assert_eq!(command("::error title=a"), None, "a reader that takes everything tests nothing");
    }

    #[test]
    fn paths_are_uris() {
        assert_eq!(uri("levels\\a b%.json"), "levels/a%20b%25.json");
        assert_eq!(fingerprint(&["a", "b"]).len(), 16);
        assert_ne!(fingerprint(&["ab", "c"]), fingerprint(&["a", "bc"]));
    }
}
