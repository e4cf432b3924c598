//! Pictures in a terminal: the graphics protocols of Kitty and iTerm2, and Sixel.

use crate::error::CliError;
use playbot_report::base64;
use png::{BitDepth, ColorType, Decoder};
use std::{collections::BTreeSet, fmt::Write, io::Cursor};

/// The way in which a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PictureForm {
    /// Pictures if the terminal says that it shows them, or else text.
    Auto,
    /// Graphics protocol of Kitty.
    Kitty,
    /// Inline pictures of iTerm2.
    Iterm,
    /// Sixel.
    Sixel,
    /// Plan in characters, with the path on it.
    Text,
    /// Nothing.
    None,
}

/// Older versions of Konsole do not know the protocol of Kitty.
const KONSOLE: u32 = 220_400;

impl PictureForm {
    /// Returns the form for a terminal, by its variables.
    pub fn of_terminal(is_terminal: bool, variable: &dyn Fn(&str) -> Option<String>) -> Self {
        let value = |name: &str| variable(name).unwrap_or_default();
        let (term, program) = (value("TERM"), value("TERM_PROGRAM"));
        let begins = |names: &[&str]| names.iter().any(|name| term.starts_with(name));
        let is_one_of = |names: &[&str]| names.contains(&program.as_str());
        let is_konsole = value("KONSOLE_VERSION").parse().is_ok_and(|version: u32| version >= KONSOLE);
        // Multiplexers keep pictures to themselves, and have the variables of the terminal around them.
        if !is_terminal || !value("TMUX").is_empty() || begins(&["screen", "tmux"]) {
            return Self::Text;
        }
        if !value("KITTY_WINDOW_ID").is_empty()
            || term.contains("kitty")
            || term.contains("ghostty")
            || is_one_of(&["ghostty"])
            || is_konsole
        {
            return Self::Kitty;
        }
        if is_one_of(&["iTerm.app", "WezTerm", "mintty"]) || value("LC_TERMINAL") == "iTerm2" {
            return Self::Iterm;
        }
        if begins(&["foot", "mlterm", "yaft", "contour"]) || term.contains("sixel") || is_one_of(&["mlterm"]) {
            return Self::Sixel;
        }
        Self::Text
    }

    /// Returns the bytes that show a PNG in a terminal, with the line break behind it; `None` if this form shows no PNG.
    ///
    /// # Errors
    ///
    /// The PNG cannot be read.
    pub fn show(self, png: &[u8]) -> Result<Option<String>, CliError> {
        Ok(match self {
            Self::Kitty => Some(kitty(png)),
            Self::Iterm => Some(iterm(png)),
            Self::Sixel => Some(sixel(png)?),
            Self::Auto | Self::Text | Self::None => None,
        })
    }
}

/// Longest part of a picture in Kitty's protocol, in letters.
const MOST_LETTERS: usize = 4096;

/// See <https://sw.kovidgoyal.net/kitty/graphics-protocol>.
fn kitty(png: &[u8]) -> String {
    let text = base64(png);
    let mut shown = String::new();
    let parts: Vec<&str> =
        text.as_bytes().chunks(MOST_LETTERS).filter_map(|part| std::str::from_utf8(part).ok()).collect();
    for (number, part) in parts.iter().enumerate() {
        // An answer of the terminal would be read as the answer of the user, so it is asked for none.
        let keys = if number == 0 { "a=T,f=100,q=2," } else { "" };
        let more = u8::from(number + 1 < parts.len());
        let _ = write!(shown, "\u{1b}_G{keys}m={more};{part}\u{1b}\\");
    }
    shown + "\n"
}

/// See <https://iterm2.com/documentation-images.html>.
fn iterm(png: &[u8]) -> String {
    format!("\u{1b}]1337;File=inline=1;size={};preserveAspectRatio=1:{}\u{7}\n", png.len(), base64(png))
}

/// Steps of each of the three colours.
const STEPS: usize = 6;

/// Rows of a band.
const BAND: usize = 6;

/// See <https://vt100.net/docs/vt3xx-gp/chapter14.html>.
fn sixel(png: &[u8]) -> Result<String, CliError> {
    let (pixels, width) = colours(png)?;
    let height = pixels.len() / width.max(1);
    let used: BTreeSet<usize> = pixels.iter().copied().collect();
    let mut shown = format!("\u{1b}Pq\"1;1;{width};{height}");
    for colour in &used {
        let [red, green, blue] =
            [colour / (STEPS * STEPS), colour / STEPS % STEPS, colour % STEPS].map(|step| 20 * step);
        let _ = write!(shown, "#{colour};2;{red};{green};{blue}");
    }
    for band in pixels.chunks(width * BAND) {
        let of_band: BTreeSet<usize> = band.iter().copied().collect();
        for colour in of_band {
            let _ = write!(shown, "#{colour}");
            let sixels: Vec<u8> = (0..width)
                .map(|column| {
                    let rows = band.iter().skip(column).step_by(width).enumerate();
                    b'?' + rows.filter(|(_, pixel)| **pixel == colour).map(|(row, _)| 1 << row).sum::<u8>()
                })
                .collect();
            for run in sixels.chunk_by(|one, next| one == next) {
                let letter = char::from(run[0]);
                let _ = match run.len() {
                    1..=3 => write!(shown, "{}", letter.to_string().repeat(run.len())),
                    count => write!(shown, "!{count}{letter}"),
                };
            }
            shown.push('$');
        }
        shown.push('-');
    }
    Ok(shown + "\u{1b}\\\n")
}

/// Returns the pixels of a PNG as numbers of colours, and its width.
fn colours(png: &[u8]) -> Result<(Vec<usize>, usize), CliError> {
    let failed = |error: png::DecodingError| CliError::Io(format!("the picture cannot be read: {error}"));
    let mut reader = Decoder::new(Cursor::new(png)).read_info().map_err(failed)?;
    let size = reader.output_buffer_size().unwrap_or(0);
    let mut bytes = vec![0; size];
    let frame = reader.next_frame(&mut bytes).map_err(failed)?;
    if (frame.color_type, frame.bit_depth) != (ColorType::Rgb, BitDepth::Eight) {
        return Err(CliError::Io("the picture has no red, green and blue of 8 bits".to_owned()));
    }
    let step = |value: u8| (usize::from(value) * (STEPS - 1) + 127) / 255;
    let (pixels, _) = bytes.as_chunks::<3>();
    let colours = pixels.iter().map(|[red, green, blue]| (step(*red) * STEPS + step(*green)) * STEPS + step(*blue));
    Ok((colours.collect(), frame.width as usize))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::{Screen, to_png};

    fn form(variables: &[(&str, &str)]) -> PictureForm {
        let variable = |name: &str| {
            let found = variables.iter().find(|(known, _)| *known == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        assert_eq!(PictureForm::of_terminal(false, &variable), PictureForm::Text, "a file shows no picture");
        PictureForm::of_terminal(true, &variable)
    }

    #[test]
    fn a_terminal_is_known_by_its_variables() {
        for (variables, wanted) in [
            (&[("TERM", "xterm-256color")][..], PictureForm::Text),
            (&[], PictureForm::Text),
            (&[("TERM", "xterm-kitty")], PictureForm::Kitty),
            (&[("TERM", "xterm-256color"), ("KITTY_WINDOW_ID", "1")], PictureForm::Kitty),
            (&[("TERM", "tmux-256color"), ("KITTY_WINDOW_ID", "1"), ("TMUX", "/tmp/x")], PictureForm::Text),
            (&[("TERM", "screen"), ("TERM_PROGRAM", "iTerm.app")], PictureForm::Text),
            (&[("TERM", "xterm-ghostty")], PictureForm::Kitty),
            (&[("KONSOLE_VERSION", "230401")], PictureForm::Kitty),
            (&[("KONSOLE_VERSION", "211201")], PictureForm::Text),
            (&[("TERM_PROGRAM", "iTerm.app")], PictureForm::Iterm),
            (&[("TERM_PROGRAM", "WezTerm")], PictureForm::Iterm),
            (&[("LC_TERMINAL", "iTerm2")], PictureForm::Iterm),
            (&[("TERM", "foot")], PictureForm::Sixel),
            (&[("TERM_PROGRAM", "Apple_Terminal")], PictureForm::Text),
        ] {
            assert_eq!(form(variables), wanted, "{variables:?}");
        }
    }

    /// Returns a PNG of black with a red row of pixels at the top and a white one in the lower right corner.
    fn picture(width: usize, height: usize) -> Vec<u8> {
        let mut screen = Screen::new(width, height, [0; 3]).expect("small");
        screen.block(0, 0, width, 1, [255, 0, 0]);
        screen.block(width - 1, height - 1, 1, 1, [255; 3]);
        to_png(&screen).expect("a picture")
    }

    /// Decodes Base64.
    fn decoded(text: &str) -> Vec<u8> {
        const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut bytes = Vec::new();
        for four in text.as_bytes().chunks(4) {
            let value = |letter: &u8| LETTERS.iter().position(|known| known == letter).unwrap_or(0);
            let bits = four.iter().fold(0, |bits, letter| bits << 6 | value(letter));
            let count = 3 - four.iter().filter(|letter| **letter == b'=').count();
            bytes.extend((0..count).map(|at| (bits >> (16 - 8 * at)) as u8));
        }
        bytes
    }

    #[test]
    fn kitty_gets_a_png_in_parts_and_iterm_in_one() {
        let noise: Vec<u8> = (0..9_000_u32).map(|number| (number.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let shown = PictureForm::Kitty.show(&noise).expect("any bytes").expect("shown");
        let parts: Vec<&str> = shown.trim_end().split_terminator("\u{1b}\\").collect();
        assert_eq!(parts.len(), 3);
        assert!(parts[0].starts_with("\u{1b}_Ga=T,f=100,q=2,m=1;"), "{}", &parts[0][..40]);
        assert!(parts[1].starts_with("\u{1b}_Gm=1;") && parts[2].starts_with("\u{1b}_Gm=0;"));
        let text: String = parts.iter().filter_map(|part| Some(part.split_once(';')?.1)).collect();
        assert_eq!(decoded(&text), noise);
        assert!(parts.iter().all(|part| part.split_once(';').is_some_and(|(_, text)| text.len() <= MOST_LETTERS)));
        let shown = PictureForm::Iterm.show(&noise).expect("any bytes").expect("shown");
        let text = shown.strip_prefix("\u{1b}]1337;File=inline=1;size=9000;preserveAspectRatio=1:").expect("the head");
        assert_eq!(decoded(text.strip_suffix("\u{7}\n").expect("the end")), noise);
    }

    #[test]
    fn sixels_have_each_pixel_once_in_its_colour() {
        let shown = PictureForm::Sixel.show(&picture(8, 7)).expect("a PNG").expect("shown");
        let body =
            shown.strip_prefix("\u{1b}Pq\"1;1;8;7").expect("the head").strip_suffix("\u{1b}\\\n").expect("the end");
        let palette = "#0;2;0;0;0#180;2;100;0;0#215;2;100;100;100";
        // The first band: black below the red row. The second one: a row of black, but for its last pixel.
        assert_eq!(body, format!("{palette}#0!8}}$#180!8@$-#0!7@?$#215!7?@$-"));
        assert!(PictureForm::Sixel.show(b"no PNG").is_err());
        assert_eq!(PictureForm::Text.show(&[]).expect("nothing to do"), None);
    }
}
