//! Changes of texts of JSON and RON.

use super::{
    dice::Dice,
    pieces::{entry, is_number, is_value, pieces},
};

/// Extreme numbers.
const EXTREMES: [&str; 20] = [
    "0",
    "1",
    "-1",
    "-0.0",
    "0.5",
    "255",
    "256",
    "65536",
    "16777217",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "NaN",
];

/// Values of another kind.
const VALUES: [&str; 14] =
    ["null", "None", "true", "[]", "{}", "()", "\"\"", "[[]]", "[null]", "Some(1)", "(a: 1)", "{\"a\":1}", "'x'", "-"];

/// Texts with a hidden meaning.
const STRINGS: [&str; 9] = [
    "\"\\u001b[2J\"",
    "\"\\u0000\"",
    "\"\u{202e}gnp\"",
    "\"../../../etc/passwd\"",
    "\"files:/dev/zero\"",
    "\"plain:0..16777215\"",
    "\"plain:9..1\"",
    "\"18446744073709551615/18446744073709551615\"",
    "\"<script>alert(1)</script>\"",
];

/// Entries of a list that is long all of a sudden.
const MANY: usize = 300;
/// Brackets within one another.
const DEEP: usize = 3000;
/// Letters of a long word.
const LONG: usize = 20_000;

/// Changes one thing about a text: a number, a word, an entry that is removed, doubled or moved.
pub fn mutate_text(text: &str, dice: &mut Dice) -> String {
    let mut pieces = pieces(text);
    let values: Vec<usize> = (0..pieces.len()).filter(|&at| is_value(&pieces[at])).collect();
    let numbers: Vec<usize> = values.iter().copied().filter(|&at| is_number(&pieces[at])).collect();
    let strings: Vec<usize> = values.iter().copied().filter(|&at| pieces[at].starts_with('"')).collect();
    if values.is_empty() {
        return (*dice.pick(&VALUES)).to_owned();
    }
    let (at, other) = (*dice.pick(&values), *dice.pick(&values));
    match dice.roll(12) {
        0..=3 if !numbers.is_empty() => (*dice.pick(&EXTREMES)).clone_into(&mut pieces[*dice.pick(&numbers)]),
        4 if !strings.is_empty() => pieces[*dice.pick(&strings)] = string(text, &strings, dice),
        5 if !strings.is_empty() => {
            let at = *dice.pick(&strings);
            pieces[at] = with_another_letter(&pieces[at], dice);
        }
        6 => remove(&mut pieces, at),
        7 => repeat(&mut pieces, at, 1),
        8 => swap(&mut pieces, at, other),
        9 => repeat(&mut pieces, at, MANY),
        10 => pieces.truncate(at),
        _ => {
            let range = entry(&pieces, at);
            pieces.splice(range, [value(dice)]);
        }
    }
    pieces.concat()
}

/// Returns another string, maybe one that stands elsewhere.
fn string(text: &str, strings: &[usize], dice: &mut Dice) -> String {
    match dice.roll(3) {
        0 => format!("\"{}\"", "x".repeat(LONG)),
        1 => pieces(text)[*dice.pick(strings)].clone(),
        _ => (*dice.pick(&STRINGS)).to_owned(),
    }
}

fn value(dice: &mut Dice) -> String {
    match dice.roll(VALUES.len() + 1) {
        0 => format!("{}{}", "[".repeat(DEEP), "]".repeat(DEEP)),
        at => VALUES[at - 1].to_owned(),
    }
}

/// Returns a string with one of its letters replaced by another that may stand there.
fn with_another_letter(string: &str, dice: &mut Dice) -> String {
    const LETTERS: [char; 12] = ['0', '9', 'a', 'Z', ' ', '.', '/', ':', '-', '\u{e9}', '\u{7f}', '\u{1f600}'];
    let mut letters: Vec<char> = string.chars().collect();
    let at = 1 + dice.roll(letters.len().saturating_sub(2));
    if at + 1 < letters.len() {
        letters[at] = *dice.pick(&LETTERS);
    }
    letters.into_iter().collect()
}

/// Takes an entry out, with the comma behind it.
fn remove(pieces: &mut Vec<String>, at: usize) {
    let mut range = entry(pieces, at);
    if pieces.get(range.end).is_some_and(|next| next == ",") {
        range.end += 1;
    }
    pieces.drain(range);
}

/// Puts copies of an entry before it.
fn repeat(pieces: &mut Vec<String>, at: usize, times: usize) {
    let copy = pieces[entry(pieces, at)].concat() + ",";
    pieces.insert(at, copy.repeat(times.min(1 + (1 << 20) / copy.len())));
}

fn swap(pieces: &mut Vec<String>, one: usize, other: usize) {
    let (first, second) = (entry(pieces, one.min(other)), entry(pieces, one.max(other)));
    // One within the other has no position to go to.
    if first.end > second.start {
        return;
    }
    let (earlier, later) = (pieces[first.clone()].to_vec(), pieces[second.clone()].to_vec());
    pieces.splice(second, earlier);
    pieces.splice(first, later);
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    const TEXT: &str = r#"{"a":[1,2],"b":{"c":"d"},"e":2.5}"#;

    #[test]
    fn entries_go_come_twice_and_change_places() {
        let changed = |change: &dyn Fn(&mut Vec<String>)| {
            let mut pieces = pieces(TEXT);
            change(&mut pieces);
            pieces.concat()
        };
        let place = |piece: &str| pieces(TEXT).iter().position(|known| known == piece).expect("there");
        assert_eq!(changed(&|all| remove(all, place("\"a\""))), r#"{"b":{"c":"d"},"e":2.5}"#);
        assert_eq!(changed(&|all| repeat(all, place("1"), 2)), r#"{"a":[1,1,1,2],"b":{"c":"d"},"e":2.5}"#);
        assert_eq!(changed(&|all| swap(all, place("\"e\""), place("\"a\""))), r#"{"e":2.5,"b":{"c":"d"},"a":[1,2]}"#);
    }

    #[test]
    fn the_same_seed_gives_the_same_text_and_others_give_others() {
        let texts = |from: u64| -> BTreeSet<String> {
            (from..from + 200).map(|seed| mutate_text(TEXT, &mut Dice::new(seed))).collect()
        };
        assert_eq!(texts(0), texts(0));
        assert!(texts(0).len() > 100, "{}", texts(0).len());
        for number in ["18446744073709551615", "NaN", "1e308"] {
            assert!(texts(0).iter().any(|text| text.contains(number)), "{number}");
        }
    }
}
