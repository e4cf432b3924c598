//! Summary of results in a page of Markdown, short enough for a pull request.

use std::fmt::Display;

use super::{
    compare::Comparison, fisher::Trials, interval::wilson, junit::message, overview::Overview, rerun::rerun_commands,
};
use crate::report::markdown_cell;

/// Most changes of a kind that are listed.
const MOST_CHANGES: usize = 20;

/// Writes the page.
pub(super) fn summary(overview: &Overview, comparison: Option<&Comparison>, program: &str) -> String {
    let record = &overview.record;
    let mut lines = vec![format!("# {} {}", record.game, markdown_cell(&record.range.to_string())), String::new()];
    let solved = Trials { successes: overview.solved, trials: overview.levels };
    lines.push(format!(
        "**{} level{}**: {} solved{}, {} unsolved with nothing proved, {} proved unsolvable; {} finding{}.",
        overview.levels,
        if overview.levels == 1 { "" } else { "s" },
        overview.solved,
        interval(solved),
        overview.bot_failed,
        overview.proved_unsolvable,
        overview.findings,
        if overview.findings == 1 { "" } else { "s" }
    ));
    if overview.places.percent().is_some() {
        lines.push(format!("{} of the open squares were visited.", overview.places.describe()));
    }
    let head = ["", "| tester | levels solved | episodes solved | squares visited |", "|---|---:|---:|---:|"];
    lines.extend(head.map(str::to_owned));
    for tester in &overview.testers {
        let share = |of: Trials| format!("{} of {}{}", of.successes, of.trials, interval(of));
        let (levels, episodes, places) = (share(tester.levels), share(tester.episodes), tester.places.describe());
        lines.push(format!("| {} | {levels} | {episodes} | {places} |", markdown_cell(&tester.name)));
    }
    if let Some(comparison) = comparison {
        lines.extend(compared(comparison));
    }
    if !overview.worst.is_empty() {
        lines.extend(
            ["", "## Levels to look at", "", "| level | outcome | problem |", "|---|---|---|"].map(str::to_owned),
        );
        for level in &overview.worst {
            let what = markdown_cell(&message(level));
            lines.push(format!("| {} | {} | {what} |", markdown_cell(&level.level), level.outcome.name()));
        }
        let shown = overview.worst.first().map(|level| rerun_commands(program, record, level)).unwrap_or_default();
        if !shown.is_empty() {
            lines.extend(["", "To play the first one again:", "", "```sh"].map(str::to_owned));
            lines.extend(shown);
            lines.push("```".to_owned());
        }
    }
    lines.push(String::new());
    lines.join("\n")
}

/// Formats the 95 % interval of a share, in percent.
pub(super) fn interval(of: Trials) -> String {
    let [low, high] = wilson(of.successes, of.trials).map(|share| 100.0 * share);
    format!(" ({low:.1} to {high:.1} %)")
}

fn compared(comparison: &Comparison) -> Vec<String> {
    let mut lines = vec![String::new(), "## Since the earlier results".to_owned(), String::new()];
    let Comparison { levels, only_now, only_before, .. } = comparison;
    lines.push(format!("{levels} levels in both, {only_now} only now, {only_before} only before."));
    lines.extend(comparison.left_out.iter().map(|why| format!("Left out: {}.", markdown_cell(why))));
    let mut list = |title: &str, changes: Vec<String>| {
        if changes.is_empty() {
            return;
        }
        lines.extend([String::new(), format!("{title} ({}):", changes.len()), String::new()]);
        let more = changes.len().saturating_sub(MOST_CHANGES);
        lines.extend(changes.into_iter().take(MOST_CHANGES).map(|change| format!("- {}", markdown_cell(&change))));
        lines.extend((more > 0).then(|| format!("- and {more} more")));
    };
    list("Unsolvable", texts(&comparison.unsolvable));
    list("Harder", texts(&comparison.harder));
    list("Easier", texts(&comparison.easier));
    list("New findings", texts(&comparison.new_findings));
    list("Gone findings", texts(&comparison.gone_findings));
    if !comparison.has_alarms() && comparison.easier.is_empty() && comparison.gone_findings.is_empty() {
        lines.extend([String::new(), "Nothing has changed by more than chance.".to_owned()]);
    }
    lines
}

fn texts(changes: &[impl Display]) -> Vec<String> {
    changes.iter().map(ToString::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::{
        LevelVerdict, MapScope, Places, TestRecord, TesterRecord,
        folder::{Earlier, TestFolder},
        testing::verdict,
    };

    #[test]
    fn the_share_of_visited_places_is_told_where_it_is_known() {
        let record = TestRecord {
            game: "garden".to_owned(),
            game_version: 1,
            range: "hard:0..0".parse().expect("a split"),
            files: None,
            seed: 0,
            testers: vec![TesterRecord::bot("random")],
            episodes: 2,
            detectors: Vec::new(),
            options: Vec::new(),
            maps: MapScope::default(),
            shard: None,
        };
        let said = |level: &LevelVerdict| {
            let parent = tempfile::tempdir().expect("a folder");
            let (mut folder, _) = TestFolder::open(parent.path(), &record, Earlier::Keep).expect("new");
            folder.keep(level).expect("writable");
            folder.finish().expect("writable");
            summary(&Overview::read(parent.path()).expect("results"), None, "playbot")
        };
        let plain = said(&verdict(0, 2, 2));
        assert!(plain.contains("| random | 1 of 1") && plain.contains(" | – |"), "{plain}");
        assert!(!plain.contains("open squares"), "{plain}");
        let mut level = LevelVerdict { places: Some(Places { visited: 3, open: 4 }), ..verdict(0, 2, 2) };
        level.testers[0].places = Some(Places { visited: 1, open: 4 });
        let mapped = said(&level);
        assert!(mapped.contains("75.0 % of the open squares") && mapped.contains(" | 25.0 % |"), "{mapped}");
    }
}
