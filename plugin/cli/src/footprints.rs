//! Picture of the paths of measured players.

use std::path::Path;

use playbot_lab::{
    eval::Trail,
    floor_plan::FloorPlan,
    game::Game,
    report::{Floor, TrailChart, Walker},
    split::LevelSplit,
};

use super::{error::CliError, plot::PlotFile};

/// Trails as they come in, by floor and player.
pub struct Footprints {
    file: PlotFile,
    grounds: Vec<Ground>,
}

/// A floor and its levels.
struct Ground {
    mode: String,
    levels: Vec<u64>,
    floor: Floor,
}

impl Footprints {
    /// Prepares the trails of a game, to be drawn into a file.
    ///
    /// # Errors
    ///
    /// The file's ending is unknown, or the game has no floor plan for these levels.
    pub fn new(path: &Path, game: &dyn Game, splits: &[LevelSplit]) -> Result<Self, CliError> {
        let file = PlotFile::new(path)?;
        match splits.iter().find(|split| game.tools().levels.floor_plan(&split.mode, split.first).is_none()) {
            Some(split) => Err(CliError::Usage(format!(
                "`{}` has no floor plan of level {}:{}: leave --plot out",
                game.name(),
                split.mode,
                split.first
            ))),
            None => Ok(Self { file, grounds: Vec::new() }),
        }
    }

    /// Adds a player's trails on some levels, each from its start. The trails come sorted by level.
    pub fn add(&mut self, game: &dyn Game, split: &LevelSplit, player: &str, trails: Vec<Trail>) {
        let mut known = None;
        for mut trail in trails {
            let level = trail.result.level;
            let (at, start) = match known {
                Some((same, at, start)) if same == level => (at, start),
                _ => {
                    let Some(plan) = game.tools().levels.floor_plan(&split.mode, level) else { continue };
                    let start = plan.start;
                    (self.ground(&split.mode, level, plan), start)
                }
            };
            known = Some((level, at, start));
            // The first position is that after the first tick, which may be far from the mark of the start.
            trail.places.insert(0, start);
            let walkers = &mut self.grounds[at].floor.walkers;
            match walkers.iter_mut().find(|walker| walker.name == player) {
                Some(walker) => walker.trails.push(trail),
                None => walkers.push(Walker { name: player.to_owned(), trails: vec![trail] }),
            }
        }
    }

    /// Returns the index of a level's floor in the list.
    fn ground(&mut self, mode: &str, level: u64, plan: FloorPlan) -> usize {
        let is_same = |ground: &Ground| {
            let known = &ground.floor.plan;
            let tiles = |plan: &FloorPlan| [&plan.walls, &plan.hazards, &plan.platforms].map(Vec::clone);
            ground.mode == mode && known.bounds == plan.bounds && tiles(known) == tiles(&plan)
        };
        let (start, goal) = (plan.start, plan.goal);
        let at = self.grounds.iter().position(is_same).unwrap_or_else(|| {
            let floor = Floor { name: String::new(), plan, starts: vec![], goals: vec![], walkers: vec![] };
            self.grounds.push(Ground { mode: mode.to_owned(), levels: Vec::new(), floor });
            self.grounds.len() - 1
        });
        let Ground { levels, floor, .. } = &mut self.grounds[at];
        for (list, place) in [(&mut floor.starts, start), (&mut floor.goals, goal)] {
            if !list.contains(&place) {
                list.push(place);
            }
        }
        levels.push(level);
        at
    }

    /// Draws them all.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn write(self, game: &dyn Game) -> Result<(), CliError> {
        let floors = self.grounds.into_iter().map(Ground::named).collect();
        let chart = TrailChart { title: format!("Paths of players in {}", game.name()), floors };
        self.file.write(&chart.draw())?;
        tell!("plot: {}", self.file.path().display());
        Ok(())
    }
}

impl Ground {
    fn named(self) -> Floor {
        let first = self.levels.iter().min().copied().unwrap_or_default();
        let last = self.levels.iter().max().copied().unwrap_or_default();
        let range = if first == last { first.to_string() } else { format!("{first}..{last}") };
        Floor { name: format!("{}:{range}", self.mode), ..self.floor }
    }
}
