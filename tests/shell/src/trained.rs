//! Tests of the verbs around policies.

use std::process::Stdio;

use serde_json::Value;

use crate::{
    at_work::{at_work, kill},
    game_program::{GameProgram, UPDATES},
    output::{ended, json_lines},
    run_folder::{logged, results},
    shell::Shell,
};

const TRAIN: [&str; 5] = ["train", "--experiment", "small.ron", "--skills", "skills.safetensors"];

/// Returns the JSON of `eval --json` for one player on these levels, two of them. They are named, so that levels which play
/// like trained ones are measured as well.
fn measured(shell: &Shell, who: &[&str], levels: &str) -> Value {
    let row = shell.answer(&[&["eval", "--json", "--levels", levels], who].concat());
    assert_eq!((&row["split"], &row["episodes"]), (&levels.into(), &2.into()), "{row}");
    for key in ["return_mean", "return_se", "success", "length_mean", "clipped"] {
        assert!(row[key].as_f64().is_some_and(f64::is_finite), "{key}: {row}");
    }
    assert!(row["length_mean"].as_f64().is_some_and(|ticks| ticks >= 1.0), "{row}");
    row
}

impl GameProgram {
    /// `record`, `learn-skills`, `train`, and `train --resume` after a kill, which comes to the same bytes as an
    /// undisturbed training.
    pub fn a_killed_training_goes_on_bit_for_bit(&self) {
        let shell = self.with_skills();
        shell.done(&[&TRAIN[..], &["--run", "whole"]].concat());
        let (whole, killed) = (shell.path("whole"), shell.path("killed"));
        assert_eq!(logged(&whole), UPDATES);
        let mut command = shell.command(&[&TRAIN[..], &["--run", "killed"]].concat());
        kill(at_work(command.stderr(Stdio::null()), || logged(&killed) >= 7));
        assert!(logged(&killed) < UPDATES, "it was killed too late to prove anything");
        shell.done(&["train", "--resume", "--run", "killed"]);
        let [metrics, weights, arenas] = results(&whole);
        let resumed = results(&killed);
        assert!(metrics == resumed[0], "killing it changed the metrics");
        assert!(weights == resumed[1], "killing it changed the weights");
        assert!(arenas == resumed[2], "killing it changed what its arenas do");
    }

    /// `teach`: a policy by imitation, better ones by training, and the same command goes on where it was. With
    /// `--until-input-ends` it stops with its input, and loses nothing.
    pub fn a_lesson_is_given_and_goes_on(&self) {
        let shell = self.with_recording();
        let few = ["arenas=2", "worlds=2", "skills.epochs=2", "ppo.num_steps=64", "ppo.minibatches=2"];
        let sets = few.iter().flat_map(|set| ["--set", *set]);
        let teach: Vec<&str> = ["teach", self.game, "--demos", "few.demo", "--out", "lessons", "--json"].into();
        let teach: Vec<&str> = teach.into_iter().chain(sets).collect();
        // The test's own input is empty.
        let (said, _) = ended(shell.command(&[&teach[..], &["--until-input-ends", "--steps", "512"]].concat()), 130);
        let events = |lines: &[Value], event: &str| lines.iter().filter(|line| line["event"] == event).count();
        let stopped = json_lines(&said);
        assert_eq!((events(&stopped, "stopped"), events(&stopped, "finished")), (1, 0), "{stopped:?}");

        let lines = shell.answers(&[&teach[..], &["--steps", "512"]].concat());
        assert_eq!((events(&lines, "stopped"), events(&lines, "finished")), (0, 1), "{lines:?}");
        let policies: Vec<&Value> = lines.iter().filter(|line| line["event"] == "policy").collect();
        let own = policies[0]["file"].as_str().expect("a path").to_owned();
        assert!(own.starts_with("lessons/") && policies.iter().all(|policy| policy["file"] == own), "{policies:?}");
        assert_eq!(policies.first().map(|policy| &policy["stage"]), Some(&"imitation".into()), "{policies:?}");
        let card = &shell.answer(&["policy", "show", "lessons/learned.policy", "--json"])["card"];
        assert_eq!(card["game"], self.game, "{card}");

        // A longer lesson goes on, and does not imitate again.
        let lines = shell.answers(&[&teach[..], &["--steps", "1024"]].concat());
        let steps: Vec<u64> =
            lines.iter().filter(|line| line["stage"] == "training").filter_map(|line| line["done"].as_u64()).collect();
        assert_eq!((steps.first(), steps.last()), (Some(&640), Some(&1024)), "{lines:?}");
        let imitated = lines.iter().any(|line| line["event"] == "progress" && line["stage"] == "imitation");
        assert!(!imitated, "{lines:?}");
        // It begins with the policy that is there.
        assert_eq!(lines.iter().find(|line| line["event"] == "policy"), policies.last().copied(), "{lines:?}");
        // Other settings begin a lesson of their own, and the policy of the first one stays.
        let kept = shell.read(&own);
        let lines = shell.answers(&[&teach[..], &["--steps", "128", "--set", "ppo.lr=0.01"]].concat());
        let other = lines.iter().find(|line| line["event"] == "policy").and_then(|line| line["file"].as_str());
        assert!(other.is_some_and(|other| other != own), "{lines:?}");
        assert_eq!(shell.read(&own), kept);
        let (_, refused) = ended(shell.command(&["teach", self.game, "--demos", "none.demo", "--out", "lessons"]), 3);
        assert!(refused.contains("none.demo"), "{refused}");
    }

    /// `eval` of the demonstrator, of a run and of the policy file that `policy export` makes of it, which plays the
    /// same.
    pub fn a_policy_file_plays_as_its_run(&self) {
        let shell = self.with_skills();
        // However little it has learned.
        shell.done(&[&TRAIN[..], &["--set", "steps=256", "--run", "run"]].concat());
        let of_bot = measured(&shell, &["--bot", self.demonstrator, "--experiment", "small.ron"], self.held_out);
        assert_eq!(of_bot["method"], self.demonstrator);
        assert!(of_bot["return_mean"].as_f64().is_some_and(|sum| sum > 0.0), "the demonstrator earns: {of_bot}");
        let of_run = measured(&shell, &["--run", "run"], self.held_out);
        assert_eq!(of_run["method"], "score-ppo");
        shell.done(&["policy", "export", "--run", "run", "--out", "bot.policy"]);
        let metadata = &shell.answer(&["policy", "show", "bot.policy", "--json"])["card"];
        assert_eq!((&metadata["game"], &metadata["algorithm"]), (&self.game.into(), &"score-ppo".into()), "{metadata}");
        let of_file = measured(&shell, &["--policy", "bot.policy", "--experiment", "small.ron"], self.held_out);
        assert_eq!(of_file, of_run, "the file plays otherwise than the run it was made of");
    }
}
