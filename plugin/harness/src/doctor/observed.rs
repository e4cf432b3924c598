//! The observations of agents: values that are not numbers, that are sometimes missing, or that never change.

use crate::doctor::{ComparisonReport, DoctorComparison, game_copy::Outcome};
use bevy_playbot::entities::EntitySet;
use serde::Serialize;

/// A value that never changed while it was watched.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConstantValue {
    /// Its name.
    pub name: String,
    /// The value.
    pub value: f32,
}

/// An observed value that was not a finite number.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NonFiniteValue {
    /// The tick, from 0.
    pub tick: u32,
    /// Name of the value.
    pub name: String,
    /// The value: `NaN`, `inf` or `-inf`.
    pub value: String,
}

/// A set of things all of whose slots were taken, so that others may have been left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FullSet {
    /// Its name.
    pub name: String,
    /// Number of its slots.
    pub slots: usize,
    /// Ticks in which it was full.
    pub ticks: u32,
}

/// The observations of one agent.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ObservationReport {
    /// Number of values that the game's sensor names.
    pub values: usize,
    /// Ticks that were watched.
    pub ticks: u32,
    /// Values that were the same in all of them; of a set of things those that were the same in all slots, by the name in
    /// the first one.
    pub constant: Vec<ConstantValue>,
    /// Sets of things that were full.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub full: Vec<FullSet>,
    /// Values that never changed in slots of sets whose other slots did: a slot that stays empty is no fault.
    #[serde(skip)]
    pub unused: usize,
    /// The first value that was not a finite number.
    pub not_finite: Option<NonFiniteValue>,
    /// The first tick, from 0, with another number of values, and that number.
    pub length: Option<(u32, usize)>,
    /// True if the game writes a state hash.
    pub state_hash: bool,
}

/// Monitors one agent's observations.
pub(super) struct ObservationMonitor {
    names: Vec<String>,
    sets: Vec<EntitySet>,
    /// Ticks in which each set was full.
    full: Vec<u32>,
    first: Option<Outcome>,
    changed: Vec<bool>,
    image_changed: bool,
    report: ObservationReport,
}

impl ObservationMonitor {
    /// Creates a monitor for values with these names.
    pub fn new(names: Vec<String>) -> Self {
        let report = ObservationReport { values: names.len(), ..Default::default() };
        let sets = EntitySet::all_in(&names);
        let (full, changed) = (vec![0; sets.len()], vec![false; names.len()]);
        Self { changed, names, sets, full, first: None, image_changed: false, report }
    }

    /// Adds the outcome of a tick.
    pub fn note(&mut self, tick: u32, seen: &Outcome) {
        self.report.ticks += 1;
        self.report.state_hash |= seen.hash != 0;
        let (wanted, got) = (self.names.len(), seen.observation.len());
        if got != wanted && self.report.length.is_none() {
            self.report.length = Some((tick, got));
        }
        let bad = seen.observation.iter().position(|value| !value.is_finite());
        if let (Some(at), None) = (bad, &self.report.not_finite) {
            let name = self.names.get(at).cloned().unwrap_or_else(|| format!("value {at}"));
            self.report.not_finite = Some(NonFiniteValue { tick, name, value: seen.observation[at].to_string() });
        }
        for (set, ticks) in self.sets.iter().zip(&mut self.full) {
            *ticks += u32::from(set.is_full(&seen.observation));
        }
        let first = self.first.get_or_insert_with(|| seen.clone());
        for ((now, then), changed) in seen.observation.iter().zip(&first.observation).zip(&mut self.changed) {
            *changed |= now.to_bits() != then.to_bits();
        }
        self.image_changed |= seen.image != first.image;
    }

    /// Returns the report. A value that was seen only once does not count as constant.
    pub fn report(mut self) -> ObservationReport {
        if self.report.ticks > 1 {
            let values = self.first.map(|first| first.observation).unwrap_or_default();
            let constant = EntitySet::constant_values(&self.sets, self.names.len(), |at| !self.changed[at]);
            let constant = constant.into_iter().map(|at| ConstantValue {
                name: self.names[at].clone(),
                // A value that was missing at first is unknown, and the report says so elsewhere.
                value: values.get(at).copied().unwrap_or(f32::NAN),
            });
            self.report.constant = constant.collect();
            let unchanged = self.changed.iter().filter(|changed| !**changed).count();
            self.report.unused = unchanged.saturating_sub(self.report.constant.len());
        }
        let full = self.sets.into_iter().zip(self.full).filter(|(_, ticks)| *ticks > 0);
        let full = full.map(|(set, ticks)| FullSet { name: set.name, slots: set.block.slots, ticks });
        self.report.full = full.collect();
        self.report
    }
}

impl ObservationReport {
    /// Returns whether there were values, and none of them ever changed.
    pub fn is_blind(&self) -> bool {
        self.values > 0 && self.ticks > 1 && self.constant.len() + self.unused == self.values
    }
}

// Uses that a game is safe for.

/// The safety of the game for a use, as far as a few ticks can show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// `None` if it was not compared.
    pub safe: Option<bool>,
    /// The reason, or the condition.
    pub why: String,
    /// The comparisons behind it: the game is safe if they found no difference in their ticks.
    pub comparisons: Vec<DoctorComparison>,
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
    /// Exploration from snapshots.
    pub snapshots: Verdict,
}

impl Safety {
    /// Returns all uses, with their names.
    pub fn all(&self) -> [(&'static str, &Verdict); 6] {
        [
            ("recording and replay", &self.recording),
            ("resume of a run", &self.resume),
            ("many arenas per World", &self.arenas),
            ("several threads", &self.threads),
            ("a window", &self.window),
            ("snapshots of explorers", &self.snapshots),
        ]
    }
}

/// Judges the uses by the results of the comparisons.
pub(super) fn assess_safety(
    first_level: u64,
    comparisons: &[ComparisonReport],
    observation: &ObservationReport,
) -> Safety {
    let verdict = |needed: &[DoctorComparison]| verdict(first_level, comparisons, needed);
    let has_other = comparisons.iter().any(|report| report.comparison == DoctorComparison::OtherLevel);
    let other = has_other.then_some(DoctorComparison::OtherLevel);
    let with_other = |needed: &[DoctorComparison]| needed.iter().copied().chain(other).collect::<Vec<_>>();
    let mut resume = verdict(&with_other(&[DoctorComparison::Repeat, DoctorComparison::Restart]));
    let mut recording =
        verdict(&with_other(&[DoctorComparison::Repeat, DoctorComparison::Archetypes, DoctorComparison::Restart]));
    for verdict in [&mut recording, &mut resume] {
        if verdict.safe == Some(true) && !observation.state_hash {
            verdict.why = "but the game writes no StateHash, so that a replay compares little".to_owned();
        }
    }
    Safety {
        recording,
        resume,
        arenas: verdict(&[DoctorComparison::Repeat, DoctorComparison::Arenas]),
        threads: verdict(&[DoctorComparison::Repeat, DoctorComparison::Threads]),
        window: verdict(&[DoctorComparison::Repeat, DoctorComparison::Clock, DoctorComparison::Archetypes]),
        snapshots: verdict(&[DoctorComparison::Repeat, DoctorComparison::Snapshots]),
    }
}

/// Returns safe if all these comparisons found nothing, unsafe if one of them did.
fn verdict(first_level: u64, reports: &[ComparisonReport], needed: &[DoctorComparison]) -> Verdict {
    let comparisons = needed.to_vec();
    let mut of_needed = reports.iter().filter(|report| needed.contains(&report.comparison));
    if let Some(bad) = of_needed.clone().find(|report| report.same() == Some(false)) {
        let is_of_first = bad.before.is_none() && bad.level == first_level;
        let why = format!("differs {}{}", if is_of_first { "" } else { "on " }, bad.describe(first_level));
        let why =
            if bad.fault.is_some() && bad.difference().is_none() { "the game has a fault".to_owned() } else { why };
        return Verdict { safe: Some(false), why, comparisons };
    }
    let has_note = of_needed.clone().any(ComparisonReport::is_note);
    match of_needed.find_map(|report| report.skipped.clone()) {
        Some(why) => Verdict { safe: None, why, comparisons },
        None => {
            let why = if has_note { "but see the notes on state that differs" } else { "" };
            Verdict { safe: Some(true), why: why.to_owned(), comparisons }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report_on(rows: &[&[f32]]) -> ObservationReport {
        let mut monitor = ObservationMonitor::new(vec!["x".to_owned(), "y".to_owned()]);
        for (tick, row) in rows.iter().enumerate() {
            let seen = Outcome { observation: row.to_vec(), image: Vec::new(), reward: 0.0, hash: 0, end: None };
            monitor.note(tick as u32, &seen);
        }
        monitor.report()
    }

    #[test]
    fn constant_values_are_named() {
        let report = report_on(&[&[1.0, 5.0], &[2.0, 5.0]]);
        let always_five = ConstantValue { name: "y".to_owned(), value: 5.0 };
        assert_eq!((report.constant.as_slice(), report.is_blind()), (&[always_five][..], false));
        assert!(report_on(&[&[1.0, 5.0], &[1.0, 5.0]]).is_blind());
        assert!(!report_on(&[&[1.0, 5.0]]).is_blind(), "one tick proves nothing");
    }

    #[test]
    fn slots_that_stay_empty_are_no_constant_values_and_full_sets_are_noted() {
        let slots = bevy_playbot::entities::EntitySlots::new("bee", 2, ["dx"]);
        let report_on = |rows: &[[f32; 4]]| {
            let mut monitor = ObservationMonitor::new(slots.names().collect());
            for (tick, row) in rows.iter().enumerate() {
                let seen = Outcome { observation: row.to_vec(), image: Vec::new(), reward: 0.0, hash: 0, end: None };
                monitor.note(tick as u32, &seen);
            }
            monitor.report()
        };
        let one = report_on(&[[1.0, 0.5, 0.0, 0.0], [0.0; 4]]);
        assert_eq!((one.constant.len(), one.full.len(), one.is_blind()), (0, 0, false));
        let two = report_on(&[[1.0, 0.5, 1.0, 2.0], [1.0, 0.25, 1.0, 2.0]]);
        let names: Vec<_> = two.constant.iter().map(|value| value.name.as_str()).collect();
        assert_eq!(names, ["bee[0].present"]);
        assert_eq!(two.full, [FullSet { name: "bee".to_owned(), slots: 2, ticks: 2 }]);
        assert!(report_on(&[[0.0; 4], [0.0; 4]]).is_blind());
    }

    #[test]
    fn the_first_value_that_is_no_number_is_named_with_its_tick() {
        let report = report_on(&[&[1.0, 5.0], &[2.0, f32::NAN], &[f32::INFINITY, 5.0]]);
        let first = NonFiniteValue { tick: 1, name: "y".to_owned(), value: "NaN".to_owned() };
        assert_eq!(report.not_finite, Some(first));
    }

    #[test]
    fn another_number_of_values_is_noticed() {
        assert_eq!(report_on(&[&[1.0, 5.0], &[2.0], &[]]).length, Some((1, 1)));
    }
}
