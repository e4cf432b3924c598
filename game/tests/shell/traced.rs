//! Tests of files from strangers, with the system calls of the program: it opens no connection, starts no other
//! program, and writes nothing outside of its folder. Read-only verbs write nothing at all.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

use crate::program::done;

const PROGRAM: &str = env!("CARGO_BIN_EXE_playbot");
const LOG: &str = "calls.txt";
/// Calls of the system that concern connections and files.
const TRACE: [&str; 6] = ["-f", "-qq", "-e", "trace=%network,%file", "-o", LOG];

/// Calls that change names, contents or rights.
const CHANGES: [&str; 14] = [
    "creat", "rename", "unlink", "rmdir", "mkdir", "link", "symlink", "mknod", "truncate", "chmod", "fchmodat",
    "chown", "lchown", "fchownat",
];
const WRITES: [&str; 5] = ["O_WRONLY", "O_RDWR", "O_CREAT", "O_TRUNC", "O_APPEND"];
const CONNECTIONS: [&str; 7] = ["socket", "connect", "bind", "listen", "accept", "send", "recv"];

/// Returns true if processes can be traced here.
fn can_watch(folder: &Path) -> bool {
    let mut watched = Command::new("strace");
    watched.args(TRACE).arg("true").current_dir(folder).stderr(Stdio::null());
    watched.status().is_ok_and(|status| status.success())
}

/// Returns the system calls of the program, a line each: the number of the process, the call, and its arguments.
fn calls(folder: &Path, line: &str) -> Vec<String> {
    let mut watched = Command::new("strace");
    watched.args(TRACE).arg(PROGRAM).args(line.split(' ')).current_dir(folder);
    let output = playbot_shell::output(&mut watched).expect("strace starts");
    let code = output.status.code();
    assert_eq!(code, Some(0), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    let text = fs::read_to_string(folder.join(LOG)).expect("written");
    text.lines().map(str::to_owned).collect()
}

/// Returns the name and arguments of a call.
fn split(call: &str) -> Option<(&str, &str)> {
    let (_, call) = call.split_once(' ')?;
    call.trim_start().split_once('(')
}

/// Returns the texts between quotes.
fn paths(arguments: &str) -> impl Iterator<Item = &str> {
    arguments.split('"').skip(1).step_by(2)
}

fn is_change(name: &str, arguments: &str) -> bool {
    let opens = name.starts_with("open") && WRITES.iter().any(|flag| arguments.contains(flag));
    let plain = name.trim_end_matches('2');
    opens || CHANGES.contains(&plain) || plain.strip_suffix("at").is_some_and(|plain| CHANGES.contains(&plain))
}

/// Returns true if the started program is the program itself.
fn is_program(arguments: &str) -> bool {
    let name = |path: &str| Path::new(path).file_name().map(ToOwned::to_owned);
    paths(arguments).next().and_then(name) == name(PROGRAM)
}

/// Returns true if a path can only lie in the folder.
fn is_inside(path: &str) -> bool {
    !Path::new(path).is_absolute() && !path.split('/').any(|part| part == "..")
}

/// Makes recordings, a policy, an experiment and a level, as if they had been sent.
fn strangers(folder: &Path) {
    done(folder, &["record", "coinrun", "--levels", "easy:0..3", "--noise", "0.2", "--out", "strange.demo"]);
    let bytes = fs::read(folder.join("strange.demo")).expect("recorded");
    fs::write(folder.join("torn.demo"), &bytes[..bytes.len() - 5]).expect("writable");
    let lander = concat!(env!("CARGO_MANIFEST_DIR"), "/../plugin/examples/lander.policy");
    fs::copy(lander, folder.join("strange.policy")).expect("part of the repository");
    let (experiment, _) = done(folder, &["config", "show", "--set", "demos=strange.demo"]);
    fs::write(folder.join("strange.ron"), experiment).expect("writable");
    let (level, _) = done(folder, &["level", "coinrun", "--level", "3", "--json"]);
    fs::write(folder.join("strange.json"), level).expect("writable");
}

#[test]
fn files_from_strangers_open_no_connection_and_write_nothing_elsewhere() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    if !can_watch(folder) {
        eprintln!("skipped: strace is missing here, or may not watch: `apt-get install strace`");
        return;
    }
    strangers(folder);
    for (line, read, may_write) in [
        ("demo verify strange.demo", "strange.demo", false),
        ("demo show strange.demo", "strange.demo", false),
        ("demo ls strange.demo", "strange.demo", false),
        ("policy show strange.policy", "strange.policy", false),
        ("config show --experiment strange.ron", "strange.ron", false),
        ("level coinrun --file strange.json --json", "strange.json", false),
        ("eval --bot random --levels files:strange.json", "strange.json", false),
        ("demo repair torn.demo --out whole.demo", "torn.demo", true),
        ("view coinrun --demo strange.demo --episode --out seen.png", "strange.demo", true),
        ("test coinrun --levels files:strange.json --out tested", "strange.json", true),
    ] {
        let calls = calls(folder, line);
        let calls: Vec<_> = calls.iter().filter_map(|call| split(call)).collect();
        let opens = |(name, arguments): &(&str, &str)| name.starts_with("open") && arguments.contains(read);
        assert!(calls.iter().any(opens), "{line}: {read} is read, so the calls are seen");
        let mut written = 0;
        for (name, arguments) in calls {
            let what = format!("{line}: {name}({arguments}");
            assert!(!CONNECTIONS.iter().any(|connection| name.starts_with(connection)), "a connection: {what}");
            assert!(!name.starts_with("execve") || is_program(arguments), "another program: {what}");
            if is_change(name, arguments) {
                written += 1;
                assert!(may_write, "it only reads: {what}");
                assert!(paths(arguments).all(is_inside), "outside of the folder: {what}");
            }
        }
        assert_eq!(written > 0, may_write, "{line}");
    }
}
