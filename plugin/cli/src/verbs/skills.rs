//! `playbot skills`: one state of a level, and what the policy does from there with each skill.
//!
//! - `page`: the page, its server on this machine, and the same page as a file; the state, and the rollout of a skill
//!   from it.

mod page;

use crate::{
    arguments::{
        LevelsArg, check_start, default_mode,
        player::{PlayerArgs, SKILL_NAMES},
    },
    error::{CliError, Outcome},
    output::{self, print_line},
    progress::{self, interrupt},
    verbs::skills::page::{Ask, Page, Rollout, Rollouts},
};
use bevy_playbot::{
    skill_prior::NamedSkill,
    vision::{ObservationConfig, ObservationKind},
};
use playbot_harness::{eval::Player, game::Game, games::Games, sealed_file::io_error, sensors::GameSensors};
use serde_json::json;
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// The usual port of the page.
const PORT: u16 = 8138;

/// Skills of a row of the grid.
const SIDE: usize = 5;

/// Largest value of the grid's two dimensions: skills are between -1 and 1, or mostly so without tanh.
const REACH: f32 = 0.9;

/// See what each skill does from one state: a page with a rollout for each point of a grid, and sliders for z.
///
/// The policy plays the level up to --tick. From there each tile shows what it does with one skill for --ticks ticks. A
/// region of skills can be given a name on the page, which `view`, `play` and this verb then show.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot skills GAME --run runs/first --level 7
  playbot skills GAME --policy my.policy --level 7 --tick 40 --ticks 30
  playbot skills GAME --run runs/first --out skills.html   the same as one file, without sliders
  playbot skills GAME --run runs/first --json   one line for each tile")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game (default: the one that it is trained in).
    #[arg(long)]
    mode: Option<String>,
    #[command(flatten)]
    levels: LevelsArg,
    /// Random seed of the policy's draws (default: 0).
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    player: PlayerArgs,
    /// Tick of the episode, from 0, at which the skills begin.
    #[arg(long, default_value_t = 0)]
    tick: u32,
    /// Ticks for which a skill is followed (default: those of the policy, at least 20).
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=2000))]
    ticks: Option<u32>,
    /// The two values of z that the grid varies, counted from 0.
    #[arg(long, value_name = "X,Y", default_value = "0,1", value_parser = two_dims)]
    dims: [usize; 2],
    /// Skills drawn from the prior at this state, in place of the grid.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    draw: Option<u32>,
    /// File of the names (default: skill-names.json in the folder of the run, or beside the policy).
    #[arg(long, value_name = "FILE")]
    names: Option<PathBuf>,
    /// Enlargement of the pictures.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=16))]
    scale: u32,
    /// Write the page into this file, and do not serve it.
    #[arg(long, value_name = "FILE", value_parser = output::html, conflicts_with = "port")]
    out: Option<PathBuf>,
    /// Port of the page; 0 takes any.
    #[arg(long)]
    port: Option<u16>,
    /// Print one line of JSON per tile: z, return, end and name. Nothing is served.
    #[arg(long, conflicts_with_all = ["port", "out"])]
    json: bool,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let (mode, level) = args.levels.choose(game, args.mode.as_deref(), args.seed)?;
    let mode = mode.unwrap_or_else(|| default_mode(game)).to_owned();
    game.check_mode(&mode)?;
    check_start(game, &mode, level)?;
    let Some(chosen) = args.player.load(game)? else {
        return Err(CliError::Usage("no policy is named: add --run or --policy".to_owned()));
    };
    let Player::Policy { prior: Some(prior), .. } = &chosen.player else {
        return Err(CliError::Usage(format!(
            "{} follows no skills: name a run or a policy of score-ppo, score-sac, spirl-ppo or spirl-sac",
            chosen.name
        )));
    };
    let latent = prior.prior.latent();
    if let Some(dim) = args.dims.iter().find(|dim| **dim >= latent) {
        return Err(CliError::Usage(format!("--dims {dim}: z has {latent} values, counted from 0")));
    }
    let (ticks, interval) = (args.ticks.unwrap_or(prior.skill_interval.max(20)), prior.skill_interval);
    let names_file = args.names.clone().or_else(|| args.player.names_file()).unwrap_or_else(|| SKILL_NAMES.into());
    let names = SkillNames::read(&names_file)?;
    let observation_config = observation_config(game, &chosen.observation_config)?;
    interrupt::listen();
    let mut rollouts = Rollouts {
        game,
        mode: &mode,
        level,
        seed: args.levels.random_seed(args.seed),
        player: &chosen.player,
        observation_config,
        tick: args.tick,
        ticks,
        scale: args.scale,
    };
    let skills = match args.draw {
        Some(count) => rollouts.draws(count as usize)?,
        None => grid(latent, args.dims),
    };
    let about = json!({
        "game": game.name(), "mode": mode, "level": level, "tick": args.tick, "ticks": ticks, "interval": interval,
        "latent": latent, "dims": args.dims, "policy": chosen.name, "columns": columns(skills.len()),
    });
    if args.json {
        return as_json(&mut rollouts, &skills, &names);
    }
    if let Some(path) = &args.out {
        return as_file(path, about, &mut rollouts, &skills, &names);
    }
    serve(&args, about, rollouts, skills, names, names_file)
}

/// Parses two numbers with a comma between them.
fn two_dims(text: &str) -> Result<[usize; 2], String> {
    let numbers = text.split_once(',').and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    numbers.ok_or_else(|| "they must be two numbers of values of z, such as 0,1".to_owned())
}

/// Returns the observation that the policy reads, or the game's picture if that is numbers.
fn observation_config(game: &dyn Game, own: &ObservationConfig) -> Result<ObservationConfig, CliError> {
    if own.is_image() {
        return Ok(*own);
    }
    let kind = match game.tools().pictures.picture() {
        Some(_) => ObservationKind::Raster,
        None => ObservationKind::Vector,
    };
    let observation_config = ObservationConfig { kind, ..*own };
    observation_config.check(game)?;
    Ok(observation_config)
}

/// Returns the skills of the grid, row by row: the second dimension falls from row to row. The others are 0.
fn grid(latent: usize, [across, down]: [usize; 2]) -> Vec<Vec<f32>> {
    let value = |index: usize| REACH * (2.0 * index as f32 / (SIDE - 1) as f32 - 1.0);
    let mut skills = Vec::new();
    for row in (0..SIDE).rev() {
        for column in 0..SIDE {
            let mut z = vec![0.0; latent];
            z[down] = value(row);
            z[across] = value(column);
            skills.push(z);
        }
    }
    // One dimension makes one row.
    if across == down {
        skills.truncate(SIDE);
        for (index, z) in skills.iter_mut().enumerate() {
            z[across] = value(index);
        }
    }
    skills
}

fn columns(count: usize) -> usize {
    SIDE.min(count.max(1))
}

/// Rolls out all skills, with a bar.
fn roll_out(
    rollouts: &mut Rollouts<'_>,
    skills: &[Vec<f32>],
    names: &SkillNames,
) -> Result<Option<Vec<Rollout>>, CliError> {
    let bar = progress::bar("roll out", skills.len() as u64, "skills");
    let mut tiles = Vec::new();
    for z in skills {
        if interrupt::asked() {
            bar.finish_and_clear();
            return Ok(None);
        }
        tiles.push(rollouts.of(z, names)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(Some(tiles))
}

fn as_json(rollouts: &mut Rollouts<'_>, skills: &[Vec<f32>], names: &SkillNames) -> Result<Outcome, CliError> {
    for z in skills {
        if interrupt::asked() {
            return Ok(Outcome::Stopped);
        }
        let rollout = rollouts.of(z, names)?;
        print_line(rollout.as_json(z, names))?;
    }
    Ok(Outcome::Pass)
}

fn as_file(
    path: &std::path::Path,
    about: serde_json::Value,
    rollouts: &mut Rollouts<'_>,
    skills: &[Vec<f32>],
    names: &SkillNames,
) -> Result<Outcome, CliError> {
    output::prepare(path)?;
    let Some(tiles) = roll_out(rollouts, skills, names)? else {
        report!("stopped; nothing is written");
        return Ok(Outcome::Stopped);
    };
    output::write(path, page::as_file(&about, skills, &tiles, names).as_bytes())?;
    report!("{} skills from tick {} written to {}", tiles.len(), rollouts.tick, path.display());
    Ok(Outcome::Pass)
}

/// Serves the page until Ctrl-C.
fn serve(
    args: &Args,
    about: serde_json::Value,
    mut rollouts: Rollouts<'_>,
    skills: Vec<Vec<f32>>,
    mut names: SkillNames,
    names_file: PathBuf,
) -> Result<Outcome, CliError> {
    // The first tile now: an error of the game is one of this command, not of its page.
    if let Some(first) = skills.first() {
        rollouts.of(first, &names)?;
    }
    let page = Page::open(args.port, PORT)?;
    let place = if page.is_other() { "the port is taken, so the page" } else { "the page" };
    report!("{place} is at {}; Ctrl-C ends it", page.address());
    while !interrupt::asked() {
        let Some((ask, answer)) = page.next() else { continue };
        match ask {
            Ask::About => answer.json(&json!({ "about": about, "skills": skills, "names": names.regions })),
            Ask::Tile(z) if z.len() == rollouts.latent() && z.iter().all(|value| value.is_finite()) => {
                match rollouts.of(&z, &names) {
                    Ok(rollout) => answer.json(&rollout.with_picture(&z, &names)),
                    Err(error) => answer.failed(&error.to_string()),
                }
            }
            Ask::Tile(_) => answer.failed("z has other values than the policy's skills"),
            Ask::Name(region) => {
                let changed = names.with(region);
                match changed.write(&names_file) {
                    Ok(()) => {
                        names = changed;
                        answer.json(&json!({ "names": names.regions }));
                    }
                    Err(error) => answer.failed(&error.to_string()),
                }
            }
        }
    }
    if !names.regions.is_empty() {
        report!("names are in {}", names_file.display());
    }
    Ok(Outcome::Stopped)
}

// Names of regions of skills, in a file beside the policy.

/// The named regions of a policy's skills.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SkillNames {
    pub regions: Vec<NamedSkill>,
}

impl SkillNames {
    /// Reads a file; none is like an empty one.
    ///
    /// # Errors
    ///
    /// It cannot be read, or holds something else.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let text = match fs::read_to_string(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            text => text.map_err(io_error("read", path))?,
        };
        let regions = serde_json::from_str(&text).map_err(|error| {
            let path = path.display();
            CliError::Usage(format!(
                "{path}: not a list of named skills ({error}): mend or remove it, or name another file with `playbot skills \
                 --names`"
            ))
        })?;
        Ok(Self { regions })
    }

    /// Reads the names of the skills of a policy's file, from the file beside it.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn beside_policy(policy: &Path) -> Result<Self, CliError> {
        Self::read(&policy.with_extension(SKILL_NAMES))
    }

    /// Reads the names of the skills of a run, from the file in its folder.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn of_run(folder: &Path) -> Result<Self, CliError> {
        Self::read(&folder.join(SKILL_NAMES))
    }

    /// Reads the names of a player's skills; none for a bot.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn of_player(player: &PlayerArgs) -> Result<Self, CliError> {
        player.names_file().map_or_else(|| Ok(Self::default()), |file| Self::read(&file))
    }

    /// Writes the file.
    ///
    /// # Errors
    ///
    /// The system refuses.
    pub fn write(&self, path: &Path) -> Result<(), CliError> {
        let text = serde_json::to_string_pretty(&self.regions).unwrap_or_default();
        output::write(path, format!("{text}\n").as_bytes())
    }

    /// Returns the names with a region more. It replaces those in which its middle lies; an empty name only takes them
    /// away.
    pub fn with(&self, region: NamedSkill) -> Self {
        let mut regions = self.regions.clone();
        regions.retain(|known| !known.holds(&region.z));
        if !region.name.trim().is_empty() {
            regions.push(region);
        }
        Self { regions }
    }

    /// Returns the name of a skill: that of the region in which it lies, the one with the nearest middle.
    pub fn of(&self, z: &[f32]) -> Option<&str> {
        NamedSkill::name_of(&self.regions, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(name: &str, z: [f32; 2]) -> NamedSkill {
        NamedSkill { name: name.to_owned(), z: z.to_vec(), radius: 0.5 }
    }

    #[test]
    fn names_are_kept_replaced_and_taken_away() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("names.json");
        assert_eq!(SkillNames::read(&path).expect("none yet"), SkillNames::default());
        let names = SkillNames::default().with(region("jump", [0.0, 0.9])).with(region("walk", [0.9, 0.0]));
        names.write(&path).expect("writable");
        let read = SkillNames::read(&path).expect("it is there");
        assert_eq!(read, names);
        names.write(&folder.path().join("bot.skill-names.json")).expect("writable");
        assert_eq!(SkillNames::beside_policy(&folder.path().join("bot.policy")).expect("it is there"), names);
        assert_eq!(SkillNames::of_run(folder.path()).expect("none yet"), SkillNames::default());
        names.write(&folder.path().join("skill-names.json")).expect("writable");
        assert_eq!(SkillNames::of_run(folder.path()).expect("it is there"), names);
        assert_eq!(read.of(&[0.1, 0.8]), Some("jump"));
        assert_eq!(read.of(&[-0.9, -0.9]), None);
        let renamed = read.with(region("leap", [0.0, 0.8]));
        assert_eq!((renamed.of(&[0.0, 0.9]), renamed.regions.len()), (Some("leap"), 2));
        assert_eq!(renamed.with(region(" ", [0.0, 0.8])).of(&[0.0, 0.9]), None);
        std::fs::write(&path, "{}").expect("writable");
        let error = SkillNames::read(&path).expect_err("no list").to_string();
        assert!(error.contains("not a list of named skills"), "{error}");
    }
}
