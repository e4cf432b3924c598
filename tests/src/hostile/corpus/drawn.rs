//! Files written by hand: experiments and level files.

use std::{fs, path::Path};

use playbot::prelude::*;
use playbot_games::{antmaze::AntMaze, coinrun::CoinRun};
use playbot_harness::{inspect::LevelRequest, level_files::LevelDesigns};
use playbot_train::{Algorithm, experiment::file::read_experiment};

use crate::{
    Corridor,
    hostile::{
        form::Form,
        kind::{FileKind, Read, words},
    },
    small,
};

const LEVEL: &str = "level.json";
const EXPERIMENT: &str = "experiment.ron";

/// Returns all kinds of files that people write.
pub(super) fn drawn(folder: &Path) -> Vec<FileKind> {
    let kind = |name: &'static str, file: &str, text: String, read: fn(&Path) -> Read| {
        let own = folder.join(name.replace(' ', "-"));
        fs::create_dir_all(&own).expect("writable");
        fs::write(own.join(file), text).expect("writable");
        FileKind::new(name, Form::Text, &own, file, read)
    };
    let request = LevelRequest { mode: None, map: None, file: None, level: Some(7), picture: false };
    let hard = LevelRequest { mode: Some("hard"), ..request };
    let medium = LevelRequest { map: Some("medium"), level: None, ..request };
    let level = |game: &dyn Game, request: &LevelRequest| game.show_level(request).expect("a level").json;
    let experiment = small::experiment(Algorithm::ScorePpo).to_ron().expect("Unicode");
    vec![
        kind("level of CoinRun", LEVEL, level(&CoinRun::default(), &hard), |folder| {
            read_level(&CoinRun::default(), folder)
        }),
        kind("level of AntMaze", LEVEL, level(&AntMaze, &medium), |folder| read_level(&AntMaze, folder)),
        kind("experiment", EXPERIMENT, experiment, check_experiment),
    ]
}

fn read_level(game: &dyn Game, folder: &Path) -> Read {
    let path = folder.join(LEVEL).display().to_string();
    let designs = LevelDesigns::of_file(&path, &|text| game.parse_level(text)).map_err(words)?;
    Ok(vec![format!("{:?}", designs.hash(0))])
}

/// Makes the checks before any work.
fn check_experiment(folder: &Path) -> Read {
    let experiment = read_experiment(&folder.join(EXPERIMENT)).map_err(words)?;
    experiment.check().map_err(words)?;
    experiment.check_game(&Corridor).map_err(words)?;
    experiment.check_memory(&Corridor).map_err(words)?;
    Ok(vec![format!("{experiment:?}")])
}
