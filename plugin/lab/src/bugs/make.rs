//! The planting of defects into the games of a program.

use std::collections::BTreeSet;

use bevy_playbot::level_files::LevelFile;
use playbot_learner::{Streams, rng::below};

use super::{
    effect::{Bases, MOST_TRIED, bases_with_effect, stream},
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

/// Unmutated levels that defects are planted into, for each mutant of a kind; also the least number of them.
const BASES_PER_MUTANT: u64 = 4;
const FEWEST_BASES: u64 = 24;

/// A game that defects are planted into.
#[derive(Clone)]
pub struct Source<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its levels.
    pub levels: LevelSplit,
    /// Levels that are left out, since bots train on them.
    pub trained: Option<LevelSplit>,
}

/// The number of defects, and the random seed.
#[derive(Clone, Copy, Debug)]
pub struct MakePlan {
    /// Random seed of everything.
    pub seed: u64,
    /// Mutants of each kind and game.
    pub per_kind: u32,
    /// Unmutated levels of all games together.
    pub sound: u64,
    /// Threads. They change no result.
    pub threads: usize,
}

/// The result of planting.
#[derive(Clone, Debug)]
pub struct Made {
    /// The set.
    pub set: BugSet,
    /// Texts of the levels that a defect was planted into, by the names of their mutants.
    pub levels: Vec<(String, String)>,
    /// Kinds of defects that no level, or not enough levels, have a place for, and those without an effect.
    pub without_place: Vec<NoPlace>,
}

/// A kind of defect that not enough levels have a place for, or with a variant that changes nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoPlace {
    /// The game.
    pub game: String,
    /// The class of the defect.
    pub class: String,
    /// How many were planted.
    pub planted: u32,
    /// How many were asked for.
    pub wanted: u32,
    /// Variants, of a defect of rules, that change nothing on any level that was tried.
    pub without_effect: BTreeSet<u32>,
}

impl NoPlace {
    /// Returns a message that says how many are missing, and why.
    pub fn describe(&self) -> String {
        let Self { game, class, planted, wanted, without_effect } = self;
        let start = format!("{game}: only {planted} of {wanted} mutants with the defect {class} were made");
        if without_effect.is_empty() {
            return format!("{start}: no other level has a place for it");
        }
        let variants: Vec<String> = without_effect.iter().map(u32::to_string).collect();
        format!("{start}: no bot notices its variant {} on any of {MOST_TRIED} levels", variants.join(", "))
    }
}

impl MakePlan {
    /// Returns the steps for a progress bar: unmutated levels to find, and mutants to find a level for, in all of these
    /// games.
    pub fn steps(&self, sources: &[Source]) -> u64 {
        let rules = |source: &Source| {
            let kinds = source.game.tools().tests.defects();
            kinds.iter().filter(|kind| matches!(kind.plant, Plant::Rules { .. })).count() as u64
        };
        let mutants: u64 = sources.iter().map(|source| rules(source) * u64::from(self.per_kind)).sum();
        self.sound + sources.len() as u64 * self.bases() + mutants
    }

    fn bases(&self) -> u64 {
        (BASES_PER_MUTANT * u64::from(self.per_kind)).max(FEWEST_BASES)
    }

    /// Returns the number of unmutated levels of the n-th game.
    fn share(&self, n: usize, games: usize) -> u64 {
        let (games, n) = (games.max(1) as u64, n as u64);
        self.sound / games + u64::from(n < self.sound % games)
    }
}

/// Plants every kind of defect into every game. The same seed gives the same set, for any number of threads. Each
/// mutant depends on the seed, its game, class and number alone.
///
/// A defect of a game's own rules is planted on a level where it changes some bot's episode: that of the demonstrator,
/// of a bot that holds an action, of chaos or of random actions. `progress` receives how many more unmutated levels
/// were found, and how many of those mutants have their level.
///
/// # Errors
///
/// A game has too few levels that its demonstrator solves, panics in one, or cannot print them.
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
        let noticed = bases_with_effect(game, (mode, bases), &game.tools().tests.defects(), plan, progress);
        for kind in defect_kinds(game) {
            plant(&mut made, game, (mode, bases), &kind, &noticed, plan)?;
        }
    }
    Ok(made)
}

/// Returns the number of the first level to try.
fn start(source: &Source, plan: &MakePlan, wanted: u64) -> u64 {
    let LevelSplit { first, last, .. } = source.levels;
    let mut rng = Streams::new(plan.seed).stream(&format!("{}/levels", source.game.name()), 0);
    // Some of the levels that follow are not solved.
    first + below(&mut rng, (last - first + 1).saturating_sub(4 * wanted))
}

/// Plants all mutants of a kind. Mutants of rules in `noticed` have their levels already.
fn plant(
    made: &mut Made,
    game: &dyn Game,
    (mode, bases): (&str, &[u64]),
    kind: &DefectKind,
    noticed: &Bases,
    plan: &MakePlan,
) -> Result<(), BugError> {
    let (mut taken, mut without_effect) = (BTreeSet::new(), BTreeSet::new());
    let mut planted = 0;
    for number in 0..plan.per_kind {
        let id = format!("{}-{}-{planted:02}", game.name(), kind.class);
        let mut rng = stream(plan.seed, game, kind, number);
        let (level, part) = match &kind.plant {
            Plant::Rules { variants, .. } => {
                let variant = number % (*variants).max(1);
                let base = match noticed.get(&(kind.class, number)) {
                    Some(Some(base)) => *base,
                    Some(None) => {
                        without_effect.insert(variant);
                        continue;
                    }
                    None => bases[below(&mut rng, bases.len() as u64) as usize],
                };
                (base, PlantedPart::Rules { variant })
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
        made.without_place.push(NoPlace { game, class, planted, wanted: plan.per_kind, without_effect });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
