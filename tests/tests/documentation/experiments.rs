//! Experiments that documents show can be read.

use playbot_lab::train::config_file::parse_experiment;

use super::blocks::{Document, blocks, documents, workspace};

#[test]
fn every_experiment_can_be_read_and_makes_sense() {
    let mut checked = 0;
    for Document { path, text } in documents() {
        for block in blocks(&text).into_iter().filter(|block| block.language == "ron") {
            // What it is based on is named as from the folder of the project.
            let experiment = parse_experiment(&block.text, &workspace().join("shown.ron"));
            let experiment = experiment.unwrap_or_else(|error| panic!("{path}, block of line {}: {error}", block.line));
            experiment.check().unwrap_or_else(|error| panic!("{path}, block of line {}: {error}", block.line));
            checked += 1;
        }
    }
    assert!(checked > 0, "no experiment was found");
}
