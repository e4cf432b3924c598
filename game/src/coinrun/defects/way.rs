//! Positions of a rules defect along a level. Variants begin at the start, further on and late, so that testers that
//! get further find more.

use crate::{
    coinrun::level::Level,
    defect_variant::{PLACES, place},
};

/// Shares of the path to the coin from which on a defect acts.
const FROM: [f32; PLACES as usize] = [0.0, 0.35, 0.7];
/// Shares of the path at which an obstacle stands.
const AT: [f32; PLACES as usize] = [0.25, 0.5, 0.75];

/// Returns the column at which the defect begins to act, in tiles from the left.
pub(super) fn begins(level: &Level, variant: u32) -> f32 {
    FROM[place(variant)] * level.coin[0] as f32
}

/// Returns a column between start and coin for an obstacle.
pub(super) fn column(level: &Level, variant: u32) -> i32 {
    let [coin, _] = level.coin;
    ((AT[place(variant)] * coin as f32) as i32).min(coin - 3).max(4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{Mode, generate};

    #[test]
    fn variants_go_through_the_places() {
        let level = generate(Mode::Hard, 1);
        let coin = level.coin[0];
        assert_eq!(begins(&level, 3), 0.0);
        assert!(begins(&level, 1) < begins(&level, 2) && begins(&level, 5) == begins(&level, 2));
        assert!(column(&level, 0) < column(&level, 1) && column(&level, 2) < coin);
    }
}
