//! Checks of observations: values that never change, are not finite, differ much in scale, or are not those that were
//! recorded.

use crate::diagnose::{
    advice::Advice,
    evidence::{Evidence, list},
    finding::{LearningFinding, Sign},
    play::{Played, PlayedEpisode, Seat},
};
use bevy_playbot::entities::EntitySet;
use playbot_report::{counted, percent, readable, whole};

/// Sizes of values that networks learn from without a normaliser. Constant values of another size do no harm.
const FIT: std::ops::RangeInclusive<f32> = 1e-3..=100.0;

/// Share of the values that may be smaller.
const MOST_TINY: f64 = 0.25;

/// Deviations from the mean at which normalisers clip.
const CLIPPED_AT: f64 = 10.0;

/// Share of values beyond that bound which is too large.
const MOST_CLIPPED: f64 = 0.02;

/// Share of the recorded rows in which a value must be another one than the constant that is played.
const OFTEN: f64 = 0.2;

/// Share of the policy's ticks in which a sound value is not clipped: rare tiles and enemies are, in some.
const MOST_OF_ALL: f64 = 0.5;

/// Share of constant values from which on hardly anything is observed.
const NEARLY_ALL: f64 = 0.95;

/// Fewest rows about which a statistic says something.
const FEWEST_ROWS: usize = 50;

/// Statistics of one observed value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnStatistics {
    /// Rows.
    pub rows: usize,
    /// Rows in which it is not finite.
    pub not_finite: usize,
    /// Smallest value.
    pub min: f32,
    /// Largest value.
    pub max: f32,
    /// Mean of the finite values.
    pub mean: f64,
    /// Their deviation.
    pub deviation: f64,
}

impl ColumnStatistics {
    fn is_constant(&self) -> bool {
        self.rows > 0 && self.min == self.max
    }

    fn size(&self) -> f32 {
        self.min.abs().max(self.max.abs())
    }
}

/// Returns the statistics of each value over rows of equal length.
pub fn statistics<'a>(rows: impl Iterator<Item = &'a [f32]>) -> Vec<ColumnStatistics> {
    let mut sums: Vec<(f64, f64)> = Vec::new();
    let mut columns: Vec<ColumnStatistics> = Vec::new();
    for row in rows {
        if columns.is_empty() {
            let (min, max) = (f32::INFINITY, f32::NEG_INFINITY);
            let empty = ColumnStatistics { rows: 0, not_finite: 0, min, max, mean: 0.0, deviation: 0.0 };
            columns = vec![empty; row.len()];
            sums = vec![(0.0, 0.0); row.len()];
        }
        if row.len() != columns.len() {
            continue;
        }
        for ((column, sum), &value) in columns.iter_mut().zip(&mut sums).zip(row) {
            column.rows += 1;
            if !value.is_finite() {
                column.not_finite += 1;
                continue;
            }
            (column.min, column.max) = (column.min.min(value), column.max.max(value));
            (sum.0, sum.1) = (sum.0 + f64::from(value), sum.1 + f64::from(value).powi(2));
        }
    }
    for (column, (sum, squares)) in columns.iter_mut().zip(sums) {
        let count = (column.rows - column.not_finite).max(1) as f64;
        column.mean = sum / count;
        column.deviation = (squares / count - column.mean.powi(2)).max(0.0).sqrt();
    }
    columns
}

/// Gives the numbers of a set's things the statistics over all slots, for those things that are there.
fn share_in_sets<'a>(
    columns: &mut [ColumnStatistics],
    sets: &[EntitySet],
    rows: impl Iterator<Item = &'a [f32]> + Clone,
) {
    for set in sets {
        for field in set.block.start..=set.block.start + set.block.width {
            let places: Vec<usize> = set.same_field(field).filter(|place| *place < columns.len()).collect();
            let things = rows.clone().filter(|row| row.len() == columns.len()).flat_map(|row| {
                let here = places.iter().filter(|place| !set.is_absent(**place, row));
                here.map(|place| std::slice::from_ref(&row[*place])).collect::<Vec<_>>()
            });
            if let Some(shared) = statistics(things).first() {
                places.iter().for_each(|place| columns[*place] = *shared);
            }
        }
    }
}

/// Checks what agents observe.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let rows = || evidence.played.iter().flat_map(|played| &played.episodes).flat_map(PlayedEpisode::rows);
    let columns = statistics(rows());
    let recorded = recorded(evidence, columns.len());
    let mut found = not_finite(evidence, &columns);
    if columns.first().is_none_or(|column| column.rows < FEWEST_ROWS) {
        return found;
    }
    found.extend(constant(evidence, &columns));
    found.extend(scales(evidence, &columns));
    found.extend(not_as_recorded(evidence, &recorded));
    found.extend(clipped(evidence));
    found
}

/// Notes values that never change, where they are some of many and no recording says that they should.
pub fn note_constants(evidence: &Evidence) -> Option<String> {
    let rows = || evidence.played.iter().flat_map(|played| &played.episodes).flat_map(PlayedEpisode::rows);
    let columns = statistics(rows());
    let sets = EntitySet::all_in(&evidence.names);
    let constants = EntitySet::constant_values(&sets, columns.len(), |number| columns[number].is_constant());
    let is_known = evidence.names.is_empty() || columns.first().is_none_or(|column| column.rows < FEWEST_ROWS);
    if is_known || constants.is_empty() || constants.len() == columns.len() {
        return None;
    }
    let names: Vec<String> = constants.iter().map(|&number| evidence.value_name(number)).collect();
    Some(format!(
        "{} of {} observed values are the same in all {} ticks that were played: {}",
        constants.len(),
        columns.len(),
        whole(columns[0].rows as f64),
        list(&names)
    ))
}

/// Finds values that the policy's own normaliser clips in the ticks that it plays.
fn clipped(evidence: &Evidence) -> Option<LearningFinding> {
    let shares = evidence.clipped.as_ref()?;
    let often = shares.iter().enumerate().filter(|(_, share)| **share > MOST_OF_ALL);
    let names: Vec<String> = often.map(|(number, _)| evidence.value_name(number)).collect();
    let most = shares.iter().copied().fold(0.0, f64::max);
    (!names.is_empty()).then(|| {
        LearningFinding::new(
            Sign::Saturated,
            format!(
                "{}: {} more than {CLIPPED_AT} deviations from the normaliser's mean, in up to {} of the policy's ticks",
                list(&names),
                if names.len() == 1 { "lies" } else { "lie" },
                percent(most)
            ),
            "the normaliser clips what lies far outside of what it was learned from: other levels, other units, or values \
             that are rarely anything but 0",
            &[Advice::ScaleInGame, Advice::RecordAgain],
        )
    })
}

/// Returns the share of the recorded rows in which a value is another one than this.
fn recorded_share(evidence: &Evidence, number: usize, value: f32) -> f64 {
    let Some(set) = &evidence.recordings else { return 0.0 };
    let is_same = set.names.is_empty() || set.names == evidence.names;
    let kept =
        set.episodes.iter().filter(|episode| episode.width == evidence.names.len() && is_same && episode.width > 0);
    let (mut rows, mut others) = (0_u64, 0_u64);
    for row in kept.flat_map(|episode| episode.episode.observations.chunks(episode.width)) {
        rows += 1;
        others += u64::from(row[number] != value);
    }
    others as f64 / rows.max(1) as f64
}

/// Returns the statistics of the recorded values, if they are those of the game's sensor.
fn recorded(evidence: &Evidence, width: usize) -> Vec<ColumnStatistics> {
    let Some(set) = &evidence.recordings else { return Vec::new() };
    let is_same = set.names.is_empty() || set.names == evidence.names;
    let kept = set.episodes.iter().filter(|episode| episode.width == width && is_same && width > 0);
    let rows = || kept.clone().flat_map(|episode| episode.episode.observations.chunks(episode.width));
    let mut columns = statistics(rows());
    share_in_sets(&mut columns, &EntitySet::all_in(&evidence.names), rows());
    columns
}

fn not_finite(evidence: &Evidence, columns: &[ColumnStatistics]) -> Vec<LearningFinding> {
    let bad = columns.iter().enumerate().filter(|(_, column)| column.not_finite > 0);
    let names: Vec<String> = bad.map(|(number, _)| evidence.value_name(number)).collect();
    let mut found = Vec::new();
    let told = evidence.faults.iter().find(|fault| fault.contains("not finite") || fault.contains("NaN"));
    if !names.is_empty() || told.is_some() {
        let words = told.cloned().unwrap_or_else(|| format!("{} is NaN or infinite", list(&names)));
        found.push(LearningFinding::new(
            Sign::NotFinite,
            words,
            "a division by 0, a root of a negative number or a value that is not set yet",
            &[Advice::FillObservation],
        ));
    }
    found
}

fn constant(evidence: &Evidence, columns: &[ColumnStatistics]) -> Option<LearningFinding> {
    let sets = EntitySet::all_in(&evidence.names);
    let is_constant = |number: usize| columns[number].is_constant();
    let constants = EntitySet::constant_values(&sets, columns.len(), is_constant);
    let rows = columns.first().map_or(0, |column| column.rows);
    let varied: Vec<usize> = constants
        .iter()
        .copied()
        .filter(|&number| recorded_share(evidence, number, columns[number].min) >= OFTEN)
        .collect();
    let shown = if varied.is_empty() { &constants } else { &varied };
    let names: Vec<String> = shown.iter().map(|&number| evidence.value_name(number)).collect();
    let all = (0..columns.len()).all(is_constant);
    let nearly_all = constants.len() as f64 >= NEARLY_ALL * columns.len() as f64;
    if !nearly_all && varied.is_empty() {
        return None;
    }
    let which = match (all, varied.is_empty()) {
        (true, _) => format!("all {} observed values", columns.len()),
        (false, true) => format!("{} of {} observed values", constants.len(), columns.len()),
        (false, false) => {
            format!("{} of {} observed values, which vary in the recordings", varied.len(), columns.len())
        }
    };
    Some(LearningFinding::new(
        Sign::ConstantObservation,
        format!(
            "{which} are the same in all {} ticks of {} players: {}",
            whole(rows as f64),
            evidence.played.len(),
            list(&names)
        ),
        "the sensor is not filled, reads another entity, or is filled once",
        &[Advice::FillObservation, Advice::ObserveMore],
    ))
}

fn scales(evidence: &Evidence, columns: &[ColumnStatistics]) -> Option<LearningFinding> {
    if evidence.is_normalised() || evidence.names.is_empty() {
        return None;
    }
    let varied = columns.iter().filter(|column| !column.is_constant() && column.size() > 0.0);
    let tiny = varied.clone().filter(|column| column.size() < *FIT.start()).count();
    // A few values that are rarely more than 0 do no harm.
    let are_many_tiny = tiny as f64 > MOST_TINY * varied.count() as f64;
    let is_strange = |column: &ColumnStatistics| {
        let is_tiny = column.size() > 0.0 && column.size() < *FIT.start();
        !column.is_constant() && (column.size() > *FIT.end() || is_tiny && are_many_tiny)
    };
    let strange: Vec<String> = columns
        .iter()
        .enumerate()
        .filter(|(_, column)| is_strange(column))
        .map(|(number, column)| {
            format!("{} (up to {})", evidence.value_name(number), readable(f64::from(column.size())))
        })
        .collect();
    let sizes = columns.iter().filter(|column| !column.is_constant()).map(|column| f64::from(column.size()));
    let (small, large) =
        sizes.fold((f64::INFINITY, 0.0_f64), |(small, large), size| (small.min(size), large.max(size)));
    (!strange.is_empty()).then(|| {
        LearningFinding::new(
            Sign::ObservationScale,
            format!(
                "{} beside values up to {}; no normaliser is on",
                list(&strange),
                readable(if strange.len() == 1 && large > 100.0 { small } else { large })
            ),
            "large values drown small ones in the first layer",
            &[Advice::NormaliseObservations, Advice::ScaleInGame],
        )
    })
}

/// Compares what the demonstrator observes now with what was recorded. A policy may go where no demonstrator goes.
fn not_as_recorded(evidence: &Evidence, recorded: &[ColumnStatistics]) -> Vec<LearningFinding> {
    let now = evidence.played(Seat::Demonstrator);
    let (Some(Played { seat, episodes, .. }), false) = (now, recorded.is_empty()) else { return Vec::new() };
    let (mut beyond, mut values) = (vec![0_usize; recorded.len()], 0_usize);
    let sets = EntitySet::all_in(&evidence.names);
    for row in episodes.iter().flat_map(PlayedEpisode::rows).filter(|row| row.len() == recorded.len()) {
        values += 1;
        for (place, ((count, column), value)) in beyond.iter_mut().zip(recorded).zip(row).enumerate() {
            if sets.iter().any(|set| set.is_absent(place, row)) {
                continue;
            }
            // A value that is rarely recorded lies many deviations from the mean, too.
            let is_known = (column.min..=column.max).contains(value);
            let is_far = (f64::from(*value) - column.mean).abs() > CLIPPED_AT * column.deviation;
            *count += usize::from(is_far && !is_known && column.deviation > 0.0);
        }
    }
    let often = |count: &usize| *count as f64 > MOST_CLIPPED * values as f64;
    let names: Vec<String> = beyond
        .iter()
        .enumerate()
        .filter(|(_, count)| often(count))
        .map(|(number, _)| evidence.value_name(number))
        .collect();
    if names.is_empty() || values < FEWEST_ROWS {
        return Vec::new();
    }
    let most = beyond.iter().max().copied().unwrap_or_default() as f64 / values as f64;
    vec![LearningFinding::new(
        Sign::OtherObservations,
        format!(
            "{}: {} more than {CLIPPED_AT} deviations from the recorded mean, in up to {} of {} of {}",
            list(&names),
            if names.len() == 1 { "lies" } else { "lie" },
            percent(most),
            counted(values as u64, "tick"),
            seat.name()
        ),
        "the sensor has changed since the recording: its units, its order or its meaning",
        &[Advice::RecordAgain, Advice::RaiseVersion],
    )]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{evidence, played};

    fn with_rows(row: impl Fn(usize) -> Vec<f32>) -> Evidence {
        let mut evidence = evidence("ppo", "");
        evidence.names = vec!["x".to_owned(), "speed".to_owned()];
        evidence.played = vec![played(Seat::Random, 100, |tick| (row(tick), 0, 0.0))];
        evidence
    }

    fn signs(evidence: &Evidence) -> Vec<Sign> {
        check(evidence).into_iter().map(|finding| finding.sign).collect()
    }

    #[test]
    fn values_that_vary_within_bounds_are_healthy() {
        assert_eq!(signs(&with_rows(|tick| vec![tick as f32 / 100.0, 1.0 - tick as f32 / 50.0])), []);
        let evidence = with_rows(|tick| vec![tick as f32 / 100.0, 3.0]);
        assert_eq!(signs(&evidence), [], "one value may be constant");
        let note = note_constants(&evidence).expect("a note");
        assert_eq!(note, "1 of 2 observed values are the same in all 100 ticks that were played: `speed`");
    }

    #[test]
    fn nearly_constant_observations_and_clipped_values_are_found() {
        let mut evidence = with_rows(|tick| {
            let mut row = vec![3.0; 40];
            row[7] = tick as f32 / 100.0;
            row
        });
        evidence.names = (0..40).map(|number| format!("v{number}")).collect();
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::ConstantObservation);
        assert!(found[0].evidence.starts_with("39 of 40 observed values are the same"), "{:?}", found[0]);
        let mut evidence = with_rows(|tick| vec![tick as f32 / 100.0, 1.0 - tick as f32 / 50.0]);
        evidence.clipped = Some(vec![0.0, 0.3]);
        assert_eq!(signs(&evidence), []);
        evidence.clipped = Some(vec![0.0, 0.8]);
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::Saturated);
        assert!(found[0].evidence.starts_with("`speed`: lies more than 10 deviations"), "{:?}", found[0]);
    }

    #[test]
    fn a_constant_observation_is_found_with_its_names() {
        let found = check(&with_rows(|_| vec![0.0, 0.0]));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].sign, Sign::ConstantObservation);
        assert!(found[0].evidence.contains("all 2 observed values are the same in all 100 ticks"), "{:?}", found[0]);
        assert!(found[0].evidence.ends_with("`x`, `speed`"), "{:?}", found[0]);
    }

    #[test]
    fn large_values_are_found_unless_they_are_normalised() {
        let mut evidence = with_rows(|tick| vec![tick as f32 / 100.0, tick as f32 * 1000.0]);
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::ObservationScale);
        assert!(found[0].evidence.starts_with("`speed` (up to 99,000) beside values up to 0.99"), "{:?}", found[0]);
        evidence.experiment.ppo.norm_obs = true;
        assert_eq!(signs(&evidence), []);
        let tiny = |tick: usize| tick as f32 * 1e-6;
        assert_eq!(signs(&with_rows(|tick| vec![tiny(tick), tiny(tick)])), [Sign::ObservationScale]);
        let wide = |tick: usize| vec![tick as f32, tick as f32, tick as f32, tiny(tick)];
        assert_eq!(signs(&with_rows(wide)), [], "one of four may be tiny");
    }

    #[test]
    fn values_that_are_not_finite_are_named() {
        let found = check(&with_rows(|tick| vec![tick as f32, if tick == 7 { f32::NAN } else { 1.0 + tick as f32 }]));
        assert_eq!(found[0].sign, Sign::NotFinite);
        assert_eq!(found[0].evidence, "`speed` is NaN or infinite");
    }

    #[test]
    fn slots_that_stay_empty_are_healthy_and_things_share_their_statistics() {
        let mut evidence = with_rows(|tick| vec![tick as f32, 1.0, (tick % 7) as f32, 0.0, 0.0]);
        let slots = bevy_playbot::entities::EntitySlots::new("bee", 2, ["dx"]);
        evidence.names = ["x".to_owned()].into_iter().chain(slots.names()).collect();
        assert_eq!(signs(&evidence), []);
        let rows: [&[f32]; 3] = [&[0.0, 1.0, 2.0, 1.0, 4.0], &[0.0, 1.0, 3.0, 0.0, 0.0], &[0.0; 5]];
        let mut columns = statistics(rows.into_iter());
        share_in_sets(&mut columns, &EntitySet::all_in(&evidence.names), rows.into_iter());
        let of_bees =
            ColumnStatistics { rows: 3, not_finite: 0, min: 2.0, max: 4.0, mean: 3.0, deviation: columns[2].deviation };
        assert_eq!((columns[2], columns[4]), (of_bees, of_bees));
        assert!((columns[2].deviation - (2.0_f64 / 3.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn statistics_are_those_of_each_column() {
        let rows = [[1.0, 5.0], [3.0, 5.0]];
        let columns = statistics(rows.iter().map(<[f32; 2]>::as_slice));
        assert_eq!((columns[0].min, columns[0].max, columns[0].mean, columns[0].deviation), (1.0, 3.0, 2.0, 1.0));
        assert!(columns[1].is_constant() && !columns[0].is_constant());
    }
}
