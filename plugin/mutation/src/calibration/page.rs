//! The page of a calibration, as HTML with charts and as Markdown.

use crate::{
    calibration::{Agreement, Calibration, CalibrationError, FEW_LEVELS, LevelNumbers, Measure, rank::RankCorrelation},
    scatter::draw_scatters,
};
use bevy_playbot::demo::file::{DemoEpisode, DemoHeader};
use playbot_harness::{
    drawing::Drawing,
    game::{Game, read_level_designs},
    level_files::is_level_files,
};
use playbot_report::{
    Chart, Curve, PlainTable, Report, Section, counted, markdown_cell, markdown_row, percent, readable, whole,
};
use playbot_test::verdict::{TestRecord, hash_of_files};
use std::{collections::BTreeMap, path::Path};

/// Most levels in the tables of a page.
const MOST_LEVELS: usize = 2000;

impl Calibration {
    /// Returns a page that opens from disk without network: agreement, scatter plots, and every level.
    pub fn to_html(&self) -> String {
        let section = |heading: &str| Section { heading: heading.to_owned(), ..Section::default() };
        let agreement = Section {
            text: [self.words(), vec![self.method().to_owned()]].concat().join("\n\n"),
            tables: vec![self.agreement_table().into()],
            ..section("Agreement")
        };
        let plots = Section {
            text: "Each dot is a level; on the line `equal` people and testers have the same number.".to_owned(),
            charts: self.scatters(),
            ..section("People and testers")
        };
        let levels = Section { tables: vec![self.level_table(MOST_LEVELS).into()], ..section("Levels") };
        let report = Report {
            title: format!("Bots beside people: {}", self.game),
            subtitle: format!("{}, version {} of the game", self.range, self.game_version),
            sections: vec![agreement, plots, levels],
        };
        report.to_html()
    }

    /// Returns the page without charts, for a pull request.
    pub fn to_markdown(&self) -> String {
        let mut parts = vec![format!(
            "# Bots beside people: {} {}",
            markdown_cell(&self.game),
            markdown_cell(&self.range.to_string())
        )];
        parts.extend(self.words().iter().map(|words| markdown_cell(words)));
        parts.push(markdown(&self.agreement_table()));
        parts.push(self.method().to_owned());
        parts.push("## Levels".to_owned());
        parts.push(markdown(&self.level_table(MOST_LEVELS)));
        parts.join("\n\n") + "\n"
    }

    /// Returns the scatter plots of all measures as one picture.
    pub fn to_drawing(&self) -> Drawing {
        draw_scatters(&self.scatters())
    }

    fn scatters(&self) -> Vec<Chart> {
        Measure::ALL.into_iter().filter_map(|measure| self.scatter(measure)).collect()
    }

    /// Returns a scatter plot of the levels, people on the x axis and a tester on the y axis, with the line on which
    /// both are equal. Returns `None` if no level has both numbers.
    pub fn scatter(&self, measure: Measure) -> Option<Chart> {
        let curve =
            |(tester, name): (usize, &String)| Curve::scatter(name.as_str(), measure.pairs(&self.levels, tester));
        let mut curves: Vec<Curve> = self.testers.iter().enumerate().map(curve).collect();
        if curves.iter().all(|curve| curve.points.is_empty()) {
            return None;
        }
        curves.extend(diagonal(&curves));
        let (title, y_range) = match measure {
            Measure::Completion => ("Share of tries that were completed", Some((0.0, 1.0))),
            Measure::Time => ("Ticks of completed tries", None),
            Measure::Deaths => ("Deaths in a try", Some((0.0, 1.0))),
        };
        Some(Chart {
            title: title.to_owned(),
            x_label: "people".to_owned(),
            y_label: "testers".to_owned(),
            curves,
            y_range,
            ..Chart::default()
        })
    }
}

/// Returns the line on which both numbers are equal, within the range of the dots; `None` if all dots coincide. Both
/// axes have one unit.
fn diagonal(curves: &[Curve]) -> Option<Curve> {
    let numbers =
        || curves.iter().flat_map(|curve| &curve.points).flat_map(|&(x, y)| [x, y]).filter(|it| it.is_finite());
    let (low, high) = (numbers().fold(f64::INFINITY, f64::min), numbers().fold(f64::NEG_INFINITY, f64::max));
    (low < high).then(|| Curve::new("equal", vec![(low, low), (high, high)]))
}

fn markdown(table: &PlainTable) -> String {
    let ruler = format!("|{}", "---|".repeat(table.columns.len()));
    let rows = table.rows.iter().map(|cells| markdown_row(cells));
    [markdown_row(&table.columns), ruler].into_iter().chain(rows).collect::<Vec<_>>().join("\n")
}

/// The levels of results, as recordings know them.
pub(super) enum LevelNames {
    /// Generated from seeds: by mode and number.
    Seeds,
    /// Files: the names of all files with a level of this hash.
    Files(BTreeMap<u64, Vec<String>>),
}

impl LevelNames {
    /// Reads the levels of the results in this folder.
    pub fn of(results: &Path, record: &TestRecord, game: Option<&dyn Game>) -> Result<Self, CalibrationError> {
        if !is_level_files(&record.range.mode) {
            return Ok(Self::Seeds);
        }
        let no_game = || CalibrationError::NoGame { results: results.into(), game: record.game.clone() };
        let game = game.ok_or_else(no_game)?;
        let designs = read_level_designs(game, &record.range.mode)?;
        if hash_of_files(game, &record.range) != record.files {
            let range = record.range.to_string();
            return Err(CalibrationError::ChangedFiles { results: results.into(), range });
        }
        let mut names: BTreeMap<u64, Vec<String>> = BTreeMap::new();
        for level in record.range.levels() {
            if let (Some(hash), Some(path)) = (designs.hash(level), designs.path(level)) {
                names.entry(hash).or_default().push(path.to_owned());
            }
        }
        Ok(Self::Files(names))
    }

    /// Returns the names that results give to the level of an episode. Files with the same level have several names.
    pub fn of_episode(&self, header: &DemoHeader, episode: &DemoEpisode) -> Vec<String> {
        match (&episode.level_file, self) {
            (None, _) => vec![format!("{}:{}", header.mode, episode.level_seed)],
            (Some(file), Self::Files(names)) => {
                names.get(&file.hash).cloned().unwrap_or_else(|| vec![file.to_string()])
            }
            (Some(file), Self::Seeds) => vec![file.to_string()],
        }
    }
}

// The tables of a calibration.

/// The sign for a missing number.
const NONE: &str = "–";

impl Calibration {
    /// Returns the table of agreement of each tester with people.
    pub fn agreement_table(&self) -> PlainTable {
        let row = |agreement: &Agreement| {
            vec![
                agreement.tester.clone(),
                agreement.measure.name().to_owned(),
                whole(agreement.levels as f64),
                correlation(agreement.spearman),
                correlation(agreement.kendall),
                agreement.note.clone().unwrap_or_default(),
            ]
        };
        let columns = ["tester", "measure", "levels", "Spearman (95 %)", "Kendall tau-b (95 %)", "note"];
        PlainTable {
            caption: format!("{} {}: agreement with people", self.game, self.range),
            columns: columns.map(str::to_owned).to_vec(),
            rows: self.agreements.iter().map(row).collect(),
        }
    }

    /// Returns the table of levels, with the numbers of people and testers, of at most `most` levels.
    pub fn level_table(&self, most: usize) -> PlainTable {
        let mut columns = ["level", "people", "tries"].map(str::to_owned).to_vec();
        for who in ["people"].into_iter().chain(self.testers.iter().map(String::as_str)) {
            columns.extend(Measure::ALL.map(|measure| format!("{who}: {}", heading(measure))));
        }
        let rows = self.levels.iter().take(most).map(|level| {
            let mut row = vec![level.level.clone(), whole(level.persons as f64), whole(level.people.tries as f64)];
            for numbers in [level.people].iter().chain(&level.testers) {
                row.extend(Measure::ALL.map(|measure| cell(measure, numbers)));
            }
            row
        });
        let more = self.levels.len().saturating_sub(most);
        let more = if more > 0 { format!(" (and {} more)", whole(more as f64)) } else { String::new() };
        PlainTable { caption: format!("levels{more}"), columns, rows: rows.collect() }
    }
}

fn heading(measure: Measure) -> &'static str {
    match measure {
        Measure::Completion => "completed",
        Measure::Time => "ticks",
        Measure::Deaths => "deaths per try",
    }
}

fn cell(measure: Measure, numbers: &LevelNumbers) -> String {
    match (measure, measure.of(numbers)) {
        (_, None) => NONE.to_owned(),
        (Measure::Completion, Some(share)) => percent(share),
        (Measure::Time | Measure::Deaths, Some(number)) => readable(number),
    }
}

fn correlation(found: Option<RankCorrelation>) -> String {
    // Negative zero is printed without its sign.
    let shown = |value: f64| format!("{value:.2}").replace("-0.00", "0.00").replace('-', "−");
    match found {
        None => NONE.to_owned(),
        Some(RankCorrelation { value, interval: None }) => shown(value),
        Some(RankCorrelation { value, interval: Some([low, high]) }) => {
            format!("{} ({} to {})", shown(value), shown(low), shown(high))
        }
    }
}

// The sentences of a calibration's reports.

/// Most people that are named.
const MOST_NAMED: usize = 8;

impl Calibration {
    /// Returns the sentences about the compared levels, the left-out episodes and the limits of the numbers.
    pub fn words(&self) -> Vec<String> {
        let shared = counted(self.levels.len() as u64, "level");
        let tries: u64 = self.levels.iter().map(|level| level.people.tries).sum();
        let names: Vec<&str> = self.people.iter().take(MOST_NAMED).map(String::as_str).collect();
        let more = if self.people.len() > MOST_NAMED { ", …" } else { "" };
        let people = match self.people.len() {
            1 => "1 person".to_owned(),
            count => format!("{count} people"),
        };
        let were = if self.levels.len() == 1 { "was" } else { "were" };
        let mut words = vec![format!(
            "{shared} of {} {were} played by {people} ({}{more}) in {}. Each person counts once on a level, however many tries \
             it took.",
            self.range,
            names.join(", "),
            counted(tries, "try"),
        )];
        let others =
            [(self.only_tested, "not played by people"), (self.only_recorded, "played by people and not tested")];
        let others = others.into_iter().filter(|(count, _)| *count > 0);
        let mut left_out: Vec<String> =
            others.map(|(count, what)| format!("{} {what}", counted(count, "level"))).collect();
        left_out.extend(self.left_out.iter().cloned());
        if !left_out.is_empty() {
            words.push(format!("Left out: {}.", left_out.join(", ")));
        }
        if self.levels.len() < FEW_LEVELS {
            words.push(format!(
                "With {shared}, too few are shared to say how well bots and people agree: record people on {FEW_LEVELS} \
                 levels or more, easy and hard ones."
            ));
        }
        words
    }

    /// Returns the method in a few sentences.
    pub fn method(&self) -> &'static str {
        "A rank correlation is 1 if a tester orders the levels from easy to hard as people do, 0 if its order says nothing of \
         theirs, −1 if it is the reverse. Spearman's has a 95 % interval by Fisher's z with the variance of Bonett and Wright \
         (2000), Kendall's tau-b by Fisher's z with that of Fieller, Hartley and Pearson (1957). Time is the median of the \
         completed tries, in ticks; deaths are tries that the game ended before the goal."
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_diagonal_spans_all_dots_of_both_axes() {
        let one = Curve::scatter("one", vec![(2.0, 5.0), (f64::NAN, 90.0)]);
        let other = Curve::scatter("other", vec![(3.0, 1.0)]);
        let line = diagonal(&[one, other]).expect("several numbers");
        assert_eq!((line.points, line.is_scatter), (vec![(1.0, 1.0), (90.0, 90.0)], false));
        assert_eq!(diagonal(&[Curve::scatter("one", vec![(2.0, 2.0)])]), None);
    }

    #[test]
    fn correlations_have_two_decimals() {
        let of = |value, interval| correlation(Some(RankCorrelation { value, interval }));
        assert_eq!(of(0.8, Some([-0.457, 0.991])), "0.80 (−0.46 to 0.99)");
        assert_eq!(of(-0.001, None), "0.00");
        assert_eq!(correlation(None), NONE);
    }
}
