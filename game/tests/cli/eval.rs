//! Tests of measurements and their plots.

use crate::program::{code, errors, lines, playbot};

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
fn a_measure_below_its_bound_is_a_finding_that_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let eval = |more: &[&str]| {
        let levels = ["--levels", "hard:64..127", "--episodes-per-level", "1", "--json"];
        playbot(folder.path(), &[&["eval", "--bot", "right-jump"], &levels[..], more].concat())
    };
    let passed = eval(&["--at-least", "return=5.46875", "--at-least", "success=0"]);
    assert_eq!(code(&passed), 0, "{}", errors(&passed));
    let failed = eval(&["--at-least", "return=6", "--at-least", "success=0"]);
    assert_eq!((code(&failed), lines(&failed).len()), (1, 1), "the row is printed all the same");
    let words = "right-jump on hard:64..127: return is 5.46875, below the required 6";
    assert!(errors(&failed).contains(words), "{}", errors(&failed));
    assert!(!errors(&failed).contains("success is"), "{}", errors(&failed));
    let wrong = eval(&["--at-least", "wins=3"]);
    assert_eq!(code(&wrong), 3);
    assert!(errors(&wrong).contains("write success=0.9 or return=8.5"), "{}", errors(&wrong));
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
    assert!(errors(&output).contains("plot: new/folder/plot.svg"), "{}", errors(&output));
    assert!(svg.contains("crates and the like"), "level 64 has crates");
    let line = svg.split("<polyline points=\"").find(|line| line.contains("stroke-width=\"1.8\"")).expect("a trail");
    let (x, y) = line.split(' ').next().and_then(|point| point.split_once(',')).expect("a point");
    assert!(svg.contains(&format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"6\"")), "it begins at {x}, {y}, not at the start");
    // A name so long that the temporary one, with the number of the process behind it, is too long for a file. That
    // shows only when it is written.
    let late = eval(&format!("{}.svg", "x".repeat(245)));
    assert_eq!(code(&late), 2, "{}", errors(&late));
    assert!(String::from_utf8_lossy(&late.stdout).contains("right-jump"), "the table is there all the same");
}

#[cfg(all(target_os = "linux", feature = "screen"))]
#[test]
fn cameras_work_silently_without_a_desktop() {
    let folder = tempfile::tempdir().expect("a folder");
    let eyes = ["eyes", "coinrun", "--levels", "hard:0..0", "--frames", "1"];
    let mut command = crate::program::command(folder.path(), &eyes);
    let output = command.env_remove("XDG_RUNTIME_DIR").env_remove("NODEVICE_SELECT").output().expect("it starts");
    assert_eq!(code(&output), 0, "{}", errors(&output));
    assert!(!errors(&output).contains("XDG_RUNTIME_DIR"), "{}", errors(&output));
}
