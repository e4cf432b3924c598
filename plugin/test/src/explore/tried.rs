//! The discrete actions that were tried from each cell, and whether any is left.

use crate::explore::cell::ExploredCell;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

/// Ticks in a row in which an action is tried that does not lead out of a cell: half a second of most games. A cell is
/// larger than one step of most of them.
const HOLD: u32 = 30;

/// Times that an action has changed nothing in a cell before it counts as tried there. In a single tick it may change
/// nothing for the only reason that the agent still rests from its last step.
const IDLE: u32 = 100;

/// The statement that an exploration has tried every action from every cell that it knows, and that no other cell came
/// up. It is no proof.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Exhaustion {
    /// Number of the actions.
    pub actions: u32,
    /// Cells from which each of them was tried: all but those in which the episode is over.
    pub cells: usize,
    /// The assumption that the statement rests on.
    pub rests_on: String,
}

impl fmt::Display for Exhaustion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { actions, cells, rests_on } = self;
        write!(
            f,
            "each of {actions} actions was tried from the start and from each of {cells} cells; no proof, it rests on \
             {rests_on}"
        )
    }
}

/// Actions that were tried from the start of a level, and from cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct TriedActions {
    start: BTreeSet<u32>,
    cells: BTreeMap<ExploredCell, BTreeSet<u32>>,
    /// Times that actions have changed nothing in a cell.
    idle: BTreeMap<ExploredCell, BTreeMap<u32, u32>>,
}

impl TriedActions {
    /// Adds an action from a cell; `None` is the start.
    fn add(&mut self, cell: Option<&ExploredCell>, action: u32) {
        let tried = cell.map_or(&mut self.start, |cell| of_cell(&mut self.cells, cell));
        tried.insert(action);
    }

    /// Notes that an action has changed nothing in a cell so many times more.
    fn add_idle(&mut self, cell: &ExploredCell, action: u32, times: u32) {
        let count = of_cell(&mut self.idle, cell).entry(action).or_default();
        *count = (*count + times).min(IDLE);
        if *count == IDLE {
            self.add(Some(cell), action);
        }
    }

    /// Adds the actions of a visit.
    pub fn merge(&mut self, other: Self) {
        for (cell, actions) in &other.idle {
            actions.iter().for_each(|(action, times)| self.add_idle(cell, *action, *times));
        }
        self.start.extend(other.start);
        for (cell, actions) in other.cells {
            self.cells.entry(cell).or_default().extend(actions);
        }
    }

    /// Returns whether this many actions were tried from a cell; `None` is the start.
    pub fn has_all(&self, cell: Option<&ExploredCell>, actions: u32) -> bool {
        let tried = cell.map_or(Some(&self.start), |cell| self.cells.get(cell));
        tried.is_some_and(|tried| tried.len() >= actions as usize)
    }
}

/// Returns the value of a cell. The cell is copied once, and not in each tick.
fn of_cell<'a, V: Default>(all: &'a mut BTreeMap<ExploredCell, V>, cell: &ExploredCell) -> &'a mut V {
    if !all.contains_key(cell) {
        all.insert(cell.clone(), V::default());
    }
    all.get_mut(cell).expect("it was added")
}

/// The action of a tick, and its effect.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    pub action: u32,
    /// Whether the state hash is another one than before.
    pub has_changed: bool,
    /// Whether the game was over after it.
    pub is_over: bool,
}

/// Notes the actions of a visit from cell to cell.
///
/// An action counts as tried from a cell if it leads to another cell or ends the game, if it is repeated in the cell for
/// a while, or if it has changed nothing there many times.
#[derive(Default)]
pub(super) struct TrialNotes {
    /// The actions so far.
    pub tried: TriedActions,
    /// The last known cell, with the ticks of the episode.
    here: Option<(u32, ExploredCell)>,
    /// The last action.
    action: Option<u32>,
    /// Ticks in a row in which it was taken in this cell.
    held: u32,
}

impl TrialNotes {
    /// Notes the cell of the agent after this many ticks, and the action of the tick before, if the visit has chosen
    /// it.
    pub fn arrive(&mut self, ticks: u32, cell: &ExploredCell, trial: Option<Trial>) {
        let before = self.here.take().filter(|(before, _)| before + 1 == ticks);
        if let Some(trial) = trial.filter(|_| ticks == 1) {
            self.tried.add(None, trial.action);
        }
        let stays = before.as_ref().is_some_and(|(_, from)| from == cell);
        if let (Some((_, from)), Some(trial)) = (&before, trial) {
            self.held = match (stays, self.action == Some(trial.action)) {
                (false, _) => 0,
                (true, true) => self.held + 1,
                (true, false) => 1,
            };
            self.action = Some(trial.action);
            if !stays || trial.is_over || self.held >= HOLD {
                self.tried.add(Some(from), trial.action);
            } else if !trial.has_changed {
                self.tried.add_idle(from, trial.action, 1);
            }
        }
        let here = before.filter(|_| stays).map_or_else(|| cell.clone(), |(_, from)| from);
        self.here = Some((ticks, here));
    }

    /// Notes the action that ended the game in this tick, for cells that are known a tick later.
    pub fn end(&mut self, ticks: u32, action: u32) {
        if ticks == 1 {
            self.tried.add(None, action);
        }
        if let Some((_, from)) = self.here.as_ref().filter(|(before, _)| before + 1 == ticks) {
            self.tried.add(Some(from), action);
        }
    }

    /// Notes actions that are illegal after this many ticks: they cannot be tried there.
    pub fn forbid(&mut self, ticks: u32, mask: &[bool]) {
        for (action, _) in (0..).zip(mask).filter(|(_, is_legal)| !**is_legal) {
            if ticks == 0 {
                self.tried.add(None, action);
            }
            if let Some((_, here)) = self.here.as_ref().filter(|(at, _)| *at == ticks) {
                self.tried.add(Some(here), action);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(number: i32) -> ExploredCell {
        ExploredCell(vec![number])
    }

    fn trial(action: u32) -> Option<Trial> {
        Some(Trial { action, has_changed: true, is_over: false })
    }

    /// Returns the actions that were tried from a cell.
    fn tried(notes: &TrialNotes, number: i32) -> Vec<u32> {
        notes.tried.cells.get(&cell(number)).into_iter().flatten().copied().collect()
    }

    #[test]
    fn an_action_that_leads_to_another_cell_was_tried() {
        let mut notes = TrialNotes::default();
        notes.arrive(5, &cell(1), None);
        notes.arrive(6, &cell(1), trial(0));
        notes.arrive(7, &cell(2), trial(1));
        assert_eq!((tried(&notes, 1), tried(&notes, 2)), (vec![1], vec![]));
        assert!(notes.tried.start.is_empty(), "the visit began later");
    }

    #[test]
    fn an_action_in_one_cell_is_tried_if_it_is_repeated_long_enough() {
        let mut notes = TrialNotes::default();
        notes.arrive(0, &cell(1), None);
        for ticks in 1..HOLD {
            notes.arrive(ticks, &cell(1), trial(2));
        }
        assert_eq!(tried(&notes, 1), Vec::<u32>::new());
        notes.arrive(HOLD, &cell(1), trial(2));
        assert_eq!(tried(&notes, 1), [2]);
        assert_eq!(notes.tried.start, BTreeSet::from([2]), "the first action was taken at the start");
    }

    #[test]
    fn an_action_that_ends_the_game_was_tried() {
        let mut notes = TrialNotes::default();
        notes.arrive(4, &cell(1), None);
        notes.arrive(5, &cell(1), Some(Trial { action: 1, has_changed: true, is_over: true }));
        assert_eq!(tried(&notes, 1), [1]);
        notes.end(6, 2);
        notes.end(9, 3);
        assert_eq!(tried(&notes, 1), [1, 2], "in tick 9 the cell before is unknown");
    }

    #[test]
    fn an_action_that_changes_nothing_was_tried_after_many_times_in_all_visits_together() {
        let mut all = TriedActions::default();
        for times in 1..=IDLE {
            let mut notes = TrialNotes::default();
            notes.arrive(3, &cell(1), None);
            notes.arrive(4, &cell(1), Some(Trial { action: 0, has_changed: false, is_over: false }));
            notes.arrive(5, &cell(1), trial(1));
            all.merge(notes.tried);
            assert_eq!(all.has_all(Some(&cell(1)), 1), times == IDLE, "{times}");
        }
        assert!(!all.has_all(Some(&cell(1)), 2), "action 1 has changed something and led nowhere yet");
    }

    #[test]
    fn illegal_actions_count_as_tried_and_all_of_them_are_needed() {
        let mut notes = TrialNotes::default();
        notes.arrive(3, &cell(1), None);
        notes.forbid(3, &[true, false, true]);
        notes.forbid(4, &[false, false, true]);
        assert_eq!(tried(&notes, 1), [1]);
        let mut all = TriedActions::default();
        all.merge(notes.tried);
        assert!(!all.has_all(Some(&cell(1)), 3) && !all.has_all(Some(&cell(2)), 1) && !all.has_all(None, 1));
        all.add(Some(&cell(1)), 0);
        all.add(Some(&cell(1)), 2);
        assert!(all.has_all(Some(&cell(1)), 3));
    }
}
