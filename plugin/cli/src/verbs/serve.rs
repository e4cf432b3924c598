//! `playbot serve`.
//!
//! - `mcp`: sessions of language models, with the detectors of `playbot test`.

mod mcp;

use crate::{
    arguments::{Threads, check_start, first_levels},
    error::{CliError, Outcome},
    output::print_line,
    progress::interrupt,
    verbs::serve::mcp::ModelArgs,
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
use std::{net::SocketAddr, path::PathBuf};

/// Let another program play: many arenas of a game in lockstep.
///
/// The program connects to a socket of this machine, and speaks a protocol of flat arrays and small messages, which
/// docs/reference/protocol.md describes. The Python package `playbot` starts this verb by itself, and makes environments of
/// Gymnasium and PettingZoo of it. The address is printed as one line of JSON. There is one client at a time.
///
/// With --mcp the client is a language model that plays as a tester: it has started this program, and speaks the Model
/// Context Protocol over its standard input and output. All that it plays is recorded, and findings are stored as those
/// of `playbot test`. docs/how-to/language-models.md says how to connect one.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot serve GAME --arenas 64
  playbot serve GAME --levels MODE:0..499 --arenas 64 --transport unix --listen /tmp/game.socket
  playbot serve coinrun --observation raster --arenas 16 --transport tcp --listen 127.0.0.1:7000
  playbot serve GAME --levels MODE:0..9 --order rounds --autoreset disabled --render 256
  playbot serve GAME --mcp --levels MODE:0..9 --out runs/model")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included, as files:pattern, or by their names in a level editor. Default: levels 0 to
    /// 499 of the mode that `train` trains in.
    #[arg(long, visible_alias = "level")]
    levels: Option<LevelSplit>,
    /// Order of the levels (default: uniform; with --mcp rounds).
    #[arg(long, value_enum)]
    order: Option<Order>,
    /// Arenas that step together, 1 to 65536.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65536))]
    arenas: u32,
    /// What follows the end of an episode.
    #[arg(long, value_enum, default_value_t)]
    autoreset: After,
    /// What agents see: vector, raster or camera.
    #[arg(long, default_value_t)]
    observation: ObservationKind,
    /// Width and height of the pictures that agents see, pixels (default: 64; with --mcp that of --render).
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=MAX_SIDE as i64))]
    size: Option<u32>,
    /// Pictures in an observation, the last ones.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=ImageOptions::MAX_STACK as i64))]
    stack: u32,
    /// One channel of brightness instead of colours.
    #[arg(long)]
    grayscale: bool,
    /// Draw pictures of this width and height for people, beside the numbers that agents see (with --mcp: for the model;
    /// default: 256 where the game can be drawn).
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
    model: ModelArgs,
    #[command(flatten)]
    pub(crate) threads: Threads,
}

/// Order of the levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
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
        let usual = if self.model.mcp { self.render.unwrap_or(PICTURE) } else { ImageOptions::default().width };
        let side = self.size.unwrap_or(usual);
        ImageOptions {
            width: side,
            height: side,
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
            (_, Some(text)) if text.parse::<SocketAddr>().is_ok() => {
                let words = format!("--listen {text} is a port, and not the path of a socket: add --transport tcp");
                Err(CliError::Usage(words))
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
    let square = |side| ImageOptions { width: side, height: side, ..ImageOptions::default() };
    let drawn = |image| ObservationConfig { kind: ObservationKind::Raster, image };
    let picture = match args.render.map(square) {
        // Not every game can be drawn, and only what was asked for is missed.
        None if args.model.mcp => Some(square(PICTURE)).filter(|image| drawn(*image).check(game).is_ok()),
        picture => picture,
    };
    if let Some(image) = picture {
        drawn(image).check(game)?;
    }
    if args.model.mcp && args.arenas != 1 {
        let words = "--arenas is for programs: a model plays one arena, so leave it out, or start a server for each";
        return Err(CliError::Usage(words.to_owned()));
    }
    let address = args.address()?;
    check_start(game, &levels.mode, levels.first)?;
    let order = args.order.unwrap_or(if args.model.mcp { Order::Rounds } else { Order::Uniform });
    let settings = Settings {
        game,
        levels,
        order: match order {
            Order::Uniform => LevelOrder::Uniform,
            Order::Rounds => LevelOrder::Rounds,
        },
        observation,
        picture,
        arenas: args.arenas,
        threads: args.threads.count(),
        seed: args.seed,
        autoreset: match args.autoreset {
            _ if args.model.mcp => Autoreset::Disabled,
            After::NextStep => Autoreset::NextStep,
            After::SameStep => Autoreset::SameStep,
            After::Disabled => Autoreset::Disabled,
        },
        first_seat: args.model.first_seat,
    };
    settings.check_memory()?;
    if args.model.mcp {
        return mcp::run(&args.model, &settings);
    }
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

/// Width and height of a model's pictures.
const PICTURE: u32 = 256;
