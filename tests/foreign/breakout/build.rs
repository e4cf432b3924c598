//! Takes the game out of the `bevy` package.

fn main() {
    foreign_showcase::write_game("breakout", &["stepping"], Some(include_str!("silence.rs")));
}
