//! The folder of a test of levels.

use std::{collections::BTreeMap, fs, path::Path};

use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;
use playbot_harness::detector::LevelProof;
use playbot_test::{
    findings::{CourseEnd, RecordedCourse},
    verdict::{
        CommonStop, Comparison, Earlier, EpisodePath, EpisodeScore, Finding, FinishTime, LevelMaps, LevelOutcome,
        LevelVerdict, MapScope, Overview, Places, PlanRows, RESULTS, ReachedCells, ResultLines, Shard, SkillTicks,
        SquareEnds, StopKind, TestFolder, TestRecord, TesterEvents, TesterRecord, TesterVerdict, TooShort, merge,
        wilson, write_reports,
    },
    verdict_report::{HtmlReport, html},
};

use crate::hostile::{
    form::Form,
    kind::{FileKind, Read, words},
    seals::digits,
};

/// Levels that were tested.
const LEVELS: u64 = 4;
/// The damaged folder, and a whole one.
const TEST: &str = "test";
const BEFORE: &str = "before";
const SHARDS: [&str; 2] = ["zero", "one"];
const GAME: CoinRun = CoinRun { physics: false };

/// Returns all kinds of files of a test.
pub(super) fn tested(folder: &Path) -> Vec<FileKind> {
    let (whole, sharded) = (folder.join("whole"), folder.join("sharded"));
    for name in [TEST, BEFORE] {
        write(&whole.join(name), None);
    }
    for (index, name) in (0..).zip(SHARDS) {
        write(&sharded.join(name), Some(Shard { index, count: 2 }));
    }
    let kind = |name, form, file: &str, read: fn(&Path) -> Read| {
        FileKind::new(name, form, &whole, &format!("{TEST}/{file}"), read)
    };
    vec![
        kind("results.json", Form::Results, RESULTS, read_results).handled(handle),
        kind("test.json", Form::Object, "test.json", go_on),
        kind("levels.jsonl", Form::Lines, "levels.jsonl", go_on).growing(),
        FileKind::new("results.json of a shard", Form::Results, &sharded, &format!("{}/{RESULTS}", SHARDS[1]), join),
    ]
}

/// Writes a test that is done.
fn write(folder: &Path, shard: Option<Shard>) {
    let record = record(shard);
    let (mut opened, _) = TestFolder::open(folder, &record, Earlier::Keep).expect("fresh");
    let places: Vec<u64> = shard.map_or_else(|| (0..LEVELS).collect(), |shard| shard.places(LEVELS).collect());
    places.into_iter().for_each(|index| opened.keep(&verdict(index)).expect("writable"));
    opened.finish().expect("writable");
}

fn record(shard: Option<Shard>) -> TestRecord {
    TestRecord {
        game: GAME.name().to_owned(),
        game_version: GAME.version(),
        range: LevelSplit { mode: "hard".to_owned(), first: 0, last: LEVELS - 1 },
        files: None,
        seed: 3,
        testers: ["random", "chaos"].map(TesterRecord::bot).to_vec(),
        episodes: 4,
        detectors: vec!["stuck ticks=9".to_owned()],
        options: vec!["--detector".to_owned(), "stuck.ticks=9".to_owned()],
        maps: MapScope::All,
        shard,
    }
}

fn score(solved: u64, episodes: u64) -> EpisodeScore {
    EpisodeScore {
        solved,
        episodes,
        interval: wilson(solved, episodes),
        ticks: FinishTime::of(vec![40; solved as usize]),
        lost: episodes - solved,
        timed_out: 0,
        broken: 0,
    }
}

/// Returns a verdict with all possible parts.
fn verdict(index: u64) -> LevelVerdict {
    let solved = index % 3;
    let places = Some(Places { visited: 3, open: 4 });
    let events = TesterEvents { ends: vec![[4, 2, 1]], lost: vec![[3, 9]], visited: vec![[3, 2]] };
    let tester = |name: &str| TesterVerdict {
        tester: name.to_owned(),
        score: score(solved, 4),
        exact: false,
        places,
        events: Some(events.clone()),
    };
    let finding = Finding {
        detector: "stuck".to_owned(),
        tester: Some("random".to_owned()),
        episode: Some(1),
        tick: Some(7),
        message: "it stands still".to_owned(),
        file: Some("findings/a.finding".to_owned()),
        settings: Vec::new(),
    };
    let causes: BTreeMap<String, u64> = [("saw".to_owned(), 2)].into();
    LevelVerdict {
        level: format!("hard:{index}"),
        name: Some("Thicket".to_owned()),
        index,
        outcome: if solved > 0 { LevelOutcome::Solved } else { LevelOutcome::BotFailed },
        proof: if solved > 0 { LevelProof::Solvable } else { LevelProof::Unknown },
        score: score(2 * solved, 8),
        seconds: Some(8.0),
        ends: vec![SquareEnds { x: 3.5, y: 2.5, lost: 2, timed_out: 1, causes: causes.clone() }],
        causes,
        stop: Some(stop()),
        solved_at_start: true,
        places,
        maps: Some(maps()),
        reached: Some(ReachedCells { side: 0.5, cells: [[-1, 2], [3, 0]].into(), entity: Some("the one".to_owned()) }),
        testers: ["random", "chaos"].map(tester).to_vec(),
        findings: vec![finding],
        not_kept: Some("`random`, episode 0: it does not fail when it is played alone".to_owned()),
        too_short: vec![too_short()],
        recorded: Some(recorded()),
    }
}

fn recorded() -> RecordedCourse {
    let (position, furthest) = (Some([12.5, 3.0]), Some([13.5, 3.0]));
    RecordedCourse {
        recorded_ticks: 120,
        ticks: 46,
        end: CourseEnd::Lost,
        differs: Some(45),
        action: Some("right".to_owned()),
        position,
        furthest,
    }
}

fn too_short() -> TooShort {
    let setting = Some("fading-action.rest=8".to_owned());
    TooShort { detector: "fading-action".to_owned(), needs: 400, had: 120, setting }
}

fn stop() -> CommonStop {
    let entity = Some("the entity with `Player`".to_owned());
    CommonStop { kind: StopKind::Furthest, x: 12.5, y: 3.0, within: 0.5, episodes: 8, of: 9, entity }
}

fn maps() -> LevelMaps {
    LevelMaps {
        side: 1.0,
        columns: 64,
        rows: 13,
        visits: vec![[3, 70], [4, 1]],
        lost: vec![[3, 9]],
        skills: vec![SkillTicks { skill: "z1+".to_owned(), ticks: 71 }],
        skill_at: vec![[3, 0], [4, 0]],
        failure: Some(EpisodePath { tester: "random".to_owned(), episode: 1, path: vec![[3, 70], [4, 1]] }),
        best: Some(EpisodePath { tester: "chaos".to_owned(), episode: 0, path: vec![[3, 2], [4, 1]] }),
        plan: Some(PlanRows { side: 1.0, rows: "64./S62.G/64#".to_owned() }),
        ..LevelMaps::default()
    }
}

fn read_results(folder: &Path) -> Read {
    let mut lines = ResultLines::open(&folder.join(TEST)).map_err(words)?;
    let mut parts = vec![format!("{:?}", lines.record())];
    while let Some(level) = lines.next_level().map_err(words)? {
        parts.push(format!("{level:?}"));
    }
    Ok(parts)
}

/// Resumes the test, of which every level may be finished, and returns its results.
fn go_on(folder: &Path) -> Read {
    let folder = folder.join(TEST);
    let (mut opened, reported) = TestFolder::open(&folder, &record(None), Earlier::Resume).map_err(words)?;
    if let Some(words) = reported {
        return Err(words);
    }
    opened.finish().map_err(words)?;
    let results = fs::read_to_string(folder.join(RESULTS)).map_err(words)?;
    let lines = results.lines().filter(|line| !line.starts_with(']'));
    Ok(lines.map(|line| line.trim_end_matches(',').to_owned()).collect())
}

fn join(folder: &Path) -> Read {
    let out = folder.join("joined");
    merge(&SHARDS.map(|name| folder.join(name)), &out).map_err(words)?;
    Ok(vec![digits(&fs::read(out.join(RESULTS)).map_err(words)?)])
}

/// Makes all reports, and compares in both directions.
fn handle(folder: &Path) {
    let (test, before) = (folder.join(TEST), folder.join(BEFORE));
    let compared = [Comparison::read(&before, &test), Comparison::read(&test, &before)];
    let comparison = compared.iter().find_map(|compared| compared.as_ref().ok());
    let _ = Overview::read(&test);
    let _ = write_reports(&test, comparison, "playbot");
    // Without an error it is the page, which is not checked here.
    let before = Some(before.as_path());
    let report = HtmlReport { game: Some(&GAME), comparison, before, program: "playbot", ..HtmlReport::default() };
    let _ = html(&test, &report);
}
