//! Held-out levels that are files.

use playbot_games::coinrun::CoinRun;
use playbot_lab::{held_out::HeldOut, level_files::level_files_mode, prelude::*};

#[test]
fn a_copy_of_a_held_out_level_is_found_under_any_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, coin: usize| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("below")).expect("writable");
        let row: String = (0..8).map(|x| if x == coin { 'C' } else { '.' }).collect();
        std::fs::write(path, format!("{{ \"rows\": [\"########\", \"{row}\"] }}")).expect("writable");
    };
    for (name, coin) in [("train/a.json", 3), ("train/b.json", 5), ("train/c.json", 6), ("test/z.json", 5)] {
        write(name, coin);
    }
    let game = CoinRun::default();
    let split = |name: &str| -> LevelSplit {
        let mode = format!("{}/{name}/*.json", level_files_mode(&folder.path().to_string_lossy()));
        let split: LevelSplit = mode.parse().expect("files");
        split.check(&game).expect("levels");
        split
    };
    let (train, test) = (split("train"), split("test"));
    let hidden = HeldOut::new(&game, &test);
    assert_eq!(hidden.first_of(&train), Some(1));
    assert!(!hidden.contains(&train.mode, 0) && hidden.contains(&train.mode, 1) && !hidden.contains(&train.mode, 2));
    assert!(!hidden.contains("hard", 0));
}
