//! The archive of reached cells, with the paths to them.

use std::{collections::BTreeMap, iter};

use playbot_learner::{
    ActionSpace,
    rng::{ChaCha8Rng, unit},
};

use super::{
    cell::Cell,
    visit::{Sight, Visited},
    ways::{Route, Way, Ways},
};

/// A cell that was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReachedCell {
    way: Way,
    /// Whether the episode was over on arrival, on every path there, so that no path goes on from it.
    pub is_over: bool,
    /// Whether every path there only passes it between two ticks. The path then ends with the tick after the cell.
    pub is_passed: bool,
    /// Visits in which it was seen.
    pub visits: u64,
}

impl ReachedCell {
    /// Returns the ticks of the shortest known path to it. A path on which the episode goes on comes before a shorter
    /// one on which it ends. One that ends in the cell comes before a shorter one that passes it.
    pub fn ticks(&self) -> u32 {
        self.way.ticks
    }

    fn sight(&self) -> Sight {
        Sight { ticks: self.ticks(), is_over: self.is_over, is_passed: self.is_passed }
    }
}

/// The destination of a visit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Destination {
    /// The cell; `None` for the start of the level, which needs no path.
    pub cell: Option<Cell>,
    pub way: Way,
    /// Whether the path only passes the cell, with the agent behind it at the end.
    pub is_passed: bool,
}

impl Destination {
    /// The start of the level.
    pub const START: Self = Self { cell: None, way: Way::START, is_passed: false };
}

/// All cells, with their paths.
pub(super) struct Archive {
    start: ReachedCell,
    cells: BTreeMap<Cell, ReachedCell>,
    ways: Ways,
    solution: Option<Way>,
}

impl Archive {
    /// Creates an archive with the start of a level alone.
    pub fn new(space: ActionSpace) -> Self {
        let start = ReachedCell { way: Way::START, is_over: false, is_passed: false, visits: 0 };
        Self { start, cells: BTreeMap::new(), ways: Ways::new(space), solution: None }
    }

    /// Returns all cells, in their order.
    pub fn cells(&self) -> &BTreeMap<Cell, ReachedCell> {
        &self.cells
    }

    /// Returns the shortest path on which the level's goal was reached.
    pub fn solution(&self) -> Option<Way> {
        self.solution
    }

    /// Returns a whole path.
    pub fn route(&self, way: Way) -> Route {
        self.ways.route(way)
    }

    /// Returns the path to a cell.
    pub fn route_to(&self, cell: &Cell) -> Option<Route> {
        self.cells.get(cell).map(|reached| self.route(reached.way))
    }

    /// Returns whether a cell is new, or reached sooner than before.
    pub fn is_news(&self, cell: &Cell, sight: &Sight) -> bool {
        self.cells.get(cell).is_none_or(|known| sight.is_better_than(&known.sight()))
    }

    /// Draws cells to explore from, with the weights of the paper's version without knowledge of the game:
    /// 1/√(visits + 1).
    pub fn choose(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Destination> {
        let all = iter::once((None, &self.start)).chain(self.cells.iter().map(|(cell, reached)| (Some(cell), reached)));
        let open: Vec<_> = all.filter(|(_, reached)| !reached.is_over).collect();
        let mut sum = 0.0;
        let mut ends = Vec::with_capacity(open.len());
        for (_, reached) in &open {
            sum += 1.0 / ((reached.visits + 1) as f64).sqrt();
            ends.push(sum);
        }
        let mut draw = || {
            let at = unit(rng) * sum;
            let (cell, reached) = open[ends.partition_point(|end| *end <= at).min(open.len() - 1)];
            Destination { cell: cell.cloned(), way: reached.way, is_passed: reached.is_passed }
        };
        (0..count).map(|_| draw()).collect()
    }

    /// Adds the cells of a visit.
    pub fn merge(&mut self, visit: Visited) {
        let Visited { destination, piece, seen, solved, .. } = visit;
        if destination.cell.is_none() {
            self.start.visits += 1;
        }
        let solved = solved.filter(|ticks| self.solution.is_none_or(|known| *ticks < known.ticks));
        let news = seen.iter().filter(|(cell, sight)| self.is_news(cell, sight)).map(|(_, sight)| sight.ticks);
        let farthest = news.chain(solved).max();
        let way = farthest.map(|ticks| self.ways.extend(destination.way, &piece, ticks));
        for (cell, sight) in seen {
            let is_news = self.is_news(&cell, &sight);
            let found = ReachedCell {
                way: way.map_or(destination.way, |way| way.cut(sight.ticks)),
                is_over: sight.is_over,
                is_passed: sight.is_passed,
                visits: 0,
            };
            let reached = self.cells.entry(cell).or_insert(found);
            if is_news {
                *reached = ReachedCell { visits: reached.visits, ..found };
            }
            reached.visits += 1;
        }
        if let (Some(ticks), Some(way)) = (solved, way) {
            self.solution = Some(way.cut(ticks));
        }
    }
}

#[cfg(test)]
mod tests {
    use playbot_learner::{Actions, Streams};

    use super::*;

    fn cell(number: i32) -> Cell {
        Cell(vec![number])
    }

    /// A visit from a cell of the archive, with the actions after it, and the cells by the tick in which they were
    /// seen.
    fn visit(archive: &Archive, from: Option<i32>, actions: &[u32], seen: &[(i32, u32, bool)]) -> Visited {
        let from = from.map(cell);
        let way = from.as_ref().map_or(Way::START, |from| archive.cells[from].way);
        let seen =
            seen.iter().map(|&(number, ticks, is_over)| (cell(number), Sight { ticks, is_over, is_passed: false }));
        Visited {
            destination: Destination { cell: from, way, is_passed: false },
            piece: Route { actions: Actions::Discrete(actions.to_vec()), hashes: actions.to_vec() },
            seen: seen.collect(),
            solved: None,
            steps: u64::from(way.ticks) + actions.len() as u64,
            end: None,
        }
    }

    fn archive() -> Archive {
        let mut archive = Archive::new(ActionSpace::Discrete(10));
        archive.merge(visit(&archive, None, &[1, 2, 3], &[(1, 1, false), (2, 2, false), (3, 3, true)]));
        archive
    }

    fn actions(archive: &Archive, number: i32) -> Vec<u32> {
        archive.route_to(&cell(number)).expect("reached").hashes
    }

    #[test]
    fn a_shorter_way_takes_the_place_of_a_longer_one_and_others_keep_theirs() {
        let mut archive = archive();
        archive.merge(visit(&archive, Some(2), &[4, 5], &[(2, 2, false), (4, 4, false)]));
        assert_eq!(actions(&archive, 4), [1, 2, 4, 5]);
        archive.merge(visit(&archive, None, &[7, 8], &[(2, 1, false), (4, 2, false)]));
        assert_eq!((actions(&archive, 2), actions(&archive, 4)), (vec![7], vec![7, 8]));
        archive.merge(visit(&archive, None, &[6, 6, 6], &[(4, 3, false)]));
        assert_eq!(actions(&archive, 4), [7, 8], "a longer one is forgotten");
        assert_eq!(archive.cells[&cell(4)].visits, 3);
        assert_eq!(archive.start.visits, 3, "the visit from cell 2 is none of the start");
    }

    #[test]
    fn a_way_on_which_the_episode_goes_on_counts_more() {
        let mut archive = archive();
        assert!(archive.cells[&cell(3)].is_over);
        archive.merge(visit(&archive, Some(2), &[5, 5], &[(2, 2, false), (3, 4, false)]));
        assert_eq!(actions(&archive, 3), [1, 2, 5, 5]);
        archive.merge(visit(&archive, None, &[9], &[(3, 1, true)]));
        assert_eq!(actions(&archive, 3).len(), 4);
    }

    #[test]
    fn a_way_that_ends_in_a_cell_counts_more_than_one_that_passes_it() {
        let mut archive = archive();
        let passing = |archive: &Archive, actions: &[u32]| {
            let mut visit = visit(archive, None, actions, &[]);
            let ticks = actions.len() as u32;
            visit.seen.insert(cell(7), Sight { ticks, is_over: false, is_passed: true });
            visit
        };
        archive.merge(passing(&archive, &[4, 4]));
        assert_eq!((actions(&archive, 7), archive.cells[&cell(7)].is_passed), (vec![4, 4], true));
        assert!(archive.choose(99, &mut Streams::new(1).stream("test", 0)).iter().any(|chosen| chosen.is_passed));
        archive.merge(visit(&archive, None, &[5, 5, 5], &[(7, 3, false)]));
        assert_eq!((actions(&archive, 7), archive.cells[&cell(7)].is_passed), (vec![5, 5, 5], false));
        archive.merge(passing(&archive, &[6]));
        assert_eq!(actions(&archive, 7), [5, 5, 5]);
        assert_eq!(archive.cells[&cell(7)].visits, 3);
    }

    #[test]
    fn the_shortest_solution_is_kept() {
        let mut archive = archive();
        let solved = |archive: &Archive, actions: &[u32], ticks| Visited {
            solved: Some(ticks),
            ..visit(archive, None, actions, &[(1, 1, false)])
        };
        archive.merge(solved(&archive, &[4, 4, 4, 4], 3));
        assert_eq!(archive.solution().map(|way| archive.route(way).hashes), Some(vec![4, 4, 4]));
        archive.merge(solved(&archive, &[5, 5, 5, 5], 4));
        archive.merge(solved(&archive, &[6, 6], 2));
        assert_eq!(archive.solution().map(|way| archive.route(way).hashes), Some(vec![6, 6]));
    }

    #[test]
    fn cells_that_were_seen_less_are_chosen_more_and_those_where_it_is_over_never() {
        let mut archive = archive();
        for _ in 0..98 {
            archive.merge(visit(&archive, None, &[1], &[(1, 1, false)]));
        }
        let chosen = archive.choose(20_000, &mut Streams::new(1).stream("test", 0));
        let share = |cell: Option<Cell>| {
            chosen.iter().filter(|destination| destination.cell == cell).count() as f64 / chosen.len() as f64
        };
        // Weights: the start and cell 1 have 99 visits, 1/10 each; cell 2 has one, 1/√2.
        let sum = 0.2 + 0.5_f64.sqrt();
        assert!((share(None) - 0.1 / sum).abs() < 0.01, "{}", share(None));
        assert!((share(Some(cell(1))) - 0.1 / sum).abs() < 0.01);
        assert!((share(Some(cell(2))) - 0.5_f64.sqrt() / sum).abs() < 0.01);
        assert_eq!(share(Some(cell(3))), 0.0);
        assert_eq!(archive.choose(9, &mut Streams::new(1).stream("test", 0)), chosen[..9]);
    }
}
