//! `playbot levels`.

use crate::{
    arguments::{Threads, check_start, default_tested},
    error::{CliError, Outcome},
    output::print_line,
    progress,
    progress::interrupt,
};
use playbot_harness::{
    game::Game,
    games::Games,
    held_out::{AlikeLevels, HeldOut, PlacedLevel},
    level_audit::{EqualLevels, EqualPlans, PlainLevels, levels_in_until, plain_episodes},
    level_files::is_level_files,
    split::LevelSplit,
};
use playbot_report::{counted, whole};
use playbot_test::verdict::maps::level_name;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};

/// Audit a set of levels: equal ones, those of another set, and those that need no player.
///
/// Two levels are equal if their layouts are: all that play meets, without pictures. Different numbers, or a number and
/// a file, can have one layout. A game that does not hash its layouts has its levels played: those are equal whose state is
/// the same in each tick, for the same actions, in up to 600 ticks. Where no more is known than what agents observe, such
/// levels are listed and are no finding. Levels of different layouts may share their floor plan: their difference is not
/// drawn, which is no finding. Then each level is played once with each action, held from the start to the end. That
/// shows the levels that are solved without an action, and those that one held action solves.
///
/// Exit code 1 if levels are equal, among those of another set, or solved without an action. Ctrl-C ends it with the results
/// so far.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot levels GAME --levels MODE:0..99
  playbot levels GAME --levels MODE:64..127 --among MODE:0..63
  playbot levels GAME --levels 'files:levels/*.json' --json
  playbot levels GAME --levels MODE:0..9999 --layouts-only")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included, as files:pattern, such as "files:levels/*.json", or by their names in a
    /// level editor (default: the held-out levels of the game's experiment, or all of a game that has no experiment and at
    /// most 64 levels).
    #[arg(long, visible_alias = "level")]
    levels: Option<LevelSplit>,
    /// Other levels, such as those of a training: name the audited levels that are among them, by number, as a file,
    /// by their layout or by their play (repeatable).
    #[arg(long, value_name = "LEVELS")]
    among: Vec<LevelSplit>,
    /// Compare hashes of layouts only: do not play.
    #[arg(long)]
    layouts_only: bool,
    #[command(flatten)]
    threads: Threads,
    /// Print one line of JSON, with all levels, instead of a text.
    #[arg(long)]
    json: bool,
}

/// Groups of equal levels, and levels of a group, that are printed.
const SHOWN: usize = 10;

pub(crate) fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let levels = args.levels.clone().unwrap_or_else(|| {
        let default = default_tested(game);
        report!("no --levels are named: {default}");
        default
    });
    levels.check(game)?;
    args.among.iter().try_for_each(|others| others.check(game))?;
    check_start(game, &levels.mode, levels.first)?;
    let quicker = if args.layouts_only { "" } else { ", or with --layouts-only, which plays nothing" };
    interrupt::leave(format!("nothing is kept: call it again{quicker}"));
    interrupt::listen();
    let threads = args.threads.count();
    let (equal, compared, alike) = compare(game, &levels, args, threads);
    let of_play = alike.filter(|alike| alike.by_state);
    let among = args.among.iter().enumerate().map(|(index, others)| {
        let stop = &interrupt::asked_to_sum_up;
        let mut known = levels_in_until(&levels, &HeldOut::levels_until(game, others, stop), stop);
        known.extend(of_play.iter().flat_map(|alike| alike.among(index + 1)));
        (others.clone(), known)
    });
    let (among, plans) = (among.collect(), EqualPlans::of_until(game, &levels, &interrupt::asked_to_sum_up));
    let plain = if args.layouts_only { None } else { play(game, &levels, threads)? };
    let names = names(game, &levels);
    let audit = Audit { among, equal, compared, plans, plain, names, levels, is_stopped: interrupt::asked_to_sum_up() };
    print_line(if args.json { audit.to_json(game) } else { audit.to_text(game) })?;
    if audit.is_stopped {
        report!("{}: the same command does all of it again{quicker}", audit.progress());
        return Ok(Outcome::Stopped);
    }
    Ok(if audit.is_clean() { Outcome::Pass } else { Outcome::Findings })
}

/// Compares levels by their layouts, or by their play if the game does not hash them, until Ctrl-C is pressed. Returns the
/// number of compared levels as well. The play is also that of the other sets.
fn compare(game: &dyn Game, levels: &LevelSplit, args: &Args, threads: usize) -> (Equality, u64, Option<AlikeLevels>) {
    if let Some((equal, compared)) = EqualLevels::of_until(game, levels, &interrupt::asked_to_sum_up) {
        return (Equality::Layouts(equal), compared, None);
    }
    if args.layouts_only {
        return (Equality::Unknown, 0, None);
    }
    let ranges: Vec<(&str, Vec<u64>)> = std::iter::once(levels)
        .chain(&args.among)
        .map(|levels| (levels.mode.as_str(), levels.levels().collect()))
        .collect();
    // Groups of the other sets alone do not count.
    let is_wanted = |group: &[PlacedLevel]| group.iter().any(|(range, _)| *range == 0);
    let alike = progress::comparing(|progress| {
        AlikeLevels::of(game, &ranges, is_wanted, threads, progress, &interrupt::asked_to_sum_up)
    });
    let equal = EqualLevels::of_alike(&alike);
    let equality = match (equal.layouts, alike.by_state) {
        (0, _) => Equality::Unknown,
        (_, true) => Equality::States(equal),
        (_, false) => Equality::Observations(equal),
    };
    (equality, levels.len() - alike.unfinished, Some(alike))
}

/// Returns the names of levels that have any: the path of a file, or the name in a level editor.
fn names(game: &dyn Game, levels: &LevelSplit) -> BTreeMap<u64, String> {
    let (tools, mode) = (game.tools().levels, levels.mode.as_str());
    let name = |level: u64| {
        let of_file = || is_level_files(mode).then(|| level_name(game, levels, level));
        tools.level_name(mode, level).or_else(of_file)
    };
    if !is_level_files(mode) && tools.level_names(mode).is_empty() {
        return BTreeMap::new();
    }
    levels.levels().filter_map(|level| Some((level, name(level)?))).collect()
}

/// Holds each action in each level; `None` if Ctrl-C was pressed.
fn play(game: &dyn Game, levels: &LevelSplit, threads: usize) -> Result<Option<PlainLevels>, CliError> {
    if interrupt::asked_to_sum_up() {
        return Ok(None);
    }
    let bar = progress::bar("hold each action", plain_episodes(game, levels), "episodes");
    let plain = PlainLevels::of_until(game, levels, threads, |episodes| bar.inc(episodes), &interrupt::asked_to_sum_up);
    bar.finish_and_clear();
    Ok(plain?)
}

/// Equal levels, and how they were found.
enum Equality {
    /// By the hashes of their layouts.
    Layouts(EqualLevels),
    /// By the state of the game, with the same actions.
    States(EqualLevels),
    /// By what agents observe, with the same actions.
    Observations(EqualLevels),
    /// Nothing was compared.
    Unknown,
}

impl Equality {
    fn levels(&self) -> Option<&EqualLevels> {
        match self {
            Self::Layouts(equal) | Self::States(equal) | Self::Observations(equal) => Some(equal),
            Self::Unknown => None,
        }
    }

    /// Returns what was compared, in a word.
    fn basis(&self) -> Option<&'static str> {
        match self {
            Self::Layouts(_) => Some("layout"),
            Self::States(_) => Some("state"),
            Self::Observations(_) => Some("observation"),
            Self::Unknown => None,
        }
    }

    /// Returns true if levels are equal in more than what agents observe.
    fn is_finding(&self) -> bool {
        !matches!(self, Self::Observations(_)) && self.levels().is_some_and(|equal| !equal.groups.is_empty())
    }

    fn in_words(&self, game: &str) -> String {
        let Some(equal) = self.levels() else {
            return format!(
                "equal levels: unknown, since {game} does not hash the layouts of these levels, and none was played"
            );
        };
        let (count, shared) = (whole(equal.layouts as f64), whole(equal.shared() as f64));
        let ticks = AlikeLevels::TICKS;
        match self {
            Self::Layouts(_) | Self::Unknown => {
                format!("layouts: {count}; {shared} of the levels share theirs with another")
            }
            Self::States(_) => format!(
                "layouts: {count}, by the state of the game in up to {ticks} ticks; {shared} of the levels share theirs with \
                 another"
            ),
            Self::Observations(_) => format!(
                "layouts: at least {count}, by what agents observe in up to {ticks} ticks; {shared} of the levels look like \
                 another, and may differ in the rest: declare `.layout` or `.state_hash` to know"
            ),
        }
    }
}

/// The results of an audit.
struct Audit {
    levels: LevelSplit,
    equal: Equality,
    /// Levels that were compared; fewer than all if the audit was stopped.
    compared: u64,
    /// `None` if the game has no floor plans.
    plans: Option<EqualPlans>,
    among: Vec<(LevelSplit, BTreeSet<u64>)>,
    /// `None` if nothing was played.
    plain: Option<PlainLevels>,
    /// Names of levels that have any.
    names: BTreeMap<u64, String>,
    /// True if Ctrl-C was pressed before all was done.
    is_stopped: bool,
}

impl Audit {
    /// Describes how far a stopped audit has come.
    fn progress(&self) -> String {
        let all = whole(self.levels.len() as f64);
        match self.compared {
            compared if compared < self.levels.len() => {
                format!("stopped; {} of {all} levels were compared", whole(compared as f64))
            }
            _ => format!("stopped; all {all} levels were compared, and the rest of the audit is missing"),
        }
    }

    fn is_clean(&self) -> bool {
        let needs_none = self.plain.iter().any(|plain| !plain.without_action.is_empty());
        !needs_none && !self.equal.is_finding() && self.among.iter().all(|(_, known)| known.is_empty())
    }

    fn to_json(&self, game: &dyn Game) -> String {
        let among = self.among.iter().map(|(others, known)| json!({ "among": others, "levels": known }));
        let by_one_action = |plain: &PlainLevels| -> Vec<_> {
            plain.by_one_action.iter().map(|(action, levels)| json!({ "action": action, "levels": levels })).collect()
        };
        json!({
            "game": game.name(),
            "levels": self.levels,
            "count": self.levels.len(),
            "stopped": self.is_stopped,
            "compared": self.compared,
            "names": self.names,
            "compared_by": self.equal.basis(),
            "layouts": self.equal.levels().map(|equal| equal.layouts),
            "equal": self.equal.levels().map(|equal| &equal.groups),
            "equal_plans": self.plans.as_ref().map(|plans| &plans.groups),
            "among": among.collect::<Vec<_>>(),
            "solved_without_action": self.plain.as_ref().map(|plain| &plain.without_action),
            "solved_by_one_action": self.plain.as_ref().map(by_one_action),
        })
        .to_string()
    }

    fn to_text(&self, game: &dyn Game) -> String {
        let count = match self.levels.len() {
            1 => "1 level".to_owned(),
            count => format!("{} levels", whole(count as f64)),
        };
        let mut lines = vec![format!("{} {}: {count}", game.name(), self.levels)];
        if self.is_stopped {
            lines.push(self.progress());
        }
        lines.push(self.equal.in_words(game.name()));
        if let Some(equal) = self.equal.levels() {
            let what = if matches!(self.equal, Equality::Observations(_)) { "alike" } else { "equal" };
            lines.extend(self.first_groups(what, &equal.groups));
        }
        if let Some(plans) = self.plans.as_ref().filter(|plans| !plans.groups.is_empty()) {
            let other =
                if matches!(self.equal, Equality::Layouts(_)) { "a level of another layout" } else { "another level" };
            let count = whole(plans.shared() as f64);
            lines.push(format!("floor plans: {count} of the levels share theirs with {other}"));
            lines.extend(self.first_groups("equal plan", &plans.groups));
        }
        for (others, known) in &self.among {
            lines.push(format!("among {others}: {}{}", whole(known.len() as f64), self.listed(known)));
        }
        if let Some(plain) = &self.plain {
            let none = &plain.without_action;
            lines.push(format!("solved without an action: {}{}", none.len(), self.listed(none)));
            let any = plain.by_any_action();
            lines.push(format!("solved by holding one action: {}", whole(any.len() as f64)));
            let by_action = plain.by_one_action.iter();
            lines.extend(
                by_action.map(|(action, levels)| format!("  {action}: {}{}", levels.len(), self.listed(levels))),
            );
        }
        lines.join("\n")
    }

    /// Describes the first groups of levels, one a line, and counts the others.
    fn first_groups(&self, what: &str, groups: &[Vec<u64>]) -> Vec<String> {
        let shown = groups.iter().take(SHOWN).map(|group| format!("  {what}: {}", self.first_few(group.iter())));
        let mut lines: Vec<String> = shown.collect();
        if groups.len() > SHOWN {
            let more = counted((groups.len() - SHOWN) as u64, "more group");
            lines.push(format!("  and {more} (--json has all)"));
        }
        lines
    }

    /// Lists the first of some levels, behind a colon.
    fn listed(&self, levels: &BTreeSet<u64>) -> String {
        if levels.is_empty() { String::new() } else { format!(": {}", self.first_few(levels.iter())) }
    }

    fn first_few<'a>(&self, levels: impl ExactSizeIterator<Item = &'a u64>) -> String {
        let more = if levels.len() > SHOWN { format!(", and {} more", levels.len() - SHOWN) } else { String::new() };
        let shown: Vec<_> = levels.take(SHOWN).map(|level| self.name(*level)).collect();
        shown.join(", ") + &more
    }

    /// Returns the number of a level, with its name in a level editor, or the path of its file.
    fn name(&self, level: u64) -> String {
        match self.names.get(&level) {
            Some(path) if is_level_files(&self.levels.mode) => path.clone(),
            Some(name) => format!("{level} {name}"),
            None => level.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::{app::App, math::Vec2};
    use playbot_harness::foreign::{EditorLevel, ForeignGame};

    #[test]
    fn levels_of_an_editor_are_named_beside_their_numbers() {
        let level = |name: &str| EditorLevel::of_rows(name, vec!["S.G".to_owned()], Vec2::ONE);
        let game = ForeignGame::new("rooms", 1, |_: &mut App| {}).editor_levels(Ok(vec![level("Hall"), level("Cave")]));
        let levels: LevelSplit = "default:0..1".parse().expect("levels");
        let audit = Audit {
            equal: Equality::Layouts(EqualLevels::of(&game, &levels).expect("layouts")),
            plans: None,
            among: vec![(levels.clone(), [1].into())],
            plain: None,
            names: names(&game, &levels),
            compared: 2,
            is_stopped: false,
            levels,
        };
        let text = audit.to_text(&game);
        assert!(text.contains("\n  equal: 0 Hall, 1 Cave\n") && text.ends_with("default:0..1: 1: 1 Cave"), "{text}");
        let json: serde_json::Value = serde_json::from_str(&audit.to_json(&game)).expect("JSON");
        assert_eq!((&json["names"]["1"], &json["compared_by"]), (&"Cave".into(), &"layout".into()));
    }

    #[test]
    fn what_is_equal_by_observations_alone_is_listed_and_no_finding() {
        let equal = EqualLevels { layouts: 1, groups: vec![vec![0, 1]] };
        let game = ForeignGame::new("cards", 1, |_: &mut App| {});
        let audit = |equal| Audit {
            levels: "default:0..1".parse().expect("levels"),
            equal,
            plans: None,
            among: Vec::new(),
            plain: None,
            names: BTreeMap::new(),
            compared: 2,
            is_stopped: false,
        };
        let observed = audit(Equality::Observations(equal.clone()));
        assert!(observed.is_clean());
        let text = observed.to_text(&game);
        let words = "layouts: at least 1, by what agents observe in up to 600 ticks; 2 of the levels look like another";
        assert!(text.contains(words) && text.contains("\n  alike: 0, 1"), "{text}");
        let known = audit(Equality::States(equal));
        assert!(!known.is_clean());
        assert!(known.to_text(&game).contains("\n  equal: 0, 1"));
        let unknown = audit(Equality::Unknown);
        assert!(
            unknown.is_clean() && unknown.to_text(&game).contains("equal levels: unknown, since cards does not hash")
        );
    }

    #[test]
    fn a_stopped_audit_says_how_far_it_came_and_shows_what_it_has_found() {
        let game = ForeignGame::new("cards", 1, |_: &mut App| {});
        let mut audit = Audit {
            levels: "default:0..1999".parse().expect("levels"),
            equal: Equality::Layouts(EqualLevels { layouts: 1199, groups: vec![vec![3, 1000]] }),
            compared: 1200,
            plans: None,
            among: Vec::new(),
            plain: None,
            names: BTreeMap::new(),
            is_stopped: true,
        };
        let text = audit.to_text(&game);
        let wanted = "cards default:0..1999: 2,000 levels\nstopped; 1,200 of 2,000 levels were compared\n\
                      layouts: 1,199; 2 of the levels share theirs with another\n  equal: 3, 1000";
        assert_eq!(text, wanted);
        let json: serde_json::Value = serde_json::from_str(&audit.to_json(&game)).expect("JSON");
        assert_eq!((&json["stopped"], &json["compared"], &json["count"]), (&true.into(), &1200.into(), &2000.into()));
        audit.compared = 2000;
        let words = "\nstopped; all 2,000 levels were compared, and the rest of the audit is missing\n";
        assert!(audit.to_text(&game).contains(words), "{}", audit.to_text(&game));
    }
}
