//! Panics and faults of a game during an episode.

use bevy_playbot::fault::Fault;

/// Beginning of the message of a game's panic, after its position.
const PANICKED: &str = "the game panicked: ";
/// Beginning of the message of an agent whose pictures were all blank.
const BLANK: &str = "each picture of an episode of ";

/// A failure of the game: it panicked, broke its contract, or the episode never ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breakage {
    /// `panic`, `fault`, `blank-picture` or `endless`.
    pub detector: &'static str,
    /// Tick of the episode, from 0.
    pub tick: u32,
    /// The game's message.
    pub message: String,
}

impl Breakage {
    /// Classifies a fault in this tick.
    pub fn of_fault(fault: &Fault, tick: u32) -> Self {
        let Fault(message) = fault;
        match message.split_once(PANICKED) {
            Some((_, words)) => Self { detector: "panic", tick, message: words.to_owned() },
            None => Self { detector: detector_of(message), tick, message: without_moment(message).to_owned() },
        }
    }

    /// Creates the breakage of an episode that has not ended after this many ticks.
    pub(super) fn endless(tick: u32) -> Self {
        let message = format!("the episode has not ended after {tick} ticks: give the game a time limit");
        Self { detector: "endless", tick, message }
    }
}

/// Returns the detector of a fault with this message.
pub(crate) fn detector_of(message: &str) -> &'static str {
    if message.contains(PANICKED) {
        "panic"
    } else if message.contains(BLANK) {
        "blank-picture"
    } else {
        "fault"
    }
}

/// Returns a message such as `agent 0, level 3, tick 7: words` without its beginning.
fn without_moment(message: &str) -> &str {
    match message.split_once(": ") {
        Some((place, words)) if place.starts_with("agent ") => words,
        _ => message,
    }
}

/// Returns whether two messages are equal, except for numbers and, after a panic, the line of the source.
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
