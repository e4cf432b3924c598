//! How a level is looked at again.

use super::{level_name::level_argument, level_verdict::LevelVerdict, plan::TestRecord};

/// Most findings that are shown by their files.
const MOST_FILES: usize = 3;

/// The commands that show a level's findings in the folder of the results, play its failed episodes again, and show them: for
/// people, of the program with this name.
pub fn rerun_commands(program: &str, record: &TestRecord, level: &LevelVerdict) -> Vec<String> {
    let files = level.findings.iter().filter_map(|finding| finding.file.as_ref());
    let mut commands: Vec<String> = files.take(MOST_FILES).map(|file| format!("{program} replay {file}")).collect();
    commands.extend(played_again(program, record, level));
    commands
}

/// The episodes of a tester that failed, if one did.
fn played_again(program: &str, record: &TestRecord, level: &LevelVerdict) -> Vec<String> {
    let found = level.findings.iter().find_map(|finding| finding.tester.as_ref());
    let failed = || level.testers.iter().find(|tester| tester.score.solved < tester.score.episodes);
    let Some(name) = found.or_else(|| failed().map(|tester| &tester.tester)) else { return Vec::new() };
    let Some(tester) = record.testers.iter().find(|tester| tester.name == *name) else { return Vec::new() };
    let who = match tester.checksum {
        Some(_) => format!("--policy {name}{}", if tester.greedy { " --greedy" } else { "" }),
        None => format!("--bot {name}"),
    };
    let (game, seed, episodes) = (&record.game, record.seed, record.episodes);
    let levels = level_argument(&record.range, &level.level);
    // The same episodes: they depend on seed, tester and level alone.
    let again =
        format!("{program} test {game} --levels {levels} {who} --episodes {episodes} --seed {seed} --out again");
    let shown = format!("{program} view {game} --levels {levels} {who} --episode --out again.png");
    vec![again, shown]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::{
        Finding, MapScope, TesterRecord,
        testing::{tester, verdict},
    };

    #[test]
    fn the_tester_that_failed_plays_again() {
        let trained = TesterRecord { checksum: Some("0f".to_owned()), greedy: true, ..TesterRecord::bot("ppo.policy") };
        let record = TestRecord {
            game: "garden".to_owned(),
            game_version: 1,
            range: "bed:5..9".parse().expect("a split"),
            files: None,
            seed: 3,
            testers: vec![TesterRecord::bot("random"), trained],
            episodes: 2,
            detectors: Vec::new(),
            maps: MapScope::default(),
            shard: None,
        };
        let testers = vec![tester("random", 2, 2, false), tester("ppo.policy", 1, 2, false)];
        let level = LevelVerdict { level: "bed:6".to_owned(), testers, ..verdict(1, 3, 4) };
        let again = "jump test garden --levels bed:6 --policy ppo.policy --greedy --episodes 2 --seed 3 --out again";
        let shown = "jump view garden --levels bed:6 --policy ppo.policy --greedy --episode --out again.png";
        assert_eq!(rerun_commands("jump", &record, &level), [again, shown]);
        let perfect = LevelVerdict { testers: vec![tester("random", 2, 2, false)], ..verdict(1, 2, 2) };
        assert!(rerun_commands("jump", &record, &perfect).is_empty());
        let finding = |name: &str| Finding {
            detector: "unreachable-goal".to_owned(),
            tester: None,
            episode: None,
            tick: None,
            message: "walled in".to_owned(),
            file: Some(format!("findings/{name}.finding")),
        };
        let findings = ["a", "b", "c", "d"].map(finding).to_vec();
        let walled = LevelVerdict { findings, ..perfect };
        let shown = ["a", "b", "c"].map(|name| format!("jump replay findings/{name}.finding"));
        assert_eq!(rerun_commands("jump", &record, &walled), shown, "three of them");
    }
}
