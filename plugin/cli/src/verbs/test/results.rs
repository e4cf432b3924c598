//! Report of results, and the files that go with them.

use crate::{
    error::{CliError, Outcome},
    output,
    output::{print_line, print_table, program},
    progress,
    progress::interrupt,
    verbs::test::{regress::PinnedLevels, scenes::SceneMaker},
};
use playbot_harness::{brief::shell_word, game::Game};
use playbot_report::{PlainTable, counted, ticks, whole};
use playbot_test::{
    findings::{FINDINGS, Pins, list_findings},
    verdict::{
        AGAINST, Comparison, JUNIT, LevelVerdict, MOST_WORST, Overview, RESULTS, RecordedTotal, ResultLines, SUMMARY,
        TestError, TesterTotal, Trials, action_search, comparable_command, merge, missing_failure, report_date, wilson,
        write_reports,
    },
    verdict_report::{HtmlReport, LevelExplorer, REPORT, folder_of, write_html},
};
use std::{
    cell::OnceCell,
    fs,
    path::{Path, PathBuf},
};

/// Most findings whose replay command is printed.
const MOST_REPLAYS: usize = 3;

/// Most levels whose common stop is printed.
const MOST_STOPS: usize = 3;

/// Results and the form of their report.
pub struct Results<'a> {
    /// Their folder.
    pub folder: &'a Path,
    /// Folder of earlier ones.
    pub against: Option<&'a Path>,
    /// The game that was tested, if the program has it: it draws the levels of the report.
    pub game: Option<&'a dyn Game>,
    /// The levels are printed as JSON instead of tables.
    pub json: bool,
    /// A failed episode of each level without a solution was to be kept.
    pub keeps_failures: bool,
    /// The page has its pictures in files beside it.
    pub split: bool,
    /// Threads of the explorer of unsolvable levels.
    pub threads: usize,
}

impl Results<'_> {
    /// Checks that reports can be written after the test, without overwriting those that are compared with them.
    ///
    /// # Errors
    ///
    /// Both folders are the same, reports are to have a date that is none, or the pins cannot be read.
    pub fn check(&self) -> Result<(), CliError> {
        report_date()?;
        // A mistake in them is to be known before the test.
        Pins::read(self.folder)?;
        let is_same = |before: &Path| match (fs::canonicalize(before), fs::canonicalize(self.folder)) {
            (Ok(before), Ok(folder)) => before == folder,
            _ => before == self.folder,
        };
        match self.against {
            Some(before) if is_same(before) => Err(CliError::Usage(format!(
                "--against and --out are both {}: results cannot be compared with themselves; choose another --out",
                before.display()
            ))),
            _ => Ok(()),
        }
    }
}

/// Joins the results of all shards into the folder of `results`, and reports them.
pub(crate) fn join_shards(shards: &[PathBuf], results: &Results<'_>) -> Result<Outcome, CliError> {
    merge(shards, results.folder).map_err(|error| {
        output::with_advice(error, "the shards are unchanged: make room or rights there and call this again")
    })?;
    report_results(results)
}

/// Compares results if requested, writes the files that go with them, and prints them. The outcome is that of the
/// comparison if there is one, else that of the results.
pub fn report_results(results: &Results) -> Result<Outcome, CliError> {
    let comparison = results.against.map(|before| Comparison::read(before, results.folder)).transpose()?;
    let folder = results.folder.display();
    let next = format!(
        "the results in {folder} are whole: make room or rights there, and make their page with `{} report html {folder}`",
        program::name()
    );
    let not_written = |error| output::with_advice(error, &next);
    let pinned = PinnedLevels::of(results.folder)?;
    let overview = write_reports(results.folder, comparison.as_ref(), program::name()).map_err(not_written)?;
    write_page(results, comparison.as_ref(), &results.folder.join(REPORT)).map_err(not_written)?;
    if results.json {
        let mut lines = ResultLines::open(results.folder)?;
        while let Some(line) = lines.next_line()? {
            print_line(line)?;
        }
    } else {
        print_table(&testers(&overview))?;
        if !overview.worst.is_empty() {
            print_line("")?;
            print_table(&worst(&overview))?;
        }
        if !overview.hardest.is_empty() {
            print_line("")?;
            print_table(&hardest(&overview))?;
        }
    }
    report!("{}", counts(&overview));
    results.game.and_then(|game| without_plans(game, &overview)).iter().for_each(|line| report!("{line}"));
    overview.first_tick().iter().for_each(|levels| report!("{levels}"));
    overview.could_not_look().iter().for_each(|detectors| report!("could not look: {detectors}"));
    stops(&overview).iter().for_each(|line| report!("{line}"));
    search(&overview).iter().for_each(|line| report!("{line}"));
    replays(results.folder, &overview).iter().for_each(|line| report!("{line}"));
    missing(&overview).iter().for_each(|line| report!("{line}"));
    if let Some(comparison) = &comparison {
        report_comparison(comparison, &overview);
    }
    report_recording(&overview.recorded);
    pinned.words.iter().for_each(|words| report!("{words}"));
    let names = [RESULTS, REPORT, JUNIT, SUMMARY].into_iter().chain(comparison.as_ref().map(|_| AGAINST));
    let pictures = Some(folder_of(Path::new(REPORT))).filter(|name| results.folder.join(name).is_dir());
    let pictures = pictures.map(|name| name.display().to_string());
    let names: Vec<&str> = names.chain(pictures.as_deref()).collect();
    report!("{folder}: {}", names.join(", "));
    if results.keeps_failures && overview.bot_failed == 0 {
        report!("no failed episode is kept: each level was solved, or is proved unsolvable");
    }
    let is_sound = match &comparison {
        Some(comparison) => !comparison.has_alarms() && overview.recorded.regressions.is_empty(),
        None => overview.unsound <= pinned.excused,
    };
    Ok(if is_sound { Outcome::Pass } else { Outcome::Findings })
}

/// Writes the page of results into a file, with progress bars for what takes long.
///
/// # Errors
///
/// The results are damaged, or a file cannot be written.
pub(crate) fn write_page(results: &Results, comparison: Option<&Comparison>, file: &Path) -> Result<(), TestError> {
    let maker = results.game.map(SceneMaker::new);
    let scene = |file: &Path| maker.as_ref()?.scene(file);
    let bar = OnceCell::new();
    let each = || bar.get_or_init(|| progress::bar("explore unsolvable levels", 0, "levels")).inc(1);
    let report = HtmlReport {
        game: results.game,
        comparison,
        before: results.against,
        program: program::name(),
        scenes: Some(&scene),
        explorer: Some(LevelExplorer { threads: results.threads, each: &each, stop: &interrupt::asked }),
        split: results.split,
    };
    let written = write_html(results.folder, file, &report);
    bar.get().iter().for_each(|bar| bar.finish_and_clear());
    written
}

/// Returns the reason why no squares were counted, if it is that the game draws no floor plans.
fn without_plans(game: &dyn Game, overview: &Overview) -> Option<String> {
    let range = &overview.record.range;
    let is_known = overview.places.percent().is_some();
    (!is_known && game.tools().levels.floor_plan(&range.mode, range.first).is_none()).then(|| {
        format!(
            "no squares were counted, and the page has no pictures: `{}` has no floor plans of these levels, which its \
             adapter draws with `.plan` or `.plan_of_file`",
            game.name()
        )
    })
}

/// Returns the positions at which the episodes of the worst levels stopped.
fn stops(overview: &Overview) -> Vec<String> {
    let stop = |level: &LevelVerdict| level.stop.as_ref().map(|stop| format!("{}: {stop}", level.title()));
    overview.worst.iter().filter_map(stop).take(MOST_STOPS).collect()
}

/// Returns the command that looks for actions without an effect, for the worst level that no tester solved.
fn search(overview: &Overview) -> Option<String> {
    let command = |level| action_search(program::name(), &overview.record, level);
    let (level, command) = overview.worst.iter().find_map(|level| Some((&level.level, command(level)?)))?;
    Some(format!("{level}: to learn which actions do nothing there, or stop working: {command}"))
}

/// Returns the commands that show findings of the worst levels, and the list of other files.
fn replays(folder: &Path, overview: &Overview) -> Vec<String> {
    let findings = overview.worst.iter().flat_map(|level| &level.findings);
    let files: Vec<_> = findings.filter_map(|finding| finding.file.as_ref()).map(|file| folder.join(file)).collect();
    let mut lines: Vec<_> = files.iter().take(MOST_REPLAYS).map(|file| seen_with(file)).collect();
    let kept: Vec<_> = list_findings(&folder.join(FINDINGS)).unwrap_or_default();
    let more = kept.len().saturating_sub(lines.len());
    match kept.first() {
        Some((_, first)) if lines.is_empty() => {
            let failures = counted(kept.len() as u64, "failed episode");
            lines.push(format!("{failures} kept in {}; {}", folder.join(FINDINGS).display(), seen_with(first)));
        }
        _ if more > 0 => lines.push(format!("and {more} more in {}", folder.join(FINDINGS).display())),
        _ => {}
    }
    if !lines.is_empty() {
        let folder = shell_word(&folder.display().to_string());
        lines.push(format!("decide on them one by one: {} review {folder}", program::name()));
    }
    lines
}

/// Returns the worst levels without a kept failure in a test that keeps failures, with the reason and what to do.
fn missing(overview: &Overview) -> Vec<String> {
    let missing = |level| missing_failure(program::name(), &overview.record, level);
    overview.worst.iter().filter_map(missing).collect()
}

/// Returns the command that shows a finding.
fn seen_with(file: &Path) -> String {
    format!("see it: {} replay {} --apng finding.png", program::name(), shell_word(&file.display().to_string()))
}

fn counts(overview: &Overview) -> String {
    format!(
        "{}: {} solved, {} unsolved with nothing proved, {} proved unsolvable; {}",
        counted(overview.levels, "level"),
        overview.solved,
        overview.bot_failed,
        overview.proved_unsolvable,
        counted(overview.findings, "finding")
    )
}

fn testers(overview: &Overview) -> PlainTable {
    let share = |of: Trials| {
        let [low, high] = wilson(of.successes, of.trials).map(|share| 100.0 * share);
        format!("{} of {} ({low:.1} to {high:.1} %)", whole(of.successes as f64), whole(of.trials as f64))
    };
    let row = |tester: &TesterTotal| {
        vec![tester.name.clone(), share(tester.levels), share(tester.episodes), tester.places.describe()]
    };
    PlainTable {
        caption: format!("{} {}", overview.record.game, overview.record.range),
        columns: ["tester", "levels solved", "episodes solved", "squares visited"].map(str::to_owned).to_vec(),
        rows: overview.testers.iter().map(row).collect(),
    }
}

fn worst(overview: &Overview) -> PlainTable {
    let row = |level: &LevelVerdict| {
        let score = &level.score;
        let median = score.ticks.map_or(f64::NAN, |ticks| ticks.median);
        let recording = if level.is_regression() { "recording" } else { "" };
        let finding = level.findings.first().map_or(recording, |finding| finding.detector.as_str()).to_owned();
        vec![
            level.title(),
            level.outcome.name().to_owned(),
            format!("{} of {}", score.solved, score.episodes),
            ticks(median),
            whole(score.lost as f64),
            whole(score.timed_out as f64),
            level.places.unwrap_or_default().describe(),
            finding,
        ]
    };
    PlainTable {
        caption: match overview.worst.len() {
            MOST_WORST => format!("levels to look at, the worst {MOST_WORST}"),
            _ => "levels to look at".to_owned(),
        },
        columns: ["level", "outcome", "solved", "ticks", "lost", "timed out", "visited", "finding"]
            .map(str::to_owned)
            .to_vec(),
        rows: overview.worst.iter().map(row).collect(),
    }
}

/// Returns the levels that are solved less often than others.
fn hardest(overview: &Overview) -> PlainTable {
    let row = |level: &LevelVerdict| {
        let score = &level.score;
        let median = score.ticks.map_or(f64::NAN, |ticks| ticks.median);
        vec![
            level.title(),
            format!("{} of {}", score.solved, score.episodes),
            ticks(median),
            whole(score.lost as f64),
            whole(score.timed_out as f64),
        ]
    };
    PlainTable {
        caption: "hardest levels, all solved".to_owned(),
        columns: ["level", "solved", "ticks", "lost", "timed out"].map(str::to_owned).to_vec(),
        rows: overview.hardest.iter().map(row).collect(),
    }
}

fn report_comparison(comparison: &Comparison, overview: &Overview) {
    let Comparison { levels, only_now, only_before, .. } = comparison;
    if only_now + only_before > 0 {
        let levels = counted(*levels, "level");
        report!("{levels} in both results are compared; {only_now} only now, {only_before} only before");
    }
    comparison.left_out.iter().for_each(|why| report!("left out of the comparison: {why}"));
    comparison.not_comparable().iter().for_each(|levels| report!("{levels}"));
    comparison.places_left_out.iter().for_each(|why| report!("places not compared: {why}"));
    if let Some(command) = comparable_command(program::name(), &overview.record, comparison) {
        report!("places are compared after the same test as before: {command}");
    }
    let lists = [
        ("unsolvable", texts(&comparison.unsolvable)),
        ("harder", texts(&comparison.harder)),
        ("easier", texts(&comparison.easier)),
        ("new finding", texts(&comparison.new_findings)),
        ("gone finding", texts(&comparison.gone_findings)),
        ("no longer reached", texts(&comparison.unreached)),
    ];
    for (what, changes) in &lists {
        changes.iter().for_each(|change| report!("{what}: {change}"));
    }
    if lists.iter().all(|(_, changes)| changes.is_empty()) {
        report!("{} in {}", comparison.no_change(), counted(comparison.levels, "level"));
    }
}

fn report_recording(recorded: &RecordedTotal) {
    let levels = recorded.regressions.iter().chain(&recorded.others);
    levels.for_each(|level| report!("recorded: {level}"));
    recorded.summary().iter().for_each(|words| report!("{words}"));
}

fn texts(changes: &[impl ToString]) -> Vec<String> {
    changes.iter().map(ToString::to_string).collect()
}
