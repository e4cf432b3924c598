//! Tests of pictures from the command line.

#[path = "shared/program.rs"]
mod program;

use std::{fs::File, io::BufReader, path::Path};

use program::{done, ended};
use serde_json::Value;

/// Returns the JSON that `playbot ARGS --json` prints about its picture.
fn written(folder: &Path, args: &[&str]) -> Value {
    let (line, _) = done(folder, &[args, &["--json"]].concat());
    serde_json::from_str(&line).expect("a line of JSON")
}

/// A PNG: width, height and its frames in red, green and blue, each with the seconds it is shown.
struct Pictures {
    size: (usize, usize),
    frames: Vec<Vec<[u8; 3]>>,
    delay: Option<(u16, u16)>,
}

fn read(path: &Path) -> Pictures {
    let decoder = png::Decoder::new(BufReader::new(File::open(path).expect("written")));
    let mut reader = decoder.read_info().expect("a PNG");
    let count = reader.info().animation_control.map_or(1, |animation| animation.num_frames);
    let size = (reader.info().width as usize, reader.info().height as usize);
    let (mut frames, mut delay) = (Vec::new(), None);
    for _ in 0..count {
        let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut bytes).expect("a whole frame");
        delay = reader.info().frame_control.map(|frame| (frame.delay_num, frame.delay_den));
        frames.push(bytes.as_chunks::<3>().0.to_vec());
    }
    assert!(reader.next_frame(&mut vec![0; size.0 * size.1 * 3]).is_err(), "no frame more");
    Pictures { size, frames, delay }
}

/// Returns the colours of every `scale`-th pixel, and checks the squares between them.
fn reduced(pictures: &Pictures, frame: usize, side: usize, scale: usize) -> Vec<[u8; 3]> {
    let (width, pixels) = (pictures.size.0, &pictures.frames[frame]);
    let square = |x: usize, y: usize| {
        let colour = pixels[y * scale * width + x * scale];
        let all = (0..scale * scale).all(|i| pixels[(y * scale + i / scale) * width + x * scale + i % scale] == colour);
        assert!(all, "({x}, {y}) is one square");
        colour
    };
    (0..side * side).map(|i| square(i % side, i / side)).collect()
}

#[test]
fn one_observation_is_what_the_bot_sees_enlarged() {
    let folder = tempfile::tempdir().expect("a folder");
    let view = |args: &[&str]| written(folder.path(), &[&["view", "coinrun", "--level", "5"], args].concat());
    let said = view(&["--tick", "20"]);
    assert_eq!((&said["width"], &said["frames"], &said["ticks"]), (&512.into(), &1.into(), &21.into()));
    let picture = read(&folder.path().join("view.png"));
    assert_eq!((picture.size, picture.delay), ((512, 512), None));
    let seen = reduced(&picture, 0, 64, 8);
    let mut colours = seen.clone();
    colours.sort_unstable();
    colours.dedup();
    assert!(colours.len() > 8, "a level has some colours: {colours:?}");

    let (_, words) = done(folder.path(), &["view", "coinrun", "--level", "5", "--tick", "20", "--out", "again.png"]);
    let sentence = "again.png shows tick 20 of level 5 of coinrun in mode hard (no --mode was named; the game has easy, \
                    hard), played by search, on 512 × 512 pixels; after 21 ticks the episode was still running";
    assert!(words.contains(sentence), "{words}");

    view(&["--tick", "20", "--scale", "2", "--image", "stack=2", "--out", "new/stack.png"]);
    let stack = read(&folder.path().join("new/stack.png"));
    assert_eq!(stack.size, (64 * 2 + 2 + 64 * 2, 128));
    let newest: Vec<_> = (0..64 * 64).map(|i| stack.frames[0][i / 64 * 2 * stack.size.0 + 130 + i % 64 * 2]).collect();
    assert!(newest == seen, "the newest picture is on the right");
    view(&["--image", "grayscale", "--image", "width=84", "--image", "height=60", "--scale", "1", "--out", "grey.png"]);
    let grey = read(&folder.path().join("grey.png"));
    assert_eq!(grey.size, (84, 60));
    assert!(grey.frames[0].iter().all(|[r, g, b]| r == g && g == b));
}

#[cfg(feature = "screen")]
#[test]
fn a_camera_sees_what_the_raster_sees() {
    let folder = tempfile::tempdir().expect("a folder");
    for game in [&["coinrun", "--level", "5"][..], &["maze2d"], &["antmaze"], &["ant", "--mode", "goal"]] {
        let [raster, camera] = [&["--out", "raster.png"][..], &["--camera", "--out", "camera.png"]].map(|args| {
            written(folder.path(), &[&["view"], game, &["--tick", "3", "--scale", "1"], args].concat());
            read(&folder.path().join(args[args.len() - 1])).frames.swap_remove(0)
        });
        let apart = |(one, other): &(&[u8; 3], &[u8; 3])| (0..3).any(|i| one[i].abs_diff(other[i]) > 8);
        let apart = raster.iter().zip(&camera).filter(apart).count();
        assert!(apart < 64 * 64 * 3 / 100, "{game:?}: {apart} pixels differ");
        assert!(raster.iter().any(|colour| *colour != raster[0]), "{game:?}: it shows something");
    }
}

#[cfg(feature = "camera")]
#[test]
fn without_a_driver_a_camera_is_refused_and_the_raster_is_offered() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = program::command(folder.path(), &["view", "coinrun", "--camera"]);
    command.envs([("VK_DRIVER_FILES", "none"), ("VK_ICD_FILENAMES", "none"), ("WGPU_BACKEND", "vulkan")]);
    let (_, errors) = playbot_shell::ended(command, 3);
    assert!(errors.contains("mesa-vulkan-drivers") && errors.contains("observation: Raster"), "{errors}");
    assert!(!folder.path().join("view.png").exists());
}

/// `playbot eyes` prints the position of its worst frame.
#[cfg(feature = "screen")]
#[test]
fn the_worst_frame_is_of_the_moment_that_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let eyes = ["eyes", "coinrun", "--levels", "hard:3..7", "--frames", "5", "--out", "."];
    let worst = &written(folder.path(), &eyes)["worst"];
    let [level, tick] = ["level", "tick"].map(|key| worst[key].to_string());
    written(folder.path(), &["view", "coinrun", "--level", &level, "--tick", &tick, "--scale", "1"]);
    let seen = &read(&folder.path().join("view.png")).frames[0];
    // The raster's picture is the left one, enlarged five times.
    assert!(reduced(&read(&folder.path().join("worst.png")), 0, 64, 5) == *seen, "level {level}, tick {tick}");
}

#[test]
fn a_maze_is_seen_as_a_whole_whatever_the_shape_of_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let seen = |mode: &str, [width, height]: [usize; 2]| {
        let [columns, rows] = [format!("width={width}"), format!("height={height}")];
        let sizes = ["--image", &columns, "--image", &rows, "--scale", "1"];
        written(
            folder.path(),
            &[&["view", "maze2d", "--mode", mode, "--level", "3", "--tick", "4"][..], &sizes].concat(),
        );
        let mut picture = read(&folder.path().join("view.png"));
        assert_eq!(picture.size, (width, height));
        picture.frames.swap_remove(0)
    };
    for mode in ["medium", "large"] {
        let square = seen(mode, [64, 64]);
        for [width, height] in [[84, 64], [64, 84]] {
            let picture = seen(mode, [width, height]);
            let middle = |i: usize| picture[(i / 64 + (height - 64) / 2) * width + i % 64 + (width - 64) / 2];
            let apart = (0..64 * 64).filter(|&i| middle(i) != square[i]).count();
            assert!(apart < 64 * 64 / 100, "{mode}, {width} × {height}: {apart} pixels differ");
        }
    }
}

#[test]
fn an_episode_becomes_a_moving_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = ["view", "coinrun", "--level", "0", "--bot", "right-jump", "--episode", "--scale", "3"];
    let said = written(folder.path(), &args);
    assert_eq!((&said["frames"], &said["ticks"], &said["level"]), (&63.into(), &63.into(), &0.into()));
    assert_eq!(said["end"]["Terminated"]["success"], true);
    let film = read(&folder.path().join("view.png"));
    assert_eq!((film.frames.len(), film.delay), (63, Some((1, 15))), "one frame for each tick of a 15th of a second");
    assert!(film.size.1 > 64 * 3, "words stand under the pictures");
    let first = reduced(&film, 0, 64, 3);
    assert!(film.frames.windows(2).all(|pair| pair[0] != pair[1]), "something changes in every tick");
    let again = written(folder.path(), &[&args[..], &["--out", "again.png"]].concat());
    assert_eq!(again["bytes"], said["bytes"]);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
    assert!(bytes("view.png") == bytes("again.png"), "the same bytes each time");
    written(folder.path(), &["view", "coinrun", "--level", "0", "--scale", "1", "--out", "first.png"]);
    assert!(read(&folder.path().join("first.png")).frames[0] == first, "the first frame is the first observation");
}

#[test]
fn recordings_and_policies_can_be_watched() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| {
        done(folder.path(), args);
    };
    run(&["record", "coinrun", "--levels", "easy:3..6", "--noise", "0.2", "--out", "demos/a.demo"]);
    let demo = ["view", "coinrun", "--demo", "demos/a.demo", "--episode-number", "2", "--episode", "--scale", "1"];
    let said = written(folder.path(), &demo);
    assert_eq!((&said["level"], &said["player"], &said["divergence"]), (&5.into(), &"recording".into(), &Value::Null));
    let plain = read(&folder.path().join("view.png"));
    assert_eq!(said["frames"], plain.frames.len());

    let config = r#"(
        game: "coinrun", train: "hard:0..3", test: "hard:64..65", demos: "demos", steps: 512, arenas: 8, worlds: 2,
        skills: (window: 5, epochs: 1, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 4),
    )"#;
    std::fs::write(folder.path().join("tiny.ron"), config).expect("writable");
    run(&["learn-skills", "--experiment", "tiny.ron", "--out", "skills.safetensors"]);
    run(&["policy", "export", "--skills", "skills.safetensors", "--experiment", "tiny.ron", "--out", "clone.policy"]);
    let policy = ["view", "coinrun", "--policy", "clone.policy", "--tick", "3", "--scale", "1"];
    let still = written(folder.path(), &policy);
    assert_eq!((&still["height"], &still["player"]), (&64.into(), &"bc".into()));
    let easy = ["view", "coinrun", "--mode", "easy", "--level", "3", "--policy", "clone.policy", "--episode"];
    let said = written(folder.path(), &[&easy[..], &["--scale", "1"]].concat());
    let film = read(&folder.path().join("view.png"));
    assert!(film.size.1 > plain.size.1, "bars of the skill stand under the words");
    let bars = |frame: &Vec<[u8; 3]>| frame[plain.size.1 * film.size.0..].to_vec();
    let skills = film.frames.windows(2).filter(|pair| bars(&pair[0]) != bars(&pair[1])).count();
    let skill_interval = 8;
    assert_eq!(
        skills,
        (said["ticks"].as_u64().expect("a count") as usize - 1) / skill_interval,
        "a new skill every 8 ticks"
    );
}

#[test]
fn a_level_can_be_drawn_as_a_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let (text, _) = done(folder.path(), &["level", "coinrun", "--level", "2", "--png", "level.png"]);
    let rows: Vec<&str> = text.lines().filter(|line| line.starts_with(['#', '='])).collect();
    let picture = read(&folder.path().join("level.png"));
    assert_eq!(picture.size, (16 * rows[0].len(), 16 * rows.len()), "{text}");
    let tile = |letter: char| {
        let (row, column) = rows.iter().enumerate().find_map(|(y, row)| Some((y, row.find(letter)?))).expect("there");
        let middle = |dy: usize| picture.frames[0][(row * 16 + dy) * picture.size.0 + column * 16 + 8];
        [middle(4), middle(12)]
    };
    assert_ne!(tile('#'), tile('C'));
    assert_ne!(tile('.'), tile('='));
}

#[test]
fn bad_wishes_are_refused_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("file"), "in the way").expect("writable");
    done(folder.path(), &["record", "maze2d", "--levels", "medium:0..0", "--steps", "5", "--out", "maze.demo"]);
    let large = ["--image", "width=1024", "--image", "height=1024", "--image", "stack=16"];
    for (args, code, words) in [
        (&["--mode", "hrad"][..], 3, "did you mean `hard`?"),
        (
            &["--level", "5000000000"],
            3,
            "level 5000000000 of `hard` does not exist: `coinrun` has levels 0 to 4294967295",
        ),
        (&["--run", "none"], 3, "none: there is no such folder"),
        (&["--bot", "serch"], 3, "did you mean `search`?"),
        (&["--policy", "none.policy"], 3, "policy export --run RUN --out none.policy"),
        (&["--image", "width=0"], 3, "width is 0; it must be 1 to 1024"),
        (&["--image", "stack=99"], 3, "stack is 99"),
        (&["--image", "widht=64"], 3, "did you mean `width`?"),
        (&["--image", "height=tall"], 3, "must be a whole number, not tall"),
        (&["--scale", "0"], 3, "it must be a whole number from 1 to 32"),
        (&[&large[..], &["--scale", "32"]].concat(), 3, "524768 x 32768 pixels"),
        (&[&large[..], &["--scale", "1", "--episode"]].concat(), 3, "more than 1024 MiB of memory"),
        (&["--tick", "5000"], 3, "there is no tick 5000: the episode has"),
        (&["--demo", "none.demo"], 3, "record GAME --out none.demo"),
        (&["--demo", "file"], 3, "file"),
        (&["--demo", "maze.demo"], 3, "look at it with `playbot view maze2d --demo maze.demo`"),
        (&["--demo", "a", "--bot", "random"], 3, "cannot be used with"),
        (&["--out", "file/view.png"], 2, "cannot create file"),
        (&["--out", "."], 3, "written as .png"),
        (&["--out", "x.jpg"], 3, "written as .png"),
    ] {
        let (_, errors) = ended(folder.path(), &[&["view", "coinrun"], args].concat(), code);
        assert!(errors.contains(words), "{args:?}: {errors}");
    }
    assert!(!folder.path().join("view.png").exists());
}
