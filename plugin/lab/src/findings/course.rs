//! The course of an episode tick by tick, and its comparison with another one.

use bevy_playbot::vision::ObservationConfig;

use super::{
    play::{Replayed, play_player},
    solo::{Setting, Solo},
};
use crate::{eval::Player, game::Game};

/// Returns the course of the episode of a bot with this seed.
pub(crate) fn course_of(game: &dyn Game, (mode, level): (&str, u64), seed: u64, bot: &Player) -> Replayed {
    let played = play_player(Setting { game, mode, level, seed }, bot, &ObservationConfig::default());
    let (_, course) = played.expect("nothing can be wrong with a vector");
    course
}

/// Returns whether a bot's episode is the same as before: the same rewards and states in each tick, and the same end.
/// It is played up to the first difference.
pub(crate) fn keeps_course(
    game: &dyn Game,
    (mode, level): (&str, u64),
    seed: u64,
    bot: &Player,
    course: &Replayed,
) -> bool {
    let built = Solo::new(Setting { game, mode, level, seed }, &ObservationConfig::default());
    let mut solo = built.expect("nothing can be wrong with a vector");
    solo.seat(bot);
    let mut ticks = 0;
    loop {
        match solo.tick() {
            Err(broken) => return course.broken.as_ref() == Some(&broken),
            Ok(false) => continue,
            Ok(true) => {}
        }
        let (reward, hash) = solo.outcome();
        let before = course.rewards.get(ticks).zip(course.state_hashes.get(ticks));
        let is_same = |(paid, state): (&f32, &u32)| paid.to_bits() == reward.to_bits() && *state == hash;
        if !before.is_some_and(is_same) {
            return false;
        }
        ticks += 1;
        match solo.end() {
            Some(end) => return course.end == Some(end),
            // The other one was over.
            None if course.end.is_some() && ticks == course.rewards.len() => return false,
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy_playbot::{action::ActionValue, bot::BlindBot};

    use super::*;
    use crate::corridor::{Corridor, Rule};

    #[test]
    fn the_same_game_keeps_its_course_and_a_broken_one_does_not() {
        let level = ("plain", 3);
        for bot in [Player::Demonstrator, Player::Blind(BlindBot::Uniform)] {
            let course = course_of(&Corridor::default(), level, 5, &bot);
            assert!(course.end.is_some() && !course.rewards.is_empty());
            assert!(keeps_course(&Corridor::default(), level, 5, &bot, &course));
        }
        let guided = course_of(&Corridor::default(), level, 0, &Player::Demonstrator);
        let burning = Corridor { rule: Rule::Panics };
        assert!(!keeps_course(&burning, level, 0, &Player::Demonstrator, &guided));
        let idle = Player::Blind(BlindBot::Constant(ActionValue::Discrete(2)));
        assert!(!keeps_course(&Corridor::default(), level, 0, &idle, &guided), "another player goes another way");
        let broken = course_of(&burning, level, 0, &Player::Demonstrator);
        assert!(broken.broken.is_some() && keeps_course(&burning, level, 0, &Player::Demonstrator, &broken));
    }
}
