//! `playbot levels`.

use crate::{
    arguments::{Threads, check_start, default_held_out, first_levels},
    error::{CliError, Outcome},
    output::print_line,
    progress,
    progress::{interrupt, interrupt::NothingToSave},
};
use playbot_harness::{
    game::Game,
    games::Games,
    level_audit::{EqualLevels, EqualPlans, PlainLevels, levels_in, plain_episodes},
    split::LevelSplit,
};
use playbot_report::{counted, whole};
use serde_json::json;
use std::collections::BTreeSet;

/// Audit a set of levels: equal ones, those of another set, and those that need no player.
///
/// Two levels are equal if their layouts are: all that play meets, without pictures. Different numbers, or a number and
/// a file, can have one layout. Levels of different layouts may share their floor plan: their difference is not drawn,
/// which is no finding. Then each level is played once with each action, held from the start to the end. That
/// shows the levels that are solved without an action, and those that one held action solves.
///
/// Exit code 1 if levels are equal, among those of another set, or solved without an action.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot levels GAME --levels MODE:0..99
  playbot levels GAME --levels MODE:64..127 --among MODE:0..63
  playbot levels GAME --levels 'files:levels/*.json' --json
  playbot levels GAME --levels MODE:0..9999 --layouts-only")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included, or files:pattern, such as "files:levels/*.json" (default: the
    /// held-out levels of the game's experiment).
    #[arg(long)]
    levels: Option<LevelSplit>,
    /// Other levels, such as those of a training: name the audited levels that are among them, by number, as a file or
    /// by their layout (repeatable).
    #[arg(long, value_name = "LEVELS")]
    among: Vec<LevelSplit>,
    /// Compare layouts only: do not play.
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
        let default = default_held_out(game).unwrap_or_else(|| first_levels(game, 63));
        report!("no --levels are named: {default}");
        default
    });
    levels.check(game)?;
    args.among.iter().try_for_each(|others| others.check(game))?;
    check_start(game, &levels.mode, levels.first)?;
    interrupt::leave("nothing is kept: call it again".to_owned());
    let _nothing = NothingToSave::listen();
    let audit = Audit {
        equal: EqualLevels::of(game, &levels),
        plans: EqualPlans::of(game, &levels),
        among: args.among.iter().map(|others| (others.clone(), levels_in(game, &levels, others))).collect(),
        plain: (!args.layouts_only).then(|| play(game, &levels, args.threads.count())).transpose()?,
        levels,
    };
    print_line(if args.json { audit.to_json(game) } else { audit.to_text(game) })?;
    Ok(if audit.is_clean() { Outcome::Pass } else { Outcome::Findings })
}

fn play(game: &dyn Game, levels: &LevelSplit, threads: usize) -> Result<PlainLevels, CliError> {
    let bar = progress::bar("hold each action", plain_episodes(game, levels), "episodes");
    let plain = PlainLevels::of(game, levels, threads, |episodes| bar.inc(episodes));
    bar.finish_and_clear();
    Ok(plain?)
}

/// The results of an audit.
struct Audit {
    levels: LevelSplit,
    /// `None` if the game does not compare layouts.
    equal: Option<EqualLevels>,
    /// `None` if the game has no floor plans.
    plans: Option<EqualPlans>,
    among: Vec<(LevelSplit, BTreeSet<u64>)>,
    /// `None` if nothing was played.
    plain: Option<PlainLevels>,
}

impl Audit {
    fn is_clean(&self) -> bool {
        let needs_none = self.plain.iter().any(|plain| !plain.without_action.is_empty());
        let is_equal = self.equal.iter().any(|equal| !equal.groups.is_empty());
        !needs_none && !is_equal && self.among.iter().all(|(_, known)| known.is_empty())
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
            "layouts": self.equal.as_ref().map(|equal| equal.layouts),
            "equal": self.equal.as_ref().map(|equal| &equal.groups),
            "equal_plans": self.plans.as_ref().map(|plans| &plans.groups),
            "among": among.collect::<Vec<_>>(),
            "solved_without_action": self.plain.as_ref().map(|plain| &plain.without_action),
            "solved_by_one_action": self.plain.as_ref().map(by_one_action),
        })
        .to_string()
    }

    fn to_text(&self, game: &dyn Game) -> String {
        let mut lines = vec![format!("{} {}: {} levels", game.name(), self.levels, whole(self.levels.len() as f64))];
        match &self.equal {
            None => lines.push(format!(
                "equal levels: unknown, since {} does not compare the layouts of these levels",
                game.name()
            )),
            Some(equal) => {
                lines.push(format!(
                    "layouts: {}; {} of the levels share theirs with another",
                    whole(equal.layouts as f64),
                    whole(equal.shared() as f64)
                ));
                lines.extend(first_groups("equal", &equal.groups));
            }
        }
        if let Some(plans) = self.plans.as_ref().filter(|plans| !plans.groups.is_empty()) {
            let other = if self.equal.is_some() { "a level of another layout" } else { "another level" };
            let count = whole(plans.shared() as f64);
            lines.push(format!("floor plans: {count} of the levels share theirs with {other}"));
            lines.extend(first_groups("equal plan", &plans.groups));
        }
        for (others, known) in &self.among {
            lines.push(format!("among {others}: {}{}", whole(known.len() as f64), listed(known)));
        }
        if let Some(plain) = &self.plain {
            let none = &plain.without_action;
            lines.push(format!("solved without an action: {}{}", none.len(), listed(none)));
            let any = plain.by_any_action();
            lines.push(format!("solved by holding one action: {}", whole(any.len() as f64)));
            let by_action = plain.by_one_action.iter();
            lines.extend(by_action.map(|(action, levels)| format!("  {action}: {}{}", levels.len(), listed(levels))));
        }
        lines.join("\n")
    }
}

/// Describes the first groups of levels, one a line, and counts the others.
fn first_groups(what: &str, groups: &[Vec<u64>]) -> Vec<String> {
    let shown = groups.iter().take(SHOWN).map(|group| format!("  {what}: {}", first_few(group.iter())));
    let mut lines: Vec<String> = shown.collect();
    if groups.len() > SHOWN {
        let more = counted((groups.len() - SHOWN) as u64, "more group");
        lines.push(format!("  and {more} (--json has all)"));
    }
    lines
}

/// Lists the first of some levels, behind a colon.
fn listed(levels: &BTreeSet<u64>) -> String {
    if levels.is_empty() { String::new() } else { format!(": {}", first_few(levels.iter())) }
}

fn first_few<'a>(levels: impl ExactSizeIterator<Item = &'a u64>) -> String {
    let more = if levels.len() > SHOWN { format!(", and {} more", levels.len() - SHOWN) } else { String::new() };
    let shown: Vec<_> = levels.take(SHOWN).map(u64::to_string).collect();
    shown.join(", ") + &more
}
