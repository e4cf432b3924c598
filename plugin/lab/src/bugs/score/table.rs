//! The table that joins several scores.

use std::{collections::BTreeMap, path::PathBuf};

use serde::Serialize;

use super::{
    clock::ClockKind,
    error::ScoreError,
    file::Score,
    mix::{Catch, Limits, best_mix},
    numbers::Share,
    record::{ScoreBudget, SetRecord},
    rows::{Rows, rows},
    subject::SubjectKind,
    tester_row::{TesterRow, tester_row},
};

/// Largest share of the unmutated levels with a finding, for the best mix with few false findings.
pub const FEW_FALSE: f64 = 0.01;

/// Recall, precision and costs of testers, by class and tester.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoreTable {
    /// The sets, each once.
    pub sets: Vec<SetRecord>,
    /// The games with their versions.
    pub games: Vec<String>,
    /// The budget of each tester.
    pub budget: ScoreBudget,
    /// The clock.
    pub clock: ClockKind,
    /// The commands that made the scores.
    pub commands: Vec<String>,
    /// Number of mutants.
    pub mutants: u64,
    /// Number of unmutated levels.
    pub sound: u64,
    /// Each tester by itself.
    pub testers: Vec<TesterRow>,
    /// The smallest mix that finds most.
    pub best: TesterRow,
    /// The smallest mix that finds most with findings on at most [`FEW_FALSE`] of the unmutated levels and no such
    /// level called unsolvable.
    pub careful: TesterRow,
    /// All testers together.
    pub all: TesterRow,
    /// Each class of defects.
    pub classes: Vec<ClassRow>,
    /// Defects that testers with learned skills find and other testers do not.
    pub only_skills: Share,
    /// The same share among the defects that are found at all.
    pub only_skills_of_found: Share,
}

/// The recall of a class of defects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassRow {
    /// The class.
    pub class: String,
    /// By each tester, in the order of the table. The total is 0 if a tester does not test the games that have the
    /// class.
    pub testers: Vec<Share>,
    /// By the best mix.
    pub best: Share,
    /// Share of true findings among those of the best mix, in this class and on unmutated levels of the same games.
    pub precision: Share,
    /// By the careful mix.
    pub careful: Share,
    /// By the best mix, with a comparison with the unmutated game.
    pub beside: Share,
    /// By testers with learned skills alone.
    pub only_skills: Share,
}

impl ScoreTable {
    /// Joins scores of different games or sets, each with the name of its file.
    ///
    /// # Errors
    ///
    /// There is no score, two scores have a subject in common, or they were made with different settings.
    pub fn join(scores: &[(PathBuf, Score)]) -> Result<Self, ScoreError> {
        let (first, others) = scores.split_first().ok_or(ScoreError::Nothing)?;
        for (path, score) in others {
            let differences = first.1.record.differences_of_way(&score.record);
            if !differences.is_empty() {
                return Err(ScoreError::Unlike { first: first.0.clone(), second: path.clone(), differences });
            }
        }
        check_different(scores)?;
        let mut sets: Vec<SetRecord> = Vec::new();
        let mut games = Vec::new();
        for (_, score) in scores {
            if !sets.contains(&score.record.set) {
                sets.push(score.record.set.clone());
            }
            games.extend(score.record.games.iter().map(|game| format!("{} {}", game.name, game.version)));
        }
        let rows = rows(scores);
        let best = best_mix(&rows.catches, None);
        let careful = best_mix(&rows.catches, Some(Limits { false_share: FEW_FALSE }));
        let all: Vec<usize> = (0..rows.testers.len()).collect();
        let only_skills = only_skills(&rows);
        let found = Catch::of(&rows.catches, &all).found;
        Ok(Self {
            sets,
            games,
            budget: first.1.record.budget,
            clock: first.1.record.clock,
            commands: scores.iter().map(|(_, score)| score.command.clone()).collect(),
            mutants: rows.mutants.len() as u64,
            sound: rows.sound.len() as u64,
            testers: all.iter().map(|&tester| tester_row(&rows, &[tester])).collect(),
            best: tester_row(&rows, &best),
            careful: tester_row(&rows, &careful),
            all: tester_row(&rows, &all),
            classes: classes(&rows, &best, &careful, &only_skills),
            only_skills: Share::of(only_skills.iter().copied()),
            only_skills_of_found: Share::of(
                only_skills.iter().zip(&found).filter(|(_, is_found)| **is_found).map(|(is, _)| *is),
            ),
        })
    }
}

/// Checks that no subject is scored twice.
fn check_different(scores: &[(PathBuf, Score)]) -> Result<(), ScoreError> {
    let mut known: BTreeMap<&str, &PathBuf> = BTreeMap::new();
    for (path, score) in scores {
        let counted = score.subjects.iter().filter(|subject| subject.kind != SubjectKind::Original);
        for subject in counted {
            if let Some(first) = known.insert(&subject.id, path) {
                let (first, second, what) = (first.clone(), path.clone(), format!("`{}`", subject.id));
                return Err(ScoreError::Twice { first, second, what });
            }
        }
    }
    Ok(())
}

/// Returns for each mutant whether only testers with learned skills found it.
fn only_skills(rows: &Rows) -> Vec<bool> {
    let (skilled, others): (Vec<usize>, Vec<usize>) =
        (0..rows.testers.len()).partition(|tester| rows.testers[*tester].skilled);
    let (with, without) = (Catch::of(&rows.catches, &skilled).found, Catch::of(&rows.catches, &others).found);
    with.into_iter().zip(without).map(|(with, without)| with && !without).collect()
}

fn classes(rows: &Rows, best: &[usize], careful: &[usize], only_skills: &[bool]) -> Vec<ClassRow> {
    let mut classes: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, mutant) in rows.mutants.iter().enumerate() {
        classes.entry(mutant.class.as_str()).or_default().push(index);
    }
    let (by_best, by_careful) = (Catch::of(&rows.catches, best), Catch::of(&rows.catches, careful));
    let row = |(class, mutants): (&str, Vec<usize>)| {
        let tester = |tester: usize| {
            let played = mutants.iter().filter(|&&mutant| rows.played[tester].contains_key(&mutant));
            Share::of(played.map(|&mutant| rows.catches[tester].found[mutant]))
        };
        let found = |catch: &Catch| Share::of(mutants.iter().map(|&mutant| catch.found[mutant]));
        let is_of_class = |game: &String| mutants.iter().any(|&mutant| rows.mutants[mutant].game == *game);
        let wrong =
            rows.sound.iter().zip(&by_best.false_findings).filter(|(level, is)| **is && is_of_class(&level.game));
        let (right, wrong) = (found(&by_best).count, wrong.count() as u64);
        let beside = |&mutant: &usize| best.iter().any(|&tester| rows.beside(tester, mutant));
        ClassRow {
            class: class.to_owned(),
            testers: (0..rows.testers.len()).map(tester).collect(),
            best: found(&by_best),
            precision: Share::new(right, right + wrong),
            careful: found(&by_careful),
            beside: Share::of(mutants.iter().map(beside)),
            only_skills: Share::of(mutants.iter().map(|&mutant| only_skills[mutant])),
        }
    };
    classes.into_iter().map(row).collect()
}

#[cfg(test)]
mod tests;
