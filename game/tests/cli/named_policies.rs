//! Tests of policies with names of their own.

use std::{fs, path::Path};

use serde_json::Value;

use crate::program::{code, done, ended, errors, playbot};

/// Writes a policy with hardly any training.
fn write_policy(folder: &Path, name: &str) {
    let text = r#"(game: "coinrun", train: "easy:0..3", test: "easy:4..5", steps: 128, arenas: 8, worlds: 2,
        algorithm: "ppo", ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8]))"#;
    fs::write(folder.join("small.ron"), text).expect("writable");
    done(folder, &["train", "--experiment", "small.ron", "--run", "run"]);
    done(folder, &["policy", "export", "--run", "run", "--out", name]);
}

/// Returns the testers in the results.
fn tested(folder: &Path, out: &str) -> Value {
    let text = fs::read_to_string(folder.join(out).join("results.json")).expect("results");
    let results: Value = serde_json::from_str(&text).expect("JSON");
    results["testers"].clone()
}

/// Returns their names and files.
fn testers(folder: &Path, out: &str) -> Vec<(String, Option<String>)> {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let testers = tested(folder, out);
    testers
        .as_array()
        .expect("testers")
        .iter()
        .map(|tester| (text(&tester["name"]).expect("a name"), text(&tester["file"])))
        .collect()
}

#[test]
fn a_policy_with_a_name_is_compared_whatever_its_file_is_called() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write_policy(folder, "a.policy");
    fs::create_dir(folder.join("new")).expect("writable");
    for copy in ["b.policy", "odd=name.policy", "new/a.policy"] {
        fs::copy(folder.join("a.policy"), folder.join(copy)).expect("writable");
    }
    let plan = ["test", "coinrun", "--levels", "easy:4..5", "--episodes", "2"];
    let test = |out: &str, more: &[&str]| {
        let output = playbot(folder, &[&plan[..], &["--out", out], more].concat());
        assert!([0, 1].contains(&code(&output)), "{}", errors(&output));
        testers(folder, out)
    };
    let known = |name: &str, file: Option<&str>| (name.to_owned(), file.map(str::to_owned));
    assert_eq!(test("before", &["--policy", "ppo=a.policy"]), [known("ppo", Some("a.policy"))]);
    let after = [&plan[..], &["--against", "before"]].concat();
    let (_, words) = done(folder, &[&after[..], &["--out", "after", "--policy", "ppo=new/a.policy"]].concat());
    assert!(words.contains("nothing has changed by more than chance in 2 levels"), "{words}");
    assert!(!words.contains("left out"), "{words}");
    assert_eq!(testers(folder, "after"), [known("ppo", Some("new/a.policy"))]);
    let (_, words) = ended(folder, &[&after[..], &["--out", "none", "--policy", "b.policy"]].concat(), 3);
    assert!(words.contains("the tester `b.policy` was not there before"), "{words}");

    assert_eq!(test("odd", &["--policy", "odd=name.policy"]), [known("odd=name.policy", None)]);
    let both = ["--policy", "a.policy", "--policy", "other=new/a.policy"];
    assert_eq!(test("both", &both), [known("a.policy", None), known("other", Some("new/a.policy"))]);
    let (_, words) =
        ended(folder, &[&plan[..], &["--out", "same", "--policy", "a.policy", "--policy", "new/a.policy"]].concat(), 3);
    assert!(words.contains("two testers are called `a.policy`: write a name of its own"), "{words}");
    let (_, words) = ended(folder, &[&plan[..], &["--out", "none", "--policy", "ppo=none.policy"]].concat(), 3);
    assert!(words.contains("`playbot policy export --run RUN --out none.policy`"), "{words}");
}

#[test]
fn what_played_is_played_once_more_by_the_command_of_the_summary() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write_policy(folder, "a.policy");
    fs::create_dir(folder.join("new")).expect("writable");
    fs::rename(folder.join("a.policy"), folder.join("new/a.policy")).expect("writable");
    for (out, tester) in [("of-run", ["--run", "run"]), ("of-policy", ["--policy", "new/a.policy"])] {
        let test = ["test", "coinrun", "--levels", "hard:4..5", "--episodes", "2", "--out", out];
        ended(folder, &[&test[..], &tester].concat(), 1);
        let summary = fs::read_to_string(folder.join(out).join("summary.md")).expect("a summary");
        let again = summary.lines().find_map(|line| line.strip_prefix("playbot test ")).expect("a level that was lost");
        let words: Vec<&str> = again.split_whitespace().collect();
        ended(folder, &[&["test"], &words[..], &["--force"]].concat(), 1);
        let place = words.iter().skip_while(|word| **word != "--out").nth(1).expect("a folder");
        assert_eq!(tested(folder, place), tested(folder, out), "{again}");
    }
}
