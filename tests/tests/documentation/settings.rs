//! The reference page of settings is the one that their tables give.

use std::fs;

use playbot_train::experiment::keys::settings_page;

use super::blocks::workspace;

/// Set to write the page instead of comparing it.
const REWRITE: &str = "PLAYBOT_REWRITE";

#[test]
fn the_reference_page_of_settings_is_that_of_their_tables() {
    let path = workspace().join("docs/reference/settings.md");
    let page = settings_page();
    if std::env::var_os(REWRITE).is_some() {
        fs::write(&path, &page).expect("writable");
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    let line = committed.lines().zip(page.lines()).position(|(committed, new)| committed != new);
    assert!(
        committed == page,
        "docs/reference/settings.md is stale, from line {}: `{REWRITE}=1 cargo test --release -p playbot_tests --test \
         documentation settings` rewrites it",
        line.unwrap_or_else(|| committed.lines().count().min(page.lines().count())) + 1
    );
}
