//! The Markdown page of a score.

use super::{record::ScoreBudget, table::ScoreTable};
use crate::report::{PlainTable, markdown_cell, markdown_row};

impl ScoreTable {
    /// Returns the page: headline numbers, classes, testers, and the method.
    pub fn to_markdown(&self) -> String {
        let mut lines = vec!["# Planted defects".to_owned(), String::new()];
        lines.extend(self.headlines().iter().map(|line| format!("- {}", markdown_cell(line))));
        for table in [self.class_table(), self.tester_table()] {
            lines.extend([String::new(), format!("## {}", heading(&table.caption)), String::new()]);
            lines.extend(rows(&table));
        }
        lines.extend([String::new(), "## How it is measured".to_owned(), String::new()]);
        lines.extend(self.notes().iter().map(|note| format!("- {note}")));
        if self.commands.iter().any(|command| !command.is_empty()) {
            lines.extend([String::new(), "```sh".to_owned()]);
            lines.extend(self.commands.iter().filter(|command| !command.is_empty()).cloned());
            lines.push("```".to_owned());
        }
        lines.push(String::new());
        lines.join("\n")
    }

    fn notes(&self) -> Vec<String> {
        let ScoreBudget { episodes, steps, routes, replays, seed } = self.budget;
        let sets: Vec<String> = self.sets.iter().map(|set| format!("{} (seed {})", set.hash, set.seed)).collect();
        let skilled: Vec<&str> =
            self.testers.iter().filter(|row| row.skilled).flat_map(|row| &row.testers).map(String::as_str).collect();
        let skilled = if skilled.is_empty() { "none".to_owned() } else { markdown_cell(&skilled.join(", ")) };
        vec![
            format!("Games and versions: {}. Sets: {}.", markdown_cell(&self.games.join(", ")), sets.join(", ")),
            format!(
                "A sound level has no planted defect. Each tester has the same budget on each mutant and sound level: \
                 {} for testers that play, {steps} steps and {routes} replayed paths for explorers. Seed: {seed}.",
                if episodes == 1 { "1 episode".to_owned() } else { format!("{episodes} episodes") }
            ),
            "A mutant is found if a detector reports something, the game breaks, or the level is proved to be \
             unsolvable. The failure of a tester counts if it solves at least 99 % of the sound levels of the game. A tester \
             that solves fewer, but collects similar rewards on all of them, fails by a reward outside of all those and \
             more than four standard deviations from their mean. On a sound level the same, compared with the others, is a false \
             finding."
                .to_owned(),
            "Beside a sound build, a difference from the same tester's episodes on the sound level counts too. Without \
             random numbers any difference counts. Otherwise Fisher's exact test decides, with at most one in twenty \
             false over all mutants (Benjamini and Hochberg)."
                .to_owned(),
            "Precision is the share of mutants among all findings in mutants and on sound levels. Intervals are 95 % \
             Wilson intervals."
                .to_owned(),
            "Some games bring detectors that know their rules. The column without them counts findings of the detectors \
             of all games, proofs and failures."
                .to_owned(),
            "Findings are minimised. Counted are actions with an effect, as a share of the path up to the tick of the \
             finding, and of the whole episode in which it was found."
                .to_owned(),
            format!("Testers with learned skills: {skilled}."),
            format!(
                "Seconds are {}, for mutants, without minimisation, which takes up to {replays} replays each.",
                self.clock.describe()
            ),
        ]
    }
}

fn rows(table: &PlainTable) -> Vec<String> {
    let rule = table.columns.iter().enumerate().map(|(index, _)| if index == 0 { "---" } else { "---:" });
    let rule = format!("|{}|", rule.collect::<Vec<_>>().join("|"));
    [markdown_row(&table.columns), rule].into_iter().chain(table.rows.iter().map(|row| markdown_row(row))).collect()
}

/// Returns the text with a capital.
fn heading(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
