//! `playbot eval`.

mod matches;

use crate::{
    arguments::{
        Compute, check_start, default_held_out,
        experiment::{ExperimentArgs, include_seen, option},
        first_levels, name_in_list, open, player,
        player::{LoadedPlayer, MeasuredLevels, RivalArgs, action_draw, check_run_of, check_skills},
    },
    error::{CliError, Outcome},
    output::print_line,
    pictures::plot::Footprints,
    progress::{interrupt, interrupt::NothingToSave},
    verbs::eval::matches::Opposition,
};
use bevy_playbot::vision::{ObservationConfig, ObservationKind};
use playbot_harness::{
    eval::{AtLeast, EvalPlan, Player},
    game::Game,
    games::{Artifact, Games},
    held_out::{HeldOut, KnownLevels},
    mode::ModeError,
    split::LevelSplit,
};
use playbot_report::{counted, to_text_table};
use playbot_train::{Experiment, checkpoint::CheckpointChoice, learn_skills::behaviour_cloning, run_dir::RunDir};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Measure policies and baselines, every level equally often.
///
/// Measured are trained runs, behaviour cloning, policy files and bots, on the held-out levels. Those of a layout that a
/// player has learned from, under any number or as a file, are left out and counted. The table's ± is one standard error
/// of the mean return over levels. More levels make it smaller, more episodes on the same levels make little difference.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot eval --run runs/first
  playbot eval --bot BOT --bot random --levels MODE:0..63 --json
  playbot eval --bot BOT --levels 'files:levels/**/*.json'
  playbot eval GAME --bot BOT --levels MODE:0..63
  playbot eval --skills skills.safetensors
  playbot eval --run runs/pixels --observation camera
  playbot eval --run runs/first --bot random --levels MODE:64..66 --plot where.png
  playbot eval --run runs/first --bot BOT --levels MODE:64..127 --levels MODE:500..599
  playbot eval --run runs/first --include-seen
  playbot eval --run runs/first --rival BOT --levels MODE:1000..1255
  playbot eval --policy bot.policy --at-least success=0.9 --at-least return=8")]
pub struct Args {
    /// Folder of a run (repeatable).
    #[arg(long)]
    run: Vec<PathBuf>,
    /// Checkpoint of the runs: last, best (highest return in training, or rating against
    /// rivals), or its number of environment steps.
    #[arg(long, default_value = "last")]
    checkpoint: CheckpointChoice,
    /// Skill model: measures behaviour cloning, the decoder under the prior.
    #[arg(long)]
    skills: Vec<PathBuf>,
    /// Policy file, as written by `playbot policy export`. It names its game (repeatable).
    #[arg(long)]
    policy: Vec<PathBuf>,
    /// Bot of the game, such as random. An unknown name lists all. Repeatable, or separated by commas.
    #[arg(long, value_delimiter = ',', value_parser = name_in_list)]
    bot: Vec<String>,
    /// Sensor for policies that read pictures: camera or raster (default: the one that the policy was trained with).
    #[arg(long)]
    observation: Option<ObservationKind>,
    /// Levels, as mode:first..last, both included, as files:pattern, such as "files:levels/**/*.json", or by their names in
    /// a level editor (repeatable). Default: the experiment's held-out levels, or those of the game's own experiment if a
    /// policy file is of another game than the experiment.
    #[arg(long, visible_alias = "level")]
    levels: Vec<LevelSplit>,
    /// Leave out levels of a layout that some player has learned from, under any number. Held-out levels are measured so
    /// by default.
    #[arg(long)]
    new_layouts: bool,
    /// Measure held-out levels of a layout that some player has learned from with the others. Rows count them.
    #[arg(long, conflicts_with = "new_layouts")]
    include_seen: bool,
    /// Episodes on each level, instead of the experiment's.
    #[arg(long, visible_alias = "episodes")]
    episodes_per_level: Option<u32>,
    /// Take the most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
    #[command(flatten)]
    against: RivalArgs,
    #[command(flatten)]
    from: ExperimentArgs,
    /// Random seed of the players' draws, instead of the experiment's.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// Also draw the players' paths, and how often they were at each position, into this .png or .svg.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Smallest value of a measure: success=0.9, a share of the episodes, or return=8.5 (repeatable). Exit code 1 if a
    /// player is below it on a range of levels.
    #[arg(long, value_name = "MEASURE=N")]
    at_least: Vec<AtLeast>,
    /// One line of JSON per player and range of levels.
    #[arg(long)]
    json: bool,
}

/// The part of a stopped measurement that remains.
const KEPT_LINES: &str = "the printed rows are complete, and nothing else is kept: measure the rest again";

const KEPT_NOTHING: &str = "no measurement is kept: call it again";

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    if args.run.is_empty() && args.skills.is_empty() && args.policy.is_empty() && args.bot.is_empty() {
        return Err(CliError::Usage(
            "no player to measure: name a --run, a --skills file, a --policy or a --bot (see `playbot eval --help`)"
                .to_owned(),
        ));
    }
    let experiment = read_experiment(&args, games)?;
    let game = match (&args.from.experiment, args.run.first()) {
        (None, Some(run)) => games.of_file(Artifact::Run, run, &experiment.game)?,
        _ => args.from.find_game(games, &experiment)?,
    };
    let splits = if args.levels.is_empty() { vec![experiment.test.clone()] } else { args.levels.clone() };
    if args.levels.is_empty() {
        let or_levels = |error| CliError::Usage(format!("{error}, or with --levels"));
        experiment.check_test(game).map_err(or_levels)?;
    }
    splits.iter().try_for_each(|split| split.check(game).map_err(|error| misfit(&error, split, games)))?;
    // Checked before anything is measured.
    let plan_of = |split| experiment.eval_plan(split, args.compute.threads());
    splits.iter().try_for_each(|split| plan_of(split).check_memory())?;
    check_start(game, &splits[0].mode, splits[0].first)?;
    let (players, known) = players(game, &experiment, &splits, &args, games)?;
    let known = known_levels(game, &splits, known, &args, experiment.eval.include_seen)?;
    let opposition = opposition(game, &experiment, &splits, &players, &args)?;
    let kept = if args.json { KEPT_LINES } else { KEPT_NOTHING };
    interrupt::leave(kept.to_owned());
    let measuring = NothingToSave::listen();
    let mut footprints = args.plot.as_deref().map(|path| Footprints::new(path, game, &splits)).transpose()?;
    let (mut rows, mut shortfalls) = (Vec::new(), Vec::new());
    for (split, known) in splits.iter().zip(&known) {
        for LoadedPlayer { name, player, observation_config, .. } in &players {
            let observation_config = *observation_config;
            let plan = EvalPlan { observation_config, left_out: known.left_out.clone(), ..plan_of(split) };
            if let Some(opposition) = &opposition {
                shortfalls.extend(opposition.measure(game, (name, player), &plan, &args.at_least, args.json)?);
                continue;
            }
            let mut measured = match &mut footprints {
                Some(footprints) => {
                    let (measured, trails) = player::follow(game, name, player, &plan)?;
                    footprints.add(game, split, name, trails);
                    measured
                }
                None => player::measure(game, name, player, &plan)?,
            };
            (measured.summary.seen, measured.summary.layouts) = (known.seen, known.layouts);
            if args.json {
                player::print_json(&measured.summary)?;
            }
            shortfalls.extend(args.at_least.iter().filter_map(|bound| bound.shortfall(&measured.summary)));
            rows.push(measured.into_row());
        }
    }
    drop(measuring);
    if !args.json && opposition.is_none() {
        print_line(to_text_table(&rows))?;
    }
    // Last, so that a measurement is not lost because it cannot be drawn.
    if let Some(footprints) = footprints {
        footprints.write(game)?;
    }
    shortfalls.iter().for_each(|shortfall| report!("{shortfall}"));
    Ok(if shortfalls.is_empty() { Outcome::Pass } else { Outcome::Findings })
}

/// Returns the rival of all players, if one is named.
fn opposition(
    game: &dyn Game,
    experiment: &Experiment,
    splits: &[LevelSplit],
    players: &[LoadedPlayer],
    args: &Args,
) -> Result<Option<Opposition>, CliError> {
    let Some(first) = splits.first().filter(|_| args.against.rival.is_some()) else { return Ok(None) };
    if args.plot.is_some() {
        return Err(CliError::Usage("--plot draws no matches: leave it out, or --rival".to_owned()));
    }
    if let Some(player) = players.iter().find(|player| player.observation_config.is_image()) {
        let name = &player.name;
        return Err(CliError::Usage(format!(
            "{name} sees pictures, and matches are played by vectors: leave it out, or --rival"
        )));
    }
    let is_policy = args.against.rival.as_deref().is_some_and(|name| Player::bot(game, name).is_err());
    let draw = action_draw(is_policy && (args.greedy || experiment.eval.greedy), is_policy)?;
    let rival = args.against.load(game, &first.mode, draw, args.compute.device())?;
    let seat = args.against.seat(game)?;
    Ok(rival.map(|rival| Opposition { rival, seat }))
}

/// Decides whether known levels are measured: not if they are held out, and with --new-layouts in no range. All players
/// are measured on the same levels.
fn known_levels(
    game: &dyn Game,
    splits: &[LevelSplit],
    known: Vec<BTreeSet<u64>>,
    args: &Args,
    include_seen: bool,
) -> Result<Vec<KnownLevels>, CliError> {
    let keeps_all = !args.new_layouts && (!args.levels.is_empty() || include_seen);
    for (split, known) in splits.iter().zip(&known).filter(|(_, known)| !known.is_empty()) {
        let (is, it) = if known.len() == 1 { ("is", "it") } else { ("are", "them") };
        let levels = format!("{} of {split} {is}", counted(known.len() as u64, "level"));
        if keeps_all && include_seen {
            report!(
                "{levels} measured with the others, though no unseen {}",
                if known.len() == 1 { "one" } else { "ones" }
            );
        } else if keeps_all {
            report!("{levels} measured with the others: --new-layouts leaves {it} out");
        } else if known.len() as u64 == split.len() {
            let or_all = if args.levels.is_empty() { ", or measure them with --include-seen" } else { "" };
            return Err(CliError::Usage(format!(
                "the players know every one of the levels {split}: name others with --levels{or_all}"
            )));
        } else {
            report!("{levels} left out");
        }
    }
    let of_range = |(split, known)| HeldOut::levels_of(game, split).without(known, keeps_all);
    Ok(splits.iter().zip(known).map(of_range).collect())
}

/// Returns the error of levels of a mode that the game does not have. It names the games that have it.
fn misfit(error: &ModeError, split: &LevelSplit, games: &Games) -> CliError {
    let others: Vec<_> = games.iter().filter(|other| split.check(*other).is_ok()).map(Game::name).collect();
    CliError::Usage(match others.first() {
        Some(first) => {
            let others = others.join(", ");
            format!("{error}; it is one of {others}: name the game, as in `playbot eval {first}`")
        }
        None => error.to_string(),
    })
}

fn read_experiment(args: &Args, games: &Games) -> Result<Experiment, CliError> {
    let of_sight = |set: &&String| ["observation", "image"].iter().any(|key| set.trim_start().starts_with(key));
    if let Some(set) = args.from.set.iter().find(of_sight) {
        return Err(CliError::Usage(format!(
            "`{set}`: a policy keeps its observation; take another sensor for the same pictures with \
             --observation camera or --observation raster"
        )));
    }
    let options = [
        option("seed", &args.seed),
        option("eval.episodes_per_level", &args.episodes_per_level),
        include_seen(args.include_seen),
    ];
    match (&args.from.experiment, args.run.first()) {
        (None, Some(run)) => {
            let own = RunDir::open(run)?.experiment;
            if let Some(game) = &args.from.game {
                check_run_of(run, &own.game, game)?;
            }
            let experiment = own.with_set(&args.from.sets(options))?;
            experiment.check()?;
            Ok(experiment)
        }
        _ => Ok(args.from.over(of_policy(args, games)?).load(games, options)?),
    }
}

/// Returns settings for the game and levels of the first policy file, where the command line names neither. The
/// experiment may be of another game.
fn of_policy(args: &Args, games: &Games) -> Result<Vec<String>, CliError> {
    let Some(path) = args.policy.first().filter(|_| !args.from.names_game()) else { return Ok(Vec::new()) };
    let file = open::policy(path, args.compute.device())?;
    let game = games.of_file(Artifact::Policy, path, &file.metadata.game)?;
    if args.from.load(games, [])?.game == game.name() {
        return Ok(Vec::new());
    }
    let levels = default_held_out(game).unwrap_or_else(|| first_levels(game, 63));
    Ok(vec![format!("game={}", game.name()), format!("test={levels}")])
}

/// Returns the players, and the levels of each range that some player knows.
fn players(
    game: &dyn Game,
    experiment: &Experiment,
    splits: &[LevelSplit],
    args: &Args,
    games: &Games,
) -> Result<(Vec<LoadedPlayer>, Vec<BTreeSet<u64>>), CliError> {
    let device = args.compute.device();
    let has_policy = !(args.run.is_empty() && args.skills.is_empty() && args.policy.is_empty());
    let draw = action_draw(args.greedy || has_policy && experiment.eval.greedy, has_policy)?;
    let mut measured = MeasuredLevels::new(game, splits, !args.levels.is_empty());
    let mut players = Vec::new();
    for path in &args.run {
        let opened = RunDir::open(path)?;
        check_run_of(path, &opened.experiment.game, &experiment.game)?;
        let chosen = LoadedPlayer::run(game, &opened, args.checkpoint, draw, device)?;
        measured.check(path, chosen.seen.as_ref())?;
        players.push(named(chosen, path, args.run.len()));
    }
    for path in &args.skills {
        let model = open::skills(path, device, &args.from)?;
        let observation_config = check_skills(path, &model, game, &args.from, games)?;
        let (player, seen) = (behaviour_cloning(&model, experiment, draw), model.demos().cloned());
        measured.check(path, seen.as_ref())?;
        let chosen = LoadedPlayer { name: "bc".to_owned(), player, observation_config, seen };
        players.push(named(chosen, path, args.skills.len()));
    }
    for path in &args.policy {
        let chosen = LoadedPlayer::policy_file(game, path, draw, device)?;
        measured.check(path, chosen.seen.as_ref())?;
        players.push(named(chosen, path, args.policy.len()));
    }
    for name in &args.bot {
        players.push(LoadedPlayer::bot(game, name)?);
    }
    for chosen in &mut players {
        if matches!(chosen.player, Player::Policy { .. }) {
            look_through(&mut chosen.observation_config, args.observation, &chosen.name)?;
        }
        chosen.check_fit(game)?;
    }
    Ok((players, measured.known()))
}

/// Replaces the sensor that a policy was trained with by another one of the same observation form.
fn look_through(
    observation_config: &mut ObservationConfig,
    requested: Option<ObservationKind>,
    name: &str,
) -> Result<(), CliError> {
    let Some(kind) = requested else { return Ok(()) };
    let other = ObservationConfig { kind, ..*observation_config };
    if other.is_image() != observation_config.is_image() {
        let offered = if observation_config.is_image() { "vectors" } else { "pictures" };
        return Err(CliError::Usage(format!(
            "the policy {name} reads {observation_config}, and --observation {kind} gives {offered}: leave --observation out, or \
             measure it by itself"
        )));
    }
    *observation_config = other;
    Ok(())
}

/// Names a player, with its path if there are several of its kind.
fn named(chosen: LoadedPlayer, path: &Path, of: usize) -> LoadedPlayer {
    if of > 1 { LoadedPlayer { name: format!("{} {}", chosen.name, path.display()), ..chosen } } else { chosen }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{App, KeyCode, Res, Resource};
    use clap::Parser;
    use playbot_harness::foreign::{ForeignGame, PlayedAgent};
    use playbot_harness::prelude::*;
    use playbot_learner::{DeviceKind, Learner as _, PolicyFile, PolicyMetadata, PolicySpec, PpoConfig, PpoLearner};

    use super::*;

    /// The words of the verb.
    #[derive(Parser)]
    struct Eval {
        #[command(flatten)]
        args: Args,
    }

    #[derive(Resource, Default)]
    struct Ticks(u32);

    /// A game that the agent on the first seat wins after three ticks.
    fn unfair() -> ForeignGame {
        ForeignGame::new("unfair", 1, |app: &mut App| {
            app.init_resource::<Ticks>()
                .add_systems(bevy::prelude::Update, |mut ticks: bevy::prelude::ResMut<Ticks>| ticks.0 += 1);
        })
        .agents(["one", "other"])
        .keys([vec![], vec![KeyCode::KeyA]])
        .keys_of("other", [vec![], vec![KeyCode::KeyB]])
        .observe(["x"], || [0.0])
        .level(|mut ticks: bevy::prelude::ResMut<Ticks>| ticks.0 = 0)
        .end(|ticks: Res<Ticks>, agent: Res<PlayedAgent>| {
            let end = if agent.0 == 0 { EpisodeEnd::WON } else { EpisodeEnd::LOST };
            (ticks.0 > 3).then_some(end)
        })
        .demonstrator("idler", || 0_u32)
    }

    fn eval(game: &ForeignGame, more: &[&str]) -> Result<Outcome, String> {
        let words = [&["eval", game.name(), "--bot", "idler", "--levels", "default:0..3"], more].concat();
        let args = Eval::try_parse_from(words).map_err(|error| error.to_string())?.args;
        let games = [game as &dyn Game];
        run(args, &Games::new(&games).expect("one game")).map_err(|error| error.to_string())
    }

    fn policy_of(game: &str, path: &Path) {
        let spec = PolicySpec { obs: 1.into(), latent: 0, action_space: ActionSpace::Discrete(2) };
        let config = PpoConfig { hidden: vec![4], ..PpoConfig::default() };
        let policy = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("valid").policy();
        let metadata = PolicyMetadata {
            game: game.to_owned(),
            game_version: 1,
            observations: vec!["x".to_owned()],
            ..PolicyMetadata::default()
        };
        PolicyFile { metadata, policy, skills: None }.save(path, &[0.5_f32], &[], 1).expect("writable");
    }

    #[test]
    fn matches_are_played_on_both_seats_or_on_the_one_that_is_named() {
        let (half, all) = (["--rival", "idler", "--at-least"], "success=0.5");
        assert!(matches!(eval(&unfair(), &[&half[..], &[all]].concat()), Ok(Outcome::Pass)), "one of two seats wins");
        let more = [&half[..], &["success=0.6"]].concat();
        assert!(matches!(eval(&unfair(), &more), Ok(Outcome::Findings)));
        let one = |seat| [&half[..], &["success=1", "--seat", seat]].concat();
        assert!(matches!(eval(&unfair(), &one("one")), Ok(Outcome::Pass)));
        assert!(matches!(eval(&unfair(), &one("other")), Ok(Outcome::Findings)));
    }

    #[test]
    fn a_policy_is_a_rival_if_it_is_of_the_game() {
        let folder = tempfile::tempdir().expect("a folder");
        let (own, others) = (folder.path().join("own.policy"), folder.path().join("others.policy"));
        policy_of("unfair", &own);
        policy_of("chess", &others);
        let against = |path: &Path| eval(&unfair(), &["--rival", &path.display().to_string()]).map(drop);
        assert_eq!(against(&own), Ok(()));
        let error = against(&others).expect_err("of another game");
        assert!(error.contains("others.policy: the policy was made for the game `chess`, not for `unfair`"), "{error}");
        let error = against(&folder.path().join("no.policy")).expect_err("no such file");
        assert!(error.contains("no.policy"), "{error}");
    }

    #[test]
    fn rivals_and_seats_that_do_not_exist_are_refused_with_those_that_do() {
        let error = eval(&unfair(), &["--rival", "idlr"]).map(drop).expect_err("no such rival");
        let expected = "unknown rival `idlr` (did you mean `idler`?); valid: idler, random, chaos; or name a policy file, or the \
                        folder of a run";
        assert_eq!(error, expected);
        let error = eval(&unfair(), &["--rival", "idler", "--seat", "oter"]).map(drop).expect_err("no such seat");
        assert_eq!(error, "unknown seat `oter` (did you mean `other`?); valid: one, other");
        assert!(eval(&unfair(), &["--seat", "one"]).is_err(), "a seat is one of a match");
        let alone = ForeignGame::new("alone", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::KeyA]])
            .observe(["x"], || [0.0])
            .demonstrator("idler", || 0_u32);
        let error = eval(&alone, &["--rival", "idler"]).map(drop).expect_err("no seat for a rival");
        assert!(error.starts_with("a World of `alone` has one agent, so it has no rivals"), "{error}");
    }
}
