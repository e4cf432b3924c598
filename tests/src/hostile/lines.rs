//! Changes of files whose lines have a meaning each.

use super::{
    bytes::change_bytes,
    dice::Dice,
    seals::{JSON_SEAL, JSON_SEAL_LENGTH, unsealed_object},
    texts::mutate_text,
};

/// Returns a file with one of its lines changed, gone, there twice or elsewhere.
pub(super) fn mutate_lines(text: &str, dice: &mut Dice) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = text.split('\n').map(|line| line.as_bytes().to_vec()).collect();
    let (at, other) = (dice.roll(lines.len()), dice.roll(lines.len()));
    match dice.roll(9) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[other].clone()),
        2 => lines.swap(at, other),
        3 => lines.insert(at, Vec::new()),
        4 => lines[at] = change_bytes(&lines[at], dice),
        _ => lines[at] = mutate_object(&String::from_utf8_lossy(&lines[at]), dice).into_bytes(),
    }
    lines.join(&b'\n')
}

/// Returns a JSON object that is changed behind its checksum, if it has one.
pub(super) fn mutate_object(text: &str, dice: &mut Dice) -> String {
    let (object, had_seal) = unsealed_object(text);
    let changed = mutate_text(&object, dice);
    match changed.strip_prefix('{') {
        Some(entries) if had_seal && text.starts_with(JSON_SEAL) => format!("{}{entries}", &text[..JSON_SEAL_LENGTH]),
        _ => changed,
    }
}

#[cfg(test)]
mod tests {
    use playbot_learner::seal_json;

    use super::*;
    use crate::hostile::seals::reseal_lines;

    #[test]
    fn lines_are_changed_behind_their_checksums() {
        let text = ["{\"step\":8}", "{\"step\":16}"].map(seal_json).join("\n") + "\n";
        let changed: Vec<String> = (0..2000)
            .map(|seed| String::from_utf8_lossy(&mutate_lines(&text, &mut Dice::new(seed))).into_owned())
            .collect();
        let is_sealed = |text: &&String| text.lines().all(|line| line.starts_with(JSON_SEAL));
        assert!(changed.iter().filter(is_sealed).count() > 600);
        assert!(changed.iter().all(|changed| reseal_lines(&reseal_lines(changed)) == reseal_lines(changed)));
        assert!(changed.iter().any(|text| text.contains("18446744073709551615")));
    }
}
