//! A game that wraps another one hands on every question, also those that are added later.

use std::{collections::BTreeSet, fs, path::Path};

use crate::{
    items::items,
    packages::workspace,
    tokens::{Token, tokens},
};

/// What [`WithSenses`](playbot_games::senses::WithSenses) does not hand on: what is written for the game itself by name,
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

/// What a game is asked, and what of it the functions of this file do not answer.
fn unanswered(file: &str) -> (BTreeSet<String>, BTreeSet<String>) {
    let tokens = read(&workspace().join("plugin/lab/src/game.rs"));
    let all = items(&tokens);
    let game = all.iter().find(|item| item.keyword == "trait" && item.name == "Game").expect("the trait is there");
    let asked = functions(&game.body);
    assert!(asked.len() > 20, "only {asked:?} were found: does the reader still see them?");
    let tokens = read(&workspace().join(file));
    let answered = functions(&tokens);
    let missing = asked.difference(&answered).map(|name| (*name).to_owned()).collect();
    (asked.into_iter().map(str::to_owned).collect(), missing)
}

#[test]
fn games_with_senses_hand_on_all_that_a_game_is_asked() {
    let (asked, missing) = unanswered("game/src/senses/with_senses.rs");
    let missing: Vec<_> = missing.iter().filter(|name| !OWN.contains(&name.as_str())).collect();
    assert!(
        missing.is_empty(),
        "game/src/senses/with_senses.rs lacks {missing:?}: hand them on in `as_without_senses!`"
    );
    let unknown: Vec<_> = OWN.iter().filter(|name| !asked.contains(**name)).collect();
    assert!(unknown.is_empty(), "no game is asked {unknown:?} any more");
}

#[test]
fn games_with_planted_defects_hand_on_all_that_a_game_is_asked() {
    let (_, missing) = unanswered("plugin/lab/src/bugs/mutant.rs");
    assert!(missing.is_empty(), "plugin/lab/src/bugs/mutant.rs lacks {missing:?}: hand them on in `as_sound!`");
}
