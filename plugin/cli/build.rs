//! Build script that notes playbot's revision, so that a run can say what made it.

use std::{fs, path::Path, process::Command};

/// The file into which `cargo package` writes the revision that it packs.
const PACKED: &str = ".cargo_vcs_info.json";
/// Files that change with the revision of a clone.
const CLONED: [&str; 2] = ["../../.git/HEAD", "../../.git/refs/heads"];

#[allow(clippy::print_stdout, reason = "cargo reads it")]
fn main() {
    // A file that is missing would have this crate built again and again.
    for path in ["build.rs", PACKED].iter().chain(&CLONED).filter(|path| Path::new(path).exists()) {
        println!("cargo::rerun-if-changed={path}");
    }
    let revision = packed().or_else(cloned);
    println!("cargo::rustc-env=PLAYBOT_REVISION={}", revision.as_deref().unwrap_or("unknown"));
}

/// The revision of a package from a registry. Asking git there would find the repository of the user, if any.
fn packed() -> Option<String> {
    let text = fs::read_to_string(PACKED).ok()?;
    let (_, rest) = text.split_once("\"sha1\"")?;
    Some(rest.split('"').nth(1)?.chars().take(12).collect())
}

/// The revision of a clone of playbot's repository.
fn cloned() -> Option<String> {
    if !Path::new("../../.git").exists() {
        return None;
    }
    let output = Command::new("git").args(["rev-parse", "--short=12", "HEAD"]).output().ok()?;
    Some(String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?.trim().to_owned())
}
