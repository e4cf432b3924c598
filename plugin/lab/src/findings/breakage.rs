//! A game that broke in the middle of an episode.

use bevy_playbot::fault::Fault;

/// How a game's panic is told, behind where it was.
const PANICKED: &str = "the game panicked: ";
/// How an agent is told whose eye has never seen anything.
const BLANK: &str = "each picture of an episode of ";

/// The game broke: it panicked, broke its contract, or the episode never ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breakage {
    /// `panic`, `fault`, `blank-picture` or `endless`.
    pub detector: &'static str,
    /// Tick of the episode, from 0.
    pub tick: u32,
    /// What the game said.
    pub message: String,
}

impl Breakage {
    /// What a fault in this tick means.
    pub(crate) fn of_fault(fault: &Fault, tick: u32) -> Self {
        let Fault(message) = fault;
        match message.split_once(PANICKED) {
            Some((_, words)) => Self { detector: "panic", tick, message: words.to_owned() },
            None => Self { detector: detector_of(message), tick, message: without_moment(message).to_owned() },
        }
    }

    /// An episode that has not ended after so many ticks.
    pub(super) fn endless(tick: u32) -> Self {
        let message = format!("the episode has not ended after {tick} ticks: give the game a time limit");
        Self { detector: "endless", tick, message }
    }
}

/// What finds a fault with these words.
pub(crate) fn detector_of(message: &str) -> &'static str {
    if message.contains(PANICKED) {
        "panic"
    } else if message.contains(BLANK) {
        "blank-picture"
    } else {
        "fault"
    }
}

/// A message such as `agent 0, level 3, tick 7: words` without its beginning.
fn without_moment(message: &str) -> &str {
    match message.split_once(": ") {
        Some((place, words)) if place.starts_with("agent ") => words,
        _ => message,
    }
}

/// Whether two messages say the same: numbers and, after a panic, the line of the source may differ.
pub(super) fn say_the_same(one: &str, other: &str) -> bool {
    fn letters(message: &str) -> impl Iterator<Item = char> {
        let place = message.rfind(" (").filter(|_| message.ends_with(')'));
        let words = place.filter(|&at| message[at..].contains(".rs:")).map_or(message, |at| &message[..at]);
        words.chars().filter(|letter| !letter.is_ascii_digit())
    }
    letters(one).eq(letters(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_told_from_a_fault_and_both_without_their_place() {
        let of = |words: &str| Breakage::of_fault(&Fault(words.to_owned()), 7);
        let panic = of("agent 0, level 3, tick 7: the game panicked: it burns (src/fire.rs:3:9)");
        assert_eq!((panic.detector, panic.message.as_str()), ("panic", "it burns (src/fire.rs:3:9)"));
        let fault = of("agent 0, level 3, tick 7: the reward is NaN: why");
        assert_eq!((fault.detector, fault.message.as_str(), fault.tick), ("fault", "the reward is NaN: why", 7));
        assert_eq!(of("no camera: none").message, "no camera: none");
        let blank =
            of("agent 0, level 3: each picture of an episode of 9 ticks was of a single colour; point it elsewhere");
        assert!(blank.detector == "blank-picture" && blank.message.starts_with("each picture"), "{blank:?}");
    }

    #[test]
    fn numbers_and_lines_of_the_source_do_not_matter() {
        assert!(say_the_same("it burns (src/fire.rs:3:9)", "it burns (src/fire.rs:12:1)"));
        assert!(say_the_same("value 12 is NaN", "value 7 is NaN"));
        assert!(!say_the_same("it burns (a)", "it burns (b)"));
        assert!(!say_the_same("it burns", "it freezes"));
    }
}
