//! Tests of a game that panics when it starts: the panic, with its plugin or system, is the first thing that a verb prints.

use std::{fs, process::Command};

use playbot_shell::{Shell, ended};

/// An experiment of the game of catching, with as little work as possible.
const TINY: &str = r#"(
    game: "catch", train: "default:0..3", test: "default:8..8", demos: "few.demo", algorithm: "ppo", seeds: [1],
    steps: 32, arenas: 1, worlds: 1,
    skills: (window: 4, epochs: 1, hidden: [4], encoder_hidden: 4, gru_hidden: 4, latent: 2),
    ppo: (num_steps: 16, epochs: 1, minibatches: 1),
    eval: (episodes_per_level: 1),
)"#;

/// The steps in which the game breaks, with what is said of them.
const STEPS: [(&str, &str); 3] = [
    ("build", "in `build` of the plugin `broken::Fragile`"),
    ("finish", "in `finish` of the plugin `broken::Fragile`"),
    ("start", "open_door`"),
];

/// Returns the program, whose game breaks in this step.
fn broken(shell: &Shell, args: &[&str], step: &str) -> Command {
    let mut command = shell.command(args);
    command.env("BREAK", step);
    command
}

/// Returns a shell with all that verbs need of a sound game: recordings, a model, a run, a finding and planted defects.
fn prepared() -> Shell {
    let shell = Shell::new(env!("CARGO_BIN_EXE_broken"));
    fs::write(shell.path("tiny.ron"), TINY).expect("writable");
    shell.done(&["record", "catch", "--levels", "default:0..1", "--steps", "60", "--out", "few.demo"]);
    shell.done(&["train", "--experiment", "tiny.ron", "--run", "run"]);
    let test = ["test", "catch", "--levels", "default:0..0", "--bot", "random", "--out", "tested"];
    ended(shell.command(&[&test[..], &["--detector", "runaway.distance=0.001"]].concat()), 1);
    let make = ["bugs", "make", "catch", "--per-kind", "1", "--sound", "1", "--levels", "catch=default:0..999"];
    shell.done(&[&make[..], &["--out", "bugs"]].concat());
    shell
}

/// Checks that a verb ends with this code, and that the panic is the first thing that it prints.
#[track_caller]
fn prints_the_panic_first(shell: &Shell, args: &[&str], code: i32) {
    for (step, origin) in STEPS {
        let (out, err) = ended(broken(shell, args, step), code);
        let all = format!("{out}{err}");
        let first = all.lines().next().unwrap_or_default();
        for part in ["panicked", "no saved game (", "broken.rs:", origin] {
            assert!(
                first.contains(part),
                "{step}: `{part}` is missing in the first line of `{}`: {all}",
                args.join(" ")
            );
        }
        let before = first.split("no saved game").next().unwrap_or_default();
        assert!(!before.contains("replay") && !before.contains("observation"), "a consequence comes first: {first}");
    }
}

#[test]
fn a_panic_of_the_start_is_the_first_thing_that_every_verb_prints() {
    let shell = prepared();
    let findings = fs::read_dir(shell.path("tested/findings")).expect("something was found");
    let finding = findings.map(|file| file.expect("readable").path()).next().expect("something was found");
    let finding = finding.to_str().expect("a name");
    for args in [
        &["doctor", "catch", "--ticks", "10"][..],
        &["record", "catch", "--levels", "default:0..1", "--out", "new.demo"],
        &["learn-skills", "--experiment", "tiny.ron", "--out", "new.safetensors"],
        &["train", "--experiment", "tiny.ron", "--run", "new"],
        &["train", "--resume", "--run", "run", "--steps", "64"],
        &["study", "--experiment", "tiny.ron", "--out", "study"],
        &["quickstart", "--experiment", "tiny.ron", "--run", "quick"],
        &["eval", "--experiment", "tiny.ron", "--bot", "random"],
        &["test", "catch", "--levels", "default:0..1", "--bot", "random", "--out", "new"],
        &["test", "--regress", "tested/findings"],
        &["replay", finding],
        &["explore", "catch", "--level", "default:0", "--steps", "50"],
        &["levels", "catch", "--levels", "default:0..1"],
        &["trace", "catch", "--level", "0", "--actions", "0,0"],
        &["view", "catch", "--level", "0"],
        &["view", "catch", "--demo", "few.demo"],
        &["bench", "--seconds", "0.01"],
        &["bugs", "make", "catch", "--per-kind", "1", "--levels", "catch=default:0..999", "--out", "more"],
        &["bugs", "score", "bugs", "--tester", "random", "--out", "score.json"],
    ] {
        prints_the_panic_first(&shell, args, 2);
    }
    // It goes on to other files, so it is a finding.
    prints_the_panic_first(&shell, &["demo", "verify", "few.demo"], 1);
    for name in ["new.demo", "new.safetensors", "new", "study", "quick", "more", "score.json", "view.png"] {
        assert!(!shell.path(name).exists(), "{name} is left behind");
    }
}

/// The game has a window of its own, in which plugins and systems panic while it opens.
#[cfg(feature = "screen")]
#[test]
fn a_panic_of_the_start_is_printed_before_the_keys_of_a_window() {
    use playbot_shell::Desk;

    let (desk, shell) = (Desk::new(env!("CARGO_BIN_EXE_broken")), Shell::new(env!("CARGO_BIN_EXE_broken")));
    for (step, origin) in STEPS {
        let mut command = desk.command(shell.folder(), &["play", "catch"]);
        command.env("BREAK", step);
        let (out, err) = ended(command, 2);
        let is_named = err.contains("no saved game (") && err.contains(origin);
        assert!(is_named && !err.contains("Escape ends") && out.is_empty(), "{step}: {out}{err}");
    }
}
