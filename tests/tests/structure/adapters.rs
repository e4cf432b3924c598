//! A game that wraps another one hands on every question, also those that are added later.

use std::{collections::BTreeSet, fs, path::Path};

use crate::{
    items::items,
    packages::workspace,
    tokens::{Token, tokens},
};

/// What [`WithRays`](playbot_games::with_rays::WithRays) does not hand on: what is written for the game without rays by name,
/// and what follows from the rest.
const OWN: [&str; 8] =
    ["benchmarked", "built_anew", "card", "demo_header", "experiment", "trace", "trace_columns", "trace_row"];

fn read(file: &Path) -> Vec<Token> {
    tokens(&fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display())))
}

/// Names behind `fn`.
fn functions(tokens: &[Token]) -> BTreeSet<&str> {
    let pairs = tokens.windows(2).filter(|pair| pair[0].text == "fn" && pair[1].is_word());
    pairs.map(|pair| pair[1].text.as_str()).collect()
}

#[test]
fn games_with_rays_hand_on_all_that_a_game_is_asked() {
    let file = read(&workspace().join("plugin/lab/src/game.rs"));
    let all = items(&file);
    let game = all.iter().find(|item| item.keyword == "trait" && item.name == "Game").expect("the trait is there");
    let asked = functions(&game.body);
    assert!(asked.len() > 20, "only {asked:?} were found: does the reader still see them?");
    let file = read(&workspace().join("game/src/with_rays.rs"));
    let answered = functions(&file);
    let missing: Vec<_> = asked.difference(&answered).filter(|name| !OWN.contains(*name)).collect();
    assert!(missing.is_empty(), "game/src/with_rays.rs lacks {missing:?}: hand them on in `as_without_rays!`");
    let unknown: Vec<_> = OWN.iter().filter(|name| !asked.contains(*name)).collect();
    assert!(unknown.is_empty(), "no game is asked {unknown:?} any more");
}
