//! Scores of testers, sets of planted defects, and results of studies.

use std::{collections::BTreeMap, fs, path::Path};

use bevy_playbot::level::LevelFile;
use playbot_games::coinrun::CoinRun;
use playbot_harness::sealed_file::{read_sealed, write_sealed};
use playbot_mutation::{
    bugs::{BugGame, BugSet, PlantedBug, PlantedPart, UnmutatedLevels},
    score::{
        ClockKind, ContestantRecord, Found, GameRecord, JobFinding, JobResult, SCORE_FORMAT, Score, ScoreBudget,
        ScoreJournal, ScoreRecord, ScoreTable, ScoredJob, SetRecord, Subject, SubjectKind, judge,
    },
};
use playbot_test::verdict::Earlier;
use playbot_train::{
    Algorithm,
    study::{StudyResult, TestResult, TrainingResult},
};

use crate::hostile::{
    form::Form,
    kind::{FileKind, Read, words},
};

const SCORE: &str = "score.json";
const COMMAND: &str = "playbot bugs score set --out score.json";
const RESULT: &str = "result.json";

/// Returns all kinds of files of scores and studies.
pub(super) fn scored(folder: &Path) -> Vec<FileKind> {
    let own = |name: &str| {
        let own = folder.join(name);
        fs::create_dir_all(&own).expect("writable");
        own
    };
    let (done, begun, planted, study) = (own("done"), own("begun"), own("planted"), own("study"));
    score().write(&done.join(SCORE)).expect("writable");
    let (mut journal, _) = journal(&begun, Earlier::Keep).expect("fresh");
    results().into_iter().for_each(|result| journal.push(result).expect("writable"));
    drop(journal);
    bugs().write(&planted, &[("coinrun-wall-01".to_owned(), "{}".to_owned())], false).expect("writable");
    write_sealed(&study.join(RESULT), &study_result()).expect("writable");
    vec![
        FileKind::new(SCORE, Form::Object, &done, SCORE, read_score).handled(handle_score),
        FileKind::new("score.json.jobs", Form::Lines, &begun, "score.json.jobs", read_journal)
            .growing()
            .handled(handle_journal),
        FileKind::new("mutants.json", Form::Text, &planted, "mutants.json", read_bugs).handled(handle_bugs),
        FileKind::new("result.json of a study", Form::Object, &study, RESULT, read_study),
    ]
}

fn subjects() -> Vec<Subject> {
    let mutant = SubjectKind::Mutant { class: "wall".to_owned(), original: "coinrun hard:3".to_owned() };
    [("coinrun hard:2", SubjectKind::Sound), ("coinrun hard:3", SubjectKind::Original), ("coinrun-wall-01", mutant)]
        .map(|(id, kind)| Subject { id: id.to_owned(), game: "coinrun".to_owned(), kind })
        .to_vec()
}

/// Returns the results of two testers on each, in the order of their names.
fn results() -> Vec<JobResult> {
    let result = |subject: &Subject, tester: &str| JobResult {
        subject: subject.id.clone(),
        tester: tester.to_owned(),
        solved: 2,
        episodes: 5,
        ends: vec!["won 83".to_owned(), "lost 12".to_owned()],
        reward: Some(4.0),
        findings: vec![JobFinding { detector: "stuck".to_owned(), tick: Some(7), message: "still".to_owned() }],
        seconds: 1.5,
        found_after: Some(0.5),
        ..JobResult::default()
    };
    subjects().iter().flat_map(|subject| ["chaos", "random"].map(|tester| result(subject, tester))).collect()
}

fn record() -> ScoreRecord {
    let game = GameRecord {
        name: "coinrun".to_owned(),
        version: 1,
        testers: ["chaos", "random"].map(ContestantRecord::bot).to_vec(),
        detectors: vec!["stuck ticks=9".to_owned()],
        own_detectors: Vec::new(),
    };
    ScoreRecord {
        format: SCORE_FORMAT,
        set: SetRecord { seed: 7, hash: "0f".to_owned() },
        games: vec![game],
        budget: ScoreBudget::default(),
        clock: ClockKind::Wall,
    }
}

fn score() -> Score {
    let found = Found { detected: true, ..Found::default() };
    let jobs = results().into_iter().map(|result| ScoredJob { result, found, first: Some(0.5) }).collect();
    Score { record: record(), command: COMMAND.to_owned(), subjects: subjects(), jobs }
}

fn journal(folder: &Path, earlier: Earlier) -> Result<(ScoreJournal, u64), String> {
    ScoreJournal::open(&folder.join(SCORE), COMMAND, &record(), earlier).map_err(words)
}

fn read_score(folder: &Path) -> Read {
    Score::read(&folder.join(SCORE)).map(|score| vec![format!("{score:?}")]).map_err(words)
}

fn handle_score(folder: &Path) {
    if let Ok(score) = Score::read(&folder.join(SCORE)) {
        // A join with itself alone may fail.
        let _ = ScoreTable::join(&[(SCORE.into(), score)]).map(|table| format!("{table:?}"));
    }
}

fn read_journal(folder: &Path) -> Read {
    let (journal, cut) = journal(folder, Earlier::Resume)?;
    if cut > 0 {
        return Err(format!("the last {cut} bytes are no whole jobs"));
    }
    Ok(journal.finished().values().map(|result| format!("{result:?}")).collect())
}

fn handle_journal(folder: &Path) {
    if let Ok((journal, _)) = journal(folder, Earlier::Resume) {
        drop(judge(&subjects(), journal.finished().values().cloned().collect()));
    }
}

fn bugs() -> BugSet {
    let bug = |id: &str, planted| PlantedBug {
        id: id.to_owned(),
        game: "coinrun".to_owned(),
        class: "wall".to_owned(),
        about: "a wall in the way".to_owned(),
        mode: "hard".to_owned(),
        level: 3,
        planted,
    };
    let level = LevelFile { path: "levels/coinrun-wall-01.json".to_owned(), hash: 9 };
    BugSet {
        seed: 7,
        games: vec![BugGame { name: "coinrun".to_owned(), version: 1 }],
        mutants: vec![
            bug("coinrun-wall-01", PlantedPart::Level(level)),
            bug("coinrun-rule-01", PlantedPart::Rules { variant: 0 }),
        ],
        sound: vec![UnmutatedLevels { game: "coinrun".to_owned(), range: "hard:0..3".parse().expect("levels") }],
    }
}

fn read_bugs(folder: &Path) -> Read {
    BugSet::read(folder).map(|set| vec![format!("{set:?}")]).map_err(words)
}

fn handle_bugs(folder: &Path) {
    if let Ok(set) = BugSet::read(folder) {
        // Its level is no level.
        let _ = set.check(folder, &CoinRun::default());
        let played: BTreeMap<String, u64> = set.mutants.iter().map(|bug| bug.played(folder)).collect();
        drop(played);
    }
}

fn study_result() -> StudyResult {
    StudyResult {
        variant: "full".to_owned(),
        algorithm: Algorithm::ScorePpo,
        seed: 3,
        training: Some(TrainingResult {
            steps: 128,
            steps_to_threshold: Some(64),
            success: Some(0.75),
            episodic_return: None,
        }),
        left_out: vec![66, 70],
        with_seen: None,
        test: TestResult {
            layouts: Some(5),
            seen: 3,
            episodes: 8,
            success: 0.5,
            success_se: 0.125,
            return_mean: 0.25,
            return_se: 0.0625,
            length_mean: 12.5,
            level_returns: vec![0.0, 0.5],
        },
    }
}

fn read_study(folder: &Path) -> Read {
    let (result, had_seal): (StudyResult, bool) = read_sealed(&folder.join(RESULT)).map_err(words)?;
    Ok(vec![format!("{result:?} {had_seal}")])
}
