//! Warnings about damaged or missing log lines, for resumed runs.

use std::collections::BTreeSet;

use super::json_lines::JsonLines;

/// Largest number of gaps that are named; beyond it their number is given.
const NAMED: usize = 8;

/// Describes the damaged lines, which are left out, and the missing updates up to `step`. A log that is missing or
/// was cut off between two lines would look whole otherwise. `None` without gaps.
///
/// `read` has no lines after `step`, up to which `updates` updates were made. A line after it that a kill tore is
/// written again, and is not mentioned.
pub(super) fn gaps(read: &JsonLines, step: u64, updates: u64) -> Option<String> {
    let parts: Vec<String> = [damaged(read, step), missing(read, step, updates)].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

fn damaged(read: &JsonLines, step: u64) -> Option<String> {
    let is_whole_until = read.lines.last().map_or(0, |line| line.step) == step;
    let harmless = usize::from(read.is_torn && is_whole_until);
    let damaged = &read.damaged[..read.damaged.len().saturating_sub(harmless)];
    let numbers: Vec<String> = damaged.iter().map(usize::to_string).collect();
    match numbers.len() {
        0 => None,
        1 => Some(format!("line {} is damaged and left out", numbers[0])),
        _ => Some(format!("lines {} are damaged and left out", numbers.join(", "))),
    }
}

fn missing(read: &JsonLines, step: u64, updates: u64) -> Option<String> {
    let found: BTreeSet<u64> = read.lines.iter().map(|line| line.step).collect();
    // Every update has the same number of steps.
    let words = match step.checked_div(updates) {
        Some(per_update) if per_update * updates == step => {
            let is_missing = |update: &u64| !found.contains(&(update * per_update));
            of_updates((1..=updates).filter(is_missing).collect(), per_update)?
        }
        _ => {
            let missing = updates.saturating_sub(found.len() as u64);
            if missing == 0 {
                return None;
            }
            format!("{missing} of {updates} updates")
        }
    };
    Some(format!("nothing is left of {words}: curves have a gap there, and learning is not affected"))
}

/// Describes updates by their steps; `None` without updates.
fn of_updates(updates: Vec<u64>, per_update: u64) -> Option<String> {
    let stretches: Vec<(u64, u64)> = updates
        .chunk_by(|one, next| one + 1 == *next)
        .filter_map(|stretch| Some((stretch.first()? * per_update, stretch.last()? * per_update)))
        .collect();
    let name = |(first, last): &(u64, u64)| {
        if first == last { first.to_string() } else { format!("{first} to {last}") }
    };
    let named: Vec<String> = stretches.iter().take(NAMED).map(name).collect();
    let more = if stretches.len() > NAMED { " and others" } else { "" };
    match updates.len() {
        0 => None,
        1 => Some(format!("the update of step {}", named.join(""))),
        count => Some(format!("{count} updates, those of the steps {}{more}", named.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use serde_json::json;

    use super::{super::json_lines::append_json_line, *};

    const UPDATES: u64 = 4;

    /// Returns the warning about a log that should have four updates of 8 steps.
    fn said(path: &Path) -> Option<String> {
        gaps(&JsonLines::read(path).expect("readable"), 8 * UPDATES, UPDATES)
    }

    fn written(path: &Path) -> Vec<u8> {
        for update in 1..=UPDATES {
            append_json_line(path, &json!({ "step": 8 * update, "charts/a": 0.25 })).expect("writable");
        }
        fs::read(path).expect("written")
    }

    #[test]
    fn wherever_a_log_is_cut_off_what_is_missing_is_said() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        let whole = written(&path);
        assert_eq!(said(&path), None);
        let ends: Vec<usize> = (0..whole.len()).filter(|at| whole[*at] == b'\n').collect();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).expect("writable");
            // Without its line feed a line is whole.
            let kept = ends.iter().filter(|end| length >= **end).count() as u64;
            let words = said(&path);
            if kept == UPDATES {
                assert_eq!(words, None, "{length} bytes");
                continue;
            }
            let words = words.unwrap_or_else(|| panic!("{length} bytes: nothing is said"));
            let gap = match kept {
                3 => "nothing is left of the update of step 32: ".to_owned(),
                kept => format!(
                    "nothing is left of {} updates, those of the steps {} to 32: ",
                    UPDATES - kept,
                    8 * (kept + 1)
                ),
            };
            assert!(words.contains(&gap), "{length} bytes: {words}");
            let is_torn = !whole[..length].is_empty() && !ends.contains(&(length - 1)) && !ends.contains(&length);
            assert_eq!(words.contains(&format!("line {} is damaged", kept + 1)), is_torn, "{length} bytes: {words}");
        }
        fs::remove_file(&path).expect("removed");
        let words = said(&path).expect("it is gone");
        assert!(words.starts_with("nothing is left of 4 updates, those of the steps 8 to 32: curves"), "{words}");
    }

    #[test]
    fn lines_that_are_missing_in_the_middle_are_said_as_well() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        let text = String::from_utf8(written(&path)).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        fs::write(&path, format!("{}\n{}\n", lines[1], lines[3])).expect("writable");
        let words = said(&path).expect("two are missing");
        assert!(words.starts_with("nothing is left of 2 updates, those of the steps 8, 24: "), "{words}");
        fs::write(&path, format!("{}\n{}\nx\n{}\n", lines[0], lines[1], lines[3])).expect("writable");
        let words = said(&path).expect("one is damaged");
        assert!(
            words.starts_with("line 3 is damaged and left out; nothing is left of the update of step 24"),
            "{words}"
        );
    }

    #[test]
    fn what_a_kill_tore_behind_the_step_is_not_spoken_of() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        let torn = [written(&path), b"{\"crc32\":\"12".to_vec()].concat();
        fs::write(&path, torn).expect("writable");
        assert_eq!(said(&path), None);
        assert_eq!(gaps(&JsonLines::default(), 0, 0), None, "nothing was learned yet");
    }

    #[test]
    fn of_many_gaps_the_first_are_named() {
        let even: Vec<u64> = (1..=20).map(|update| 2 * update).collect();
        let words = of_updates(even, 10).expect("missing");
        assert_eq!(words, "20 updates, those of the steps 20, 40, 60, 80, 100, 120, 140, 160 and others");
        let words = missing(&JsonLines::default(), 17, 4).expect("missing");
        assert!(words.starts_with("nothing is left of 4 of 4 updates: "), "{words}");
    }
}
