//! Tables, in HTML and as text for the console.

use crate::{
    escape::{escape, one_line, with_code_spans},
    number::{UNKNOWN, decimals_for, fixed, mean_and_error, percent},
    results::{Rank, ResultRow, ResultTable, rank_key, ranks},
    text_table::{NO_SUCCESS, has_no_success, wrap_while},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
};

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

    /// Returns the table for a console of this width. If it is too wide, sentences in the last columns move below their
    /// rows. Then long words lose a part, but keep at least twelve letters, and different ones stay different. Numbers are
    /// never shortened.
    pub fn to_text_within(&self, most: usize) -> String {
        let numbers = number_columns(self);
        let rows: Vec<Vec<String>> = std::iter::once(&self.columns)
            .chain(&self.rows)
            .map(|row| (0..numbers.len()).map(|c| row.get(c).map_or(String::new(), |cell| one_line(cell))).collect())
            .collect();
        let width = |c: usize| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0);
        let mut widths: Vec<usize> = (0..numbers.len()).map(width).collect();
        while total(&widths) > most && widths.len() > 1 && has_sentences(&rows[1..], widths.len() - 1) {
            widths.pop();
        }
        fit(&mut widths, &numbers, most);
        let columns: Vec<Vec<String>> = widths
            .iter()
            .enumerate()
            .map(|(c, width)| shortened(&rows.iter().map(|row| row[c].as_str()).collect::<Vec<_>>(), *width))
            .collect();
        let line = |index: usize| {
            let cells = columns.iter().zip(&widths).zip(&numbers).map(|((column, &width), number)| {
                let cell = &column[index];
                if *number { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
        };
        let ruler: Vec<String> = widths.iter().map(|width| "-".repeat(*width)).collect();
        let mut out = if self.caption.is_empty() { String::new() } else { one_line(&self.caption) + "\n" };
        out += &line(0);
        out += &(ruler.join("  ") + "\n");
        for (index, row) in rows.iter().enumerate().skip(1) {
            out += &line(index);
            let below = row.iter().zip(&rows[0]).skip(widths.len()).filter(|(cell, _)| !cell.is_empty());
            below.for_each(|(cell, heading)| out += &indented(&format!("{heading}: {cell}"), most));
        }
        out
    }
}

/// Fewest letters that are left of a word in a table that is too wide.
pub const FEWEST_LETTERS: usize = 12;

/// Space between two columns.
const GAP: usize = 2;

/// Space in front of sentences below a row.
const INDENT: usize = 4;

/// Most words of a cell that is no sentence.
const FEW_WORDS: usize = 3;

/// Returns the width of a table with columns of these widths.
fn total(widths: &[usize]) -> usize {
    widths.iter().map(|width| width + GAP).sum::<usize>().saturating_sub(GAP)
}

/// Returns true if a cell of this column is a sentence.
fn has_sentences(rows: &[Vec<String>], column: usize) -> bool {
    rows.iter().any(|row| row[column].split_whitespace().nth(FEW_WORDS).is_some())
}

/// Breaks a text into indented lines of at most `most` letters. A longer word gets a line of its own, whole, so that it can
/// be copied.
fn indented(text: &str, most: usize) -> String {
    let fits = |line: &str, word: &str| INDENT + line.chars().count() + 1 + word.chars().count() <= most;
    wrap_while(text, fits).iter().map(|line| format!("{:INDENT$}{line}\n", "")).collect()
}

/// Takes letters from the widest column of words, again and again, until the table is no wider than `most`.
fn fit(widths: &mut [usize], numbers: &[bool], most: usize) {
    while total(widths) > most {
        let words = widths.iter_mut().zip(numbers).filter(|(_, number)| !**number).map(|(width, _)| width);
        match words.max() {
            Some(widest) if *widest > FEWEST_LETTERS => *widest -= 1,
            _ => return,
        }
    }
}

/// Shortens the texts of a column. Different texts stay different: those that would be the same are cut around their first
/// difference, or numbered where even that does not tell them apart.
fn shortened(texts: &[&str], width: usize) -> Vec<String> {
    let mut cut: BTreeMap<&str, String> = texts.iter().map(|text| (*text, shorten(text, width))).collect();
    // A group in which only some texts are different by then becomes smaller each time.
    for _ in 0..MOST_CUTS {
        let groups = same(&cut);
        for group in &groups {
            let first = first_difference(group);
            cut.extend(group.iter().map(|text| (*text, around(text, first, width))));
        }
        if groups.is_empty() {
            break;
        }
    }
    let mut used: BTreeSet<String> = cut.values().cloned().collect();
    for text in same(&cut).iter().flat_map(|group| group.iter().skip(1)) {
        let numbered = |number: usize| {
            let ending = format!("…{number}");
            let begin = text.chars().take(width.saturating_sub(ending.chars().count()));
            begin.chain(ending.chars()).collect::<String>()
        };
        if let Some(own) = (2..=used.len() + 2).map(numbered).find(|own| !used.contains(own)) {
            used.insert(own.clone());
            cut.insert(*text, own);
        }
    }
    texts.iter().map(|text| cut[text].clone()).collect()
}

/// Times that texts are cut around their first difference.
const MOST_CUTS: usize = 4;

/// Returns the groups of texts that are cut to the same.
fn same<'a>(cut: &BTreeMap<&'a str, String>) -> Vec<Vec<&'a str>> {
    let mut groups = BTreeMap::<&str, Vec<&'a str>>::new();
    cut.iter().for_each(|(text, short)| groups.entry(short).or_default().push(*text));
    groups.into_values().filter(|group| group.len() > 1).collect()
}

/// Returns the number of letters with which all texts begin.
fn first_difference(texts: &[&str]) -> usize {
    let [first, others @ ..] = texts else { return 0 };
    let common = |other: &&str| first.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
    others.iter().map(common).min().unwrap_or(0)
}

/// Returns a text, or one without its middle if it is longer than `width`. More is kept of its end: paths differ there.
fn shorten(text: &str, width: usize) -> String {
    let length = text.chars().count();
    if length <= width {
        return text.to_owned();
    }
    let begin = width.saturating_sub(1) / 3;
    let end = width.saturating_sub(1) - begin;
    text.chars().take(begin).chain(['…']).chain(text.chars().skip(length - end)).collect()
}

/// Returns the part of a text around a letter, or the whole text if it is no longer than `width`.
fn around(text: &str, at: usize, width: usize) -> String {
    let length = text.chars().count();
    let room = width.saturating_sub(2);
    let start = at.saturating_sub(room / 3);
    if length <= width {
        text.to_owned()
    } else if start <= 1 {
        text.chars().take(width.saturating_sub(1)).chain(['…']).collect()
    } else if start + room + 1 >= length {
        std::iter::once('…').chain(text.chars().skip(length + 1 - width)).collect()
    } else {
        std::iter::once('…').chain(text.chars().skip(start).take(room)).chain(['…']).collect()
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
    let cell = |row: &[String], c: usize| row.get(c).map(|t| with_code_spans(t)).unwrap_or_default();
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

    fn levels(names: &[&str]) -> PlainTable {
        let row = |name: &&str| vec![(*name).to_owned(), "7".to_owned()];
        PlainTable {
            caption: String::new(),
            columns: vec!["level".into(), "steps".into()],
            rows: names.iter().map(row).collect(),
        }
    }

    #[test]
    fn different_names_stay_different_in_a_narrow_table() {
        let names = |names: &[&str], most: usize| -> Vec<String> {
            let text = levels(names).to_text_within(most);
            assert!(text.lines().all(|line| line.chars().count() <= most), "{text}");
            text.lines().skip(2).map(|line| line.trim_end_matches('7').trim_end().to_owned()).collect()
        };
        let (first, second) =
            ("levels/a very long folder/east/level.json", "levels/a very long folder/west/level.json");
        let other = "levels/a very long folder/west/other.json";
        assert_eq!(names(&[first, second, other], 23), ["…der/east/level…", "…der/west/level…", "level…other.json"]);
        // Equal names stay equal.
        assert_eq!(names(&[first, first], 23), ["level…level.json"; 2]);
        // They differ beyond what can be shown of both.
        let far = ["x".repeat(40) + "a" + &"y".repeat(40) + "c", "x".repeat(40) + "b" + &"y".repeat(40) + "c"];
        let shown = names(&[far[0].as_str(), far[1].as_str()], 23);
        assert!(shown[0].contains("xa") && shown[1].contains("xb"), "{shown:?}");
        // Three differences in pairs, which no part of the text shows at once.
        let many: Vec<String> = (0..8_usize)
            .map(|bits| (0..3).map(|bit| format!("{}{}", "z".repeat(20), bits >> bit & 1)).collect::<String>() + "end")
            .collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        let shown: BTreeSet<String> = names(&many, 23).into_iter().collect();
        assert_eq!(shown.len(), 8, "{shown:?}");
    }

    #[test]
    fn sentences_at_the_end_of_a_narrow_table_move_below_their_rows() {
        let cells = |cells: [&str; 4]| cells.map(str::to_owned).to_vec();
        let table = PlainTable {
            caption: "findings in runs/old".into(),
            columns: cells(["finding", "now", "pinned", "message"]),
            rows: vec![
                cells(["stuck-default-7", "still there", "", "the agent did not move for 300 ticks at 12.5, 3.25"]),
                cells(["panic-default-9", "gone", "until 2031-01-01: known since May", "it does not happen any more"]),
            ],
        };
        let expected = [
            "findings in runs/old",
            "finding          now",
            "---------------  -----------",
            "stuck-default-7  still there",
            "    message: the agent did not move for",
            "    300 ticks at 12.5, 3.25",
            "panic-default-9  gone",
            "    pinned: until 2031-01-01: known since",
            "    May",
            "    message: it does not happen any more",
            "",
        ];
        assert_eq!(table.to_text_within(41), expected.join("\n"));
        let wide = table.to_text();
        assert!(wide.lines().nth(3).is_some_and(|row| row.ends_with("at 12.5, 3.25")), "{wide}");
        assert_eq!(table.to_text_within(200), wide);
    }
}
