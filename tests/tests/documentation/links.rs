//! What documents point to is there.

use super::blocks::{Document, documents, workspace};

/// Where links lead to, but for the web and for places in the same document.
fn links(text: &str) -> Vec<&str> {
    let ends = text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next());
    let paths = ends.filter(|target| !target.contains("://") && !target.starts_with('#'));
    paths.map(|target| target.split('#').next().unwrap_or(target)).collect()
}

/// Files and folders of this repository that are named in code.
fn named_paths(text: &str) -> Vec<&str> {
    let folders = [".ci/", ".github/", "assets/", "demos/", "docs/", "game/", "plugin/", "tests/"];
    let code = text.split('`').skip(1).step_by(2);
    let is_path = |code: &&str| folders.iter().any(|folder| code.starts_with(folder));
    code.filter(is_path).filter(|code| !code.contains(['*', ' ', '\n', '…'])).collect()
}

#[test]
fn links_and_paths_are_found() {
    let text = "![a](docs/a.png) [b](https://b.org) [c](#c) [d](../d.md#e) `game/src` `assets/*.ron` `playbot`";
    assert_eq!(links(text), ["docs/a.png", "../d.md"]);
    assert_eq!(named_paths(text), ["game/src"]);
}

#[test]
fn every_link_leads_somewhere() {
    let mut missing = Vec::new();
    for Document { path, text } in documents() {
        let file = workspace().join(&path);
        let folder = file.parent().expect("a file is in a folder");
        let gone = links(&text).into_iter().filter(|link| !folder.join(link).exists());
        missing.extend(gone.map(|link| format!("{path}: {link}")));
    }
    assert!(missing.is_empty(), "links that lead nowhere:\n{}", missing.join("\n"));
}

#[test]
fn every_path_that_is_named_exists() {
    let mut missing = Vec::new();
    for Document { path, text } in documents() {
        let gone = named_paths(&text).into_iter().filter(|named| !workspace().join(named).exists());
        missing.extend(gone.map(|named| format!("{path}: {named}")));
    }
    assert!(missing.is_empty(), "files that are not there:\n{}", missing.join("\n"));
}
