//! Tests of Ctrl-C: stopped work is not done, and the message has the command that resumes it.

use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

use playbot_shell::at_work;

use crate::program::{code, command, errors, lines, playbot};

const ENDLESS: u64 = 1_000_000_000;

/// Starts the program, waits until it is at work, presses Ctrl-C and waits for its end.
fn interrupted(folder: &Path, args: &[&str], is_at_work: impl Fn() -> bool) -> Output {
    let child = at_work(command(folder, args).stdout(Stdio::null()).stderr(Stdio::piped()), is_at_work);
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("a shell's kill");
    assert!(sent.success());
    let output = child.wait_with_output().expect("a child");
    assert_eq!(code(&output), 130, "{args:?}: {}", errors(&output));
    output
}

#[test]
fn a_stopped_recording_says_how_the_rest_is_added() {
    let temporary = tempfile::tempdir().expect("a folder");
    let (folder, file) = (temporary.path(), temporary.path().join("a.demo"));
    let steps = ENDLESS.to_string();
    let base = ["record", "coinrun", "--out", "a.demo", "--noise", "0.2"];
    let first = [&base[..], &["--levels", "easy:0..4000", "--steps", &steps]].concat();
    let output = interrupted(folder, &first, || fs::metadata(&file).is_ok_and(|file| file.len() > 3_000));
    let listed = |what: &str| lines(&playbot(folder, &["demo", "ls", "a.demo", "--json"]))[0][what].as_u64();
    let recorded = listed("steps").expect("a number");
    let words = errors(&output);
    let (_, advice) = words.split_once('`').expect("what to change");
    let (advice, _) = advice.split_once('`').expect("what to change");
    assert!(words.contains("incomplete") && advice.starts_with("--append --levels easy:"), "{words}");
    let rest = (ENDLESS - recorded).to_string();
    assert!(advice.ends_with(&format!("..4000 --steps {rest} --seed 2")), "{recorded} steps: {words}");
    assert!(words.contains("`, in place of its --levels, --steps and --seed"), "{words}");

    // As printed, but for the number of steps.
    let advice = advice.replace(&rest, "100");
    let output = playbot(folder, &base.into_iter().chain(advice.split(' ')).collect::<Vec<_>>());
    assert_eq!(code(&output), 0, "{}", errors(&output));
    assert_eq!(listed("steps"), Some(recorded + 100), "the steps that were there are not counted again");
}

#[test]
fn a_stopped_audit_of_levels_prints_what_it_has_compared() {
    let temporary = tempfile::tempdir().expect("a folder");
    // Layouts are hashed, and levels are played if the game does not hash them.
    for (args, basis) in [
        (&["levels", "coinrun", "--levels", "hard:0..16000000", "--layouts-only", "--json"][..], "layout"),
        (&["levels", "maze2d", "--levels", "medium:0..300000", "--json"], "state"),
    ] {
        let begun = Instant::now();
        let mut audit = command(temporary.path(), args);
        audit.stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = at_work(&mut audit, || begun.elapsed() > Duration::from_secs(5));
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("a shell's kill");
        assert!(sent.success());
        let output = child.wait_with_output().expect("a child");
        assert_eq!(code(&output), 130, "{args:?}: {}", errors(&output));
        let found = &lines(&output)[0];
        let number = |what: &str| found[what].as_u64().unwrap_or_default();
        assert_eq!(found["stopped"], true, "{found}");
        if basis == "layout" {
            assert_eq!(found["compared_by"], basis, "{found}");
            assert!(number("compared") > 0 && number("compared") < number("count"), "{found}");
            assert!(number("layouts") <= number("compared"), "{found}");
        }
        let words = "the same command does all of it again";
        assert!(errors(&output).contains(words), "{}", errors(&output));
    }
}

#[test]
fn a_stopped_exploration_prints_what_it_has_found_within_a_round() {
    let temporary = tempfile::tempdir().expect("a folder");
    let begun = Instant::now();
    // The first round alone takes minutes.
    let steps = ENDLESS.to_string();
    let args = ["explore", "coinrun", "--level", "easy:0", "--until", "spent", "--batch", "200000", "--steps", &steps];
    let mut explorer = command(temporary.path(), &[&args[..], &["--png", "seen.png", "--json"]].concat());
    explorer.stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = at_work(&mut explorer, || begun.elapsed() > Duration::from_secs(5));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("a shell's kill");
    assert!(sent.success());
    let output = child.wait_with_output().expect("a child");
    assert_eq!(code(&output), 130, "{}", errors(&output));
    let found = &lines(&output)[0];
    assert_eq!(found["stop"], "asked", "{found}");
    assert!(found["cells"].as_u64().is_some_and(|cells| cells > 1), "{found}");
    assert!(found["visits"].as_u64().is_some_and(|visits| visits > 0 && visits < 200_000), "{found}");
    assert!(temporary.path().join("seen.png").exists(), "{}", errors(&output));
}

#[test]
fn stopped_planting_says_that_nothing_is_written() {
    let temporary = tempfile::tempdir().expect("a folder");
    let args = ["bugs", "make", "coinrun", "--sound", "900000", "--out", "set"];
    let folder = temporary.path();
    let output = interrupted(folder, &args, || folder.join("set").is_dir());
    let words = errors(&output);
    assert!(words.contains("stopped; nothing is written in set: the same command begins again"), "{words}");
    assert!(!folder.join("set/mutants.json").exists());
}

/// `nohup` has SIGHUP ignored, and a shell without job control SIGINT of what it starts in the background.
#[cfg(target_os = "linux")]
#[test]
fn signals_that_the_caller_has_switched_off_stop_nothing() {
    let temporary = tempfile::tempdir().expect("a folder");
    let (folder, file) = (temporary.path(), temporary.path().join("a.demo"));
    let steps = ENDLESS.to_string();
    let work =
        command(folder, &["record", "coinrun", "--levels", "easy:0..4000", "--steps", &steps, "--out", "a.demo"]);
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP INT; exec \"$0\" \"$@\""]).arg(work.get_program()).args(work.get_args());
    shell.current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = at_work(&mut shell, || fs::metadata(&file).is_ok_and(|file| file.len() > 3_000));
    for signal in ["-HUP", "-INT", "-INT", "-TERM"] {
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("a shell's kill");
        assert!(sent.success(), "it has ended before {signal}");
    }
    let output = child.wait_with_output().expect("a child");
    let words = errors(&output);
    // 128 and the number of TERM.
    assert_eq!(code(&output), 143, "{words}");
    assert!(words.contains("another signal stops at once and loses it"), "{words}");
    // A second signal that is heard stops at once.
    assert!(words.contains("stopping after this step") && !words.contains("stopped at once"), "{words}");
}

#[test]
fn stopped_learning_is_not_done() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let text = format!(
        r#"(
    game: "coinrun", train: "hard:0..7", test: "hard:64..71", demos: "few.demo", steps: {ENDLESS}, arenas: 8, worlds: 2,
    skills: (window: 5, epochs: 1000000, batch: 16, hidden: [16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 16, minibatches: 2, hidden: [16]), algorithm: "ppo",
)"#
    );
    fs::write(folder.join("small.ron"), text).expect("writable");
    let recorded = playbot(folder, &["record", "coinrun", "--levels", "easy:0..3", "--out", "few.demo"]);
    assert_eq!(code(&recorded), 0, "{}", errors(&recorded));
    let from = ["--experiment", "small.ron"];
    for (args, sign, words) in [
        (&["learn-skills", "--out", "skills"][..], "skills.checkpoint", "the same command and --resume"),
        (&["train", "--run", "run"], "run/metrics.jsonl", "playbot train --run run --resume"),
        (
            &["study", "--out", "o", "--runs", "runs", "--seeds", "1"],
            "runs/ppo-seed1/metrics.jsonl",
            "--runs runs --resume",
        ),
    ] {
        let output = interrupted(folder, &[args, &from].concat(), || folder.join(sign).exists());
        let said = errors(&output);
        assert!(said.contains("stopped and saved") && said.contains(words), "{args:?}: {said}");
    }
    let shorter = playbot(folder, &["train", "--run", "run", "--resume", "--steps", "1"]);
    let said = errors(&shorter);
    assert!(code(&shorter) == 3 && said.contains("leave --steps out to go on to 1000000000"), "{said}");
}

#[test]
fn a_quickstart_stopped_during_its_further_seeds_keeps_both_trainings() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let text = r#"(
    game: "coinrun", train: "hard:0..7", test: "hard:64..71", demos: "few.demo", steps: 128, arenas: 8, worlds: 2,
    skills: (window: 5, epochs: 20, batch: 16, hidden: [16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 16, minibatches: 2, hidden: [16]),
)"#;
    fs::write(folder.join("small.ron"), text).expect("writable");
    let recorded = playbot(folder, &["record", "coinrun", "--levels", "easy:0..3", "--out", "few.demo"]);
    assert_eq!(code(&recorded), 0, "{}", errors(&recorded));
    let trained = |method: &str| folder.join("q").join(method).join("checkpoints/step-000000000128/summary.json");
    let args = ["quickstart", "--experiment", "small.ron", "--seeds", "100", "--run", "q"];
    let said = errors(&interrupted(folder, &args, || trained("ppo").exists()));
    assert!(said.contains("both trainings and their report are saved in q, without the steps to success"), "{said}");
    assert!(folder.join("q/report.html").exists());
    let advice = said.rsplit_once("`playbot ").and_then(|(_, advice)| advice.split_once('`')).expect("a command").0;
    let measured = playbot(folder, &advice.split(' ').collect::<Vec<_>>());
    assert_eq!(code(&measured), 0, "{advice}: {}", errors(&measured));
}
