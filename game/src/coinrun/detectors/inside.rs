//! Detector of players in the ground.

use playbot_lab::detector::{Detector, EachTick, Moment};

use super::contact::place;
use crate::coinrun::components::{Arena, PlayerBody, PlaysIn};

/// Finds a player whose middle is in ground with more ground below it. By the rules a player's corners stay out of
/// walls, and it can be in one only across a ledge one tile thick.
pub(super) fn inside_ground() -> impl Detector {
    EachTick::new("inside-ground", "a player is inside of ground", |moment: &Moment<'_>| {
        let body = moment.world.get::<PlayerBody>(moment.agent)?.0;
        let arena = moment.world.get::<PlaysIn>(moment.agent)?.0;
        let tiles = &moment.world.get::<Arena>(arena)?.level.tiles;
        let (x, y) = (body.x.floor() as i32, body.y.floor() as i32);
        let is_inside = tiles.get(x, y).is_wall() && tiles.get(x, y - 1).is_wall();
        is_inside.then(|| format!("inside of ground at {}", place(moment)))
    })
}

#[cfg(test)]
mod tests {
    use crate::coinrun::detectors::testing::{Bot, first_named, planted, sound};

    #[test]
    fn who_falls_into_ground_that_does_not_hold_is_found_and_who_runs_on_it_is_not() {
        assert!(first_named("inside-ground", &planted("missing-collider", 0), Bot::RightJump, 0..60).is_some());
        assert_eq!(first_named("inside-ground", &sound(), Bot::RightJump, 0..40), None);
    }
}
