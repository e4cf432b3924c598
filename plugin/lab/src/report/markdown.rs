//! Tables in Markdown.

use crate::escape::steers;

/// Escapes text, which then neither ends a cell of a table nor begins anything in Markdown.
pub(crate) fn markdown_cell(text: &str) -> String {
    let mut out = String::new();
    for letter in text.chars() {
        match letter {
            '|' | '*' | '_' | '<' | '[' | '`' | '\\' | '#' => out.extend(['\\', letter]),
            letter if steers(letter) => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

/// Returns the cells of a row, joined.
pub(crate) fn markdown_row(cells: &[String]) -> String {
    let cells: Vec<String> = cells.iter().map(|text| markdown_cell(text)).collect();
    format!("| {} |", cells.join(" | "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_ends_its_cell_or_begins_anything() {
        let cells = ["a|b", "*c*\n<d>", "e\u{202e}f"].map(str::to_owned);
        assert_eq!(markdown_row(&cells), r"| a\|b | \*c\* \<d> | e f |");
    }
}
