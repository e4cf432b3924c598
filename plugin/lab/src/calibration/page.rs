//! The page of a calibration, as HTML with charts and as Markdown.

use super::{agreement::Measure, read::Calibration};
use crate::{
    drawing::Drawing,
    report::{Chart, Curve, PlainTable, Report, Section, draw_scatters, markdown_cell, markdown_row},
};

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
    /// both are equal; `None` if no level has both numbers.
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
            marks: Vec::new(),
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
}
