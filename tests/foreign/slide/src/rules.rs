//! Detector of the game's rules, tick by tick. Playing needs none of it.

use bevy::prelude::*;
use playbot::harness::{
    detector::{Detector, DetectorTick, EpisodeWatcher, LevelAhead},
    eval::EpisodeResult,
    foreign::ForeignGame,
};
use playbot::prelude::{ActionValue, EpisodeEnd};

use crate::defects;
use crate::game::{Board, CELLS, Screen};

/// Ticks until time is up: see the adapter.
const TIME: u32 = 120;

/// Adds the detector and the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    defects::add_to(game).detector(|| Rules)
}

struct Rules;

impl Detector for Rules {
    fn name(&self) -> &'static str {
        "slide-rules"
    }

    fn describe(&self) -> &'static str {
        "tiles, rewards or ends differ from those by the rules of the puzzle"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::<Watched>::default())
    }
}

/// The screen and the board after the last tick of an episode.
#[derive(Default)]
struct Watched(Option<(Screen, Board)>);

impl EpisodeWatcher for Watched {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let screen = **moment.world.get_resource::<State<Screen>>()?;
        let board = moment.world.get_resource::<Board>()?.clone();
        let before = self.0.replace((screen, board.clone()));
        if moment.is_success && !board.is_solved() {
            return Some(format!("the puzzle counts as solved with the tiles {:?}", board.0));
        }
        if (moment.reward != 0.0) != moment.is_success {
            return Some(format!("a reward of {}, and solved is {}", moment.reward, moment.is_success));
        }
        // Other screens have no moves. The click that leads to the board may be followed by one on it.
        let (Some((Screen::Playing, mut expected)), Screen::Playing) = (before, screen) else { return None };
        if expected.is_solved() {
            return Some("the tiles are in order, and the puzzle goes on".to_owned());
        }
        let tiles = expected.0;
        clicked(moment.action).into_iter().for_each(|cell| expected.slide(cell));
        (board != expected).then(|| format!("{:?} turns the tiles {tiles:?} into {:?}", moment.action, board.0))
    }

    fn end(&mut self, _moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        match result.end {
            _ if result.success => None,
            EpisodeEnd::Terminated { .. } => Some("the puzzle is lost, which cannot happen".to_owned()),
            EpisodeEnd::Truncated => (result.ticks < TIME)
                .then(|| format!("time is up after {} ticks, and a puzzle has {TIME}", result.ticks)),
        }
    }
}

/// Returns the cell that an action clicks on.
fn clicked(action: &ActionValue) -> Option<usize> {
    match action {
        ActionValue::Discrete(choice) => (*choice as usize).checked_sub(1).filter(|cell| *cell < CELLS),
        ActionValue::Continuous(_) | ActionValue::Mixed { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOLVED: [u8; CELLS] = [1, 2, 3, 4, 5, 6, 7, 8, 0];
    /// The gap is above the last cell.
    const MOVED: [u8; CELLS] = [1, 2, 3, 4, 5, 0, 7, 8, 6];
    /// The action that clicks on the last cell.
    const LAST: u32 = CELLS as u32;

    /// Returns the message about a tick in which an action leads from one board to another one.
    fn said(tiles: [[u8; CELLS]; 2], action: u32, is_success: bool, reward: f32) -> Option<String> {
        let mut world = World::new();
        world.insert_resource(State::new(Screen::Playing));
        world.insert_resource(Board(tiles[1]));
        let action = ActionValue::Discrete(action);
        let moment = DetectorTick { reward, is_success, ..DetectorTick::of(&world, &action) };
        Watched(Some((Screen::Playing, Board(tiles[0])))).tick(&moment)
    }

    #[test]
    fn clicks_move_tiles_into_the_gap_and_nothing_else_does() {
        let is_broken = |tiles, action| said(tiles, action, false, 0.0).is_some();
        assert!(!is_broken([MOVED, SOLVED], LAST) && !is_broken([MOVED, MOVED], 0));
        assert!(!is_broken([MOVED, MOVED], 1), "the first cell is not beside the gap");
        assert!(is_broken([MOVED, MOVED], LAST), "the tile stays");
        assert!(is_broken([MOVED, SOLVED], 0), "no click");
        assert!(is_broken([MOVED, SOLVED], LAST - 3), "the gap was clicked on");
        assert!(is_broken([SOLVED, SOLVED], 0), "it is solved and goes on");
    }

    #[test]
    fn only_tiles_in_order_are_solved_and_paid() {
        assert_eq!(said([MOVED, SOLVED], LAST, true, 1.0), None);
        assert!(said([MOVED, MOVED], 0, true, 1.0).is_some(), "not in order");
        assert!(said([MOVED, MOVED], 0, false, 0.5).is_some(), "paid for nothing");
        assert!(said([MOVED, SOLVED], LAST, true, 0.0).is_some(), "not paid");
    }

    #[test]
    fn a_puzzle_ends_solved_or_when_its_time_is_up() {
        let said = |end: EpisodeEnd, ticks: u32| {
            let (world, success) = (World::new(), end.is_success());
            let result = EpisodeResult { level: 0, end, success, ticks, clipped: 0, total_reward: 0.0 };
            let action = ActionValue::Discrete(0);
            let moment = DetectorTick { tick: ticks - 1, is_success: success, ..DetectorTick::of(&world, &action) };
            Watched::default().end(&moment, &result)
        };
        assert!(said(EpisodeEnd::WON, 9).is_none() && said(EpisodeEnd::Truncated, TIME).is_none());
        assert!(said(EpisodeEnd::LOST, 9).is_some() && said(EpisodeEnd::Truncated, TIME - 1).is_some());
    }
}
