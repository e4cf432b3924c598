//! Subjects, ready to be played.

use std::collections::BTreeSet;

use super::{
    error::ScoreError,
    plan::{ScorePlan, TestedGame},
    subject::{Subject, SubjectKind},
};
use crate::{
    bugs::{DefectKind, Mutant, PlantedPart, defect_kinds},
    game::Game,
    split::LevelSplit,
};

/// A subject, and its levels and rules.
pub(super) struct Case {
    pub subject: Subject,
    /// Index of the game in the plan.
    pub game: usize,
    pub mode: String,
    pub level: u64,
    /// Name of the unmutated level. Seeds are derived from it.
    pub name: String,
    /// The defect in the rules and its variant, if there is one.
    rules: Option<(DefectKind, u32)>,
}

impl Case {
    /// Returns the game that is played.
    pub fn mutant<'a>(&self, game: &'a dyn Game) -> Mutant<&'a dyn Game> {
        match &self.rules {
            Some((kind, variant)) => Mutant::new(game, kind, *variant),
            None => Mutant::sound(game),
        }
    }

    fn sound(game: usize, name: &str, kind: SubjectKind, mode: &str, level: u64) -> Self {
        let id = Subject::id_of_level(name, mode, level);
        Self {
            subject: Subject { id, game: name.to_owned(), kind },
            game,
            mode: mode.to_owned(),
            level,
            name: format!("{mode}:{level}"),
            rules: None,
        }
    }
}

/// Returns all subjects of the plan's games: for each game the mutants, the levels that they were made of, and the
/// unmutated levels.
///
/// # Errors
///
/// A level cannot be played, or a defect is unknown.
pub(super) fn cases(plan: &ScorePlan) -> Result<Vec<Case>, ScoreError> {
    let mut cases = Vec::new();
    for (index, tested) in plan.games.iter().enumerate() {
        let own = cases_of(plan, index, tested)?;
        for case in &own {
            let split = LevelSplit { mode: case.mode.clone(), first: case.level, last: case.level };
            let subject = || case.subject.id.clone();
            split.check(tested.game).map_err(|source| ScoreError::Level { subject: subject(), source })?;
        }
        cases.extend(own);
    }
    Ok(cases)
}

fn cases_of(plan: &ScorePlan, index: usize, tested: &TestedGame) -> Result<Vec<Case>, ScoreError> {
    let (name, kinds) = (tested.game.name(), defect_kinds(tested.game));
    let sound_levels = plan.set.sound.iter().filter(|sound| sound.game == name);
    let sound_levels =
        sound_levels.flat_map(|sound| sound.range.levels().map(|level| (sound.range.mode.clone(), level)));
    let sound_levels: BTreeSet<(String, u64)> = sound_levels.collect();
    let (mut cases, mut originals) = (Vec::new(), BTreeSet::new());
    for bug in plan.set.mutants.iter().filter(|bug| bug.game == name) {
        let rules = match bug.planted {
            PlantedPart::Level(_) => None,
            PlantedPart::Rules { variant } => {
                let kind = kinds.iter().find(|kind| kind.class == bug.class);
                let unknown = || ScoreError::Unknown { subject: bug.id.clone(), class: bug.class.clone() };
                Some((kind.ok_or_else(unknown)?.clone(), variant))
            }
        };
        let original = (bug.mode.clone(), bug.level);
        let id = Subject::id_of_level(name, &bug.mode, bug.level);
        let kind = SubjectKind::Mutant { class: bug.class.clone(), original: id };
        let (mode, level) = bug.played(plan.folder);
        let subject = Subject { id: bug.id.clone(), game: name.to_owned(), kind };
        cases.push(Case { subject, game: index, mode, level, name: bug.base(), rules });
        if !sound_levels.contains(&original) {
            originals.insert(original);
        }
    }
    let of =
        |kind: SubjectKind| move |(mode, level): &(String, u64)| Case::sound(index, name, kind.clone(), mode, *level);
    cases.extend(originals.iter().map(of(SubjectKind::Original)));
    cases.extend(sound_levels.iter().map(of(SubjectKind::Sound)));
    Ok(cases)
}
