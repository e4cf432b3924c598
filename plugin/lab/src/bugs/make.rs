//! Planting defects into the games of a program.

use std::collections::BTreeSet;

use bevy_playbot::level_files::LevelFile;
use playbot_learner::{Streams, rng::below};

use super::{
    error::BugError,
    kinds::defect_kinds,
    place::plant_level,
    set::{BugGame, BugSet, PlantedBug, PlantedPart},
    set_text::level_path,
    sound::{ranges, sound_levels},
};
use crate::{
    defect::{DefectKind, Plant},
    game::Game,
    split::LevelSplit,
};

/// Sound levels that a defect is planted into, for each mutant of a kind; and at least so many.
const BASES_PER_MUTANT: u64 = 4;
const FEWEST_BASES: u64 = 24;

/// A game that defects are planted into.
#[derive(Clone)]
pub struct Source<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its levels.
    pub levels: LevelSplit,
    /// Levels that are left out, since bots learn on them.
    pub trained: Option<LevelSplit>,
}

/// How many defects are planted.
#[derive(Clone, Copy, Debug)]
pub struct MakePlan {
    /// Seed of all that is drawn.
    pub seed: u64,
    /// Mutants of each kind and game.
    pub per_kind: u32,
    /// Sound levels of all games together.
    pub sound: u64,
    /// Threads: not part of the result.
    pub threads: usize,
}

/// What was planted.
#[derive(Clone, Debug)]
pub struct Made {
    /// The set.
    pub set: BugSet,
    /// Texts of the levels that a defect was planted into, by the names of their mutants.
    pub levels: Vec<(String, String)>,
    /// Kinds for which not enough levels had a place.
    pub without_place: Vec<NoPlace>,
}

/// A kind of defect for which not enough levels had a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoPlace {
    /// The game.
    pub game: String,
    /// The class of the defect.
    pub class: String,
    /// How many were planted.
    pub planted: u32,
    /// How many were to be.
    pub wanted: u32,
}

impl MakePlan {
    /// Sound levels that are looked for in all of so many games, for a bar.
    pub fn levels(&self, games: usize) -> u64 {
        self.sound + games as u64 * self.bases()
    }

    fn bases(&self) -> u64 {
        (BASES_PER_MUTANT * u64::from(self.per_kind)).max(FEWEST_BASES)
    }

    /// The sound levels of the n-th of so many games.
    fn share(&self, n: usize, games: usize) -> u64 {
        let (games, n) = (games.max(1) as u64, n as u64);
        self.sound / games + u64::from(n < self.sound % games)
    }
}

/// Plants every kind of defect into every game. The same seed gives the same set, whatever the number of threads; each
/// mutant depends on nothing but the seed, its game, class and number. `progress` hears how many more levels were found sound.
///
/// # Errors
///
/// A game has not enough levels that its demonstrator plays to a good end, breaks in one, or cannot show them.
pub fn make_bugs(sources: &[Source], plan: &MakePlan, progress: &(dyn Fn(u64) + Sync)) -> Result<Made, BugError> {
    let set = BugSet { seed: plan.seed, games: Vec::new(), mutants: Vec::new(), sound: Vec::new() };
    let mut made = Made { set, levels: Vec::new(), without_place: Vec::new() };
    for (n, source) in sources.iter().enumerate() {
        let (game, mode) = (source.game, source.levels.mode.as_str());
        game.check_mode(mode)?;
        let share = plan.share(n, sources.len());
        let wanted = share + plan.bases();
        let levels = sound_levels(source, start(source, plan, wanted), wanted, plan.threads, progress)?;
        let (beside, bases) = levels.split_at(usize::try_from(share).unwrap_or(usize::MAX).min(levels.len()));
        made.set.games.push(BugGame { name: game.name().to_owned(), version: game.version() });
        made.set.sound.extend(ranges(game.name(), mode, beside));
        for kind in defect_kinds(game) {
            plant(&mut made, game, (mode, bases), &kind, plan)?;
        }
    }
    Ok(made)
}

/// The number of the first level that is looked at.
fn start(source: &Source, plan: &MakePlan, wanted: u64) -> u64 {
    let LevelSplit { first, last, .. } = source.levels;
    let mut rng = Streams::new(plan.seed).stream(&format!("{}/levels", source.game.name()), 0);
    // Not all of those that follow are sound.
    first + below(&mut rng, (last - first + 1).saturating_sub(4 * wanted))
}

/// Plants all mutants of a kind.
fn plant(
    made: &mut Made,
    game: &dyn Game,
    (mode, bases): (&str, &[u64]),
    kind: &DefectKind,
    plan: &MakePlan,
) -> Result<(), BugError> {
    let mut taken = BTreeSet::new();
    let mut planted = 0;
    for number in 0..plan.per_kind {
        let id = format!("{}-{}-{planted:02}", game.name(), kind.class);
        let mut rng = Streams::new(plan.seed).stream(&format!("{}/{}", game.name(), kind.class), u64::from(number));
        let (level, part) = match &kind.plant {
            Plant::Rules { variants, .. } => {
                let base = bases[below(&mut rng, bases.len() as u64) as usize];
                (base, PlantedPart::Rules { variant: number % (*variants).max(1) })
            }
            Plant::Level(change) => {
                match plant_level(game, kind.class, (mode, bases), &**change, &mut rng, &mut taken)? {
                    None => continue,
                    Some(broken) => {
                        let file = LevelFile { path: level_path(&id), hash: broken.hash };
                        made.levels.push((id.clone(), broken.text));
                        (broken.base, PlantedPart::Level(file))
                    }
                }
            }
        };
        planted += 1;
        made.set.mutants.push(PlantedBug {
            id,
            game: game.name().to_owned(),
            class: kind.class.to_owned(),
            about: kind.about.to_owned(),
            mode: mode.to_owned(),
            level,
            planted: part,
        });
    }
    if planted < plan.per_kind {
        let (game, class) = (game.name().to_owned(), kind.class.to_owned());
        made.without_place.push(NoPlace { game, class, planted, wanted: plan.per_kind });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
