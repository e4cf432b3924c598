//! Tests of trainings whose Worlds play in other processes: the same bytes as in one, whatever happens to them.

#[path = "shared/program.rs"]
mod program;

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};

use playbot_shell::{at_work, logged, results};
use program::{command, done, ended};

/// Trains in `folder/NAME` with these settings, and the options of a cluster.
fn train(folder: &Path, name: &str, settings: &[&str], cluster: &[&str]) -> String {
    let words = [&["train", "--run", name], settings, cluster].concat();
    done(folder, &words).1
}

/// Checks that a training comes to the same bytes on one machine and with 1, 2 and 4 workers.
fn same_with_workers(folder: &Path, settings: &[&str]) {
    train(folder, "here", settings, &[]);
    for workers in ["1", "2", "4"] {
        let name = format!("with-{workers}");
        let said = train(folder, &name, settings, &["--cluster", "processes", "--workers", workers]);
        assert!(said.contains("rollouts of ") && said.contains("of weights"), "{said}");
        let equal = results(&folder.join("here")) == results(&folder.join(&name));
        assert!(equal, "{workers} workers come to other numbers with {settings:?}");
    }
}

const SMALL: [&str; 3] = ["coinrun", "--algorithm", "ppo"];

#[test]
fn each_number_of_workers_comes_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let plr = "train=hard:0..7,test=hard:64..71,arenas=8,worlds=2,steps=2048,ppo.num_steps=32,ppo.hidden=[16],\
               ppo.memory=Gru(hidden: 8),ppo.norm_obs=true,levels.order=Plr()";
    same_with_workers(folder.path(), &settings(&SMALL, plr));
}

/// Returns the words of a training with these settings.
fn settings<'a>(words: &[&'a str], sets: &'a str) -> Vec<&'a str> {
    words.iter().copied().chain(sets.split(',').flat_map(|set| ["--set", set.trim()])).collect()
}

#[test]
fn lessons_in_other_modes_and_numbers_as_actions_do_not_matter() {
    let folder = tempfile::tempdir().expect("a folder");
    let sac = "train=hard:0..7,test=hard:64..71,arenas=4,worlds=1,steps=640,sac.num_steps=32,sac.learning_starts=64,\
               sac.hidden=[16]";
    same_with_workers(folder.path(), &settings(&["coinrun", "--algorithm", "sac"], sac));
    let folder = tempfile::tempdir().expect("a folder");
    let experiment = r#"(
        game: "coinrun", train: "hard:0..7", test: "hard:64..71", steps: 12288, arenas: 8, worlds: 2, algorithm: "ppo",
        curriculum: (lessons: [(levels: "easy:0..7", success: 0.01)], window: 1, mix: 0.25),
        ppo: (num_steps: 64, hidden: [16], minibatches: 2),
    )"#;
    fs::write(folder.path().join("lessons.ron"), experiment).expect("writable");
    same_with_workers(folder.path(), &["--experiment", "lessons.ron"]);
    let log = fs::read_to_string(folder.path().join("here/metrics.jsonl")).expect("written");
    assert!(
        log.lines().last().is_some_and(|line| line.contains(r#""levels/lesson":2"#)),
        "the second lesson was not reached"
    );
}

#[test]
fn skills_are_drawn_by_the_workers() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    done(path, &["record", "maze2d", "--levels", "medium:100..103", "--out", "demos/a.demo"]);
    let sets = "train=medium:0..3,test=medium:64..67,demos=demos,skills.epochs=1,skills.window=5,skills.latent=2,\
                skills.hidden=[16],skills.encoder_hidden=8,skills.gru_hidden=8,skills.norm_obs=true,arenas=4,worlds=1,steps=1024,\
                ppo.num_steps=64,ppo.minibatches=2,score.horizon=4";
    done(path, &[&["learn-skills", "maze2d", "--out", "skills"], &settings(&[], sets)[..]].concat());
    for algorithm in ["score-ppo", "spirl-ppo"] {
        let words = settings(&["maze2d", "--algorithm", algorithm, "--skills", "skills"], sets);
        same_with_workers(path, &[&words[..], &["--force"]].concat());
    }
}

/// Returns the workers of a training.
#[cfg(target_os = "linux")]
fn workers_of(training: u32) -> Vec<u32> {
    let is_child = |process: &u32| {
        let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        let parent = stat.rsplit_once(')').and_then(|(_, rest)| rest.split_whitespace().nth(1)?.parse::<u32>().ok());
        parent == Some(training)
    };
    let all = fs::read_dir("/proc").expect("readable").flatten();
    all.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(is_child).collect()
}

#[cfg(target_os = "linux")]
#[test]
fn a_worker_that_is_killed_is_replaced_and_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let sets = "train=hard:0..7,test=hard:64..71,arenas=8,worlds=2,steps=40960,ppo.num_steps=64,ppo.hidden=[32]";
    let words = settings(&SMALL, sets);
    train(folder.path(), "whole", &words, &[]);
    let run = folder.path().join("killed");
    let cluster = ["train", "--run", "killed", "--cluster", "processes", "--workers", "3"];
    let mut training = command(folder.path(), &[&cluster[..], &words].concat());
    let child = at_work(training.stderr(Stdio::piped()), || logged(&run) >= 3);
    let workers = workers_of(child.id());
    assert_eq!(workers.len(), 3, "the workers of {}", child.id());
    let kill = |signal: &str, worker: u32| {
        let sent = Command::new("kill").args([signal, &worker.to_string()]).status().expect("there is a kill");
        assert!(sent.success());
    };
    // One is slow, and one is lost.
    kill("-STOP", workers[0]);
    kill("-KILL", workers[1]);
    std::thread::park_timeout(Duration::from_millis(300));
    kill("-CONT", workers[0]);
    let ended = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.success() && said.contains("1 worker was lost and replaced"), "{said}");
    assert!(results(&folder.path().join("whole")) == results(&run), "the loss changed the result");
    assert!(workers.iter().all(|worker| !Path::new(&format!("/proc/{worker}")).exists()), "workers are left");
}

#[test]
fn a_training_goes_on_with_workers_or_without() {
    let folder = tempfile::tempdir().expect("a folder");
    let sets = "train=hard:0..7,test=hard:64..71,arenas=8,worlds=2,ppo.num_steps=32,ppo.hidden=[16]";
    let words = settings(&SMALL, sets);
    train(folder.path(), "whole", &[&words[..], &["--steps", "1024"]].concat(), &[]);
    train(
        folder.path(),
        "parts",
        &[&words[..], &["--steps", "512"]].concat(),
        &["--cluster", "processes", "--workers", "2"],
    );
    done(folder.path(), &["train", "--run", "parts", "--resume", "--steps", "768"]);
    let on = ["train", "--run", "parts", "--resume", "--steps", "1024", "--cluster", "processes", "--workers", "3"];
    done(folder.path(), &on);
    let metrics = |run: &str| fs::read(folder.path().join(run).join("metrics.jsonl")).expect("written");
    assert!(metrics("whole") == metrics("parts"));
}

#[test]
fn what_a_cluster_cannot_do_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let sets = settings(
        &["train", "coinrun", "--algorithm", "ppo", "--run", "r"],
        "arenas=2,worlds=1,steps=64,ppo.num_steps=32",
    );
    let refused = |more: &[&str], wanted| ended(folder.path(), &[&sets[..], &["--force"], more].concat(), wanted).1;
    let said = refused(&["--cluster", "nowhere"], 3);
    assert!(said.contains("write `processes`, `ray`"), "{said}");
    let said = refused(&["--workers", "2"], 3);
    assert!(said.contains("--cluster"), "{said}");
    let said = refused(&["--cluster", "processes", "--workers", "1", "--worker-program", "no/such"], 2);
    assert!(said.contains("no/such") && said.contains("--worker-program"), "{said}");
    let said = refused(&["--cluster", "processes", "--workers", "1", "--worker-program", "/bin/false"], 2);
    assert!(said.contains("worker 0 was lost 5 times") && said.contains("exit status: 1"), "{said}");
    let mut python = command(folder.path(), &[&sets[..], &["--force", "--cluster", "ray"]].concat());
    let said = playbot_shell::output(python.env("PLAYBOT_PYTHON", "no-python")).expect("it starts");
    assert!(program::errors(&said).contains("install `playbot[ray]`"), "{}", program::errors(&said));
    let said =
        ended(folder.path(), &["test", "coinrun", "--levels", "easy:0..3", "--out", "t", "--cluster", "processes"], 3)
            .1;
    assert!(said.contains("--threads"), "{said}");
}
