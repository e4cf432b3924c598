//! Tests that the reference pages of settings and verbs are those that their tables and the parser of the command line
//! give.

use std::fs;

use playbot::reference::verbs_page;
use playbot_train::experiment::page::settings_page;

use super::blocks::workspace;

/// Set to write the pages instead of comparing them.
const REWRITE: &str = "PLAYBOT_REWRITE";

#[test]
fn the_reference_page_of_settings_is_that_of_their_tables() {
    check("docs/reference/settings.md", &settings_page());
}

#[test]
fn the_reference_page_of_verbs_is_that_of_the_command_line() {
    check("docs/reference/verbs.md", &verbs_page());
}

/// Compares a committed page with the one that is generated, or writes it.
fn check(path: &str, page: &str) {
    let file = workspace().join(path);
    if std::env::var_os(REWRITE).is_some() {
        fs::write(&file, page).expect("writable");
    }
    let committed = fs::read_to_string(&file).unwrap_or_default();
    let line = committed.lines().zip(page.lines()).position(|(committed, new)| committed != new);
    assert!(
        committed == page,
        "{path} is stale, from line {}: `{REWRITE}=1 cargo test --release -p playbot_tests --test documentation \
         the_reference_page` rewrites it",
        line.unwrap_or_else(|| committed.lines().count().min(page.lines().count())) + 1
    );
}
