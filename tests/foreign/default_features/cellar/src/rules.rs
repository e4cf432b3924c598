//! Detector of the game's rules, tick by tick, and a bot that goes where they can be broken. Playing needs none of it.

use std::collections::{HashSet, VecDeque};

use bevy::prelude::*;
use playbot::harness::{
    detector::{Detector, DetectorTick, EpisodeWatcher, LevelAhead},
    eval::EpisodeResult,
    foreign::ForeignGame,
};
use playbot::prelude::{ActionValue, EpisodeEnd};

use crate::defects;
use crate::game::{Cell, Room, Screen, WAYS};

/// Ticks until time is up: see the adapter.
const TIME: u32 = 900;

/// Ticks after a step in which the walker may rest.
const REST: u32 = 8;

/// Adds the detector, the bot and the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    defects::add_to(game).detector(|| Rules).bot("tourist", tour)
}

/// Goes to the nearest cell where it has not been, without falling into a pit, and to the exit when there is no more.
fn tour(time: Res<Time>, room: Res<Room>, mut last: Local<f32>, mut seen: Local<HashSet<IVec2>>) -> u32 {
    // The clock of the game begins anew with each episode.
    let now = time.elapsed_secs();
    if now <= *last {
        seen.clear();
    }
    *last = now;
    seen.insert(room.at);
    way_to_news(&room, &seen).or_else(|| room.hint()).map_or(0, |way| way as u32 + 1)
}

/// Returns the first direction of a shortest path to a cell that was not seen, as an index of [`WAYS`].
fn way_to_news(room: &Room, seen: &HashSet<IVec2>) -> Option<usize> {
    let mut known = HashSet::from([room.clone()]);
    let mut open = VecDeque::from([(room.clone(), None)]);
    while let Some((room, first)) = open.pop_front() {
        for (index, (_, way)) in WAYS.iter().enumerate() {
            let (mut next, first) = (room.clone(), first.unwrap_or(index));
            match next.step(*way) {
                None | Some(Cell::Pit | Cell::Exit) => continue,
                Some(_) if !seen.contains(&next.at) => return Some(first),
                Some(_) => {}
            }
            if known.insert(next.clone()) {
                open.push_back((next, Some(first)));
            }
        }
    }
    None
}

struct Rules;

impl Detector for Rules {
    fn name(&self) -> &'static str {
        "cellar-rules"
    }

    fn describe(&self) -> &'static str {
        "steps, rewards or ends differ from those by the rules of the cellar"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::<Watched>::default())
    }
}

/// An episode so far.
#[derive(Default)]
struct Watched {
    /// The screen and the room after the last tick.
    before: Option<(Screen, Room)>,
    /// Ticks without a step.
    rested: u32,
}

impl EpisodeWatcher for Watched {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let screen = **moment.world.get_resource::<State<Screen>>()?;
        let room = moment.world.get_resource::<Room>()?.clone();
        let before = self.before.replace((screen, room.clone()));
        if (moment.reward != 0.0) != moment.is_success {
            return Some(format!("a reward of {}, and success is {}", moment.reward, moment.is_success));
        }
        if moment.is_success && room.at != room.exit {
            return Some(format!("the room is left at {}, and its exit is at {}", room.at, room.exit));
        }
        let (Some((Screen::Walking, mut expected)), Screen::Walking) = (before, screen) else { return None };
        let (at, can_step) = (expected.at, way(moment.action).and_then(|way| expected.step(way)).is_some());
        if room.at == at {
            self.rested += 1;
            let is_late = can_step && self.rested > REST;
            return is_late.then(|| format!("the walker stays at {at} for {} ticks, with free way", self.rested));
        }
        self.rested = 0;
        let (to, keys) = (room.at, room.keys);
        (room != expected).then(|| format!("a step from {at} to {to}, with {keys} keys then, is against the rules"))
    }

    fn end(&mut self, moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        let room = moment.world.get_resource::<Room>()?;
        match result.end {
            _ if result.success => None,
            EpisodeEnd::Terminated { .. } => {
                (room.cell(room.at) != Cell::Pit).then(|| format!("the walk is lost at {}, where no pit is", room.at))
            }
            EpisodeEnd::Truncated => {
                (result.ticks < TIME).then(|| format!("time is up after {} ticks, and a walk has {TIME}", result.ticks))
            }
        }
    }
}

/// Returns the direction of an action.
fn way(action: &ActionValue) -> Option<IVec2> {
    match action {
        ActionValue::Discrete(choice) => WAYS.get((*choice as usize).checked_sub(1)?).map(|(_, way)| *way),
        ActionValue::Continuous(_) | ActionValue::Mixed { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The action without a key, and the one with that to the right.
    const STAY: u32 = 0;
    const RIGHT: u32 = 4;

    /// A corridor of four cells, with a key in the second one and a pit in the third, and the walker at its left end.
    fn corridor() -> Room {
        let mut room = Room::default();
        room.exit = IVec2::new(3, 0);
        [Cell::Floor, Cell::Key, Cell::Pit, Cell::Exit]
            .into_iter()
            .enumerate()
            .for_each(|(x, cell)| room.put(IVec2::new(x as i32, 0), cell));
        room
    }

    #[test]
    fn the_bot_sees_all_that_it_can_before_it_leaves() {
        let mut room = corridor();
        room.at = IVec2::new(1, 1);
        for (x, cell) in [(0, Cell::Wall), (1, Cell::Floor), (2, Cell::Floor)] {
            room.put(IVec2::new(x, 1), cell);
        }
        let mut seen = HashSet::from([room.at]);
        while let Some(way) = way_to_news(&room, &seen) {
            let cell = room.step(WAYS[way].1);
            assert!(!matches!(cell, Some(Cell::Pit | Cell::Exit)), "{cell:?}");
            seen.insert(room.at);
        }
        let cells = [[0, 0], [1, 0], [1, 1], [2, 1]].map(IVec2::from);
        assert_eq!((seen, room.keys), (HashSet::from(cells), 1));
    }

    /// Returns the corridor after steps to the right.
    fn after(steps: u32) -> Room {
        let mut room = corridor();
        (0..steps).for_each(|_| _ = room.step(IVec2::X));
        room
    }

    /// Calls a function with the moment of a tick that leads to this room.
    fn at<T>(room: Room, action: u32, is_success: bool, reward: f32, ask: impl FnOnce(&DetectorTick<'_>) -> T) -> T {
        let mut world = World::new();
        world.insert_resource(State::new(Screen::Walking));
        world.insert_resource(room);
        ask(&DetectorTick { reward, is_success, ..DetectorTick::of(&world, &ActionValue::Discrete(action)) })
    }

    /// Returns whether a tick after so many ticks of rest breaks a rule.
    fn is_broken([before, now]: [Room; 2], action: u32, rested: u32) -> bool {
        let mut watched = Watched { before: Some((Screen::Walking, before)), rested };
        at(now, action, false, 0.0, |moment| watched.tick(moment)).is_some()
    }

    #[test]
    fn a_walker_steps_where_its_keys_lead_and_rests_for_a_moment_only() {
        assert!(!is_broken([corridor(), after(1)], RIGHT, 0), "with the key");
        assert!(!is_broken([corridor(), corridor()], RIGHT, 0) && !is_broken([corridor(), corridor()], STAY, 99));
        assert!(is_broken([corridor(), corridor()], RIGHT, REST), "it rests for too long");
        assert!(!is_broken([after(3), after(3)], RIGHT, 99), "the wall is in the way");
        assert!(is_broken([corridor(), after(1)], STAY, 0), "no key was pressed");
        assert!(is_broken([corridor(), after(2)], RIGHT, 0), "two cells at a time");
        let mut lost = after(1);
        lost.keys = 0;
        assert!(is_broken([corridor(), lost], RIGHT, 0), "the key is lost");
    }

    #[test]
    fn rewards_and_ends_belong_to_the_exit_to_pits_and_to_the_time_limit() {
        let pays = |room, is_success, reward| {
            at(room, STAY, is_success, reward, |moment| Watched::default().tick(moment)).is_none()
        };
        assert!(pays(after(3), true, 1.0) && pays(after(1), false, 0.0));
        assert!(!pays(after(1), true, 1.0) && !pays(after(3), true, 0.0) && !pays(after(1), false, 0.1));
        let ends = |room, end: EpisodeEnd, ticks: u32| {
            let success = end.is_success();
            let result = EpisodeResult { level: 0, end, success, ticks, clipped: 0, total_reward: 0.0 };
            at(room, STAY, success, 0.0, |moment| Watched::default().end(moment, &result)).is_none()
        };
        assert!(ends(after(3), EpisodeEnd::WON, 40) && ends(after(2), EpisodeEnd::LOST, 20));
        assert!(ends(after(1), EpisodeEnd::Truncated, TIME) && !ends(after(1), EpisodeEnd::Truncated, TIME - 1));
        assert!(!ends(after(1), EpisodeEnd::LOST, 20), "no pit is there");
    }
}
