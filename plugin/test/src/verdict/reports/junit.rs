//! JUnit XML, with a test case for each level.
//!
//! The elements and attributes are those that the xUnit plugin of Jenkins accepts (its `junit-10.xsd`), which refuses a
//! whole file for one attribute more. Equal results give equal bytes, so times are those of the game, and a date is that of
//! `SOURCE_DATE_EPOCH`.

use crate::{
    findings::{DAY, Date, PinState},
    verdict::{
        LevelOutcome, LevelVerdict,
        error::{TestError, io_error},
        pinned::{PinnedFindings, pinned_words},
        plan::{TestRecord, TesterRecord},
        reports::{JUNIT, failure, rerun_commands},
        results::{Overview, ResultLines},
    },
};
use playbot_harness::level_files::is_level_files;
use playbot_learner::write_atomically_with;
use quick_xml::{
    Writer,
    events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event},
};
use std::{collections::BTreeSet, env, ffi::OsStr, io, io::Write, path::Path, time::Duration};

/// The host in every file: results are independent of the machine.
const HOST: &str = "localhost";

/// The variable with the date of files that can be made again, byte for byte: see
/// <https://reproducible-builds.org/specs/source-date-epoch/>.
const DATE: &str = "SOURCE_DATE_EPOCH";

/// Seconds from 1970 to the year 10000, which has too many digits for a date.
const DATES: u64 = 253_402_300_800;

/// Returns the date in `junit.xml`, such as `2026-01-01T00:00:00`: that of the variable `SOURCE_DATE_EPOCH`. `None` if it
/// is not set, because the time of the test would make other bytes of equal results.
///
/// # Errors
///
/// The variable is no number of seconds from 1970 to the year 9999.
pub fn report_date() -> Result<Option<String>, TestError> {
    let seconds = env::var_os(DATE).filter(|seconds| !seconds.is_empty());
    seconds.map(|seconds| date(&seconds)).transpose()
}

/// Returns the date in UTC, without a time zone, which readers do not expect.
fn date(seconds: &OsStr) -> Result<String, TestError> {
    let number = seconds.to_str().and_then(|text| text.parse().ok()).filter(|&number: &u64| number < DATES);
    let Some(number) = number else { return Err(TestError::Date(seconds.to_string_lossy().into_owned())) };
    let second = number % DAY;
    let (hour, minute) = (second / 3_600, second / 60 % 60);
    Ok(format!("{}T{hour:02}:{minute:02}:{:02}", Date::of_day(number / DAY), second % 60))
}

/// Writes the results in a folder to `junit.xml` there, with this date. A level that was not solved, that has a finding, or
/// that no longer ends as recorded, has failed. If all that is wrong with it is pinned, it is skipped: it does not count for
/// the exit code of `test` either.
///
/// A suite begins with its counts, which are those of `overview`. So a million levels take no more memory than one.
pub(super) fn write_junit(
    folder: &Path,
    overview: &Overview,
    pinned: &PinnedFindings,
    program: &str,
    date: Option<&str>,
) -> Result<(), TestError> {
    let lines = ResultLines::open(folder)?;
    let path = folder.join(JUNIT);
    let skipped = pinned.excused(folder)?;
    let all = Totals {
        tests: overview.levels,
        failures: overview.unsound.saturating_sub(skipped),
        skipped,
        time: overview.time,
    };
    write_atomically_with(&path, |file| write_suites(file, lines, &all, pinned, program, date))
        .map_err(io_error("write", &path))
}

/// The counts and the time of a suite, or of all.
struct Totals {
    tests: u64,
    failures: u64,
    skipped: u64,
    time: Option<Duration>,
}

fn write_suites(
    file: &mut dyn Write,
    mut lines: ResultLines,
    all: &Totals,
    pinned: &PinnedFindings,
    program: &str,
    date: Option<&str>,
) -> io::Result<()> {
    let record = lines.record().clone();
    let class = class(&record);
    let mut xml = Xml { writer: Writer::new_with_indent(file, b' ', 4) };
    xml.writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let mut suites = Tag::new("testsuites");
    suites.text("name", &format!("{} {}", record.game, record.range));
    suites.text("tests", &all.tests.to_string());
    suites.text("failures", &all.failures.to_string());
    suites.text("errors", "0");
    suites.time(all.time);
    xml.begin(suites)?;
    let is_file_a_suite = is_level_files(&record.range.mode) && all.tests > 0;
    if !is_file_a_suite {
        xml.begin(suite(&record, None, date, all))?;
    }
    while let Some(level) = lines.next_level().map_err(io::Error::other)? {
        let pins = pinned.of_level(&level);
        if is_file_a_suite {
            let skipped = u64::from(!pins.is_empty());
            let failures = u64::from(!level.is_sound()) - skipped;
            let one = Totals { tests: 1, failures, skipped, time: level.time() };
            xml.begin(suite(&record, Some(&level.level), date, &one))?;
        }
        write_case(&mut xml, &record, &level, &pins, program, &class)?;
        if is_file_a_suite {
            xml.end("testsuite")?;
        }
    }
    if !is_file_a_suite {
        xml.end("testsuite")?;
    }
    xml.end("testsuites")?;
    xml.writer.write_indent()
}

/// Returns the suite of all levels, or that of a level file. Readers that show failures at files read the suite's file,
/// because a case may not have one.
fn suite(record: &TestRecord, file: Option<&str>, date: Option<&str>, totals: &Totals) -> Tag {
    let levels = file.map_or_else(|| record.range.to_string(), str::to_owned);
    let mut suite = Tag::new("testsuite");
    suite.text("name", &format!("{} {levels}", record.game));
    suite.text("tests", &totals.tests.to_string());
    suite.text("skipped", &totals.skipped.to_string());
    suite.text("errors", "0");
    suite.text("failures", &totals.failures.to_string());
    suite.time(totals.time);
    if let Some(date) = date {
        suite.text("timestamp", date);
    }
    suite.text("hostname", HOST);
    if let Some(file) = file {
        suite.text("file", file);
    }
    suite
}

fn write_case(
    xml: &mut Xml<'_>,
    record: &TestRecord,
    level: &LevelVerdict,
    pins: &[&PinState],
    program: &str,
    class: &str,
) -> io::Result<()> {
    let mut case = Tag::new("testcase");
    case.text("name", &level.title());
    case.text("classname", class);
    case.time(level.time());
    if level.is_sound() {
        return xml.writer.write_event(Event::Empty(case.0));
    }
    xml.begin(case)?;
    let (name, message) = if pins.is_empty() {
        ("failure", failure(level))
    } else {
        let words: BTreeSet<String> = pins.iter().map(|pin| pinned_words(pin)).collect();
        ("skipped", words.into_iter().collect::<Vec<_>>().join("; "))
    };
    let mut failed = Tag::new(name);
    failed.text("message", &message);
    failed.text("type", kind(level));
    xml.begin(failed)?;
    xml.writer.write_event(Event::Text(BytesText::new(&of_xml(&description(record, level, program)))))?;
    xml.end(name)?;
    xml.end("testcase")
}

/// An XML file that is being written.
struct Xml<'a> {
    writer: Writer<&'a mut dyn Write>,
}

impl Xml<'_> {
    fn begin(&mut self, tag: Tag) -> io::Result<()> {
        self.writer.write_event(Event::Start(tag.0))
    }

    fn end(&mut self, name: &str) -> io::Result<()> {
        self.writer.write_event(Event::End(BytesEnd::new(name)))
    }
}

/// The beginning of an element.
struct Tag(BytesStart<'static>);

impl Tag {
    fn new(name: &'static str) -> Self {
        Self(BytesStart::new(name))
    }

    fn text(&mut self, key: &str, value: &str) {
        self.0.push_attribute((key, of_xml(value).as_str()));
    }

    fn time(&mut self, time: Option<Duration>) {
        if let Some(time) = time {
            self.text("time", &format!("{:.3}", time.as_secs_f64()));
        }
    }
}

/// Leaves out what XML 1.0 cannot hold, not even escaped, and the colours of a terminal. Names of files and messages of
/// panics may have them.
fn of_xml(text: &str) -> String {
    let (mut kept, mut rest) = (String::with_capacity(text.len()), text.chars());
    while let Some(c) = rest.next() {
        match c {
            '\u{1b}' if rest.as_str().starts_with('[') => {
                // The bracket, and everything up to the letter that ends it.
                rest.next();
                rest.find(|c| matches!(c, '@'..='~'));
            }
            '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'.. => kept.push(c),
            _ => {}
        }
    }
    kept
}

/// Returns the class of all cases: game, levels and testers. Build servers take cases of the same class and name for one,
/// so two tests of a game in one pipeline need different classes.
fn class(record: &TestRecord) -> String {
    let range = &record.range;
    // A further file leaves the cases of the others as they were.
    let levels = if is_level_files(&range.mode) { range.mode.clone() } else { range.to_string() };
    let testers = record.testers.iter().map(tester).collect::<Vec<_>>().join("+");
    let seed = if record.seed == 0 { String::new() } else { format!(" seed {}", record.seed) };
    [&record.game, &levels, &format!("{testers}{seed}")].map(|part| without_dots(part)).join(".")
}

/// Replaces full stops, at which readers split a class into packages.
fn without_dots(part: &str) -> String {
    part.replace("..", "-").replace('.', "_")
}

/// Returns a tester as a part of the class: its name, and the file or checkpoint of a policy.
fn tester(record: &TesterRecord) -> String {
    let of_run = || record.run.as_ref().map(|run| format!("({} step {})", run.folder, run.step));
    let of_file = || record.file.as_ref().map(|file| format!("({file})"));
    let greedy = if record.greedy { " greedy" } else { "" };
    format!("{}{}{greedy}", record.name, of_run().or_else(of_file).unwrap_or_default())
}

/// Returns the kind of a failure, in a word.
fn kind(level: &LevelVerdict) -> &str {
    match level.outcome {
        LevelOutcome::Solved => level.findings.first().map_or("recording", |finding| finding.detector.as_str()),
        outcome => outcome.name(),
    }
}

/// Describes a failure in several lines. Begins with its message, because some readers show the text alone.
fn description(record: &TestRecord, level: &LevelVerdict, program: &str) -> String {
    let mut lines = vec![format!("{}: {}", level.title(), level.outcome.name()), failure(level)];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        findings::{RecordedCourse, testing::course},
        verdict::{
            EpisodeScore, Finding, TestedRun,
            folder::{Earlier, TestFolder},
            pinned::tests::{in_file, pin},
            testing,
            testing::{tester, verdict},
        },
    };
    use playbot_harness::{detector::LevelProof, split::LevelSplit};
    use quick_xml::{Reader, XmlVersion};
    use std::{collections::BTreeMap, fs};

    /// Elements of junit-10.xsd that are written: parent, name, required attributes, and others that are allowed. The
    /// schema lets the elements below a suite and a case come in any order.
    const SCHEMA: [(&str, &str, &[&str], &[&str]); 5] = [
        ("", "testsuites", &[], &["name", "time", "tests", "failures", "errors"]),
        (
            "testsuites",
            "testsuite",
            &["name", "tests", "failures", "errors"],
            &["group", "time", "skipped", "timestamp", "hostname", "id", "package", "file", "log", "url", "version"],
        ),
        ("testsuite", "testcase", &["name"], &["time", "classname", "group"]),
        ("testcase", "failure", &[], &["type", "message"]),
        ("testcase", "skipped", &[], &["type", "message"]),
    ];

    /// Attributes that count elements.
    const COUNTS: [&str; 4] = ["tests", "failures", "errors", "skipped"];

    /// An element of the XML.
    struct Element {
        parent: String,
        name: String,
        attributes: BTreeMap<String, String>,
    }

    impl Element {
        /// Returns the value of an attribute that counts.
        fn count(&self, attribute: &str) -> usize {
            self.attributes[attribute].parse().expect("a count")
        }
    }

    fn elements(text: &str) -> Vec<Element> {
        let mut reader = Reader::from_str(text);
        let (mut open, mut found) = (Vec::<String>::new(), Vec::new());
        let words = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("Unicode");
        loop {
            let event = reader.read_event().expect("well-formed XML");
            match &event {
                Event::Start(tag) | Event::Empty(tag) => {
                    let mut attributes = BTreeMap::new();
                    for attribute in tag.attributes() {
                        let attribute = attribute.expect("an attribute");
                        let value = attribute.normalized_value(XmlVersion::Explicit1_0).expect("a value");
                        attributes.insert(words(attribute.key.as_ref()), value.into_owned());
                    }
                    let (parent, name) = (open.last().cloned().unwrap_or_default(), words(tag.name().as_ref()));
                    if matches!(event, Event::Start(_)) {
                        open.push(name.clone());
                    }
                    found.push(Element { parent, name, attributes });
                }
                Event::End(_) => {
                    open.pop();
                }
                Event::Text(words) if words.iter().all(u8::is_ascii_whitespace) => {}
                Event::Text(_) | Event::GeneralRef(_) => {
                    let within = open.last().map(String::as_str);
                    assert!(matches!(within, Some("failure" | "skipped")), "text is elsewhere in {text}");
                }
                Event::Decl(_) => assert!(found.is_empty(), "{text}"),
                Event::Eof => {
                    assert!(open.is_empty(), "{open:?} are not closed in {text}");
                    return found;
                }
                other => panic!("{other:?} in {text}"),
            }
        }
    }

    /// Returns the values of an attribute of all elements of this name; `None` where it is missing.
    fn values(text: &str, name: &str, attribute: &str) -> Vec<Option<String>> {
        let own = elements(text).into_iter().filter(|element| element.name == name);
        own.map(|element| element.attributes.get(attribute).cloned()).collect()
    }

    fn record(mode: &str) -> TestRecord {
        TestRecord {
            range: LevelSplit { mode: mode.to_owned(), first: 0, last: 9 },
            episodes: 2,
            ..testing::record("hard:0..9")
        }
    }

    /// Checks a file as the schema does, whose only type besides text is that of times, and its counts and dates besides.
    fn check(text: &str) {
        let is_character = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..);
        assert!(text.chars().all(is_character), "no XML 1.0: {text:?}");
        let elements = elements(text);
        for Element { parent, name, attributes } in &elements {
            let known = SCHEMA.iter().find(|(above, own, ..)| above == parent && own == name);
            let (_, _, required, others) = known.unwrap_or_else(|| panic!("{name} in {parent}: {text}"));
            assert!(required.iter().all(|key| attributes.contains_key(*key)), "{name}: {text}");
            for (key, value) in attributes {
                let is_known = required.contains(&key.as_str()) || others.contains(&key.as_str());
                assert!(is_known, "{name} has {attributes:?}: {text}");
                let is_sound = match key.as_str() {
                    // Digits and at most three more after the point.
                    "time" => {
                        let (whole, part) = value.split_once('.').unwrap_or((value.as_str(), ""));
                        part.len() <= 3 && [whole, part].concat().bytes().all(|byte| byte.is_ascii_digit())
                    }
                    // The pattern of other schemas, which the xUnit plugin leaves open.
                    "timestamp" => {
                        let shape: String = value.chars().map(|c| if c.is_ascii_digit() { '0' } else { c }).collect();
                        shape == "0000-00-00T00:00:00"
                    }
                    key if COUNTS.contains(&key) => value.bytes().all(|byte| byte.is_ascii_digit()),
                    _ => true,
                };
                assert!(is_sound && !value.is_empty(), "{name} has {key}={value:?}: {text}");
            }
        }
        let (all, rest) = elements.split_first().expect("an element");
        let of = |elements: &[Element], name: &str| elements.iter().filter(|element| element.name == name).count();
        assert_eq!((all.name.as_str(), of(rest, "testsuites")), ("testsuites", 0), "{text}");
        let counts = ["tests", "failures", "errors"].map(|count| all.count(count));
        assert_eq!(counts, [of(rest, "testcase"), of(rest, "failure"), 0], "{text}");
        for suite in rest.chunk_by(|_, next| next.name != "testsuite") {
            let counts = [of(suite, "testcase"), of(suite, "failure"), 0, of(suite, "skipped")];
            assert_eq!(COUNTS.map(|count| suite[0].count(count)), counts, "{text}");
            for case in suite[1..].chunk_by(|_, next| next.name != "testcase") {
                assert!(case.len() <= 2, "a case has two failures: {text}");
            }
        }
    }

    fn written(record: &TestRecord, levels: &[LevelVerdict]) -> String {
        dated(record, levels, None)
    }

    /// Returns the file with this date, and checks it.
    fn dated(record: &TestRecord, levels: &[LevelVerdict], date: Option<&str>) -> String {
        with_pins(record, levels, &[], date)
    }

    /// Returns the file of results with these pins, and checks it.
    fn with_pins(record: &TestRecord, levels: &[LevelVerdict], pins: &[&str], date: Option<&str>) -> String {
        let parent = tempfile::tempdir().expect("a folder");
        let (mut folder, _) = TestFolder::open(parent.path(), record, Earlier::Keep).expect("new");
        levels.iter().for_each(|level| folder.keep(level).expect("writable"));
        folder.finish().expect("writable");
        pin(parent.path(), pins, "2027-01-31");
        let pinned = PinnedFindings::read(parent.path(), "2027-01-01".parse().expect("a day")).expect("pins");
        let overview = Overview::read(parent.path()).expect("results");
        write_junit(parent.path(), &overview, &pinned, "playbot", date).expect("results");
        let text = fs::read_to_string(parent.path().join(JUNIT)).expect("written");
        check(&text);
        text
    }

    #[test]
    fn a_level_whose_findings_are_all_pinned_is_skipped() {
        let with = |index, names: &[&str]| LevelVerdict {
            findings: names.iter().map(|name| in_file(name)).collect(),
            ..verdict(index, 2, 2)
        };
        let levels = [with(0, &["a", "b"]), with(1, &["a", "c"]), verdict(2, 2, 2)];
        for mode in ["hard", "files:levels/*.json"] {
            let text = with_pins(&record(mode), &levels, &["a", "b"], None);
            let reason = "pinned until 2027-01-31: drawn anew in spring".to_owned();
            assert_eq!(values(&text, "skipped", "message"), [Some(reason)], "equal reasons are there once");
            assert_eq!(values(&text, "failure", "type"), [Some("panic".to_owned())]);
            assert_eq!(values(&text, "testsuites", "failures"), [Some("1".to_owned())]);
        }
    }

    /// A finding of `panic` with this message.
    fn panicked(message: &str) -> Finding {
        Finding {
            detector: "panic".to_owned(),
            tester: Some("random".to_owned()),
            episode: Some(0),
            tick: Some(3),
            message: message.to_owned(),
            file: Some("findings/a.finding".to_owned()),
            settings: Vec::new(),
        }
    }

    #[test]
    fn jenkins_accepts_every_element_and_attribute() {
        let words = panicked("a < b && \"c\" skipped=\"0\" ]]> \u{1b}[31m\u{0}\u{fffe}\u{ffff}\r\n\tin line 2");
        let timed = |index, solved| LevelVerdict { seconds: Some(1_234.5), ..verdict(index, solved, 2) };
        let found = LevelVerdict { findings: vec![words.clone(), panicked("again")], ..timed(2, 1) };
        let (broken, proved) = (timed(3, 0), timed(4, 0));
        let score = EpisodeScore { lost: 0, broken: 2, ..broken.score.clone() };
        let broken = LevelVerdict { score, findings: vec![words], ..broken };
        let proved = LevelVerdict {
            outcome: LevelOutcome::ProvedUnsolvable,
            proof: LevelProof::Unsolvable { why: "the goal is walled in".to_owned() },
            seconds: None,
            ..proved
        };
        let regression = LevelVerdict { recorded: Some(course(80)), ..verdict(5, 2, 2) };
        let levels = [timed(0, 2), timed(1, 0), found, broken, proved, regression];
        let testers = ["random", "search"].map(TesterRecord::bot).to_vec();
        let by_two = TestRecord { testers, ..record("hard") };
        let both = |level: &LevelVerdict| LevelVerdict {
            testers: ["random", "search"].map(|name| tester(name, level.score.solved, 2, false)).to_vec(),
            ..level.clone()
        };
        let shard = TestRecord { shard: Some("1/2".parse().expect("a shard")), ..record("hard") };
        let in_shard: Vec<LevelVerdict> = levels.iter().skip(1).step_by(2).cloned().collect();
        let texts = [
            written(&record("hard"), &levels),
            written(&record("files:levels/*.json"), &levels),
            written(&record("skipped=\"0\""), &[]),
            written(&by_two, &levels.each_ref().map(both)),
            written(&shard, &in_shard),
        ];
        assert_eq!(values(&texts[0], "testsuites", "failures"), [Some("5".to_owned())]);
        let types = ["bot-failed", "panic", "bot-failed", "proved-unsolvable", "recording"];
        assert_eq!(values(&texts[0], "failure", "type"), types.map(|kind| Some(kind.to_owned())));
        assert_eq!(values(&texts[1], "testsuite", "tests"), vec![Some("1".to_owned()); 6]);
        assert_eq!(values(&texts[2], "testsuite", "tests"), [Some("0".to_owned())]);
        assert!(texts[3].contains("\nrandom: solved 0 of 2") && texts[3].contains("\nsearch: solved 0 of 2"));
        assert_eq!(
            values(&texts[4], "testcase", "name"),
            ["hard:1", "hard:3", "hard:5"].map(|name| Some(name.to_owned()))
        );
    }

    #[test]
    fn a_name_without_a_place_in_xml_leaves_the_file_readable() {
        let level = LevelVerdict { level: "levels/\u{ffff}a\u{fffe}\u{7}.json".to_owned(), ..verdict(0, 2, 2) };
        let text = written(&record("files:levels/*.json"), &[level]);
        assert_eq!(values(&text, "testsuite", "file"), [Some("levels/a.json".to_owned())]);
    }

    #[test]
    fn the_date_is_that_of_the_variable_and_in_each_suite() {
        let levels = [verdict(0, 2, 2), verdict(1, 0, 2)];
        let day = Some("2026-01-01T00:00:00");
        let text = dated(&record("files:levels/*.json"), &levels, day);
        assert_eq!(values(&text, "testsuite", "timestamp"), vec![day.map(str::to_owned); 2]);
        assert_eq!(text.matches("timestamp").count(), 2, "no reader's schema has one elsewhere: {text}");
        assert!(!written(&record("hard"), &levels).contains("timestamp"));
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        // As GNU date writes them: `date -u -d @SECONDS +%FT%T`.
        for (seconds, expected) in [
            ("0", "1970-01-01T00:00:00"),
            ("951782399", "2000-02-28T23:59:59"),
            ("951782400", "2000-02-29T00:00:00"),
            ("951868800", "2000-03-01T00:00:00"),
            ("1704067199", "2023-12-31T23:59:59"),
            ("1709251199", "2024-02-29T23:59:59"),
            ("1767225600", "2026-01-01T00:00:00"),
            ("4107542400", "2100-03-01T00:00:00"),
            ("253402300799", "9999-12-31T23:59:59"),
        ] {
            assert_eq!(date(OsStr::new(seconds)).expect("a date"), expected, "{seconds}");
        }
        for seconds in ["-1", "1.5", "today", "253402300800", "99999999999999999999"] {
            let words = date(OsStr::new(seconds)).expect_err("no date").to_string();
            assert!(words.contains(&format!("SOURCE_DATE_EPOCH is `{seconds}`")), "{words}");
        }
    }

    #[test]
    fn times_are_those_of_the_game_and_older_results_have_none() {
        let level = |index, seconds| LevelVerdict { seconds, ..verdict(index, 2, 2) };
        let text = written(&record("hard"), &[level(0, Some(1.25)), level(1, Some(2.0)), level(2, None)]);
        let time = |text: &str| Some(text.to_owned());
        assert_eq!(values(&text, "testcase", "time"), [time("1.250"), time("2.000"), None]);
        assert_eq!(values(&text, "testsuite", "time"), [time("3.250")]);
        assert_eq!(values(&text, "testsuites", "time"), [time("3.250")]);
        let older = written(&record("hard"), &[level(0, None), level(1, Some(-1.0))]);
        assert!(!older.contains(" time="), "{older}");
    }

    #[test]
    fn a_level_file_is_the_file_of_its_suite() {
        let level = |index, path: &str| LevelVerdict { level: path.to_owned(), ..verdict(index, 0, 2) };
        let levels = [level(0, "levels/a.json"), level(1, "levels/b & c.json")];
        let text = written(&record("files:levels/*.json"), &levels);
        let paths = ["levels/a.json", "levels/b & c.json"];
        assert_eq!(values(&text, "testsuite", "file"), paths.map(|path| Some(path.to_owned())));
        assert_eq!(values(&text, "testcase", "name"), paths.map(|path| Some(path.to_owned())));
        assert_eq!(values(&text, "testsuite", "name"), paths.map(|path| Some(format!("garden {path}"))));
        assert_eq!(values(&written(&record("hard"), &levels), "testsuite", "file"), [None]);
    }

    #[test]
    fn a_level_of_an_editor_is_named_in_its_case() {
        let named =
            |index, solved, name: &str| LevelVerdict { name: Some(name.to_owned()), ..verdict(index, solved, 2) };
        let text = written(&record("hard"), &[named(0, 0, "Cave"), named(1, 2, "a & b"), verdict(2, 2, 2)]);
        let names = ["hard:0 Cave", "hard:1 a & b", "hard:2"].map(|name| Some(name.to_owned()));
        assert_eq!(values(&text, "testcase", "name"), names);
        assert!(text.contains(">hard:0 Cave: bot-failed\n"), "{text}");
        assert!(text.contains("--levels hard:0 ") && !text.contains("--levels hard:0 Cave"), "{text}");
    }

    #[test]
    fn a_reader_of_the_text_alone_sees_the_message() {
        let text = written(&record("hard"), &[verdict(0, 0, 2)]);
        let message = Some("solved 0 of 2 episodes; lost 2".to_owned());
        assert_eq!(values(&text, "failure", "message"), [message]);
        assert!(text.contains(">hard:0: bot-failed\nsolved 0 of 2 episodes; lost 2\nrandom: solved 0 of 2"), "{text}");
    }

    #[test]
    fn a_level_that_no_longer_ends_as_recorded_has_failed() {
        let recorded = |index, ticks| LevelVerdict { recorded: Some(course(ticks)), ..verdict(index, 2, 2) };
        let other_course = RecordedCourse { differs: Some(3), ..course(120) };
        let other = LevelVerdict { recorded: Some(other_course), ..verdict(2, 2, 2) };
        let text = written(&record("hard"), &[recorded(0, 120), recorded(1, 80), other]);
        let message = "solved 2 of 2 episodes; the recording solves it in 120 ticks; its actions lead elsewhere from tick 79 \
                       on, and reach the goal after 80 ticks";
        assert_eq!(values(&text, "failure", "message"), [Some(message.to_owned())]);
        assert_eq!(values(&text, "failure", "type"), [Some("recording".to_owned())]);
        assert!(text.contains(&format!(">hard:1: solved\n{message}\n")), "{text}");
    }

    #[test]
    fn tests_of_one_game_have_cases_of_different_classes() {
        let plain = record("hard");
        assert_eq!(class(&plain), "garden.hard:0-9.random");
        let by = |testers: &[TesterRecord]| TestRecord { testers: testers.to_vec(), ..plain.clone() };
        let policy = TesterRecord { checksum: Some("0f".to_owned()), ..TesterRecord::bot("a.policy") };
        let file = |path: &str| TesterRecord { file: Some(path.to_owned()), ..policy.clone() };
        let run = |folder: &str, step| {
            let run = Some(TestedRun { folder: folder.to_owned(), step });
            TesterRecord { run, ..policy.clone() }
        };
        let tests = [
            plain.clone(),
            record("easy"),
            TestRecord { range: LevelSplit { mode: "hard".to_owned(), first: 0, last: 8 }, ..plain.clone() },
            TestRecord { seed: 1, ..plain.clone() },
            by(&[TesterRecord::bot("search")]),
            by(&[TesterRecord::bot("random"), TesterRecord::bot("search")]),
            by(std::slice::from_ref(&policy)),
            by(&[TesterRecord { greedy: true, ..policy.clone() }]),
            by(&[file("old/a.policy")]),
            by(&[file("new/a.policy")]),
            by(&[run("runs/a", 4096)]),
            by(&[run("runs/a", 8192)]),
            by(&[run("runs/b", 4096)]),
            record("files:levels/*.json"),
        ];
        let classes: BTreeSet<String> = tests.iter().map(class).collect();
        assert_eq!(classes.len(), tests.len(), "{classes:?}");
        assert!(classes.iter().all(|class| class.matches('.').count() == 2), "game, levels and testers: {classes:?}");
    }

    #[test]
    fn a_further_level_file_and_a_shard_leave_the_class_as_it_is() {
        let files = record("files:levels/*.json");
        let more = LevelSplit { mode: files.range.mode.clone(), first: 0, last: 10 };
        assert_eq!(class(&files), class(&TestRecord { range: more, ..files.clone() }));
        let shard = Some("0/2".parse().expect("a shard"));
        assert_eq!(class(&record("hard")), class(&TestRecord { shard, ..record("hard") }));
    }
}
