//! Tests of traces.

use serde_json::Value;

use crate::program::{code, errors, lines, playbot};

#[test]
fn traces_stop_at_the_end_and_read_back_exactly() {
    let folder = tempfile::tempdir().expect("a folder");
    let actions = vec!["8"; 200].join(",");
    let output = playbot(
        folder.path(),
        &["trace", "coinrun", "--mode", "hard", "--level", "0", "--actions", &actions, "--json"],
    );
    let steps = lines(&output);
    assert_eq!(steps.len(), 63);
    assert_eq!(steps[0], serde_json::json!([1.5999999, 3.0787, 0.1, 1.5, 0, 0]));
    assert_eq!((&steps[62][4], &steps[62][5]), (&Value::from(10), &Value::from(1)));
    std::fs::write(folder.path().join("actions.txt"), actions.replace(',', "\n")).expect("writable");
    let from_file =
        playbot(folder.path(), &["trace", "coinrun", "--level", "0", "--actions-file", "actions.txt", "--json"]);
    assert_eq!(output.stdout, from_file.stdout);
    let names = actions.replace('8', "Right+Jump");
    let from_names = playbot(folder.path(), &["trace", "coinrun", "--level", "0", "--actions", &names, "--json"]);
    assert_eq!(output.stdout, from_names.stdout);
    let wrong = playbot(folder.path(), &["trace", "coinrun", "--actions", "99", "--json"]);
    assert_eq!(code(&wrong), 3);
    assert!(errors(&wrong).contains("action 99 is outside of the numbers from 0 to 14"), "{}", errors(&wrong));
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
