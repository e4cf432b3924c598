//! Tables, in HTML and as text for the console.

use crate::{
    escape::{escape, one_line},
    number::{UNKNOWN, decimals_for, fixed, mean_and_error, percent},
    results::{Rank, ResultRow, ResultTable, rank_key, ranks},
    text_table::{NO_SUCCESS, has_no_success},
};
use std::fmt::Write;

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlainTable {
    /// Caption of the table.
    pub caption: String,
    /// The headings.
    pub columns: Vec<String>,
    /// The cells, row by row; missing ones stay empty. Columns whose cells are numbers are right-aligned.
    pub rows: Vec<Vec<String>>,
}

impl PlainTable {
    /// Returns the table for the console, with aligned columns; ends with a line feed.
    pub fn to_text(&self) -> String {
        self.to_text_within(usize::MAX)
    }

    /// Returns the table for a console of this width. If it is too wide, long words lose their middle, but keep at least
    /// twelve letters. Numbers are never shortened.
    pub fn to_text_within(&self, most: usize) -> String {
        let numbers = number_columns(self);
        let mut rows: Vec<Vec<String>> = std::iter::once(&self.columns)
            .chain(&self.rows)
            .map(|row| (0..numbers.len()).map(|c| row.get(c).map_or(String::new(), |cell| one_line(cell))).collect())
            .collect();
        let width = |c: usize| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0);
        let mut widths: Vec<usize> = (0..numbers.len()).map(width).collect();
        fit(&mut widths, &numbers, most);
        rows.iter_mut().for_each(|row| row.iter_mut().zip(&widths).for_each(|(cell, width)| shorten(cell, *width)));
        let line = |row: &[String]| {
            let cells = row.iter().zip(&widths).zip(&numbers).map(|((cell, &width), number)| {
                if *number { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
        };
        let ruler: Vec<String> = widths.iter().map(|width| "-".repeat(*width)).collect();
        let mut out = if self.caption.is_empty() { String::new() } else { one_line(&self.caption) + "\n" };
        out += &line(&rows[0]);
        out += &line(&ruler);
        rows[1..].iter().for_each(|row| out += &line(row));
        out
    }
}

/// Fewest letters that are left of a word in a table that is too wide.
pub const FEWEST_LETTERS: usize = 12;

/// Space between two columns.
const GAP: usize = 2;

/// Takes letters from the widest column of words, again and again, until the table is no wider than `most`.
fn fit(widths: &mut [usize], numbers: &[bool], most: usize) {
    let total = |widths: &[usize]| widths.iter().map(|width| width + GAP).sum::<usize>().saturating_sub(GAP);
    while total(widths) > most {
        let words = widths.iter_mut().zip(numbers).filter(|(_, number)| !**number).map(|(width, _)| width);
        match words.max() {
            Some(widest) if *widest > FEWEST_LETTERS => *widest -= 1,
            _ => return,
        }
    }
}

/// Replaces the middle of a text that is longer than `width`. More is kept of its end: paths differ there.
fn shorten(text: &mut String, width: usize) {
    let length = text.chars().count();
    if length > width {
        let begin = width.saturating_sub(1) / 3;
        let end = width.saturating_sub(1) - begin;
        let kept = text.chars().take(begin).chain(['…']).chain(text.chars().skip(length - end));
        *text = kept.collect();
    }
}

/// A table of a section.
#[derive(Clone, Debug, PartialEq)]
pub enum Table {
    /// Results of methods, with bars.
    Results(ResultTable),
    /// Any text.
    Plain(PlainTable),
}

impl From<ResultTable> for Table {
    fn from(table: ResultTable) -> Self {
        Self::Results(table)
    }
}

impl From<PlainTable> for Table {
    fn from(table: PlainTable) -> Self {
        Self::Plain(table)
    }
}

impl Table {
    pub(crate) fn to_html(&self) -> String {
        match self {
            Self::Results(table) => results(table),
            Self::Plain(table) => plain(table),
        }
    }
}

fn wrapped(caption: &str, head: &str, body: &str, key: Option<String>) -> String {
    let caption = if caption.is_empty() { String::new() } else { format!("<caption>{}</caption>\n", escape(caption)) };
    let key = key.map(|k| format!("<p class=\"key\">{}</p>\n", escape(&k))).unwrap_or_default();
    format!(
        "<div class=\"table\"><table>\n{caption}<thead>{head}</thead>\n<tbody>\n{body}</tbody></table></div>\n{key}"
    )
}

/// Returns the columns that hold numbers and empty cells only; no column without rows.
pub(crate) fn number_columns(table: &PlainTable) -> Vec<bool> {
    let width = table.rows.iter().map(Vec::len).fold(table.columns.len(), usize::max);
    let is_number = |text: &String| {
        let digits = text.trim_start_matches(['-', '−', '+', '±', '<', '>', '≥', '≤', ' ']);
        digits.starts_with(|c: char| c.is_ascii_digit()) || text.is_empty() || text == UNKNOWN
    };
    let numbers = |c: usize| !table.rows.is_empty() && table.rows.iter().all(|r| r.get(c).is_none_or(is_number));
    (0..width).map(numbers).collect()
}

fn plain(table: &PlainTable) -> String {
    let class: Vec<&str> =
        number_columns(table).into_iter().map(|number| if number { " class=\"number\"" } else { "" }).collect();
    let width = class.len();
    let cell = |row: &[String], c: usize| row.get(c).map(|t| escape(t)).unwrap_or_default();
    let row = |tag: &str, cells: &[String]| {
        let cells: String = (0..width).map(|c| format!("<{tag}{}>{}</{tag}>", class[c], cell(cells, c))).collect();
        format!("<tr>{cells}</tr>")
    };
    let body: String = table.rows.iter().map(|r| row("td", r) + "\n").collect();
    let none = format!("<tr><td colspan=\"{}\">nothing</td></tr>\n", width.max(1));
    wrapped(&table.caption, &row("th", &table.columns), if body.is_empty() { &none } else { &body }, None)
}

fn results(table: &ResultTable) -> String {
    let ranks = ranks(&table.rows);
    let all = || table.rows.iter().chain(&table.references);
    let bars = BarScale::new(all());
    let decimals = decimals_for(all().map(|r| r.return_se));
    let speed = all().any(|r| r.steps_per_s.is_some());
    let mut head = String::from("<tr><th></th><th>Method</th><th>Levels</th>");
    let hides_success = has_no_success(all());
    let columns = [(true, "Episodes"), (true, "Return ± s.e."), (false, ""), (true, "Success"), (true, "Length")];
    for (number, name) in columns.into_iter().filter(|(_, name)| *name != "Success" || !hides_success) {
        let _ = write!(head, "<th{}>{name}</th>", if number { " class=\"number\"" } else { "" });
    }
    head += if speed { "<th class=\"number\">Steps/s</th></tr>" } else { "</tr>" };

    let mut body = String::new();
    let mut split_before: Option<&str> = None;
    for (i, row) in all().enumerate() {
        let rank = ranks.get(i).copied();
        let (class, sign) = match rank {
            Some(Rank::Best) => ("best", "★"),
            Some(Rank::CloseToBest) => ("close", "≈"),
            Some(Rank::Other) => ("", ""),
            None => ("reference", ""),
        };
        // A rule sets a new group of levels apart.
        let group = if split_before.is_some_and(|s| s != row.split) || i == table.rows.len() { " group" } else { "" };
        split_before = Some(&row.split);
        let _ = write!(
            body,
            "<tr class=\"{class}{group}\"><td class=\"sign\">{sign}</td><td>{}</td><td class=\"split\">{}</td>",
            escape(&row.method),
            escape(&row.split)
        );
        let episodes = if row.episodes == 0 { UNKNOWN.to_owned() } else { fixed(row.episodes as f64, 0) };
        let _ = write!(body, "<td class=\"number\">{episodes}</td>");
        let _ = write!(body, "<td class=\"number\">{}</td>", mean_and_error(row.return_mean, row.return_se, decimals));
        let _ = write!(body, "<td>{}</td>", bars.draw(row));
        if !hides_success {
            let _ = write!(body, "<td class=\"number\">{}</td>", percent(row.success));
        }
        let _ = write!(body, "<td class=\"number\">{}</td>", fixed(row.length_mean, 1));
        if speed {
            let text = row.steps_per_s.map_or(UNKNOWN.to_owned(), |s| fixed(s, 0));
            let _ = write!(body, "<td class=\"number\">{text}</td>");
        }
        body += "</tr>\n";
    }
    if body.is_empty() {
        body = format!("<tr><td colspan=\"{}\">no results</td></tr>\n", 8 + usize::from(speed));
    }
    let mut key: Vec<String> = rank_key(&ranks, "★", "≈").into_iter().collect();
    if !table.references.is_empty() {
        key.push("rows in italics are references, not measured here".to_owned());
    }
    if hides_success {
        key.push(NO_SUCCESS.to_owned());
    }
    wrapped(&table.caption, &head, &body, (!key.is_empty()).then(|| key.join("; ") + "."))
}

/// Common scale of the bars of a table; it includes 0.
struct BarScale {
    low: f64,
    high: f64,
}

impl BarScale {
    const WIDTH: f64 = 96.0;

    fn new<'a>(rows: impl Iterator<Item = &'a ResultRow>) -> Self {
        let mut scale = Self { low: 0.0, high: 0.0 };
        for (low, high) in rows.filter_map(ends) {
            scale.low = scale.low.min(low);
            scale.high = scale.high.max(high);
        }
        if scale.low == scale.high {
            scale.high += 1.0;
        }
        scale
    }

    fn x(&self, value: f64) -> f64 {
        1.0 + (value - self.low) / (self.high - self.low) * (Self::WIDTH - 2.0)
    }

    /// Draws a bar from 0 to the mean, with a whisker of one standard error.
    fn draw(&self, row: &ResultRow) -> String {
        let Some((low, high)) = ends(row) else {
            return String::new();
        };
        let (zero, mean) = (self.x(0.0), self.x(row.return_mean));
        let whisker = if low < high {
            let (low, high) = (self.x(low), self.x(high));
            format!("<path class=\"whisker\" d=\"M{low:.1} 5V11M{low:.1} 8H{high:.1}M{high:.1} 5V11\"/>")
        } else {
            String::new()
        };
        format!(
            "<svg class=\"bar\" viewBox=\"0 0 {w} 16\" width=\"{w}\" height=\"16\" aria-hidden=\"true\">\
             <rect class=\"fill\" x=\"{:.1}\" y=\"3\" width=\"{:.1}\" height=\"10\"/>{whisker}\
             <line class=\"zero\" x1=\"{zero:.1}\" y1=\"0\" x2=\"{zero:.1}\" y2=\"16\"/></svg>",
            zero.min(mean),
            (zero - mean).abs(),
            w = Self::WIDTH,
        )
    }
}

/// Returns the mean minus and plus one standard error; `None` if the mean cannot be drawn.
fn ends(row: &ResultRow) -> Option<(f64, f64)> {
    let se = if row.return_se.is_finite() { row.return_se.abs() } else { 0.0 };
    let ends = (row.return_mean - se, row.return_mean + se);
    (ends.0.abs() <= 1e300 && ends.1.abs() <= 1e300).then_some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample_rows;

    #[test]
    fn results_have_bars_and_one_best_per_split() {
        let mut references = vec![sample_rows().remove(0)];
        references[0].method = "SCORE-PPO (paper) <b>".into();
        let html = Table::from(ResultTable { caption: "a & b".into(), rows: sample_rows(), references }).to_html();
        assert_eq!(html.matches("class=\"best").count(), 2);
        assert_eq!(html.matches("<svg").count(), 6);
        assert!(html.contains("<caption>a &amp; b</caption>"));
        assert!(html.contains("SCORE-PPO (paper) &lt;b&gt;"));
        assert!(html.contains("rows in italics are references"));
        assert!(html.contains("Success") && !html.contains(NO_SUCCESS));
    }

    #[test]
    fn a_game_without_wins_has_no_column_of_them() {
        let mut rows = sample_rows();
        rows.iter_mut().for_each(|row| row.success = 0.0);
        let html = Table::from(ResultTable { rows, ..Default::default() }).to_html();
        assert!(!html.contains("Success") && !html.contains("0.0 %") && html.contains(NO_SUCCESS), "{html}");
    }

    #[test]
    fn unknown_and_extreme_values_draw_no_nonsense() {
        let mut rows = sample_rows();
        rows[0].return_mean = f64::NAN;
        rows[1].return_mean = f64::INFINITY;
        rows[2].return_se = f64::NAN;
        let html = Table::from(ResultTable { rows, ..Default::default() }).to_html();
        assert!(!html.contains("NaN") && !html.contains("\"inf"), "{html}");
        assert_eq!(html.matches("<svg").count(), 3);
        assert!(Table::from(ResultTable::default()).to_html().contains("no results"));
    }

    #[test]
    fn plain_tables_escape_and_align() {
        let table = PlainTable {
            caption: String::new(),
            columns: vec!["Level".into(), "<Place>".into()],
            rows: vec![vec!["12".into(), "pit".into()], vec!["7".into()]],
        };
        let html = Table::from(table).to_html();
        assert!(html.contains("<th class=\"number\">Level</th><th>&lt;Place&gt;</th>"), "{html}");
        assert!(html.contains("<tr><td class=\"number\">7</td><td></td></tr>"), "{html}");
        assert!(Table::from(PlainTable::default()).to_html().contains("nothing"));
    }

    #[test]
    fn words_are_left_and_numbers_right() {
        let table = PlainTable {
            caption: "Runs".into(),
            columns: vec!["run".into(), "steps".into(), "state".into()],
            rows: vec![
                vec!["a\u{1b}[2J".into(), "1,024".into(), "finished".into()],
                vec!["long/name".into(), "–".into()],
            ],
        };
        let expected = [
            "Runs",
            "run        steps  state",
            "---------  -----  --------",
            "a\u{fffd}[2J      1,024  finished",
            "long/name      –",
            "",
        ];
        assert_eq!(table.to_text(), expected.join("\n"));
    }

    #[test]
    fn a_table_fits_a_narrow_console_and_keeps_its_numbers() {
        let table = PlainTable {
            caption: String::new(),
            columns: vec!["level".into(), "steps".into(), "state".into()],
            rows: vec![
                vec!["broken/levels/walled-goal-00.json".into(), "123,456".into(), "finished".into()],
                vec!["7".into(), "1".into(), "stopped".into()],
            ],
        };
        let text = table.to_text_within(40);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.iter().all(|line| line.chars().count() <= 40), "{text}");
        assert_eq!(lines[2], "broken…d-goal-00.json  123,456  finished");
        assert_eq!(table.to_text_within(usize::MAX), table.to_text());
        let least = table.to_text_within(1);
        assert!(least.contains("bro…-00.json  123,456  finished"), "{least}");
    }
}
