//! The default folder of findings.

use std::{
    env,
    path::{Path, PathBuf},
};

/// Returns the folder for the findings of a game: `target/playbot-findings/` and the game's name.
pub(super) fn usual_folder(game: &str) -> PathBuf {
    let program = env::current_exe().ok();
    let target = program.as_deref().and_then(target_of).map(Path::to_owned);
    let target = target.or_else(|| env::var_os("CARGO_TARGET_DIR").map(PathBuf::from));
    let folder = target.unwrap_or_else(|| "target".into()).join("playbot-findings").join(game);
    // Commands may be called from other folders.
    std::path::absolute(&folder).unwrap_or(folder)
}

/// Returns the folder that cargo built a program into: the ancestor that cargo marks as a cache.
fn target_of(program: &Path) -> Option<&Path> {
    program.ancestors().skip(1).find(|folder| folder.join("CACHEDIR.TAG").is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_go_below_the_folder_that_cargo_builds_into() {
        let folder = tempfile::tempdir().expect("a folder");
        let deps = folder.path().join("target/release/deps");
        std::fs::create_dir_all(&deps).expect("writable");
        let program = deps.join("levels-0f");
        assert_eq!(target_of(&program), None);
        std::fs::write(folder.path().join("target/CACHEDIR.TAG"), "").expect("writable");
        assert_eq!(target_of(&program), Some(folder.path().join("target").as_path()));
        let usual = usual_folder("garden");
        assert!(usual.is_absolute() && usual.ends_with("playbot-findings/garden"), "{}", usual.display());
    }
}
