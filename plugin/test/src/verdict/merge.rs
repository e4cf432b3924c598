//! Joining of the results of shards.

use crate::{
    findings::gather_findings,
    verdict::{
        error::{TestError, io_error},
        plan::TestRecord,
        results::{RESULTS, ResultLines, ResultWriter},
        shard::Shard,
    },
};
use playbot_learner::{disk, write_atomically_with};
use std::{
    io,
    path::{Path, PathBuf},
};

/// Joins the results of all shards of a test into `out`, given their folders in any order. The result has the same
/// bytes as the results of the whole test. Levels are not kept in memory. The files of their findings are copied.
///
/// # Errors
///
/// A folder has no results, shards overlap or are missing, or their tests differ; or `out` cannot be written.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<(), TestError> {
    let mut shards = Vec::new();
    for folder in folders {
        // Heads are compared before levels are read.
        let lines = ResultLines::open_whole(folder)?;
        let shard = lines.record().shard.ok_or_else(|| TestError::NotAShard(folder.clone()))?;
        shards.push((folder, shard, lines));
    }
    // Facts from the first folder must not depend on the order of the folders.
    let Some((first, count, record)) = shards
        .iter()
        .min_by_key(|(_, shard, _)| shard.index)
        .map(|(folder, shard, lines)| (*folder, shard.count, TestRecord { shard: None, ..lines.record().clone() }))
    else {
        return Err(TestError::Missing(Vec::new()));
    };
    for (index, (folder, shard, lines)) in shards.iter().enumerate() {
        let mut differences = record.differences(lines.record());
        if shard.count != count {
            differences.push(format!("{count} and {} shards", shard.count));
        }
        if !differences.is_empty() {
            return Err(TestError::Unlike { first: first.clone(), second: (*folder).clone(), differences });
        }
        if let Some((other, ..)) = shards[..index].iter().find(|(_, other, _)| other == shard) {
            return Err(TestError::Overlap { first: (*other).clone(), second: (*folder).clone(), shard: *shard });
        }
    }
    // A range with fewer levels than shards has empty shards, which have no results.
    let wanted = count.min(record.range.len());
    let is_there = |index: u64| shards.iter().any(|(_, shard, _)| shard.index == index);
    let missing: Vec<Shard> =
        (0..wanted).filter(|index| !is_there(*index)).map(|index| Shard { index, count }).collect();
    if !missing.is_empty() {
        return Err(TestError::Missing(missing));
    }
    shards.sort_by_key(|(_, shard, _)| shard.index);
    let mut lines: Vec<ResultLines> = shards.into_iter().map(|(_, _, lines)| lines).collect();
    write_joined(&record, count, &mut lines, out)?;
    Ok(gather_findings(folders, out)?)
}

fn write_joined(record: &TestRecord, count: u64, shards: &mut [ResultLines], out: &Path) -> Result<(), TestError> {
    let is_new = !out.exists();
    disk::create_dir_all(out).map_err(io_error("create", out))?;
    let path = out.join(RESULTS);
    // The writer's errors are the system's only.
    let mut damaged = None;
    let written = write_atomically_with(&path, |file| {
        let mut set_aside = |error: TestError| {
            damaged = Some(error);
            io::Error::other("a shard is damaged")
        };
        let mut results = ResultWriter::begin(file, record)?;
        for index in 0..record.range.len() {
            let line = shards[(index % count) as usize].line_of(index).map_err(&mut set_aside)?;
            results.push(&line)?;
        }
        // The checksum of the joined file must cover checked content only.
        shards.iter_mut().try_for_each(ResultLines::expect_end).map_err(&mut set_aside)?;
        results.end()
    });
    let written = match (written, damaged) {
        (_, Some(error)) => Err(error),
        (written, None) => written.map_err(io_error("write", &path)),
    };
    if written.is_err() && is_new {
        // A folder that is not empty stays; the earlier error is the one to report.
        let _ = disk::remove_dir(out);
    }
    written
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::verdict::{
        folder::{Earlier, TestFolder},
        testing,
        testing::verdict,
    };

    fn record(shard: Option<&str>) -> TestRecord {
        TestRecord { shard: shard.map(|shard| shard.parse().expect("a shard")), ..testing::record("hard:0..10") }
    }

    /// Makes the results of a test, in the folder of this name.
    fn tested(parent: &Path, name: &str, record: &TestRecord) -> PathBuf {
        let path = parent.join(name);
        let (mut folder, _) = TestFolder::open(&path, record, Earlier::Keep).expect("new");
        let all = record.range.len();
        let places: Vec<u64> = record.shard.map_or_else(|| (0..all).collect(), |shard| shard.places(all).collect());
        for index in places.into_iter().rev() {
            folder.keep(&verdict(index, index % 2, 1)).expect("writable");
        }
        folder.finish().expect("writable");
        path
    }

    fn results(folder: &Path) -> Vec<u8> {
        fs::read(folder.join(RESULTS)).expect("results")
    }

    #[test]
    fn joined_shards_are_the_whole_to_the_byte() {
        let parent = tempfile::tempdir().expect("a folder");
        let whole = tested(parent.path(), "whole", &record(None));
        for count in [1, 2, 7, 11] {
            let mut folders: Vec<PathBuf> = (0..count)
                .map(|index| {
                    let shard = format!("{index}/{count}");
                    tested(parent.path(), &shard.replace('/', "-of-"), &record(Some(&shard)))
                })
                .collect();
            folders.reverse();
            let out = parent.path().join(format!("joined {count}"));
            merge(&folders, &out).expect("all are there");
            assert!(results(&out) == results(&whole), "{count} shards");
        }
    }

    #[test]
    fn what_does_not_belong_together_is_named() {
        let parent = tempfile::tempdir().expect("a folder");
        let folder = |name: &str, record: &TestRecord| tested(parent.path(), name, record);
        let (zero, one) = (folder("zero", &record(Some("0/3"))), folder("one", &record(Some("1/3"))));
        let (again, whole) = (folder("again", &record(Some("1/3"))), folder("whole", &record(None)));
        let newer = folder("newer", &TestRecord { game_version: 2, ..record(Some("2/3")) });
        let half = folder("half", &record(Some("1/2")));
        let said = |folders: &[&PathBuf]| {
            let folders: Vec<PathBuf> = folders.iter().map(|folder| (*folder).clone()).collect();
            merge(&folders, &parent.path().join("out")).expect_err("they do not fit").to_string()
        };
        for (words, parts) in [
            (said(&[&zero, &one]), ["missing shard 2/3", "--shard"]),
            (said(&[&zero, &one, &again]), ["one and ", "again overlap: both are shard 1/3"]),
            (said(&[&zero, &whole]), ["whole holds results of a whole range", "not of a shard"]),
            (said(&[&zero, &one, &newer]), ["newer cannot be joined", "versions 1 and 2 of `garden`"]),
            (said(&[&zero, &half]), ["half cannot be joined", "3 and 2 shards"]),
            (said(&[&parent.path().join("none")]), ["none has no results.json", "playbot test"]),
        ] {
            assert!(parts.iter().all(|part| words.contains(part)), "{words}");
        }
        // Older versions wrote no checksum.
        let text = String::from_utf8(results(&one)).expect("text").replace("\"index\":4", "\"index\":5");
        let (levels, _) = text.rsplit_once("],").expect("an end");
        fs::write(one.join(RESULTS), format!("{levels}]}}\n")).expect("writable");
        let two = folder("two", &record(Some("2/3")));
        let words = said(&[&zero, &one, &two]);
        assert!(words.contains("results.json, line 3: this is not the level with index 4"), "{words}");
        assert!(!parent.path().join("out").exists(), "nothing is half there");
    }

    /// Makes two shards of two levels, and the results of the second one.
    fn two_shards(parent: &Path) -> (Vec<PathBuf>, Vec<u8>) {
        let shard = |name: &str, shard: &str| {
            let range = "hard:0..1".parse().expect("a split");
            tested(parent, name, &TestRecord { range, ..record(Some(shard)) })
        };
        let folders = vec![shard("zero", "0/2"), shard("one", "1/2")];
        let whole = results(&folders[1]);
        (folders, whole)
    }

    #[test]
    fn no_flipped_bit_gets_a_new_checksum() {
        let parent = tempfile::tempdir().expect("a folder");
        let (folders, whole) = two_shards(parent.path());
        let (damaged, out) = (folders[1].join(RESULTS), parent.path().join("out"));
        for at in 0..whole.len() * 8 {
            let mut bytes = whole.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            fs::write(&damaged, bytes).expect("writable");
            let error = merge(&folders, &out).expect_err("damaged").to_string();
            assert!(error.contains("one") && !out.exists(), "bit {at}: {error}");
        }
        fs::write(&damaged, &whole).expect("writable");
        merge(&folders, &out).expect("sound again");
    }

    #[test]
    fn no_part_of_a_shard_is_taken_for_whole() {
        let parent = tempfile::tempdir().expect("a folder");
        let (folders, whole) = two_shards(parent.path());
        // Without the last line feed nothing is missing.
        for length in 0..whole.len() - 1 {
            fs::write(folders[1].join(RESULTS), &whole[..length]).expect("writable");
            let error = merge(&folders, &parent.path().join("out")).expect_err("cut off").to_string();
            assert!(error.contains(RESULTS) && !parent.path().join("out").exists(), "{length}: {error}");
        }
    }

    #[test]
    fn a_shard_with_more_levels_than_it_says_is_refused() {
        let parent = tempfile::tempdir().expect("a folder");
        let (folders, _) = two_shards(parent.path());
        let record = TestRecord { range: "hard:0..1".parse().expect("a split"), ..record(Some("1/2")) };
        let (mut folder, _) = TestFolder::open(&folders[1], &record, Earlier::Replace).expect("there");
        [1, 3].iter().for_each(|index| folder.keep(&verdict(*index, 1, 1)).expect("writable"));
        folder.finish().expect("writable");
        drop(folder);
        let error = merge(&folders, &parent.path().join("out")).expect_err("too many").to_string();
        assert!(error.contains("results.json, line 3: there are more levels than were tested"), "{error}");
        assert!(!parent.path().join("out").exists());
    }
}
