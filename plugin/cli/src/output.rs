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

use crate::{error::CliError, output::messages::for_programs};
use playbot_harness::sealed_file::write_atomically;
use playbot_learner::{disk, disk::DiskFile};
use playbot_report::PlainTable;
use playbot_test::verdict::TestError;
use std::{
    fs::File,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
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
    let line = format!("{}\n", for_programs(&line.to_string()));
    let mut data = DATA.lock().unwrap_or_else(PoisonError::into_inner);
    let written = match data.as_mut() {
        Some(data) => data.write_all(line.as_bytes()),
        None => io::stdout().lock().write_all(line.as_bytes()),
    };
    written.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        _ => CliError::Io(format!("cannot write to standard output: {error}")),
    })
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
pub(crate) struct GamesPrintElsewhere(());

impl GamesPrintElsewhere {
    /// Redirects standard output of the process. If the system refuses, all is printed as before.
    pub fn begin() -> Self {
        #[cfg(unix)]
        {
            let own = redirect().ok();
            *DATA.lock().unwrap_or_else(PoisonError::into_inner) = own;
        }
        Self(())
    }
}

/// Lets the file of standard output be that of standard error, and returns the former.
#[cfg(unix)]
fn redirect() -> io::Result<File> {
    use std::os::fd::AsFd;
    let own = io::stdout().as_fd().try_clone_to_owned()?;
    rustix::stdio::dup2_stdout(io::stderr().as_fd())?;
    Ok(own.into())
}

impl Drop for GamesPrintElsewhere {
    fn drop(&mut self) {
        let own = DATA.lock().unwrap_or_else(PoisonError::into_inner).take();
        #[cfg(unix)]
        if let Some(own) = own {
            // A game may have begun a line. If standard error is closed, its words are lost.
            let _ = io::stdout().flush();
            let _ = rustix::stdio::dup2_stdout(&own);
        }
        #[cfg(not(unix))]
        drop(own);
    }
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

/// Makes a folder to write into.
///
/// # Errors
///
/// The path is a file's, or the system refuses.
pub(crate) fn make_folder(folder: &Path) -> Result<(), CliError> {
    if folder.is_file() {
        return Err(CliError::Usage(format!("{} is a file: name a folder to write into", folder.display())));
    }
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
    let Some(path) = out else { return print_line(data) };
    if path.exists() {
        return Err(CliError::Usage(format!(
            "{} exists already; nothing was written: name another --out, or remove that file first",
            path.display()
        )));
    }
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
