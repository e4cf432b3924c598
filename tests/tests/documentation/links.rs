//! Tests that links in documents lead to existing files.

use super::blocks::{Document, documents, workspace};

/// Returns the targets of links, but for the web and for anchors in the same document.
fn links(text: &str) -> Vec<&str> {
    let ends = text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next());
    let pictures = text.split("<img src=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let paths = ends.chain(pictures).filter(|target| !target.contains("://") && !target.starts_with('#'));
    paths.map(|target| target.split('#').next().unwrap_or(target)).collect()
}

/// Returns the files and folders of this repository that are named in code.
fn named_paths(text: &str) -> Vec<&str> {
    let folders = [".ci/", ".github/", "assets/", "demos/", "docs/", "game/", "plugin/", "tests/"];
    let code = text.split('`').skip(1).step_by(2);
    let is_path = |code: &&str| folders.iter().any(|folder| code.starts_with(folder));
    code.filter(is_path).filter(|code| !code.contains(['*', ' ', '\n', '…'])).collect()
}

#[test]
fn links_and_paths_are_found() {
    let text = "![a](docs/a.png) [b](https://b.org) [c](#c) [d](../d.md#e) `game/src` `assets/*.ron` `playbot` \
                <img src=\"e.png\">";
    assert_eq!(links(text), ["docs/a.png", "../d.md", "e.png"]);
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

#[test]
fn every_page_can_be_found() {
    let documents = documents();
    let mut reached = std::collections::BTreeSet::new();
    for Document { path, text } in &documents {
        let file = workspace().join(path);
        let folder = file.parent().expect("a file is in a folder");
        reached.extend(links(text).into_iter().filter_map(|link| folder.join(link).canonicalize().ok()));
    }
    let pages = documents.iter().filter(|document| document.path.starts_with("docs/"));
    let lost: Vec<_> = pages.filter(|page| !reached.contains(&workspace().join(&page.path))).collect();
    let lost: Vec<_> = lost.iter().map(|page| page.path.as_str()).filter(|path| !path.ends_with("/cost.md")).collect();
    assert!(lost.is_empty(), "pages that no document links to:\n{}", lost.join("\n"));
}

#[test]
fn the_readme_is_short_and_has_four_pictures() {
    let text = super::blocks::read("README.md");
    assert!(text.lines().count() <= 170, "{} lines", text.lines().count());
    let pictures: Vec<_> = links(&text).into_iter().filter(|link| link.ends_with(".png")).collect();
    assert_eq!(pictures.len(), 4, "{pictures:?}");
    for picture in pictures {
        let length = std::fs::metadata(workspace().join(picture)).expect("it exists").len();
        assert!(length < 400_000, "{picture} has {length} bytes");
    }
}
