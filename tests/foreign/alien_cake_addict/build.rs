//! Takes the game out of the `bevy` package.

fn main() {
    foreign_showcase::write_game("alien_cake_addict", &[], Some(include_str!("seeded.rs")));
}
