//! Differences of a level from earlier results.

use std::fmt;

use serde::Serialize;

use super::fisher::Trials;

/// A level that has changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The level.
    pub level: String,
    /// The tester that shows the change; `None` for several together.
    pub tester: Option<String>,
    /// Solved episodes before.
    pub before: Trials,
    /// Solved episodes now.
    pub now: Trials,
    /// Probability of such a difference by chance, by Fisher's exact test; `None` without randomness.
    pub probability: Option<f64>,
    /// Change of the level's proof, described.
    pub proof: Option<String>,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { level, before, now, .. } = self;
        let (was, is) = (before.successes, now.successes);
        write!(f, "{level}: solved {was} of {}, now {is} of {}", before.trials, now.trials)?;
        match (&self.proof, self.probability, &self.tester) {
            (Some(proof), ..) => write!(f, " ({proof})"),
            (None, Some(probability), _) => write!(f, " (p = {probability:.1e})"),
            (None, None, Some(tester)) => write!(f, " ({tester}, which draws no random numbers)"),
            (None, None, None) => Ok(()),
        }
    }
}

/// A finding that is new or gone.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FindingChange {
    /// The level.
    pub level: String,
    /// Its detector.
    pub detector: String,
    /// The tester that played.
    pub tester: Option<String>,
}

impl fmt::Display for FindingChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.level, self.detector)?;
        self.tester.iter().try_for_each(|tester| write!(f, " ({tester})"))
    }
}
