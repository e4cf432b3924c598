//! Bots without sensors, by name.

use bevy_playbot::bot::BlindBot;

use crate::game::Game;

/// Name of the bot that every game has in addition to its own: [`BlindBot::Chaos`].
pub const CHAOS: &str = "chaos";

/// Returns the blind bots that can play a game: [its own](crate::game::BotTools::blind_bots), and [`CHAOS`].
pub fn blind_bots(game: &dyn Game) -> Vec<(&'static str, BlindBot)> {
    let mut bots = game.tools().bots.blind_bots();
    if bots.iter().all(|(name, _)| *name != CHAOS) {
        bots.push((CHAOS, BlindBot::Chaos));
    }
    bots
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;

    #[test]
    fn every_game_has_chaos_behind_its_own_bots() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let bots = blind_bots(&game);
        assert_eq!(bots.last(), Some(&(CHAOS, BlindBot::Chaos)));
        assert_eq!(bots.len(), game.tools().bots.blind_bots().len() + 1);
    }
}
