//! Findings of a diagnosis, the most likely cause first, as text, JSON and a section of a page.

use crate::diagnose::advice::{Advice, AdviceContext};
use playbot_report::{PlainTable, Section, Table, counted};
use serde_json::{Value, json};
use std::fmt;

/// What shows that something keeps an agent from learning. The order is that of the findings: a broken game comes before
/// a wrong setting, and a cause before its consequences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Sign {
    /// The game breaks its contract or panics.
    GameFault,
    /// An observed value is not a finite number.
    NotFinite,
    /// Recordings are of another game or of another version of its rules.
    OtherVersion,
    /// Recordings do not lead to the recorded states.
    NoReplay,
    /// The game differs from itself.
    Differs,
    /// Time is up before the goal can be reached. In a few ticks observed values hardly change.
    ShortTime,
    /// Observed values never change.
    ConstantObservation,
    /// Masks forbid what demonstrators do.
    ForbiddenActions,
    /// Actions change nothing.
    DeadActions,
    /// Recordings in which nearly nothing is done.
    IdleRecordings,
    /// Recordings of another task than the training.
    OtherLevels,
    /// Recorded actions do not depend on what is observed.
    Contradictory,
    /// Recordings without a win.
    NeverWon,
    /// No player is ever rewarded.
    NoReward,
    /// Doing nothing earns as much as the demonstrator.
    IdlingPays,
    /// The demonstrator earns less than random actions.
    RewardAgainst,
    /// Rewards that are large and not normalised.
    RewardScale,
    /// A learning rate at which nothing is kept.
    LearningRate,
    /// The policy hardly changes.
    Unmoved,
    /// The entropy bonus outweighs the reward.
    EntropyWeight,
    /// The discount ends before the reward comes.
    ShortHorizon,
    /// The penalty holds the policy at the decoder.
    HeldByDecoder,
    /// Observed values of very different scale, not normalised.
    ObservationScale,
    /// Observed values at the bound of the normaliser.
    Saturated,
    /// The observations of the recordings are not those of the game.
    OtherObservations,
    /// Nothing trains the critic, or it explains nothing.
    BlindCritic,
    /// The policy earns less than random actions do.
    BelowChance,
    /// Under one in a hundred episodes is rewarded.
    RareReward,
    /// A lesson of the curriculum that was never learned.
    LessonNotLearned,
    /// The policy moves too far in an update.
    MovesTooFar,
    /// Units of the policy let no gradient through.
    DeadUnits,
    /// The policy earns less than the decoder that it began as.
    BelowDecoder,
    /// The policy takes the same actions whatever it draws.
    Collapsed,
    /// The policy does the same whatever it observes.
    IgnoresObservation,
    /// Equal observations in which the best actions differ.
    PartialObservation,
    /// The decoder knows its recordings no better than their frequencies.
    WeakDecoder,
    /// Skills of the prior earn less than those of any state.
    PoorPrior,
    /// The prior draws the same skills in every state.
    BlindPrior,
    /// All skills do the same.
    EqualSkills,
    /// Training levels are learned, held-out levels are not.
    Overfitting,
    /// No episode ends.
    NoEpisodes,
}

impl Sign {
    /// Returns the name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::GameFault => "game-fault",
            Self::NotFinite => "observation-not-finite",
            Self::OtherVersion => "recordings-of-another-version",
            Self::NoReplay => "recordings-do-not-replay",
            Self::Differs => "game-differs-from-itself",
            Self::ConstantObservation => "constant-observation",
            Self::ForbiddenActions => "mask-forbids-demonstrated-actions",
            Self::DeadActions => "actions-change-nothing",
            Self::IdleRecordings => "idle-recordings",
            Self::OtherLevels => "recordings-of-other-levels",
            Self::Contradictory => "contradictory-recordings",
            Self::NeverWon => "recordings-never-won",
            Self::ShortTime => "time-limit-too-short",
            Self::NoReward => "reward-never-seen",
            Self::IdlingPays => "idling-pays",
            Self::RewardAgainst => "demonstrator-earns-less-than-random",
            Self::RewardScale => "reward-scale",
            Self::LearningRate => "learning-rate-too-high",
            Self::Unmoved => "policy-does-not-move",
            Self::EntropyWeight => "entropy-weight-too-high",
            Self::ShortHorizon => "horizon-too-short",
            Self::HeldByDecoder => "policy-held-by-decoder",
            Self::ObservationScale => "observation-scale",
            Self::Saturated => "observation-saturated",
            Self::OtherObservations => "observations-not-as-recorded",
            Self::BlindCritic => "critic-explains-nothing",
            Self::BelowChance => "policy-worse-than-chance",
            Self::RareReward => "reward-rarely-seen",
            Self::LessonNotLearned => "lesson-not-learned",
            Self::MovesTooFar => "policy-moves-too-far",
            Self::DeadUnits => "dead-units",
            Self::BelowDecoder => "policy-worse-than-decoder",
            Self::Collapsed => "policy-collapsed",
            Self::IgnoresObservation => "policy-ignores-observation",
            Self::PartialObservation => "observation-lacks-what-decides",
            Self::WeakDecoder => "decoder-worse-than-recordings",
            Self::PoorPrior => "prior-worse-than-chance",
            Self::BlindPrior => "prior-ignores-state",
            Self::EqualSkills => "skills-all-alike",
            Self::Overfitting => "overfitting",
            Self::NoEpisodes => "no-episode-ends",
        }
    }

    /// Returns the heading for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::GameFault => "the game breaks off",
            Self::NotFinite => "an observed value is not finite",
            Self::OtherVersion => "the recordings are of other rules or of another game",
            Self::NoReplay => "the recordings do not replay",
            Self::Differs => "the game differs from itself",
            Self::ConstantObservation => "observed values never change",
            Self::ForbiddenActions => "masks forbid what is demonstrated",
            Self::DeadActions => "actions change nothing",
            Self::IdleRecordings => "the recordings do nothing",
            Self::OtherLevels => "the recordings are of another task",
            Self::Contradictory => "recorded actions do not depend on the observation",
            Self::NeverWon => "no recorded episode is won",
            Self::ShortTime => "time is up before the goal",
            Self::NoReward => "no reward is ever seen",
            Self::IdlingPays => "doing nothing pays",
            Self::RewardAgainst => "the demonstrator earns less than random actions",
            Self::RewardScale => "rewards are too large",
            Self::LearningRate => "the learning rate is too high",
            Self::Unmoved => "the policy does not move",
            Self::EntropyWeight => "the entropy bonus outweighs the reward",
            Self::ShortHorizon => "the horizon ends before the reward",
            Self::HeldByDecoder => "the penalty holds the policy at the decoder",
            Self::ObservationScale => "observed values differ much in scale",
            Self::Saturated => "observed values lie beyond the normaliser",
            Self::OtherObservations => "the game is not observed as the recordings are",
            Self::BlindCritic => "the critic explains nothing",
            Self::BelowChance => "the policy does worse than random actions",
            Self::RareReward => "reward is rarely seen",
            Self::LessonNotLearned => "a lesson is not learned",
            Self::MovesTooFar => "the policy moves too far",
            Self::DeadUnits => "units of the policy are dead",
            Self::BelowDecoder => "the policy does worse than the decoder it began as",
            Self::Collapsed => "the policy has collapsed",
            Self::IgnoresObservation => "the policy ignores what it observes",
            Self::PartialObservation => "the observation lacks what decides",
            Self::WeakDecoder => "the decoder is no better than action frequencies",
            Self::PoorPrior => "the prior does worse than skills by chance",
            Self::BlindPrior => "the prior ignores the state",
            Self::EqualSkills => "all skills do the same",
            Self::Overfitting => "what is learned does not carry over",
            Self::NoEpisodes => "no episode ends",
        }
    }
}

/// One reason why an agent may not learn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LearningFinding {
    /// What was found.
    pub sign: Sign,
    /// The numbers that show it.
    pub evidence: String,
    /// The likely cause.
    pub cause: String,
    /// The next steps.
    pub advice: Vec<Advice>,
}

impl LearningFinding {
    /// Makes a finding.
    pub fn new(sign: Sign, evidence: impl Into<String>, cause: impl Into<String>, advice: &[Advice]) -> Self {
        Self { sign, evidence: evidence.into(), cause: cause.into(), advice: advice.to_vec() }
    }

    /// Returns what to try, in one line.
    pub fn next_steps(&self, context: &AdviceContext) -> String {
        self.advice.iter().map(|advice| advice.words(context)).collect::<Vec<_>>().join("; or ")
    }

    /// Returns the finding in one sentence with its first step, for the log of a training.
    pub fn warning(&self, context: &AdviceContext) -> String {
        let step = self.advice.first().map_or_else(String::new, |advice| format!("; try: {}", advice.words(context)));
        format!("{}: {}{step}", self.sign.title(), self.evidence)
    }
}

/// All findings about one run, set of recordings or game, the most likely cause first.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// The findings.
    pub findings: Vec<LearningFinding>,
    /// Words about what was not looked at, and why, and about what was measured without a finding.
    pub notes: Vec<String>,
    /// What commands name.
    pub context: AdviceContext,
}

impl Diagnosis {
    /// Orders findings: the most likely cause first. Of those with one sign, the first that was found stays.
    pub fn new(mut findings: Vec<LearningFinding>, notes: Vec<String>, context: AdviceContext) -> Self {
        findings.sort_by_key(|finding| finding.sign);
        findings.dedup_by_key(|finding| finding.sign);
        Self { findings, notes, context }
    }

    /// Returns whether nothing was found.
    pub fn is_healthy(&self) -> bool {
        self.findings.is_empty()
    }

    /// Returns `{"findings": [{"sign", "evidence", "cause", "try"}], "notes": []}`.
    pub fn to_json(&self) -> Value {
        let findings = self.findings.iter().map(|finding| {
            json!({
                "sign": finding.sign.name(),
                "evidence": finding.evidence,
                "cause": finding.cause,
                "try": finding.next_steps(&self.context),
            })
        });
        json!({ "findings": findings.collect::<Vec<_>>(), "notes": self.notes })
    }

    /// Returns the part of a page that shows the findings.
    pub fn section(&self) -> Section {
        let columns = ["sign", "evidence", "likely cause", "try"].map(str::to_owned).to_vec();
        let rows = self.findings.iter().map(|finding| {
            let (title, next) = (finding.sign.title().to_owned(), finding.next_steps(&self.context));
            vec![title, finding.evidence.clone(), finding.cause.clone(), next]
        });
        let table = PlainTable { columns, rows: rows.collect(), ..PlainTable::default() };
        let text = match self.findings.len() {
            0 => "None of the known signs of what keeps an agent from learning was found.".to_owned(),
            count => format!("{}, the most likely cause first.", counted(count as u64, "finding")),
        };
        let tables = if self.is_healthy() { Vec::new() } else { vec![Table::Plain(table)] };
        Section { heading: "Why it does not learn".to_owned(), text, tables, ..Section::default() }
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_healthy() {
            write!(f, "none of the known signs of what keeps an agent from learning")?;
        }
        for (number, finding) in self.findings.iter().enumerate() {
            let end = if number == 0 { "" } else { "\n\n" };
            write!(f, "{end}{}. {} ({})", number + 1, finding.sign.title(), finding.sign.name())?;
            write!(f, "\n   evidence: {}\n   cause: {}", finding.evidence, finding.cause)?;
            write!(f, "\n   try: {}", finding.next_steps(&self.context))?;
        }
        self.notes.iter().try_for_each(|note| write!(f, "\nnote: {note}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::evidence;

    fn context() -> AdviceContext {
        evidence("ppo", "").context
    }

    fn finding(sign: Sign) -> LearningFinding {
        LearningFinding::new(sign, format!("evidence of {}", sign.name()), "a cause", &[Advice::Doctor])
    }

    #[test]
    fn causes_come_before_their_consequences() {
        let found = [Sign::Collapsed, Sign::LearningRate, Sign::ConstantObservation].map(finding).to_vec();
        let diagnosis = Diagnosis::new(found, Vec::new(), context());
        let signs: Vec<_> = diagnosis.findings.iter().map(|finding| finding.sign).collect();
        assert_eq!(signs, [Sign::ConstantObservation, Sign::LearningRate, Sign::Collapsed]);
    }

    #[test]
    fn json_has_the_four_fields_of_each_finding() {
        let diagnosis = Diagnosis::new(vec![finding(Sign::Differs)], Vec::new(), context());
        let expected = json!({ "findings": [{
            "sign": "game-differs-from-itself", "evidence": "evidence of game-differs-from-itself", "cause": "a cause",
            "try": "look for the first difference with `playbot doctor coinrun --mode hard`",
        }], "notes": [] });
        assert_eq!(diagnosis.to_json(), expected);
        assert_eq!(Diagnosis::new(Vec::new(), Vec::new(), context()).to_json(), json!({ "findings": [], "notes": [] }));
    }

    #[test]
    fn a_page_and_text_show_every_finding_and_what_was_left_out() {
        let notes = vec!["pictures are not looked at".to_owned()];
        let diagnosis = Diagnosis::new(vec![finding(Sign::NoReward)], notes, context());
        let text = diagnosis.to_string();
        assert!(text.starts_with("1. no reward is ever seen (reward-never-seen)\n   evidence: "), "{text}");
        assert!(text.ends_with("note: pictures are not looked at"), "{text}");
        assert_eq!(diagnosis.section().tables.len(), 1);
        assert!(Diagnosis::new(Vec::new(), Vec::new(), context()).section().tables.is_empty());
    }
}
