//! Tables of a score, for the console and for Markdown.

use super::{
    numbers::{Share, short_number},
    table::{FEW_FALSE, ScoreTable},
    tester_row::TesterRow,
};
use crate::report::PlainTable;

impl ScoreTable {
    /// Returns the summary, in a few lines.
    pub fn headlines(&self) -> Vec<String> {
        let mix = |row: &TesterRow| {
            let names = if row.testers.is_empty() { "no tester".to_owned() } else { row.testers.join(" + ") };
            let first =
                row.first_seconds.map_or_else(String::new, |s| format!("; median to the first {} s", short_number(s)));
            format!(
                "{names}: recall {}, something found on {} sound levels, {} called unsolvable; {} defects per hour{first}",
                row.recall.describe(),
                row.false_findings.short(),
                row.called_unsolvable,
                row.found_per_hour.map_or_else(|| "–".to_owned(), short_number)
            )
        };
        let mut lines = vec![
            format!("{} mutants in {} classes, {} sound levels", self.mutants, self.classes.len(), self.sound),
            format!("Best mix: {}", mix(&self.best)),
        ];
        if self.careful.testers != self.best.testers {
            let most = 100.0 * FEW_FALSE;
            lines.push(format!(
                "Best mix with false findings on at most {most} % of sound levels: {}",
                mix(&self.careful)
            ));
        }
        lines.push(format!("All testers: {}", mix(&self.all)));
        lines.push(format!(
            "Found by testers with learned skills alone: {} of all defects, {} of those that are found",
            self.only_skills.describe(),
            self.only_skills_of_found.describe()
        ));
        lines
    }

    /// Returns the meanings of the columns, a line each.
    pub fn meanings() -> Vec<String> {
        vec![
            "best mix: the fewest testers that together find most".to_owned(),
            format!(
                "careful mix: the same, with something found on at most {} % of the sound levels and none called unsolvable",
                100.0 * FEW_FALSE
            ),
            "without games' own detectors: found by detectors of all games, by a proof, or by failing".to_owned(),
            "beside a sound build: found as before, or by a difference from the sound level or game, with the best mix"
                .to_owned(),
            "of the path, of the episode: the share that is left of the actions up to the finding, and of its episode"
                .to_owned(),
            "skills alone: found by testers with learned skills and by no other".to_owned(),
        ]
    }

    /// Returns the table of classes.
    pub fn class_table(&self) -> PlainTable {
        let names = self.testers.iter().map(|tester| tester.testers.join(" + "));
        let last = ["best mix", "precision", "careful mix", "beside a sound build", "skills alone"];
        let columns = ["class", "mutants"].map(str::to_owned).into_iter().chain(names).chain(last.map(str::to_owned));
        let rows = self.classes.iter().map(|class| {
            let all = class.testers.iter();
            let last = [&class.best, &class.precision, &class.careful, &class.beside, &class.only_skills];
            let first = [class.class.clone(), class.best.of.to_string()];
            first.into_iter().chain(all.chain(last).map(Share::short)).collect::<Vec<String>>()
        });
        PlainTable { caption: "defects found, by class".to_owned(), columns: columns.collect(), rows: rows.collect() }
    }

    /// Returns the table of testers and mixes.
    pub fn tester_table(&self) -> PlainTable {
        let columns = [
            "tester",
            "recall",
            "without games' own detectors",
            "beside a sound build",
            "precision",
            "false findings",
            "called unsolvable",
            "defects per hour",
            "seconds to the first",
            "minimised actions",
            "of the path",
            "of the episode",
        ];
        let number = |number: Option<f64>| number.map_or_else(|| "–".to_owned(), short_number);
        let percent =
            |share: Option<f64>| share.map_or_else(|| "–".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        let row = |name: String, row: &TesterRow| {
            vec![
                name,
                row.recall.describe(),
                row.without_own.short(),
                row.beside.short(),
                row.precision.describe(),
                row.false_findings.describe(),
                row.called_unsolvable.to_string(),
                number(row.found_per_hour),
                number(row.first_seconds),
                number(row.minimised),
                percent(row.minimised_share),
                percent(row.episode_share),
            ]
        };
        let testers = self.testers.iter().map(|tester| row(tester.testers.join(" + "), tester));
        let mixes = [("best mix", &self.best), ("careful mix", &self.careful), ("all testers", &self.all)];
        let mixes = mixes.into_iter().map(|(name, mix)| row(name.to_owned(), mix));
        PlainTable {
            caption: "testers".to_owned(),
            columns: columns.map(str::to_owned).to_vec(),
            rows: testers.chain(mixes).collect(),
        }
    }
}
