//! `playbot eval --rival`: matches on both sides, and the difference between them.

use crate::{
    arguments::player::LoadedPlayer,
    error::CliError,
    output::{print_line, print_table},
    progress,
};
use playbot_harness::{
    eval::{AtLeast, EvalPlan, Player, error_over_levels, summarize},
    game::Game,
    rivals::matches::{Match, MatchOutcome, MatchPlan, play_matches},
};
use playbot_report::{PlainTable, percent, whole};
use serde::Serialize;

/// The matches of one player with the rival on some levels.
#[derive(Debug, Serialize)]
pub(super) struct Measured {
    method: String,
    rival: String,
    split: String,
    levels: u64,
    #[serde(flatten)]
    all: Score,
    seats: Vec<SeatScore>,
    /// Score on the first seat above that on the second one, of two seats.
    #[serde(skip_serializing_if = "Option::is_none")]
    difference: Option<f64>,
    /// Its standard error, over levels.
    #[serde(skip_serializing_if = "Option::is_none")]
    difference_se: Option<f64>,
}

/// The matches on one seat.
#[derive(Debug, Serialize)]
struct SeatScore {
    seat: String,
    #[serde(flatten)]
    score: Score,
}

/// Results of matches.
#[derive(Debug, Serialize)]
struct Score {
    matches: u64,
    wins: u64,
    draws: u64,
    losses: u64,
    /// Share of the points that were won, a draw being half a point.
    score: f64,
    /// Its standard error, over levels.
    score_se: f64,
    length_mean: f64,
}

impl Score {
    fn of(played: &[&Match]) -> Self {
        let count = |outcome| played.iter().filter(|it| it.outcome == outcome).count() as u64;
        let points: Vec<(u64, f64)> = played.iter().map(|it| (it.episode.level, it.outcome.points())).collect();
        let mean = |of: fn(&Match) -> f64| played.iter().map(|it| of(it)).sum::<f64>() / played.len().max(1) as f64;
        Self {
            matches: played.len() as u64,
            wins: count(MatchOutcome::Win),
            draws: count(MatchOutcome::Draw),
            losses: count(MatchOutcome::Loss),
            score: mean(|it| it.outcome.points()),
            score_se: error_over_levels(&points),
            length_mean: mean(|it| f64::from(it.episode.ticks)),
        }
    }

    fn cells(&self) -> [String; 6] {
        [
            whole(self.matches as f64),
            whole(self.wins as f64),
            whole(self.draws as f64),
            whole(self.losses as f64),
            percent(self.score),
            format!("±{}", percent(self.score_se)),
        ]
    }
}

/// The rival of a measurement.
pub(super) struct Opposition {
    /// The rival.
    pub(super) rival: LoadedPlayer,
    /// The seat of the players; `None` for all.
    pub(super) seat: Option<usize>,
}

impl Opposition {
    /// Plays the matches of a player on the levels of a plan, prints them, and returns what is below the bounds.
    pub(super) fn measure(
        &self,
        game: &dyn Game,
        (name, player): (&str, &Player),
        plan: &EvalPlan,
        bounds: &[AtLeast],
        json: bool,
    ) -> Result<Vec<String>, CliError> {
        let seats: Vec<usize> = self.seat.map_or_else(|| (0..game.tools().host.seats().len()).collect(), |it| vec![it]);
        let levels: Vec<u64> = plan.levels().collect();
        let matches = MatchPlan {
            mode: plan.split.mode.clone(),
            levels: levels.clone(),
            seats: seats.clone(),
            seed: plan.seed,
            threads: plan.threads,
            randomise: plan.randomise.clone(),
        };
        let total = (levels.len() * seats.len()) as u64;
        let bar = progress::bar(&format!("{name} against {}", self.rival.name), total, "matches");
        let played = play_matches(game, player, &self.rival.player, &matches, |ended| bar.inc(ended))?;
        bar.finish_and_clear();
        let measured = self.summary(game, name, plan, &seats, &played);
        if json {
            let line = serde_json::to_string(&measured)
                .map_err(|error| CliError::Io(format!("the matches cannot be written as JSON: {error}")))?;
            print_line(line)?;
        } else {
            measured.print()?;
        }
        let episodes: Vec<_> = played.iter().map(|it| it.episode).collect();
        let summary = summarize(&format!("{name} against {}", self.rival.name), &plan.split, &episodes);
        Ok(bounds.iter().filter_map(|bound| bound.shortfall(&summary)).collect())
    }

    fn summary(&self, game: &dyn Game, name: &str, plan: &EvalPlan, seats: &[usize], played: &[Match]) -> Measured {
        let names = game.tools().host.seats();
        let on = |seat: usize| played.iter().filter(|it| it.seat == seat).collect::<Vec<_>>();
        let of_seat = |&seat: &usize| {
            let name = names.get(seat).cloned().unwrap_or_default();
            SeatScore { seat: name, score: Score::of(&on(seat)) }
        };
        // Both matches of a level are one pair.
        let pairs: Vec<(u64, f64)> = match seats {
            [one, other] => on(*one)
                .iter()
                .zip(on(*other))
                .map(|(one, other)| (one.episode.level, one.outcome.points() - other.outcome.points()))
                .collect(),
            _ => Vec::new(),
        };
        let has_pairs = !pairs.is_empty();
        let mean = pairs.iter().map(|(_, difference)| difference).sum::<f64>() / pairs.len().max(1) as f64;
        Measured {
            method: name.to_owned(),
            rival: self.rival.name.clone(),
            split: plan.split.to_string(),
            levels: plan.levels().count() as u64,
            all: Score::of(&played.iter().collect::<Vec<_>>()),
            seats: seats.iter().map(of_seat).collect(),
            difference: has_pairs.then_some(mean),
            difference_se: has_pairs.then(|| error_over_levels(&pairs)),
        }
    }
}

impl Measured {
    fn print(&self) -> Result<(), CliError> {
        let columns = ["player", "rival", "levels", "seat", "matches", "won", "drawn", "lost", "score", "error"];
        let row = |seat: &str, score: &Score| {
            let words = [&self.method, &self.rival, &self.split].map(String::clone);
            words.into_iter().chain([seat.to_owned()]).chain(score.cells()).collect::<Vec<String>>()
        };
        let mut rows: Vec<_> = self.seats.iter().map(|it| row(&it.seat, &it.score)).collect();
        if self.seats.len() > 1 {
            rows.push(row("all", &self.all));
        }
        let columns = columns.map(str::to_owned).to_vec();
        print_table(&PlainTable { columns, rows, ..PlainTable::default() })?;
        if let (Some(difference), Some(error), [one, other]) = (self.difference, self.difference_se, &self.seats[..]) {
            print_line(format!(
                "score on the seat {} above that on {}: {:+.1} ± {:.1} points of 100",
                one.seat,
                other.seat,
                100.0 * difference,
                100.0 * error
            ))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_playbot::episode::EpisodeEnd;
    use playbot_harness::eval::EpisodeResult;

    fn played(seat: usize, level: u64, outcome: MatchOutcome) -> Match {
        let end = if outcome == MatchOutcome::Win { EpisodeEnd::WON } else { EpisodeEnd::LOST };
        let episode = EpisodeResult { level, end, success: end.is_success(), ticks: 9, clipped: 0, total_reward: 0.0 };
        Match { seat, outcome, episode }
    }

    #[test]
    fn points_are_counted_by_level() {
        use MatchOutcome::{Draw, Loss, Win};
        let all = [played(0, 0, Win), played(1, 0, Draw), played(0, 1, Win), played(1, 1, Loss)];
        let score = Score::of(&all.iter().collect::<Vec<_>>());
        assert_eq!((score.matches, score.wins, score.draws, score.losses), (4, 2, 1, 1));
        assert_eq!(score.score, 0.625);
        // The levels have 0.75 and 0.5 points: a standard deviation of 0.25 / √2, of two.
        assert!((score.score_se - 0.125).abs() < 1e-9, "{}", score.score_se);
    }
}
