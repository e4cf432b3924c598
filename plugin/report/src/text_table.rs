//! Results as text for the console.

use crate::{
    escape::one_line,
    number::{UNKNOWN, decimals_for, fixed, mean_and_error, percent},
    results::{Rank, ResultRow, ResultTable, rank_key, ranks},
};

const HEADINGS: [&str; 7] = ["method", "split", "episodes", "return", "success", "length", "steps/s"];

/// The column of successes.
const SUCCESS: usize = 4;

/// Number of leading columns that hold words; the others hold numbers.
const WORDS: usize = 2;

/// Formats the rows as an aligned table for the console. The best row of each split is marked with `*`, rows that are
/// not clearly worse with `~`. A column that is unknown in all rows is left out. So is the column of successes if it
/// is 0 in all rows: the game most likely reports no success.
///
/// Ends with a line feed; an empty list gives a message.
pub fn to_text_table(rows: &[ResultRow]) -> String {
    render(rows, &[])
}

impl ResultTable {
    /// Formats the table for the console, see [`to_text_table`]: caption, results, then the references.
    pub fn to_text(&self) -> String {
        let table = render(&self.rows, &self.references);
        if self.caption.is_empty() { table } else { format!("{}\n{table}", one_line(&self.caption)) }
    }
}

fn render(rows: &[ResultRow], references: &[ResultRow]) -> String {
    if rows.is_empty() && references.is_empty() {
        return "no results\n".to_owned();
    }
    let ranks = ranks(rows);
    let all = || rows.iter().chain(references);
    let decimals = decimals_for(all().map(|r| r.return_se));
    let cells: Vec<[String; 7]> = all().map(|row| cells(row, decimals)).collect();
    let hides_success = has_no_success(all());
    let shown: Vec<usize> = (0..HEADINGS.len())
        .filter(|&c| c < WORDS || cells.iter().any(|row| row[c] != UNKNOWN))
        .filter(|&c| c != SUCCESS || !hides_success)
        .collect();
    let width = |c: usize| cells.iter().map(|row| row[c].chars().count()).fold(HEADINGS[c].len(), usize::max);
    let line = |sign: char, cell: &dyn Fn(usize) -> String| {
        let mut line = format!("{sign} ");
        for &c in &shown {
            let (text, width) = (cell(c), width(c));
            line += &if c < WORDS { format!("{text:<width$}  ") } else { format!("{text:>width$}  ") };
        }
        line.trim_end().to_owned() + "\n"
    };
    let mut out = line(' ', &|c| HEADINGS[c].to_owned());
    out += &line(' ', &|c| "-".repeat(width(c)));
    for (i, row) in cells.iter().enumerate() {
        let sign = match ranks.get(i) {
            Some(Rank::Best) => '*',
            Some(Rank::CloseToBest) => '~',
            Some(Rank::Other) => ' ',
            None => '>',
        };
        out += &line(sign, &|c| row[c].clone());
    }
    let mut key = rank_key(&ranks, "*", "~").into_iter().collect::<Vec<_>>();
    if !references.is_empty() {
        key.push("> reference, not measured here".to_owned());
    }
    if hides_success {
        key.push(NO_SUCCESS.to_owned());
    }
    if !key.is_empty() {
        out += &format!("{}\n", key.join("; "));
    }
    out
}

/// Text in place of a column without successes.
pub(crate) const NO_SUCCESS: &str = "no episode was reported as a success";

/// Returns whether successes are known and all 0.
pub(crate) fn has_no_success<'a>(rows: impl Iterator<Item = &'a ResultRow>) -> bool {
    let known: Vec<f64> = rows.map(|row| row.success).filter(|success| !success.is_nan()).collect();
    !known.is_empty() && known.iter().all(|success| *success == 0.0)
}

fn cells(row: &ResultRow, decimals: usize) -> [String; 7] {
    [
        one_line(&row.method),
        one_line(&row.split),
        if row.episodes == 0 { UNKNOWN.to_owned() } else { fixed(row.episodes as f64, 0) },
        mean_and_error(row.return_mean, row.return_se, decimals),
        percent(row.success),
        fixed(row.length_mean, 1),
        row.steps_per_s.map_or(UNKNOWN.to_owned(), |s| fixed(s, 0)),
    ]
}

// Estimated width of text in a drawing.

/// Returns the width of `text` in pixels at a font size in pixels; rather too wide than too narrow.
pub fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(|c| char_width(c) * size).sum()
}

fn char_width(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' => 0.32,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.92,
        'A'..='Z' => 0.70,
        // Beyond Latin, Greek and Cyrillic, characters may be as wide as they are high.
        '\u{1100}'.. if !('\u{2000}'..'\u{2300}').contains(&c) => 1.05,
        _ => 0.60,
    }
}

/// Breaks text into lines of at most `width` pixels at its spaces; a longer word gets its own line.
pub fn wrap(text: &str, width: f64, size: f64) -> Vec<String> {
    wrap_while(text, |line, word| text_width(line, size) + text_width(word, size) + 0.6 * size <= width)
}

/// Breaks text into lines at its spaces. `fits` receives a line and the next word.
pub(crate) fn wrap_while(text: &str, fits: impl Fn(&str, &str) -> bool) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if fits(line, word) => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Positions labels of height `height` near `wanted`, moved apart within `top..=bottom`. The order of the labels
/// along the axis is kept.
pub(crate) fn spread(wanted: &[f64], height: f64, top: f64, bottom: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|&a, &b| wanted[a].total_cmp(&wanted[b]));
    let mut placed = vec![0.0; wanted.len()];
    let mut least = top;
    for &i in &order {
        placed[i] = wanted[i].max(least);
        least = placed[i] + height;
    }
    let mut most = bottom;
    for &i in order.iter().rev() {
        placed[i] = placed[i].min(most);
        most = placed[i] - height;
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample_rows;

    #[test]
    fn columns_are_aligned_and_the_best_is_marked() {
        let expected = [
            "  method     split     episodes        return  success  length  steps/s",
            "  ---------  --------  --------  ------------  -------  ------  -------",
            "* SCORE-PPO  train          500   9.61 ± 0.08   96.1 %    83.2   12,346",
            "~ PPO        train          500   9.52 ± 0.09   95.2 %    83.2   15,001",
            "* SCORE-PPO  held-out       500   9.14 ± 0.11   91.4 %    83.2        –",
            "  PPO        held-out       500   7.40 ± 0.19   74.0 %    83.2        –",
            "  random     held-out       500  −0.31 ± 0.14    2.0 %    83.2        –",
            "* highest mean return of its split; ~ within two standard errors of the difference to it",
            "",
        ]
        .join("\n");
        assert_eq!(to_text_table(&sample_rows()), expected);
    }

    #[test]
    fn a_game_without_wins_has_no_column_of_them() {
        let mut rows = sample_rows();
        rows.iter_mut().for_each(|row| row.success = 0.0);
        let text = to_text_table(&rows);
        let head = text.lines().next().unwrap_or_default();
        assert!(!head.contains("success") && !text.contains("0.0 %"), "{text}");
        assert!(text.ends_with("; no episode was reported as a success\n"), "{text}");
        rows[0].success = 0.5;
        assert!(to_text_table(&rows).contains("success"));
    }

    #[test]
    fn unknown_columns_are_left_out_and_references_set_apart() {
        let mut rows = sample_rows();
        rows.truncate(2);
        for row in &mut rows {
            row.steps_per_s = None;
            row.success = f64::NAN;
        }
        let table = ResultTable { caption: "CoinRun".into(), references: vec![rows.remove(1)], rows };
        let text = table.to_text();
        assert!(text.starts_with("CoinRun\n  method"), "{text}");
        assert!(!text.contains("steps/s") && !text.contains("success"), "{text}");
        assert!(text.contains("\n> PPO") && text.ends_with("> reference, not measured here\n"), "{text}");
        assert_eq!(to_text_table(&[]), "no results\n");
    }

    #[test]
    fn lines_break_at_spaces() {
        assert_eq!(wrap("aa bb cc", 5.5 * 0.6 * 10.0, 10.0), ["aa bb", "cc"]);
        assert_eq!(wrap("", 100.0, 10.0), [] as [&str; 0]);
        assert_eq!(wrap("unbreakable", 1.0, 10.0), ["unbreakable"]);
    }

    #[test]
    fn labels_do_not_overlap() {
        assert_eq!(spread(&[50.0, 51.0, 10.0], 16.0, 0.0, 100.0), [50.0, 66.0, 10.0]);
        assert_eq!(spread(&[99.0, 100.0], 16.0, 0.0, 100.0), [84.0, 100.0]);
    }
}
