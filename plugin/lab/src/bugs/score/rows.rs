//! All scores side by side: mutants, unmutated levels and testers, each by its index.

use std::{collections::BTreeMap, path::PathBuf};

use super::{
    file::Score,
    found::ScoredJob,
    mix::Catch,
    subject::{Subject, SubjectKind},
};

/// A tester of some games.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TesterOfGames {
    pub name: String,
    pub skilled: bool,
    pub games: Vec<String>,
}

/// A mutant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MutantRow {
    pub game: String,
    pub class: String,
}

/// An unmutated level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SoundRow {
    pub game: String,
}

/// All scores.
#[derive(Default)]
pub(super) struct Rows<'a> {
    pub mutants: Vec<MutantRow>,
    pub sound: Vec<SoundRow>,
    pub testers: Vec<TesterOfGames>,
    /// For each tester, its jobs by the index of the mutant.
    pub played: Vec<BTreeMap<usize, &'a ScoredJob>>,
    /// For each tester, its jobs by the index of the unmutated level.
    pub played_sound: Vec<BTreeMap<usize, &'a ScoredJob>>,
    /// For each tester, its findings without a comparison with the unmutated game.
    pub catches: Vec<Catch>,
    /// Names of the detectors that games add, by the game.
    own_detectors: BTreeMap<&'a str, &'a [String]>,
}

impl Rows<'_> {
    /// Returns whether a tester found a mutant by any means.
    pub fn beside(&self, tester: usize, mutant: usize) -> bool {
        self.played[tester].get(&mutant).is_some_and(|job| job.found.at_all())
    }

    /// Returns whether a tester found a mutant without a comparison with the unmutated game, and without its game's own
    /// detectors.
    pub fn without_own(&self, tester: usize, mutant: usize) -> bool {
        let own = self.own_detectors.get(self.mutants[mutant].game.as_str()).copied().unwrap_or_default();
        self.played[tester].get(&mutant).is_some_and(|job| {
            let findings = &job.result.findings;
            let is_of_own = !findings.is_empty() && findings.iter().all(|finding| own.contains(&finding.detector));
            job.found.unsolvable || job.found.failed || job.found.detected && !is_of_own
        })
    }
}

/// Indexes the scores. Testers of the same name are one.
pub(super) fn rows(scores: &[(PathBuf, Score)]) -> Rows<'_> {
    let mut rows = Rows::default();
    for (_, score) in scores {
        add_testers(&mut rows, score);
        rows.own_detectors.extend(score.record.games.iter().map(|game| (game.name.as_str(), &*game.own_detectors)));
        let (mut mutants, mut sound) = (BTreeMap::new(), BTreeMap::new());
        for Subject { id, game, kind } in &score.subjects {
            let game = game.clone();
            match kind {
                SubjectKind::Mutant { class, .. } => {
                    mutants.insert(id.as_str(), rows.mutants.len());
                    rows.mutants.push(MutantRow { game, class: class.clone() });
                }
                SubjectKind::Sound => {
                    sound.insert(id.as_str(), rows.sound.len());
                    rows.sound.push(SoundRow { game });
                }
                SubjectKind::Original => {}
            }
        }
        for job in &score.jobs {
            let name = &job.result.tester;
            let Some(tester) = rows.testers.iter().position(|tester| tester.name == *name) else { continue };
            let subject = job.result.subject.as_str();
            if let Some(mutant) = mutants.get(subject) {
                rows.played[tester].insert(*mutant, job);
            } else if let Some(level) = sound.get(subject) {
                rows.played_sound[tester].insert(*level, job);
            }
        }
    }
    rows.catches = (0..rows.testers.len()).map(|tester| catch(&rows, tester)).collect();
    rows
}

fn add_testers(rows: &mut Rows<'_>, score: &Score) {
    for game in &score.record.games {
        for record in &game.testers {
            let known = rows.testers.iter().position(|tester| tester.name == record.name);
            let index = known.unwrap_or(rows.testers.len());
            if known.is_none() {
                let (name, games) = (record.name.clone(), Vec::new());
                rows.testers.push(TesterOfGames { name, skilled: false, games });
                rows.played.push(BTreeMap::new());
                rows.played_sound.push(BTreeMap::new());
            }
            let tester = &mut rows.testers[index];
            tester.skilled |= record.skilled;
            if !tester.games.contains(&game.name) {
                tester.games.push(game.name.clone());
            }
        }
    }
}

fn catch(rows: &Rows, tester: usize) -> Catch {
    let (played, sound) = (&rows.played[tester], &rows.played_sound[tester]);
    let is = |job: Option<&&ScoredJob>, of: fn(&ScoredJob) -> bool| job.is_some_and(|job| of(job));
    Catch {
        found: (0..rows.mutants.len()).map(|mutant| is(played.get(&mutant), |job| job.found.alone())).collect(),
        false_findings: (0..rows.sound.len()).map(|level| is(sound.get(&level), |job| job.found.alone())).collect(),
        unsolvable: (0..rows.sound.len()).map(|level| is(sound.get(&level), |job| job.found.unsolvable)).collect(),
    }
}
