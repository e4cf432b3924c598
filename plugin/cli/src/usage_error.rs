//! Plain wording of errors of the command line's parser.

use std::{
    error::Error,
    num::{IntErrorKind, ParseFloatError, ParseIntError},
};

use clap::Command;

/// Lets options take numbers below 0, so that the error is about the number, and not about an unknown option.
pub fn with_negative_numbers(command: Command) -> Command {
    command
        .mut_args(|arg| {
            let takes_number = !arg.is_positional() && arg.get_action().takes_values();
            if takes_number { arg.allow_negative_numbers(true) } else { arg }
        })
        .mut_subcommands(with_negative_numbers)
}

/// Returns the whole text of an error about a number in plain words; `None` for other errors.
pub fn in_plain_words(error: &clap::Error) -> Option<String> {
    let source = error.source()?;
    let plain = number_wanted(source)?;
    Some(error.render().to_string().replacen(&format!(": {source}"), &format!(": {plain}"), 1))
}

/// Describes the wanted number.
fn number_wanted(error: &(dyn Error + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref::<ParseIntError>() {
        let words = match error.kind() {
            IntErrorKind::PosOverflow => "the number is too large",
            _ => "it must be a whole number, 0 or more",
        };
        return Some(words.to_owned());
    }
    if error.downcast_ref::<ParseFloatError>().is_some() {
        return Some("it must be a number, such as 0.5".to_owned());
    }
    let words = error.to_string();
    let (_, bounds) = words.split_once(" is not in ")?;
    let (first, last) = bounds.split_once("..=")?;
    Some(format!("it must be a whole number from {first} to {last}"))
}

#[cfg(test)]
mod tests {
    use clap::{Arg, value_parser};

    use super::*;

    fn said(option: &str, value: &str) -> String {
        let inner = Command::new("inner")
            .arg(Arg::new("seed").long("seed").value_parser(value_parser!(u64)))
            .arg(Arg::new("noise").long("noise").value_parser(value_parser!(f64)))
            .arg(Arg::new("scale").long("scale").value_parser(value_parser!(u32).range(1..=32)));
        let command = with_negative_numbers(Command::new("outer").subcommand(inner));
        match command.try_get_matches_from(["outer", "inner", option, value]) {
            Ok(_) => "taken".to_owned(),
            Err(error) => in_plain_words(&error).unwrap_or_else(|| format!("in other words: {error}")),
        }
    }

    #[test]
    fn numbers_that_cannot_be_read_are_refused_in_plain_words() {
        for (option, value, words) in [
            ("--seed", "x", "error: invalid value 'x' for '--seed <seed>': it must be a whole number, 0 or more"),
            ("--seed", "-1", "it must be a whole number, 0 or more"),
            ("--seed", "18446744073709551616", "the number is too large"),
            ("--noise", "abc", "it must be a number, such as 0.5"),
            ("--scale", "0", "it must be a whole number from 1 to 32"),
        ] {
            let text = said(option, value);
            assert!(text.contains(words) && text.ends_with('\n'), "{text}");
        }
        assert_eq!(said("--noise", "-1"), "taken", "whoever reads it says what is wrong with it");
        assert!(said("--nose", "1").starts_with("in other words: "));
    }
}
