//! Writing of an example into a file that a game includes.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{find, rewrite};

/// Writes `OUT_DIR/game.rs` from `examples/showcase/NAME.rs`, and the modules `parts` of the example beside it.
///
/// `stand_ins` replaces parts of Bevy that the example uses and that are not built. It is put below the example: items
/// of the same names and, if they have to be registered, a plugin function `stand_ins`.
///
/// Call it as the last expression of a build script's `main`: an error becomes the build's error.
pub fn write_game(name: &str, parts: &[&str], stand_ins: Option<&str>) {
    if let Err(error) = try_write(name, parts, stand_ins) {
        say(&format!("cargo::error=the example `{name}` of the bevy package: {error}"));
    }
}

fn try_write(name: &str, parts: &[&str], stand_ins: Option<&str>) -> Result<(), String> {
    let folder = find::bevy_folder()?.join("examples/showcase");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set: is this a build script?")?);
    // Features that the examples ask for by name and that belong to the bevy package.
    say(r#"cargo::rustc-check-cfg=cfg(feature, values("bevy_debug_stepping", "debug"))"#);
    let game = rewrite(&read(&folder, name)?, stand_ins)?;
    write(&out, "game", &game)?;
    for part in parts {
        write(&out, part, &read(&folder, part)?)?;
    }
    Ok(())
}

fn read(folder: &Path, name: &str) -> Result<String, String> {
    let path = folder.join(name).with_extension("rs");
    say(&format!("cargo::rerun-if-changed={}", path.display()));
    fs::read_to_string(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))
}

fn write(out: &Path, name: &str, text: &str) -> Result<(), String> {
    let path = out.join(name).with_extension("rs");
    fs::write(&path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))
}

#[allow(clippy::print_stdout, reason = "that is how a build script talks to cargo")]
fn say(line: &str) {
    println!("{line}");
}
