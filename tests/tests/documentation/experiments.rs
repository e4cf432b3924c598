//! Tests that experiments in documents, and beside the tables of studies, can be read.

use std::fs;

use playbot_train::experiment::file::parse_experiment;

use super::blocks::{Document, blocks, documents, read, workspace};

#[test]
fn every_experiment_can_be_read_and_makes_sense() {
    let mut checked = 0;
    for Document { path, text } in documents() {
        for block in blocks(&text).into_iter().filter(|block| block.language == "ron") {
            // Its bases are named as from the folder of the project.
            let experiment = parse_experiment(&block.text, &workspace().join("shown.ron"));
            let experiment = experiment.unwrap_or_else(|error| panic!("{path}, block of line {}: {error}", block.line));
            experiment.check().unwrap_or_else(|error| panic!("{path}, block of line {}: {error}", block.line));
            checked += 1;
        }
    }
    assert!(checked > 0, "no experiment was found");
}

#[test]
fn the_experiment_beside_each_table_can_be_read_and_makes_sense() {
    let mut checked = 0;
    for study in fs::read_dir(workspace().join("docs/results")).expect("the studies are there") {
        let study = study.expect("readable").path();
        if !study.join("results.json").exists() || study.ends_with("eyes-coinrun") {
            continue;
        }
        let file = study.join("experiment.ron");
        let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let experiment = parse_experiment(&text, &file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        experiment.check().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let table = fs::read_to_string(study.join("table.md")).expect("a table");
        assert!(!experiment.variants.is_empty(), "{}: no variants", file.display());
        for variant in &experiment.variants {
            assert!(table.contains(&variant.name), "{}: the table has no row {}", file.display(), variant.name);
        }
        checked += 1;
    }
    assert!(checked > 20, "only {checked} studies were found");
}

/// The index of studies has a row for each folder with a table: the calls that made it, and the CPU hours of its
/// `cost.md`.
#[test]
fn the_index_of_studies_has_all_of_them_with_their_costs() {
    let index = read("docs/results/README.md");
    let (mut calls, mut hours) = (0, 0.0);
    for study in fs::read_dir(workspace().join("docs/results")).expect("the studies are there") {
        let study = study.expect("readable").path();
        if !study.join("table.md").exists() {
            continue;
        }
        let name = study.file_name().expect("a name").to_string_lossy().into_owned();
        let row = index.lines().find(|line| line.contains(&format!("]({name}/table.md) |")));
        let row = row.unwrap_or_else(|| panic!("the index has no row of {name}"));
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let [.., call, cost, _] = cells.as_slice() else { panic!("{row}") };
        calls += call.parse::<u32>().unwrap_or_else(|error| panic!("{row}: {error}"));
        let text = fs::read_to_string(study.join("cost.md")).unwrap_or_default();
        let written = text.lines().find_map(|line| line.split_once(" CPU hours in all")).map(|(hours, _)| hours);
        assert_eq!(*cost, written.unwrap_or("–"), "{name}");
        hours += written.map_or(0.0, |hours| hours.parse::<f64>().expect("a number"));
    }
    for page in ["README.md", "docs/results/README.md"] {
        let text = read(page);
        assert!(text.contains(&format!("{calls} studies")), "{page} does not count {calls} studies");
        assert!(text.contains(&format!("{hours:.1}")), "{page} does not have {hours:.1} CPU hours");
    }
}
