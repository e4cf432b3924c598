//! Tests of the whole page.

use crate::{
    findings::{FindingHead, NOT_SOLVED, RecordedCourse, testing::course},
    verdict::{
        CommonStop, Comparison, EpisodePath, FindingChange, LevelMaps, LevelVerdict, MapScope, Places, Shard,
        SkillTicks, SquareEnds, StopKind, TestError, TestRecord, TesterVerdict, TooShort, merge,
    },
    verdict_report::{
        HtmlReport, REPORT, STYLE, html,
        testing::{Garden, finding, in_file, keep, level, pin, record, tested},
        write_html,
    },
};
use std::{collections::BTreeMap, fs, path::PathBuf};

const PLAIN: HtmlReport<'static> = HtmlReport {
    game: Some(&Garden),
    comparison: None,
    before: None,
    program: "playbot",
    scenes: None,
    explorer: None,
    split: false,
};

/// Makes the page of these levels of `hard:0..`.
fn page(levels: &[LevelVerdict], report: &HtmlReport) -> String {
    let parent = tempfile::tempdir().expect("a folder");
    let range = format!("hard:0..{}", levels.len() - 1);
    html(&tested(parent.path(), "whole", &record(&range, None), levels), report).expect("results")
}

/// Makes maps of a level with agents everywhere, and a failure path all over it.
fn full_maps() -> LevelMaps {
    let often = |square: u64| [square, 1 + square * square * 7919 % 997];
    let path = (0..200).map(|step| [step * 389 % 1024, 40]).collect();
    LevelMaps {
        side: 1.0,
        columns: 64,
        rows: 16,
        visits: (0..1024).map(often).collect(),
        lost: (0..1024).map(|square| often(square + 3)).map(|[square, ticks]| [square - 3, ticks]).collect(),
        skills: (1..9).map(|number| SkillTicks { skill: format!("z{number}+"), ticks: 7 }).collect(),
        skill_at: (0..1024).map(|square| [square, often(square)[1] % 8]).collect(),
        failure: Some(EpisodePath { tester: "random".to_owned(), episode: 3, path }),
        ..LevelMaps::default()
    }
}

/// Leaves out most visits of maps.
fn few_visits(maps: LevelMaps) -> LevelMaps {
    LevelMaps { visits: maps.visits.into_iter().take(100).collect(), ..maps }
}

/// Makes a level with everything that makes a page long.
fn long(index: u64) -> LevelVerdict {
    let end = |number: u16| SquareEnds {
        x: f32::from(2 * number) + 1.0,
        y: 3.0,
        lost: 3,
        timed_out: 2,
        causes: [("saw".to_owned(), 3), ("time".to_owned(), 2)].into(),
    };
    let short = level(index, 1, 9, 1234);
    let tester = |number: u32| TesterVerdict { tester: format!("tester-{number}"), ..short.testers[0].clone() };
    LevelVerdict {
        ends: (0..32).map(end).collect(),
        causes: [("saw".to_owned(), 96), ("time".to_owned(), 64)].into(),
        places: Some(Places { visited: 800, open: 1_000 }),
        // Further levels would not be drawn.
        maps: (index < 200).then(full_maps),
        testers: (0..40).map(tester).collect(),
        findings: (0..3).map(|_| finding("panic", &"index out of bounds ".repeat(100))).collect(),
        ..short
    }
}

#[test]
fn a_level_of_an_editor_has_its_name_beside_its_number() {
    let thicket = LevelVerdict { name: Some("Thicket".to_owned()), ..level(1, 1, 9, 5) };
    let html = page(&[level(0, 1, 9, 5), thicket], &PLAIN);
    assert!(html.contains(">hard:1 Thicket</th>") && html.contains(">hard:0</th>"), "{html}");
}

#[test]
fn common_stops_and_levels_that_are_solved_in_their_first_tick_are_on_the_page() {
    let (kind, entity) = (StopKind::Furthest, Some("the entity with `Player<T>`".to_owned()));
    let stop = Some(CommonStop { kind, x: 12.4, y: 3.0, within: 0.5, episodes: 3, of: 3, entity });
    let stopped = LevelVerdict { stop, ..level(0, 0, 3, 0) };
    let at_start = LevelVerdict { solved_at_start: true, ..level(1, 3, 3, 1) };
    let html = page(&[stopped, at_start], &PLAIN);
    let words = "lost 3; all 3 episodes got no further from their start than (12.4, 3.0), within 0.5, by the \
                 position of the entity with `Player&lt;T&gt;`";
    assert!(html.contains(words), "{html}");
    assert!(html.contains("<p>1 level is solved in its first tick: hard:1.</p>"), "{html}");
}

#[test]
fn pins_are_in_the_gallery_and_in_the_rows_of_levels() {
    let parent = tempfile::tempdir().expect("a folder");
    let with = |index: u64, names: &[&str]| LevelVerdict {
        findings: names.iter().map(|name| in_file(name)).collect(),
        ..level(index, 9, 9, 5)
    };
    let levels = [with(0, &["a"]), with(1, &["a", "b"]), with(2, &["b"])];
    let folder = tested(parent.path(), "whole", &record("hard:0..2", None), &levels);
    pin(&folder, &["a"], "2999-01-31");
    let page = html(&folder, &PLAIN).expect("results");
    let words = "pinned until 2999-01-31: drawn anew in spring";
    for words in [
        format!("<summary>panic: a; {words}</summary>"),
        format!("<summary>panic: a (and 1 more); panic {words}</summary>"),
        "<summary>panic: b</summary>".to_owned(),
        format!("\"d\":\"{words}\""),
        format!("<li><b>panic</b> (random, episode 0, tick 7): a; {words} <code>"),
        format!("<p><b>{words}</b></p>"),
    ] {
        assert!(page.contains(&words), "{words} in {page}");
    }
    assert_eq!(page.matches("<article class=\"finding pinned\">").count(), 2, "{page}");
}

#[test]
fn a_kept_failed_episode_is_at_its_level_with_the_command_that_replays_it() {
    let parent = tempfile::tempdir().expect("a folder");
    let folder = tested(parent.path(), "whole", &record("hard:0..0", None), &[level(0, 0, 9, 0)]);
    let tester = Some("<random>".to_owned());
    let head = FindingHead { tester, ..FindingHead::new("hard:0", NOT_SOLVED, "time was up after 30 ticks") };
    keep(&folder, "a b", head);
    let page = html(&folder, &PLAIN).expect("results");
    let words = "<p>A failed episode of &lt;random&gt; is kept: time was up after 30 ticks.</p>\n\
                 <pre><code>playbot replay &#39;findings/a b.finding&#39; --window</code></pre>";
    assert!(page.contains(words), "{page}");
}

#[test]
fn detectors_that_could_not_look_are_on_the_page() {
    let too_short =
        vec![TooShort { detector: "a<b".to_owned(), needs: 9, had: 8, setting: Some("a<b.ticks=4".to_owned()) }];
    let mut short = LevelVerdict { too_short, ..level(0, 0, 3, 0) };
    short.score.timed_out = 1;
    let html = page(&[short], &PLAIN);
    let words = "<p>Detectors that could not look: a&lt;b (needs episodes of 9 ticks, and had at most 8: `--detector \
                 a&lt;b.ticks=4`).</p>";
    assert!(html.contains(words), "{html}");
}

#[test]
fn what_a_recording_does_otherwise_is_in_the_row_of_its_level() {
    let recorded = |index, course| LevelVerdict { recorded: Some(course), ..level(index, 1, 1, 9) };
    let other = RecordedCourse { differs: Some(3), position: Some([2.0, 0.5]), ..course(120) };
    let html = page(&[recorded(0, course(120)), recorded(1, other), recorded(2, course(80))], &PLAIN);
    let start = "the recording solves it in 120 ticks; its actions lead elsewhere from tick";
    let early = format!("{start} 79 on, and reach the goal after 80 ticks");
    let late = format!("{start} 3 on, at (2.0, 0.5), and still reach the goal");
    for words in [&early, &late] {
        let summary = format!("<summary>solved each time; {words}</summary>");
        assert!(html.contains(&summary) && html.contains(&format!("<p>{words}.</p>")), "{html}");
    }
    assert!(html.contains("<p>3 recorded levels: 1 no longer ends as recorded.</p>"), "{html}");
    let list = |title: &str, line: &str| format!("<h3>{title} (1)</h3>\n<ul>\n<li>{line}</li>\n</ul>");
    assert!(html.contains(&list("No longer end as recorded", &format!("hard:2: {early}"))), "{html}");
    assert!(html.contains(&list("End as recorded", &format!("hard:1: {late}"))), "{html}");
    assert_eq!(html.matches("data-k=\"solved recording\"").count(), 1, "{html}");
    assert!(html.contains("<td data-v=\"1\">recording</td>"), "{html}");
    let place = |name: &str| html.find(&format!(">{name}</th>")).unwrap_or_else(|| panic!("{name} in {html}"));
    assert!(place("hard:2") < place("hard:0"), "it is worse");
}

#[test]
fn a_thousand_long_levels_are_less_than_ten_megabytes() {
    let levels: Vec<LevelVerdict> = (0..1000).map(long).collect();
    let html = page(&levels, &PLAIN);
    assert!(html.len() < 10_000_000, "{} bytes", html.len());
    assert_eq!(html.matches("<tbody data-k=").count(), 1000);
    assert_eq!(html.matches("viewBox=\"0 0 640 160\"").count(), 250, "the worst ones have pictures, and 50 findings");
    assert_eq!(html.matches("playbot test garden --levels hard:").count(), 1000, "all say how to see them");
    assert_eq!(html.matches("<g class=\"map visits\"><path").count(), 200, "and maps");
    let clips = html.matches("data-clip=\"data:image/png;base64,iVBORw0KGgo").count();
    assert!((20..=60).contains(&clips), "{clips} clips");
    assert!(html.contains(" 200 of them have a picture here.") && html.contains("and 30 more in results.json"));
}

#[test]
fn joined_shards_give_the_page_of_the_whole() {
    let parent = tempfile::tempdir().expect("a folder");
    let levels: Vec<LevelVerdict> = (0..11).map(|index| level(index, index % 3, 9, 40 + index as u32)).collect();
    let whole = tested(parent.path(), "whole", &record("hard:0..10", None), &levels);
    let shards: Vec<PathBuf> = ["0/2", "1/2"]
        .map(|name| {
            let shard: Shard = name.parse().expect("a shard");
            let own: Vec<LevelVerdict> = shard.places(11).map(|place| levels[place as usize].clone()).collect();
            tested(parent.path(), &name.replace('/', "-"), &record("hard:0..10", Some(name)), &own)
        })
        .to_vec();
    let joined = parent.path().join("joined");
    merge(&shards, &joined).expect("all are there");
    let files = [&whole, &joined].map(|folder| {
        let file = folder.join(REPORT);
        write_html(folder, &file, &PLAIN).expect("writable");
        fs::read(file).expect("it is there")
    });
    assert!(files[0] == files[1] && !files[0].is_empty());
    let part = html(&shards[1], &PLAIN).expect("results");
    assert!(part.contains("shard 1/2") && part.contains("hard:9") && !part.contains("hard:8<"));
    let none = write_html(parent.path(), &parent.path().join(REPORT), &PLAIN);
    assert!(matches!(none, Err(TestError::NoResults { .. })));
}

#[test]
fn nothing_of_what_files_and_games_say_becomes_markup() {
    let nasty = LevelVerdict {
        level: "levels/<b>.json".to_owned(),
        findings: vec![finding("<u>", "</details></script><script>alert('x')</script>")],
        testers: vec![TesterVerdict { tester: "<i>".to_owned(), ..level(0, 0, 9, 0).testers[0].clone() }],
        ends: vec![SquareEnds { x: 1.0, y: 1.0, lost: 9, ..SquareEnds::default() }],
        ..level(0, 0, 9, 0)
    };
    let changed = FindingChange { level: "<em>".to_owned(), detector: "panic".to_owned(), tester: None };
    let comparison = Comparison { levels: 1, new_findings: vec![changed], ..Comparison::default() };
    let html = page(&[nasty], &HtmlReport { comparison: Some(&comparison), ..PLAIN });
    for markup in ["<b>.json", "<i>", "<u>", "<em>", "</script><script>", "alert('x')"] {
        assert!(!html.contains(markup), "{markup} in {html}");
    }
    assert!(html.contains("levels/&lt;b&gt;.json") && html.contains("<h3>New findings (1)</h3>"), "{html}");
    assert_eq!(html.matches("<script>").count(), 1);
}

#[test]
fn the_page_loads_nothing() {
    let lost = LevelVerdict { maps: Some(full_maps()), ..level(2, 0, 9, 5) };
    let html =
        page(&[long(0), level(1, 9, 9, 5), LevelVerdict { maps: lost.maps.clone().map(few_visits), ..lost }], &PLAIN);
    for words in ["http:", "https:", "src=\"", "href=", "@import", "import("] {
        assert!(!html.contains(words), "{words}");
    }
    assert_eq!(html.matches("url(").count(), html.matches("url(#hatch)").count(), "the pattern is in the page");
    assert_eq!((html.matches("id=\"hatch\"").count(), html.matches("fill=\"url(#hatch)").count()), (1, 2));
    // Clips are in the page, and shown by the script.
    assert!(html.contains("default-src 'none'") && html.contains("img-src data:") && html.contains("data-clip=\""));
}

#[test]
fn a_split_page_has_its_pictures_in_files_and_a_whole_one_removes_them() {
    let parent = tempfile::tempdir().expect("a folder");
    let folder = tested(parent.path(), "whole", &record("hard:0..2", None), &[long(0), long(1), level(2, 9, 9, 5)]);
    let (file, pictures) = (folder.join(REPORT), folder.join("report-files"));
    let split = HtmlReport { split: true, ..PLAIN };
    let written = |report: &HtmlReport| {
        write_html(&folder, &file, report).expect("writable");
        fs::read_to_string(&file).expect("it is there")
    };
    let page = written(&split);
    let (_, clip) = page.split_once("data-clip=\"").expect("a clip");
    let (clip, _) = clip.split_once('"').expect("an address");
    assert!(fs::read(folder.join(clip)).expect("a file").starts_with(b"\x89PNG"), "{clip}");
    // Both levels fail in the same way.
    assert_eq!((page.matches("data-clip=").count(), fs::read_dir(&pictures).expect("a folder").count()), (2, 1));
    assert!(!page.contains("base64,iVBOR") && page.contains("img-src data: 'self' file:"), "{page}");
    let again = written(&split);
    assert_eq!(page, again);
    assert!(written(&PLAIN).contains("base64,iVBOR") && !pictures.exists());
    fs::write(&pictures, "a file").expect("writable");
    let error = write_html(&folder, &file, &split).expect_err("there is no folder").to_string();
    assert!(error.contains("report-files"), "{error}");
    assert!(fs::read_to_string(&file).expect("it is there").contains("base64,iVBOR"), "the page before is kept");
}

#[test]
fn changed_levels_stand_side_by_side_on_the_page_of_a_comparison() {
    let parent = tempfile::tempdir().expect("a folder");
    let path = |square: u64| LevelVerdict {
        maps: Some(LevelMaps {
            best: Some(EpisodePath { tester: "random".to_owned(), episode: 0, path: vec![[65, 1], [square, 1]] }),
            failure: None,
            ..full_maps()
        }),
        ..level(0, 9, 9, 5)
    };
    let tested = |name: &str, square| tested(parent.path(), name, &record("hard:0..0", None), &[path(square)]);
    let (before, now) = (tested("before", 66), tested("now", 67));
    let comparison = Comparison::read(&before, &now).expect("comparable");
    let with = |before| html(&now, &HtmlReport { comparison: Some(&comparison), before, ..PLAIN }).expect("results");
    let page = with(Some(before.as_path()));
    assert!(page.contains("<h2>Before and now</h2>") && page.contains("<p class=\"key\">another path</p>"), "{page}");
    assert!(!with(None).contains("Before and now"));
}

#[test]
fn a_level_has_its_numbers_in_cells_that_can_be_sorted() {
    let levels = [
        level(0, 9, 9, 40),
        level(1, 3, 9, 50),
        LevelVerdict { findings: vec![finding("a", "b")], ..level(2, 0, 9, 0) },
    ];
    let html = page(&levels, &PLAIN);
    let row = "<tr><th scope=\"row\" data-v=\"1\">hard:1</th><td data-v=\"2\" class=\"solved\">solved</td>\
               <td data-v=\"0.3333\">3 of 9</td><td data-v=\"0.1206\">12.1 to 64.6 %</td><td data-v=\"50\">50</td>\
               <td data-v=\"-1.0\">–</td><td data-v=\"0\">–</td></tr>";
    assert!(html.contains(row), "{html}");
    let place = |words: &str| html.find(words).unwrap_or_else(|| panic!("{words} in {html}"));
    assert!(place(">hard:2</th>") < place(">hard:1</th>") && place(">hard:1</th>") < place(">hard:0</th>"));
    assert!(html.contains("data-k=\"bot-failed findings\"") && html.contains("<summary>a: b</summary>"), "{html}");
    assert!(html.contains("<summary>lost 6</summary>") && html.contains("<summary>solved each time</summary>"));
    // Two of three.
    assert!(html.contains("<dd class=\"solved\">2</dd><dd>20.8 to 93.9 %</dd>"), "{html}");
    let without = page(&levels, &HtmlReport { game: None, ..PLAIN });
    assert!(without.contains("There are no pictures: this program does not have the game `garden`."), "{without}");
    assert!(!without.contains("<svg") && !without.contains("<summary>solved each time"));
}

#[test]
fn wide_tables_scroll_within_themselves_and_keep_their_first_column() {
    let html = page(&[long(0), level(1, 3, 9, 5)], &PLAIN);
    let frames: Vec<&str> = html
        .match_indices("<table")
        .map(|(start, _)| {
            let before = &html[..start];
            &before[before.rfind('<').expect("it is in something")..]
        })
        .collect();
    let own = "<div class=\"table\" role=\"group\" aria-label=\"Testers\" tabindex=\"0\">";
    let [all, levels] =
        ["table\" role=\"region\" aria-label=\"Testers", "levels\" role=\"region\" aria-labelledby=\"levels-heading"]
            .map(|words| format!("<div class=\"{words}\" tabindex=\"0\">"));
    assert_eq!(frames, [all.as_str(), levels.as_str(), own, own], "all testers, levels, and the testers of each level");
    assert_eq!(html.matches("<div").count(), html.matches("</div>").count());
    for rule in [
        ".table { overflow-x: auto;",
        ".levels { overflow-x: auto;",
        "no-repeat local",
        "th:first-child { position: sticky; left: 0;",
    ] {
        assert!(html.contains(rule), "{rule}");
    }
}

#[test]
fn maps_are_switched_and_explained_in_words() {
    let html = page(&[long(0), level(1, 9, 9, 5)], &PLAIN);
    for words in [
        "<form id=\"maps\"",
        "<li><b>lost time</b>: ticks more than two seconds after",
        "<g class=\"map ends\">",
        "<g class=\"map lost-time\">",
        "<p>Ended by saw 96 (at ",
        "<p>Visited 80.0 % of the open squares",
        "<td data-v=\"80.0\">80.0 %</td>",
        "<dt>open squares visited</dt><dd class=\"places\">80.0 %</dd><dd>800 of 1,000</dd>",
    ] {
        assert!(html.contains(words), "{words}");
    }
    for kind in ["ends", "visits", "lost-time", "skills"] {
        assert!(html.contains(&format!("name=\"map\" value=\"{kind}\"")), "{kind}");
        assert!(STYLE.contains(&format!("[data-map=\"{kind}\"] .map.{kind}")), "{kind}");
    }
    let without = page(&[level(0, 1, 9, 5)], &PLAIN);
    assert!(without.contains("<g class=\"map ends\">") && !without.contains("<form id=\"maps\""), "{without}");
    assert!(without.contains("<summary>lost 8</summary>") && !without.contains("Maps of where agents went"));
}

#[test]
fn the_page_says_of_which_levels_there_are_maps() {
    let parent = tempfile::tempdir().expect("a folder");
    for (maps, words) in [(MapScope::All, "kept for all levels."), (MapScope::Failed, "since there are many levels.")] {
        let folder = tested(parent.path(), maps.name(), &TestRecord { maps, ..record("hard:0..0", None) }, &[long(0)]);
        let results = fs::read_to_string(folder.join("results.json")).expect("results");
        assert!(results.contains(&format!("\"maps\":\"{}\"", maps.name())), "{}", maps.name());
        assert!(html(&folder, &PLAIN).expect("results").contains(words), "{words}");
    }
}

/// Returns the colours of a style sheet by name.
fn colours(css: &str) -> BTreeMap<&str, [f64; 3]> {
    fn is_name(name: &str) -> bool {
        name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '-')
    }
    css.split("--")
        .filter_map(|part| {
            let (name, rest) = part.split_once(": #").filter(|(name, _)| is_name(name))?;
            let bits = u32::from_str_radix(rest.get(..6)?, 16).ok()?;
            Some((name, [bits >> 16, (bits >> 8) & 255, bits & 255].map(|channel| f64::from(channel) / 255.0)))
        })
        .collect()
}

/// Returns the contrast of two colours, as the Web Content Accessibility Guidelines define it.
fn contrast(one: [f64; 3], other: [f64; 3]) -> f64 {
    let linear = |c: f64| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    let light =
        |[red, green, blue]: [f64; 3]| 0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue) + 0.05;
    let (one, other) = (light(one), light(other));
    one.max(other) / one.min(other)
}

#[test]
fn all_text_can_be_read_on_light_and_on_dark_paper() {
    let dark = "@media (prefers-color-scheme: dark)";
    let sheets = [playbot_report::PAGE_STYLE, STYLE].map(|css| {
        let screen = css.split("@media print").next().expect("the first part");
        screen.split_once(dark).expect("both themes")
    });
    for theme in [sheets.map(|(light, _)| light), sheets.map(|(_, dark)| dark)] {
        let mut all = colours(theme[0]);
        all.extend(colours(theme[1]));
        for text in ["text", "quiet", "solved", "failed", "unsolvable"] {
            for paper in ["page", "block"] {
                let found = contrast(all[text], all[paper]);
                assert!(found >= 4.5, "{text} on {paper}: {found:.2}");
            }
        }
    }
}
