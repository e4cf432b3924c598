//! Check for common levels of two tests.

use crate::verdict::{Shard, TestRecord};
use playbot_harness::level_files::is_level_files;

/// Returns whether they may have common levels, judged by their ranges: the files of other patterns are known from
/// results only.
pub(super) fn may_have_common_levels(before: &TestRecord, now: &TestRecord) -> bool {
    if is_level_files(&before.range.mode) && is_level_files(&now.range.mode) {
        return true;
    }
    let shard = now.shard.unwrap_or(Shard { index: 0, count: 1 });
    let mut levels = shard.places(now.range.len()).map(|place| now.range.first + place);
    before.range.mode == now.range.mode && levels.any(|level| has(before, level))
}

/// Returns whether a level of the mode is tested.
fn has(record: &TestRecord, level: u64) -> bool {
    let is_mine = |shard: Shard| (level - record.range.first) % shard.count == shard.index;
    (record.range.first..=record.range.last).contains(&level) && record.shard.is_none_or(is_mine)
}

/// Describes the lack of a common level.
pub(super) fn no_common_level(before: &TestRecord, now: &TestRecord) -> String {
    let levels = |record: &TestRecord| match record.shard {
        Some(shard) => format!("shard {shard} of {}", record.range),
        None => record.range.to_string(),
    };
    format!("no level is in {} and in {}", levels(before), levels(now))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::{MapScope, TesterRecord};

    fn record(range: &str, shard: Option<&str>) -> TestRecord {
        TestRecord {
            game: "garden".to_owned(),
            game_version: 1,
            range: range.parse().expect("a split"),
            files: None,
            seed: 0,
            testers: vec![TesterRecord::bot("random")],
            episodes: 1,
            detectors: Vec::new(),
            options: Vec::new(),
            maps: MapScope::default(),
            shard: shard.map(|shard| shard.parse().expect("a shard")),
        }
    }

    #[test]
    fn ranges_and_shards_without_a_common_level_are_told() {
        let may = |one: (&str, Option<&str>), other: (&str, Option<&str>)| {
            may_have_common_levels(&record(one.0, one.1), &record(other.0, other.1))
        };
        assert!(may(("hard:0..9", None), ("hard:9..20", None)));
        assert!(!may(("hard:0..9", None), ("hard:10..20", None)));
        assert!(!may(("hard:0..9", None), ("easy:0..9", None)));
        assert!(may(("hard:0..9", Some("0/2")), ("hard:0..9", None)));
        assert!(!may(("hard:0..9", Some("0/2")), ("hard:0..9", Some("1/2"))));
        assert!(may(("hard:0..9", Some("0/2")), ("hard:1..9", Some("1/2"))), "1 + 1 is in both");
        assert!(may(("files:a/*.json:0..3", None), ("files:a/b.json:0..0", None)), "it is not known yet");
        assert!(!may(("files:a/*.json:0..3", None), ("hard:0..3", None)));
        let words = no_common_level(&record("hard:0..9", Some("0/2")), &record("easy:3..4", None));
        assert_eq!(words, "no level is in shard 0/2 of hard:0..9 and in easy:3..4");
    }
}
