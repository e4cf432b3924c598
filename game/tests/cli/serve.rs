//! Tests of `serve` with clients in another language.

use std::{
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, Command, Stdio},
};

use playbot_games::coinrun::CoinRun;
use playbot_harness::{prelude::*, worlds::build_world};
use serde_json::Value;

use crate::program::{code, command, errors, playbot};

/// Builds the client in C, and returns its path.
fn client(folder: &Path) -> std::path::PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/clients/client.c");
    let built = folder.join("client");
    let compiled =
        Command::new("cc").args(["-O1", "-Wall", "-Wextra", "-Werror", "-o"]).arg(&built).arg(source).output();
    let compiled = compiled.expect("a C compiler, which Rust links with");
    assert!(compiled.status.success(), "{}", errors(&compiled));
    built
}

/// Starts a server, and returns it with what it says first.
fn served(folder: &Path, args: &[&str]) -> (Child, Value) {
    let args = [&["serve"], args].concat();
    let mut server = command(folder, &args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let mut line = String::new();
    BufReader::new(server.stdout.as_mut().expect("a pipe")).read_line(&mut line).expect("a line");
    (server, serde_json::from_str(&line).expect("JSON"))
}

fn ended(mut server: Child) -> (i32, String) {
    let mut said = String::new();
    server.stderr.as_mut().expect("a pipe").read_to_string(&mut said).expect("words");
    (server.wait().expect("it ends").code().expect("no signal"), said)
}

/// Words of a line of the client: step, arena, reward, ends, level, and the bits of the observation.
struct Line {
    arena: usize,
    reward: f32,
    ended: bool,
    level: u64,
    seen: Vec<u32>,
}

fn lines(text: &str) -> Vec<Line> {
    let line = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |at: usize| words[at].parse::<u64>().expect("a number");
        let bits = |word: &&str| u32::from_str_radix(word, 16).expect("bits");
        Line {
            arena: number(1) as usize,
            reward: words[2].parse().expect("a number"),
            ended: number(3) + number(4) > 0,
            level: number(5),
            seen: words[6..].iter().map(bits).collect(),
        }
    };
    text.lines().map(line).collect()
}

#[test]
fn a_client_in_c_sees_what_a_world_shows_that_is_played_directly() {
    const ACTION: u32 = 8;
    let folder = tempfile::tempdir().expect("a folder");
    let client = client(folder.path());
    let words = ["coinrun", "--levels", "hard:0..99", "--arenas", "3", "--once", "--listen", "socket"];
    let (server, begun) = served(folder.path(), &words);
    assert_eq!((&begun["address"], &begun["protocol"]), (&"socket".into(), &1.into()));
    let played =
        Command::new(client).args(["socket", "0", "70", &ACTION.to_string()]).current_dir(folder.path()).output();
    let played = played.expect("it starts");
    assert!(played.status.success(), "{}", errors(&played));
    let (code, said) = ended(server);
    assert!(code == 0 && said.contains("C has left: after 71 steps"), "{code}: {said}");
    assert!(!folder.path().join("socket").exists());

    let all = lines(&String::from_utf8(played.stdout).expect("text"));
    let mut ends = 0;
    for arena in 0..3 {
        let level = arena as u64;
        let (mut world, agents) = build_world(&CoinRun::default(), "hard", 0, 0, 1);
        world.entity_mut(agents[0]).insert((
            Control::Bot,
            LevelQueue::Always(level),
            Action(ActionValue::Discrete(ACTION)),
        ));
        let mut before = 0.0;
        for line in all.iter().filter(|line| line.arena == arena) {
            assert_eq!((line.level, line.reward), (level, before));
            if line.ended {
                // The level was played for one episode.
                ends += 1;
                break;
            }
            world.tick().expect("sound");
            let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
            assert_eq!(line.seen, seen.iter().map(|number| number.to_bits()).collect::<Vec<u32>>());
            before = world.get::<Reward>(agents[0]).expect("a reward").get();
        }
    }
    assert!(ends > 0, "no episode ended");
}

#[test]
fn what_cannot_be_served_is_refused_before_a_socket_is_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    for (args, words) in [
        (&["serve", "coinrun", "--transport", "tcp", "--listen", "0.0.0.0:7000"][..], "take 127.0.0.1"),
        (&["serve", "coinrun", "--transport", "tcp", "--listen", "here"], "write 127.0.0.1:PORT"),
        (&["serve", "coinrun", "--listen", "127.0.0.1:7000"], "add --transport tcp"),
        (&["serve", "coinrun", "--listen", "no/such/folder/socket"], "no/such/folder/socket"),
        (&["serve", "coinrun", "--levels", "hardest:0..9"], "hardest"),
        (&["serve", "coinrun", "--arenas", "0"], "--arenas"),
        (&["serve", "nogame"], "unknown game"),
    ] {
        let refused = playbot(folder.path(), args);
        assert!(code(&refused) == 3 && errors(&refused).contains(words), "{args:?}: {}", errors(&refused));
        assert!(refused.stdout.is_empty());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_server_that_is_stopped_says_so_and_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let (server, _) = served(folder.path(), &["coinrun", "--listen", "socket"]);
    let stopped = Command::new("kill").args(["-TERM", &server.id().to_string()]).status().expect("kill is there");
    assert!(stopped.success());
    let (code, said) = ended(server);
    assert!(code == 143 && said.contains("stopping"), "{code}: {said}");
    assert!(!folder.path().join("socket").exists());
}
