//! Parser of drawings that are written as text; `sprites.txt` explains the form.

use std::collections::BTreeMap;

use super::canvas::{Canvas, Texel, rgb};

/// A drawing: its letters and the colours that are its own.
#[derive(Clone, Default)]
struct Drawing {
    rows: Vec<Vec<char>>,
    colours: BTreeMap<char, Texel>,
}

/// Drawings by name.
pub type Drawings = BTreeMap<String, Canvas>;

#[derive(Default)]
struct Reader {
    palette: BTreeMap<char, Texel>,
    drawings: BTreeMap<String, Drawing>,
    current: Option<(String, usize)>,
}

/// Reads all drawings of a file.
///
/// # Errors
///
/// The number of the line and what is wrong with it.
pub fn read(text: &str) -> Result<Drawings, String> {
    let mut reader = Reader::default();
    for (number, line) in text.lines().enumerate() {
        reader.line(line.trim_end()).map_err(|why| format!("line {}: {why}", number + 1))?;
    }
    let paint = |(name, drawing): (&String, &Drawing)| Ok((name.clone(), reader.paint(name, drawing)?));
    reader.drawings.iter().map(paint).collect()
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        match words.next() {
            None => self.current = None,
            Some(word) if word.starts_with('#') => {}
            Some("colour") => {
                let (letter, colour) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
                let (letter, texel) = colour_of(letter, colour)?;
                self.palette.insert(letter, texel);
            }
            Some("draw") => self.begin(words, Drawing::default())?,
            Some("copy") => {
                let name = words.next().ok_or("a copy needs a name")?;
                let old = words.next().ok_or("a copy needs a drawing to copy")?;
                let drawing = self.drawings.get(old).ok_or(format!("`{old}` is not drawn yet"))?.clone();
                self.begin([name].into_iter().chain(words), drawing)?;
            }
            Some(row) => self.row(row)?,
        }
        Ok(())
    }

    fn begin<'a>(&mut self, mut words: impl Iterator<Item = &'a str>, mut drawing: Drawing) -> Result<(), String> {
        let name = words.next().ok_or("a drawing needs a name")?.to_owned();
        let mut at = drawing.rows.len();
        for word in words {
            match word.split_once('=') {
                Some(("at", row)) => at = row.parse().map_err(|_| format!("`{row}` is no row"))?,
                Some((letter, colour)) => drawing.colours.extend([colour_of(letter, colour)?]),
                None => return Err(format!("`{word}` is neither at=ROW nor LETTER=RRGGBB")),
            }
        }
        self.drawings.insert(name.clone(), drawing);
        self.current = Some((name, at));
        Ok(())
    }

    fn row(&mut self, row: &str) -> Result<(), String> {
        let (name, at) = self.current.as_mut().ok_or(format!("`{row}` belongs to no drawing"))?;
        let drawing = self.drawings.get_mut(name).expect("inserted when the drawing began");
        let row: Vec<char> = row.chars().collect();
        if drawing.rows.first().is_some_and(|first| first.len() != row.len()) {
            return Err(format!("this row of `{name}` has {} texels, the first has another number", row.len()));
        }
        if *at > drawing.rows.len() {
            return Err(format!("`{name}` has no row {at}"));
        }
        if *at == drawing.rows.len() {
            drawing.rows.push(row);
        } else {
            drawing.rows[*at] = row;
        }
        *at += 1;
        Ok(())
    }

    fn paint(&self, name: &str, drawing: &Drawing) -> Result<Canvas, String> {
        let width = drawing.rows.first().ok_or(format!("`{name}` has no rows"))?.len();
        let mut canvas = Canvas::new(width, drawing.rows.len());
        for (texel, letter) in canvas.texels.iter_mut().zip(drawing.rows.iter().flatten()) {
            let colour = drawing.colours.get(letter).or_else(|| self.palette.get(letter));
            *texel = match (letter, colour) {
                ('.', _) => [0; 4],
                (_, Some(colour)) => *colour,
                (letter, None) => return Err(format!("`{name}`: the letter `{letter}` has no colour")),
            };
        }
        Ok(canvas)
    }
}

fn colour_of(letter: &str, colour: &str) -> Result<(char, Texel), String> {
    let mut letters = letter.chars();
    let (Some(letter), None) = (letters.next(), letters.next()) else {
        return Err(format!("`{letter}` is not one letter"));
    };
    match (colour.len(), u32::from_str_radix(colour, 16)) {
        (6, Ok(value)) => Ok((letter, rgb(value))),
        _ => Err(format!("`{colour}` is not a colour; write RRGGBB")),
    }
}
