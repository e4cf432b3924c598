//! The reference page of all settings.

use crate::experiment::{Experiment, file::Keys};
use playbot_learner::settings::{Reader, Setting, Settings};
use std::fmt::Write as _;

/// Returns the reference page of all settings as Markdown: key, type, default, range, readers and documentation of
/// each.
pub fn settings_page() -> String {
    let mut page = String::from(
        "# Settings\n\nAll settings of an experiment. An experiment file is a RON struct, `(key: value, ...)`, in which a \
         section is a struct of its own: `ppo: (lr: 0.0003)`. `--set ppo.lr=0.0003` changes one setting. `playbot config \
         show` prints an experiment with all its values; settings that are off by default are left out.\n\n\
         \"Read by\" names the algorithms that a setting changes. A setting without a default must be given.\n",
    );
    let outside = Experiment::SETTINGS.iter().filter(|setting| setting.section.is_none());
    section(&mut page, "The experiment", "Settings outside all sections.", outside);
    for setting in Experiment::SETTINGS {
        if let Some(inner) = setting.section {
            section(&mut page, &format!("`{}`", setting.path), &summary(setting.doc), inner.iter());
        }
    }
    page
}

fn section<'a>(page: &mut String, title: &str, about: &str, settings: impl Iterator<Item = &'a Setting> + Clone) {
    let common = most_common(settings.clone().map(|setting| setting.readers));
    let _ = write!(
        page,
        "\n## {title}\n\n{about} Read by {}, if the table names no others.\n\n| key | type | default | range | read by | |\n\
         | --- | --- | --- | --- | --- | --- |\n",
        reader_names(common)
    );
    for setting in settings {
        let default = setting.default.map(|default| format!("`{}`", default())).unwrap_or_default();
        let cells = [
            format!("`{}`", setting.path),
            type_in_words(setting),
            default,
            setting.range.to_string(),
            if setting.readers == common { String::new() } else { reader_names(setting.readers) },
            summary(setting.doc),
        ];
        let _ = writeln!(page, "| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
    }
}

/// The readers that most settings of a section have; of several, those of the first.
fn most_common(all: impl Iterator<Item = &'static [Reader]> + Clone) -> &'static [Reader] {
    let count = |readers: &&[Reader]| all.clone().filter(|other| other == readers).count();
    let most = all.clone().map(|readers| count(&readers)).max();
    all.clone().find(|readers| Some(count(readers)) == most).unwrap_or_default()
}

/// The type of a setting in words.
fn type_in_words(setting: &Setting) -> String {
    let name = setting.type_name;
    if let Some(inner) = name.strip_prefix("Option<").and_then(|name| name.strip_suffix('>')) {
        return format!("{} or `None`", plain_kind(inner));
    }
    match Keys::valid_names(setting.path) {
        Some(names) => names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
        None => plain_kind(name).to_owned(),
    }
}

fn plain_kind(type_name: &str) -> &'static str {
    match type_name {
        "bool" => "true or false",
        "f64" => "number",
        "(f64, f64)" => "two numbers",
        "u32" | "u64" | "usize" => "whole number",
        "Randomise" => "ranges of factors by path",
        "Vec<u64>" | "Vec<usize>" => "list of whole numbers",
        name if name.starts_with("Vec<") => "list",
        _ => "text",
    }
}

fn reader_names(readers: &[Reader]) -> String {
    if readers.is_empty() {
        return "all algorithms".to_owned();
    }
    let words = readers.iter().map(|Reader { algorithm, switch }| match switch {
        Some(switch) => format!("{algorithm} with `{switch}`"),
        None => (*algorithm).to_owned(),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// The first paragraph of a documentation, on one line and without the targets of its links.
fn summary(doc: &str) -> String {
    let lines = doc.lines().map(str::trim).skip_while(|line| line.is_empty()).take_while(|line| !line.is_empty());
    let text = lines.collect::<Vec<_>>().join(" ");
    let mut parts = text.split("[`");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once("`](").and_then(|(name, rest)| Some((name, rest.split_once(')')?.1))) {
            Some((name, rest)) => plain += &format!("`{name}`{rest}"),
            None => plain += &format!("[`{part}"),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_say_type_default_range_and_readers() {
        let page = settings_page();
        for row in [
            "| `ppo.lr` | number | `0.0005` | above 0, at most 1e30 |  | Learning rate of Adam. |",
            "Read by score-ppo, ppo, spirl-ppo, spirl-sac with `spirl.learn_decoder`, if the table names no others.",
            "| `sac.critics` | whole number | `2` | at least 1 | score-sac, sac, spirl-sac |",
            "| `seeds` | list of whole numbers | `[]` |  |  |",
            "| `score.alpha` | `Auto`, `Off`,",
            "| `skills.patience` | whole number or `None` | `None` | at least 1 |",
            "| `game` | text |  |  |  | Name of the game. |",
        ] {
            assert!(page.contains(row), "{row}\n{page}");
        }
        assert_eq!(summary(" One [`A`](super::A) and\n two `b`.\n\n Three."), "One `A` and two `b`.");
    }
}
