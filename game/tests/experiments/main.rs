//! Tests that the shipped experiments can be run: names, modes, levels and values fit.

mod fair;
#[path = "../shared/program.rs"]
mod program;

use std::path::{Path, PathBuf};

use playbot_games::GAMES;
use playbot_harness::{game::Game, games::Games, held_out::HeldOut, split::LevelSplit};
use playbot_train::{
    Experiment,
    experiment::file::{parse_experiment, read_experiment},
    study::study_runs,
};
use program::done;
use serde_json::Value;

fn game(name: &str) -> &'static dyn Game {
    Games::new(&GAMES).expect("each has a name of its own").get(name).expect("a game")
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/experiments")
}

fn read(name: &str) -> Experiment {
    read_experiment(&folder().join(format!("{name}.ron"))).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn names() -> Vec<String> {
    let entries = std::fs::read_dir(folder()).expect("the folder");
    let stem = |path: PathBuf| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let mut names: Vec<_> = entries.filter_map(|entry| stem(entry.expect("an entry").path())).collect();
    names.sort();
    names
}

#[test]
fn every_experiment_and_every_variant_fits_its_game() {
    for name in names() {
        for run in study_runs(&read(&name)).unwrap_or_else(|error| panic!("{name}: {error}")) {
            let game = game(&run.experiment.game);
            run.experiment.check_levels(game).unwrap_or_else(|error| panic!("{name}, {}: {error}", run.variant));
            run.experiment.score.check_space(game.actions()).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
    }
}

#[test]
fn what_is_held_out_is_not_trained_on_by_another_name() {
    let check = |game: &str, train: &str, test: &str| {
        let (train, test) = (train.parse().expect("a split"), test.parse().expect("a split"));
        let experiment = Experiment { train, test, ..read("maze2d-random") };
        experiment.check_levels(self::game(game)).map_err(|error| error.to_string())
    };
    let senses = ["", "-sighted", "-mapped", "-placed"];
    let games = ["maze2d", "antmaze"].into_iter().flat_map(|game| senses.map(|senses| format!("{game}{senses}")));
    for game in games {
        let game = game.as_str();
        for train in ["random+sparse:0..63", "random+limit=100:50..63", "random+loops=0.3+difficulty=4..8:50..50"] {
            let error = check(game, train, "random:50..99").expect_err("mazes of the same seed");
            assert!(error.contains(train) && error.contains("random:50..99"), "{error}");
        }
        assert_eq!(check(game, "random+sparse:0..49", "random:50..99"), Ok(()));
        // So few rooms that seeds draw the same walls again and again.
        let error = check(game, "random+size=5x5:0..49", "random+size=5x5:50..99").expect_err("the same walls");
        assert!(error.contains("has the layout of one of the training levels"), "{error}");
        assert!(check(game, "random+lops=0.3:0..9", "random:50..99").is_err_and(|error| error.contains("loops")));
    }
    let error = check("maze2d", "medium+limit=600:0..9", "medium:9..9").expect_err("the limit that it has anyway");
    assert!(error.contains("level 9"), "{error}");
    assert_eq!(check("maze2d", "medium+fixed-start:0..9", "medium:9..9"), Ok(()), "another start");
    // Levels 81 and 142 differ in their pictures only.
    let error = check("coinrun", "hard:81..81", "hard:142..142").expect_err("one layout");
    assert!(error.contains("hard:142..142 has the layout of one of the training levels hard:81..81"), "{error}");
    assert_eq!(check("coinrun", "hard:81..81", "hard:142..143"), Ok(()), "143 is new");
}

/// Mazes of the paper's tables and figures, with the compared methods.
const MAZES: [(&str, &[&str]); 10] = [
    ("antmaze-medium", &["score-ppo", "sac", "ppo", "spirl-ppo", "rlpd"]),
    ("antmaze-large", &["score-ppo", "sac", "ppo", "spirl-ppo", "rlpd"]),
    ("antmaze-xl", &["score-ppo", "sac", "ppo", "spirl-ppo", "rlpd"]),
    ("antmaze-to-large", &["score-medium", "score-large", "ppo-medium"]),
    ("antmaze-to-xl", &["score-medium", "score-large", "score-xl", "ppo-large"]),
    (
        "antmaze-ablation",
        &[
            "score-ppo",
            "no-init",
            "no-kl",
            "no-alpha",
            "own-sample-alpha",
            "no-z-no-copy",
            "copy-without-z",
            "bc-start",
            "every-tick",
            "random-z",
            "critic-clock",
            "spirl-ppo",
            "ppo",
        ],
    ),
    ("antmaze-random", &["score-ppo", "ppo", "bc"]),
    ("maze2d-medium", &["score-ppo", "sac", "ppo", "rlpd"]),
    ("maze2d-large", &["score-ppo", "sac", "ppo", "rlpd"]),
    ("maze2d-random", &["score-ppo", "ppo", "bc"]),
];

#[test]
fn mazes_come_at_the_papers_size_and_at_one_for_an_hour() {
    for (name, methods) in MAZES {
        let (paper, hour) = (read(name), read(&format!("{name}-hour")));
        for experiment in [&paper, &hour] {
            let variants: Vec<_> = experiment.variants.iter().map(|variant| variant.name.as_str()).collect();
            assert_eq!(variants, methods, "{name}");
            assert_eq!((&experiment.train, &experiment.test), (&paper.train, &paper.test), "{name}");
        }
        assert_eq!((paper.arenas, paper.ppo.num_steps, paper.skills.gru_layers), (1, 2048, 4), "{name}");
        let hour_steps = match name {
            "antmaze-random" | "antmaze-large" | "antmaze-xl" | "antmaze-to-large" | "antmaze-to-xl" => 3_500_000,
            _ => 1_024_000,
        };
        assert_eq!((hour.steps, hour.arenas, hour.skills.gru_layers), (hour_steps, 64, 1), "{name}");
        let steps = |experiment: &Experiment| -> Vec<u64> {
            study_runs(experiment).expect("valid").iter().map(|run| run.experiment.steps).collect()
        };
        assert!(steps(&paper).iter().all(|&steps| [3_500_000, 17_500_000].contains(&steps)), "{name}");
        assert!(steps(&hour).iter().all(|&steps| steps == hour_steps), "{name}");
    }
}

#[test]
fn what_is_measured_elsewhere_was_learned_where_the_variant_says() {
    for (name, test) in [("antmaze-to-large", "large"), ("antmaze-to-xl", "xl")] {
        for name in [name.to_owned(), format!("{name}-hour")] {
            for run in study_runs(&read(&name)).expect("valid") {
                let (_, map) = run.variant.split_once('-').expect("method and map");
                assert_eq!(
                    (run.experiment.train.mode.as_str(), run.experiment.test.mode.as_str()),
                    (map, test),
                    "{name}"
                );
                assert!(
                    run.experiment.recordings().expect("some").to_string_lossy().contains(map),
                    "{name}, {}",
                    run.variant
                );
            }
        }
    }
}

#[test]
fn what_a_game_is_trained_with_by_itself_comes_with_the_program() {
    let own: Vec<_> =
        GAMES.iter().filter_map(|game| Some((game.name(), game.tools().training.experiment()?))).collect();
    assert_eq!(own.iter().map(|(name, _)| *name).collect::<Vec<_>>(), ["coinrun", "maze2d", "antmaze"]);
    for (name, own) in own {
        // A user of the crate has no other files to build upon.
        let experiment =
            parse_experiment(&own.text, Path::new("nowhere/own.ron")).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((own.origin.to_string(), &*experiment.game), (format!("assets/experiments/{name}.ron"), name));
        let demos = experiment.demos.unwrap_or_else(|| panic!("{name} says from which recordings"));
        assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(&demos).exists(), "{name}: {}", demos.display());
    }
}

/// Returns the command that makes an experiment's recordings, from its file, if it is there.
fn recorded(name: &str) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(folder().join(format!("{name}.ron"))).expect("readable");
    let line = text.lines().find_map(|line| line.trim_start_matches("//").trim().strip_prefix("playbot record "))?;
    Some(line.split_whitespace().map(str::to_owned).collect())
}

/// Returns the value of an option of a command.
fn value<'a>(args: &'a [String], option: &str) -> &'a str {
    let at = args.iter().position(|arg| arg == option).unwrap_or_else(|| panic!("{args:?} has no {option}"));
    &args[at + 1]
}

#[test]
fn demonstrations_are_made_of_the_game_that_is_learned_and_not_of_held_out_levels() {
    let recorded: Vec<_> = names().into_iter().filter_map(|name| Some((recorded(&name)?, name))).collect();
    assert!(recorded.len() >= 10, "only {} say how", recorded.len());
    for (args, name) in recorded {
        let experiment = read(&name);
        assert_eq!(args[0], experiment.game, "{name}");
        let levels: LevelSplit = value(&args, "--levels").parse().expect("a split");
        let game = game(&args[0]);
        game.check_mode(&levels.mode).expect("a mode");
        let hidden = HeldOut::new(game, &experiment.test);
        if args.iter().any(|arg| arg == "--hold-out") {
            let left_out = value(&args, "--hold-out").parse().expect("a split");
            let left_out = HeldOut::new(game, &left_out);
            assert!(experiment.test.levels().all(|level| left_out.contains(&experiment.test.mode, level)), "{name}");
        } else {
            assert_eq!(hidden.first_of(&levels), None, "{name}");
        }
        assert_eq!(Some(Path::new(value(&args, "--out"))), experiment.demos.as_deref(), "{name}");
    }
}

#[test]
fn games_with_senses_are_recorded_cloned_trained_and_measured() {
    let experiments =
        [("maze2d-random-hour", 14), ("maze2d-mapped", 135), ("antmaze-random-hour", 39), ("antmaze-xl-placed", 45)];
    for (name, sees) in experiments {
        let folder = tempfile::tempdir().expect("a folder");
        let run = |args: &[&str]| done(folder.path(), args).0;
        let [game, levels, noise] = {
            let args = recorded(name).expect("says how");
            [args[0].clone(), value(&args, "--levels").to_owned(), value(&args, "--noise").to_owned()]
        };
        run(&["record", &game, "--levels", &levels, "--noise", &noise, "--steps", "2000", "--out", "some.demo"]);
        let file = folder_file(name);
        let sizes = "skills.hidden=[32,32]";
        let experiment = [
            "--experiment",
            &file,
            "--set",
            sizes,
            "--set",
            "arenas=8",
            "--set",
            "checkpoints.every=1",
            "--set",
            "ppo.critic_warmup=0",
        ];
        let learn = ["learn-skills", "--demos", "some.demo", "--epochs", "1", "--out", "skills"];
        run(&[&learn[..], &experiment].concat());
        let train = ["train", "--skills", "skills", "--run", "run", "--steps", "2048"];
        run(&[&train[..], &experiment].concat());
        let levels = format!("{}:64..65", read(name).test.mode);
        let measured = run(&["eval", "--run", "run", "--levels", &levels, "--episodes-per-level", "1", "--json"]);
        let measured: Value = serde_json::from_str(measured.trim()).expect("a line of JSON");
        assert_eq!(measured["episodes"], 2, "{measured}");
        let seen = self::game(&game).observation().len();
        assert_eq!(seen, sees, "{name} is learned by its own experiment");
    }
}

fn folder_file(name: &str) -> String {
    let path = folder().canonicalize().expect("there").join(format!("{name}.ron"));
    path.to_str().expect("plain").to_owned()
}
