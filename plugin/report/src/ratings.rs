//! Elo ratings of players from the results of their matches.
//!
//! The model is that of Bradley and Terry (1952, "Rank analysis of incomplete block designs"), on Elo's scale: a player
//! whose rating is d above another one's scores 1 / (1 + 10^(-d / 400)) points of a match with it. A draw is half a point
//! for each. Ratings are those of the highest likelihood, so they depend on no order of the matches.
//!
//! ```
//! use playbot_report::ratings::{Encounter, elo};
//!
//! // Player 1 wins three of four matches against player 0, whose rating is set to 1000.
//! let met = [Encounter { one: 1, other: 0, wins: 300, draws: 0, losses: 100 }];
//! let ratings = elo(2, &met, 0, 1000.0);
//! let [Some(known), Some(rated)] = ratings[..] else { panic!("they met") };
//! assert_eq!((known.elo, known.error), (1000.0, 0.0));
//! // 400 · log10(3) is 190.8; the prior draw takes a little of it.
//! assert!((rated.elo - 1190.0).abs() < 1.0 && (19.0..21.0).contains(&rated.error), "{rated:?}");
//! ```

use serde::{Deserialize, Serialize};

/// Results of the matches of two players.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Encounter {
    /// Number of the first player.
    pub one: usize,
    /// Number of the second player.
    pub other: usize,
    /// Matches that the first one won.
    pub wins: u64,
    /// Matches without a winner.
    pub draws: u64,
    /// Matches that the second one won.
    pub losses: u64,
}

impl Encounter {
    /// Returns the number of matches.
    pub fn matches(&self) -> u64 {
        self.wins + self.draws + self.losses
    }

    /// Returns the share of the points that the first player won, a draw being half a point; `None` without matches.
    pub fn score(&self) -> Option<f64> {
        let matches = self.matches();
        (matches > 0).then(|| (self.wins as f64 + 0.5 * self.draws as f64) / matches as f64)
    }
}

/// The rating of a player.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rating {
    /// On Elo's scale.
    pub elo: f64,
    /// Its standard error, of the distance from the player whose rating is set: 0 for that one itself. It is a little too
    /// large where matches are drawn, whose results vary less.
    pub error: f64,
}

/// Points on Elo's scale by which the odds grow e-fold: 400 / ln 10.
const PER_FOLD: f64 = 400.0 / std::f64::consts::LN_10;

/// Most steps of Newton's method. It needs some ten.
const MOST_STEPS: usize = 200;

/// Returns the rating of each of so many players; `None` for those that no chain of matches connects with `anchor`, whose
/// rating is set to `level`.
///
/// One drawn match is added to those of each pair that has met, so that a player that won or lost all of them has a
/// rating too.
pub fn elo(players: usize, encounters: &[Encounter], anchor: usize, level: f64) -> Vec<Option<Rating>> {
    let met: Vec<&Encounter> = encounters.iter().filter(|it| is_usable(it, players)).collect();
    let connected = connected_with(anchor, players, &met);
    // The number of each rated player among the unknowns.
    let mut unknowns = vec![None; players];
    let rated = (0..players).filter(|&player| connected[player] && player != anchor);
    let count = rated.enumerate().map(|(number, player)| unknowns[player] = Some(number)).count();
    let terms: Vec<Term> = met.iter().filter(|it| connected[it.one]).map(|it| Term::of(it, &unknowns)).collect();
    let strengths = fit(&terms, count);
    let errors = inverse_diagonal(&slopes(&terms, &strengths).1, count);
    let rating = |player: usize| match unknowns[player] {
        Some(number) => {
            Some(Rating { elo: level + PER_FOLD * strengths[number], error: PER_FOLD * errors[number].max(0.0).sqrt() })
        }
        None => (player == anchor).then_some(Rating { elo: level, error: 0.0 }),
    };
    (0..players).map(rating).collect()
}

fn is_usable(it: &Encounter, players: usize) -> bool {
    it.one < players && it.other < players && it.one != it.other && it.matches() > 0
}

/// Returns which players a chain of matches connects with this one.
fn connected_with(anchor: usize, players: usize, met: &[&Encounter]) -> Vec<bool> {
    let mut connected = vec![false; players];
    if let Some(first) = connected.get_mut(anchor) {
        *first = true;
    }
    loop {
        let before = connected.iter().filter(|it| **it).count();
        for it in met {
            let either = connected[it.one] || connected[it.other];
            (connected[it.one], connected[it.other]) = (either, either);
        }
        if connected.iter().filter(|it| **it).count() == before {
            return connected;
        }
    }
}

/// The matches of a pair, with the places of their strengths; `None` is the anchor, at 0.
struct Term {
    one: Option<usize>,
    other: Option<usize>,
    matches: f64,
    points: f64,
}

impl Term {
    /// Returns the matches of an encounter, with one draw more.
    fn of(it: &Encounter, unknowns: &[Option<usize>]) -> Self {
        Self {
            one: unknowns[it.one],
            other: unknowns[it.other],
            matches: it.matches() as f64 + 1.0,
            points: it.wins as f64 + 0.5 * (it.draws as f64 + 1.0),
        }
    }

    fn distance(&self, strengths: &[f64]) -> f64 {
        let of = |place: Option<usize>| place.map_or(0.0, |place| strengths[place]);
        of(self.one) - of(self.other)
    }
}

/// Returns the strengths of the highest likelihood, by Newton's method. Steps are halved while the likelihood falls.
fn fit(terms: &[Term], count: usize) -> Vec<f64> {
    let mut strengths = vec![0.0; count];
    let mut best = likelihood(terms, &strengths);
    for _ in 0..MOST_STEPS {
        let (gradient, information) = slopes(terms, &strengths);
        let Some(step) = solve(information, gradient, count) else { break };
        let moved = |share: f64| -> Vec<f64> { strengths.iter().zip(&step).map(|(at, by)| at + share * by).collect() };
        let tries = (0..30).map(|halvings| moved(1.0 / f64::from(1u32 << halvings)));
        let found = tries.map(|next| (likelihood(terms, &next), next)).find(|(value, _)| *value > best);
        let Some((value, next)) = found else { break };
        (best, strengths) = (value, next);
    }
    strengths
}

/// Returns the logarithm of the likelihood.
fn likelihood(terms: &[Term], strengths: &[f64]) -> f64 {
    let log_share = |distance: f64| -libm::log1p(libm::exp(-distance.abs())) + distance.min(0.0);
    let of = |term: &Term| {
        let distance = term.distance(strengths);
        term.points * log_share(distance) + (term.matches - term.points) * log_share(-distance)
    };
    terms.iter().map(of).sum()
}

/// Returns the gradient of the likelihood, and its information matrix row by row.
fn slopes(terms: &[Term], strengths: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let count = strengths.len();
    let (mut gradient, mut information) = (vec![0.0; count], vec![0.0; count * count]);
    for term in terms {
        let share = 1.0 / (1.0 + libm::exp(-term.distance(strengths)));
        let (pull, weight) = (term.points - term.matches * share, term.matches * share * (1.0 - share));
        for (place, sign) in [(term.one, 1.0), (term.other, -1.0)] {
            let Some(place) = place else { continue };
            gradient[place] += sign * pull;
            information[place * count + place] += weight;
        }
        if let (Some(one), Some(other)) = (term.one, term.other) {
            information[one * count + other] -= weight;
            information[other * count + one] -= weight;
        }
    }
    (gradient, information)
}

/// Solves a system of equations with a positive definite matrix by its Cholesky factors; `None` if it has none.
fn solve(matrix: Vec<f64>, mut right: Vec<f64>, count: usize) -> Option<Vec<f64>> {
    let factor = cholesky(matrix, count)?;
    for row in 0..count {
        let known: f64 = (0..row).map(|column| factor[row * count + column] * right[column]).sum();
        right[row] = (right[row] - known) / factor[row * count + row];
    }
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|below| factor[below * count + row] * right[below]).sum();
        right[row] = (right[row] - known) / factor[row * count + row];
    }
    Some(right)
}

/// Returns the lower triangle L of a positive definite matrix L Lᵀ.
fn cholesky(mut matrix: Vec<f64>, count: usize) -> Option<Vec<f64>> {
    for row in 0..count {
        for column in 0..=row {
            let known: f64 = (0..column).map(|k| matrix[row * count + k] * matrix[column * count + k]).sum();
            let rest = matrix[row * count + column] - known;
            matrix[row * count + column] = if row == column {
                // Not a number is no positive one, either.
                if rest.is_nan() || rest <= 0.0 {
                    return None;
                }
                rest.sqrt()
            } else {
                rest / matrix[column * count + column]
            };
        }
    }
    Some(matrix)
}

/// Returns the diagonal of the inverse of a positive definite matrix; infinite if it has none.
fn inverse_diagonal(matrix: &[f64], count: usize) -> Vec<f64> {
    let of = |place: usize| {
        let unit = (0..count).map(|row| f64::from(u8::from(row == place))).collect();
        solve(matrix.to_vec(), unit, count).map_or(f64::INFINITY, |column| column[place])
    };
    (0..count).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn met(one: usize, other: usize, wins: u64, draws: u64, losses: u64) -> Encounter {
        Encounter { one, other, wins, draws, losses }
    }

    fn rounded(ratings: &[Option<Rating>]) -> Vec<Option<i64>> {
        ratings.iter().map(|rating| rating.map(|rating| rating.elo.round() as i64)).collect()
    }

    #[test]
    fn a_pair_is_rated_by_the_odds_of_its_points() {
        // With the draw that is added: 3.5 of 5 points, 400 · log10(3.5 / 1.5) = 147.19. Its error is
        // 173.72 / √(5 · 0.7 · 0.3) = 169.53.
        let ratings = elo(2, &[met(0, 1, 3, 0, 1)], 1, 1000.0);
        let [Some(rated), Some(anchor)] = ratings[..] else { panic!("both are rated") };
        assert!((rated.elo - 1147.19).abs() < 0.01 && (rated.error - 169.53).abs() < 0.01, "{rated:?}");
        assert_eq!(anchor, Rating { elo: 1000.0, error: 0.0 });
        assert_eq!(rounded(&elo(2, &[met(1, 0, 1, 0, 3)], 1, 1000.0)), rounded(&ratings), "named the other way round");
        assert_eq!(rounded(&elo(2, &[met(0, 1, 2, 2, 0)], 1, 1000.0)), [Some(1147), Some(1000)], "draws are halves");
    }

    #[test]
    fn players_that_never_met_are_compared_through_others() {
        // 400 · log10(301 / 101) = 189.7 for each step.
        let ratings = elo(3, &[met(1, 0, 300, 2, 100), met(2, 1, 300, 2, 100)], 0, 1000.0);
        let [Some(_), Some(one), Some(two)] = ratings[..] else { panic!("all are rated") };
        assert!((two.elo - one.elo - (one.elo - 1000.0)).abs() < 1e-6, "{ratings:?}");
        assert!(two.error > one.error, "what is known through others is less certain");
    }

    #[test]
    fn a_player_that_won_everything_has_a_finite_rating_and_one_that_met_nobody_none() {
        let ratings =
            elo(4, &[met(1, 0, 50, 0, 0), met(2, 2, 5, 0, 0), met(2, 3, 0, 0, 0), met(9, 0, 1, 0, 0)], 0, 0.0);
        // 50.5 of 51 points.
        assert_eq!(rounded(&ratings), [Some(0), Some(802), None, None]);
        assert_eq!(elo(1, &[], 0, 7.0), [Some(Rating { elo: 7.0, error: 0.0 })]);
    }

    #[test]
    fn a_chain_of_a_hundred_players_is_rated_in_its_order() {
        let chain: Vec<Encounter> = (1..100).map(|player| met(player, player - 1, 20, 0, 0)).collect();
        let ratings = elo(100, &chain, 0, 1000.0);
        let ratings: Vec<f64> = ratings.iter().map(|rating| rating.expect("connected").elo).collect();
        assert!(ratings.windows(2).all(|pair| pair[1] > pair[0] + 600.0), "{ratings:?}");
    }
}
