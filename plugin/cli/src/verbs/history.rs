//! `playbot history`, and the builds that `playbot test --history` adds.

use crate::{
    error::{CliError, Outcome},
    output::{self, print_line, print_table, program},
};
use playbot_harness::{game::Game, sealed_file::file_checksum};
use playbot_report::{PlainTable, counted};
use playbot_test::{
    history::{Build, Course, History, LevelCourse, add, check_game, check_one_game, page, read},
    verdict::results_folder,
};
use serde_json::json;
use std::{
    env,
    path::{Path, PathBuf},
};

/// Variables of build servers that name the build.
const OF_SERVERS: [&str; 3] = ["GITHUB_SHA", "CI_COMMIT_SHORT_SHA", "GIT_COMMIT"];

/// Letters of a revision that name a build.
const REVISION: usize = 10;

/// Most changes of testers that are printed; the page has all.
const MOST_CHANGES: usize = 5;

/// Most levels in the table; the page and JSON have more.
const MOST_ROWS: usize = 40;

/// Show levels and findings over the builds of a game: since when a level is broken, and which are flaky.
///
/// The builds are those of a file that `playbot test --history FILE` adds to, or folders of results, the oldest first. A
/// level is broken since the first build after which it was never solved without findings again. It is flaky if the same
/// bytes of game and level gave both; where those of the game are unknown, as in folders, if it changed three times or
/// more. A flaky level is broken, too, once it fails in more builds in a row than before. If the testers changed, builds
/// are compared by the testers that they share: a level is not comparable if its solvers take no part any more.
///
/// Exit code 1 if a level is broken or flaky.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot history history.jsonl
  playbot history history.jsonl --out history.html
  playbot history runs/monday runs/tuesday runs/wednesday --json")]
pub struct Args {
    /// The file of a history, or folders of results, the oldest first.
    #[arg(required = true, value_name = "PATH")]
    from: Vec<PathBuf>,
    /// Write a page with a square for each level and build, an .html.
    #[arg(long, value_name = "FILE", value_parser = output::html)]
    out: Option<PathBuf>,
    /// Print one line of JSON per level instead of a table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<Outcome, CliError> {
    args.out.as_deref().map(output::prepare).transpose()?;
    let history = match args.from.as_slice() {
        [file] if file.is_file() && results_folder(file) == file.as_path() => {
            let (history, damaged) = read(file)?;
            if !damaged.is_empty() {
                let lines: Vec<String> = damaged.iter().map(ToString::to_string).collect();
                report!(
                    "warning: {} is damaged in line {}, and those builds are left out",
                    file.display(),
                    lines.join(", ")
                );
            }
            history
        }
        folders => {
            let is_history = |path: &&PathBuf| path.is_file() && results_folder(path) == path.as_path();
            if let Some(file) = folders.iter().find(is_history) {
                return Err(CliError::Usage(format!(
                    "{} is a file: name the file of a history alone, or folders of results",
                    file.display()
                )));
            }
            let build =
                |path: &PathBuf| Build::of_results(results_folder(path), path.display().to_string(), None, None);
            History { builds: folders.iter().map(build).collect::<Result<_, _>>()? }
        }
    };
    check_one_game(&history)?;
    let courses = history.courses();
    if args.json {
        for course in &courses {
            print_line(json!(course))?;
        }
    } else if courses.iter().all(|level| level.course == Course::Sound) {
        print_line("every level was sound in every build")?;
    } else {
        print_table(&table(&courses))?;
    }
    let changes = history.changes_of_testers();
    changes.iter().take(MOST_CHANGES).for_each(|change| report!("the testers changed in {change}"));
    if changes.len() > MOST_CHANGES {
        report!("and in {}", counted((changes.len() - MOST_CHANGES) as u64, "other build"));
    }
    if let Some(file) = &args.out {
        output::write(file, page(&history).as_bytes())?;
        report!("{}", file.display());
    }
    let count = |is: fn(&Course) -> bool| courses.iter().filter(|level| is(&level.course)).count();
    let broken = count(|course| matches!(course, Course::Broken { .. }));
    let flaky = count(|course| matches!(course, Course::Flaky { .. }));
    let others = count(|course| matches!(course, Course::OtherTesters { .. }));
    let others = if others > 0 { format!(", {others} not comparable") } else { String::new() };
    report!(
        "{} over {}: {broken} broken, {flaky} flaky{others}",
        counted(courses.len() as u64, "level"),
        counted(history.builds.len() as u64, "build")
    );
    Ok(if broken + flaky > 0 { Outcome::Findings } else { Outcome::Pass })
}

/// Returns the table of the levels that are not always sound.
fn table(courses: &[LevelCourse]) -> PlainTable {
    let row = |level: &LevelCourse| {
        let found: Vec<&str> =
            level.findings.iter().filter(|finding| finding.is_there).map(|finding| finding.finding.as_str()).collect();
        vec![level.level.clone(), level.course.to_string(), found.join(", ")]
    };
    let unsound = courses.iter().filter(|level| level.course != Course::Sound);
    PlainTable {
        caption: format!("{} not always sound", counted(unsound.clone().count() as u64, "level")),
        columns: ["level", "course", "findings now"].map(str::to_owned).to_vec(),
        rows: unsound.take(MOST_ROWS).map(row).collect(),
    }
}

/// Checks that results of a game can be added to a file, before the test whose results they are.
///
/// # Errors
///
/// It is no history, or that of another game, or it cannot be written.
pub(crate) fn check_history(file: &Path, game: &dyn Game) -> Result<(), CliError> {
    output::prepare(file)?;
    if file.exists() {
        check_game(file, &read(file)?.0, game.name())?;
    }
    Ok(())
}

/// Adds the results of a test of a game, in a folder, to a history. Without a name the build has that of the build server's
/// revision, or a number.
///
/// # Errors
///
/// The results cannot be read, or the file is no history of this game.
pub(crate) fn add_results(file: &Path, folder: &Path, game: &dyn Game, name: Option<&str>) -> Result<(), CliError> {
    let of_server = || OF_SERVERS.iter().find_map(|name| env::var(name).ok()).filter(|revision| !revision.is_empty());
    let known = if file.exists() { read(file)?.0.builds.len() } else { 0 };
    let name =
        name.map(str::to_owned).or_else(|| of_server().map(|revision| revision.chars().take(REVISION).collect()));
    let name = name.unwrap_or_else(|| format!("build {}", known + 1));
    // A program that cannot be read plays all the same, and only less is known of it.
    let program = env::current_exe().ok().and_then(|path| file_checksum(&path).ok());
    add(file, &Build::of_results(folder, name.as_str(), program, Some(game))?)?;
    report!(
        "{} has {} now: `{} history {}`",
        file.display(),
        counted(known as u64 + 1, "build"),
        program::name(),
        file.display()
    );
    Ok(())
}
