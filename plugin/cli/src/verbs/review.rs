//! `playbot review`.
//!
//! The folder, in reading order:
//!
//! - `listed`: findings of a folder, with what was decided on them.
//! - `terminal`: pictures in a terminal.

mod listed;
mod terminal;

use crate::{
    arguments::check_start,
    error::{CliError, Outcome},
    output,
    output::{print_line, print_picture, program, shows_on_terminal},
    pictures::episode_world::EpisodeStep,
    progress::interrupt::{self, NothingToSave},
    verbs::{
        replay,
        replay::{ReplayReport, described, last_tick, play_again},
        review::{
            listed::{ListedFinding, list},
            terminal::PictureForm,
        },
    },
};
use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{
    brief::shell_word,
    game::Game,
    games::{Artifact, Games},
};
use playbot_learner::write_atomically;
use playbot_report::counted;
use playbot_test::{
    findings::{Date, FINDINGS, Pin, Pins, StoredFinding},
    verdict::results_folder,
};
use std::{
    env, fs,
    io::{self, BufRead, IsTerminal, Read},
    path::{Path, PathBuf},
};

#[cfg(not(feature = "window"))]
use crate::verbs::play::no_window;
#[cfg(feature = "window")]
use std::process::{Command, Stdio};

/// Days for which a finding is pinned by default.
const DAYS: u16 = 90;

/// Longest line of answers that is read, bytes.
const MOST_BYTES: u64 = 64 << 10;

/// Length of the longer side of a picture, pixels.
const LENGTH: u32 = 384;

/// Most numbers of an observation to print.
const MOST_NUMBERS: usize = 8;

/// Go through the findings of a test one by one, and decide on each: keep it as a regression test, pin it with a reason, or
/// leave it for later.
///
/// Each finding is played again and shown: as a picture if the terminal shows pictures, or else as the plan of the level
/// with the path on it. The answer is a letter and Enter:
///
/// k keeps it: its file is copied to --regressions, whose findings `playbot test --regress DIR` plays. p pins it with a reason
/// and a last day in the pins.ron of the folder: until then neither `test` nor `test --regress` counts it. i ignores it for
/// now, and the next review shows it again. o opens it in a window. s stops. ? explains the letters.
///
/// Each decision is on the disk before the next finding is shown. A further review shows the findings without a decision,
/// and those whose pin has expired. Answers are read from standard input, so a script can give them.
///
/// Exit code 1 if a finding is left without a decision.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot review runs/test
  playbot review runs/test --all
  playbot review runs/test --regressions tests/regressions
  playbot review runs/test --picture text
  playbot review runs/test --json   all findings, and what was decided
  yes k | playbot review runs/test   keep all of them")]
pub struct Args {
    /// Folder of a test, or of findings.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Folder for findings that are kept as regression tests.
    #[arg(long, value_name = "DIR", default_value = "regressions")]
    regressions: PathBuf,
    /// Also show the findings that were decided on.
    #[arg(long)]
    all: bool,
    /// The form of pictures.
    #[arg(long, value_name = "FORM", value_enum, default_value_t = PictureForm::Auto)]
    picture: PictureForm,
    /// Print one line of JSON per finding with its decision, and ask nothing.
    #[arg(long, conflicts_with = "all")]
    json: bool,
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    let folder = results_folder(&args.folder);
    check_regressions(folder, &args.regressions)?;
    let mut findings = list(folder, &args.regressions)?;
    let undecided = |findings: &[ListedFinding]| findings.iter().filter(|one| one.decision.is_none()).count();
    if args.json {
        for finding in &findings {
            let line = serde_json::to_string(finding)
                .map_err(|error| CliError::Io(format!("the findings cannot be written as JSON: {error}")))?;
            print_line(line)?;
        }
    } else if findings.is_empty() {
        report!("{} has no findings: there is nothing to decide", folder.display());
    } else if undecided(&findings) == 0 && !args.all {
        report!("{}; --all shows them again", sums(&findings));
    } else {
        let shown = |finding: &ListedFinding| args.all || finding.decision.is_none();
        let count = findings.iter().filter(|finding| shown(finding)).count();
        let order: Vec<usize> = (0..findings.len()).filter(|index| shown(&findings[*index])).collect();
        let session = Session {
            folder,
            regressions: &args.regressions,
            form: match args.picture {
                PictureForm::Auto => PictureForm::of_terminal(shows_on_terminal(), &|name| env::var(name).ok()),
                form => form,
            },
            games,
        };
        interrupt::leave("all decisions so far are kept".to_owned());
        interrupt::go_on_with(format!("`{} review {}`", program::name(), word(&args.folder)));
        let _stops_at_once = NothingToSave::listen();
        let mut answers = Answers::of(io::stdin().lock(), io::stdin().is_terminal());
        for (number, index) in order.into_iter().enumerate() {
            print_line(format!("\nfinding {} of {count}: {}", number + 1, findings[index].title()))?;
            session.show(&findings[index])?;
            match session.decide(&mut findings[index], &mut answers)? {
                Next::Finding => {}
                Next::Stop => break,
            }
        }
        if !answers.were_given && !answers.is_terminal {
            return Err(CliError::Usage(
                "nothing was decided: standard input has no letters and is no terminal; call this in a terminal, give it \
                 letters as in `echo k | …`, or list the findings with --json"
                    .to_owned(),
            ));
        }
        report!("{}", sums(&findings));
    }
    Ok(if undecided(&findings) == 0 { Outcome::Pass } else { Outcome::Findings })
}

/// Returns the number of findings, and what was decided on them.
fn sums(findings: &[ListedFinding]) -> String {
    let count = |name: &str| findings.iter().filter(|finding| finding.decision == Some(name)).count();
    let [kept, pinned] = [listed::KEPT, listed::PINNED].map(count);
    let all = findings.len();
    format!("{}: {kept} kept, {pinned} pinned, {} left", counted(all as u64, "finding"), all - kept - pinned)
}

/// Returns a path as a word of a shell.
fn word(path: &Path) -> String {
    shell_word(&path.display().to_string())
}

/// Checks that kept findings do not go where those of a test are, which the next test clears.
fn check_regressions(folder: &Path, regressions: &Path) -> Result<(), CliError> {
    let same = |other: &Path| match (fs::canonicalize(other), fs::canonicalize(regressions)) {
        (Ok(other), Ok(regressions)) => other == regressions,
        _ => false,
    };
    if same(folder) || same(&folder.join(FINDINGS)) {
        return Err(CliError::Usage(format!(
            "--regressions {} is the folder of the findings themselves: name another one",
            regressions.display()
        )));
    }
    if regressions.is_file() {
        return Err(CliError::Usage(format!("--regressions {} is a file: name a folder", regressions.display())));
    }
    Ok(())
}

/// The answers of a user or of a script.
struct Answers<R> {
    lines: R,
    is_terminal: bool,
    /// Whether there was one.
    were_given: bool,
}

impl<R: BufRead> Answers<R> {
    fn of(lines: R, is_terminal: bool) -> Self {
        Self { lines, is_terminal, were_given: false }
    }

    /// Asks, and returns the next line without blanks around it; `None` at the end of the input.
    fn ask(&mut self, question: &str) -> Result<Option<String>, CliError> {
        begin_report!("{question} ");
        let mut line = Vec::new();
        let read = self.lines.by_ref().take(MOST_BYTES).read_until(b'\n', &mut line);
        let count = read.map_err(|error| CliError::Io(format!("cannot read standard input: {error}")))?;
        let text = String::from_utf8_lossy(&line).trim().to_owned();
        // On a terminal the user has typed it.
        if !self.is_terminal || count == 0 {
            report!("{text}");
        }
        self.were_given |= count > 0;
        Ok((count > 0).then_some(text))
    }
}

/// What follows a finding.
enum Next {
    Finding,
    Stop,
}

/// A review.
struct Session<'a> {
    /// Folder of the findings, and of pins.
    folder: &'a Path,
    regressions: &'a Path,
    form: PictureForm,
    games: &'a Games<'a>,
}

impl Session<'_> {
    /// Shows a finding, as far as it can be played. What keeps it from being shown is no error: it can be decided on all
    /// the same.
    fn show(&self, finding: &ListedFinding) -> Result<(), CliError> {
        if let Some(pin) = &finding.pin {
            let word = if pin.expired { "was pinned until" } else { "is pinned until" };
            print_line(format!("it {word} {}: {}", pin.until, pin.reason))?;
        }
        if let Some(file) = &finding.kept {
            print_line(format!("it is kept as {}", file.display()))?;
        }
        let Some(path) = &finding.path else {
            return print_line(finding.problem.as_deref().unwrap_or_default());
        };
        let stored = match StoredFinding::read(path) {
            Ok(stored) => stored,
            Err(error) => return print_line(error.to_string()),
        };
        match self.play(path, &stored) {
            Err(CliError::BrokenPipe) => Err(CliError::BrokenPipe),
            Err(error) => {
                print_line(described(&stored))?;
                print_line(format!("it cannot be played: {}", program::named(&error.to_string())))
            }
            Ok(()) => Ok(()),
        }
    }

    fn play(&self, path: &Path, stored: &StoredFinding) -> Result<(), CliError> {
        let game = self.games.of_file(Artifact::Finding, path, &stored.header.game)?;
        let finding = stored.clone().seen_from(game, path);
        check_start(game, &finding.header.mode, finding.episode.level_seed)?;
        let again = play_again(game, &finding)?;
        let edited = finding.edited_level(game);
        let edited = edited.as_deref();
        let report = ReplayReport { path, finding: stored, again: &again, edited, shorter: None, is_stopped: false };
        print_line(report.sentence())?;
        let mut finding = finding;
        // The level as it is now is the one to show.
        if let (Some(_), Some(now)) = (edited, &again.replayed.level_file) {
            finding.episode.level_file = Some(now.clone());
        }
        match self.form {
            PictureForm::None => Ok(()),
            PictureForm::Text | PictureForm::Auto => print_line(in_characters(game, &finding)?),
            form => match last_tick(game, &finding, LENGTH)? {
                Some(png) => print_picture(&form.show(&png)?.unwrap_or_default()),
                None => print_line(in_characters(game, &finding)?),
            },
        }
    }

    /// Asks for a decision on a finding, and carries it out.
    fn decide(&self, finding: &mut ListedFinding, answers: &mut Answers<impl BufRead>) -> Result<Next, CliError> {
        loop {
            let Some(answer) = answers.ask("[k]eep [p]in [i]gnore [o]pen [s]top [?]")? else { return Ok(Next::Stop) };
            match answer.to_lowercase().as_str() {
                "k" | "keep" => {
                    if self.keep(finding)? {
                        return Ok(Next::Finding);
                    }
                }
                "p" | "pin" => match self.pin(finding, answers)? {
                    Some(true) => return Ok(Next::Finding),
                    Some(false) => {}
                    None => return Ok(Next::Stop),
                },
                "i" | "ignore" => return Ok(Next::Finding),
                "o" | "open" => match &finding.path {
                    Some(path) => open(path),
                    None => report!("there is no file to play"),
                },
                "s" | "stop" => return Ok(Next::Stop),
                "" => {}
                "?" | "h" | "help" => self.help(),
                other => {
                    report!("`{other}` is none of the letters");
                    self.help();
                }
            }
        }
    }

    fn help(&self) {
        let folder = word(self.regressions);
        report!(
            "k  keep it as a regression test in {folder}: `{} test --regress {folder}` fails as long as it happens\n\
             p  pin it with a reason and a last day: until then tests in this folder do not count it\n\
             i  ignore it for now: the next review shows it again\n\
             o  open it in a window\n\
             s  stop: what was decided is kept",
            program::name()
        );
    }

    /// Copies a finding to the regression tests. Returns false if it has no file.
    fn keep(&self, finding: &mut ListedFinding) -> Result<bool, CliError> {
        let (Some(path), Some(name)) = (&finding.path, &finding.finding) else {
            report!("it cannot be kept: it has no file");
            return Ok(false);
        };
        if let Err(error) = StoredFinding::read(path) {
            report!("it cannot be kept: {error}");
            return Ok(false);
        }
        let target = listed::kept_as(self.regressions, name);
        if target.exists() {
            report!("it is kept already, as {}", target.display());
        } else {
            let bytes =
                fs::read(path).map_err(|error| CliError::Io(format!("cannot read {}: {error}", path.display())))?;
            output::make_folder(self.regressions)?;
            write_atomically(&target, &bytes)
                .map_err(|error| CliError::Io(format!("cannot write {}: {error}", target.display())))?;
            report!("kept as {}", target.display());
        }
        finding.kept = Some(target);
        finding.decide();
        Ok(true)
    }

    /// Asks for a reason and a last day, and pins a finding. Returns false if nothing was pinned, and `None` at the end of
    /// the input.
    fn pin(&self, finding: &mut ListedFinding, answers: &mut Answers<impl BufRead>) -> Result<Option<bool>, CliError> {
        let Some(name) = &finding.finding else {
            report!("it cannot be pinned: pins name the file of a finding, and it has none");
            return Ok(Some(false));
        };
        let Some(reason) = answers.ask("reason:")? else { return Ok(None) };
        if reason.is_empty() {
            report!("nothing is pinned: a pin needs a reason");
            return Ok(Some(false));
        }
        let default = Date::in_days(DAYS);
        let until = loop {
            let Some(day) = answers.ask(&format!("last day (Enter for {default}):"))? else { return Ok(None) };
            match day.parse::<Date>() {
                _ if day.is_empty() => break default,
                Ok(day) if day < Date::today() => report!("{day} has passed: name today or a later day"),
                Ok(day) => break day,
                Err(error) => report!("{error}"),
            }
        };
        let file = Pins::add(self.folder, &Pin { finding: name.clone(), reason, until })?;
        report!("pinned until {until} in {}", file.display());
        finding.pin = Pins::read(self.folder)?.of(name, Date::today());
        finding.decide();
        Ok(Some(true))
    }
}

/// Returns the plan of the level in characters, with the path up to the finding. Without a plan these are the numbers of
/// the last observation.
///
/// # Errors
///
/// The finding cannot be played.
fn in_characters(game: &dyn Game, finding: &StoredFinding) -> Result<String, CliError> {
    let mut positions = Vec::new();
    let (steps, _) = replay::play(game, finding, &ObservationConfig::default(), 1, &mut |world, _| {
        positions.extend(world.position(game));
    })?;
    match game.tools().levels.floor_plan(&finding.header.mode, finding.episode.level_seed) {
        Some(plan) => {
            let path = if positions.is_empty() { "" } else { "  * path  X the finding" };
            let signs = format!("S start  G goal  # wall  ^ hazard  = platform{path}");
            Ok(format!("{}\n{signs}", plan.rows_with_path(&positions).join("\n")))
        }
        None => Ok(steps.last().map_or_else(
            || format!("`{}` has no plan of this level to show", game.name()),
            |last| numbers(game, last),
        )),
    }
}

/// Describes the last observation in numbers.
fn numbers(game: &dyn Game, step: &EpisodeStep) -> String {
    let names = game.observation().names;
    let shown = names.iter().zip(&step.vector).take(MOST_NUMBERS).map(|(name, value)| format!("{name} {value}"));
    let more = if step.vector.len() > MOST_NUMBERS { ", …" } else { "" };
    format!("tick {}, {}: {}{more}", step.tick, step.action, shown.collect::<Vec<_>>().join(", "))
}

/// Says that this program has no window.
#[cfg(not(feature = "window"))]
fn open(path: &Path) {
    report!("{}; `{} replay {} --apng FILE` draws it", no_window(), program::name(), word(path));
}

/// Plays a finding in a window of another process: a process opens one window only.
#[cfg(feature = "window")]
fn open(path: &Path) {
    let Ok(own) = program::file() else {
        return report!("call `{} replay {} --window`", program::name(), word(path));
    };
    let mut replay = Command::new(own);
    replay.arg("replay").arg(path).arg("--window").stdin(Stdio::null());
    // It says itself what went wrong.
    if let Err(error) = replay.status() {
        report!("`{} replay {} --window` does not start: {error}", program::name(), word(path));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::prelude::*;
    use playbot_harness::{floor_plan::FloorPlan, foreign::ForeignGame};
    use playbot_test::findings::{Checks, FindingHead, list_findings};

    /// A walk to the right of one unit in each tick; the game is lost behind the third.
    fn walk() -> ForeignGame {
        let plan = FloorPlan {
            bounds: Rect::new(0.0, 0.0, 6.0, 1.0),
            start: Vec2::new(0.5, 0.5),
            goal: Vec2::new(5.5, 0.5),
            ..FloorPlan::default()
        };
        ForeignGame::new("walk", 1, |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Name::new("walker"), Transform::from_xyz(0.5, 0.5, 0.0)));
            });
            app.add_systems(Update, |mut walkers: Query<&mut Transform, With<Name>>| {
                walkers.iter_mut().for_each(|mut walker| walker.translation.x += 1.0);
            });
        })
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["x"], |walkers: Query<&Transform, With<Name>>| [walkers.single().map_or(0.0, |at| at.translation.x)])
        .position(|walkers: Query<&Transform, With<Name>>| {
            walkers.single().map_or(Vec2::ZERO, |at| at.translation.truncate())
        })
        .plan(move |_| plan.clone())
        .time_limit(3)
    }

    /// Writes a finding of the walk below a folder of results, and returns its name.
    fn found(game: &dyn Game, folder: &Path, level: &str) -> String {
        let head =
            FindingHead { tester: Some("idle".to_owned()), ..FindingHead::new(level, "not-solved", "time is up") };
        let actions = vec![playbot_learner::ActionValue::Discrete(0); 3];
        let finding = StoredFinding::of_actions(game, "default", 0, head, &actions, &Checks::default());
        let finding = finding.expect("time is up");
        let below = folder.join(FINDINGS);
        fs::create_dir_all(&below).expect("writable");
        let name = finding.file_name();
        finding.write(&below.join(&name)).expect("writable");
        name.trim_end_matches(".finding").to_owned()
    }

    /// Answers the questions about the first finding of a folder. Returns it, and whether the review goes on.
    fn decided(folder: &Path, answers: &str) -> (ListedFinding, bool) {
        let (game, regressions) = (walk(), folder.join("kept"));
        let games: [&dyn Game; 1] = [&game];
        let games = Games::new(&games).expect("one game");
        let session = Session { folder, regressions: &regressions, form: PictureForm::Text, games: &games };
        let mut finding = list(folder, &regressions).expect("findings").remove(0);
        session.show(&finding).expect("it is shown");
        let next = session.decide(&mut finding, &mut Answers::of(answers.as_bytes(), false)).expect("decided");
        (finding, matches!(next, Next::Finding))
    }

    #[test]
    fn each_letter_does_what_the_help_says() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = temporary.path();
        let name = found(&walk(), folder, "default:0");
        let decision = |finding: &ListedFinding| finding.decision;
        for (answers, wanted) in [
            ("i\n", (None, true)),
            ("s\n", (None, false)),
            ("", (None, false)),
            ("?\n\nx\no\ni\n", (None, true)),
            ("p\n\ni\n", (None, true)),
            ("p\nthe artist is ill", (None, false)),
        ] {
            let (finding, goes_on) = decided(folder, answers);
            assert_eq!((decision(&finding), goes_on), wanted, "{answers:?}");
        }
        assert!(!folder.join("kept").exists() && !folder.join("pins.ron").exists(), "nothing was decided");
        let (finding, goes_on) = decided(folder, "p\nthe artist is ill\nsoon\n2001-01-01\n2099-01-31\n");
        assert_eq!((decision(&finding), goes_on), (Some("pinned"), true));
        let pin = Pins::read(folder).expect("pins").of(&name, Date::today()).expect("pinned");
        assert_eq!((pin.reason.as_str(), pin.until.to_string().as_str()), ("the artist is ill", "2099-01-31"));
        let (finding, _) = decided(folder, "K\n");
        assert_eq!(decision(&finding), Some("kept"));
        let kept = list_findings(&folder.join("kept")).expect("one");
        let bytes = |path: &Path| fs::read(path).expect("readable");
        assert_eq!((kept.len(), kept[0].0.as_str()), (1, name.as_str()));
        assert_eq!(bytes(&kept[0].1), bytes(&folder.join(FINDINGS).join(format!("{name}.finding"))));
        // One that is kept is not overwritten.
        fs::write(&kept[0].1, "shorter").expect("writable");
        decided(folder, "k\n");
        assert_eq!(bytes(&kept[0].1), b"shorter");
    }

    #[test]
    fn the_path_is_drawn_on_the_plan_and_without_a_plan_there_are_numbers() {
        let temporary = tempfile::tempdir().expect("a folder");
        let game = walk();
        let name = found(&game, temporary.path(), "default:0");
        let path = temporary.path().join(FINDINGS).join(format!("{name}.finding"));
        let finding = StoredFinding::read(&path).expect("written");
        let text = in_characters(&game, &finding).expect("it plays");
        let row = text.lines().next().expect("a row");
        assert!(row.starts_with('S') && row.contains("*X") && row.ends_with('G') && row.len() == 6, "{text}");
        assert!(text.ends_with("* path  X the finding"), "{text}");
        let bare = ForeignGame::new("walk", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::Space]]);
        let bare = bare.observe(["x", "y"], || [1.5, -2.0]).time_limit(3);
        assert_eq!(in_characters(&bare, &finding).expect("it plays"), "tick 2, nothing: x 1.5, y -2");
    }

    #[test]
    fn a_finding_that_cannot_be_played_can_be_pinned_but_not_kept_if_it_is_damaged() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = temporary.path();
        let name = found(&walk(), folder, "default:0");
        fs::write(folder.join(FINDINGS).join(format!("{name}.finding")), "no finding").expect("writable");
        let (finding, goes_on) = decided(folder, "k\np\nthe disk is full\n\n");
        assert_eq!((finding.decision, goes_on), (Some("pinned"), true));
        assert!(finding.problem.is_some_and(|problem| problem.contains(&name)));
    }

    #[test]
    fn kept_findings_go_elsewhere() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = temporary.path();
        fs::create_dir(folder.join(FINDINGS)).expect("writable");
        fs::write(folder.join("file"), "").expect("writable");
        for (regressions, words) in [(".", "themselves"), ("findings", "themselves"), ("file", "is a file")] {
            let error = check_regressions(folder, &folder.join(regressions)).expect_err(regressions);
            assert!(error.exit_code() == 3 && error.to_string().contains(words), "{error}");
        }
        check_regressions(folder, &folder.join("new")).expect("another one");
    }
}
