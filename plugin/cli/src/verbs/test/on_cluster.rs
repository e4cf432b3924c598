//! Tests whose shards other machines play.

use crate::{
    error::{CliError, Outcome},
    verbs::{
        history::{add_results, check_history},
        test::{
            Args,
            results::{Results, join_shards},
        },
    },
};
use playbot_learner::disk;
use playbot_test::verdict::{RESULTS, TestPlan};
use std::{
    env,
    ffi::{OsStr, OsString},
    path::PathBuf,
};

/// Options of the whole test that a shard does not get, each with whether it has a value.
const OF_THE_WHOLE: [(&str, bool); 14] = [
    ("--cluster", true),
    ("--workers", true),
    ("--worker-program", true),
    ("--shards", true),
    ("--threads", true),
    ("--out", true),
    ("--against", true),
    ("--history", true),
    ("--build", true),
    ("--resume", false),
    ("--force", false),
    ("--split", false),
    ("--json", false),
    ("--verbose", false),
];

/// Tests by the shards of a cluster, joins them, and reports the whole.
pub(super) fn run(args: &Args, plan: &TestPlan, results: &Results<'_>) -> Result<Outcome, CliError> {
    let (out, shards) = (results.folder, results.folder.join("shards"));
    if !args.resume && !args.force && (shards.exists() || out.join(RESULTS).exists()) {
        return Err(CliError::Usage(format!(
            "{} has results already: go on with --resume, replace them with --force, or choose another --out",
            out.display()
        )));
    }
    if args.force && shards.exists() {
        disk::remove_dir_all(&shards)
            .map_err(|error| CliError::Io(format!("{} cannot be removed: {error}", shards.display())))?;
    }
    if let (Some(file), Some(game)) = (&args.history, results.game) {
        check_history(file, game)?;
    }
    let count = (args.shards as usize).min(plan.places().len()).max(1);
    let mut words = vec!["--shards".into(), count.to_string().into(), "--out".into(), out.into(), "--".into()];
    words.extend(of_a_shard(env::args_os().skip(1)));
    match args.cluster.run_by_ray("test", words)? {
        Some(0) | None => {}
        Some(130) => return Ok(Outcome::Stopped),
        Some(code) => {
            let words = "not all shards are tested, as said above: go on with the same command and --resume".to_owned();
            return Err(if code == 3 { CliError::Usage(words) } else { CliError::Io(words) });
        }
    }
    let folders: Vec<PathBuf> = (0..count).map(|shard| shards.join(shard.to_string())).collect();
    let outcome = join_shards(&folders, results)?;
    if let (Some(file), Some(game)) = (&args.history, results.game) {
        add_results(file, out, game, args.build.as_deref())?;
    }
    Ok(outcome)
}

/// Returns the words of a command without the options of the whole test.
fn of_a_shard(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut kept = Vec::new();
    let mut is_value = false;
    for word in words {
        if std::mem::take(&mut is_value) {
            continue;
        }
        let (name, value) = match word.to_str().and_then(|word| word.split_once('=')) {
            Some((name, value)) => (OsStr::new(name), Some(value)),
            None => (word.as_os_str(), None),
        };
        match OF_THE_WHOLE.iter().find(|(option, _)| name == *option) {
            Some((_, has_value)) => is_value = *has_value && value.is_none(),
            None => kept.push(word),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_gets_the_options_of_the_test_alone() {
        let shard = |words: &str| {
            let kept = of_a_shard(words.split(' ').map(OsString::from));
            kept.iter().map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(
            shard("test coinrun --levels hard:0..9 --out a --cluster ray --workers 3 --resume --bot random --json"),
            "test coinrun --levels hard:0..9 --bot random"
        );
        assert_eq!(shard("test --out=a --bot=random --shards=4 --seed 3"), "test --bot=random --seed 3");
    }
}
