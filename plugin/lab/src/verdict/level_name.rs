//! Names of levels in results.

use bevy_playbot::state_hash::StateHash;

use crate::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files, level_files_mode},
    shell_word::shell_word,
    split::LevelSplit,
};

/// Returns the name of a level of these: `hard:7`, or the path of its file.
pub fn level_name(game: &dyn Game, split: &LevelSplit, level: u64) -> String {
    let designs = drawn(game, split);
    let path = designs.as_ref().and_then(|designs| designs.path(level));
    path.map_or_else(|| format!("{}:{level}", split.mode), str::to_owned)
}

/// Returns the value of `--levels` for the level with this name alone, as a word for the shell.
pub(super) fn level_argument(split: &LevelSplit, name: &str) -> String {
    let word = if is_level_files(&split.mode) { level_files_mode(name) } else { name.to_owned() };
    shell_word(&word)
}

/// Returns a hash of these levels' files and of their content; `None` for levels that are not files.
pub fn hash_of_files(game: &dyn Game, split: &LevelSplit) -> Option<String> {
    let designs = drawn(game, split)?;
    let path = |level| designs.path(level).unwrap_or_default().bytes().map(u64::from).collect::<Vec<_>>();
    let words = split.levels().flat_map(|level| path(level).into_iter().chain([designs.hash(level).unwrap_or(0)]));
    Some(format!("{:016x}", StateHash::of(words).0))
}

pub(super) fn drawn(game: &dyn Game, split: &LevelSplit) -> Option<LevelDesigns> {
    let is_drawn = is_level_files(&split.mode);
    is_drawn.then(|| level_designs(game, &split.mode).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;

    #[test]
    fn a_name_is_a_range_of_one_level() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let split: LevelSplit = "hard+fog=1:5..9".parse().expect("a split");
        let name = level_name(&game, &split, 7);
        assert_eq!(name, "hard+fog=1:7");
        assert_eq!((level_argument(&split, &name), hash_of_files(&game, &split)), (name.clone(), None));
        let alone: LevelSplit = name.parse().expect("a split");
        assert_eq!((alone.len(), split.contains(&alone.mode, alone.first)), (1, true));
    }

    #[test]
    fn a_file_is_named_in_words_that_a_shell_takes() {
        let split = LevelSplit { mode: "files:levels/*.json".to_owned(), first: 0, last: 3 };
        assert_eq!(level_argument(&split, "levels/a.json"), "files:levels/a.json");
        assert_eq!(level_argument(&split, "my levels/a.json"), "'files:my levels/a.json'");
    }
}
