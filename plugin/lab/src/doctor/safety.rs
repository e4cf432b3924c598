//! The uses that a game is safe for.

use serde::Serialize;

use super::{
    observed::ObservationReport,
    report::{Comparison, ComparisonReport},
};

/// Whether the game is safe for a use, as far as a few ticks can show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// `None` if it was not compared.
    pub safe: Option<bool>,
    /// The reason, or the condition.
    pub why: String,
    /// The comparisons behind it: the game is safe if they found no difference in their ticks.
    pub comparisons: Vec<Comparison>,
}

/// The uses that the game is safe for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Safety {
    /// Recording: whether a recording replays.
    pub recording: Verdict,
    /// Resume: whether a stopped run can go on.
    pub resume: Verdict,
    /// Many arenas in one World.
    pub arenas: Verdict,
    /// Several Worlds on several threads.
    pub threads: Verdict,
    /// Play in a window, where frames take the time they take.
    pub window: Verdict,
}

impl Safety {
    /// Returns all uses, with their names.
    pub fn all(&self) -> [(&'static str, &Verdict); 5] {
        [
            ("recording and replay", &self.recording),
            ("resume of a run", &self.resume),
            ("many arenas per World", &self.arenas),
            ("several threads", &self.threads),
            ("a window", &self.window),
        ]
    }
}

/// Judges the uses by the results of the comparisons.
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

/// Returns safe if all these comparisons found nothing, unsafe if one of them did.
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
