//! The ladder of a training: its rivals by their ratings, as a table, a chart and a file.

use playbot_harness::sealed_file::{SealedFileError, read_sealed, write_sealed};
use playbot_report::{
    Chart, Curve, PlainTable, Section, Table, percent,
    ratings::{Encounter, Rating, elo},
    whole,
};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The rating of the first player of a ladder: the first scripted rival, or else the first snapshot.
pub const FIRST_RATING: f64 = 1000.0;

/// Name of the file in the folder of a run.
const LADDER: &str = "ladder.json";

/// Half of the width of an interval of 95 %, in standard errors.
const Z95: f64 = 1.96;

/// The rivals of a training: scripted bots, then snapshots from the oldest to the newest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ladder {
    /// All of them.
    pub members: Vec<LadderMember>,
    /// Results of their rating matches. Numbers are places in `members`.
    pub encounters: Vec<Encounter>,
}

/// A rival on a [`Ladder`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LadderMember {
    /// Its name: that of a bot, or the step of a snapshot.
    pub name: String,
    /// Environment steps at which the snapshot was taken; `None` for a bot.
    pub step: Option<u64>,
    /// Its rating; `None` before its first match.
    pub rating: Option<Rating>,
    /// Rating matches that it has played.
    pub matches: u64,
    /// Share of the points of these matches that it won, a draw being half a point; `None` before the first one.
    pub score: Option<f64>,
    /// True if it may be the rival of an episode now.
    pub is_drawn: bool,
}

/// Rates all rivals; the numbers in `encounters` are those of bots, then of snapshots. The first `rivals` of the bots may
/// be rivals, and so may the snapshots `drawn`.
pub(super) fn ladder_of(
    bots: &[String],
    rivals: usize,
    steps: &[u64],
    drawn: &[usize],
    encounters: &[Encounter],
) -> Ladder {
    let ratings = elo(bots.len() + steps.len(), encounters, 0, FIRST_RATING);
    let of_bots = bots.iter().enumerate().map(|(bot, name)| (name.clone(), None, bot < rivals));
    let of_snapshots = steps.iter().enumerate().map(|(snapshot, &step)| {
        let name = format!("step {}", whole(step as f64));
        (name, Some(step), drawn.contains(&snapshot))
    });
    let members = of_bots.chain(of_snapshots).zip(ratings).enumerate();
    let members = members.map(|(number, ((name, step, is_drawn), rating))| {
        let (mut matches, mut points) = (0, 0.0);
        for met in encounters {
            let own = match number {
                number if number == met.one => met.wins as f64 + 0.5 * met.draws as f64,
                number if number == met.other => met.losses as f64 + 0.5 * met.draws as f64,
                _ => continue,
            };
            matches += met.matches();
            points += own;
        }
        let score = (matches > 0).then(|| points / matches as f64);
        // The rating that is set says nothing before a match.
        LadderMember { name, step, rating: rating.filter(|_| matches > 0), matches, score, is_drawn }
    });
    Ladder { members: members.collect(), encounters: encounters.to_vec() }
}

impl Ladder {
    /// Returns the path of the ladder of the run in this folder.
    pub fn path(run: &Path) -> PathBuf {
        run.join(LADDER)
    }

    /// Reads the ladder of a run; `None` if it has none.
    ///
    /// # Errors
    ///
    /// [`SealedFileError`]: the file cannot be read, or is damaged.
    pub fn read(run: &Path) -> Result<Option<Self>, SealedFileError> {
        let path = Self::path(run);
        if !path.exists() {
            return Ok(None);
        }
        Ok(Some(read_sealed(&path)?.0))
    }

    /// Writes the ladder of a run.
    ///
    /// # Errors
    ///
    /// [`SealedFileError::Io`].
    pub(crate) fn write(&self, run: &Path) -> Result<(), SealedFileError> {
        write_sealed(&Self::path(run), self)
    }

    /// Returns the table, the best rival first; those without a rating come last.
    pub fn to_table(&self) -> PlainTable {
        let mut members: Vec<&LadderMember> = self.members.iter().collect();
        let rated = |member: &LadderMember| member.rating.map_or(f64::NEG_INFINITY, |rating| rating.elo);
        members.sort_by(|one, other| rated(other).total_cmp(&rated(one)));
        let rows = members.into_iter().map(|member| {
            let (elo, error) = match member.rating {
                Some(Rating { elo, error: 0.0 }) => (whole(elo), "set".to_owned()),
                Some(Rating { elo, error }) => (whole(elo), format!("±{}", whole(error))),
                None => ("?".to_owned(), String::new()),
            };
            let score = member.score.map_or_else(|| "?".to_owned(), percent);
            let is_drawn = if member.is_drawn { "yes" } else { "no" };
            vec![member.name.clone(), elo, error, whole(member.matches as f64), score, is_drawn.to_owned()]
        });
        let columns = ["rival", "elo", "error", "matches", "score", "plays"];
        PlainTable { columns: columns.map(str::to_owned).to_vec(), rows: rows.collect(), ..PlainTable::default() }
    }

    /// Returns the part of a run's report with table and chart.
    pub fn section(&self) -> Section {
        let text = "Snapshots of the policy and bots, by Elo ratings from matches on held-out levels, from all seats. The rating \
                    of the first of them is set to 1000.";
        Section {
            heading: "Rivals".to_owned(),
            text: text.to_owned(),
            charts: vec![self.to_chart()],
            tables: vec![Table::Plain(self.to_table())],
            code: Vec::new(),
        }
    }

    /// Returns the ratings of the snapshots over their steps, with intervals of 95 %, beside those of the bots.
    pub fn to_chart(&self) -> Chart {
        let snapshots = self.members.iter().filter_map(|member| Some((member.step? as f64, member.rating?)));
        let (points, band): (Vec<_>, Vec<_>) = snapshots
            .map(|(step, Rating { elo, error })| ((step, elo), (elo - Z95 * error, elo + Z95 * error)))
            .unzip();
        let ends = points.first().zip(points.last()).map(|(first, last)| [first.0, last.0]);
        let mut curves = vec![Curve::new("snapshots", points).with_band(band)];
        for (member, ends) in self.members.iter().filter(|member| member.step.is_none()).zip(ends.iter().cycle()) {
            let Some(Rating { elo, .. }) = member.rating else { continue };
            curves.push(Curve::new(member.name.clone(), ends.iter().map(|&step| (step, elo)).collect()));
        }
        Chart {
            title: "Elo ratings of the rivals".to_owned(),
            x_label: "environment steps of the snapshot".to_owned(),
            y_label: "Elo".to_owned(),
            curves,
            ..Chart::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn met(one: usize, other: usize, wins: u64, losses: u64) -> Encounter {
        Encounter { one, other, wins, draws: 0, losses }
    }

    fn ladder() -> Ladder {
        let bots = ["follower".to_owned()];
        ladder_of(
            &bots,
            0,
            &[0, 500, 1000],
            &[1, 2],
            &[met(2, 0, 2, 6), met(2, 1, 8, 0), met(3, 0, 6, 2), met(3, 2, 7, 1)],
        )
    }

    #[test]
    fn rivals_are_rated_together_and_listed_by_rating() {
        let ladder = ladder();
        let elo = |number: usize| ladder.members[number].rating.expect("it has played").elo;
        assert_eq!(elo(0), FIRST_RATING);
        assert!(elo(1) < elo(2) && elo(2) < elo(0) && elo(0) < elo(3), "{ladder:?}");
        let names: Vec<String> = ladder.to_table().rows.into_iter().map(|row| row[0].clone()).collect();
        assert_eq!(names, ["step 1,000", "follower", "step 500", "step 0"]);
        let newest = &ladder.members[3];
        assert_eq!((newest.matches, newest.score, newest.step), (16, Some(13.0 / 16.0), Some(1000)));
        assert_eq!(ladder.members.iter().map(|member| member.is_drawn).collect::<Vec<_>>(), [false, false, true, true]);
        assert_eq!(ladder.to_chart().curves.len(), 2, "snapshots, and the bot beside them");
    }

    #[test]
    fn a_ladder_is_read_as_it_was_written_and_a_run_may_have_none() {
        let run = tempfile::tempdir().expect("a folder");
        assert_eq!(Ladder::read(run.path()).expect("no file is no error"), None);
        ladder().write(run.path()).expect("writable");
        assert_eq!(Ladder::read(run.path()).expect("readable"), Some(ladder()));
    }

    #[test]
    fn before_the_first_match_nobody_has_a_rating() {
        let ladder = ladder_of(&[], 0, &[0], &[0], &[]);
        assert_eq!((ladder.members[0].rating, ladder.members[0].matches), (None, 0));
        assert_eq!(ladder.to_table().rows[0][1], "?");
    }
}
