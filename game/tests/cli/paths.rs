//! Tests of paths on the command line: a missing file is not taken from elsewhere, and advice can be followed.

use std::{fs, path::Path};

use crate::program::{code, done, ended, errors, piped, said};

/// Writes an experiment with one update of PPO.
fn write_experiment(folder: &Path) {
    let text = r#"(game: "coinrun", train: "easy:0..3", test: "easy:4..5", steps: 128, arenas: 8, worlds: 2,
        algorithm: "ppo", ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8]))"#;
    fs::write(folder.join("small.ron"), text).expect("writable");
}

#[test]
fn what_somebody_names_is_looked_for_here_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let file = "demos/coinrun/easy.demo";
    for args in [
        &["demo", "ls"][..],
        &["demo", "ls", "demos/coinrun"],
        &["demo", "verify", file],
        &["demo", "show", file],
        &["demo", "repair", file],
    ] {
        let (_, words) = ended(folder, args, 3);
        assert!(words.contains("`playbot record GAME --out demos/"), "{args:?}: {words}");
    }
    let (_, words) = ended(folder, &["demo", "repair", "demos/README.md"], 3);
    assert!(words.contains("end in .demo") && !words.contains("README.md/"), "{words}");
}

#[test]
fn recordings_of_the_experiment_that_comes_with_the_program_are_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let learn = ["learn-skills", "--max-steps", "1", "--epochs", "1", "--out", "skills"];
    let (_, words) = done(folder, &learn);
    assert!(words.contains("recordings are taken from ") && words.contains("none at demos/coinrun here"), "{words}");
    assert!(!words.contains(".."), "{words}");
    let (_, words) = ended(folder, &[&learn[..], &["--force", "--demos", "demos/coinrun"]].concat(), 3);
    assert!(words.contains("`playbot record coinrun "), "{words}");
    for game in ["coinrun", "maze2d", "antmaze"] {
        let (_, reported) = done(folder, &["config", "show", game]);
        assert!(!reported.contains("there are no recordings"), "{reported}");
    }
    let (_, reported) = done(folder, &["config", "show", "--set", "demos=demos/coinrun"]);
    assert!(reported.contains("there are no recordings at demos/coinrun"), "{reported}");
}

#[test]
fn paths_in_an_experiment_start_in_its_folder_or_else_in_this_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, text).expect("writable");
    };
    let level = |number: &str| done(folder, &["level", "coinrun", "--level", number, "--json"]).0;
    write("own/train/1.json", &level("1"));
    write("test/1.json", &level("2"));
    write("own/base/test/1.json", &level("3"));
    for path in ["own/easy/1.json", "own/base/easy/1.json"] {
        write(path, &level("4"));
    }
    write("own/walks.demo", "");
    write("walks.demo", "");
    write("others.demo", "");
    let rest = r#"test: "files:test/*.json", steps: 128"#;
    let text = format!(
        r#"(game: "coinrun", train: "files:train/*.json:0..0", demos: "walks.demo", {rest},
        curriculum: (lessons: [(levels: "files:easy/*.json", success: 0.5)]),
        variants: [(name: "a", set: ["train=files:train/1.json", "demos=others.demo"]), (name: "b")])"#
    );
    write("own/small.ron", &text);
    write("own/base/base.ron", &text.replace("files:train", "files:../train"));
    write("own/built.ron", r#"(base: ["base/base.ron"], demos: "others.demo", variants: [])"#);
    let config = |file: &str, more: &[&str]| done(folder, &[&["config", "show", "--experiment", file], more].concat());
    let (shown, _) = config("own/small.ron", &[]);
    for line in [
        r#"train: "files:own/train/*.json:0..0","#,
        r#"test: "files:test/*.json:0..0","#,
        r#"levels: "files:own/easy/*.json:0..0","#,
        r#"demos: "own/walks.demo","#,
        r#""train=files:own/train/1.json","#,
        r#""demos=others.demo""#,
    ] {
        assert!(shown.contains(line), "{line} is not in {shown}");
    }
    // Paths in a base start beside the base, and options of the command line here.
    let (shown, _) = config("own/built.ron", &[]);
    for line in [
        r#"train: "files:own/base/../train/*.json:0..0","#,
        r#"test: "files:own/base/test/*.json:0..0","#,
        r#"levels: "files:own/base/easy/*.json:0..0","#,
        r#"demos: "others.demo","#,
    ] {
        assert!(shown.contains(line), "{line} is not in {shown}");
    }
    let (shown, _) = config("own/small.ron", &["--set", "demos=walks.demo"]);
    assert!(shown.contains(r#"demos: "walks.demo","#), "{shown}");

    let (_, words) = config("own/small.ron", &["--set", "demos=no.demo"]);
    assert!(words.contains("there are no recordings at no.demo") && !words.contains("own/no.demo"), "{words}");
    write("own/lost.ron", &text.replace("walks.demo", "no.demo"));
    let (_, words) = config("own/lost.ron", &[]);
    assert!(words.contains("no recordings at own/no.demo") && words.contains("no recordings at no.demo"), "{words}");
    write("own/lost.ron", &text.replace("files:test", "files:no"));
    let (_, words) = ended(folder, &["config", "show", "--experiment", "own/lost.ron"], 3);
    let expected = "files:no/*.json matches no file, neither seen from own, the folder of this file, nor from ";
    assert!(words.contains("own/lost.ron:1:") && words.contains(expected), "{words}");
}

#[test]
fn a_dash_stands_for_standard_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let piped_in = |args: &[&str], input: &str| {
        let output = piped(folder, args, input);
        assert_eq!(code(&output), 0, "{args:?}: {}", errors(&output));
        said(&output)
    };
    let refused = |args: &[&str], input: &str| {
        let output = piped(folder, args, input);
        assert_eq!(code(&output), 3, "{args:?}: {}", said(&output));
        errors(&output)
    };
    let shown = done(folder, &["level", "coinrun", "--level", "5"]).0;
    let text = done(folder, &["level", "coinrun", "--level", "5", "--json"]).0;
    assert_eq!(piped_in(&["level", "coinrun", "--file", "-"], &text), shown);
    let words = refused(&["level", "coinrun", "--file", "-"], "{\n\"rows\": [\n\"####\",\n\"#?C#\"]}");
    assert!(words.contains("standard input, line 4: unknown letter `?`"), "{words}");
    let rows = done(folder, &["level", "antmaze", "--map", "umaze"]).0;
    assert_eq!(piped_in(&["level", "antmaze", "--map", "-"], &rows), rows);
    let words = refused(&["level", "antmaze", "--map", "-"], "#####\n");
    assert!(words.contains("standard input: "), "{words}");

    let trace = ["trace", "coinrun", "--level", "5", "--json"];
    let traced = done(folder, &[&trace[..], &["--actions", "8,8,7"]].concat()).0;
    let trace = [&trace[..], &["--actions-file", "-"]].concat();
    assert_eq!(piped_in(&trace, "8 8\n7\n"), traced);
    assert!(refused(&trace, "8 x").contains("standard input: `x` is not an action"));
    assert!(refused(&trace, "").contains("standard input has no actions"));
    let trace = ["trace", "maze2d", "--map", "medium", "--actions-file", "-"];
    assert!(refused(&trace, "1 0\n1 x\n").contains("standard input, line 2: `1 x` is no push"));

    // The experiment is read a second time for the position of its error.
    let experiment = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 1234)"#;
    let config = ["config", "show", "--experiment", "-"];
    assert!(piped_in(&config, experiment).contains("steps: 1234,"));
    let words = refused(&config, &experiment.replace("hard:0..63", "hrad:0..63"));
    assert!(words.contains("standard input:1:19: `train` is hrad:0..63"), "{words}");

    // A file of that name has a path.
    fs::write(folder.join("-"), &text).expect("writable");
    assert_eq!(done(folder, &["level", "coinrun", "--file", "./-"]).0, shown);
    assert!(refused(&["level", "coinrun", "--file", "-"], "").contains("standard input"), "not the file");
}

#[test]
fn utf_16_without_its_mark_is_named_wherever_a_text_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let bytes = "(steps: 1234)\n".encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    for name in ["a.json", "a.ron", "a.txt"] {
        fs::write(folder.join(name), &bytes).expect("writable");
    }
    for args in [
        &["level", "coinrun", "--file", "a.json"][..],
        &["levels", "coinrun", "--levels", "files:a.json"],
        &["level", "maze2d", "--map", "a.txt"],
        &["config", "show", "--experiment", "a.ron"],
        &["trace", "coinrun", "--actions-file", "a.txt"],
        &["trace", "maze2d", "--map", "medium", "--actions-file", "a.txt"],
        &["test", "coinrun", "--levels", "easy:0", "--par", "a.json", "--out", "o"],
    ] {
        let (_, words) = ended(folder, args, 3);
        let next =
            "it is text in UTF-16 without a byte order mark: save it as UTF-8 in an editor, or with `iconv -f UTF-16LE";
        let file = args.iter().find_map(|arg| arg.trim_start_matches("files:").strip_prefix("a."));
        let file = format!("a.{}", file.expect("each names one"));
        assert!(words.contains(next) && words.contains(&file), "{args:?}: {words}");
    }
}

#[test]
fn an_empty_folder_becomes_a_run_and_a_file_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_experiment(folder);
    fs::create_dir(folder.join("empty")).expect("writable");
    fs::write(folder.join("main.log"), "words").expect("writable");
    let train = ["train", "--experiment", "small.ron", "--run"];
    let (_, words) = ended(folder, &["train", "--run", "empty", "--resume"], 3);
    assert!(words.contains("`playbot train --run empty` starts one"), "{words}");
    done(folder, &[&train[..], &["empty"]].concat());
    let (_, words) = ended(folder, &[&train[..], &["empty"]].concat(), 3);
    assert!(words.contains("empty exists already") && words.contains("--resume"), "{words}");
    let (_, words) = ended(folder, &[&train[..], &["main.log"]].concat(), 3);
    assert!(words.contains("main.log is not the folder of a run") && !words.contains("--resume"), "{words}");
    let (_, words) = ended(folder, &["eval", "--run", "main.log"], 3);
    assert!(words.contains("it is a file") && !words.contains("--run main.log`"), "{words}");
    let (_, words) = ended(folder, &["learn-skills", "--out", "empty"], 3);
    assert!(words.contains("empty is a folder: name a file") && !words.contains("--force"), "{words}");
}

#[test]
fn the_best_checkpoint_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_experiment(folder);
    done(folder, &["train", "--experiment", "small.ron", "--run", "run"]);
    let (_, words) = done(folder, &["eval", "--run", "run", "--checkpoint", "best", "--episodes-per-level", "1"]);
    assert!(words.contains("no checkpoint of run has a return") && words.contains("the last, of step 128"), "{words}");
}
