//! Tests of the verbs that ask little of a game. Each is called once, on few levels, and what it prints is checked. A verb
//! that makes no sense for the game must say so.

use std::fs;

use serde_json::{Value, json};

use crate::{
    game_program::GameProgram,
    output::{ended, ended_in, json_lines},
    shell::Shell,
};

/// No findings, or some: a verb that looks for something has worked.
const DONE: [i32; 2] = [0, 1];

/// Runs the program, which must end with one of these exit codes, and returns its lines of JSON.
#[track_caller]
fn answers(shell: &Shell, args: &[&str], codes: &[i32]) -> Vec<Value> {
    json_lines(&ended_in(shell.command(args), codes).1)
}

/// Runs the program, which must refuse, and checks its words.
#[track_caller]
fn refused(shell: &Shell, args: &[&str], words: &str) {
    let (out, err) = ended(shell.command(args), 3);
    assert!(err.contains(words) && out.is_empty(), "{args:?}: {out}{err}");
}

#[track_caller]
fn is_written(shell: &Shell, names: &[&str]) {
    for name in names {
        assert!(fs::metadata(shell.path(name)).is_ok_and(|file| file.len() > 0), "{name} is not written");
    }
}

/// Scores the set in the folder `bugs` with random actions, one episode of each level, and prints the table.
#[track_caller]
fn score(shell: &Shell) -> Value {
    let score = ["bugs", "score", "bugs", "--tester", "random", "--episodes", "1", "--replays", "0"];
    // Those that play each episode again and again.
    let without = ["--no-detect", "determinism,dead-action,fading-action,entity-leak"];
    let scored = shell.answer(&[&score[..], &without, &["--out", "score.json", "--json"]].concat());
    assert!(shell.done(&["bugs", "table", "score.json"]).contains("random"));
    scored
}

impl GameProgram {
    /// `levels`, `level`, `trace`, `explore` and `eyes`.
    pub fn levels_are_looked_at(&self) {
        let shell = self.with_recording();
        let first = format!("default:{}", self.recorded);
        let two = format!("{first}..{}", self.recorded + 1);

        let audit = answers(&shell, &["levels", self.game, "--levels", &two, "--layouts-only", "--json"], &DONE);
        assert_eq!((&audit[0]["game"], &audit[0]["count"]), (&self.game.into(), &2.into()), "{audit:?}");
        let one = format!("{first}..{}", self.recorded);
        let held = answers(&shell, &["levels", self.game, "--levels", &one, "--json"], &DONE);
        assert!(held[0]["solved_without_action"].is_array(), "it was played: {held:?}");

        let number = self.recorded.to_string();
        let (code, out, err) = ended_in(shell.command(&["level", self.game, "--level", &number]), &[0, 3]);
        let is_explained = err.contains("has no levels to show") && err.contains("view");
        assert!(if code == 0 { !out.trim().is_empty() } else { is_explained }, "{out}{err}");

        // The actions of the demonstrator bring the rewards that were recorded.
        let ticks = shell.answers(&["demo", "show", "few.demo", "--episode", "0", "--json"]);
        let ticks = &ticks[..3];
        let actions: Vec<String> = ticks.iter().map(|tick| tick["action"].to_string()).collect();
        let trace = ["trace", self.game, "--level", &number, "--actions", &actions.join(","), "--json"];
        let rows = shell.answers(&trace);
        let reward = |row: &Value| row.as_array().and_then(|row| row[row.len() - 2].as_f64());
        let close = |(row, tick): (&Value, &Value)| {
            let (traced, recorded) = (reward(row).expect("a number"), tick["reward"].as_f64().expect("a number"));
            (traced - recorded).abs() < 1e-6
        };
        assert!(rows.len() == 3 && rows.iter().zip(ticks).all(close), "{rows:?}: {ticks:?}");

        let explore = ["explore", self.game, "--level", &first, "--steps", "100", "--until", "spent", "--json"];
        let explored = answers(&shell, &explore, &DONE);
        let is_enough = |key: &str, least: u64| explored[0][key].as_u64().is_some_and(|count| count >= least);
        assert!(is_enough("steps", 100) && is_enough("cells", 1), "{explored:?}");

        refused(&shell, &["eyes", self.game], "cannot be drawn by the raster, so there is nothing to compare");
        refused(
            &shell,
            &["view", self.game, "--image", "width=16"],
            &format!("{} cannot be drawn; use `observation: Vector`", self.game),
        );
    }

    /// `test` in shards and without, `replay`, `test --regress` and `report`.
    pub fn levels_are_tested(&self) {
        let shell = self.with_recording();
        let levels = format!("default:{}..{}", self.recorded, self.recorded + 1);
        // Everything is too far from the origin, so that there is something to find.
        let test = ["test", self.game, "--levels", &levels, "--bot", "random", "--detector", "runaway.distance=0.001"];
        for (shard, out) in [("0/2", "a"), ("1/2", "b")] {
            let rows = answers(&shell, &[&test[..], &["--shard", shard, "--out", out, "--json"]].concat(), &[1]);
            assert_eq!(rows.len(), 1, "{rows:?}");
        }
        let merged = answers(&shell, &["report", "merge", "a", "b", "--out", "both", "--json"], &[1]);
        assert_eq!(merged.len(), 2, "{merged:?}");
        is_written(&shell, &["both/results.json", "both/report.html", "both/junit.xml", "both/summary.md"]);
        ended(shell.command(&["report", "html", "both", "--out", "page.html"]), 0);
        is_written(&shell, &["page.html"]);
        // Bots have recorded it.
        refused(&shell, &["report", "calibrate", "both", "few.demo"], "was played by a person");

        let findings = fs::read_dir(shell.path("a/findings")).expect("something was found");
        let finding = findings.map(|file| file.expect("readable").path()).next().expect("something was found");
        let finding = finding.to_str().expect("a name");
        let replayed = shell.answer(&["replay", finding, "--png", "found.png", "--json"]);
        assert_eq!(replayed["status"], "still-there", "{replayed}");
        is_written(&shell, &["found.png"]);
        let again = answers(&shell, &["test", "--regress", "a/findings", "--json"], &[1]);
        assert!(!again.is_empty() && again.iter().all(|row| row["status"] == "still-there"), "{again:?}");
    }

    /// `study`, `quickstart`, `bench`, `runs` and `config`.
    pub fn methods_are_compared(&self) {
        let shell = self.with_tiny_experiment();
        let study = ["study", "--experiment", "tiny.ron", "--seeds", "1", "--out", "study", "--runs", "runs", "--json"];
        let studied = shell.answer(&study);
        let test = &studied["test"];
        assert!(test["return_mean"].as_f64().is_some_and(f64::is_finite), "{studied}");
        is_written(&shell, &["study/table.md", "study/curves.svg", "study/results.json"]);

        let quick = ["quickstart", "--experiment", "tiny.ron", "--run", "quick", "--seeds", "1", "--json"];
        let methods: Vec<Value> = shell.answers(&quick).into_iter().map(|row| row["method"].clone()).collect();
        for method in ["score-ppo", "ppo", "bc", "random"] {
            assert!(methods.contains(&method.into()), "{method} is missing in {methods:?}");
        }
        is_written(&shell, &["quick/report.html"]);

        for case in ["sim", "train"] {
            let case = format!("{case}/{}", self.game);
            let bench = ["bench", "--case", &case, "--seconds", "0.01", "--arenas", "1", "--threads", "1", "--json"];
            let set: &[&str] = if case.starts_with("train") { &["--set", "ppo.num_steps=16"] } else { &[] };
            let measured = shell.answer(&[&bench[..], set].concat());
            assert!(measured["steps_per_s"].as_f64().is_some_and(|speed| speed > 0.0), "{measured}");
        }

        let runs = shell.answers(&["runs", "ls", "quick", "--json"]);
        assert!(runs.len() >= 2 && runs.iter().all(|run| run["game"] == self.game), "{runs:?}");
        let path = runs[0]["path"].as_str().expect("a path");
        assert_eq!(shell.answer(&["runs", "show", path, "--json"])["game"], self.game);
        // No episode has ended in a training as short as this.
        let compared = ended(shell.command(&["runs", "compare", "quick", "--json"]), 0);
        assert!(compared.1.contains("nothing to compare yet") || !compared.0.is_empty(), "{compared:?}");
        assert!(!shell.answers(&["config", "presets", "--json"]).is_empty());
        let script = shell.done(&["completions", "bash"]);
        assert!(script.contains("learn-skills"), "{script}");
    }

    /// `bugs make`, `bugs score` and `bugs table`.
    pub fn defects_are_planted_and_looked_for(&self) {
        let shell = Shell::new(self.program);
        let levels = format!("{}=default:{}..{}", self.game, self.recorded, self.recorded + 999);
        let make = ["bugs", "make", self.game, "--per-kind", "1", "--sound", "1", "--levels", &levels, "--out", "bugs"];
        let made = shell.answer(&[&make[..], &["--json"]].concat());
        assert!(made["mutants"].as_u64().is_some_and(|count| count >= 5) && made["sound"] == 1, "{made}");
        assert_eq!(score(&shell)["mutants"], made["mutants"]);
    }

    /// `bugs score` and `bugs table` of a set written by hand: two defects that games of all kinds can have, and the level
    /// without them.
    pub fn planted_defects_are_scored(&self) {
        let shell = Shell::new(self.program);
        let (game, level) = (self.game, format!("default:{}", self.recorded));
        let mutant = |class: &str| {
            let id = format!("{game}-{class}-00");
            json!({ "id": id, "game": game, "class": class, "about": "it breaks", "base": level, "variant": 0 })
        };
        let set = json!({
            "format": 1,
            "seed": 0,
            "games": [{ "name": game, "version": 1 }],
            "mutants": [mutant("panic"), mutant("error-log")],
            "sound": [{ "game": game, "range": format!("{level}..{}", self.recorded) }],
        });
        fs::create_dir(shell.path("bugs")).expect("writable");
        fs::write(shell.path("bugs/mutants.json"), set.to_string()).expect("writable");
        let scored = score(&shell);
        let tester = &scored["testers"][0];
        let count = |what: &str| (tester[what]["count"].as_u64(), tester[what]["of"].as_u64());
        assert_eq!((count("recall"), count("false_findings")), ((Some(2), Some(2)), (Some(0), Some(1))), "{scored}");
    }

    /// `bugs make` on too few levels, for games whose episodes take too long to plant defects in a test. Those of
    /// [`planted_defects_are_scored`](Self::planted_defects_are_scored) take the place of such a set.
    pub fn defects_need_levels(&self) {
        let shell = Shell::new(self.program);
        let levels = format!("{}={}", self.game, self.held_out);
        let make = ["bugs", "make", self.game, "--per-kind", "1", "--sound", "1", "--levels", &levels, "--out", "bugs"];
        let (out, err) = ended(shell.command(&make), 3);
        let is_explained = err.contains("are needed") && err.contains(self.game);
        assert!(is_explained && out.is_empty() && !shell.path("bugs/mutants.json").exists(), "{out}{err}");
    }
}
