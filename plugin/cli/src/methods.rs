//! Players by name, and their measurement for `eval` and `quickstart`.

use bevy_playbot::unknown_name::UnknownName;
use playbot_lab::{
    eval::{
        EpisodeResult, EvalError, EvalPlan, EvalSummary, Player, Trail, blind_bots, evaluate, evaluate_with_trails,
        summarize,
    },
    game::Game,
    report::ResultRow,
};
use serde_json::json;

use super::{
    error::{CliError, print_line},
    progress,
};

/// Returns the bot of a game with this name: one of its blind bots, chaos, or its demonstrator.
///
/// # Errors
///
/// [`UnknownName`] with the game's bots.
pub fn bot(game: &dyn Game, name: &str) -> Result<Player, UnknownName> {
    if game.tools().bots.demonstrator() == Some(name) {
        return Ok(Player::Demonstrator);
    }
    let bots = blind_bots(game);
    match bots.iter().find(|(bot, _)| *bot == name) {
        Some((_, bot)) => Ok(Player::Blind(bot.clone())),
        None => Err(UnknownName::new("bot", name, &bot_names(game))),
    }
}

/// Returns the names of all bots of a game.
pub fn bot_names(game: &dyn Game) -> Vec<&'static str> {
    blind_bots(game).into_iter().map(|(name, _)| name).chain(game.tools().bots.demonstrator()).collect()
}

/// A measured player: its row of the result table, its episodes and its speed.
pub struct Measured {
    /// The row.
    pub summary: EvalSummary,
    /// Environment steps per second.
    pub steps_per_s: f64,
}

impl Measured {
    /// Returns the row in the form of reports.
    pub fn into_row(self) -> ResultRow {
        let summary = self.summary;
        ResultRow {
            method: summary.method,
            split: summary.split,
            episodes: summary.episodes as usize,
            return_mean: summary.return_mean,
            return_se: summary.return_se,
            level_returns: summary.level_returns,
            success: summary.success,
            length_mean: summary.length_mean,
            steps_per_s: Some(self.steps_per_s),
        }
    }
}

/// Measures one player, with a progress bar.
///
/// # Errors
///
/// The game broke its contract.
pub fn measure(game: &dyn Game, name: &str, player: &Player, plan: &EvalPlan) -> Result<Measured, CliError> {
    timed(name, plan, |progress| evaluate(game, player, plan, progress), |episode| episode)
        .map(|(measured, _)| measured)
}

/// As [`measure`], with the trail of every episode.
///
/// # Errors
///
/// The game broke its contract.
pub fn follow(
    game: &dyn Game,
    name: &str,
    player: &Player,
    plan: &EvalPlan,
) -> Result<(Measured, Vec<Trail>), CliError> {
    timed(name, plan, |progress| evaluate_with_trails(game, player, plan, progress), |trail| &trail.result)
}

fn timed<T>(
    name: &str,
    plan: &EvalPlan,
    play: impl FnOnce(&(dyn Fn(u64) + Sync)) -> Result<Vec<T>, EvalError>,
    result: impl Fn(&T) -> &EpisodeResult,
) -> Result<(Measured, Vec<T>), CliError> {
    let total = plan.split.len() * u64::from(plan.episodes_per_level);
    let bar = progress::bar(&format!("test {name}"), total, "episodes");
    let start = std::time::Instant::now();
    let played = play(&|n| bar.inc(n))?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let episodes: Vec<_> = played.iter().map(|episode| *result(episode)).collect();
    let steps: u64 = episodes.iter().map(|episode| u64::from(episode.ticks)).sum();
    let summary = summarize(name, &plan.split, &episodes);
    tell_clipped(&summary);
    Ok((Measured { summary, steps_per_s: steps as f64 / seconds }, played))
}

/// Reports it if actions of a measured player were clipped.
pub fn tell_clipped(summary: &EvalSummary) {
    if summary.clipped > 0.0 {
        tell!(
            "{} on {}: {:.1} % of the actions lay outside the game's range and were clipped",
            summary.method,
            summary.split,
            100.0 * summary.clipped
        );
    }
}

/// Prints a row as one line of JSON.
///
/// # Errors
///
/// Standard output is closed.
pub fn print_json(summary: &EvalSummary) -> Result<(), CliError> {
    print_line(json!(summary))
}
