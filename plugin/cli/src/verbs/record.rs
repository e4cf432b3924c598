//! `playbot record`.

use crate::{
    arguments::{
        OverwriteArgs, check_start_and_steps, default_held_out, first_levels, number_of_steps,
        player::{LoadedPlayer, PlayerArgs},
        report_agents_along,
    },
    error::{CliError, Outcome},
    output, progress,
    progress::interrupt,
};
use bevy_playbot::{
    demo::recorder::Recorder,
    engine::{flush_unfinished, repeated_episodes},
};
use playbot_harness::{
    demo::demonstration::DemonstrationPlan,
    game::Game,
    games::Games,
    held_out::HeldOut,
    prelude::*,
    randomise::{Factors, Randomise},
    worlds::check_randomised,
};
use playbot_learner::disk;
use playbot_report::counted;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Record the game's demonstrator, or another player.
///
/// The demonstrator is a bot of the game's own. --policy, --run and --bot name others, such as a policy that has
/// learned the game from vectors and demonstrates it for one that sees pixels. --noise replaces some of the actions, so
/// that recordings also show recoveries.
///
/// Recordings may show training levels and any others, but no held-out level, on which bots are tested. `learn-skills`
/// refuses those. Held-out levels are the experiment's `test`, and --hold-out leaves
/// them out.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot record GAME --levels MODE:0..9 --out my.demo
  playbot record GAME --levels MODE:2000..2999 --noise 0.2 --steps 100000 --out demos/GAME/noisy.demo
  playbot record antmaze --levels random+size=9x9:1000..1999 --hold-out random+size=9x9:64..127 --steps 20000 --out mazes.demo
  playbot record maze2d --levels medium+retarget:0..9999 --noise 0.5 --steps 1000000 --out medium.demo
  playbot record GAME --run runs/first --checkpoint best --levels MODE:1000..1999 --noise 0.1 --out learned.demo")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included, as files:pattern, such as "files:levels/*.json", or by their names in a
    /// level editor. They are played in order, again and again until --steps is reached. Default: levels 0 to 499 of the
    /// mode that `train` trains in, but for the held-out ones of the game's own experiment.
    #[arg(long, visible_alias = "level")]
    levels: Option<LevelSplit>,
    /// Leave out these levels, and any of the same layout as one of them (repeatable).
    #[arg(long, value_name = "LEVELS")]
    hold_out: Vec<LevelSplit>,
    /// Recording to write, a .demo.
    #[arg(long, value_parser = output::demo)]
    out: PathBuf,
    #[command(flatten)]
    player: PlayerArgs,
    /// Noise of the actions. Discrete actions: probability with which one is replaced by a uniformly random one.
    /// Continuous actions: standard deviation of the normal noise on each value, before it is clipped.
    #[arg(long, default_value_t = 0.0)]
    noise: f64,
    /// Stop after exactly this many steps, not counting those that --append finds (default: one round of the levels).
    #[arg(long, value_parser = number_of_steps)]
    steps: Option<u64>,
    /// Random seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Multiply a number of the game by a factor that each level draws, by its path and the range of factors, such as
    /// Gravity.0=0.8..1.2 (repeatable). The recording keeps the values, and replays set them.
    #[arg(long, value_name = "PATH=FACTORS", value_parser = randomised)]
    randomise: Vec<(String, Factors)>,
    /// Keep the observation vectors too. The file is larger, and replays restore them anyway.
    #[arg(long)]
    observations: bool,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// The last of the default levels, which begin with 0.
const LAST_LEVEL: u64 = 499;

/// Warns that policies learned from this recording depend on the levels of its player, which it does not note.
fn warn_of_pupils(player: &LoadedPlayer) {
    if let Some(seen) = &player.seen {
        report!(
            "the player has learned from {seen}: hold none of these out from learners of its recordings, which do not note them"
        );
    }
}

/// Parses `PATH=LEAST..MOST`.
fn randomised(text: &str) -> Result<(String, Factors), String> {
    let (path, factors) = text.rsplit_once('=').ok_or("write PATH=FACTORS, such as Gravity.0=0.8..1.2")?;
    Ok((path.trim().to_owned(), factors.trim().parse::<Factors>().map_err(|error| error.to_string())?))
}

fn randomised_paths(paths: &[(String, Factors)]) -> Randomise {
    paths.iter().fold(Randomise::default(), |all, (path, factors)| all.with(path.clone(), *factors))
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    report_agents_along(game);
    let levels = args.levels.clone().unwrap_or_else(|| first_levels(game, LAST_LEVEL));
    levels.check(game)?;
    let chosen_player = args.player.load(game)?;
    if chosen_player.is_none() {
        check_demonstrator(game)?;
    }
    check_noise(game, args.noise)?;
    if args.steps == Some(0) {
        return Err(CliError::Usage("--steps is 0: a recording has at least one step".to_owned()));
    }
    let left_out = default_held_out(game).filter(|_| args.levels.is_none());
    let held_out: Vec<_> = args.hold_out.iter().chain(&left_out).cloned().collect();
    let chosen = choose_levels(game, &levels, &held_out)?;
    check_start_and_steps(game, &levels.mode, levels.first)?;
    match &left_out {
        Some(held_out) => report!("no --levels are named: recording {levels}, but for the held-out levels {held_out}"),
        None if args.levels.is_none() => report!("no --levels are named: recording {levels}"),
        None => warn_of_held_out(game, &levels, &chosen),
    }
    let count = chosen.len() as u64;
    let plan = DemonstrationPlan {
        mode: levels.mode.clone(),
        levels: chosen,
        noise: args.noise,
        seed: args.seed,
        steps: args.steps,
        keep_observations: args.observations,
        randomise: randomised_paths(&args.randomise),
    };
    check_randomised(&plan.randomise, game, &levels.mode, levels.first)?;
    let mut header = plan.header(game);
    if let Some(chosen) = &chosen_player {
        header.demonstrator.clone_from(&chosen.name);
        warn_of_pupils(chosen);
    }
    let is_new = !args.overwrite.adds_to(&args.out);
    let writer = args.overwrite.open(&args.out, header)?;
    let built = match &chosen_player {
        Some(LoadedPlayer { player, observation_config, .. }) => {
            plan.build_world_of(game, player, observation_config, writer)
        }
        None => Ok(plan.build_world(game, writer)),
    };
    let (mut world, agent) = built.inspect_err(|_| leave_nothing(&args.out, is_new))?;
    interrupt::leave(format!("the finished episodes are kept in {}", args.out.display()));
    let finished = play(&mut world, agent, count, args.steps);
    let (episodes, steps) = (world.resource::<Recorder>().episodes(), world.resource::<Recorder>().steps());
    let counts = format!("{}, {}", counted(episodes, "episode"), counted(steps, "step"));
    if finished.is_err() && episodes == 0 {
        // The file is closed before it is removed.
        world.remove_resource::<Recorder>();
        leave_nothing(&args.out, is_new);
    }
    let finished = finished.inspect_err(|_| {
        if episodes > 0 {
            report!("{}: the part recorded before the error is kept: {counts}", args.out.display());
        }
    })?;
    let ended = *world.get::<EpisodeCount>(agent).expect("required by Agent");
    report!("{}: {counts}{}", args.out.display(), wins(episodes, ended));
    // The file is closed before it is read.
    world.remove_resource::<Recorder>();
    if !is_new {
        warn_of_repeats(&args, episodes);
    }
    if finished {
        return Ok(Outcome::Pass);
    }
    let level = world.get::<Episode>(agent).filter(|_| episodes <= count).map(|episode| episode.level);
    let stopped = StoppedRecording { level, steps, left_out };
    report!("stopped, so the recording is incomplete: {}", stopped.how_to_go_on(&args, &levels));
    Ok(Outcome::Stopped)
}

/// Describes how many of the recorded episodes reached the goal. An episode that was cut off at the end of the recording
/// shows nothing about that.
fn wins(recorded: u64, ended: EpisodeCount) -> String {
    let cut_off = recorded.saturating_sub(ended.finished);
    match (ended.successes, cut_off) {
        // Not every game has a goal.
        (0, 0) => String::new(),
        (0, _) => format!(", {cut_off} cut off"),
        (n, 0) => format!(", {:.1} % reached the goal", 100.0 * n as f64 / ended.finished as f64),
        (n, _) => format!(", {n} of {} that ended reached the goal; {cut_off} cut off", ended.finished),
    }
}

/// Warns if added episodes were in the recording before.
fn warn_of_repeats(args: &Args, added: u64) {
    // The recording is written; only the warning is lost.
    let Ok(repeated @ 1..) = repeated_episodes(&args.out, usize::try_from(added).unwrap_or(usize::MAX)) else { return };
    let (are, ones) = if repeated == 1 { ("is", "one") } else { ("are", "ones") };
    let others = if args.noise > 0.0 {
        format!("a --seed that was not used before, such as --seed {}", args.seed.wrapping_add(1))
    } else {
        "other --levels, or --noise".to_owned()
    };
    report!(
        "warning: {} {are} equal to {ones} that {} before, and would count twice: record with {others}",
        counted(repeated as u64, "episode"),
        if repeated == 1 { "was there" } else { "were there" },
    );
}

/// Removes a new recording without an episode, which would be in the way of the next attempt. Devices and links stay.
fn leave_nothing(path: &Path, is_new: bool) {
    if is_new && fs::symlink_metadata(path).is_ok_and(|found| found.is_file()) && disk::remove_file(path).is_ok() {
        report!("{}: nothing was recorded before the error, so no file is left", path.display());
    }
}

/// Position at which a recording was stopped.
struct StoppedRecording {
    /// The level that was being played, unless every level has been played already.
    level: Option<u64>,
    /// Steps that this call has recorded.
    steps: u64,
    /// Held-out levels that were left out because no levels were named.
    left_out: Option<LevelSplit>,
}

impl StoppedRecording {
    /// Returns the changes of the call that resumes the recording. Each call begins with the first of its levels,
    /// counts its own steps, and draws the same noise from the same seed. Options that are given twice are an error.
    fn how_to_go_on(&self, args: &Args, levels: &LevelSplit) -> String {
        let mut changes = "--append".to_owned();
        let mut replaced = Vec::new();
        if args.overwrite.replaces() {
            replaced.push("--force");
        }
        if let Some(first) = self.level {
            if args.levels.is_some() {
                replaced.push("--levels");
            }
            changes += &format!(" --levels {}", LevelSplit { first, ..levels.clone() });
            changes.extend(self.left_out.iter().map(|held_out| format!(" --hold-out {held_out}")));
        }
        if let Some(steps) = args.steps {
            replaced.push("--steps");
            changes += &format!(" --steps {}", steps.saturating_sub(self.steps));
        }
        if args.noise > 0.0 {
            replaced.push("--seed");
            changes += &format!(" --seed {}", args.seed.wrapping_add(1));
        }
        let place = match replaced.as_slice() {
            [] => String::new(),
            [only] => format!(", in place of its {only}"),
            [most @ .., last] => format!(", in place of its {} and {last}", most.join(", ")),
        };
        format!("add the rest with the same command and `{changes}`{place}")
    }
}

/// Checks that there is a player.
fn check_demonstrator(game: &dyn Game) -> Result<(), CliError> {
    if game.tools().bots.demonstrator().is_some() {
        return Ok(());
    }
    let name = game.name();
    let mut advice = "train a policy without recordings (`playbot train --algorithm ppo --run runs/first`)".to_owned();
    if game.tools().input.records_people() {
        advice += &format!(", or play and record it yourself: `playbot play {name} --record FILE`");
    }
    if let Some(bot) = game.tools().bots.scripted_bots().first() {
        advice = format!("record another of its bots (`--bot {bot}`), or {advice}");
    }
    Err(CliError::Usage(format!("`{name}` has no demonstrator that could be recorded: {advice}")))
}

/// Checks the noise: a probability for discrete actions, a standard deviation for continuous ones, and both for others.
fn check_noise(game: &dyn Game, noise: f64) -> Result<(), CliError> {
    let (fits, wanted) = match game.actions() {
        ActionSpace::Discrete(_) => ((0.0..=1.0).contains(&noise), "a probability lies between 0 and 1"),
        ActionSpace::Continuous(_) => {
            (noise.is_finite() && noise >= 0.0, "a standard deviation is a finite number, 0 or more")
        }
        ActionSpace::Mixed(_) => (
            (0.0..=1.0).contains(&noise),
            "it is the probability of another option in each choice, and the deviation of each number: 0 to 1",
        ),
    };
    if fits { Ok(()) } else { Err(CliError::Usage(format!("--noise is {noise}; {wanted}"))) }
}

/// Returns the levels but for those that are held out.
fn choose_levels(game: &dyn Game, levels: &LevelSplit, held_out: &[LevelSplit]) -> Result<Vec<u64>, CliError> {
    held_out.iter().try_for_each(|split| split.check(game))?;
    let hidden: Vec<_> = held_out.iter().map(|split| HeldOut::new(game, split)).collect();
    let is_held_out =
        |hidden: &HeldOut, level| hidden.contains(&levels.mode, level) || hidden.resembles(&levels.mode, level);
    let chosen: Vec<u64> =
        levels.levels().filter(|&level| !hidden.iter().any(|hidden| is_held_out(hidden, level))).collect();
    if chosen.is_empty() {
        return Err(CliError::Usage(format!("every one of the levels {levels} is held out: record others")));
    }
    Ok(chosen)
}

/// Warns if requested levels are held out by the game's own experiment. Another experiment may hold out others.
fn warn_of_held_out(game: &dyn Game, levels: &LevelSplit, chosen: &[u64]) {
    let Some(split) = default_held_out(game) else { return };
    let hidden = HeldOut::new(game, &split);
    if hidden.first_of(levels).is_none() {
        return;
    }
    if let Some(level) = chosen.iter().find(|level| hidden.contains(&levels.mode, **level)) {
        report!(
            "warning: level {level} is one of the held-out levels {split}; learn-skills refuses recordings of them, unless \
             your experiment holds out others: leave them out with --hold-out {split}"
        );
    }
}

/// Plays until enough is recorded. Returns false if Ctrl-C stopped it before.
fn play(
    world: &mut bevy::prelude::World,
    agent: bevy::prelude::Entity,
    levels: u64,
    steps: Option<u64>,
) -> Result<bool, CliError> {
    interrupt::listen();
    let (length, unit) = steps.map_or((levels, "levels"), |steps| (steps, "steps"));
    let bar = progress::bar("record", length, unit);
    let finished = loop {
        world.tick()?;
        let recorder = world.resource::<Recorder>();
        let done = if steps.is_some() { recorder.steps() } else { recorder.episodes() };
        bar.set_position(done);
        let idle = !Control::of(world, agent).is_active();
        if idle || steps.is_some_and(|steps| done >= steps) {
            break true;
        }
        if interrupt::asked() {
            break false;
        }
    };
    bar.finish_and_clear();
    flush_unfinished(world)?;
    Ok(finished)
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{App, KeyCode, Res};
    use bevy_playbot::action::Actions;
    use bevy_playbot::demo::file::DemoReader;
    use clap::Parser;
    use playbot_harness::{foreign::ForeignGame, level_files::LevelDesigns};

    use super::*;

    /// The words of the verb.
    #[derive(Parser)]
    struct Record {
        #[command(flatten)]
        args: Args,
    }

    /// A game whose episodes last three ticks.
    fn sound() -> ForeignGame {
        ForeignGame::new("wait", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .time_limit(3)
            .demonstrator("idler", || 0_u32)
    }

    /// The same game, in which no level can start: no level is from a file.
    fn broken() -> ForeignGame {
        sound().level(|_: Res<LevelDesigns>| {})
    }

    fn record(game: &ForeignGame, path: &Path, more: &[&str]) -> Result<(), CliError> {
        let out = path.display().to_string();
        let words = [&["record", "wait", "--levels", "default:0..0", "--out", &out], more].concat();
        let args = Record::try_parse_from(words).unwrap_or_else(|error| panic!("{error}")).args;
        let games = [game as &dyn Game];
        run(args, &Games::new(&games).expect("one game")).map(drop)
    }

    #[test]
    fn another_scripted_bot_is_recorded_by_its_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("paced.demo");
        let game = ForeignGame::new("wait", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .time_limit(3)
            .bot("presser", || 1_u32);
        let error = record(&game, &path, &[]).expect_err("it has no demonstrator").to_string();
        assert!(error.contains("`wait` has no demonstrator") && error.contains("(`--bot presser`)"), "{error}");
        record(&game, &path, &["--bot", "presser"]).expect("sound");
        let mut reader = DemoReader::open(&path).expect("readable");
        assert_eq!(reader.header().demonstrator, "presser");
        let episode = reader.next().expect("one episode").expect("whole");
        assert_eq!(episode.actions, Actions::Discrete(vec![1; 3]));
    }

    #[test]
    fn an_episode_that_was_cut_off_does_not_count_as_ended() {
        let words = |recorded, finished, successes| wins(recorded, EpisodeCount { finished, successes });
        assert_eq!(words(5, 4, 4), ", 4 of 4 that ended reached the goal; 1 cut off");
        assert_eq!(words(4, 4, 3), ", 75.0 % reached the goal");
        assert_eq!((words(4, 4, 0), words(1, 0, 0)), (String::new(), ", 1 cut off".to_owned()));
    }

    #[test]
    fn a_recording_that_fails_before_its_first_episode_leaves_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("new.demo");
        record(&broken(), &path, &[]).expect_err("no level starts");
        assert!(!path.exists());
        record(&sound(), &path, &[]).expect("nothing is in the way");
    }

    #[test]
    fn a_recording_that_fails_while_it_grows_keeps_its_episodes() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("old.demo");
        record(&sound(), &path, &[]).expect("recorded");
        record(&broken(), &path, &["--append"]).expect_err("no level starts");
        let episodes = DemoReader::open(&path).and_then(DemoReader::read_all).expect("sound");
        assert_eq!(episodes.len(), 1);
    }
}
