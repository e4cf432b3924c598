//! `playbot explore`.
//!
//! - `results`: the recording of a path that was found, the picture of the cells, and a policy's cells beside them.

mod results;

use crate::{
    arguments::{
        Compute, at_least_one_step, check_start, default_experiment_of,
        experiment::ExperimentArgs,
        first_levels,
        player::{LoadedPlayer, check_skills},
        report_agents_along,
    },
    error::{CliError, Outcome},
    output,
    output::print_line,
    pictures::plot::{PlotFile, without_plan},
    progress,
    progress::interrupt,
    verbs::explore::results::{Beside, PlayedBeside, RecordingFile, chart},
};
use bevy_playbot::{placement::TickPlacement, policy::ActionDraw, skill_prior::SkillPrior, vision::ObservationConfig};
use playbot_harness::{
    eval::Player,
    game::Game,
    games::Games,
    split::{LevelSplit, SplitError},
};
use playbot_learner::{DeviceKind, ScoreConfig, SkillDraw, SkillModel, SkillSource};
use playbot_report::counted;
use playbot_test::explore::{
    Exploration, ExplorationSummary, ExplorePlan, ExploredCell, Explorer, Route, Stop, Until, explore_until,
    round::check_cell,
};
use serde_json::json;
use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Explore a level without training: print the reachable cells and the actions that lead there.
///
/// The method is Go-Explore (Ecoffet et al. 2021): return to seldom seen cells by the same actions, and explore from
/// there. Cells are squares of the level where the game gives positions of agents, else observations that are alike.
/// Skills or a policy explore instead of random actions if given. If the game does not play the same by the same
/// actions, the first tick that differs is printed. Ctrl-C ends it with what is known by then.
///
/// Exit code 1 if the level has a goal and no path to it was found, or if the cell of --cell was not reached.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot explore GAME
  playbot explore GAME --level MODE:7 --steps 1000000 --png reached.png
  playbot explore GAME --level MODE:7 --until solved --out solution.demo
  playbot explore GAME --level MODE:7 --skills skills.safetensors --json
  playbot explore GAME --level MODE:7 --until spent --cell 3,4 --out there.demo
  playbot explore GAME --level MODE:7 --beside runs/curious --png both.png")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Level, as mode:number, as a number of the mode that `train` trains in, or by its name in a level editor (default:
    /// level 0 of that mode).
    #[arg(long, value_name = "MODE:N", value_parser = one_level)]
    level: Option<LevelSplit>,
    /// Environment steps to use, including returns to known cells. A round of visits begins if there are steps for
    /// --explore-ticks each, and a visit that goes on finding cells takes up to ten times as many. So the last round may
    /// take up to 9 × --batch × --explore-ticks more (28,800 by default), and --steps 3000 may become 12,000.
    #[arg(long, default_value_t = 500_000, value_parser = at_least_one_step)]
    steps: u64,
    /// End earlier: solved (a path to the goal is found), covered (every open cell is reached, too), or spent (never).
    /// For covered the number of open cells must be known. Or exhausted: every action was tried from every cell. Use
    /// spent to find shorter paths.
    #[arg(long, default_value_t, value_name = "WHEN")]
    until: Until,
    /// Skill model: explores with skills drawn from its prior.
    #[arg(long, value_name = "FILE", group = "explorer")]
    skills: Option<PathBuf>,
    /// Policy file, as written by `playbot policy export`: explores with the policy.
    #[arg(long, value_name = "FILE", group = "explorer")]
    policy: Option<PathBuf>,
    /// Ticks without anything new after which a visit ends.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    explore_ticks: u32,
    /// Probability that a random action is repeated in the next tick. Its keys stay held, so a game that reads
    /// `just_pressed` acts once: 0 chooses anew in each tick.
    #[arg(long, default_value_t = 0.95)]
    sticky: f64,
    /// Side of a cell in units of the level (default: one tile). For cells of observations, the step to which values
    /// are rounded (default: 1/8).
    #[arg(long, value_name = "LENGTH")]
    cell_size: Option<f32>,
    /// Visits between two updates of the known cells.
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..))]
    batch: u32,
    /// Return to known cells by replays alone, even if the game saves its state.
    #[arg(long)]
    no_snapshots: bool,
    /// Random seed.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// Record the shortest solution, or the path to --cell, into this .demo, once it has been replayed.
    #[arg(long, value_name = "FILE", value_parser = output::demo)]
    out: Option<PathBuf>,
    /// Record and draw the path to this cell instead of the solution. Cells are named by their numbers, such as 3,4.
    #[arg(long, value_name = "CELL", allow_hyphen_values = true)]
    cell: Option<ExploredCell>,
    /// Run, or policy file: also play its policy from the start of the level, for as many ticks as the exploration took,
    /// and count the cells that it reaches. With --png they are drawn beside those of the explorer.
    #[arg(long, value_name = "RUN")]
    beside: Option<PathBuf>,
    /// Overwrite an existing recording.
    #[arg(long, requires = "out")]
    force: bool,
    /// Draw the reached cells, and how often each was reached, on the floor plan of the level.
    #[arg(long, value_name = "FILE", value_parser = output::png)]
    png: Option<PathBuf>,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    report_agents_along(game);
    let split = level(game, args.level.as_ref())?;
    split.check(game)?;
    let device = args.compute.device();
    let ExplorerSetup { explorer, observation_config } = match (&args.skills, &args.policy) {
        (Some(path), _) => ExplorerSetup::skills(path, game, games, device)?,
        (None, Some(path)) => ExplorerSetup::policy(path, game, device)?,
        (None, None) => ExplorerSetup::none(),
    };
    let plan = plan(&args, &split, explorer, observation_config);
    plan.check(game)?;
    if let Some(cell) = &args.cell
        && !check_cell(game, &plan, cell)?
    {
        report!("warning: by the level's plan, cell {cell} is a wall, or walls cut it off from the start");
    }
    let beside = args.beside.as_deref().map(|path| Beside::load(path, game, device)).transpose()?;
    let recording = args.out.as_deref().map(|path| RecordingFile::new(path, args.force)).transpose()?;
    let floor = match &args.png {
        None => None,
        Some(path) => {
            let floor_plan = game.tools().levels.floor_plan(&split.mode, split.first);
            let floor_plan = floor_plan.ok_or_else(|| without_plan(game, &shown(&split), "--png"))?;
            Some((PlotFile::new(path)?, floor_plan))
        }
    };
    check_start(game, &split.mode, split.first)?;
    let begin = Instant::now();
    let exploration = search(game, &plan)?;
    if let Some(fault) = &exploration.snapshot_fault {
        report!("warning: {fault}");
    }
    if let Some(obstacle) = &exploration.snapshot_obstacle {
        report!("warning: `{}` was explored by replays, since snapshots are not possible: {obstacle}", game.name());
    }
    report!("{}", pace(&exploration, begin.elapsed()));
    if exploration.has_goal && exploration.solution_ticks().is_none() && repeats_keys(game, &plan) {
        report!(
            "tip: --sticky {} repeats an action with its keys held, and a game that reads `just_pressed` acts once: \
             --sticky 0 chooses anew in each tick",
            plan.sticky
        );
    }
    let to_cell = args.cell.as_ref().map(|cell| (cell, exploration.route_to(cell)));
    // What was explored is printed and kept, even if nothing can be set beside it.
    let (played, beside_fault) = match beside.as_ref().map(|beside| beside.play(game, &exploration)).transpose() {
        Ok(played) => (played, None),
        Err(error) => (None, Some(error)),
    };
    print(&exploration.summary(game), to_cell.as_ref(), played.as_ref(), args.json)?;
    let is_missed = matches!(to_cell, Some((_, None)));
    let route = match to_cell {
        Some((_, route)) => route,
        None => exploration.solution(),
    };
    let route = route.filter(|route| !route.is_empty());
    // Last, so that the result is not lost because it cannot be written.
    if let Some(recording) = recording {
        match &route {
            Some(route) => {
                recording.write(game, &exploration, route)?;
                report!("recorded: {}, {}", recording.path().display(), counted(route.len() as u64, "tick"));
            }
            None => report!("nothing is recorded: {}", why_nothing(args.cell.as_ref(), is_missed)),
        }
    }
    if let Some((file, floor_plan)) = floor {
        let drawing = chart(game, floor_plan.clone(), &exploration, route.as_ref())?.draw();
        file.write(&match &played {
            Some(played) => played.draw_beside(drawing, floor_plan, &exploration),
            None => drawing,
        })?;
        report!("drawn: {}", file.path().display());
    }
    if let Some(error) = beside_fault {
        return Err(error);
    }
    Ok(match (exploration.stop, exploration.solution_ticks()) {
        (Stop::Asked, _) => Outcome::Stopped,
        (_, None) if exploration.has_goal => Outcome::Findings,
        _ if is_missed => Outcome::Findings,
        _ => Outcome::Pass,
    })
}

/// Prints the result, for the cell of `--cell` how soon it is reached, and the cells of the policy of `--beside`.
fn print(
    summary: &ExplorationSummary,
    to_cell: Option<&(&ExploredCell, Option<Route>)>,
    played: Option<&PlayedBeside<'_>>,
    as_json: bool,
) -> Result<(), CliError> {
    let ticks = to_cell.map(|(cell, route)| (cell, route.as_ref().map(|route| route.len())));
    if as_json {
        let mut line = serde_json::to_value(summary)
            .map_err(|error| CliError::Io(format!("the summary cannot be written as JSON: {error}")))?;
        if let Some((cell, ticks)) = ticks {
            line["cell"] = json!({ "cell": cell.to_string(), "ticks": ticks });
        }
        if let Some(played) = played {
            line["beside"] = played.json()?;
        }
        return print_line(line);
    }
    print_line(summary)?;
    if let Some(played) = played {
        print_line(played.line())?;
    }
    match ticks {
        None => Ok(()),
        Some((cell, Some(ticks))) => print_line(format!("cell {cell} is reached in {}", counted(ticks as u64, "tick"))),
        Some((cell, None)) => {
            print_line(format!("cell {cell} was not reached: a larger --steps or --until spent looks for it longer"))
        }
    }
}

/// Returns the named level, or the first one.
fn level(game: &dyn Game, named: Option<&LevelSplit>) -> Result<LevelSplit, CliError> {
    match named {
        None => {
            let default = first_levels(game, 0);
            report!("no --level is named: {}", shown(&default));
            Ok(default)
        }
        Some(split) if split.len() == 1 => Ok(split.clone()),
        Some(split) => Err(CliError::Usage(format!(
            "--level is {split}, which are {} levels: one at a time is explored, such as {}:{}",
            split.len(),
            split.mode,
            split.first
        ))),
    }
}

fn shown(split: &LevelSplit) -> String {
    format!("{}:{}", split.mode, split.first)
}

fn plan(args: &Args, split: &LevelSplit, explorer: Explorer, observation_config: ObservationConfig) -> ExplorePlan {
    ExplorePlan {
        steps: args.steps,
        until: args.until,
        explorer,
        observation_config,
        explore_ticks: args.explore_ticks,
        sticky: args.sticky,
        cell_size: args.cell_size,
        batch: args.batch,
        seed: args.seed,
        snapshots: !args.no_snapshots,
        threads: args.compute.threads(),
        ..ExplorePlan::new(split.mode.clone(), split.first)
    }
}

/// Explores, with a progress bar, until it is done or Ctrl-C is pressed.
fn search(game: &dyn Game, plan: &ExplorePlan) -> Result<Exploration, CliError> {
    interrupt::listen();
    let bar = progress::bar("explore", plan.steps, "steps");
    let explored = explore_until(
        game,
        plan,
        |ticks| bar.inc(ticks),
        |round| {
            let solved = round
                .solution
                .map_or_else(String::new, |ticks| format!(", solved in {}", counted(ticks.into(), "tick")));
            bar.set_message(format!("{}{solved}", counted(round.cells as u64, "cell")));
            ControlFlow::Continue(())
        },
        // What is known is then recorded and drawn.
        &interrupt::asked_to_sum_up,
    );
    bar.finish_and_clear();
    Ok(explored?)
}

/// Returns whether random actions hold keys for many ticks.
fn repeats_keys(game: &dyn Game, plan: &ExplorePlan) -> bool {
    let presses = game.tools().host.placement() == TickPlacement::Frame;
    presses && matches!(plan.explorer, Explorer::Random) && plan.sticky >= 0.5
}

/// Returns how fast the exploration was, and what snapshots have saved. The speed differs from run to run, so it is no
/// part of the result.
fn pace(exploration: &Exploration, time: Duration) -> String {
    let (cells, seconds) = (exploration.cells().len(), time.as_secs_f64());
    let restored = 100.0 * exploration.restored_steps as f64 / exploration.steps.max(1) as f64;
    format!(
        "{} in {seconds:.1} s, {:.0} a second; snapshots restored {restored:.0} % of the steps",
        counted(cells as u64, "cell"),
        cells as f64 / seconds.max(1e-9)
    )
}

fn why_nothing(cell: Option<&ExploredCell>, is_missed: bool) -> String {
    match cell {
        Some(cell) if is_missed => format!("cell {cell} was not reached"),
        Some(cell) => format!("the level starts in cell {cell}"),
        None => "no solution was found; with --cell the path to a cell is recorded".to_owned(),
    }
}

/// Parses a level.
///
/// # Errors
///
/// The text is no level; the message shows the form of one.
pub(crate) fn one_level(text: &str) -> Result<LevelSplit, String> {
    text.parse::<LevelSplit>().map_err(|error| match error {
        SplitError::NotARange(_) => {
            // Numbers and files are no modes.
            let is_file = text.contains(['.', '/', '\\']);
            let is_mode = |mode: &&str| mode.starts_with(char::is_alphabetic) && !is_file;
            let mode = text.split(':').next().filter(is_mode).unwrap_or("MODE");
            let file = match (is_file, text.ends_with(".json")) {
                (_, true) => format!(", or files:{text}"),
                (true, false) => ", or a level file, which is JSON, such as files:levels/a.json".to_owned(),
                (false, false) => String::new(),
            };
            format!("`{text}` names no level: write its mode and its number, such as {mode}:7{file}")
        }
        other => other.to_string(),
    })
}

// The explorers that a user can ask for: random actions, skills of a model, or a policy.

/// An explorer and its observation.
pub struct ExplorerSetup {
    pub explorer: Explorer,
    pub observation_config: ObservationConfig,
}

impl ExplorerSetup {
    /// Returns an explorer with random actions.
    pub fn none() -> Self {
        Self { explorer: Explorer::Random, observation_config: ObservationConfig::default() }
    }

    /// Skills of a model, drawn from its prior, with the skill interval of the game's experiment.
    ///
    /// # Errors
    ///
    /// The model cannot be read, or was learned for another game.
    pub fn skills(path: &Path, game: &dyn Game, games: &Games, device: DeviceKind) -> Result<Self, CliError> {
        let model = SkillModel::load(path, device)?;
        // The game is named, so that errors do not ask for an experiment.
        let named = ExperimentArgs::of_game(game.name());
        let observation_config = check_skills(path, &model, game, &named, games)?;
        let skill_interval = default_experiment_of(game)
            .map_or_else(ScoreConfig::default, |default| default.experiment.score)
            .skill_interval;
        let source =
            SkillSource { prior: model.prior(), decoder: model.policy(), skill_interval, draw: SkillDraw::Sample };
        Ok(Self { explorer: Explorer::skills(SkillPrior::from(&source), source.decoder), observation_config })
    }

    /// Returns the policy of a file, whose actions are drawn.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn policy(path: &Path, game: &dyn Game, device: DeviceKind) -> Result<Self, CliError> {
        let chosen = LoadedPlayer::policy_file(game, path, ActionDraw::Sample, device)?;
        chosen.check_fit(game)?;
        let explorer = match chosen.player {
            Player::Policy { policy, prior, draw } => Explorer::Policy { policy, prior, draw },
            Player::Blind(_) | Player::Demonstrator | Player::Scripted(_) => Explorer::Random,
        };
        Ok(Self { explorer, observation_config: chosen.observation_config })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::prelude::App;
    use playbot_harness::foreign::ForeignGame;

    #[test]
    fn levels_are_read_and_others_are_refused_with_an_example() {
        assert_eq!(one_level("plain:7").map(|level| (level.first, level.len())), Ok((7, 1)));
        for (text, example) in [
            ("plain", "plain:7"),
            ("plain:x", "plain:7"),
            ("", "MODE:7"),
            (":3", "MODE:7"),
            ("7", "MODE:7"),
            ("levels/a.json", "MODE:7, or files:levels/a.json"),
            ("C:\\levels\\a.json", "MODE:7, or files:C:\\levels\\a.json"),
            ("a.txt", "MODE:7, or a level file, which is JSON, such as files:levels/a.json"),
        ] {
            let error = one_level(text).expect_err(text);
            assert!(error.contains(&format!("`{text}` names no level")) && error.ends_with(example), "{error}");
        }
        assert!(one_level("plain:9..3").is_err_and(|error| error.contains("write plain:3..9")));
    }

    #[test]
    fn keys_are_held_by_random_actions_that_are_mostly_repeated() {
        let game = ForeignGame::new("walk", 1, |_: &mut App| {});
        let plan = |sticky| ExplorePlan { sticky, ..ExplorePlan::new("default", 0) };
        assert_eq!([0.95, 0.0].map(|sticky| repeats_keys(&game, &plan(sticky))), [true, false]);
    }
}
