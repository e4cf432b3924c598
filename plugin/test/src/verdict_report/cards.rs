//! Findings as cards: as the game shows them, the keys before them, what moved, and the command that replays them.

use crate::{
    detectors::LogLine,
    verdict::{Finding, LevelVerdict},
    verdict_report::{
        drawn::{Drawer, Drawings, Drawn},
        files::PictureFiles,
        picture::plan_with_path,
        selection::Selection,
        text,
    },
};
use bevy::math::Vec2;
use playbot_harness::brief::shell_word;
use playbot_report::{counted, escape::escape, readable};
use std::{fmt::Write, path::Path};

/// Most findings with a card.
const MOST_CARDS: usize = 50;

/// Most letters of all pictures together. Later findings have none.
const MOST_LETTERS: usize = 12_000_000;

/// Most lines of a game's log on a card, the last ones.
const MOST_LINES: usize = 20;

/// Width and height of a curve, pixels.
const CURVE: [f32; 2] = [280.0, 44.0];

/// The last ticks before a finding as the game shows them, or those around the tick since which something is wrong.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FindingScene {
    /// The last tick, or that since which something is wrong, as a PNG.
    pub still: Vec<u8>,
    /// A picture of each tick, if there are several.
    pub film: Option<SceneFilm>,
    /// The ticks.
    pub ticks: Vec<SceneTick>,
    /// The tick since which something is wrong, if these are the ticks around it.
    pub since: Option<u32>,
    /// Positions of the agent in all ticks of the episode up to the last of these, as far as the game reports them.
    pub path: Vec<[f32; 2]>,
    /// Lines that the game logged in these ticks.
    pub log: Vec<GameLogLine>,
}

/// Pictures of the last ticks of a scene, side by side in one PNG. So a page shows each of them in turn by moving the PNG,
/// also where it lies beside the page, whose bytes a script cannot read.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFilm {
    /// The PNG: rows of pictures of one size, from the left to the right and from the top to the bottom.
    pub png: Vec<u8>,
    /// Pictures, at least 1. The last one shows the last tick.
    pub pictures: usize,
    /// Pictures in a row, at least 1.
    pub columns: usize,
    /// Width and height of a picture, pixels.
    pub size: [usize; 2],
    /// Milliseconds of a tick.
    pub pause: u32,
}

/// A line of a game's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GameLogLine {
    /// Tick of the episode, from 0, in which it was logged.
    pub tick: u32,
    /// The line.
    pub line: LogLine,
}

/// A tick of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneTick {
    /// Its number in the episode, from 0.
    pub tick: u32,
    /// The action in words, as keys for games with keys.
    pub action: String,
    /// Its reward.
    pub reward: f32,
    /// Position of the agent, if the game reports it.
    pub position: Option<[f32; 2]>,
    /// Number of entities in the World.
    pub entities: u32,
}

impl FindingScene {
    /// Returns the tick that the still shows.
    fn shown(&self) -> Option<&SceneTick> {
        let since = self.since.and_then(|since| self.ticks.iter().find(|tick| tick.tick == since));
        since.or(self.ticks.last())
    }
}

/// Returns the ticks of the finding in a file; `None` if they cannot be drawn.
pub type Scenes<'a> = &'a dyn Fn(&Path) -> Option<FindingScene>;

/// Writes the section of the page; empty without findings. `folder` is that of the results.
pub(crate) fn cards(
    selection: &Selection,
    drawings: &Drawings,
    program: &str,
    folder: &Path,
    scenes: Option<Scenes>,
) -> String {
    let found = selection.levels.iter().flat_map(|level| level.findings.iter().map(move |finding| (level, finding)));
    let mut found: Vec<(&LevelVerdict, &Finding)> = found.collect();
    // A stable sort: those that do not count come last, and the others stay as they are.
    found.sort_by_key(|(_, finding)| selection.pinned.of_finding(finding).is_some());
    let all = found.len();
    if all == 0 {
        return String::new();
    }
    let mut out = String::from("<section>\n<h2>Findings</h2>\n");
    out += "<p>Run the commands in the folder of this page.";
    if all > MOST_CARDS {
        let more = counted((all - MOST_CARDS) as u64, "more finding");
        let _ =
            write!(out, " These are the first {MOST_CARDS}, of the worst levels; {more} are below, with their levels.");
    }
    out += "</p>\n<div class=\"cards\">\n";
    let mut drawer = Drawer::new(drawings);
    let mut letters = 0;
    for (level, finding) in found.into_iter().take(MOST_CARDS) {
        let file = finding.file.as_ref().map(|file| folder.join(file));
        let scene = file.as_deref().zip(scenes).filter(|_| letters < MOST_LETTERS);
        let scene = scene.and_then(|(file, scenes)| scenes(file));
        let picture = scene.as_ref().map_or_else(String::new, |scene| picture(scene, &drawings.files));
        letters += picture.len();
        let path = scene.as_ref().map_or_else(String::new, |scene| path(level, scene, drawings));
        let is_bare = path.is_empty() && (finding.tester.is_none() || picture.is_empty());
        let plan = if is_bare { plan(&mut drawer, level) } else { path };
        let pictures = match (picture.is_empty(), plan.is_empty()) {
            (false, false) => format!("<div class=\"beside\">\n{picture}{plan}</div>\n"),
            _ => picture + &plan,
        };
        let pictures = pictures + &scene.as_ref().map_or_else(String::new, curves);
        out += &card(level, finding, selection.pinned.describe(finding), program, &pictures);
    }
    out + "</div>\n</section>\n"
}

/// Draws the plan of a level with the path of the agent up to the finding; empty without a plan or positions.
fn path(level: &LevelVerdict, scene: &FindingScene, drawings: &Drawings) -> String {
    let label = format!("{}: the path to the finding", level.title());
    let cross = scene.since.and(scene.shown()).and_then(|tick| tick.position);
    let drawn = drawings.plans.get(level).and_then(|plan| plan_with_path(&plan, &scene.path, cross, &label));
    let words = match scene.since.filter(|_| cross.is_some()) {
        Some(since) => format!("The path of the agent, which is at the cross in tick {since}."),
        None => "The path to the finding, which is at the cross.".to_owned(),
    };
    let figure = |drawn: String| format!("<figure>{drawn}<figcaption class=\"key\">{words}</figcaption></figure>\n");
    drawn.map_or_else(String::new, figure)
}

/// Draws the plan of a level, with the squares that were reached if it was not solved.
fn plan(drawer: &mut Drawer, level: &LevelVerdict) -> String {
    // The maps are those of the table.
    let drawn = drawer.draw_bare(level);
    drawn.map_or_else(String::new, |Drawn { picture, reach, .. }| {
        let reach = reach.map_or_else(String::new, |reach| format!("<figcaption class=\"key\">{reach}.</figcaption>"));
        format!("<figure>{picture}{reach}</figure>")
    })
}

fn card(level: &LevelVerdict, finding: &Finding, pin: Option<String>, program: &str, pictures: &str) -> String {
    let who = finding.tester.as_ref().map_or_else(|| "found without play".to_owned(), |tester| escape(tester));
    let episode = finding.episode.map_or_else(String::new, |episode| format!(", episode {episode}"));
    let tick = finding.tick.map_or_else(String::new, |tick| format!(", tick {tick}"));
    // Seen from the folder of the page, so that results of a whole range and joined ones have equal pages.
    let replay = finding.file.as_ref().map_or_else(String::new, |file| {
        let command = format!("{program} replay {} --window", shell_word(file));
        format!("<pre><code>{}</code></pre>\n", escape(&command))
    });
    // Levels that are found without play often have the same message, and differ in where testers end.
    let losses = level.describe_losses().filter(|_| finding.tester.is_none());
    let losses = losses.map_or_else(String::new, |losses| format!("<p>Episodes: {}</p>\n", text(&losses)));
    let class = if pin.is_some() { "finding pinned" } else { "finding" };
    let pin = pin.map_or_else(String::new, |pin| format!("<p><b>{}</b></p>\n", text(&pin)));
    format!(
        "<article class=\"{class}\">\n<h3>{}</h3>\n<p class=\"key\">{}; {who}{episode}{tick}</p>\n{pin}<p>{}</p>\n{losses}{pictures}{replay}</article>\n",
        escape(&finding.detector),
        text(&level.title()),
        text(&finding.message)
    )
}

/// Writes the picture of a scene, and buttons that show it tick by tick. Without script, the still is there.
fn picture(scene: &FindingScene, files: &PictureFiles) -> String {
    let [Some(last), Some(shown)] = [scene.ticks.last(), scene.shown()].map(|tick| tick.map(|tick| tick.tick)) else {
        return String::new();
    };
    let still =
        format!("<img src=\"{}\" alt=\"The game in tick {shown}\" loading=\"lazy\">", files.source(&scene.still));
    let since = scene.since.map_or_else(String::new, |since| {
        format!("<figcaption class=\"key\">Around tick {since}, since which it is so.</figcaption>")
    });
    let film = scene.film.as_ref().filter(|film| film.columns > 0 && (2..=scene.ticks.len()).contains(&film.pictures));
    let Some(film) = film else { return format!("<figure class=\"scene\">{still}{since}</figure>\n") };
    let SceneFilm { pictures, columns, size: [width, height], pause, .. } = film;
    let filmed = &scene.ticks[scene.ticks.len() - pictures..];
    let first = filmed[0].tick;
    let place = filmed.iter().position(|tick| tick.tick == shown).unwrap_or(pictures - 1);
    format!(
        "<figure class=\"scene\" data-film=\"{}\" data-pictures=\"{pictures}\" data-columns=\"{columns}\" \
         data-ratio=\"{width} / {height}\" data-first=\"{first}\" data-shown=\"{place}\" data-pause=\"{pause}\">{still}\
         <div class=\"steps\" role=\"group\" aria-label=\"Ticks {first} to {last}\" hidden>\
         <button type=\"button\" aria-label=\"One tick back\">−1</button>\
         <button type=\"button\">Play</button>\
         <button type=\"button\" aria-label=\"One tick on\">+1</button> \
         <output>tick {shown}</output> of {first} to {last}</div>{since}</figure>\n",
        files.source(&film.png)
    )
}

/// Writes the keys of a scene, its curves and the lines of the log.
fn curves(scene: &FindingScene) -> String {
    if scene.ticks.is_empty() {
        return String::new();
    }
    let mut out = format!("<p class=\"keys\">{}</p>\n", keys(&scene.ticks));
    let positions: Option<Vec<[f32; 2]>> = scene.ticks.iter().map(|tick| tick.position).collect();
    if let Some(positions) = positions.filter(|positions| positions.len() > 1) {
        let along = |axis: usize| positions.iter().map(|position| position[axis]).collect::<Vec<f32>>();
        let moved = |pair: &[[f32; 2]]| Vec2::from(pair[1]).distance(Vec2::from(pair[0]));
        let speed = positions.windows(2).map(moved).collect();
        for (name, values) in [("x", along(0)), ("y", along(1)), ("moved in a tick", speed)] {
            out += &curve(name, &values);
        }
    }
    let rewards: Vec<f32> = scene.ticks.iter().map(|tick| tick.reward).collect();
    if rewards.iter().any(|reward| *reward != 0.0) {
        out += &curve("reward", &rewards);
    }
    let entities: Vec<f32> = scene.ticks.iter().map(|tick| tick.entities as f32).collect();
    if entities.iter().any(|count| *count != entities[0]) {
        out += &curve("entities", &entities);
    }
    out + &log(&scene.log)
}

/// Writes the last lines of a game's log with their ticks; empty without lines.
fn log(lines: &[GameLogLine]) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let left_out = lines.len().saturating_sub(MOST_LINES);
    let title = match left_out {
        0 => counted(lines.len() as u64, "line"),
        more => format!("the last {MOST_LINES} lines, after {more} more"),
    };
    let mut out =
        format!("<details class=\"log\" open><summary>Log of the game: {title}</summary>\n<ol tabindex=\"0\">\n");
    for GameLogLine { tick, line } in &lines[left_out..] {
        let class = line.level.as_str().to_lowercase();
        let _ = writeln!(out, "<li class=\"{class}\">tick {tick} {} {}</li>", line.level, text(&line.message));
    }
    out + "</ol></details>\n"
}

/// Returns the actions, each once with the number of ticks in a row, the last ones of many.
fn keys(ticks: &[SceneTick]) -> String {
    let mut runs: Vec<(&str, usize)> = Vec::new();
    for tick in ticks {
        match runs.last_mut() {
            Some((action, count)) if *action == tick.action => *count += 1,
            _ => runs.push((&tick.action, 1)),
        }
    }
    let shown = &runs[runs.len().saturating_sub(12)..];
    let words: Vec<String> =
        shown.iter().map(|(action, count)| format!("<kbd>{}</kbd>&nbsp;×&nbsp;{count}", escape(action))).collect();
    let begin = if shown.len() < runs.len() { "… " } else { "" };
    format!("{begin}{}", words.join(" "))
}

/// Writes values over the ticks as a line, with the least and the largest.
fn curve(name: &str, values: &[f32]) -> String {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let (least, most) = finite().fold((f32::MAX, f32::MIN), |(least, most), value| (least.min(value), most.max(value)));
    if least > most {
        return String::new();
    }
    let [width, height] = CURVE;
    let span = if most > least { most - least } else { 1.0 };
    let step = width / (values.len().max(2) - 1) as f32;
    let mut points = String::new();
    for (place, value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let (x, y) = (place as f32 * step, (height - 4.0) * (1.0 - (value - least) / span) + 2.0);
        let _ = write!(points, "{x:.0},{y:.0} ");
    }
    let last = values.last().copied().unwrap_or(0.0);
    let [least, most, last] = [least, most, last].map(|value| readable(f64::from(value)));
    format!(
        "<p class=\"curve\"><svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{name} over the ticks\">\
         <polyline points=\"{}\"/></svg><span>{name}: {least} to {most}, at last {last}</span></p>\n",
        points.trim_end()
    )
}

// The tick since which something is wrong. Some detectors wait until they are sure, so the cause of a finding lies ticks
// before it. Their messages name it as `since tick 807` or as `for 300 ticks`, and so may those of a game's own detectors.
// A message is in every finding, so older ones are shown around that tick, too.

/// Words before the number of a tick.
const SINCE: &str = "since tick ";

/// Words around a number of ticks.
const FOR: [&str; 2] = ["for ", " ticks"];

/// Returns the tick since which something is wrong, of a finding in the tick `found`. `None` if the message names no tick
/// before that one.
pub fn tick_since(message: &str, found: u32) -> Option<u32> {
    let since = message.split(SINCE).skip(1).find_map(|rest| number(rest).map(|(tick, _)| tick));
    let lasted = || {
        let ticks = message.split(FOR[0]).skip(1).filter_map(number).find(|(_, rest)| rest.starts_with(FOR[1]));
        ticks.map(|(ticks, _)| found.saturating_sub(ticks))
    };
    since.or_else(lasted).filter(|since| *since < found)
}

/// Returns the number with which a text begins, and the text after it.
fn number(text: &str) -> Option<(u32, &str)> {
    let end = text.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    Some((digits.parse().ok()?, rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{PinnedFindings, SquareEnds},
        verdict_report::{
            drawn::Plans,
            testing::{Garden, finding, in_file, level, pin, record},
        },
    };

    fn scene() -> FindingScene {
        let tick = |number: u16| SceneTick {
            tick: 40 + u32::from(number),
            action: if number < 7 { "right" } else { "jump <b>" }.to_owned(),
            reward: 0.0,
            position: Some([f32::from(number), 2.0]),
            entities: 7 + u32::from(number > 4),
        };
        let film = SceneFilm { png: vec![4, 5], pictures: 8, columns: 3, size: [192, 220], pause: 66 };
        FindingScene {
            still: vec![1, 2, 3],
            film: Some(film),
            ticks: (0..10).map(tick).collect(),
            since: None,
            path: (0..50_u16).map(|tick| [f32::from(tick), 2.0]).collect(),
            log: Vec::new(),
        }
    }

    #[test]
    fn the_last_lines_of_the_log_are_shown_with_their_ticks() {
        let line = |tick: u32, level: tracing::Level, message: &str| GameLogLine {
            tick,
            line: LogLine { level, message: message.to_owned() },
        };
        assert_eq!(log(&[]), "");
        let few = log(&[line(41, tracing::Level::WARN, "the <door> jams"), line(49, tracing::Level::ERROR, "no key")]);
        assert!(few.contains("Log of the game: 2 lines</summary>"), "{few}");
        assert!(few.contains("<li class=\"warn\">tick 41 WARN the &lt;door&gt; jams</li>"), "{few}");
        assert!(few.contains("<li class=\"error\">tick 49 ERROR no key</li>"), "{few}");
        let many: Vec<GameLogLine> = (0..33).map(|tick| line(tick, tracing::Level::INFO, &"x".repeat(900))).collect();
        let many = log(&many);
        assert!(many.contains("the last 20 lines, after 13 more") && !many.contains("tick 12 "), "{many}");
        assert!(many.contains("tick 13 INFO x") && many.len() < 20 * 480, "long lines are cut: {}", many.len());
    }

    #[test]
    fn a_finding_is_shown_with_its_pictures_keys_and_curves() {
        let tested = record("hard:0..1", None);
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let mut bad = level(1, 0, 9, 0);
        bad.findings = vec![crate::verdict::Finding {
            file: Some("findings/a b.finding".to_owned()),
            ..finding("stuck", "it <i>is</i>")
        }];
        let selection = Selection { levels: vec![bad], all: 1, ..Selection::default() };
        let scenes = |path: &Path| {
            (path == Path::new("runs/a test/findings/a b.finding")).then(|| {
                let line = LogLine { level: tracing::Level::INFO, message: "the door opens".to_owned() };
                FindingScene { log: vec![GameLogLine { tick: 48, line }], ..scene() }
            })
        };
        let html = cards(&selection, &drawings, "jump", Path::new("runs/a test"), Some(&scenes));
        for words in [
            "<h3>stuck</h3>",
            "it &lt;i&gt;is&lt;/i&gt;",
            "src=\"data:image/png;base64,AQID\"",
            "data-film=\"data:image/png;base64,BAU=\" data-pictures=\"8\" data-columns=\"3\" data-ratio=\"192 / 220\" \
             data-first=\"42\" data-shown=\"7\" data-pause=\"66\"",
            "aria-label=\"One tick back\"",
            "<output>tick 49</output> of 42 to 49",
            "<div class=\"beside\">\n<figure class=\"scene\"",
            "<path class=\"way\"",
            "<kbd>right</kbd>&nbsp;×&nbsp;7 <kbd>jump &lt;b&gt;</kbd>&nbsp;×&nbsp;3",
            "x: 0 to 9.000, at last 9.000",
            "moved in a tick: 1.000 to 1.000",
            "entities: 7.000 to 8.000, at last 8.000",
            "<li class=\"info\">tick 48 INFO the door opens</li>",
            "jump replay &#39;findings/a b.finding&#39; --window",
        ] {
            assert!(html.contains(words), "{words} in {html}");
        }
        assert!(!html.contains("reward:"), "there was none: {html}");
        let (scene_at, plan_at) = (html.find("class=\"scene\""), html.find("<svg class=\"level\""));
        assert!(scene_at < plan_at && html.matches("<svg class=\"level\"").count() == 1, "one plan, beside: {html}");
        let without = cards(&selection, &drawings, "jump", Path::new("runs"), None);
        assert!(without.contains("<svg class=\"level\"") && !without.contains("<img"), "the plan instead: {without}");
        let sound = Selection { levels: vec![level(0, 9, 9, 40)], all: 1, ..Selection::default() };
        assert_eq!(cards(&sound, &drawings, "jump", Path::new("runs"), None), "");
    }

    #[test]
    fn a_finding_that_names_an_earlier_tick_is_shown_around_it() {
        let tested = record("hard:0..1", None);
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let locked = FindingScene { since: Some(45), ..scene() };
        let html = picture(&locked, &drawings.files) + &path(&level(1, 0, 9, 0), &locked, &drawings);
        for words in [
            "alt=\"The game in tick 45\"",
            "data-first=\"42\" data-shown=\"3\"",
            "<output>tick 45</output> of 42 to 49",
            "Around tick 45, since which it is so.",
            "The path of the agent, which is at the cross in tick 45.",
            // Its position is 5, 2, and a unit 10 of the drawing.
            "<path class=\"cross\" d=\"M23 113l54 54m0-54l-54 54\"/>",
        ] {
            assert!(html.contains(words), "{words} in {html}");
        }
        let left_out = picture(&FindingScene { since: Some(40), ..scene() }, &drawings.files);
        assert!(
            left_out.contains("alt=\"The game in tick 40\"") && left_out.contains("data-shown=\"7\""),
            "{left_out}"
        );
        let elsewhere = picture(&FindingScene { since: Some(7), ..scene() }, &drawings.files);
        assert!(elsewhere.contains("The game in tick 49"), "{elsewhere}");
    }

    #[test]
    fn pinned_findings_say_so_and_come_after_the_others() {
        let folder = tempfile::tempdir().expect("a folder");
        pin(folder.path(), &["a"], "2027-01-31");
        let tested = record("hard:0..1", None);
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let with = |index: u64, name: &str| LevelVerdict { findings: vec![in_file(name)], ..level(index, 0, 9, 0) };
        let pinned = PinnedFindings::read(folder.path(), "2027-01-01".parse().expect("a day")).expect("pins");
        let selection = Selection { levels: vec![with(0, "a"), with(1, "b")], all: 2, pinned, ..Selection::default() };
        let html = cards(&selection, &drawings, "jump", folder.path(), None);
        let words = "<article class=\"finding pinned\">";
        let [open, pinned] = ["<article class=\"finding\">", words].map(|words| html.find(words).expect(words));
        assert!(open < pinned, "{html}");
        let words = "<p><b>pinned until 2027-01-31: drawn anew in spring</b></p>";
        assert_eq!((html.matches(words).count(), html.matches("<article").count()), (1, 2), "{html}");
    }

    #[test]
    fn a_finding_without_play_has_the_ends_of_the_episodes() {
        let tested = record("hard:0..1", None);
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let sealed = Finding { tester: None, ..finding("unreachable-goal", "a search ended without it") };
        let causes = [("lava <b>".to_owned(), 9)].into();
        let end = SquareEnds { x: 7.0, y: 5.0, lost: 9, timed_out: 0, causes: [("lava <b>".to_owned(), 9)].into() };
        let one = LevelVerdict { findings: vec![sealed], causes, ends: vec![end], ..level(0, 0, 9, 0) };
        let selection = Selection { levels: vec![one], all: 1, ..Selection::default() };
        let html = cards(&selection, &drawings, "jump", Path::new("runs"), None);
        assert!(html.contains("<p>Episodes: lost 9: lava &lt;b&gt; 9 (near 7.0, 5.0)</p>"), "{html}");
    }

    #[test]
    fn a_scene_of_one_picture_has_no_buttons() {
        let files = PictureFiles::default();
        let film = |pictures: usize, columns: usize| {
            let film = scene().film.map(|film| SceneFilm { pictures, columns, ..film });
            picture(&FindingScene { film, ..scene() }, &files)
        };
        // More pictures than ticks cannot be.
        for html in [film(1, 1), film(11, 3), film(8, 0), picture(&FindingScene { film: None, ..scene() }, &files)] {
            assert!(html.contains("The game in tick 49") && !html.contains("<button"), "{html}");
        }
        assert!(film(10, 4).contains("<output>tick 49</output> of 40 to 49"));
        assert_eq!(picture(&FindingScene::default(), &files), "");
    }

    #[test]
    fn curves_of_odd_numbers_are_drawn_as_far_as_they_go() {
        assert_eq!(curve("x", &[f32::NAN, f32::INFINITY]), "");
        let flat = curve("x", &[3.0, f32::NAN, 3.0]);
        assert!(flat.contains("points=\"0,42 280,42\""), "{flat}");
    }

    #[test]
    fn messages_name_the_tick_since_which_something_is_wrong() {
        for (message, found, since) in [
            ("since tick 807 at the latest the goal cannot be reached", 907, Some(807)),
            ("the agent has not left 4.0, 1.5 for 300 ticks, whatever it did", 455, Some(155)),
            ("nothing has changed since the start of the episode, for 300 ticks, whatever the agent did", 300, Some(0)),
            ("the agent waits for the door for 20 ticks", 50, Some(30)),
            ("locked since tick 12 for 300 ticks", 50, Some(12)),
            ("stays for 300 ticks", 40, Some(0)),
            ("since tick 907 at the latest the goal cannot be reached", 907, None),
            ("the agent is lost after 20 ticks", 20, None),
            ("it rests for ticks, since tick x, for 9 seconds", 20, None),
            ("for 99999999999999999999 ticks", 20, None),
            ("", 0, None),
        ] {
            assert_eq!(tick_since(message, found), since, "{message}");
        }
    }
}
