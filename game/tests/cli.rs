//! The program as its users call it.

use std::{
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;

fn playbot(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_playbot")).args(args).current_dir(folder).output().expect("the program starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("not killed")
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn lines(output: &Output) -> Vec<Value> {
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}

#[test]
fn wrong_names_are_usage_errors_with_the_nearest_right_one() {
    let folder = tempfile::tempdir().expect("a folder");
    for (args, words) in [
        (&["level", "coinrunn"][..], "did you mean `coinrun`?"),
        (&["level", "coinrun", "--mode", "hrad"], "did you mean `hard`?"),
        (&["trace", "coinrun", "--mode", "medium", "--actions", "7"], "valid: easy, hard"),
        (&["eval", "--bot", "serch"], "did you mean `search`?"),
        (&["eval"], "nobody to measure"),
        (&["eval", "--bot", "random", "--levels", "hard"], "mode:first..last"),
        (&["bench", "--case", "nonsense"], "sim/coinrun/vector"),
        (&["train", "--run", "r", "--algorithm", "pp"], "did you mean `ppo`?"),
        (&["trace", "maze2d", "--map", "medum", "--actions-file", "f"], "did you mean `medium`?"),
        (&["trace", "maze2d", "--map", "medium+limt=3", "--actions-file", "f"], "did you mean `limit=1000`?"),
        (&["record", "maze2d", "--levels", "medium+sprse:0..1", "--out", "o"], "did you mean `sparse`?"),
        (&["record", "maze2d", "--noise=-0.5", "--out", "o"], "a standard deviation is a finite number"),
        (&["record", "coinrun", "--noise", "1.5", "--out", "o"], "a probability lies between 0 and 1"),
        (&["eval", "--set", "game=maze2d", "--bot", "random", "--levels", "random+size=3x3:0..1"], "size=3x3"),
        (&["fly"], "unrecognized subcommand"),
        (&["train", "--run", "r", "--set", "ppo.gama=1"], "unknown key `ppo.gama`; did you mean `ppo.gamma`?"),
        (&["train", "--run", "r", "--set", "ppo.lr"], "write key=value"),
        (&["quickstart", "--set", "ppo.lr=fast"], "`ppo.lr` must be a number such as 0.0005, not fast"),
        (&["learn-skills", "--out", "s", "--epochs", "0"], "epochs must be at least 1"),
        (&["learn-skills", "--out", "s", "--threads", "0"], "it must be at least 1"),
        (&["eval", "--bot", "random", "--threads", "0"], "it must be at least 1"),
        (&["train", "--run", "r", "--threads", "0"], "it must be at least 1"),
        (&["study", "--out", "o", "--threads", "0"], "it must be at least 1"),
        (&["quickstart", "--threads", "0"], "it must be at least 1"),
        (&["view", "coinrun", "--out", "x.svg"], "written as .png"),
        (&["level", "coinrun", "--png", "a.svg"], "written as .png"),
        (&["runs", "show", "r", "--plot", "x.png"], "written as .svg"),
        (&["runs", "compare", "r", "--plot", "x.png"], "written as .svg"),
        (&["learn-skills", "--out", "s", "--set", "skills.prior_std=Sate"], "did you mean `State`?"),
        (&["eval", "--bot", "random", "--set", "eval.episodes_per_level=0"], "at least one episode"),
        (&["eval", "--bot", "random", "--set", "test=hard"], "mode:first..last"),
        (&["train", "--run", "r", "--algorithm", "bc"], "playbot eval --skills"),
        (&["config", "show", "--set", "ppo.minibatches=7"], "64 × 128 = 8192; 8 does"),
        (&["config", "show", "--set", "arenas=0"], "`arenas=0`: `arenas` is 0"),
        (&["config", "show", "--set", "ppo.lr=NaN"], "`ppo.lr=NaN`: ppo lr must be"),
        (&["config", "show", "--set", "game=conrun"], "did you mean `coinrun`?"),
        (&["config", "show", "--set", "train=hrad:0..3"], "`train` is hrad:0..3: unknown mode `hrad`"),
        (&["eval", "--set", "game=maze2d", "--bot", "random"], "`test` is hard:64..127: unknown map `hard`"),
        (&["eval", "--set", "game=maze2d", "--bot", "random"], "or with --levels"),
        (&["eval", "--bot", "random", "--plot", "plot.gif"], "is written as .png or .svg"),
        (&["config", "presets", "skil-paper"], "did you mean `skill-paper`?"),
        (&["study", "--out", "o", "--seeds", "1,1"], "seed 1 is there twice"),
        (&["study", "--out", "o", "--set", "variants=[(name: \"a\", set: [\"kl=false\"])]"], "variant `a`"),
    ] {
        let output = playbot(folder.path(), args);
        assert_eq!(code(&output), 3, "{args:?}: {}", errors(&output));
        assert!(errors(&output).contains(words), "{args:?}: {}", errors(&output));
    }
}

#[test]
fn an_unknown_key_names_file_line_and_neighbour() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = folder.path().join("bad.ron");
    let text = "(\n    game: \"coinrun\",\n    trian: \"hard:0..63\",\n)\n";
    std::fs::write(&config, text).expect("writable");
    let output = playbot(folder.path(), &["train", "--run", "r", "--experiment", "bad.ron"]);
    assert_eq!(code(&output), 3);
    let errors = errors(&output);
    assert!(errors.contains("bad.ron:3:") && errors.contains("`trian`") && errors.contains("`train`"), "{errors}");
    assert!(!folder.path().join("r").exists(), "nothing is written for a bad experiment");
}

#[test]
fn an_experiment_can_be_shown_with_all_its_values_and_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = |args: &[&str]| {
        let output = playbot(folder.path(), &[&["config", "show"], args].concat());
        assert_eq!(code(&output), 0, "{}", errors(&output));
        String::from_utf8(output.stdout).expect("Unicode")
    };
    std::fs::write(folder.path().join("least.ron"), "(base: [\"d4rl-ppo\"], game: \"coinrun\", train: \"hard:0..3\", test: \"hard:4..5\", demos: \"d\", steps: 9, ppo: (epochs: 2))").expect("writable");
    let shown = show(&["--experiment", "least.ron", "--set", "score.kl_coef=0.25"]);
    let warned = playbot(folder.path(), &["config", "show", "--experiment", "least.ron"]);
    assert!(errors(&warned).contains("there are no recordings at d"), "{}", errors(&warned));
    for line in
        ["steps: 9,", "epochs: 2,", "num_steps: 2048,", "kl_coef: 0.25,", "algorithm: \"score-ppo\",", "horizon: 8,"]
    {
        assert!(shown.contains(line), "{line}: {shown}");
    }
    std::fs::write(folder.path().join("shown.ron"), &shown).expect("writable");
    assert_eq!(show(&["--experiment", "shown.ron"]), shown);
    let presets = playbot(folder.path(), &["config", "presets", "--json"]);
    assert!(lines(&presets).iter().any(|preset| preset["name"] == "skill-paper"));
}

#[test]
fn traces_stop_at_the_end_and_read_back_exactly() {
    let folder = tempfile::tempdir().expect("a folder");
    let actions = vec!["8"; 200].join(",");
    let output =
        playbot(folder.path(), &["trace", "coinrun", "--mode", "hard", "--seed", "0", "--actions", &actions, "--json"]);
    let steps = lines(&output);
    assert_eq!(steps.len(), 63);
    assert_eq!(steps[0], serde_json::json!([1.5999999, 3.0787, 0.1, 1.5, 0, 0]));
    assert_eq!((&steps[62][4], &steps[62][5]), (&Value::from(10), &Value::from(1)));
    std::fs::write(folder.path().join("actions.txt"), actions.replace(',', "\n")).expect("writable");
    let from_file =
        playbot(folder.path(), &["trace", "coinrun", "--seed", "0", "--actions-file", "actions.txt", "--json"]);
    assert_eq!(output.stdout, from_file.stdout);
    let wrong = playbot(folder.path(), &["trace", "coinrun", "--actions", "99", "--json"]);
    assert_eq!(code(&wrong), 3);
    assert!(errors(&wrong).contains("action 99 is outside 0..15"), "{}", errors(&wrong));
}

#[test]
fn traces_of_maze2d_are_the_published_numbers_and_name_the_line_of_a_mistake() {
    let folder = tempfile::tempdir().expect("a folder");
    let trace = |pushes: &str, rest: &[&str]| {
        std::fs::write(folder.path().join("pushes.txt"), pushes).expect("writable");
        let args = ["trace", "maze2d", "--map", "medium", "--actions-file", "pushes.txt", "--json"];
        playbot(folder.path(), &[&args, rest].concat())
    };
    let start = &["--start", "1,1,0,0"][..];
    let output = trace(&"1 0\n".repeat(12), start);
    assert_eq!(code(&output), 0, "{}", errors(&output));
    let steps = lines(&output);
    let value = |step: usize, index: usize| steps[step - 1][index].as_f64().expect("a number");
    assert_eq!((steps.len(), value(12, 1), value(12, 3)), (12, 1.0, 0.0));
    for (step, x, v) in [(5, 1.035611, 1.185160), (10, 1.130059, 2.356275), (12, 1.184155, 2.820825)] {
        assert!((value(step, 0) - x).abs() < 1e-6 && (value(step, 2) - v).abs() < 1e-6, "step {step}");
    }
    let clipped = trace(&"7 0\n".repeat(12), start);
    assert_eq!(clipped.stdout, output.stdout);
    assert!(errors(&clipped).contains("12 pushes lay outside -1 to 1"), "{}", errors(&clipped));
    for (pushes, rest, words) in [
        ("1 0\n\n1 x\n", start, "pushes.txt, line 3: `1 x` is no push"),
        ("1 0\n1 NaN\n", start, "pushes.txt, line 2"),
        ("1 0 0\n", start, "pushes.txt, line 1"),
        ("\n", start, "pushes.txt has no pushes"),
        ("1 0\n", &["--start", "1,1"], "--start has 2 numbers"),
        ("1 0\n", &["--start", "1,1,inf,0"], "--start has inf"),
        ("1 0\n", &["--start", "0,0,0,0"], "lies in a wall"),
    ] {
        let output = trace(pushes, rest);
        assert_eq!(code(&output), 3, "{pushes:?}");
        assert!(errors(&output).contains(words), "{}", errors(&output));
        assert!(output.stdout.is_empty(), "nothing is printed before the mistake is found");
    }
}

#[test]
fn blind_bots_score_what_they_score_in_the_original() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = playbot(
        folder.path(),
        &[
            "eval",
            "--bot",
            "right-jump",
            "--episodes-per-level",
            "1",
            "--levels",
            "hard:64..127",
            "--levels",
            "hard:0..63",
            "--json",
        ],
    );
    let rows = lines(&output);
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[0]["split"], "hard:64..127");
    assert_eq!((rows[0]["episodes"].as_u64(), rows[0]["return_mean"].as_f64()), (Some(64), Some(5.46875)));
    assert_eq!((rows[1]["method"].as_str(), rows[1]["return_mean"].as_f64()), (Some("right-jump"), Some(6.40625)));
}

#[test]
fn a_measurement_outlives_its_plot() {
    let folder = tempfile::tempdir().expect("a folder");
    let eval = |plot: &str| {
        let levels = ["--levels", "hard:64..64", "--episodes-per-level", "1"];
        playbot(folder.path(), &[&["eval", "--bot", "right-jump", "--plot", plot], &levels[..]].concat())
    };
    std::fs::create_dir(folder.path().join("taken.svg")).expect("writable");
    std::fs::write(folder.path().join("file"), "").expect("writable");
    for (plot, words, code_then) in [("taken.svg", "is a folder", 3), ("file/plot.svg", "cannot create file", 2)] {
        let output = eval(plot);
        assert_eq!(code(&output), code_then, "{}", errors(&output));
        assert!(errors(&output).contains(words), "{}", errors(&output));
        assert!(output.stdout.is_empty(), "found out before anything is measured");
    }
    let output = eval("new/folder/plot.svg");
    assert_eq!(code(&output), 0, "{}", errors(&output));
    let svg = std::fs::read_to_string(folder.path().join("new/folder/plot.svg")).expect("drawn");
    assert!(svg.contains("crates and the like"), "level 64 has crates");
    let line = svg.split("<polyline points=\"").find(|line| line.contains("stroke-width=\"1.8\"")).expect("a trail");
    let (x, y) = line.split(' ').next().and_then(|point| point.split_once(',')).expect("a point");
    assert!(svg.contains(&format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"6\"")), "it begins at {x}, {y}, not at the start");
    // A file name that is too long is found out only when it is written.
    let late = eval(&format!("{}.svg", "x".repeat(300)));
    assert_eq!(code(&late), 2, "{}", errors(&late));
    assert!(String::from_utf8_lossy(&late.stdout).contains("right-jump"), "the table is there all the same");
}

#[cfg(all(target_os = "linux", feature = "camera"))]
#[test]
fn cameras_work_silently_without_a_desktop() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(env!("CARGO_BIN_EXE_playbot"));
    command.args(["eyes", "coinrun", "--levels", "hard:0..0", "--frames", "1"]).current_dir(folder.path());
    let output = command.env_remove("XDG_RUNTIME_DIR").env_remove("NODEVICE_SELECT").output().expect("it starts");
    assert_eq!(code(&output), 0, "{}", errors(&output));
    assert!(!errors(&output).contains("XDG_RUNTIME_DIR"), "{}", errors(&output));
}

#[cfg(target_os = "linux")]
#[test]
fn nobody_listening_stops_no_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let deaf = |args: &[&str]| {
        let full = std::fs::File::create("/dev/full").expect("a disk that is always full");
        let mut command = Command::new(env!("CARGO_BIN_EXE_playbot"));
        command.args(args).current_dir(folder.path()).stderr(full).output().expect("the program starts")
    };
    let recorded = deaf(&["record", "coinrun", "--levels", "easy:0..3", "--out", "a.demo"]);
    assert_eq!(code(&recorded), 0);
    let learned = deaf(&["learn-skills", "--demos", "a.demo", "--epochs", "1", "--out", "skills"]);
    assert_eq!(code(&learned), 0);
    assert!(folder.path().join("skills").exists());
    assert_eq!(code(&deaf(&["level", "maze2d", "--map", "nope"])), 3, "a mistake is one even if nobody is told");
}

#[test]
fn recording_verifying_and_repairing_from_the_shell() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| playbot(folder.path(), args);
    let output = run(&["record", "coinrun", "--levels", "easy:0..3", "--noise", "0.2", "--out", "a.demo"]);
    assert_eq!(code(&output), 0, "{}", errors(&output));
    let again = run(&["record", "coinrun", "--levels", "easy:0..3", "--out", "a.demo"]);
    assert_eq!(code(&again), 3, "an existing recording is not overwritten");
    let verified = run(&["demo", "verify", "a.demo", "--json"]);
    assert_eq!(code(&verified), 0, "{}", errors(&verified));
    assert_eq!(lines(&verified)[0]["report"]["episodes"], 4);
    assert_eq!(lines(&run(&["demo", "ls", "a.demo", "--json"]))[0]["episodes"], 4);
    assert_eq!(lines(&run(&["demo", "show", "a.demo", "--json"])).len(), 4);

    let bytes = std::fs::read(folder.path().join("a.demo")).expect("readable");
    std::fs::write(folder.path().join("torn.demo"), &bytes[..bytes.len() - 5]).expect("writable");
    let torn = run(&["demo", "verify", "torn.demo"]);
    assert_eq!(code(&torn), 1, "damage is a finding: {}", errors(&torn));
    assert!(said(&torn).contains("playbot demo repair"), "{}", said(&torn));
    let mended = run(&["demo", "repair", "torn.demo", "--out", "mended.demo", "--json"]);
    assert_eq!(lines(&mended)[0]["kept_episodes"], 3);
    assert_eq!(code(&run(&["demo", "verify", "mended.demo"])), 0);

    let mut flipped = bytes;
    let middle = flipped.len() / 2;
    flipped[middle] ^= 16;
    std::fs::write(folder.path().join("flipped.demo"), flipped).expect("writable");
    let flipped = run(&["demo", "verify", "flipped.demo"]);
    assert_eq!(code(&flipped), 1);
    assert!(said(&flipped).contains("byte"), "{}", said(&flipped));
}

#[test]
fn a_small_run_from_demonstrations_to_evaluation() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| playbot(folder.path(), args);
    let config = r#"(
        game: "coinrun", train: "hard:0..3", test: "hard:64..65", demos: "demos", steps: 512, arenas: 8, worlds: 2,
        skills: (window: 5, epochs: 1, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
        ppo: (num_steps: 16, minibatches: 2, hidden: [16, 16]),
        eval: (episodes_per_level: 1),
    )"#;
    std::fs::write(folder.path().join("tiny.ron"), config).expect("writable");
    std::fs::create_dir(folder.path().join("demos")).expect("writable");
    let ok = |output: Output| {
        assert_eq!(code(&output), 0, "{}", errors(&output));
        output
    };
    ok(run(&["record", "coinrun", "--levels", "easy:0..7", "--out", "demos/a.demo"]));
    ok(run(&["learn-skills", "--experiment", "tiny.ron", "--out", "skills.safetensors"]));
    let train = ["train", "--experiment", "tiny.ron", "--skills", "skills.safetensors", "--run", "runs/a"];
    ok(run(&train));
    let again = run(&train);
    assert_eq!(code(&again), 3);
    assert!(errors(&again).contains("--force"), "{}", errors(&again));
    ok(run(&["train", "--run", "runs/a", "--resume", "--steps", "1024"]));
    let rows =
        lines(&ok(run(&["eval", "--run", "runs/a", "--skills", "skills.safetensors", "--bot", "random", "--json"])));
    let methods: Vec<_> = rows.iter().filter_map(|row| row["method"].as_str()).collect();
    assert_eq!(methods, ["score-ppo", "bc", "random"]);
    assert!(rows.iter().all(|row| row["split"] == "hard:64..65" && row["episodes"] == 2));

    let mut swapped = vec!["train", "--experiment", "tiny.ron", "--algorithm", "ppo", "--run", "runs/b"];
    swapped.extend(["--set", "train=hard:64..65", "--set", "test=hard:0..3", "--steps", "128"]);
    ok(run(&swapped));
    let eval = |more: &[&str]| run(&[&["eval", "--run", "runs/a", "--run", "runs/b", "--json"], more].concat());
    let seen = eval(&[]);
    assert_eq!(code(&seen), 3);
    for words in ["runs/b was trained on hard:64..65", "held-out levels hard:64..65", "--levels"] {
        assert!(errors(&seen).contains(words), "{}", errors(&seen));
    }
    assert_eq!(lines(&ok(eval(&["--levels", "hard:64..65"]))).len(), 2, "on purpose");
    let saved = folder.path().join("runs/b/experiment.ron");
    let text = std::fs::read_to_string(&saved).expect("written").replace("\"coinrun\"", "\"maze\"");
    std::fs::write(&saved, text).expect("writable");
    let foreign = eval(&["--levels", "hard:64..65"]);
    assert_eq!(code(&foreign), 3);
    assert!(errors(&foreign).contains("runs/b is a run of `maze`"), "{}", errors(&foreign));

    let quick = ok(run(&["quickstart", "--experiment", "tiny.ron", "--run", "runs/quick", "--json"]));
    let methods: Vec<_> = lines(&quick).iter().filter_map(|row| row["method"].as_str().map(str::to_owned)).collect();
    assert_eq!(methods, ["score-ppo", "ppo", "bc", "right-jump", "random"]);
    let report = std::fs::read_to_string(folder.path().join("runs/quick/report.html")).expect("written");
    assert!(report.contains("score-ppo") && report.contains("<svg"));

    std::fs::write(folder.path().join("not.safetensors"), b"nothing of the kind").expect("writable");
    let foreign = run(&["eval", "--skills", "not.safetensors"]);
    assert_eq!(code(&foreign), 3, "{}", errors(&foreign));
}
