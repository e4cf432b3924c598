//! `playbot serve`.

use crate::{
    arguments::{Threads, check_start, first_levels},
    error::{CliError, Outcome},
    output::print_line,
    progress::interrupt,
};
use bevy_playbot::vision::{ImageOptions, MAX_SIDE, ObservationConfig, ObservationKind};
use clap::ValueEnum;
use playbot_bridge::{
    lockstep::{Autoreset, LevelOrder, Settings},
    messages::PROTOCOL,
    server::{Address, Listener, Server},
};
use playbot_harness::{games::Games, prelude::*};
use serde_json::json;
use std::path::PathBuf;

/// Let another program play: many arenas of a game in lockstep.
///
/// The program connects to a socket of this machine, and speaks a protocol of flat arrays and small messages, which
/// docs/reference/protocol.md describes. The Python package `playbot` starts this verb by itself, and makes environments of
/// Gymnasium and PettingZoo of it. The address is printed as one line of JSON. There is one client at a time.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot serve GAME --arenas 64
  playbot serve GAME --levels MODE:0..499 --arenas 64 --transport unix --listen /tmp/game.socket
  playbot serve coinrun --observation raster --arenas 16 --transport tcp --listen 127.0.0.1:7000
  playbot serve GAME --levels MODE:0..9 --order rounds --autoreset disabled --render 256")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included, as files:pattern, or by their names in a level editor. Default: levels 0 to
    /// 499 of the mode that `train` trains in.
    #[arg(long, visible_alias = "level")]
    levels: Option<LevelSplit>,
    /// Order of the levels.
    #[arg(long, value_enum, default_value_t)]
    order: Order,
    /// Arenas that step together, 1 to 65536.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65536))]
    arenas: u32,
    /// What follows the end of an episode.
    #[arg(long, value_enum, default_value_t)]
    autoreset: After,
    /// What agents see: vector, raster or camera.
    #[arg(long, default_value_t)]
    observation: ObservationKind,
    /// Width and height of the pictures that agents see, pixels.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=MAX_SIDE as i64))]
    size: u32,
    /// Pictures in an observation, the last ones.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=ImageOptions::MAX_STACK as i64))]
    stack: u32,
    /// One channel of brightness instead of colours.
    #[arg(long)]
    grayscale: bool,
    /// Draw pictures of this width and height for people, beside the numbers that agents see.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=MAX_SIDE as i64))]
    render: Option<u32>,
    /// The way of the arrays: shared memory, or the socket itself.
    #[arg(long, value_enum, default_value_t)]
    transport: Transport,
    /// Path of the socket, or 127.0.0.1:PORT with --transport tcp (default: a new path, or a free port).
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<String>,
    /// End when the first client leaves, or if none comes within a minute.
    #[arg(long)]
    once: bool,
    /// Random seed of the levels, unless the client names one.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    pub(crate) threads: Threads,
}

/// Order of the levels.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Order {
    /// Each is drawn.
    #[default]
    Uniform,
    /// All of them in turn.
    Rounds,
}

/// What follows the end of an episode.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum After {
    /// The next step ignores the action and begins an episode.
    #[default]
    NextStep,
    /// The same step begins an episode.
    SameStep,
    /// Nothing, until the client resets the arena.
    Disabled,
}

/// The way of the arrays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Transport {
    /// Shared memory, with messages over a socket in the file system.
    #[cfg_attr(unix, default)]
    Shm,
    /// A socket in the file system.
    Unix,
    /// A port of 127.0.0.1.
    #[cfg_attr(not(unix), default)]
    Tcp,
}

impl Args {
    fn image(&self) -> ImageOptions {
        ImageOptions {
            width: self.size,
            height: self.size,
            stack: self.stack,
            grayscale: self.grayscale,
            ..ImageOptions::default()
        }
    }

    fn address(&self) -> Result<Address, CliError> {
        match (self.transport, &self.listen) {
            (Transport::Tcp, listen) => {
                let text = listen.as_deref().unwrap_or("127.0.0.1:0");
                let wrong = |error| CliError::Usage(format!("--listen {text}: {error}; write 127.0.0.1:PORT"));
                Ok(Address::Tcp(text.parse().map_err(wrong)?))
            }
            #[cfg(unix)]
            (_, listen) => {
                let new = || std::env::temp_dir().join(format!("playbot-{}.socket", std::process::id()));
                Ok(Address::Unix(listen.as_ref().map_or_else(new, PathBuf::from)))
            }
            #[cfg(not(unix))]
            _ => Err(CliError::Usage("this system has --transport tcp alone".to_owned())),
        }
    }
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let levels = args.levels.clone().unwrap_or_else(|| first_levels(game, LAST_LEVEL));
    levels.check(game)?;
    let observation = ObservationConfig { kind: args.observation, image: args.image() };
    observation.check(game)?;
    let picture = args.render.map(|side| ImageOptions { width: side, height: side, ..ImageOptions::default() });
    if let Some(image) = picture {
        ObservationConfig { kind: ObservationKind::Raster, image }.check(game)?;
    }
    let address = args.address()?;
    check_start(game, &levels.mode, levels.first)?;
    let settings = Settings {
        game,
        levels,
        order: match args.order {
            Order::Uniform => LevelOrder::Uniform,
            Order::Rounds => LevelOrder::Rounds,
        },
        observation,
        picture,
        arenas: args.arenas,
        threads: args.threads.count(),
        seed: args.seed,
        autoreset: match args.autoreset {
            After::NextStep => Autoreset::NextStep,
            After::SameStep => Autoreset::SameStep,
            After::Disabled => Autoreset::Disabled,
        },
    };
    settings.check_memory()?;
    let listener = Listener::open(&address).map_err(|error| CliError::Usage(error.to_string()))?;
    interrupt::listen();
    interrupt::leave("recorded episodes that have ended are kept".to_owned());
    let kind = if args.transport == Transport::Tcp { "tcp" } else { "unix" };
    print_line(json!({ "address": listener.address(), "socket": kind, "protocol": PROTOCOL, "game": game.name() }))?;
    let report = |line: &str| report!("{line}");
    let server = Server {
        settings: &settings,
        shared: args.transport == Transport::Shm,
        once: args.once,
        stops: &interrupt::asked,
        report: &report,
    };
    server.run(&listener).map_err(|error| CliError::Io(format!("no client can be heard any more: {error}")))?;
    Ok(if interrupt::asked() { Outcome::Stopped } else { Outcome::Pass })
}

/// The last of the default levels, which begin with 0.
const LAST_LEVEL: u64 = 499;
