//! Findings as cards: as the game shows them, the keys before them, what moved, and the command that replays them.

use crate::{
    detectors::LogLine,
    verdict::{Finding, LevelVerdict},
    verdict_report::{
        drawn::{Drawer, Drawings, Drawn},
        files::PictureFiles,
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

/// The last ticks before a finding, as the game shows them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FindingScene {
    /// The last tick as a PNG.
    pub still: Vec<u8>,
    /// All of them as an animated PNG.
    pub moving: Vec<u8>,
    /// The ticks.
    pub ticks: Vec<SceneTick>,
    /// Lines that the game logged in these ticks.
    pub log: Vec<GameLogLine>,
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
}

/// Returns the last ticks before the finding in a file; `None` if they cannot be drawn.
pub type Scenes<'a> = &'a dyn Fn(&Path) -> Option<FindingScene>;

/// Writes the section of the page; empty without findings. `folder` is that of the results.
pub(crate) fn cards(
    selection: &Selection,
    drawings: &Drawings,
    program: &str,
    folder: &Path,
    scenes: Option<Scenes>,
) -> String {
    let found = || selection.levels.iter().flat_map(|level| level.findings.iter().map(move |finding| (level, finding)));
    let all = found().count();
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
    for (level, finding) in found().take(MOST_CARDS) {
        let file = finding.file.as_ref().map(|file| folder.join(file));
        let scene = file.as_deref().zip(scenes).filter(|_| letters < MOST_LETTERS);
        let scene = scene.and_then(|(file, scenes)| scenes(file));
        let pictures = scene.as_ref().map_or_else(String::new, |scene| scene_html(scene, &drawings.files));
        letters += pictures.len();
        let plan =
            if finding.tester.is_none() || pictures.is_empty() { plan(&mut drawer, level) } else { String::new() };
        out += &card(level, finding, program, &(pictures + &plan));
    }
    out + "</div>\n</section>\n"
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

fn card(level: &LevelVerdict, finding: &Finding, program: &str, pictures: &str) -> String {
    let who = finding.tester.as_ref().map_or_else(|| "found without play".to_owned(), |tester| escape(tester));
    let episode = finding.episode.map_or_else(String::new, |episode| format!(", episode {episode}"));
    let tick = finding.tick.map_or_else(String::new, |tick| format!(", tick {tick}"));
    // Seen from the folder of the page, so that results of a whole range and joined ones have equal pages.
    let replay = finding.file.as_ref().map_or_else(String::new, |file| {
        let command = format!("{program} replay {} --window", shell_word(file));
        format!("<pre><code>{}</code></pre>\n", escape(&command))
    });
    format!(
        "<article class=\"finding\">\n<h3>{}</h3>\n<p class=\"key\">{}; {who}{episode}{tick}</p>\n<p>{}</p>\n{pictures}{replay}</article>\n",
        escape(&finding.detector),
        text(&level.title()),
        text(&finding.message)
    )
}

/// Writes the pictures of a scene with the keys below, and its curves.
fn scene_html(scene: &FindingScene, files: &PictureFiles) -> String {
    let (Some(first), Some(last)) = (scene.ticks.first(), scene.ticks.last()) else { return String::new() };
    let ticks = format!("ticks {} to {}", first.tick, last.tick);
    let mut out = format!(
        "<figure class=\"scene\"><img src=\"{}\" data-moving=\"{}\" alt=\"The game in tick {}\" \
         loading=\"lazy\"><button type=\"button\" class=\"moving\" hidden>Play {ticks}</button></figure>\n",
        files.source(&scene.still),
        files.source(&scene.moving),
        last.tick
    );
    let _ = writeln!(out, "<p class=\"keys\">{}</p>", keys(&scene.ticks));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict_report::{
        drawn::Plans,
        testing::{Garden, finding, level, record},
    };

    fn scene() -> FindingScene {
        let tick = |number: u16| SceneTick {
            tick: 40 + u32::from(number),
            action: if number < 7 { "right" } else { "jump <b>" }.to_owned(),
            reward: 0.0,
            position: Some([f32::from(number), 2.0]),
        };
        FindingScene { still: vec![1, 2, 3], moving: vec![4, 5], ticks: (0..10).map(tick).collect(), log: Vec::new() }
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
        let selection = Selection { levels: vec![bad], left_out: 0, gallery: Vec::new(), all: 1 };
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
            "src=\"data:image/png;base64,AQID\" data-moving=\"data:image/png;base64,BAU=\"",
            "Play ticks 40 to 49",
            "<kbd>right</kbd>&nbsp;×&nbsp;7 <kbd>jump &lt;b&gt;</kbd>&nbsp;×&nbsp;3",
            "x: 0 to 9.000, at last 9.000",
            "moved in a tick: 1.000 to 1.000",
            "<li class=\"info\">tick 48 INFO the door opens</li>",
            "jump replay &#39;findings/a b.finding&#39; --window",
        ] {
            assert!(html.contains(words), "{words} in {html}");
        }
        assert!(!html.contains("reward:"), "there was none: {html}");
        let without = cards(&selection, &drawings, "jump", Path::new("runs"), None);
        assert!(without.contains("<svg class=\"level\"") && !without.contains("<img"), "the plan instead: {without}");
        let sound = Selection { levels: vec![level(0, 9, 9, 40)], left_out: 0, gallery: Vec::new(), all: 1 };
        assert_eq!(cards(&sound, &drawings, "jump", Path::new("runs"), None), "");
    }

    #[test]
    fn curves_of_odd_numbers_are_drawn_as_far_as_they_go() {
        assert_eq!(curve("x", &[f32::NAN, f32::INFINITY]), "");
        let flat = curve("x", &[3.0, f32::NAN, 3.0]);
        assert!(flat.contains("points=\"0,42 280,42\""), "{flat}");
    }
}
