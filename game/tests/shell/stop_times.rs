//! Tests that one signal is enough: during any work, the program ends within two seconds and reports the kept files.

use std::{
    fs::{self, File},
    path::Path,
    process::{Child, Command, ExitStatus},
    sync::atomic::{AtomicU64, AtomicUsize, Ordering},
    thread,
    time::{Duration, Instant},
};

use playbot_shell::at_work;

use crate::{
    dice::Dice,
    program::{command, done},
};

/// Longest allowed time from the signal to the end.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time after which the program is killed.
const HOPELESS: Duration = Duration::from_secs(20);
/// Work is stopped at a random time of so many milliseconds after it has begun.
const MOMENTS: usize = 1000;

/// Default number of stops, without `PLAYBOT_STOPS`: each kind twice.
const USUAL_STOPS: usize = 18;
/// Programs that run at a time.
const AT_ONCE: usize = 2;

/// The signals, and the exit codes after them.
const SIGNALS: [(&str, i32); 3] = [("INT", 130), ("TERM", 143), ("HUP", 129)];

/// Work that takes minutes.
struct Work {
    /// The command; NAME is another name each time.
    line: &'static str,
    /// A file, and its least number of bytes once the work has begun.
    sign: (&'static str, u64),
    /// One of these is in the last line.
    kept: &'static [&'static str],
}

const WORKS: [Work; 9] = [
    Work {
        line: "train --experiment update.ron --run NAME",
        sign: ("NAME/checkpoints/step-000000000000/summary.json", 1),
        kept: &["stopped and saved after ", "the last checkpoint of NAME is that of step 0: go on with `playbot train"],
    },
    Work {
        line: "learn-skills --experiment epochs.ron --out NAME",
        sign: ("NAME.checkpoint", 1),
        kept: &["stopped and saved; no skill model is written yet: go on with", "NAME.checkpoint is kept, after "],
    },
    // It replays first, and reports that before it does.
    Work {
        line: "learn-skills --experiment replayed.ron --threads 1 --out NAME",
        sign: ("NAME.err", 1),
        kept: &[
            "nothing is learned yet: go on with the same command",
            "stopped and saved; no skill model is written yet",
        ],
    },
    Work { line: "demo verify many", sign: ("NAME.out", 1), kept: &[" of 100 recordings checked: name the others"] },
    // The first level is measured and printed, and the others are being measured.
    Work {
        line: "eval --bot random --levels hard:63..63 --levels hard:64..100000 --json",
        sign: ("NAME.out", 1),
        kept: &["the printed rows are complete, and nothing else is kept"],
    },
    Work {
        line: "record coinrun --levels easy:0..100000 --noise 0.2 --out NAME.demo",
        sign: ("NAME.demo", 3000),
        kept: &["add the rest with the same command and `--append --levels easy:"],
    },
    // Its one training is done, and its policy is being measured.
    Work {
        line: "study --experiment measured.ron --seeds 1 --out NAME-tables --runs NAME",
        sign: ("NAME/ppo-seed1/checkpoints/step-000000000128/summary.json", 1),
        kept: &[
            "stopped and saved; the study is incomplete",
            "the last checkpoint of NAME/ppo-seed1 is that of step 128",
        ],
    },
    Work {
        line: "test coinrun --levels hard:0..100000 --out NAME",
        sign: ("NAME/levels.jsonl", 1),
        kept: &["levels are finished: go on with the same command and --resume"],
    },
    Work {
        line: "quickstart --experiment endless.ron --run NAME",
        sign: ("NAME/score-ppo/metrics.jsonl", 1),
        kept: &["stopped and saved; there is no report yet: go on with", "the last checkpoint of NAME/score-ppo is"],
    },
];

/// Writes a small experiment that trains for so many steps, with other numbers of epochs and test levels.
fn write_experiment(folder: &Path, name: &str, (steps, skill_epochs, epochs, last_test): (u64, u64, u64, u64)) {
    let text = format!(
        r#"(
    game: "coinrun", train: "hard:0..7", test: "hard:64..{last_test}", demos: "few.demo", steps: {steps}, arenas: 8, worlds: 2,
    skills: (window: 5, epochs: {skill_epochs}, batch: 16, hidden: [16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 16, minibatches: 2, epochs: {epochs}, hidden: [16]), algorithm: "ppo",
)"#
    );
    fs::write(folder.join(name), text).expect("writable");
}

/// Makes the files that the commands need.
fn prepare(folder: &Path) {
    const ENDLESS: u64 = 1_000_000_000;
    write_experiment(folder, "update.ron", (ENDLESS, 1, 100_000, 71));
    write_experiment(folder, "epochs.ron", (ENDLESS, 1_000_000, 3, 71));
    write_experiment(folder, "measured.ron", (128, 1, 3, 100_000));
    write_experiment(folder, "endless.ron", (ENDLESS, 1, 3, 71));
    let replayed = r#"(
    game: "antmaze", train: "umaze:0..63", test: "umaze:64..71", demos: "ant.demo", steps: 128, arenas: 8, worlds: 2,
    observation: Raster, image: (width: 192, height: 192), algorithm: "ppo", ppo: (num_steps: 16, minibatches: 2),
    skills: (window: 5, epochs: 1000000, batch: 16, hidden: [16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
)"#;
    fs::write(folder.join("replayed.ron"), replayed).expect("writable");
    done(folder, &["record", "coinrun", "--levels", "easy:0..3", "--out", "few.demo"]);
    done(folder, &["record", "antmaze", "--levels", "umaze:0..63", "--steps", "3000", "--out", "ant.demo"]);
    fs::create_dir(folder.join("many")).expect("writable");
    for copy in 0..100 {
        fs::copy(folder.join("ant.demo"), folder.join(format!("many/{copy}.demo"))).expect("copied");
    }
}

fn pass(time: Duration) {
    let begun = Instant::now();
    while let Some(left) = time.checked_sub(begun.elapsed()) {
        thread::park_timeout(left);
    }
}

/// Returns the exit status of the program, if it ends in time.
fn end(child: &mut Child) -> Option<ExitStatus> {
    let begun = Instant::now();
    while begun.elapsed() < HOPELESS {
        if let Some(status) = child.try_wait().expect("a child") {
            return Some(status);
        }
        thread::park_timeout(Duration::from_millis(1));
    }
    child.kill().expect("it runs");
    child.wait().expect("a child");
    None
}

/// Begins work, stops it at a random time, and returns how long it took to end.
fn stop(folder: &Path, index: usize) -> Duration {
    let (kind, round) = (index % WORKS.len(), index / WORKS.len());
    let (work, (signal, code)) = (&WORKS[kind], SIGNALS[(kind + round) % SIGNALS.len()]);
    let name = format!("x{index}");
    let named = |text: &str| text.replace("NAME", &name);
    let line = named(work.line);
    let file = |ending: &str| File::create(folder.join(format!("{name}.{ending}"))).expect("writable");
    let mut begun = command(folder, &line.split(' ').collect::<Vec<_>>());
    begun.stdout(file("out")).stderr(file("err"));
    let sign = folder.join(named(work.sign.0));
    let mut child = at_work(&mut begun, || fs::metadata(&sign).is_ok_and(|file| file.len() >= work.sign.1));
    let moment = Dice(index as u64).roll(MOMENTS);
    pass(Duration::from_millis(moment as u64));

    let sent = Instant::now();
    let kill = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status();
    let status = end(&mut child);
    let took = sent.elapsed();
    let said = fs::read_to_string(folder.join(format!("{name}.err"))).expect("text");
    let what =
        format!("`{line}`, SIG{signal} after {moment} ms, ended after {took:?} with {status:?}, and said:\n{said}");
    assert!(kill.is_ok_and(|kill| kill.success()), "it had ended by itself: {what}");
    assert!(took <= PATIENCE, "{what}");
    let status = status.expect("it ended in time");
    assert_eq!(status.code(), Some(code), "{what}");
    let last = said.trim_end().lines().last().unwrap_or_default();
    assert!(work.kept.iter().any(|words| last.contains(&named(words))), "{what}");
    took
}

#[test]
fn one_signal_stops_everything_within_two_seconds_and_what_is_kept_is_said() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    prepare(folder);
    let stops = std::env::var("PLAYBOT_STOPS").map_or(USUAL_STOPS, |stops| stops.parse().expect("a number"));
    let (begun, longest) = (AtomicUsize::new(0), AtomicU64::new(0));
    let next = || Some(begun.fetch_add(1, Ordering::Relaxed)).filter(|index| *index < stops);
    let work = || {
        while let Some(index) = next() {
            longest.fetch_max(stop(folder, index).as_millis() as u64, Ordering::Relaxed);
        }
    };
    thread::scope(|scope| (0..AT_ONCE).for_each(|_| drop(scope.spawn(work))));
    eprintln!("{stops} of {stops} were stopped in time; the longest took {} ms", longest.into_inner());
}
