//! Tables of text for the console.

use super::table::{PlainTable, number_columns};
use crate::escape::one_line;

impl PlainTable {
    /// Returns the table for the console, with aligned columns; ends with a line feed.
    pub fn to_text(&self) -> String {
        let numbers = number_columns(self);
        let rows: Vec<Vec<String>> = std::iter::once(&self.columns)
            .chain(&self.rows)
            .map(|row| (0..numbers.len()).map(|c| row.get(c).map_or(String::new(), |cell| one_line(cell))).collect())
            .collect();
        let width = |c: usize| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..numbers.len()).map(width).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
