//! Build script: copies the game out of the `bevy` package.

// A path, not a dependency: packages may depend on nothing that is not published.
#[path = "../showcase/src/lib.rs"]
mod showcase;

fn main() {
    showcase::write_game("breakout", &["stepping"], Some(include_str!("silence.rs")));
}
