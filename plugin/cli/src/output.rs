//! Output of verbs: lines of data, and files, tested before the work whose result they hold.
//!
//! The folder, in reading order:
//!
//! - `messages`: messages on standard error (`report!`), and text that cannot steer a terminal.
//! - `program`: the program's name in messages.
//! - `log`: the log of libraries and of games.

#[macro_use]
pub(crate) mod messages;
pub(crate) mod log;
pub(crate) mod program;

use crate::{
    error::CliError,
    output::{log::Repeats, messages::for_programs},
};
use playbot_harness::sealed_file::write_atomically;
use playbot_learner::{disk, disk::DiskFile};
use playbot_report::PlainTable;
use playbot_test::verdict::TestError;
use std::{
    fs::File,
    io::{self, IsTerminal, Write},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError, mpsc::Receiver},
};

/// Advice where nothing can be written.
const ELSEWHERE: &str = "make room or rights there, or name a file in another folder";

/// The standard output that the program was started with, while that of the process leads to standard error.
static DATA: Mutex<Option<File>> = Mutex::new(None);

/// Prints one line of data.
///
/// # Errors
///
/// [`CliError::BrokenPipe`] if the reader is gone.
pub(crate) fn print_line(line: impl std::fmt::Display) -> Result<(), CliError> {
    write_data(&format!("{}\n", for_programs(&line.to_string())))
}

fn write_data(text: &str) -> Result<(), CliError> {
    let mut data = DATA.lock().unwrap_or_else(PoisonError::into_inner);
    let written = match data.as_mut() {
        Some(data) => data.write_all(text.as_bytes()),
        None => io::stdout().lock().write_all(text.as_bytes()),
    };
    written.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        _ => CliError::Io(format!("cannot write to standard output: {error}")),
    })
}

/// Standard output for data that is no text.
pub(crate) struct DataStream;

impl Write for DataStream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match DATA.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            Some(data) => data.write(bytes),
            None => io::stdout().lock().write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match DATA.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            Some(data) => data.flush(),
            None => io::stdout().lock().flush(),
        }
    }
}

/// Returns whether data is shown on a terminal.
pub(crate) fn shows_on_terminal() -> bool {
    match DATA.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
        Some(data) => data.is_terminal(),
        None => io::stdout().is_terminal(),
    }
}

/// Prints a picture for a terminal, whose characters steer it.
///
/// # Errors
///
/// [`CliError::BrokenPipe`] if the reader is gone.
pub(crate) fn print_picture(shown: &str) -> Result<(), CliError> {
    write_data(shown)
}

/// Prints a table of data. On a terminal it is no wider than that, if words can be shortened; elsewhere it is whole.
///
/// # Errors
///
/// [`CliError::BrokenPipe`] if the reader is gone.
pub(crate) fn print_table(table: &PlainTable) -> Result<(), CliError> {
    let terminal = match DATA.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
        Some(data) => terminal_size::terminal_size_of(data),
        None => terminal_size::terminal_size_of(io::stdout()),
    };
    let width = terminal.map_or(usize::MAX, |(width, _)| width.0.into());
    print_line(table.to_text_within(width).trim_end())
}

/// While this lives, what games print by `println!` goes to standard error, so that standard output holds the data of the
/// verb alone. On Unix only: elsewhere it has no effect.
pub(crate) struct GamesPrintElsewhere {
    /// Hears when the last line has been passed on. `None` if lines are not looked at.
    #[cfg_attr(not(unix), allow(dead_code, reason = "standard output is redirected on Unix only"))]
    passed_on: Option<Receiver<()>>,
}

impl GamesPrintElsewhere {
    /// Redirects standard output of the process. Equal lines are written once and counted, as messages of the log are. If
    /// the system refuses, all is printed as before.
    pub fn begin(repeats: &Repeats) -> Self {
        #[cfg(unix)]
        {
            let begun = if repeats.collapses() { redirect_lines(repeats) } else { redirect() };
            let (own, passed_on) = begun.or_else(|_| redirect()).ok().unzip();
            *DATA.lock().unwrap_or_else(PoisonError::into_inner) = own;
            Self { passed_on: passed_on.flatten() }
        }
        #[cfg(not(unix))]
        {
            let _ = repeats;
            Self { passed_on: None }
        }
    }
}

/// The former standard output, and the end of a thread that passes lines on.
#[cfg(unix)]
type Redirected = (File, Option<Receiver<()>>);

/// Lets the file of standard output be that of standard error.
#[cfg(unix)]
fn redirect() -> io::Result<Redirected> {
    use std::os::fd::AsFd;
    let own = io::stdout().as_fd().try_clone_to_owned()?;
    rustix::stdio::dup2_stdout(io::stderr().as_fd())?;
    Ok((own.into(), None))
}

/// Lets standard output be a pipe, whose lines a thread passes on to standard error.
#[cfg(unix)]
fn redirect_lines(repeats: &Repeats) -> io::Result<Redirected> {
    use std::os::fd::AsFd;
    let own = io::stdout().as_fd().try_clone_to_owned()?;
    let (reader, writer) = io::pipe()?;
    let (passing, passed_on) = std::sync::mpsc::channel();
    let repeats = repeats.clone();
    std::thread::Builder::new().name("games print".to_owned()).spawn(move || {
        pass_on(io::BufReader::new(reader), io::stderr(), &repeats);
        // The other end hears that it is gone.
        drop(passing);
    })?;
    // From now on standard output alone has the pipe open, so its lines end as soon as it is another file again.
    rustix::stdio::dup2_stdout(&writer)?;
    Ok((own.into(), Some(passed_on)))
}

/// Longest line that games print whole, in bytes: one without an end would fill the memory.
#[cfg(any(unix, test))]
const LONGEST_LINE: u64 = 16 * 1024;

/// Passes on lines that were not there before, without empty ones, and counts the others, until there are no more.
#[cfg(any(unix, test))]
fn pass_on(mut lines: impl io::BufRead, mut to: impl Write, repeats: &Repeats) {
    use io::{BufRead, Read};
    let mut line = Vec::new();
    while lines.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line).is_ok_and(|read| read > 0) {
        let text = String::from_utf8_lossy(line.trim_ascii_end());
        if !text.is_empty() && repeats.is_new(text.into_owned(), true, None) {
            if !line.ends_with(b"\n") {
                line.push(b'\n');
            }
            // Standard error may be closed. Lines are read all the same: a game would wait, or fail, if they were not.
            let _ = to.write_all(&line);
        }
        line.clear();
    }
}

impl Drop for GamesPrintElsewhere {
    fn drop(&mut self) {
        let own = DATA.lock().unwrap_or_else(PoisonError::into_inner).take();
        #[cfg(unix)]
        if let Some(own) = own {
            // A game may have begun a line. If standard error is closed, its words are lost.
            let _ = io::stdout().flush();
            let _ = rustix::stdio::dup2_stdout(&own);
            // A program that a game has started may have the pipe open, and never end.
            if let Some(passed_on) = &self.passed_on {
                let _ = passed_on.recv_timeout(std::time::Duration::from_secs(1));
            }
        }
        #[cfg(not(unix))]
        drop(own);
    }
}

/// [Prepares](prepare) a file that is overwritten only with `--force`.
///
/// # Errors
///
/// There is one and it was not asked for, or as for [`prepare`].
pub(crate) fn prepare_new(path: &Path, force: bool) -> Result<(), CliError> {
    if path.is_file() && !force {
        let path = path.display();
        return Err(CliError::Usage(format!("{path} exists: name another file, or overwrite it with --force")));
    }
    prepare(path)
}

/// Makes the folder of a file, and tests whether the file can be written.
///
/// # Errors
///
/// The path is a folder's, or the system refuses.
pub(crate) fn prepare(path: &Path) -> Result<(), CliError> {
    if path.is_dir() {
        return Err(CliError::Usage(format!("{} is a folder: name a file to write", path.display())));
    }
    make_folder_of(path)?;
    let probe = beside(path, ".probe");
    DiskFile::create(&probe)
        .and_then(|_| disk::remove_file(&probe))
        .map_err(|error| CliError::Io(format!("cannot write {}: {error}; {ELSEWHERE}", path.display())))
}

/// Makes the folder of a file.
///
/// # Errors
///
/// The system refuses.
pub(crate) fn make_folder_of(path: &Path) -> Result<(), CliError> {
    let folder = path.parent().unwrap_or(path);
    disk::create_dir_all(folder)
        .map_err(|error| CliError::Io(format!("cannot create {}: {error}; {ELSEWHERE}", folder.display())))
}

/// Checks that the path of a folder to write into is not a file's.
///
/// # Errors
///
/// It is.
pub(crate) fn check_folder(folder: &Path) -> Result<(), CliError> {
    if folder.is_file() {
        return Err(CliError::Usage(format!("{} is a file: name a folder to write into", folder.display())));
    }
    Ok(())
}

/// Makes a folder to write into.
///
/// # Errors
///
/// The path is a file's, or the system refuses.
pub(crate) fn make_folder(folder: &Path) -> Result<(), CliError> {
    check_folder(folder)?;
    disk::create_dir_all(folder).map_err(|error| {
        CliError::Io(format!(
            "cannot create {}: {error}; make room or rights there, or name another folder",
            folder.display()
        ))
    })
}

/// Writes a file, and makes its folder.
///
/// # Errors
///
/// The folder or the file cannot be written.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    make_folder_of(path)?;
    Ok(write_atomically(path, bytes)?)
}

/// Prints data, or writes it to a new file if one is named.
///
/// # Errors
///
/// There is such a file already, or it cannot be written.
pub(crate) fn print_or_write(data: &str, out: Option<&Path>) -> Result<(), CliError> {
    if let Some(path) = out.filter(|path| path.exists()) {
        return Err(CliError::Usage(format!(
            "{} exists already; nothing was written: name another --out, or remove that file first",
            path.display()
        )));
    }
    print_or_replace(data, out)
}

/// Prints data, or writes it to a file if one is named, which is replaced if it is there.
///
/// # Errors
///
/// It cannot be written.
pub(crate) fn print_or_replace(data: &str, out: Option<&Path>) -> Result<(), CliError> {
    let Some(path) = out else { return print_line(data) };
    write(path, format!("{data}\n").as_bytes())?;
    report!("written: {}", path.display());
    Ok(())
}

/// Returns the file in the same folder whose name goes on with `ending`.
pub(crate) fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(ending);
    path.with_file_name(name)
}

/// Parses the path of a PNG.
///
/// # Errors
///
/// Its name ends otherwise.
pub(crate) fn png(text: &str) -> Result<PathBuf, String> {
    of_kind(text, "picture", "png")
}

/// Parses the path of an SVG.
///
/// # Errors
///
/// Its name ends otherwise.
pub(crate) fn svg(text: &str) -> Result<PathBuf, String> {
    of_kind(text, "picture", "svg")
}

/// Parses the path of a page.
///
/// # Errors
///
/// Its name ends otherwise.
pub(crate) fn html(text: &str) -> Result<PathBuf, String> {
    of_kind(text, "page", "html")
}

/// Parses the path of a recording. Folders of recordings are read by this ending.
///
/// # Errors
///
/// Its name ends otherwise.
pub(crate) fn demo(text: &str) -> Result<PathBuf, String> {
    of_kind(text, "recording", "demo")
}

/// Parses the path of a finding. Folders of findings are read by this ending.
///
/// # Errors
///
/// Its name ends otherwise.
pub(crate) fn finding(text: &str) -> Result<PathBuf, String> {
    of_kind(text, "finding", "finding")
}

fn of_kind(text: &str, what: &str, kind: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(kind)) {
        Ok(path)
    } else {
        Err(format!("this {what} is written as .{kind}: choose a name that ends so"))
    }
}

/// Describes something with the first few names of its parts, if they have any.
pub(crate) fn with_names(what: &str, names: &[String]) -> String {
    const SHOWN: usize = 6;
    if names.is_empty() {
        return what.to_owned();
    }
    let more = if names.len() > SHOWN { ", …" } else { "" };
    format!("{what}: {}{more}", names[..names.len().min(SHOWN)].join(", "))
}

/// Adds advice, and the list of whole files, to an error of writing; other errors have their own.
pub(crate) fn with_advice(error: TestError, next: &str) -> CliError {
    match error {
        TestError::Io { action, path, source } if action != "read" => {
            CliError::Io(format!("cannot {action} {}: {source}; {next}", path.display()))
        }
        error => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, io};

    use super::*;

    #[test]
    fn a_wrong_kind_of_place_is_the_callers_and_a_closed_one_the_systems() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = temporary.path();
        let file = folder.join("file");
        fs::write(&file, "in the way").expect("writable");
        let said = |result: Result<(), CliError>| {
            let error = result.expect_err("refused");
            (error.exit_code(), error.to_string())
        };
        for (result, code, words) in [
            (prepare(folder), 3, "is a folder: name a file to write"),
            (prepare(&file.join("below")), 2, "make room or rights there, or name a file in another folder"),
            (make_folder(&file), 3, "is a file: name a folder to write into"),
            (make_folder(&file.join("below")), 2, "make room or rights there, or name another folder"),
        ] {
            let (exit, text) = said(result);
            assert!(exit == code && text.contains(words), "{exit}: {text}");
        }
        prepare(&folder.join("new/a")).expect("the folder is made");
        make_folder(&folder.join("new/b")).expect("the folder is made");
        assert_eq!(fs::read_dir(folder.join("new")).expect("there").count(), 1, "no probe is left");
    }

    #[test]
    fn data_goes_to_a_new_file_and_over_no_other() {
        let temporary = tempfile::tempdir().expect("a folder");
        let path = temporary.path().join("new/level.json");
        print_or_write("{}", Some(&path)).expect("writable");
        let error = print_or_write("[]", Some(&path)).expect_err("taken");
        assert!(error.exit_code() == 3 && error.to_string().contains("name another --out"), "{error}");
        assert_eq!(fs::read_to_string(&path).expect("written"), "{}\n");
    }

    /// Returns what is passed on of what a game prints, and the lines about the rest.
    fn passed_on(printed: &[u8]) -> (String, Vec<String>) {
        let (mut out, repeats) = (Vec::new(), Repeats::default());
        pass_on(printed, &mut out, &repeats);
        (String::from_utf8_lossy(&out).into_owned(), repeats.lines())
    }

    #[test]
    fn equal_lines_of_a_game_are_passed_on_once_and_counted() {
        let (text, counts) = passed_on(b"jump\n\nscore 1\njump\r\n \nscore 2\njump\nlast");
        assert_eq!(text, "jump\nscore 1\nscore 2\nlast\n");
        assert_eq!(counts[1..], ["  2 times more: jump"]);
        let (text, counts) = passed_on(b"a\xffb\n\x1b[31mred\x1b[0m\n");
        assert_eq!((text.as_str(), counts.len()), ("a\u{fffd}b\n\u{1b}[31mred\u{1b}[0m\n", 0));
    }

    #[test]
    fn a_line_without_an_end_is_passed_on_in_parts() {
        let longest = LONGEST_LINE as usize;
        let (text, counts) = passed_on(&[vec![b'a'; longest], vec![b'b'; 5]].concat());
        assert_eq!(text, format!("{}\nbbbbb\n", "a".repeat(longest)));
        assert!(counts.is_empty(), "{counts:?}");
    }

    #[test]
    fn only_the_first_names_are_listed() {
        assert_eq!(with_names("3 values", &[]), "3 values");
        let names: Vec<String> = (0..7).map(|number| format!("x{number}")).collect();
        assert_eq!(with_names("2 values", &names[..2]), "2 values: x0, x1");
        assert_eq!(with_names("7 values", &names), "7 values: x0, x1, x2, x3, x4, x5, …");
    }

    #[test]
    fn a_full_disk_says_what_to_do_and_wrong_usage_stays_that() {
        let refused = |action, kind: io::ErrorKind| {
            let source = io::Error::from(kind);
            TestError::Io { action, path: "a/report.html".into(), source }
        };
        let words = with_advice(refused("write", io::ErrorKind::StorageFull), "make room").to_string();
        assert!(words.starts_with("cannot write a/report.html: ") && words.ends_with("; make room"), "{words}");
        assert_eq!(words.matches("; ").count(), 1, "one next step is enough: {words}");
        let words = with_advice(refused("read", io::ErrorKind::PermissionDenied), "make room").to_string();
        assert!(!words.ends_with("; make room"), "nothing is known to be whole: {words}");
        assert_eq!(with_advice(TestError::NoTester, "make room").exit_code(), 3);
    }
}
