//! The sentences of a calibration's reports.

use super::{agreement::FEW_LEVELS, read::Calibration};

/// Most people that are named.
const MOST_NAMED: usize = 8;

impl Calibration {
    /// Returns the sentences about the compared levels, the left-out episodes and the limits of the numbers.
    pub fn words(&self) -> Vec<String> {
        let shared = counted(self.levels.len() as u64, "level");
        let tries: u64 = self.levels.iter().map(|level| level.people.tries).sum();
        let names: Vec<&str> = self.people.iter().take(MOST_NAMED).map(String::as_str).collect();
        let more = if self.people.len() > MOST_NAMED { ", …" } else { "" };
        let people = match self.people.len() {
            1 => "1 person".to_owned(),
            count => format!("{count} people"),
        };
        let were = if self.levels.len() == 1 { "was" } else { "were" };
        let mut words = vec![format!(
            "{shared} of {} {were} played by {people} ({}{more}) in {}. Each person counts once on a level, however many tries \
             it took.",
            self.range,
            names.join(", "),
            counted(tries, "try"),
        )];
        let others =
            [(self.only_tested, "not played by people"), (self.only_recorded, "played by people and not tested")];
        let others = others.into_iter().filter(|(count, _)| *count > 0);
        let mut left_out: Vec<String> =
            others.map(|(count, what)| format!("{} {what}", counted(count, "level"))).collect();
        left_out.extend(self.left_out.iter().cloned());
        if !left_out.is_empty() {
            words.push(format!("Left out: {}.", left_out.join(", ")));
        }
        if self.levels.len() < FEW_LEVELS {
            words.push(format!(
                "With {shared}, too few are shared to say how well bots and people agree: record people on {FEW_LEVELS} \
                 levels or more, easy and hard ones."
            ));
        }
        words
    }

    /// Returns the method in a few sentences.
    pub fn method(&self) -> &'static str {
        "A rank correlation is 1 if a tester orders the levels from easy to hard as people do, 0 if its order says nothing of \
         theirs, −1 if it is the reverse. Spearman's has a 95 % interval by Fisher's z with the variance of Bonett and Wright \
         (2000), Kendall's tau-b by Fisher's z with that of Fieller, Hartley and Pearson (1957). Time is the median of the \
         completed tries, in ticks; deaths are tries that the game ended without the aim."
    }
}

fn counted(count: u64, what: &str) -> String {
    match (count, what) {
        (1, _) => format!("1 {what}"),
        (_, "try") => format!("{count} tries"),
        _ => format!("{count} {what}s"),
    }
}
