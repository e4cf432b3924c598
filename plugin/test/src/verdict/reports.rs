//! Reports of results. They are a page of Markdown, short enough for a pull request, JUnit XML for build servers, the
//! files of findings, and the commands that show a level again.
//!
//! - `junit`: the XML.
//! - [`issues`](mod@issues): lists of what is wrong, for build servers and editors.

pub mod issues;
mod junit;

use crate::{
    detectors::compares_testers,
    findings::{Date, FindingFiles, KeptFailure, Played, SeenFinding, SeenLevel},
    verdict::{
        Finding, LevelOutcome, LevelVerdict, SquareEnds, TesterVerdict,
        compare::{Comparison, EarlierTest},
        error::{TestError, io_error},
        maps::level_argument,
        pinned::PinnedFindings,
        plan::{TestPlan, TestRecord, Tester, TesterRecord, testers},
        reports::junit::write_junit,
        results::{Overview, RecordedTotal},
        statistics::{Trials, wilson},
    },
};
use playbot_harness::{brief::shell_word, game::Game};
use playbot_report::{counted, markdown_cell};
use std::{cmp::Reverse, fmt::Display, path::Path};

pub use crate::verdict::reports::junit::report_date;

/// Name of the file with JUnit XML.
pub const JUNIT: &str = "junit.xml";

/// Name of the file with a short summary, in Markdown.
pub const SUMMARY: &str = "summary.md";

/// Name of the file with the comparison, in JSON.
pub const AGAINST: &str = "against.json";

/// Most changes of a kind that are listed.
const MOST_CHANGES: usize = 20;

/// Writes `junit.xml`, `summary.md` and, with a comparison, `against.json` beside the results in a folder.
///
/// `program` is the name of the program in the commands that they show. [`verdict_report`](crate::verdict_report)
/// makes `report.html`, whose pictures need the game.
///
/// # Errors
///
/// The folder has no results, they or its pins are damaged, the files cannot be written, or [`report_date`] returns an
/// error.
pub fn write_reports(folder: &Path, comparison: Option<&Comparison>, program: &str) -> Result<Overview, TestError> {
    let overview = Overview::read(folder)?;
    let pinned = PinnedFindings::read(folder, Date::today())?;
    write_junit(folder, &overview, &pinned, program, report_date()?.as_deref())?;
    write(&folder.join(SUMMARY), &summary(&overview, comparison, &pinned, program))?;
    if let Some(comparison) = comparison {
        let path = folder.join(AGAINST);
        let text = serde_json::to_string(comparison).map_err(|error| io_error("write", &path)(error.into()))?;
        write(&path, &format!("{text}\n"))?;
    }
    Ok(overview)
}

fn write(path: &Path, text: &str) -> Result<(), TestError> {
    playbot_learner::write_atomically(path, text.as_bytes()).map_err(io_error("write", path))
}

/// Writes the findings of a level to files, and notes the files' names in it.
pub(super) fn keep_findings(
    game: &dyn Game,
    plan: &TestPlan,
    files: &FindingFiles,
    verdict: &mut LevelVerdict,
) -> Result<(), TestError> {
    let LevelVerdict { level: name, index, outcome, testers, findings, not_kept, .. } = verdict;
    let level = SeenLevel { mode: &plan.split.mode, level: plan.split.first + *index, name };
    let played = |tester: &str, episode: u32| {
        let tester = plan.testers.iter().find(|known| known.record.name == tester)?;
        Some(played_by(tester, plan.episode_seed(&tester.record, level.name, episode)))
    };
    for finding in findings {
        let who = finding.tester.as_deref().zip(finding.episode);
        let played = who.and_then(|(tester, episode)| played(tester, episode));
        let Finding { detector, message, settings, .. } = finding;
        let seen = SeenFinding { detector, message, settings, played };
        finding.file = files.keep(game, level, &seen)?;
    }
    if files.keep_failures && *outcome == LevelOutcome::BotFailed {
        let failed = failed_episodes(testers, plan.episodes).filter_map(|(tester, episode)| {
            let played = played(tester, episode)?;
            Some((format!("`{tester}`, episode {episode}"), played))
        });
        let mut missing = Vec::new();
        for (episode, played) in failed {
            match files.keep_failure(game, level, played)? {
                KeptFailure::File(_) => return Ok(()),
                KeptFailure::Missing(why) => missing.push(format!("{episode}: {why}")),
            }
        }
        *not_kept = (!missing.is_empty()).then(|| missing.join("; "));
    }
    Ok(())
}

/// Most episodes of a tester that are played again in search of one that can be kept.
const MOST_TRIES: u32 = 3;

/// Returns failed episodes of a level that no tester solved, by tester and number: first one of each tester that
/// repeats itself exactly, then some of the others.
fn failed_episodes(testers: &[TesterVerdict], episodes: u32) -> impl Iterator<Item = (&str, u32)> {
    let failed = testers.iter().filter(|tester| tester.score.lost > 0 || tester.score.timed_out > 0);
    let (exact, drawn): (Vec<_>, Vec<_>) = failed.partition(|tester| tester.exact);
    let tries = move |tester: &TesterVerdict| if tester.exact { 1 } else { episodes.clamp(1, MOST_TRIES) };
    let all = exact.into_iter().chain(drawn);
    all.flat_map(move |tester| (0..tries(tester)).map(move |episode| (tester.tester.as_str(), episode)))
}

fn played_by(tester: &Tester, seed: u64) -> Played<'_> {
    let Tester { record, player, observation_config } = tester;
    Played { tester: &record.name, player, observation_config, seed }
}

// Summary in Markdown.

/// Writes the page.
pub(super) fn summary(
    overview: &Overview,
    comparison: Option<&Comparison>,
    pinned: &PinnedFindings,
    program: &str,
) -> String {
    let record = &overview.record;
    let mut lines = vec![format!("# {} {}", record.game, markdown_cell(&record.range.to_string())), String::new()];
    let solved = Trials { successes: overview.solved, trials: overview.levels };
    lines.push(format!(
        "**{}**: {} solved{}, {} unsolved with nothing proved, {} proved unsolvable; {}.",
        counted(overview.levels, "level"),
        overview.solved,
        interval(solved),
        overview.bot_failed,
        overview.proved_unsolvable,
        counted(overview.findings, "finding")
    ));
    if overview.places.percent().is_some() {
        lines.push(format!("{} of the open squares were visited.", overview.places.describe()));
    }
    lines.extend(overview.first_tick().map(|levels| format!("{}.", markdown_cell(&levels))));
    let short = overview.could_not_look();
    lines.extend(short.map(|detectors| format!("Detectors that could not look: {}.", markdown_cell(&detectors))));
    let head = ["", "| tester | levels solved | episodes solved | squares visited |", "|---|---:|---:|---:|"];
    lines.extend(head.map(str::to_owned));
    for tester in &overview.testers {
        let share = |of: Trials| format!("{} of {}{}", of.successes, of.trials, interval(of));
        let (levels, episodes, places) = (share(tester.levels), share(tester.episodes), tester.places.describe());
        lines.push(format!("| {} | {levels} | {episodes} | {places} |", markdown_cell(&tester.name)));
    }
    let known: Vec<String> = record.testers.iter().filter_map(TesterRecord::describe_known).collect();
    if !known.is_empty() {
        lines.extend([String::new(), format!("{}.", markdown_cell(&known.join("; ")))]);
    }
    if let Some(comparison) = comparison {
        lines.extend(compared(comparison, comparable_command(program, record, comparison)));
    }
    lines.extend(recorded(&overview.recorded));
    if !overview.worst.is_empty() {
        lines.extend(
            ["", "## Levels to look at", "", "| level | outcome | problem |", "|---|---|---|"].map(str::to_owned),
        );
        for level in &overview.worst {
            let pin = pinned.describe_level(level).map_or_else(String::new, |pin| format!("; {pin}"));
            let what = markdown_cell(&format!("{}{pin}", failure(level)));
            lines.push(format!("| {} | {} | {what} |", markdown_cell(&level.title()), level.outcome.name()));
        }
        let missing: Vec<String> =
            overview.worst.iter().filter_map(|level| missing_failure(program, record, level)).collect();
        lines.extend(list("Failed episodes that are not kept", missing));
        // Testers show nothing of a level that only the recording no longer solves.
        let has_failed = |level: &&LevelVerdict| level.outcome != LevelOutcome::Solved || !level.findings.is_empty();
        let first = overview.worst.first().filter(has_failed);
        let shown = first.map(|level| rerun_commands(program, record, level)).unwrap_or_default();
        if !shown.is_empty() {
            lines.extend(["", "To play the first one again:", "", "```sh"].map(str::to_owned));
            lines.extend(shown);
            lines.push("```".to_owned());
        }
        if let Some(search) = overview.worst.iter().find_map(|level| action_search(program, record, level)) {
            let why = "No tester solved a level: to learn which actions do nothing there, or stop working:";
            lines.extend(["", why, "", "```sh"].map(str::to_owned));
            lines.extend([search, "```".to_owned()]);
        }
    }
    lines.extend(hardest(overview));
    lines.push(String::new());
    lines.join("\n")
}

/// Lists levels that are solved less often than others. They have no problem.
fn hardest(overview: &Overview) -> Vec<String> {
    if overview.hardest.is_empty() {
        return Vec::new();
    }
    let head = [
        "",
        "## Hardest levels",
        "",
        "Solved and without findings, but in fewer episodes than half of the solved levels:",
        "",
        "| level | episodes |",
        "|---|---|",
    ];
    let row =
        |level: &LevelVerdict| format!("| {} | {} |", markdown_cell(&level.title()), markdown_cell(&message(level)));
    head.map(str::to_owned).into_iter().chain(overview.hardest.iter().map(row)).collect()
}

/// Formats the 95 % interval of a share, in percent.
pub(super) fn interval(of: Trials) -> String {
    let [low, high] = wilson(of.successes, of.trials).map(|share| 100.0 * share);
    format!(" ({low:.1} to {high:.1} %)")
}

/// Writes the changes since earlier results, with the command that makes the places comparable, if there is one.
fn compared(comparison: &Comparison, comparable: Option<String>) -> Vec<String> {
    let mut lines = vec![String::new(), "## Since the earlier results".to_owned(), String::new()];
    let Comparison { levels, only_now, only_before, .. } = comparison;
    lines.push(format!("{} in both, {only_now} only now, {only_before} only before.", counted(*levels, "level")));
    lines.extend(comparison.left_out.iter().map(|why| format!("Left out: {}.", markdown_cell(why))));
    lines.extend(comparison.places_left_out.iter().map(|why| format!("Places not compared: {}.", markdown_cell(why))));
    if let Some(command) = comparable {
        let what = "Places are compared after the same test as before:";
        lines.extend(["", what, "", "```sh", &command, "```"].map(str::to_owned));
    }
    for (title, changes) in [
        ("Unsolvable", texts(&comparison.unsolvable)),
        ("Harder", texts(&comparison.harder)),
        ("Easier", texts(&comparison.easier)),
        ("New findings", texts(&comparison.new_findings)),
        ("Gone findings", texts(&comparison.gone_findings)),
        ("No longer reached", texts(&comparison.unreached)),
        ("Not comparable", texts(&comparison.other_testers)),
    ] {
        lines.extend(list(title, changes));
    }
    let is_better = !(comparison.easier.is_empty() && comparison.gone_findings.is_empty());
    if !comparison.has_alarms() && !is_better && comparison.unreached.is_empty() {
        lines.extend([String::new(), comparison.no_change_sentence()]);
    }
    lines
}

fn recorded(total: &RecordedTotal) -> Vec<String> {
    let Some(words) = total.summary() else { return Vec::new() };
    let mut lines = ["", "## Since the recording", ""].map(str::to_owned).to_vec();
    lines.push(format!("{words}."));
    lines.extend(list("No longer end as recorded", total.regressions.clone()));
    lines.extend(list("End as recorded", total.others.clone()));
    lines
}

/// Writes a list of changes, the first ones of many; empty without changes.
fn list(title: &str, changes: Vec<String>) -> Vec<String> {
    if changes.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![String::new(), format!("{title} ({}):", changes.len()), String::new()];
    let more = changes.len().saturating_sub(MOST_CHANGES);
    lines.extend(changes.into_iter().take(MOST_CHANGES).map(|change| format!("- {}", markdown_cell(&change))));
    lines.extend((more > 0).then(|| format!("- and {more} more")));
    lines
}

fn texts(changes: &[impl Display]) -> Vec<String> {
    changes.iter().map(ToString::to_string).collect()
}

// Failures in words.

/// Most causes or squares that are named in one line.
const MOST_CAUSES: usize = 3;

/// Describes the failure of a level in one line, with what a recording does in it.
fn failure(level: &LevelVerdict) -> String {
    let news = level.recorded_news().map_or_else(String::new, |news| format!("; {news}"));
    message(level) + &news
}

/// Describes the ends of a level's episodes and its findings in one line.
fn message(level: &LevelVerdict) -> String {
    let solved = format!("solved {} of {}", level.score.solved, counted(level.score.episodes, "episode"));
    let finding = level.findings.first().map(|finding| format!("; {}: {}", finding.detector, finding.message));
    let more = level.findings.len().saturating_sub(1);
    let more = if more > 0 { format!(" (and {more} more)") } else { String::new() };
    let stop = level.stop.as_ref().map_or_else(String::new, |stop| format!("; {stop}"));
    format!("{solved}{}{stop}{}{more}", lost(level), finding.unwrap_or_default())
}

impl LevelVerdict {
    /// Describes how, why and where its episodes ended without the goal, for reports; `None` without such episodes.
    pub(crate) fn describe_losses(&self) -> Option<String> {
        lost(self).strip_prefix("; ").map(str::to_owned)
    }
}

/// Describes how, why and where episodes ended without the goal; empty without such episodes.
fn lost(level: &LevelVerdict) -> String {
    let kinds = [("lost", level.score.lost), ("timed out", level.score.timed_out)];
    let kinds = kinds.into_iter().filter(|(_, count)| *count > 0).map(|(kind, count)| format!("{kind} {count}"));
    let kinds = kinds.collect::<Vec<_>>().join(", ");
    if kinds.is_empty() {
        return String::new();
    }
    if level.causes.is_empty() {
        return format!("; {kinds}{}", squares(level));
    }
    let mut reasons = reasons(level);
    // A stable sort: equally frequent ones keep the order of the results.
    reasons.sort_by_key(|(count, _)| Reverse(*count));
    let words = first_few(reasons.into_iter().map(|(_, words)| words));
    format!("; {kinds}: {}", words.join(", "))
}

/// Returns the first causes or squares, and how many more there are.
fn first_few(mut all: impl ExactSizeIterator<Item = String>) -> Vec<String> {
    let mut words: Vec<String> = all.by_ref().take(MOST_CAUSES).collect();
    if all.len() > 0 {
        words.push(format!("{} more", all.len()));
    }
    words
}

/// Describes a square of ends.
fn near(end: &SquareEnds) -> String {
    format!("near {:.1}, {:.1}", end.x, end.y)
}

/// Returns how often each cause ended an episode, and the square where it did most often.
fn reasons(level: &LevelVerdict) -> Vec<(u64, String)> {
    let reason = |(cause, count): (&String, &u64)| {
        let ends = level.ends.iter().filter(|end| end.causes.contains_key(cause));
        // Of equal squares `max_by_key` takes the last one, which is the first of the results.
        let most = ends.rev().max_by_key(|end| end.causes.get(cause).copied());
        let place = most.map_or_else(String::new, |end| format!(" ({})", near(end)));
        (*count, format!("{cause} {count}{place}"))
    };
    level.causes.iter().map(reason).collect()
}

/// Returns the squares where episodes ended, in brackets, for a game that reports no causes. A square where all of them
/// ended has no number. Empty without positions.
fn squares(level: &LevelVerdict) -> String {
    let count = |end: &SquareEnds| end.lost.saturating_add(end.timed_out);
    let mut ends: Vec<&SquareEnds> = level.ends.iter().collect();
    // A stable sort, as for causes.
    ends.sort_by_key(|end| Reverse(count(end)));
    let words = match ends[..] {
        [] => return String::new(),
        [end] if count(end) == level.score.lost.saturating_add(level.score.timed_out) => near(end),
        _ => first_few(ends.iter().map(|end| format!("{} {}", count(end), near(end)))).join("; "),
    };
    format!(" ({words})")
}

// Commands that show a level of results again.

/// Largest number of findings that are shown by their files.
const MOST_FILES: usize = 3;

/// Ticks for which the doctor searches for the cause of an episode that does not happen twice: many, because it is
/// rare.
const DOCTOR_TICKS: u32 = 10_000;

/// Comment on the folder for the replay of findings: their files are named as in the results.
const OF_RESULTS: &str = "# from the folder of the results:";

/// Comment on the folder for all other commands: recordings, policies and level files are named as the test named
/// them.
const OF_TEST: &str = "# from the folder where the test was run:";

/// Returns the commands that replay a level's findings, play its failed episodes again, and show them, for the
/// program of this name. If they belong to different folders, shell comments name these.
pub fn rerun_commands(program: &str, record: &TestRecord, level: &LevelVerdict) -> Vec<String> {
    let files = level.findings.iter().filter_map(|finding| finding.file.as_ref());
    let replays: Vec<String> = files.take(MOST_FILES).map(|file| format!("{program} replay {file}")).collect();
    let again = played_again(program, record, level);
    let [of_results, of_test] = match (replays.is_empty(), again.is_empty()) {
        (true, _) => [None, None],
        (false, true) => [Some(OF_RESULTS), None],
        (false, false) => [Some(OF_RESULTS), Some(OF_TEST)],
    };
    let comment = |words: Option<&str>| words.map(str::to_owned);
    comment(of_results).into_iter().chain(replays).chain(comment(of_test)).chain(again).collect()
}

/// Returns the command for the episodes of the tester that has a finding or else failed, if any. If the finding
/// compares testers, the command is for all of them. Adds a picture if the tester repeats itself exactly.
fn played_again(program: &str, record: &TestRecord, level: &LevelVerdict) -> Vec<String> {
    let found = level.findings.iter().find_map(|finding| finding.tester.as_ref());
    let failed = || level.testers.iter().find(|tester| tester.score.solved < tester.score.episodes);
    let Some(name) = found.or_else(|| failed().map(|tester| &tester.tester)) else { return Vec::new() };
    let Some(tester) = record.testers.iter().find(|tester| tester.name == *name) else { return Vec::new() };
    let compares = level.findings.iter().any(|finding| compares_testers(&finding.detector));
    let played = if compares { testers(&record.testers) } else { testers(std::slice::from_ref(tester)) };
    let shown = seen(tester);
    let (game, seed, episodes) = (&record.game, record.seed, record.episodes);
    let (levels, place) = (level_argument(&record.range, &level.level), in_file_name(&level.level));
    let detectors: String = record.options.iter().map(|word| format!(" {}", shell_word(word))).collect();
    // The same episodes: they depend on seed, tester and level alone.
    let again = format!(
        "{program} test {game} --levels {levels} {played} --episodes {episodes} --seed {seed}{detectors} --out \
         again-{place}"
    );
    // A tester that draws random numbers draws others in a picture.
    let exact = level.testers.iter().any(|tester| tester.tester == *name && tester.exact);
    let picture = format!("{program} view {game} --levels {levels} {shown} --episode --out again-{place}.png");
    [again].into_iter().chain(exact.then_some(picture)).collect()
}

/// Detectors of actions that do nothing, or no longer do what they did. They are opt-in, since they take long.
const OF_ACTIONS: [&str; 2] = ["dead-action", "fading-action"];

/// Returns the command that looks for actions without an effect on a level that no tester solved, for the program of this
/// name. `None` for other levels, or if the test looked for them there.
pub fn action_search(program: &str, record: &TestRecord, level: &LevelVerdict) -> Option<String> {
    let has_looked = |name: &str| {
        record.detectors.iter().any(|detector| {
            let mut words = detector.split(' ');
            let is_it = words.next() == Some(name);
            let every = words.find_map(|setting| setting.strip_prefix("every=")?.parse::<f64>().ok());
            is_it && level.index.is_multiple_of((every.unwrap_or(1.0) as u64).max(1))
        })
    };
    let missing: Vec<&str> = OF_ACTIONS.into_iter().filter(|name| !has_looked(name)).collect();
    if level.outcome != LevelOutcome::BotFailed || missing.is_empty() {
        return None;
    }
    let (game, seed, episodes, played) = (&record.game, record.seed, record.episodes, testers(&record.testers));
    let (levels, place) = (level_argument(&record.range, &level.level), in_file_name(&level.level));
    let missing = missing.join(",");
    Some(format!(
        "{program} test {game} --levels {levels} {played} --episodes {episodes} --seed {seed} --detect {missing} --out \
         runs/actions-{place}"
    ))
}

/// Returns the command of a test whose visited squares can be compared with the earlier ones: on the same levels as
/// now, by the earlier testers, with their seed and number of episodes. `None` if they are compared, or no such test is
/// possible.
pub fn comparable_command(program: &str, now: &TestRecord, comparison: &Comparison) -> Option<String> {
    let EarlierTest { folder, record } = comparison.earlier.as_ref()?;
    let (game, levels, folder) =
        (&now.game, shell_word(&now.range.to_string()), shell_word(&folder.display().to_string()));
    let (played, episodes, seed) = (testers(&record.testers), record.episodes, record.seed);
    let shard = now.shard.map_or_else(String::new, |shard| format!(" --shard {shard}"));
    let detectors: String = now.options.iter().map(|word| format!(" {}", shell_word(word))).collect();
    Some(format!(
        "{program} test {game} --levels {levels} {played} --episodes {episodes} --seed {seed}{shard}{detectors} --against \
         {folder} --out runs/comparable"
    ))
}

/// Returns why no failed episode of a level is kept, with the command that searches for the cause. `None` if one is
/// kept, or if the test keeps none.
pub fn missing_failure(program: &str, record: &TestRecord, level: &LevelVerdict) -> Option<String> {
    let why = level.not_kept.as_ref()?;
    let (game, mode, number) = (&record.game, shell_word(&record.range.mode), record.range.first + level.index);
    let doctor = format!("{program} doctor {game} --mode {mode} --level {number} --ticks {DOCTOR_TICKS}");
    Some(format!(
        "{}: no failed episode is kept, because the game does not play the same each time ({doctor} may find the cause): \
         {why}",
        level.title()
    ))
}

/// Returns the name of a level as a part of the name of a file, so that the commands of several levels write to places of
/// their own.
fn in_file_name(level: &str) -> String {
    level.chars().map(|letter| if letter.is_alphanumeric() || "-_".contains(letter) { letter } else { '-' }).collect()
}

/// Returns a tester as an argument of `playbot view`, which takes the files of policies only.
fn seen(tester: &TesterRecord) -> String {
    let unnamed =
        TesterRecord { name: tester.file.clone().unwrap_or_else(|| tester.name.clone()), file: None, ..tester.clone() };
    testers(&[unnamed])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        findings::testing::course,
        verdict::{
            CommonStop, Finding, LevelVerdict, Places, StopKind, TestRecord, TestedRun, TesterRecord, TooShort,
            folder::{Earlier, TestFolder},
            pinned::tests::{in_file, pin},
            testing,
            testing::{tester, verdict},
        },
    };

    #[test]
    fn shares_of_visited_places_and_levels_solved_in_their_first_tick_are_reported() {
        let record = TestRecord { episodes: 2, ..testing::record("hard:0..0") };
        let said = |level: &LevelVerdict| {
            let parent = tempfile::tempdir().expect("a folder");
            let (mut folder, _) = TestFolder::open(parent.path(), &record, Earlier::Keep).expect("new");
            folder.keep(level).expect("writable");
            folder.finish().expect("writable");
            summary(&Overview::read(parent.path()).expect("results"), None, &PinnedFindings::default(), "playbot")
        };
        let plain = said(&verdict(0, 2, 2));
        assert!(plain.contains("| random | 1 of 1") && plain.contains(" | – |"), "{plain}");
        assert!(!plain.contains("open squares") && !plain.contains("first tick"), "{plain}");
        let at_start = said(&LevelVerdict { solved_at_start: true, ..verdict(0, 2, 2) });
        assert!(at_start.contains("\n1 level is solved in its first tick: hard:0.\n"), "{at_start}");
        let short = TooShort { detector: "own".to_owned(), needs: 9, had: 8, setting: None };
        let mut level = LevelVerdict { too_short: vec![short], ..verdict(0, 1, 2) };
        level.score.timed_out = 1;
        let short = said(&level);
        let words = "\nDetectors that could not look: own (needs episodes of 9 ticks, and had at most 8).\n";
        assert!(short.contains(words) && !plain.contains("could not look"), "{short}");
        let named = said(&LevelVerdict { name: Some("Cave".to_owned()), ..verdict(0, 0, 2) });
        assert!(named.contains("\n| hard:0 Cave | bot-failed |"), "{named}");
        let mut level = LevelVerdict { places: Some(Places { visited: 3, open: 4 }), ..verdict(0, 2, 2) };
        level.testers[0].places = Some(Places { visited: 1, open: 4 });
        let mapped = said(&level);
        assert!(mapped.contains("75.0 % of the open squares") && mapped.contains(" | 25.0 % |"), "{mapped}");
    }

    #[test]
    fn solved_levels_are_no_problem_and_those_that_end_otherwise_than_recorded_are() {
        let testers = ["search", "random"].map(TesterRecord::bot).to_vec();
        let record = TestRecord { testers, ..testing::record("hard:0..3") };
        let said = |solved: &[u64], recorded: &[u64]| {
            let parent = tempfile::tempdir().expect("a folder");
            let (mut folder, _) = TestFolder::open(parent.path(), &record, Earlier::Keep).expect("new");
            for (index, solved) in (0..).zip(solved) {
                let testers = vec![tester("search", 1, 1, true), tester("random", solved - 1, 1, false)];
                folder.keep(&LevelVerdict { testers, ..verdict(index, *solved, 2) }).expect("writable");
            }
            let courses = (0..).zip(recorded).map(|(index, ticks)| (index, course(*ticks))).collect();
            folder.finish_against(&courses).expect("writable");
            summary(&Overview::read(parent.path()).expect("results"), None, &PinnedFindings::default(), "playbot")
        };
        let sound = said(&[1, 1, 1, 1], &[]);
        for words in ["look at", "problem", "Hardest", "--bot random", "recording"] {
            assert!(!sound.contains(words), "{words}: {sound}");
        }
        let hard = said(&[2, 2, 1, 2], &[120; 4]);
        let row = "## Hardest levels\n\nSolved and without findings, but in fewer episodes than half of the solved levels:\n\n\
                   | level | episodes |\n|---|---|\n| hard:2 | solved 1 of 2 episodes; lost 1 |\n";
        assert!(hard.contains(row) && !hard.contains("problem") && !hard.contains("--bot random"), "{hard}");
        assert!(hard.contains("## Since the recording\n\n4 recorded levels: all end as recorded.\n"), "{hard}");
        let early = said(&[1, 1, 1, 1], &[120, 80]);
        let words = "the recording solves it in 120 ticks; its actions lead elsewhere from tick 79 on, and reach the goal after \
                     80 ticks";
        let list = format!("No longer end as recorded (1):\n\n- hard:1: {words}\n");
        let row = format!("| hard:1 | solved | solved 1 of 2 episodes; lost 1; {words} |\n");
        assert!(early.contains(&list) && early.contains(&row) && !early.contains("--bot random"), "{early}");
    }

    #[test]
    fn a_failure_has_its_causes_and_where_each_is_most_frequent() {
        let counts =
            |causes: &[(&str, u64)]| causes.iter().map(|(cause, count)| ((*cause).to_owned(), *count)).collect();
        let end = |x, y, [lost, timed_out]: [u64; 2], causes: &[(&str, u64)]| {
            let causes = counts(causes);
            SquareEnds { x, y, lost, timed_out, causes }
        };
        let mut level = LevelVerdict {
            ends: vec![
                end(12.5, 3.0, [1, 0], &[("saw", 1)]),
                end(4.0, 1.0, [1, 1], &[("lava", 1), ("time", 1)]),
                end(20.0, 2.5, [1, 0], &[("saw", 1)]),
            ],
            causes: counts(&[("lava", 1), ("saw", 2), ("time", 1)]),
            ..verdict(0, 0, 4)
        };
        (level.score.lost, level.score.timed_out) = (3, 1);
        let start = "solved 0 of 4 episodes; lost 3, timed out 1";
        let causes = "saw 2 (near 12.5, 3.0), lava 1 (near 4.0, 1.0), time 1 (near 4.0, 1.0)";
        assert_eq!(message(&level), format!("{start}: {causes}"));
        assert_eq!(level.describe_losses(), Some(format!("lost 3, timed out 1: {causes}")));
        assert_eq!(verdict(0, 4, 4).describe_losses(), None);
        level.causes.insert("toad".to_owned(), 1);
        assert_eq!(message(&level), format!("{start}: {causes}, 1 more"));
        level.causes.clear();
        let squares = "2 near 4.0, 1.0; 1 near 12.5, 3.0; 1 near 20.0, 2.5";
        assert_eq!(message(&level), format!("{start} ({squares})"), "the game reports no causes");
        level.ends.push(end(30.0, 2.5, [0, 1], &[]));
        assert_eq!(message(&level), format!("{start} ({squares}; 1 more)"));
        level.ends.truncate(1);
        assert_eq!(message(&level), format!("{start} (1 near 12.5, 3.0)"), "the other positions are not known");
        level.ends[0].lost = 3;
        level.ends[0].timed_out = 1;
        assert_eq!(message(&level), format!("{start} (near 12.5, 3.0)"), "all of them in one square");
        level.ends.clear();
        assert_eq!(message(&level), start, "nor positions");
        assert_eq!(message(&verdict(0, 4, 4)), "solved 4 of 4 episodes");
        let (kind, entity) = (StopKind::Furthest, None);
        level.stop = Some(CommonStop { kind, x: 12.4, y: 3.0, within: 0.5, episodes: 4, of: 4, entity });
        let stopped = "all 4 episodes got no further from their start than (12.4, 3.0), within 0.5";
        assert_eq!(message(&level), format!("{start}; {stopped}"));
    }

    #[test]
    fn failed_episodes_are_those_of_exact_testers_first_and_then_some_of_the_others() {
        let testers = [
            tester("random", 0, 9, false),
            tester("solver", 9, 9, true),
            tester("jumper", 0, 9, true),
            tester("slow", 0, 9, true),
        ];
        let all: Vec<_> = failed_episodes(&testers, 9).collect();
        assert_eq!(all, [("jumper", 0), ("slow", 0), ("random", 0), ("random", 1), ("random", 2)]);
        assert_eq!(failed_episodes(&testers[..1], 1).collect::<Vec<_>>(), [("random", 0)]);
    }

    #[test]
    fn a_failure_that_is_not_kept_is_in_the_summary_with_the_reason_and_the_next_step() {
        let record = testing::record("hard:3..9");
        let why = Some("`random`, episode 0: it does not fail when it is played alone".to_owned());
        let level = LevelVerdict { not_kept: why, ..verdict(1, 0, 1) };
        let words = "hard:1: no failed episode is kept, because the game does not play the same each time (jump doctor garden \
                     --mode hard --level 4 --ticks 10000 may find the cause): `random`, episode 0: it does not fail when it \
                     is played alone";
        assert_eq!(missing_failure("jump", &record, &level).as_deref(), Some(words));
        assert_eq!(missing_failure("jump", &record, &verdict(1, 0, 1)), None);
        let parent = tempfile::tempdir().expect("a folder");
        let (mut folder, _) = TestFolder::open(parent.path(), &record, Earlier::Keep).expect("new");
        (0..7).for_each(|index| folder.keep(&LevelVerdict { index, ..level.clone() }).expect("writable"));
        folder.finish().expect("writable");
        let page = summary(&Overview::read(parent.path()).expect("results"), None, &PinnedFindings::default(), "jump");
        assert!(
            page.contains("Failed episodes that are not kept (7):\n\n- hard:1: no failed episode is kept, because "),
            "{page}"
        );
    }

    #[test]
    fn pins_are_in_the_summary() {
        let parent = tempfile::tempdir().expect("a folder");
        let level = LevelVerdict { findings: vec![in_file("a")], ..verdict(0, 0, 1) };
        let (mut folder, _) =
            TestFolder::open(parent.path(), &testing::record("hard:0..0"), Earlier::Keep).expect("new");
        folder.keep(&level).expect("writable");
        folder.finish().expect("writable");
        pin(parent.path(), &["a"], "2999-01-31");
        write_reports(parent.path(), None, "jump").expect("writable");
        let page = std::fs::read_to_string(parent.path().join(SUMMARY)).expect("written");
        assert!(page.contains("; panic: a; pinned until 2999-01-31: drawn anew in spring |"), "{page}");
    }

    #[test]
    fn places_that_are_not_compared_are_in_the_summary_with_the_command_that_compares_them() {
        let before = TestRecord { seed: 4, ..testing::record("hard:0..3") };
        let comparison = Comparison {
            places_left_out: vec!["the testers differ (a; before: b): 1 unsolved level, such as hard:0".to_owned()],
            earlier: Some(EarlierTest { folder: "my runs/a".into(), record: before.clone() }),
            ..Comparison::default()
        };
        let command = comparable_command("jump", &before, &comparison).expect("there is an earlier test");
        assert!(command.contains(" --bot random --episodes 1 --seed 4 --against 'my runs/a' "), "{command}");
        let lines = compared(&comparison, Some(command.clone()));
        for line in
            ["Places not compared: the testers differ (a; before: b): 1 unsolved level, such as hard:0.", &command]
        {
            assert!(lines.iter().any(|found| found == line), "{line}: {lines:?}");
        }
        let page = crate::verdict_report::compared(&comparison, &before, "jump");
        assert!(page.contains("<p>Places not compared: the testers differ (a; before: b): 1 "), "{page}");
        assert!(page.contains("<pre><code>jump test garden --levels hard:0..3 "), "{page}");
        assert_eq!(comparable_command("jump", &before, &Comparison::default()), None);
    }

    #[test]
    fn runs_are_named_by_their_folders_with_the_checkpoint_that_they_share() {
        let run = |folder: &str, step| TesterRecord {
            checksum: Some("0f".to_owned()),
            run: Some(TestedRun { folder: folder.to_owned(), step }),
            ..TesterRecord::bot(folder.rsplit('/').next().expect("a name"))
        };
        let [first, second] = [run("my runs/a", 4096), run("runs/b", 8192)];
        assert_eq!(testers(std::slice::from_ref(&first)), "--run 'my runs/a' --checkpoint 4096");
        assert_eq!(seen(&first), "--run 'my runs/a' --checkpoint 4096");
        let all = [TesterRecord::bot("random"), TesterRecord { greedy: true, ..first }, second];
        assert_eq!(testers(&all), "--bot random --run 'my runs/a' --run runs/b --greedy", "no checkpoint is theirs");
    }

    #[test]
    fn a_level_that_no_tester_solved_names_the_search_for_dead_actions_unless_it_was_made() {
        let policy = TesterRecord { checksum: Some("0f".to_owned()), ..TesterRecord::bot("ppo.policy") };
        let record = TestRecord {
            seed: 3,
            testers: vec![TesterRecord::bot("random"), policy],
            episodes: 2,
            ..testing::record("bed:5..9")
        };
        let failed = LevelVerdict { level: "bed:6".to_owned(), ..verdict(1, 0, 4) };
        let search = |record: &TestRecord, level: &LevelVerdict| action_search("jump", record, level);
        let command = |detectors: &str| {
            Some(format!(
                "jump test garden --levels bed:6 --bot random --policy ppo.policy --episodes 2 --seed 3 --detect \
                 {detectors} --out runs/actions-bed-6"
            ))
        };
        assert_eq!(search(&record, &failed), command("dead-action,fading-action"));
        let mut looked = record.clone();
        looked.detectors = vec!["stuck ticks=300".to_owned(), "dead-action every=1 moments=6".to_owned()];
        assert_eq!(search(&looked, &failed), command("fading-action"));
        looked.detectors.push("fading-action every=10 tries=40".to_owned());
        assert_eq!(search(&looked, &failed), command("fading-action"), "it looked at every tenth level");
        assert_eq!(search(&looked, &LevelVerdict { index: 20, ..failed.clone() }), None);
        assert_eq!(search(&record, &verdict(1, 4, 4)), None, "it was solved");
    }

    #[test]
    fn the_tester_that_failed_plays_again() {
        let trained = TesterRecord { checksum: Some("0f".to_owned()), greedy: true, ..TesterRecord::bot("ppo.policy") };
        let record = TestRecord {
            seed: 3,
            testers: vec![TesterRecord::bot("random"), trained],
            episodes: 2,
            ..testing::record("bed:5..9")
        };
        let testers = vec![tester("random", 2, 2, true), tester("ppo.policy", 1, 2, true)];
        let level = LevelVerdict { level: "bed:6".to_owned(), testers, ..verdict(1, 3, 4) };
        let again =
            "jump test garden --levels bed:6 --policy ppo.policy --greedy --episodes 2 --seed 3 --out again-bed-6";
        let shown = "jump view garden --levels bed:6 --policy ppo.policy --greedy --episode --out again-bed-6.png";
        assert_eq!(rerun_commands("jump", &record, &level), [again, shown]);
        let mut named = record.clone();
        named.testers[1].file = Some("my runs/a.policy".to_owned());
        let again = again.replace("ppo.policy", "'ppo.policy=my runs/a.policy'");
        let shown = shown.replace("ppo.policy", "'my runs/a.policy'");
        assert_eq!(rerun_commands("jump", &named, &level), [again.clone(), shown.clone()]);
        named.options = ["--no-detect", "stuck", "--par", "my pars.json"].map(str::to_owned).to_vec();
        let again = again.replace(" --out", " --no-detect stuck --par 'my pars.json' --out");
        assert_eq!(rerun_commands("jump", &named, &level), [again, shown]);
        let mut drawn = level.clone();
        drawn.testers[1].exact = false;
        let other = LevelVerdict { level: "lawns/my bed.json".to_owned(), ..level.clone() };
        let elsewhere = rerun_commands("jump", &record, &other);
        assert!(elsewhere[0].ends_with(" --out again-lawns-my-bed-json"), "each level has a folder: {elsewhere:?}");
        assert_eq!(rerun_commands("jump", &named, &drawn).len(), 1, "a picture would show another episode");
        let farmed = Finding {
            detector: "reward-farm".to_owned(),
            tester: Some("random".to_owned()),
            episode: Some(1),
            tick: Some(9),
            message: "paid for nothing".to_owned(),
            file: None,
            settings: Vec::new(),
        };
        let compared = LevelVerdict { findings: vec![farmed], ..level.clone() };
        let again = "jump test garden --levels bed:6 --bot random --policy ppo.policy --greedy --episodes 2 --seed 3 --out again-bed-6";
        let shown = "jump view garden --levels bed:6 --bot random --episode --out again-bed-6.png";
        assert_eq!(rerun_commands("jump", &record, &compared), [again, shown], "all are compared");
        let perfect = LevelVerdict { testers: vec![tester("random", 2, 2, false)], ..verdict(1, 2, 2) };
        assert!(rerun_commands("jump", &record, &perfect).is_empty());
        let finding = |name: &str| Finding {
            detector: "unreachable-goal".to_owned(),
            tester: None,
            episode: None,
            tick: None,
            message: "walled in".to_owned(),
            file: Some(format!("findings/{name}.finding")),
            settings: Vec::new(),
        };
        let findings = ["a", "b", "c", "d"].map(finding).to_vec();
        let walled = LevelVerdict { findings, ..perfect };
        let shown = ["a", "b", "c"].map(|name| format!("jump replay findings/{name}.finding"));
        let commands = rerun_commands("jump", &record, &walled);
        assert_eq!((commands[0].as_str(), &commands[1..]), (OF_RESULTS, &shown[..]), "three of them");
        let failed = LevelVerdict { testers: level.testers.clone(), ..walled };
        let commands = rerun_commands("jump", &record, &failed);
        assert_eq!(commands[1..4], shown);
        assert_eq!(commands[4], OF_TEST);
        assert!(commands[5].starts_with("jump test garden ") && commands[6].starts_with("jump view garden "));
    }
}
