//! Tests of the table that joins several scores.

use crate::score::{
    Found, JobFinding, JobResult, ScoredJob,
    table::*,
    testing::{job, mutant, record, sound},
};

/// Two classes in a garden: `stone` finds a and b, `skill` b and c, both have a finding on one of four unmutated
/// levels.
fn garden() -> (PathBuf, Score) {
    let mut subjects = vec![mutant("garden", "a", "wall"), mutant("garden", "b", "wall"), mutant("garden", "c", "pit")];
    subjects.push(mutant("garden", "d", "pit"));
    subjects.extend((1..5).map(|level| sound("garden", level)));
    let mut jobs = Vec::new();
    for (tester, found) in [("stone", ["a", "b"]), ("skill", ["b", "c"])] {
        jobs.extend(["a", "b", "c", "d"].map(|id| job(id, tester, found.contains(&id))));
        jobs.extend((1..5).map(|level| job(&sound("garden", level).id, tester, level == 2)));
    }
    let record = record("garden", &["stone", "skill"]);
    (
        "garden.json".into(),
        Score { record, command: "playbot bugs score set --out garden.json".to_owned(), subjects, jobs },
    )
}

fn forest() -> (PathBuf, Score) {
    let subjects = vec![mutant("forest", "e", "pit"), sound("forest", 1)];
    let short = |job: ScoredJob| {
        let found = Found { differs: true, ..job.found };
        let result = JobResult { minimised: Some(3), original: Some(12), played: Some(30), ..job.result };
        ScoredJob { result, found, first: Some(0.1) }
    };
    let jobs = vec![short(job("e", "stone", true)), job("forest bed:1", "stone", false)];
    let score = Score { record: record("forest", &["stone"]), command: String::new(), subjects, jobs };
    ("forest.json".into(), score)
}

#[test]
fn numbers_are_those_that_are_worked_out_by_hand() {
    let table = ScoreTable::join(&[garden(), forest()]).expect("they fit");
    assert_eq!((table.mutants, table.sound), (5, 5));
    let [stone, skill] = table.testers.as_slice() else { panic!("two testers") };
    assert_eq!((stone.recall, skill.recall), (Share::new(3, 5), Share::new(2, 4)));
    assert_eq!((stone.precision, skill.precision), (Share::new(3, 4), Share::new(2, 3)));
    assert_eq!((stone.false_findings, skill.false_findings), (Share::new(1, 5), Share::new(1, 4)));
    // Three defects in five seconds.
    assert_eq!((stone.seconds, stone.found_per_hour), (5.0, Some(2160.0)));
    assert_eq!((stone.first_seconds, skill.first_seconds), (Some(0.5), Some(0.5)));
    assert_eq!((stone.minimised, stone.minimised_share, stone.replays), (Some(3.0), Some(0.25), 1));
    assert_eq!(stone.episode_share, Some(0.1));
    assert_eq!((stone.games.clone(), skill.skilled), (vec!["forest".to_owned(), "garden".to_owned()], true));
    assert_eq!(table.best.testers, ["stone", "skill"]);
    assert_eq!(table.best.recall, Share::new(4, 5));
    // Both have a finding on an unmutated level.
    assert!(table.careful.testers.is_empty());
    assert_eq!((table.only_skills, table.only_skills_of_found), (Share::new(1, 5), Share::new(1, 4)));
    let [pit, wall] = table.classes.as_slice() else { panic!("two classes") };
    assert_eq!((pit.class.as_str(), pit.testers.clone()), ("pit", vec![Share::new(1, 3), Share::new(1, 2)]));
    assert_eq!((pit.best, pit.precision, pit.only_skills), (Share::new(2, 3), Share::new(2, 3), Share::new(1, 3)));
    assert_eq!((wall.class.as_str(), wall.best, wall.beside), ("wall", Share::new(2, 2), Share::new(2, 2)));
}

#[test]
fn what_only_a_games_own_detectors_find_is_distinguished() {
    let (path, mut score) = garden();
    let finding = |detector: &str| JobFinding { detector: detector.to_owned(), tick: None, message: String::new() };
    let found = |job: &mut ScoredJob, detectors: &[&str]| {
        job.result.findings = detectors.iter().map(|detector| finding(detector)).collect();
    };
    for job in score.jobs.iter_mut().filter(|job| job.result.tester == "stone") {
        match job.result.subject.as_str() {
            "a" => found(job, &["weeds"]),
            "b" => found(job, &["weeds", "stuck"]),
            _ => {}
        }
    }
    let table = ScoreTable::join(&[(path, score)]).expect("it fits");
    assert_eq!((table.testers[0].recall, table.testers[0].without_own), (Share::new(2, 4), Share::new(1, 4)));
    assert_eq!((table.best.recall, table.best.without_own), (Share::new(3, 4), Share::new(2, 4)));
}

#[test]
fn the_page_has_a_row_for_each_class_and_tester_and_its_commands() {
    let page = ScoreTable::join(&[garden(), forest()]).expect("they fit").to_markdown();
    for part in [
        "- 5 mutants in 2 classes, 5 sound levels",
        "- Best mix: stone + skill: recall 80.0 % (4 of 5; ",
        "| pit | 3 | 1 of 3 | 1 of 2 | 2 of 3 | 2 of 3 |",
        "| stone | 60.0 % (3 of 5; ",
        "Testers with learned skills: skill.",
        "```sh\nplaybot bugs score set --out garden.json\n```",
    ] {
        assert!(page.contains(part), "no {part} in {page}");
    }
}

#[test]
fn scores_that_do_not_go_together_are_refused() {
    assert!(matches!(ScoreTable::join(&[]), Err(ScoreError::Nothing)));
    let twice = ScoreTable::join(&[garden(), garden()]).expect_err("the same").to_string();
    assert!(twice.contains("both score `a`"), "{twice}");
    let (path, mut other) = forest();
    other.record.budget.episodes = 9;
    let unlike = ScoreTable::join(&[garden(), (path, other)]).expect_err("another way").to_string();
    assert!(unlike.contains("garden.json and forest.json cannot be joined: episodes 5 and 9"), "{unlike}");
}
