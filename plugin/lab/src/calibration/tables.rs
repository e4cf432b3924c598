//! The tables of a calibration.

use super::{
    agreement::{Agreement, Measure},
    numbers::Numbers,
    rank::RankCorrelation,
    read::Calibration,
};
use crate::report::{PlainTable, percent, readable, whole};

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

fn cell(measure: Measure, numbers: &Numbers) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_have_two_decimals() {
        let of = |value, interval| correlation(Some(RankCorrelation { value, interval }));
        assert_eq!(of(0.8, Some([-0.457, 0.991])), "0.80 (−0.46 to 0.99)");
        assert_eq!(of(-0.001, None), "0.00");
        assert_eq!(correlation(None), NONE);
    }
}
