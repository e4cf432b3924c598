//! Audits of sets of levels: equal levels under different numbers, levels of one floor plan, and levels that one held
//! action solves.

use crate::{
    eval::{EpisodeResult, EvalError, EvalPlan, Player, evaluate_until},
    floor_plan::FloorPlan,
    game::{Game, idle_action, is_named_idle},
    held_out::{AlikeLevels, HeldOut, LevelsByLayout, by_layout_until},
    single_actions::{SingleAction, single_actions},
    split::LevelSplit,
};
use bevy::math::{Rect, Vec2};
use bevy_playbot::{bot::BlindBot, state_hash::StateHash};
use playbot_learner::ActionValue;
use std::collections::{BTreeMap, BTreeSet};

/// Most arenas in which actions are tried. The result does not depend on them.
const ARENAS: u32 = 64;

/// Levels of one layout under different numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EqualLevels {
    /// The number of layouts.
    pub layouts: u64,
    /// Levels that share their layout, in ascending order: the largest groups first, then by their first level.
    pub groups: Vec<Vec<u64>>,
}

impl EqualLevels {
    /// Compares levels of a game; `None` if the game does not compare its [layouts](Game::layout).
    pub fn of(game: &dyn Game, split: &LevelSplit) -> Option<Self> {
        Self::of_until(game, split, &|| false).map(|(equal, _)| equal)
    }

    /// Compares levels as [`of`](Self::of) does until the caller stops, and returns the number of compared levels, the first
    /// ones.
    pub fn of_until(game: &dyn Game, split: &LevelSplit, stop: &(dyn Fn() -> bool + Sync)) -> Option<(Self, u64)> {
        let (layouts, count) = by_layout_until(game, split, stop);
        Some((Self::of_layouts(layouts)?, count))
    }

    /// Takes levels by their layout; `None` if there are none.
    pub fn of_layouts(layouts: LevelsByLayout) -> Option<Self> {
        (!layouts.is_empty()).then(|| Self::of_groups(layouts.into_values()))
    }

    /// Takes levels that were compared by their play: as many layouts as there are groups.
    pub fn of_alike(alike: &AlikeLevels) -> Self {
        Self::of_groups(alike.groups().into_iter())
    }

    fn of_groups(groups: impl ExactSizeIterator<Item = Vec<u64>>) -> Self {
        let count = groups.len() as u64;
        Self { layouts: count, groups: largest_first(groups.filter(|levels| levels.len() > 1)) }
    }

    /// Returns the number of levels that share their layout with another.
    pub fn shared(&self) -> u64 {
        self.groups.iter().map(|levels| levels.len() as u64).sum()
    }
}

/// Levels that differ in nothing that their floor plan draws.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EqualPlans {
    /// Levels of one plan whose layouts are different, or are unknown, in ascending order: the largest groups first,
    /// then by their first level.
    pub groups: Vec<Vec<u64>>,
}

impl EqualPlans {
    /// Compares levels of a game; `None` if the game has no [floor plans](crate::game::LevelTools::floor_plan), or if the
    /// caller stopped.
    pub fn of_until(game: &dyn Game, split: &LevelSplit, stop: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        let mut by_plan = BTreeMap::<u64, Vec<u64>>::new();
        for level in split.levels() {
            if stop() {
                return None;
            }
            if let Some(plan) = game.tools().levels.floor_plan(&split.mode, level) {
                by_plan.entry(plan_hash(&plan)).or_default().push(level);
            }
        }
        if by_plan.is_empty() {
            return None;
        }
        let differ = |levels: &Vec<u64>| {
            let layouts: BTreeSet<_> = levels.iter().map(|level| game.layout(&split.mode, *level)).collect();
            layouts.len() > 1 || layouts.contains(&None)
        };
        Some(Self { groups: largest_first(by_plan.into_values().filter(|levels| levels.len() > 1 && differ(levels))) })
    }

    /// Returns the number of levels in all groups.
    pub fn shared(&self) -> u64 {
        self.groups.iter().map(|levels| levels.len() as u64).sum()
    }
}

/// Returns groups of levels, the largest ones first.
fn largest_first(groups: impl Iterator<Item = Vec<u64>>) -> Vec<Vec<u64>> {
    let mut groups: Vec<_> = groups.collect();
    groups.sort_by_key(|levels| (usize::MAX - levels.len(), levels[0]));
    groups
}

/// Returns a hash of all that a plan draws.
fn plan_hash(plan: &FloorPlan) -> u64 {
    let FloorPlan { bounds, walls, hazards, platforms, start, goal } = plan;
    let point = |point: &Vec2| point.to_array().map(|number| u64::from(number.to_bits()));
    let corners = |area: &Rect| [point(&area.min), point(&area.max)].concat();
    let areas = [walls, hazards, platforms].into_iter();
    let areas = areas.flat_map(|areas| [vec![areas.len() as u64], areas.iter().flat_map(corners).collect()].concat());
    StateHash::of(areas.chain(corners(bounds)).chain(point(start)).chain(point(goal))).0
}

/// Returns the levels of a split that are among others: by number, as a file, or by their layout. If the caller stops, these
/// are the ones that were found by then.
pub fn levels_in_until(split: &LevelSplit, others: &HeldOut<'_>, stop: &(dyn Fn() -> bool + Sync)) -> BTreeSet<u64> {
    let is_in = |level: &u64| others.contains(&split.mode, *level) || others.resembles(&split.mode, *level);
    split.levels().take_while(|_| !stop()).filter(is_in).collect()
}

/// Levels that need no player.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlainLevels {
    /// Levels that need no action: solved by the idle action alone, or in the first tick by every action.
    pub without_action: BTreeSet<u64>,
    /// Other levels that are solved by holding one action all the time, by its name.
    pub by_one_action: Vec<(String, BTreeSet<u64>)>,
}

impl PlainLevels {
    /// Plays each level once with each action, held for the whole episode. Continuous actions are rest, and each axis at
    /// both its ends. Where the action is illegal, the idle action is held, or the lowest legal one: see
    /// [`legal`](bevy_playbot::legal). `progress` receives finished episodes, from several threads. Returns `None` if the
    /// caller stopped.
    ///
    /// # Errors
    ///
    /// The game broke its contract.
    pub fn of_until(
        game: &dyn Game,
        split: &LevelSplit,
        threads: usize,
        progress: impl Fn(u64) + Sync,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Self>, EvalError> {
        let plan = EvalPlan::of_bot(split.clone(), ARENAS, threads);
        let mut solved = Vec::new();
        let mut first_ticks = BTreeMap::<u64, u64>::new();
        let mut without_action = BTreeSet::new();
        let (actions, idle) = (held_actions(game), known_idle_action(game));
        for (name, action) in &actions {
            let player = Player::Blind(BlindBot::Constant(action.clone()));
            let results = evaluate_until(game, &player, &plan, &progress, stop)?;
            if stop() {
                return Ok(None);
            }
            let wins = || results.iter().filter(|result| result.success);
            for result in wins().filter(|result: &&EpisodeResult| result.ticks <= 1) {
                *first_ticks.entry(result.level).or_default() += 1;
            }
            if idle.as_ref() == Some(action) {
                without_action.extend(wins().map(|result| result.level));
            }
            solved.push((name.clone(), wins().map(|result| result.level).collect::<BTreeSet<u64>>()));
        }
        let is_at_start = |(level, count): (u64, u64)| (count == actions.len() as u64).then_some(level);
        without_action.extend(first_ticks.into_iter().filter_map(is_at_start));
        let others = |levels: BTreeSet<u64>| levels.difference(&without_action).copied().collect::<BTreeSet<_>>();
        let by_one_action = solved.into_iter().map(|(name, levels)| (name, others(levels)));
        let by_one_action = by_one_action.filter(|(_, levels)| !levels.is_empty()).collect();
        Ok(Some(Self { without_action, by_one_action }))
    }

    /// Returns the levels that some held action solves.
    pub fn by_any_action(&self) -> BTreeSet<u64> {
        self.by_one_action.iter().flat_map(|(_, levels)| levels.iter().copied()).collect()
    }
}

/// Returns the number of episodes that [`PlainLevels::of_until`] plays.
pub fn plain_episodes(game: &dyn Game, split: &LevelSplit) -> u64 {
    split.len().saturating_mul(held_actions(game).len() as u64)
}

/// Returns the action that holds nothing, if the game has one by its name.
fn known_idle_action(game: &dyn Game) -> Option<ActionValue> {
    let names = game.tools().input.action_names();
    let idle = idle_action(game);
    match idle {
        ActionValue::Discrete(choice) if !is_named_idle(&names, choice) => None,
        _ => Some(idle),
    }
}

/// Returns the actions that are held, with their names.
fn held_actions(game: &dyn Game) -> Vec<(String, ActionValue)> {
    let space = game.actions();
    let rest = (space.numbers() > 0).then(|| ("rest".to_owned(), idle_action(game)));
    let held = single_actions(game).into_iter().flat_map(|single| {
        let SingleAction { name, number, mut ways, .. } = single;
        let name = name.unwrap_or_else(|| format!("action {number}"));
        if ways.len() == 1 {
            return ways.into_iter().map(|way| (name.clone(), way)).collect::<Vec<_>>();
        }
        // From the lower end to the upper one.
        ways.reverse();
        [-1.0, 1.0].into_iter().zip(ways).map(|(value, way)| (format!("{name} at {value}"), way)).collect()
    });
    rest.into_iter().chain(held).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;
    use bevy::{app::App, input::keyboard::KeyCode};
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn levels_of_one_plan_are_named_unless_their_layouts_are_equal() {
        let plan = |level: u64| FloorPlan { goal: Vec2::new((level % 3) as f32, 0.0), ..FloorPlan::default() };
        let bare = ForeignGame::new("rooms", 1, |_: &mut App| {});
        let levels: LevelSplit = "default:0..7".parse().expect("levels");
        assert_eq!(EqualPlans::of_until(&bare, &levels, &|| false), None, "the game has no plans");
        let drawn = bare.plan(plan);
        let all = vec![vec![0, 3, 6], vec![1, 4, 7], vec![2, 5]];
        let unknown = EqualPlans::of_until(&drawn, &levels, &|| false).expect("plans");
        assert_eq!((&unknown.groups, unknown.shared()), (&all, 8));
        // 0 and 6 are equal, and so are 1 and 7.
        let other =
            EqualPlans::of_until(&drawn.clone().layout(|_, level| level % 6), &levels, &|| false).expect("plans");
        assert_eq!(other.groups, all);
        let equal = EqualPlans::of_until(&drawn.layout(|_, level| level % 3), &levels, &|| false).expect("plans");
        assert_eq!(equal.groups, Vec::<Vec<u64>>::new());
    }

    #[test]
    fn a_stopped_audit_is_about_the_first_levels() {
        let game = ForeignGame::new("rooms", 1, |_: &mut App| {}).layout(|_, level| level % 3);
        let levels: LevelSplit = "default:0..99".parse().expect("levels");
        let looks = AtomicU64::new(0);
        let stop = || looks.fetch_add(1, Ordering::Relaxed) >= 4;
        let (equal, count) = EqualLevels::of_until(&game, &levels, &stop).expect("layouts");
        assert_eq!((equal.groups, equal.layouts, count), (vec![vec![0, 3], vec![1, 4]], 3, 5));
        assert_eq!(EqualPlans::of_until(&game.clone().plan(|_| FloorPlan::default()), &levels, &stop), None);
        assert_eq!(levels_in_until(&levels, &HeldOut::levels_until(&game, &levels, &stop), &stop), BTreeSet::new());
        let game = game.keys([vec![], vec![KeyCode::Space]]).observe(["nothing"], || [0.0]).time_limit(3);
        let plain = PlainLevels::of_until(&game, &levels, 1, |_| {}, &stop);
        assert_eq!(plain.expect("it plays"), None);
    }
}
