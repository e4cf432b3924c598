//! Tests of little memory and of settings that need more than there is: refused before any work, with the setting's
//! name.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::Mutex,
    thread,
};

use crate::program::{code, errors};

/// Limits in bytes.
const LIMITS: [u64; 3] = [500_000_000, 600_000_000, 1_000_000_000];
/// Programs that run at a time.
const AT_ONCE: usize = 2;

/// Settings of experiments, and the faulty key. Several settings stand beside one another.
const SETTINGS: [(&str, &str); 57] = [
    ("ppo.hidden=[18446744073709551615]", "ppo.hidden"),
    ("ppo.hidden=[4294967295]", "ppo.hidden"),
    ("ppo.hidden=[1000000,1000000]", "ppo.hidden"),
    ("ppo.hidden=[65536,65536]", "ppo.hidden"),
    ("algorithm=ppo ppo.hidden=[18446744073709551615,18446744073709551615]", "ppo.hidden"),
    ("ppo.num_steps=18446744073709551615", "ppo.num_steps"),
    ("ppo.num_steps=16777216", "ppo.num_steps"),
    ("ppo.num_steps=1048576 ppo.minibatches=1", "ppo.minibatches"),
    ("ppo.minibatches=18446744073709551615", "ppo.minibatches"),
    ("ppo.epochs=18446744073709551615", "ppo.epochs"),
    ("arenas=4294967295", "arenas"),
    ("arenas=4294967295 worlds=4294967295", "worlds"),
    ("arenas=100000 worlds=100000", "worlds"),
    ("arenas=1000000 ppo.num_steps=1000000", "arenas"),
    ("worlds=4294967295", "worlds"),
    ("steps=18446744073709551615", "steps"),
    ("skills.latent=18446744073709551615", "skills.latent"),
    ("skills.latent=4294967295", "skills.latent"),
    ("skills.latent=100000000", "skills.latent"),
    ("skills.gru_hidden=18446744073709551615", "skills.gru_hidden"),
    ("skills.gru_hidden=4294967295", "skills.gru_hidden"),
    ("skills.gru_hidden=100000", "skills.gru_hidden"),
    ("skills.gru_layers=18446744073709551615", "skills.gru_layers"),
    ("skills.gru_layers=4294967295", "skills.gru_layers"),
    ("skills.gru_layers=1000000", "skills.gru_layers"),
    ("skills.hidden=[18446744073709551615,18446744073709551615]", "skills.hidden"),
    ("skills.hidden=[4294967295]", "skills.hidden"),
    ("skills.hidden=[100000,100000]", "skills.hidden"),
    ("skills.encoder_hidden=18446744073709551615", "skills.encoder_hidden"),
    ("skills.encoder_hidden=4294967295", "skills.encoder_hidden"),
    ("skills.encoder_hidden=1000000", "skills.encoder_hidden"),
    ("skills.batch=18446744073709551615", "skills.batch"),
    ("skills.batch=4294967295", "skills.batch"),
    ("skills.window=18446744073709551615", "skills.window"),
    ("skills.window=1000000 skills.batch=1000000", "skills.window"),
    ("skills.epochs=18446744073709551615", "skills.epochs"),
    ("algorithm=sac sac.batch=18446744073709551615", "sac.batch"),
    ("algorithm=sac sac.batch=4294967295", "sac.batch"),
    ("algorithm=sac sac.batch=1000000", "sac.batch"),
    ("algorithm=sac sac.buffer=18446744073709551615 steps=9007199254740992", "sac.buffer"),
    ("algorithm=sac sac.buffer=1000000000 steps=1000000000", "sac.buffer"),
    ("algorithm=sac sac.hidden=[18446744073709551615]", "sac.hidden"),
    ("algorithm=sac sac.hidden=[100000,100000]", "sac.hidden"),
    ("algorithm=sac sac.critics=18446744073709551615", "sac.critics"),
    ("algorithm=sac sac.critics=1000000", "sac.critics"),
    ("algorithm=sac sac.num_steps=18446744073709551615", "sac.num_steps"),
    ("algorithm=sac sac.num_steps=1000000000", "sac.num_steps"),
    ("algorithm=sac sac.updates_per_step=1e300", "sac.updates_per_step"),
    ("algorithm=sac sac.buffer=20000000 steps=20000000", "sac.buffer"),
    ("algorithm=rlpd rlpd.critics=18446744073709551615", "rlpd.critics"),
    ("algorithm=rlpd rlpd.critics=1000000", "rlpd.critics"),
    ("algorithm=ppo observation=Raster image.width=1024 image.height=1024 image.stack=16", "image.width"),
    ("algorithm=ppo observation=Raster image.width=4294967295", "image.width"),
    ("algorithm=ppo observation=Raster image.stack=4294967295", "image.stack"),
    ("eval.episodes_per_level=18446744073709551615", "eval.episodes_per_level"),
    ("test=hard:64..4294967295", "test"),
    ("train=hard:0..18446744073709551615", "train"),
];

/// Whole commands, and the name in the error.
const COMMANDS: [(&str, &str); 6] = [
    ("eval --bot random --levels hard:0..16777215 --episodes-per-level 4294967295", "eval.episodes_per_level"),
    ("eval --bot random --levels hard:0..9 --episodes-per-level 4294967295", "eval.episodes_per_level"),
    ("eval --bot random --levels hard:0..4294967295", "--levels"),
    ("test coinrun --levels hard:0..9 --episodes 4294967295 --out tested", "episodes"),
    ("test coinrun --levels hard:0..18446744073709551615 --out tested", "--levels"),
    ("view coinrun --image width=1024 --image height=1024 --image stack=16 --episode --scale 32", "--scale"),
];

/// Returns all of it as command lines. Settings are printed as often as they are trained with, and are refused both
/// times.
fn calls() -> Vec<(String, &'static str)> {
    let settings = SETTINGS.iter().enumerate().map(|(index, (sets, key))| {
        let verb = if index % 2 == 0 { "config show" } else { "train --run run" };
        let sets: String = sets.split(' ').flat_map(|set| [" --set ", set]).collect();
        (verb.to_owned() + &sets, *key)
    });
    settings.chain(COMMANDS.iter().map(|(line, name)| ((*line).to_owned(), *name))).collect()
}

/// Does `each` for all calls, on two threads.
fn for_all_calls(each: impl Fn(&str, &str) + Sync) {
    let left = Mutex::new(calls());
    let next = || left.lock().expect("no thread panics while it is locked").pop();
    let work = || {
        while let Some((line, name)) = next() {
            each(&line, name);
        }
    };
    thread::scope(|scope| (0..AT_ONCE).for_each(|_| drop(scope.spawn(work))));
}

/// Runs the program behind another command of the shell, and checks that it refuses in plain words.
fn assert_refused(before: &str, line: &str, name: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    // Words are passed as arguments and not written into the shell's line, where brackets have a meaning.
    let script = format!("{before} && exec \"$@\"");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_playbot")]).args(line.split(' ')).current_dir(folder.path());
    let output = playbot_shell::output(&mut shell).unwrap_or_else(|error| panic!("{before}; {line}: {error}"));
    let words = errors(&output);
    let what = format!("{before}; {line}: {:?}: {words}", output.status);
    assert!(output.status.code().is_some(), "a signal has ended it: {what}");
    assert_eq!(code(&output), 3, "{what}");
    assert!(words.contains(name), "`{name}` is not named: {what}");
    for crash in ["memory allocation of", "panicked", "capacity overflow", "backtrace", "a bug"] {
        assert!(!words.contains(crash), "{what}");
    }
    assert!(words.len() < 2000, "{what}");
    let left: Vec<PathBuf> = fs::read_dir(folder.path()).expect("there").flatten().map(|entry| entry.path()).collect();
    assert!(left.is_empty(), "something was begun: {left:?}: {what}");
}

#[test]
fn settings_that_ask_for_more_than_a_limit_leaves_are_refused_by_name() {
    assert!(calls().len() >= 60, "{}", calls().len());
    for limit in LIMITS {
        let before = format!("ulimit -v {}", limit / 1024);
        for_all_calls(|line, name| assert_refused(&before, line, name));
    }
}

/// A control group below the one that `PLAYBOT_CGROUP` names, removed on drop.
struct Group(PathBuf);

impl Group {
    /// Makes a group with a limit, if permitted.
    fn new(limit: u64) -> Result<Self, String> {
        let above = std::env::var_os("PLAYBOT_CGROUP").ok_or("PLAYBOT_CGROUP names no control group for children")?;
        let path = Path::new(&above).join(format!("playbot-test-{}", std::process::id()));
        fs::create_dir(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let group = Self(path);
        let file = group.0.join("memory.max");
        if !file.exists() {
            return Err("it does not limit memory".to_owned());
        }
        fs::write(&file, limit.to_string()).map_err(|error| format!("{}: {error}", file.display()))?;
        Ok(group)
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        // The kernel's files go with the folder.
        let _ = fs::remove_dir(&self.0);
    }
}

#[test]
fn settings_that_ask_for_more_than_a_control_group_has_are_refused_by_name() {
    for limit in LIMITS {
        let group = match Group::new(limit) {
            Ok(group) => group,
            Err(why) => {
                eprintln!("skipped: no control group can be made: {why}");
                return;
            }
        };
        let before = format!("echo $$ > {}/cgroup.procs", group.0.display());
        for_all_calls(|line, name| assert_refused(&before, line, name));
    }
}
