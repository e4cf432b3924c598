//! Tests that work of every kind, killed at random times and resumed, comes to the same bytes as undisturbed work.
//! `tests/soak/kills` does the same a hundred times, with longer work.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Stdio,
    thread,
    time::{Duration, Instant},
};

use playbot_shell::kill;

use crate::{
    dice::Dice,
    program::{code, command, done, errors, playbot},
};

/// Number of kills, and largest number of works for them: some are done before they are killed.
const KILLS: usize = 12;
const MOST_WORKS: usize = 40;
/// Levels of a recording.
const LEVELS: usize = 200;

const EXPERIMENT: &str = r#"(
    game: "coinrun", train: "hard:0..7", test: "hard:64..71", demos: "few.demo", steps: 4096, arenas: 8, worlds: 2,
    variants: [(name: "ppo", set: ["algorithm=ppo"]), (name: "score-ppo", set: ["steps=2048"])],
    skills: (window: 5, epochs: 8, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 32, minibatches: 4, hidden: [32, 32]),
    sac: (num_steps: 32, learning_starts: 256, updates_per_step: 0.02, batch: 32, hidden: [16, 16], buffer: 4096),
    rlpd: (critics: 3),
    checkpoints: (every: 3, keep: 2),
)"#;

/// A kind of work.
struct Work {
    begin: String,
    /// The command that resumes it; empty if it is begun again.
    go_on: String,
    /// The beginning and the end of the path of a file that appears with the first save.
    saved: (&'static str, &'static str),
}

fn works() -> Vec<Work> {
    let training = |(algorithm, skills): (&str, &str)| Work {
        begin: format!("train --experiment small.ron --algorithm {algorithm} --run run{skills}"),
        go_on: "train --run run --resume".to_owned(),
        saved: ("run/checkpoints/step-", "summary.json"),
    };
    let with = " --skills skills";
    let remembering = " --skills skills --set ppo.memory=Gru(hidden:8)";
    let trainings =
        [("score-ppo", with), ("ppo", ""), ("score-sac", with), ("sac", ""), ("spirl-ppo", remembering), ("rlpd", "")];
    let work = |begin: &str, go_on: &str, saved| Work {
        begin: begin.to_owned(),
        go_on: if go_on.is_empty() { String::new() } else { format!("{begin} {go_on}") },
        saved,
    };
    let others = [
        work("learn-skills --experiment small.ron --out learned", "--resume", ("learned.checkpoint", "")),
        work("study --experiment small.ron --seeds 1 --out out --runs runs", "--resume", ("runs/", "run.json")),
        work("policy export --run trained --out bot.policy", "", ("", "")),
        work(&format!("record coinrun --levels easy:0..{} --out all.demo", LEVELS - 1), "", ("", "")),
    ];
    trainings.into_iter().map(training).chain(others).collect()
}

/// Returns every file below a folder with its bytes, but for those that hold times or locks, and temporary ones.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    const TIMES: [&str; 5] = ["timing.jsonl", "run.lock", "cost.json", "cost.md", ".tmp"];
    let (mut found, mut folders) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).expect("listed").map(|entry| entry.expect("an entry").path()) {
            let name = entry.strip_prefix(folder).expect("in it").display().to_string();
            if entry.is_dir() && !name.ends_with("tensorboard") {
                folders.push(entry);
            } else if entry.is_file() && !TIMES.iter().any(|times| name.contains(times)) {
                found.insert(name, fs::read(&entry).expect("readable"));
            }
        }
    }
    found
}

fn copy(from: &Path, to: PathBuf) -> PathBuf {
    for (name, bytes) in contents(from) {
        let path = to.join(name);
        fs::create_dir_all(path.parent().expect("in the folder")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    to
}

fn words(line: &str) -> Vec<&str> {
    line.split(' ').collect()
}

/// Returns the command that resumes killed work, as a person would choose it.
fn next_command(folder: &Path, work: &Work) -> String {
    if work.begin.starts_with("record") {
        return rest_of_recording(folder, &work.begin);
    }
    let (first, last) = work.saved;
    let is_saved =
        !first.is_empty() && contents(folder).keys().any(|name| name.starts_with(first) && name.ends_with(last));
    if is_saved { work.go_on.clone() } else { format!("{} --force", work.begin) }
}

/// Repairs a recording, and returns the command that records the levels that it lacks.
fn rest_of_recording(folder: &Path, begin: &str) -> String {
    let anew = format!("{begin} --force");
    if code(&playbot(folder, &["demo", "ls", "all.demo"])) != 0 {
        let repaired = playbot(folder, &["demo", "repair", "all.demo"]);
        // Kept beside the repaired one.
        let _ = fs::remove_file(folder.join("all.demo.bak"));
        if code(&repaired) != 0 {
            return anew;
        }
    }
    match done(folder, &["demo", "show", "all.demo", "--json"]).0.lines().count() {
        LEVELS => "demo verify all.demo".to_owned(),
        whole => format!("record coinrun --out all.demo --append --levels easy:{whole}..{}", LEVELS - 1),
    }
}

/// Starts a command and kills it after a while. Returns whether it was still at work.
fn kill_after(folder: &Path, line: &str, moment: Duration) -> bool {
    let mut begun = command(folder, &words(line));
    let mut child = begun.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts");
    let start = Instant::now();
    while let Some(left) = moment.checked_sub(start.elapsed()) {
        thread::park_timeout(left);
    }
    match child.try_wait().expect("a child") {
        Some(status) => {
            assert!(status.success(), "{line} ended with {status}");
            false
        }
        None => {
            kill(child);
            true
        }
    }
}

fn finish(folder: &Path, line: &str) {
    let output = playbot(folder, &words(line));
    assert_eq!(code(&output), 0, "{line}: {}", errors(&output));
}

#[test]
fn killed_work_of_every_kind_comes_to_the_same_bytes() {
    let temporary = tempfile::tempdir().expect("a folder");
    let home = temporary.path();
    let template = home.join("template");
    fs::create_dir(&template).expect("writable");
    fs::write(template.join("small.ron"), EXPERIMENT).expect("writable");
    finish(&template, "record coinrun --levels easy:0..9 --noise 0.2 --out few.demo");
    finish(&template, "learn-skills --experiment small.ron --epochs 1 --out skills");
    finish(&template, "train --experiment small.ron --algorithm ppo --run trained --steps 512");
    let works = works();
    // Each is done undisturbed when its turn comes first.
    let mut whole: Vec<Option<(Duration, BTreeMap<String, Vec<u8>>)>> = works.iter().map(|_| None).collect();
    let (mut dice, mut killed) = (Dice(4), vec![0; works.len()]);
    for trial in 0..MOST_WORKS {
        if killed.iter().sum::<usize>() >= KILLS && trial >= works.len() {
            break;
        }
        let kind = trial % works.len();
        let work = &works[kind];
        let (time, expected) = whole[kind].get_or_insert_with(|| {
            let folder = copy(&template, home.join(format!("whole-{kind}")));
            let begun = Instant::now();
            finish(&folder, &work.begin);
            (begun.elapsed(), contents(&folder))
        });
        let folder = copy(&template, home.join(format!("trial-{trial}")));
        let mut line = work.begin.clone();
        for _ in 0..*dice.pick(&[1, 1, 2]) {
            let is_killed = kill_after(&folder, &line, *time * dice.roll(80) as u32 / 100);
            killed[kind] += usize::from(is_killed);
            line = next_command(&folder, work);
            if !is_killed {
                break;
            }
        }
        finish(&folder, &line);
        let found = contents(&folder);
        let differs: Vec<_> =
            expected.keys().chain(found.keys()).filter(|name| expected.get(*name) != found.get(*name)).collect();
        assert!(differs.is_empty(), "trial {trial}, `{}`: other bytes in {differs:?}", work.begin);
    }
    assert!(killed.iter().sum::<usize>() >= KILLS, "too few were killed in time: {killed:?}");
}
