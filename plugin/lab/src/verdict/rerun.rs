//! Commands that show a level of results again.

use super::{level_name::level_argument, level_verdict::LevelVerdict, plan::TestRecord, tester::TesterRecord};
use crate::{detectors::compares_testers, shell_word::shell_word};

/// Largest number of findings that are shown by their files.
const MOST_FILES: usize = 3;
/// Comment on the folder for the replay of findings: their files are named as in the results.
const OF_RESULTS: &str = "# from the folder of the results:";
/// Comment on the folder for all other commands: recordings, policies and level files are named as the test named
/// them.
const OF_TEST: &str = "# from the folder where the test was run:";

/// Returns the commands that replay a level's findings, play its failed episodes again, and show them, for the
/// program of this name. If they belong to different folders, shell comments name these.
pub fn rerun_commands(program: &str, record: &TestRecord, level: &LevelVerdict) -> Vec<String> {
    let files = level.findings.iter().filter_map(|finding| finding.file.as_ref());
    let replays: Vec<String> = files.take(MOST_FILES).map(|file| format!("{program} replay {file}")).collect();
    let again = played_again(program, record, level);
    let [of_results, of_test] = match (replays.is_empty(), again.is_empty()) {
        (true, _) => [None, None],
        (false, true) => [Some(OF_RESULTS), None],
        (false, false) => [Some(OF_RESULTS), Some(OF_TEST)],
    };
    let comment = |words: Option<&str>| words.map(str::to_owned);
    comment(of_results).into_iter().chain(replays).chain(comment(of_test)).chain(again).collect()
}

/// Returns the command for the episodes of the tester that has a finding or else failed, if any. If the finding
/// compares testers, the command is for all of them. Adds a picture if the tester repeats itself exactly.
fn played_again(program: &str, record: &TestRecord, level: &LevelVerdict) -> Vec<String> {
    let found = level.findings.iter().find_map(|finding| finding.tester.as_ref());
    let failed = || level.testers.iter().find(|tester| tester.score.solved < tester.score.episodes);
    let Some(name) = found.or_else(|| failed().map(|tester| &tester.tester)) else { return Vec::new() };
    let Some(tester) = record.testers.iter().find(|tester| tester.name == *name) else { return Vec::new() };
    let compares = level.findings.iter().any(|finding| compares_testers(&finding.detector));
    let played = if compares { testers(&record.testers) } else { testers(std::slice::from_ref(tester)) };
    let shown = seen(tester);
    let (game, seed, episodes) = (&record.game, record.seed, record.episodes);
    let levels = level_argument(&record.range, &level.level);
    let detectors: String = record.options.iter().map(|word| format!(" {}", shell_word(word))).collect();
    // The same episodes: they depend on seed, tester and level alone.
    let again = format!(
        "{program} test {game} --levels {levels} {played} --episodes {episodes} --seed {seed}{detectors} --out again"
    );
    // A tester that draws random numbers draws others in a picture.
    let exact = level.testers.iter().any(|tester| tester.tester == *name && tester.exact);
    let picture = format!("{program} view {game} --levels {levels} {shown} --episode --out again.png");
    [again].into_iter().chain(exact.then_some(picture)).collect()
}

/// Returns the testers as arguments of `playbot test`. The draws of a policy depend on its name, so the name is
/// included.
fn testers(testers: &[TesterRecord]) -> String {
    let bots: Vec<&str> =
        testers.iter().filter(|tester| tester.checksum.is_none()).map(|tester| tester.name.as_str()).collect();
    let bots = (!bots.is_empty()).then(|| format!("--bot {}", bots.join(",")));
    let policies = testers.iter().filter(|tester| tester.checksum.is_some() && tester.run.is_none());
    let policies = policies.map(|TesterRecord { name, file, .. }| {
        let given = file.as_ref().map_or_else(|| name.clone(), |file| format!("{name}={file}"));
        format!("--policy {}", shell_word(&given))
    });
    let greedy = testers.iter().any(|tester| tester.greedy).then(|| "--greedy".to_owned());
    bots.into_iter().chain(policies).chain(runs(testers)).chain(greedy).collect::<Vec<_>>().join(" ")
}

/// Returns the arguments for runs among testers. One checkpoint applies to all, so runs with different checkpoints
/// get none.
fn runs(testers: &[TesterRecord]) -> Vec<String> {
    let runs: Vec<_> = testers.iter().filter_map(|tester| tester.run.as_ref()).collect();
    let folders = runs.iter().map(|run| format!("--run {}", shell_word(&run.folder)));
    let step = runs.first().map(|run| run.step).filter(|step| runs.iter().all(|run| run.step == *step));
    folders.chain(step.map(|step| format!("--checkpoint {step}"))).collect()
}

/// Returns a tester as an argument of `playbot view`, which takes the files of policies only.
fn seen(tester: &TesterRecord) -> String {
    let unnamed =
        TesterRecord { name: tester.file.clone().unwrap_or_else(|| tester.name.clone()), file: None, ..tester.clone() };
    testers(&[unnamed])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::{
        Finding, MapScope, TestedRun, TesterRecord,
        testing::{tester, verdict},
    };

    #[test]
    fn runs_are_named_by_their_folders_with_the_checkpoint_that_they_share() {
        let run = |folder: &str, step| TesterRecord {
            checksum: Some("0f".to_owned()),
            run: Some(TestedRun { folder: folder.to_owned(), step }),
            ..TesterRecord::bot(folder.rsplit('/').next().expect("a name"))
        };
        let [first, second] = [run("my runs/a", 4096), run("runs/b", 8192)];
        assert_eq!(testers(std::slice::from_ref(&first)), "--run 'my runs/a' --checkpoint 4096");
        assert_eq!(seen(&first), "--run 'my runs/a' --checkpoint 4096");
        let all = [TesterRecord::bot("random"), TesterRecord { greedy: true, ..first }, second];
        assert_eq!(testers(&all), "--bot random --run 'my runs/a' --run runs/b --greedy", "no checkpoint is theirs");
    }

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
            options: Vec::new(),
            maps: MapScope::default(),
            shard: None,
        };
        let testers = vec![tester("random", 2, 2, true), tester("ppo.policy", 1, 2, true)];
        let level = LevelVerdict { level: "bed:6".to_owned(), testers, ..verdict(1, 3, 4) };
        let again = "jump test garden --levels bed:6 --policy ppo.policy --greedy --episodes 2 --seed 3 --out again";
        let shown = "jump view garden --levels bed:6 --policy ppo.policy --greedy --episode --out again.png";
        assert_eq!(rerun_commands("jump", &record, &level), [again, shown]);
        let mut named = record.clone();
        named.testers[1].file = Some("my runs/a.policy".to_owned());
        let again = again.replace("ppo.policy", "'ppo.policy=my runs/a.policy'");
        let shown = shown.replace("ppo.policy", "'my runs/a.policy'");
        assert_eq!(rerun_commands("jump", &named, &level), [again.clone(), shown.clone()]);
        named.options = ["--no-detect", "stuck", "--par", "my pars.json"].map(str::to_owned).to_vec();
        let again = again.replace(" --out", " --no-detect stuck --par 'my pars.json' --out");
        assert_eq!(rerun_commands("jump", &named, &level), [again, shown]);
        let mut drawn = level.clone();
        drawn.testers[1].exact = false;
        assert_eq!(rerun_commands("jump", &named, &drawn).len(), 1, "a picture would show another episode");
        let farmed = Finding {
            detector: "reward-farm".to_owned(),
            tester: Some("random".to_owned()),
            episode: Some(1),
            tick: Some(9),
            message: "paid for nothing".to_owned(),
            file: None,
            settings: Vec::new(),
        };
        let compared = LevelVerdict { findings: vec![farmed], ..level.clone() };
        let again = "jump test garden --levels bed:6 --bot random --policy ppo.policy --greedy --episodes 2 --seed 3 --out again";
        let shown = "jump view garden --levels bed:6 --bot random --episode --out again.png";
        assert_eq!(rerun_commands("jump", &record, &compared), [again, shown], "all are compared");
        let perfect = LevelVerdict { testers: vec![tester("random", 2, 2, false)], ..verdict(1, 2, 2) };
        assert!(rerun_commands("jump", &record, &perfect).is_empty());
        let finding = |name: &str| Finding {
            detector: "unreachable-goal".to_owned(),
            tester: None,
            episode: None,
            tick: None,
            message: "walled in".to_owned(),
            file: Some(format!("findings/{name}.finding")),
            settings: Vec::new(),
        };
        let findings = ["a", "b", "c", "d"].map(finding).to_vec();
        let walled = LevelVerdict { findings, ..perfect };
        let shown = ["a", "b", "c"].map(|name| format!("jump replay findings/{name}.finding"));
        let commands = rerun_commands("jump", &record, &walled);
        assert_eq!((commands[0].as_str(), &commands[1..]), (OF_RESULTS, &shown[..]), "three of them");
        let failed = LevelVerdict { testers: level.testers.clone(), ..walled };
        let commands = rerun_commands("jump", &record, &failed);
        assert_eq!(commands[1..4], shown);
        assert_eq!(commands[4], OF_TEST);
        assert!(commands[5].starts_with("jump test garden ") && commands[6].starts_with("jump view garden "));
    }
}
