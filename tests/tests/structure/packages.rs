//! The packages of the workspace.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::files::files;

/// A package: a folder with a `Cargo.toml` that names one.
#[derive(Clone, Debug)]
pub struct Package {
    pub name: String,
    pub folder: PathBuf,
    /// Whether it goes to a registry.
    pub is_published: bool,
    pub manifest: String,
}

/// The folder of the workspace.
pub fn workspace() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    folder.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
}

/// All packages of a workspace.
pub fn packages(workspace: &Path) -> Vec<Package> {
    let manifests = files(workspace, "Cargo.toml");
    manifests.iter().filter_map(|manifest| package(manifest)).collect()
}

fn package(file: &Path) -> Option<Package> {
    let manifest = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let section = manifest.split("\n[").find(|section| section.trim_start_matches('[').starts_with("package]"))?;
    let value = |key: &str| {
        let line = section.lines().find_map(|line| line.strip_prefix(key)?.trim_start().strip_prefix('='))?;
        Some(line.trim().trim_matches('"').to_owned())
    };
    let folder = file.parent().expect("a file is in a folder").to_owned();
    let is_published = value("publish").is_none_or(|publish| publish != "false");
    Some(Package { name: value("name")?, folder, is_published, manifest })
}

impl Package {
    /// The root of its library, or else of its program.
    pub fn root(&self) -> Option<PathBuf> {
        ["src/lib.rs", "src/main.rs"].iter().map(|root| self.folder.join(root)).find(|root| root.exists())
    }
}
