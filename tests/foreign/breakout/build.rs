//! Takes the game out of the `bevy` package.

// A link, not a dependency: packages may depend on nothing that is not published.
#[path = "showcase/lib.rs"]
mod showcase;

fn main() {
    showcase::write_game("breakout", &["stepping"], Some(include_str!("silence.rs")));
}
