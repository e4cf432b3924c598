//! What a game can be used for as it is.

use serde::Serialize;

use super::{
    observed::ObservationReport,
    report::{Comparison, ComparisonReport},
};

/// Whether the game is safe for something, as far as a few ticks can show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// `None` if that was not looked at.
    pub safe: Option<bool>,
    /// Why, or under which condition.
    pub why: String,
    /// What it rests on: it is safe as far as none of these comparisons found a difference in the ticks that they played.
    pub comparisons: Vec<Comparison>,
}

/// What the game is safe for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Safety {
    /// Recording: whether a recording replays.
    pub recording: Verdict,
    /// Stopping a training and going on with it.
    pub resume: Verdict,
    /// Many arenas in one World.
    pub arenas: Verdict,
    /// Several Worlds on several threads.
    pub threads: Verdict,
    /// Play in a window, where frames take the time they take.
    pub window: Verdict,
}

impl Safety {
    /// All of them, with what they are about.
    pub fn all(&self) -> [(&'static str, &Verdict); 5] {
        [
            ("recording and replay", &self.recording),
            ("resume of a training", &self.resume),
            ("many arenas per World", &self.arenas),
            ("several threads", &self.threads),
            ("a window", &self.window),
        ]
    }
}

/// What is safe, by what the comparisons found.
pub(super) fn assess_safety(comparisons: &[ComparisonReport], observation: &ObservationReport) -> Safety {
    let verdict = |needed: &[Comparison]| verdict(comparisons, needed);
    let mut resume = verdict(&[Comparison::Repeat, Comparison::Restart]);
    let mut recording = verdict(&[Comparison::Repeat, Comparison::Archetypes, Comparison::Restart]);
    for verdict in [&mut recording, &mut resume] {
        if verdict.safe == Some(true) && !observation.state_hash {
            verdict.why = "but the game writes no StateHash, so that a replay compares little".to_owned();
        }
    }
    Safety {
        recording,
        resume,
        arenas: verdict(&[Comparison::Repeat, Comparison::Arenas]),
        threads: verdict(&[Comparison::Repeat, Comparison::Threads]),
        window: verdict(&[Comparison::Repeat, Comparison::Clock, Comparison::Archetypes]),
    }
}

/// Safe if all these comparisons found nothing, unsafe if one of them did.
fn verdict(reports: &[ComparisonReport], needed: &[Comparison]) -> Verdict {
    let comparisons = needed.to_vec();
    let mut of_needed = reports.iter().filter(|report| needed.contains(&report.comparison));
    if let Some(bad) = of_needed.clone().find(|report| report.same() == Some(false)) {
        let why = format!("differs {}", bad.comparison.describe());
        let why =
            if bad.fault.is_some() && bad.difference().is_none() { "the game has a fault".to_owned() } else { why };
        return Verdict { safe: Some(false), why, comparisons };
    }
    match of_needed.find_map(|report| report.skipped.clone()) {
        Some(why) => Verdict { safe: None, why, comparisons },
        None => Verdict { safe: Some(true), why: String::new(), comparisons },
    }
}
