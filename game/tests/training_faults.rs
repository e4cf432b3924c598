//! Tests of trainings that are killed, run out of disk or diverge: no saved file is lost.

#[path = "shared/program.rs"]
mod program;

use std::{
    path::Path,
    process::{Command, Output, Stdio},
};

use playbot_shell::{at_work, kill, logged, results, steps};
use program::{code, command, done, ended, errors, playbot};

const UPDATES: usize = 120;

/// Writes a small training; `more` is added to its settings of PPO.
fn write_experiment(folder: &Path, more: &str) {
    let text = format!(
        r#"(
    game: "coinrun", train: "hard:0..7", test: "hard:64..71", demos: "none",
    steps: {steps}, arenas: 8, worlds: 2,
    ppo: (num_steps: 32, minibatches: 4, hidden: [32, 32], {more}),
    checkpoints: (every: 2, keep: 2),
)"#,
        steps = UPDATES * 8 * 32
    );
    std::fs::write(folder.join("small.ron"), text).expect("writable");
}

fn train(folder: &Path, args: &[&str]) -> Output {
    start(folder, args).output().expect("the program starts")
}

fn start(folder: &Path, args: &[&str]) -> Command {
    command(folder, &[&["train", "--algorithm", "ppo", "--experiment", "small.ron"], args].concat())
}

fn resume(folder: &Path, run: &str) -> Output {
    playbot(folder, &["train", "--resume", "--run", run])
}

#[test]
fn a_killed_training_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    write_experiment(folder.path(), "");
    let whole = train(folder.path(), &["--run", "whole"]);
    assert!(whole.status.success(), "{}", errors(&whole));

    let run = folder.path().join("killed");
    kill(at_work(start(folder.path(), &["--run", "killed"]).stderr(Stdio::null()), || logged(&run) >= 5));
    assert!(logged(&run) < UPDATES, "it was killed too late to prove anything");
    let resumed = resume(folder.path(), "killed");
    assert!(resumed.status.success(), "{}", errors(&resumed));
    assert!(results(&folder.path().join("whole")) == results(&run), "killing it changed the result");
}

#[test]
fn one_process_at_a_time_trains_in_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    write_experiment(folder.path(), "");
    let run = folder.path().join("busy");
    let mut endless = start(folder.path(), &["--run", "busy", "--steps", "100000000"]);
    let mut child = at_work(endless.stderr(Stdio::null()), || logged(&run) >= 3);
    let before = ["experiment.ron", "run.json"].map(|name| std::fs::read(run.join(name)).expect("written"));
    let second = [resume(folder.path(), "busy"), train(folder.path(), &["--run", "busy", "--force"])];
    // Reading needs no lock.
    done(folder.path(), &["runs", "ls", "."]);
    assert!(child.try_wait().expect("a child").is_none(), "the first one goes on");
    for refused in second {
        assert_eq!(code(&refused), 3, "{}", errors(&refused));
        assert!(errors(&refused).contains("busy is in use by another process"), "{}", errors(&refused));
    }
    let after = ["experiment.ron", "run.json"].map(|name| std::fs::read(run.join(name)).expect("still there"));
    assert!(before == after && !steps(&run).is_empty(), "the refused ones touched the run");
    kill(child);
    // Nothing is left of the lock, and the old run is replaced as a whole.
    let forced = train(folder.path(), &["--run", "busy", "--force", "--steps", "256"]);
    assert!(forced.status.success(), "{}", errors(&forced));
    assert_eq!((logged(&run), steps(&run).len()), (1, 2));
    let names: Vec<_> =
        std::fs::read_dir(folder.path()).expect("there").flatten().map(|entry| entry.file_name()).collect();
    assert_eq!(names.len(), 2, "the old run is gone: {names:?}");
}

#[test]
fn what_is_no_run_is_never_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    write_experiment(folder.path(), "");
    let precious = folder.path().join("demos/a.demo");
    std::fs::create_dir(folder.path().join("demos")).expect("writable");
    std::fs::write(&precious, "precious").expect("writable");
    let forced = train(folder.path(), &["--run", "demos", "--force"]);
    assert_eq!(code(&forced), 3, "{}", errors(&forced));
    assert!(errors(&forced).contains("demos is not the folder of a run"), "{}", errors(&forced));
    let (_, errors) = ended(folder.path(), &["quickstart", "--experiment", "small.ron", "--run", "demos"], 3);
    assert!(errors.contains("demos is not the folder of a quickstart"), "{errors}");
    let left: Vec<_> = std::fs::read_dir(folder.path().join("demos")).expect("there").flatten().collect();
    assert!(left.len() == 1 && precious.exists(), "{left:?}");
}

#[test]
fn what_does_not_fit_into_memory_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let large = ["observation=Raster", "image.width=512", "image.height=512", "image.stack=8", "ppo.num_steps=1048576"];
    let sets = large.map(|set| ["--set", set]).concat();
    for start in [&["train", "--algorithm", "ppo", "--run", "r"][..], &["quickstart", "--run", "r"]] {
        let (_, errors) = ended(folder.path(), &[start, &sets[..]].concat(), 3);
        for words in ["64 arenas × 1048576 steps × 6291456 bytes", "`ppo.num_steps`", "`image.stack`"] {
            assert!(errors.contains(words), "{errors}");
        }
    }
    assert!(!folder.path().join("r").exists());
}

#[test]
fn a_torn_checkpoint_is_passed_over_for_the_one_before() {
    let folder = tempfile::tempdir().expect("a folder");
    write_experiment(folder.path(), "");
    let whole = train(folder.path(), &["--run", "whole"]);
    assert!(whole.status.success(), "{}", errors(&whole));
    let run = folder.path().join("whole");
    let before = results(&run);
    let last = run.join("checkpoints").join(steps(&run).pop().expect("a checkpoint")).join("learner.safetensors");
    let bytes = std::fs::read(&last).expect("readable");
    std::fs::write(&last, &bytes[..bytes.len() / 2]).expect("writable");
    for verb in [&["eval"][..], &["policy", "export", "--out", "torn.policy"]] {
        let (_, words) = ended(folder.path(), &[verb, &["--run", "whole"]].concat(), 3);
        assert!(words.contains("the file is cut off") && words.contains("--checkpoint: there are those of"), "{words}");
    }
    let resumed = resume(folder.path(), "whole");
    assert!(resumed.status.success(), "{}", errors(&resumed));
    let words = errors(&resumed);
    assert!(words.contains("warning: the checkpoint of step ") && words.contains("the file is cut off"), "{words}");
    assert!(words.contains("); going on from step ") && !words.contains("WARN"), "{words}");
    assert_eq!(words.matches("cannot be read").count(), 1, "{words}");
    assert!(results(&run) == before, "going on from the checkpoint before changed the result");
}

#[test]
fn a_training_that_runs_away_names_the_tensor_and_the_last_good_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    write_experiment(folder.path(), "lr: 1e30");
    let output = train(folder.path(), &["--run", "wild"]);
    assert_eq!(code(&output), 2, "{}", errors(&output));
    let text = errors(&output);
    assert!(text.contains("is not finite") && text.contains("wild/checkpoints/step-000000000000"), "{text}");
    assert!(text.contains("learning rate"), "{text}");
    assert_eq!(steps(&folder.path().join("wild")), ["step-000000000000"]);
}

/// A limit on the size of files stands for a full disk: a write fails in the middle of a checkpoint.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_old_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    write_experiment(folder.path(), "");
    let start = train(folder.path(), &["--run", "full", "--steps", "512"]);
    assert!(start.status.success(), "{}", errors(&start));
    let run = folder.path().join("full");
    let (before, results_before) = (steps(&run), results(&run));
    let output = program::on_full_disk(folder.path(), 64, "train --resume --run full --steps 5120");
    assert_eq!(code(&output), 2, "{}", errors(&output));
    let text = errors(&output);
    assert!(text.contains("learner.safetensors") && text.contains("--resume"), "{text}");
    assert_eq!(steps(&run), before, "the old checkpoints are still there and no new one is");
    assert!(results(&run)[1..] == results_before[1..], "the old checkpoint was touched");
    let resumed = resume(folder.path(), "full");
    assert!(resumed.status.success(), "with room again it goes on: {}", errors(&resumed));
}

#[test]
fn a_killed_skill_training_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let sets = ["hidden=[16]", "encoder_hidden=8", "gru_hidden=8", "window=5", "epochs=200"];
    let sets = sets.map(|set| format!("--set=skills.{set}"));
    let learn = |out: &'static str, more: &[&'static str]| {
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        [&["learn-skills", "--demos", "few.demo", "--out", out], &sets[..], more].concat()
    };
    done(folder.path(), &["record", "coinrun", "--levels", "easy:0..9", "--out", "few.demo"]);
    done(folder.path(), &learn("whole", &[]));
    let checkpoint = folder.path().join("killed.checkpoint");
    kill(at_work(command(folder.path(), &learn("killed", &[])).stderr(Stdio::null()), || checkpoint.exists()));
    assert!(checkpoint.exists() && !folder.path().join("killed").exists(), "it was killed too late");
    let (_, refused) = ended(folder.path(), &learn("killed", &[]), 3);
    assert!(refused.contains("--resume"), "{refused}");
    let (_, other) = ended(folder.path(), &learn("killed", &["--resume", "--set", "skills.lr=0.5"]), 3);
    let words = "other settings: `--set skills.lr=0.5` asks for skills.lr=0.5, and the training has ";
    assert!(other.contains(words) && other.contains("start anew with --force"), "{other}");
    let whole = std::fs::read(&checkpoint).expect("written");
    let flipped = [&whole[..whole.len() / 2], &[!whole[whole.len() / 2]], &whole[whole.len() / 2 + 1..]].concat();
    let zeros = vec![0; whole.len()];
    for damaged in [&flipped[..], &whole[..whole.len() / 2], &zeros[..]] {
        std::fs::write(folder.path().join("hurt.checkpoint"), damaged).expect("writable");
        let (_, hurt) = ended(folder.path(), &learn("hurt", &["--resume"]), 3);
        assert!(hurt.contains("hurt.checkpoint: ") && hurt.contains("learn anew with --force"), "{hurt}");
        assert!(!hurt.contains("go on with the recordings"), "they are not to blame: {hurt}");
    }
    done(folder.path(), &learn("killed", &["--resume"]));
    let (_, finished) = ended(folder.path(), &learn("killed", &["--resume"]), 0);
    assert!(finished.contains("killed is finished") && finished.contains("train --skills killed"), "{finished}");
    let (_, nothing) = ended(folder.path(), &learn("none", &["--resume"]), 3);
    assert!(nothing.contains("nothing to resume") && nothing.contains("leave --resume out"), "{nothing}");
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
    assert!(read("whole") == read("killed"), "killing it changed the result");
    assert!(!checkpoint.exists(), "nothing is left over");
}

#[test]
fn recordings_that_are_too_short_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    done(folder.path(), &["record", "coinrun", "--levels", "easy:0..0", "--out", "one.demo"]);
    let learn = ["learn-skills", "--demos", "one.demo", "--out", "skills", "--set", "skills.window=900"];
    let (_, errors) = ended(folder.path(), &learn, 3);
    assert!(errors.contains("window of 900 steps"), "{errors}");
}
