//! The table that joins several scores.

#[cfg(test)]
mod tests;

use crate::score::{
    Score,
    contestant::ClockKind,
    error::ScoreError,
    found::ScoredJob,
    mix::{Catch, Limits, best_mix},
    record::{ScoreBudget, SetRecord, Subject, SubjectKind},
};
use playbot_report::{PlainTable, counted, markdown_cell, markdown_row, statistics::median, whole};
use playbot_test::verdict::wilson;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
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

impl ScoreTable {
    /// Returns the summary, in a few lines.
    pub fn headlines(&self) -> Vec<String> {
        let mix = |row: &TesterRow| {
            let names = if row.testers.is_empty() { "no tester".to_owned() } else { row.testers.join(" + ") };
            let first =
                row.first_seconds.map_or_else(String::new, |s| format!("; median to the first {} s", short_number(s)));
            format!(
                "{names}: recall {}, something found on {} sound levels, {} called unsolvable; {} defects per hour{first}",
                row.recall.describe(),
                row.false_findings.short(),
                row.called_unsolvable,
                row.found_per_hour.map_or_else(|| "–".to_owned(), short_number)
            )
        };
        let mut lines = vec![
            format!(
                "{} in {}, {}",
                counted(self.mutants, "mutant"),
                counted(self.classes.len() as u64, "class"),
                counted(self.sound, "sound level")
            ),
            format!("Best mix: {}", mix(&self.best)),
        ];
        if self.careful.testers != self.best.testers {
            let most = 100.0 * FEW_FALSE;
            lines.push(format!(
                "Best mix with false findings on at most {most} % of sound levels: {}",
                mix(&self.careful)
            ));
        }
        lines.push(format!("All testers: {}", mix(&self.all)));
        lines.push(format!(
            "Found by testers with learned skills alone: {} of all defects, {} of those that are found",
            self.only_skills.describe(),
            self.only_skills_of_found.describe()
        ));
        lines
    }

    /// Returns the meanings of the columns, a line each.
    pub fn meanings() -> Vec<String> {
        vec![
            "best mix: the fewest testers that together find most".to_owned(),
            format!(
                "careful mix: the same, with something found on at most {} % of the sound levels and none called unsolvable",
                100.0 * FEW_FALSE
            ),
            "without games' own detectors: found by detectors of all games, by a proof, or by failing".to_owned(),
            "beside a sound build: found as before, or by a difference from the sound level or game, with the best mix"
                .to_owned(),
            "of the path, of the episode: the share that is left of the actions up to the finding, and of its episode"
                .to_owned(),
            "skills alone: found by testers with learned skills and by no other".to_owned(),
        ]
    }

    /// Returns the table of classes.
    pub fn class_table(&self) -> PlainTable {
        let names = self.testers.iter().map(|tester| tester.testers.join(" + "));
        let last = ["best mix", "precision", "careful mix", "beside a sound build", "skills alone"];
        let columns = ["class", "mutants"].map(str::to_owned).into_iter().chain(names).chain(last.map(str::to_owned));
        let rows = self.classes.iter().map(|class| {
            let all = class.testers.iter();
            let last = [&class.best, &class.precision, &class.careful, &class.beside, &class.only_skills];
            let first = [class.class.clone(), class.best.of.to_string()];
            first.into_iter().chain(all.chain(last).map(Share::short)).collect::<Vec<String>>()
        });
        PlainTable { caption: "defects found, by class".to_owned(), columns: columns.collect(), rows: rows.collect() }
    }

    /// Returns the table of testers and mixes.
    pub fn tester_table(&self) -> PlainTable {
        let columns = [
            "tester",
            "recall",
            "without games' own detectors",
            "beside a sound build",
            "precision",
            "false findings",
            "called unsolvable",
            "defects per hour",
            "seconds to the first",
            "minimised actions",
            "of the path",
            "of the episode",
        ];
        let number = |number: Option<f64>| number.map_or_else(|| "–".to_owned(), short_number);
        let percent =
            |share: Option<f64>| share.map_or_else(|| "–".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        let row = |name: String, row: &TesterRow| {
            vec![
                name,
                row.recall.describe(),
                row.without_own.short(),
                row.beside.short(),
                row.precision.describe(),
                row.false_findings.describe(),
                row.called_unsolvable.to_string(),
                number(row.found_per_hour),
                number(row.first_seconds),
                number(row.minimised),
                percent(row.minimised_share),
                percent(row.episode_share),
            ]
        };
        let testers = self.testers.iter().map(|tester| row(tester.testers.join(" + "), tester));
        let mixes = [("best mix", &self.best), ("careful mix", &self.careful), ("all testers", &self.all)];
        let mixes = mixes.into_iter().map(|(name, mix)| row(name.to_owned(), mix));
        PlainTable {
            caption: "testers".to_owned(),
            columns: columns.map(str::to_owned).to_vec(),
            rows: testers.chain(mixes).collect(),
        }
    }
}

// All scores side by side: mutants, unmutated levels and testers, each by its index.

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

// The numbers of a tester, or of several together.

/// Recall, precision and costs of a tester, or of several together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TesterRow {
    /// Names of the testers.
    pub testers: Vec<String>,
    /// The games that they test.
    pub games: Vec<String>,
    /// True if all of them act with learned skills.
    pub skilled: bool,
    /// Share of the mutants that they test and find; for several testers, of all mutants.
    pub recall: Share,
    /// The same with a comparison with the unmutated game.
    pub beside: Share,
    /// Recall without the detectors that games add.
    pub without_own: Share,
    /// Share of true findings among all in mutants and on unmutated levels.
    pub precision: Share,
    /// Unmutated levels with a finding.
    pub false_findings: Share,
    /// Unmutated levels that are called unsolvable.
    pub called_unsolvable: u64,
    /// Seconds on the mutants.
    pub seconds: f64,
    /// Distinct defects that are found in an hour.
    pub found_per_hour: Option<f64>,
    /// Median of the seconds until a defect is first found, among those that are found.
    pub first_seconds: Option<f64>,
    /// Median length of the minimised replays, in actions with an effect.
    pub minimised: Option<f64>,
    /// Median of their share of the actions up to the finding.
    pub minimised_share: Option<f64>,
    /// Median of their share of the actions of the whole episode.
    pub episode_share: Option<f64>,
    /// Number of minimised replays.
    pub replays: u64,
}

/// Seconds of an hour.
const HOUR: f64 = 3600.0;

/// Returns the row of these testers, by their indices. A defect counts as found when the fastest of them finds it.
pub(super) fn tester_row(rows: &Rows, testers: &[usize]) -> TesterRow {
    let catch = Catch::of(&rows.catches, testers);
    // A single tester is not judged by mutants that it does not test.
    let is_tested = |mutant: &usize| match testers {
        [tester] => rows.played[*tester].contains_key(mutant),
        _ => true,
    };
    let mutants: Vec<usize> = (0..rows.mutants.len()).filter(is_tested).collect();
    let is_tested = |level: &usize| testers.iter().any(|&tester| rows.played_sound[tester].contains_key(level));
    let sound: Vec<usize> = (0..rows.sound.len()).filter(is_tested).collect();
    let found: Vec<usize> = mutants.iter().copied().filter(|&mutant| catch.found[mutant]).collect();
    let jobs = |mutant: usize| testers.iter().filter_map(move |&tester| rows.played[tester].get(&mutant));
    let wrong = Share::of(sound.iter().map(|&level| catch.false_findings[level]));
    let seconds: f64 = mutants.iter().flat_map(|&mutant| jobs(mutant)).map(|job| job.result.seconds).sum();
    let first = |&mutant: &usize| jobs(mutant).filter_map(|job| job.first).min_by(f64::total_cmp);
    let shortest = |&mutant: &usize| {
        let lengths = |job: &&ScoredJob| Some([job.result.minimised?, job.result.original?, job.result.played?]);
        jobs(mutant).filter_map(lengths).min().map(|lengths| lengths.map(f64::from))
    };
    let replays: Vec<[f64; 3]> = found.iter().filter_map(shortest).collect();
    let share_of = |whole: usize| {
        let shares = replays.iter().filter(|lengths| lengths[whole] > 0.0).map(|lengths| lengths[0] / lengths[whole]);
        median(shares.collect())
    };
    let own = || testers.iter().map(move |&tester| &rows.testers[tester]);
    let games: BTreeSet<&String> = own().flat_map(|tester| &tester.games).collect();
    let count = found.len() as u64;
    TesterRow {
        testers: own().map(|tester| tester.name.clone()).collect(),
        games: games.into_iter().cloned().collect(),
        skilled: !testers.is_empty() && own().all(|tester| tester.skilled),
        recall: Share::new(count, mutants.len() as u64),
        beside: Share::of(mutants.iter().map(|&mutant| testers.iter().any(|&tester| rows.beside(tester, mutant)))),
        without_own: Share::of(
            mutants.iter().map(|&mutant| testers.iter().any(|&tester| rows.without_own(tester, mutant))),
        ),
        precision: Share::new(count, count + wrong.count),
        false_findings: wrong,
        called_unsolvable: sound.iter().filter(|&&level| catch.unsolvable[level]).count() as u64,
        seconds,
        found_per_hour: (seconds > 0.0).then(|| count as f64 * HOUR / seconds),
        first_seconds: median(found.iter().filter_map(first).collect()),
        minimised: median(replays.iter().map(|lengths| lengths[0]).collect()),
        minimised_share: share_of(1),
        episode_share: share_of(2),
        replays: replays.len() as u64,
    }
}

// The Markdown page of a score.

impl ScoreTable {
    /// Returns the page: headline numbers, classes, testers, and the method.
    pub fn to_markdown(&self) -> String {
        let mut lines = vec!["# Planted defects".to_owned(), String::new()];
        lines.extend(self.headlines().iter().map(|line| format!("- {}", markdown_cell(line))));
        for table in [self.class_table(), self.tester_table()] {
            lines.extend([String::new(), format!("## {}", heading(&table.caption)), String::new()]);
            lines.extend(markdown_rows(&table));
        }
        lines.extend([String::new(), "## How it is measured".to_owned(), String::new()]);
        lines.extend(self.notes().iter().map(|note| format!("- {note}")));
        if self.commands.iter().any(|command| !command.is_empty()) {
            lines.extend([String::new(), "```sh".to_owned()]);
            lines.extend(self.commands.iter().filter(|command| !command.is_empty()).cloned());
            lines.push("```".to_owned());
        }
        lines.push(String::new());
        lines.join("\n")
    }

    fn notes(&self) -> Vec<String> {
        let ScoreBudget { episodes, steps, routes, replays, seed } = self.budget;
        let sets: Vec<String> = self.sets.iter().map(|set| format!("{} (seed {})", set.hash, set.seed)).collect();
        let skilled: Vec<&str> =
            self.testers.iter().filter(|row| row.skilled).flat_map(|row| &row.testers).map(String::as_str).collect();
        let skilled = if skilled.is_empty() { "none".to_owned() } else { markdown_cell(&skilled.join(", ")) };
        vec![
            format!("Games and versions: {}. Sets: {}.", markdown_cell(&self.games.join(", ")), sets.join(", ")),
            format!(
                "A sound level has no planted defect. Each tester has the same budget on each mutant and sound level. \
                 Testers that play have {}, and explorers {steps} steps and {routes} replayed paths. Seed: {seed}.",
                counted(u64::from(episodes), "episode")
            ),
            "A mutant is found if a detector reports something, the game breaks, or the level is proved to be \
             unsolvable. The failure of a tester counts if it solves at least 99 % of the sound levels of the game. A tester \
             that solves fewer may collect similar rewards on all of them. It fails by a reward outside of all those and \
             more than four standard deviations from their mean. On a sound level the same, compared with the others, is a false \
             finding."
                .to_owned(),
            "Beside a sound build, a difference from the same tester's episodes on the sound level counts too. Without \
             random numbers any difference counts. Otherwise Fisher's exact test decides, with at most one in twenty \
             false over all mutants (Benjamini and Hochberg)."
                .to_owned(),
            "Precision is the share of mutants among all findings in mutants and on sound levels. Intervals are 95 % \
             Wilson intervals."
                .to_owned(),
            "Some games bring detectors that know their rules. The column without them counts findings of the detectors \
             of all games, proofs and failures."
                .to_owned(),
            "Findings are minimised. The table counts actions with an effect. Their shares are of the path up to the tick of \
             the finding, and of the whole episode in which it was found."
                .to_owned(),
            format!("Testers with learned skills: {skilled}."),
            format!(
                "Seconds are {}, for mutants, without minimisation, which takes up to {replays} replays each.",
                self.clock.describe()
            ),
        ]
    }
}

fn markdown_rows(table: &PlainTable) -> Vec<String> {
    let rule = table.columns.iter().enumerate().map(|(index, _)| if index == 0 { "---" } else { "---:" });
    let rule = format!("|{}|", rule.collect::<Vec<_>>().join("|"));
    [markdown_row(&table.columns), rule].into_iter().chain(table.rows.iter().map(|row| markdown_row(row))).collect()
}

/// Returns the text with a capital.
fn heading(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

// Shares and numbers of a table.

/// A count of a total, with the 95 % Wilson interval of the share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The count.
    pub count: u64,
    /// The total.
    pub of: u64,
    /// Lower and upper bound of the share.
    pub interval: [f64; 2],
}

impl Share {
    /// Creates the share of a count of a total.
    pub fn new(count: u64, of: u64) -> Self {
        Self { count, of, interval: wilson(count, of) }
    }

    /// Counts the true values.
    pub fn of(list: impl IntoIterator<Item = bool>) -> Self {
        let (mut count, mut of) = (0, 0);
        for is in list {
            of += 1;
            count += u64::from(is);
        }
        Self::new(count, of)
    }

    /// Returns the share; `None` if the total is 0.
    pub fn share(&self) -> Option<f64> {
        (self.of > 0).then(|| self.count as f64 / self.of as f64)
    }

    /// Returns the share, the counts and the interval in words.
    pub fn describe(&self) -> String {
        let Some(share) = self.share() else { return "–".to_owned() };
        let [low, high] = self.interval.map(|end| 100.0 * end);
        format!("{:.1} % ({} of {}; {low:.1} to {high:.1})", 100.0 * share, self.count, self.of)
    }

    /// Returns the counts in words.
    pub fn short(&self) -> String {
        if self.of == 0 { "–".to_owned() } else { format!("{} of {}", self.count, self.of) }
    }
}

/// Formats a number with two or three significant digits.
pub(super) fn short_number(value: f64) -> String {
    let size = value.abs();
    let decimals = match size {
        _ if size >= 100.0 || size == 0.0 || !size.is_finite() => return whole(value),
        _ if size >= 10.0 => 1,
        _ if size >= 1.0 => 2,
        _ if size < 0.001 => return "under 0.001".to_owned(),
        // Two digits behind the zeros.
        _ => (1.0 - libm::log10(size).floor()) as usize,
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod numbers_tests {
    use super::*;

    #[test]
    fn shares_have_their_intervals() {
        let share = Share::of([true, false, true, true, true, true, true, true, false, true]);
        assert_eq!((share.count, share.of, share.share()), (8, 10, Some(0.8)));
        assert_eq!(share.describe(), "80.0 % (8 of 10; 49.0 to 94.3)");
        let nothing = Share::of([]);
        assert_eq!((nothing.share(), nothing.describe().as_str(), nothing.short().as_str()), (None, "–", "–"));
    }

    #[test]
    fn numbers_have_two_or_three_digits() {
        let reported = [2160.0, 12.345, 1.234, 0.1234, 0.005_526, 0.000_02, 0.0].map(short_number);
        assert_eq!(reported, ["2,160", "12.3", "1.23", "0.12", "0.0055", "under 0.001", "0"]);
    }
}
