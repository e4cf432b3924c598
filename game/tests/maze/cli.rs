//! Tests of `playbot level` and `playbot eval --plot` through the command line.

use playbot_games::maze::{MazeSpec, generate};
use serde_json::{Value, json};

use crate::program::{done, ended};

fn level(args: &[&str]) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    let (line, _) = done(folder.path(), &[&["level"], args, &["--json"]].concat());
    serde_json::from_str(&line).expect("a line of JSON")
}

#[test]
fn a_level_is_rows_start_goal_and_the_length_of_its_path() {
    let medium = level(&["maze2d", "--map", "medium"]);
    let rows = ["########", "#SO##OO#", "#OO#OOO#", "##OOO###", "#OO#OOO#", "#O#OO#O#", "#OOO#OG#", "########"];
    assert_eq!(medium, json!({ "rows": rows, "start": [1, 1], "goal": [6, 6], "shortest_path_length": 10 }));
    assert_eq!(level(&["antmaze", "--map", "medium"]), medium);
    assert_eq!(level(&["antmaze", "--map", "xl"])["shortest_path_length"], 29);
    let (ball, ant) = (level(&["maze2d", "--map", "umaze"]), level(&["antmaze", "--map", "umaze"]));
    assert_eq!((&ball["goal"], &ant["goal"]), (&json!([1, 1]), &json!([3, 1])));
    for senses in ["sighted", "mapped", "placed"] {
        assert_eq!(level(&[&format!("maze2d-{senses}"), "--map", "umaze"]), ball);
        assert_eq!(level(&[&format!("antmaze-{senses}"), "--map", "umaze"]), ant);
    }
}

#[test]
fn a_seed_makes_a_maze_and_options_shape_it() {
    let default = generate(&MazeSpec::default(), 7).expect("a maze");
    assert_eq!(level(&["maze2d", "--map", "random", "--level", "7"])["rows"], json!(default.to_rows()));
    let wide = MazeSpec { rows: 9, columns: 13, corridor: 2, ..MazeSpec::default() };
    let map = "random+size=9x13+corridor=2";
    let rows = json!(generate(&wide, 64).expect("a maze").to_rows());
    assert_eq!(level(&["antmaze", "--map", map, "--level", "64"])["rows"], rows);
}

#[test]
fn people_see_the_path() {
    let folder = tempfile::tempdir().expect("a folder");
    let shown = done(folder.path(), &["level", "antmaze", "--map", "umaze"]).0;
    assert!(shown.starts_with("#####\n#S..#\n###.#\n#G..#\n#####\n") && shown.contains("6 moves"), "{shown}");
}

#[test]
fn a_file_of_rows_is_a_map() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("mine.txt"), "11111\r\n1r0g1\r\n11111\r\n\n").expect("writable");
    let args = ["level", "maze2d", "--map", "mine.txt", "--json", "--png", "mine.png"];
    let shown: Value = serde_json::from_str(&done(folder.path(), &args).0).expect("JSON");
    assert_eq!((&shown["rows"][1], &shown["shortest_path_length"]), (&json!("#SOG#"), &json!(2)));
    let file = std::fs::File::open(folder.path().join("mine.png")).expect("drawn");
    let size = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG").info().size();
    assert_eq!(size, (160, 96), "five by three cells, 32 pixels each");
}

#[test]
fn what_is_shown_can_be_edited_and_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let shown = done(folder.path(), &["level", "antmaze", "--map", "umaze"]).0;
    std::fs::write(folder.path().join("mine.txt"), format!("\u{feff}{shown}")).expect("writable");
    let again = done(folder.path(), &["level", "antmaze", "--map", "mine.txt"]).0;
    assert_eq!(again, shown);
}

#[test]
fn a_whole_mode_names_the_level_that_is_played() {
    use playbot_games::{antmaze, maze2d};
    let text = "random+size=15x15+loops=0.2+goals=random";
    let mode: antmaze::AntMazeMode = text.parse().expect("a mode");
    let played = antmaze::generate(&mode, 3).expect("a level");
    assert_ne!(played.goal, played.maze.goal(), "the mode draws another goal than the map's");
    for game in ["antmaze", "antmaze-sighted", "antmaze-mapped", "antmaze-placed"] {
        let shown = level(&[game, "--map", text, "--level", "3"]);
        assert_eq!((&shown["start"], &shown["goal"]), (&json!(played.start), &json!(played.goal)));
    }
    let mode: maze2d::Maze2dMode = "medium+sparse".parse().expect("a mode");
    let played = maze2d::Maze2dLevel::new(&mode, 5).expect("a level");
    let shown = level(&["maze2d", "--map", "medium+sparse", "--level", "5"]);
    assert_eq!((&shown["start"], &shown["goal"]), (&json!(played.start_cell), &json!(played.goal_cell)));
    assert_eq!(level(&["antmaze-sighted", "--map", "xl"]), level(&["antmaze", "--map", "xl"]));
    for alias in ["antmaze-with-rays", "antmaze-with-map", "antmaze-with-positional-encoding"] {
        assert_eq!(level(&[alias, "--map", "xl"]), level(&["antmaze", "--map", "xl"]), "{alias}");
    }
}

#[test]
fn what_is_wrong_with_a_map_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, rows) in [
        ("no-start", "####\n#OG#\n####"),
        ("no-goal", "####\n#SO#\n####"),
        ("cut", "#####\n#S#G#\n#####"),
        ("ragged", "####\n#SG#\n###"),
        ("letter", "####\n#SX#\n####"),
        ("open", "####\n#SGO\n####"),
        ("empty", "\n"),
    ] {
        std::fs::write(folder.path().join(name), rows).expect("writable");
    }
    for (args, words) in [
        (&["--map", "no-start"][..], &["no-start", "no start"][..]),
        (&["--map", "no-goal"], &["no goal"]),
        (&["--map", "cut"], &["(1, 3)", "cannot be reached", "(1, 1)"]),
        (&["--map", "ragged"], &["row 2"]),
        (&["--map", "letter"], &["row 1, column 2", "`X`"]),
        (&["--map", "open"], &["(1, 3)", "border"]),
        (&["--map", "empty"], &["empty"]),
        (&["--map", "medum"], &["did you mean `medium`?", "no file"]),
        (&["--map", "medium", "--level", "1"], &["is a single map", "take --mode medium"]),
        (&["--map", "random+size=5000x5000"], &["too large"]),
        (&["--map", "random+size=0x0"], &["`size=0x0`"]),
        (&["--map", "medium+sprse"], &["did you mean `sparse`?", "valid: sparse, fixed-start"]),
        (&["--map", "random+lops=1"], &["did you mean `loops"]),
        (&["--mode", "medum"], &["did you mean `medium`?"]),
        (&["--levels", "medium:3..4", "--level", "5"], &["--level 5 is none of the levels medium:3..4"]),
        (&["--map", "medium", "--png", "a.gif"], &[".png or .svg"]),
    ] {
        let (_, errors) = ended(folder.path(), &[&["level", "maze2d"], args].concat(), 3);
        assert!(words.iter().all(|word| errors.contains(word)), "{args:?}: {errors}");
    }
}

#[test]
fn eval_draws_where_players_went() {
    let folder = tempfile::tempdir().expect("a folder");
    let base =
        ["eval", "--bot", "random", "--bot", "right-jump", "--levels", "hard:64..65", "--episodes-per-level", "1"];
    for file in ["where.svg", "where.png"] {
        let (rows, _) = done(folder.path(), &[&base[..], &["--json", "--plot", file]].concat());
        assert_eq!(rows.lines().count(), 2);
    }
    let svg = std::fs::read_to_string(folder.path().join("where.svg")).expect("drawn");
    for part in ["hard:64", "hard:65", ">random<", ">right-jump<", "goal reached in ", "<polyline"] {
        assert!(svg.contains(part), "{part}");
    }
    let file = std::fs::File::open(folder.path().join("where.png")).expect("drawn");
    let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    assert!(reader.info().width > 1000, "{}", reader.info().width);
    for (args, words) in [
        (&["eval", "--bot", "random", "--plot", "where.gif"][..], ".png or .svg"),
        (
            &["eval", "--bot", "random", "--set", "game=\"ant\"", "--levels", "chase:0..0", "--plot", "a.png"],
            "no floor plan of level chase:0: leave --plot out, or add one to its adapter with `.plan`",
        ),
    ] {
        let (_, errors) = ended(folder.path(), args, 3);
        assert!(errors.contains(words), "{errors}");
    }
}
