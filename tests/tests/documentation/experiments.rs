//! Experiments that documents show can be read.

use std::path::Path;

use playbot_lab::train::config_file::parse_experiment;

use super::blocks::{Document, blocks, documents};

#[test]
fn every_experiment_can_be_read_and_makes_sense() {
    let mut checked = 0;
    for Document { path, text } in documents() {
        for block in blocks(&text).into_iter().filter(|block| block.language == "ron") {
            let experiment = parse_experiment(&block.text, Path::new(&path));
            let experiment = experiment.unwrap_or_else(|error| panic!("block of line {}: {error}", block.line));
            experiment.check().unwrap_or_else(|error| panic!("{path}, block of line {}: {error}", block.line));
            checked += 1;
        }
    }
    assert!(checked > 0, "no experiment was found");
}
