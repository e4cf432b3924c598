//! Tests of mistakes on the command line and in experiments.

#[cfg(feature = "window")]
use crate::program::command;
use crate::program::{code, errors, lines, playbot, said};

#[test]
fn wrong_names_are_usage_errors_with_the_nearest_right_one() {
    let folder = tempfile::tempdir().expect("a folder");
    for (args, words) in [
        (&["level", "coinrunn"][..], "did you mean `coinrun`?"),
        (&["level", "coinrun", "--mode", "hrad"], "did you mean `hard`?"),
        (&["trace", "coinrun", "--mode", "medium", "--actions", "7"], "valid: easy, hard"),
        (&["trace", "coinrun"], "<--actions <ACTIONS>|--actions-file <FILE>>"),
        (&["trace", "coinrun", "--actions", "1", "--actions-file", "f"], "cannot be used with"),
        (&["trace", "coinrun", "--actions-file", "f"], "give actions with --actions 0,1,2, or with --actions-file"),
        (&["trace", "ant", "--actions", "1"], "`playbot view ant --episode`"),
        (&["demo", "ls", "none"], "playbot record GAME --out none/my.demo"),
        (&["demo", "show", "none.demo"], "playbot record GAME --out none.demo"),
        (&["demo", "merge", "none.demo", "--out", "all.demo"], "playbot record GAME --out none.demo"),
        (&["policy", "show", "none.policy"], "playbot policy export --run RUN --out none.policy"),
        (&["policy", "export", "--run", "none", "--out", "o"], "`playbot train --run none`"),
        (&["eval", "--bot", "serch"], "did you mean `search`?"),
        (&["eval"], "no player to measure"),
        (&["eval", "--bot", "random", "--levels", "hard"], "mode:first..last"),
        (&["bench", "--case", "nonsense"], "sim/coinrun/vector"),
        (&["bench", "coinrnu"], "did you mean `coinrun`?); valid: coinrun, "),
        (&["bench", "coinrnu"], "; `playbot bench --list` lists the cases of all games"),
        (&["bench", "sim/coinrun"], "; `playbot bench --case sim/coinrun` measures the cases with it in their names"),
        (&["bench", "coinrun", "--case", "maze2d"], "no case has `maze2d` in its name; cases: sim/coinrun/"),
        (&["level"], "<GAME>, one of coinrun, "),
        (&["bench", "--threads", "3"], "try `--arenas 66`"),
        (&["bench", "--threads", "0"], "--threads must be at least 1"),
        (&["train", "--run", "r", "--algorithm", "pp"], "did you mean `ppo`?"),
        (&["trace", "maze2d", "--map", "medum", "--actions-file", "f"], "did you mean `medium`?"),
        (&["trace", "maze2d", "--map", "medium+limt=3", "--actions-file", "f"], "did you mean `limit=1000`?"),
        (&["record", "maze2d", "--levels", "medium+sprse:0..1", "--out", "o.demo"], "did you mean `sparse`?"),
        (&["record", "maze2d", "--noise=-0.5", "--out", "o.demo"], "a standard deviation is a finite number"),
        (&["record", "maze2d", "--noise", "-0.5", "--out", "o.demo"], "--noise is -0.5; a standard deviation is"),
        (&["view", "coinrun", "--seed", "-1"], "it must be a whole number, 0 or more"),
        (&["view", "coinrun", "--seed", "18446744073709551616"], "the number is too large"),
        (
            &["trace", "coinrun", "--actions", "a"],
            "`a` is not an action of `coinrun`: write numbers from 0 to 14, or the names",
        ),
        (&["runs", "compare", "r", "--threshold", "abc"], "it must be a number, such as 0.5"),
        (&["runs", "compare", "r", "--threshold", "nan"], "it must be a number, such as 0.5"),
        (&["bench", "coinrun", "--seconds", "inf"], "it must be a number, such as 0.5"),
        (&["eval", "--bot", "robot"], "unknown bot `robot`"),
        (&["level", "maze2d", "--map", "lrage"], "; and there is no file of that name"),
        (&["policy", "export", "--out", "a.policy"], "<--run <RUN>|--skills <SKILLS>|--policy <POLICY>>"),
        (&["train", "--run", "r", "--skills", "no.safetensors"], "`playbot learn-skills --out no.safetensors`"),
        (&["train", "--run", "r", "--steps", "0"], "`steps=0`: must be at least 1\n"),
        (&["config", "show", "--experiment", "no.ron"], "`playbot config show --out no.ron`"),
        (&["record", "coinrun", "--noise", "1.5", "--out", "o.demo"], "a probability lies between 0 and 1"),
        (&["record", "coinrun", "--out", "o.txt"], "this recording is written as .demo"),
        (&["play", "coinrun", "--record", "o"], "this recording is written as .demo"),
        (&["explore", "coinrun", "--out", "o.dem"], "this recording is written as .demo"),
        (&["demo", "merge", "a.demo", "b.demo", "--out", "o"], "this recording is written as .demo"),
        (&["demo", "filter", "a.demo", "--out", "o.txt"], "this recording is written as .demo"),
        (&["demo", "label", "a.demo", "--player", "ada", "--out", "o"], "this recording is written as .demo"),
        (&["demo", "repair", "a.demo", "--out", "o.bak"], "this recording is written as .demo"),
        (&["replay", "a.finding", "--minimise", "--out", "o.demo"], "this finding is written as .finding"),
        (&["demo", "filter", "a.demo", "--out", "o.demo", "--min-return", "nan"], "it must be a number, such as 0.5"),
        (&["demo", "filter", "a.demo", "--out", "o.demo", "--max-return", "inf"], "it must be a number, such as"),
        (&["eval", "--set", "game=maze2d", "--bot", "random", "--levels", "random+size=3x3:0..1"], "size=3x3"),
        (&["fly"], "unrecognized subcommand"),
        (&["train", "--run", "r", "--set", "ppo.gama=1"], "unknown key `ppo.gama`; did you mean `ppo.gamma`?"),
        (&["train", "--run", "r", "--set", "ppo.lr"], "write key=value"),
        (&["quickstart", "--set", "ppo.lr=fast"], "`ppo.lr` must be a number such as 0.0005, not fast"),
        (&["learn-skills", "--out", "s", "--epochs", "0"], "`skills.epochs` must be at least 1"),
        (&["learn-skills", "--out", "s", "--threads", "0"], "it must be at least 1"),
        (&["eval", "--bot", "random", "--threads", "0"], "it must be at least 1"),
        (&["train", "--run", "r", "--threads", "0"], "it must be at least 1"),
        (&["study", "--out", "o", "--threads", "0"], "it must be at least 1"),
        (&["quickstart", "--threads", "0"], "it must be at least 1"),
        (&["learn-skills", "--out", "s", "--threads", "1025"], "it must be at most 1024"),
        (&["study", "--out", "o", "--threads", "18446744073709551615"], "it must be at most 1024"),
        (&["bench", "--threads", "4096", "--arenas", "4096"], "--threads must be at most 1024"),
        (&["view", "coinrun", "--out", "x.svg"], "written as .png"),
        (&["report", "html", "r", "--out", "x.txt"], "written as .html"),
        (&["view", "coinrun", "--level", "hrad:7"], "did you mean `hard`?"),
        (
            &["view", "coinrun", "--mode", "easy", "--level", "hard:7"],
            "`--level hard:7` is of the mode hard, and --mode names",
        ),
        (&["view", "coinrun", "--level", "5", "--episode-number", "3"], "cannot be used with"),
        (&["view", "coinrun", "--greedy"], "--greedy is for policies"),
        (&["test", "coinrun", "--greedy", "--out", "o"], "--greedy is for policies"),
        (&["eval", "--bot", "random", "--greedy"], "--greedy is for policies"),
        (&["eval", "--bot", "random,,search"], "a name is missing beside a comma"),
        (&["test", "coinrun", "--bot", "search,", "--out", "o"], "a name is missing beside a comma"),
        (&["test", "coinrun", "--today", "2027-01-31", "--out", "o"], "cannot be used with"),
        (&["test", "coinrun", "--levels", "hard:0..18446744073709551616", "--out", "o"], "numbers go up to"),
        (&["doctor", "coinrun", "--ticks", "99999999999"], "it must be a whole number from 1 to 4294967295"),
        (&["level", "coinrun", "--png", "a.svg"], "written as .png"),
        (&["runs", "show", "r", "--plot", "x.png"], "written as .svg"),
        (&["runs", "compare", "r", "--plot", "x.png"], "written as .svg"),
        (&["learn-skills", "--out", "s", "--set", "skills.prior_std=Sate"], "did you mean `State`?"),
        (
            &["eval", "--bot", "random", "--set", "eval.episodes_per_level=0"],
            "episodes_per_level=0`: must be at least 1\n",
        ),
        (&["eval", "--bot", "random", "--set", "test=hard"], "mode:first..last"),
        (&["train", "--run", "r", "--algorithm", "bc"], "playbot eval --skills"),
        (
            &["train", "--run", "r", "--algorithm", "bc"],
            "those that are: score-ppo, ppo, score-sac, sac, spirl-ppo, spirl-sac, rlpd\n",
        ),
        (
            &["train", "--run", "r", "--set", "ppo.lr=1"],
            "`playbot learn-skills --set ppo.lr=1 --out skills.safetensors`",
        ),
        (
            &["train", "--run", "none", "--resume"],
            "no run at none: there is no such folder; `playbot train --run none`",
        ),
        (
            &["eval", "--bot", "random", "--levels", "hard:4294967295..4294967296"],
            "level 4294967296 of `hard` does not exist: `coinrun` has levels 0 to 4294967295",
        ),
        (&["test", "coinrun", "--levels", "hard:4294967296", "--out", "t"], "`coinrun` has levels 0 to 4294967295"),
        (&["record", "coinrun", "--levels", "hard:0..4294967296", "--out", "q.demo"], "has too many levels"),
        (
            &["record", "coinrun", "--levels", "hard:4294967290..4294967296", "--out", "q.demo"],
            "`coinrun` has levels 0 to",
        ),
        (&["eval", "--bot", "random,serch"], "did you mean `search`?"),
        (&["eval", "--bot", "random", "--levels", "easy:9..3"], "first level 9 is after last level 3; write easy:3..9"),
        (&["config", "show", "--set", "ppo.minibatches=7"], "64 × 128 = 8192; 8 does"),
        (&["config", "show", "--set", "arenas=0"], "`arenas=0`: must be at least 1"),
        (&["config", "show", "--set", "ppo.lr=NaN"], "`ppo.lr=NaN`: `ppo.lr` must be"),
        (&["config", "show", "--set", "game=conrun"], "did you mean `coinrun`?"),
        // The refusal of a game without a picture is in the tests of foreign games.
        #[cfg(not(feature = "camera"))]
        (&["config", "show", "--set", "observation=Camera"], "this program was built without cameras"),
        (
            &["config", "show", "--set", "arenas=100000", "--set", "worlds=100000"],
            "`worlds=100000`: must be at most 10000",
        ),
        (&["config", "show", "--set", "train=hrad:0..3"], "`train` is hrad:0..3: unknown mode `hrad`"),
        (&["eval", "--set", "game=maze2d", "--set", "test=hard:0..3", "--bot", "random"], "unknown map `hard`"),
        (&["eval", "--set", "game=maze2d", "--set", "test=hard:0..3", "--bot", "random"], "or with --levels"),
        (&["eval", "--bot", "random", "--levels", "umaze:0..3"], "name the game, as in `playbot eval maze2d`"),
        (&["eval", "maze2d", "--set", "test=hard:0..3", "--bot", "random"], "unknown map `hard`"),
        (&["train", "maze2d", "--run", "r", "--set", "game=coinrun"], "`--set` names the game `coinrun`"),
        (&["train", "mase2d", "--run", "r"], "did you mean `maze2d`?"),
        (&["study", "maze2d", "--out", "o", "--rewrite"], "cannot be used with"),
        (&["eval", "--bot", "random", "--plot", "plot.gif"], "is written as .png or .svg"),
        (&["config", "presets", "skil-paper"], "did you mean `skill-paper`?"),
        (&["study", "--out", "o", "--seeds", "1,1"], "seed 1 is there twice"),
        (&["study", "--out", "o", "--set", "variants=[(name: \"a\", set: [\"kl=false\"])]"], "variant `a`"),
    ] {
        let output = playbot(folder.path(), args);
        assert_eq!(code(&output), 3, "{args:?}: {}", errors(&output));
        assert!(errors(&output).contains(words), "{args:?}: {}", errors(&output));
    }
    assert!(!folder.path().join("q.demo").exists(), "nothing was recorded");
}

/// Refusals of `play` that need no display to be seen.
#[cfg(feature = "window")]
#[test]
fn a_window_that_cannot_open_is_refused_before_anything_is_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let refuse = |display: Option<&str>, args: &[&str], words: &[&str]| {
        let mut command = command(folder.path(), &[&["play", "coinrun", "--record", "a.demo"], args].concat());
        command.env_remove("DISPLAY").envs(display.map(|display| ("DISPLAY", display)));
        let (_, errors) = playbot_shell::ended(command, 3);
        assert!(words.iter().any(|words| errors.contains(words)), "{args:?}: {errors}");
        assert!(!folder.path().join("a.demo").exists(), "no recording without a window");
    };
    for (args, words) in [
        (&["--mode", "hrad"][..], "did you mean `hard`?"),
        (&["--bot", "serch"], "did you mean `search`?"),
        (&["--mode", "easy", "--levels", "hard:0..3"], "different modes"),
        (&["--levels", "0..3", "--level", "4"], "none of the levels hard:0..3"),
        (&["--policy", "not-there"], "not-there"),
        (&["--run", "not-there"], "not-there"),
        (&["--bot", "search", "--policy", "b"], "cannot be used with"),
    ] {
        refuse(None, args, &[words]);
    }
    if cfg!(target_os = "linux") {
        refuse(None, &[], &["DISPLAY is not set"]);
        // The second where the machine does not even have the library.
        refuse(Some(":9999"), &[], &["no X server answers at DISPLAY=:9999", "install libx11-6"]);
    }
}

#[test]
fn a_file_where_a_folder_is_wanted_is_left_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("taken");
    std::fs::write(&file, "in the way").expect("writable");
    for args in [
        &["test", "coinrun", "--levels", "easy:0..0", "--out", "taken"][..],
        &["test", "coinrun", "--levels", "easy:0..0", "--out", "taken", "--force"],
        &["watch", "coinrun", "--levels", "easy:0..0", "--once", "--out", "taken"],
    ] {
        let output = playbot(folder.path(), args);
        assert_eq!(code(&output), 3, "{args:?}: {}", errors(&output));
        let words = "taken is a file: name a folder to write into";
        assert!(errors(&output).contains(words), "{args:?}: {}", errors(&output));
    }
    assert_eq!(std::fs::read_to_string(file).expect("kept"), "in the way");
}

#[test]
fn a_level_replaces_a_file_with_force_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("new/a.json");
    let level = |level: &str, more: &[&str], wanted: i32| {
        let args = ["level", "coinrun", "--level", level, "--json", "--out", "new/a.json"];
        let output = playbot(folder.path(), &[&args[..], more].concat());
        assert_eq!(code(&output), wanted, "{}", errors(&output));
        (errors(&output), std::fs::read_to_string(&file).expect("it is there"))
    };
    let (_, first) = level("1", &[], 0);
    let (words, kept) = level("2", &[], 3);
    assert!(words.contains("new/a.json exists: name another file, or overwrite it with --force"), "{words}");
    assert_eq!(kept, first);
    let (_, second) = level("2", &["--force"], 0);
    assert_ne!(second, first);
}

#[test]
fn a_shell_gets_the_verbs_that_it_completes() {
    let folder = tempfile::tempdir().expect("a folder");
    let printed = playbot(folder.path(), &["completions", "bash"]);
    assert_eq!(code(&printed), 0, "{}", errors(&printed));
    let script = said(&printed);
    assert!(script.contains("complete -F") && script.contains("learn-skills"), "{script}");
    let written = playbot(folder.path(), &["completions", "bash", "--out", "new/playbot"]);
    assert_eq!((code(&written), said(&written)), (0, String::new()), "{}", errors(&written));
    assert_eq!(std::fs::read_to_string(folder.path().join("new/playbot")).expect("written"), script);
    let unknown = playbot(folder.path(), &["completions", "bsh"]);
    assert!(code(&unknown) == 3 && errors(&unknown).contains("bash"), "{}", errors(&unknown));
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
