//! Comparison of the variants of a study: paired differences, interquartile means, and probabilities of improvement.

use super::{
    bootstrap::{Estimate, interquartile_mean, probability_of_improvement},
    number::{UNKNOWN, fixed, mean_and_error},
    paired::{PairedDifference, holm},
    study::StudyReport,
    study_table::markdown_table,
};

impl StudyReport {
    /// Returns the paired differences of the first variant from each other one.
    pub(super) fn differences(&self) -> String {
        let variants = self.variants();
        let Some((first, others)) = variants.split_first() else { return String::new() };
        let paired: Vec<(&str, PairedDifference)> =
            others.iter().filter_map(|other| Some((*other, self.difference(first, other)?))).collect();
        if paired.is_empty() {
            return String::new();
        }
        let p_values: Vec<f64> = paired.iter().filter_map(|(_, found)| found.p_value()).collect();
        let mut together = holm(&p_values).into_iter();
        let rows = paired.iter().map(|(other, found)| {
            let p = found.p_value();
            let p_together = p.and_then(|_| together.next());
            let words = match (p_together, found.mean > 0.0) {
                (None, _) => "one seed is too few",
                (Some(0.05..), _) => "no difference that is clear",
                (Some(_), true) => "clearly above",
                (Some(_), false) => "clearly below",
            };
            let [levels, seeds] = [found.levels, found.seeds].map(|count| count.to_string());
            let difference = mean_and_error(found.mean, found.se, 2);
            vec![(*other).to_owned(), difference, levels, seeds, p_cell(p), p_cell(p_together), words.to_owned()]
        });
        let headings = ["other", "difference", "levels", "seeds", "p", "p of all", &format!("{first} is")];
        format!(
            "The held-out return of **{first}** less that of each other variant, on the same levels and with the same seeds. ± is \
             the standard error over levels and seeds; p is Student's t with one degree of freedom less than there are seeds. \
             The p of all allows for that many comparisons (Holm), and below 0.05 the difference is called clear.\n\n{}\n",
            markdown_table(&headings, rows)
        )
    }

    /// Returns interquartile means, and the probability that the first variant does better. A variant with a single
    /// seed has neither, since one seed does not generalise to others.
    pub(super) fn intervals(&self) -> String {
        let variants = self.variants();
        let seeds = |variant: &str| Some(self.level_returns(variant)).filter(|returns| returns.len() > 1);
        let first = variants.first().and_then(|first| seeds(first));
        let cell = |found: Option<Estimate>| {
            found.map_or(UNKNOWN.to_owned(), |Estimate { value, low, high }| {
                format!("{} [{}, {}]", fixed(value, 2), fixed(low, 2), fixed(high, 2))
            })
        };
        let rows: Vec<Vec<String>> = variants
            .iter()
            .enumerate()
            .filter_map(|(number, variant)| {
                let returns = seeds(variant)?;
                let mean = interquartile_mean(&returns)?;
                let first = first.as_ref().filter(|_| number > 0);
                let improvement = first.and_then(|first| probability_of_improvement(first, &returns));
                Some(vec![(*variant).to_owned(), cell(Some(mean)), cell(improvement)])
            })
            .collect();
        if rows.is_empty() {
            return String::new();
        }
        let above = format!("{} above it", variants[0]);
        format!(
            "The interquartile mean over the seeds: that of the middle half of the runs, each with its mean held-out return over \
             all levels. And the probability that a run of **{}** has a higher return on a level than a run of the variant, where \
             equal returns count half. In brackets are 95 % intervals by a bootstrap over seeds and levels, which are too narrow for \
             a handful of seeds: whether a difference is clear is what the p above says. Variants with a single seed have \
             none.\n\n{}\n",
            variants[0],
            markdown_table(&["variant", "interquartile mean", &above], rows.into_iter())
        )
    }
}

/// Formats a p-value; unknown if there is no value.
fn p_cell(p: Option<f64>) -> String {
    p.map_or(UNKNOWN.to_owned(), |p| if p < 0.001 { "< 0.001".to_owned() } else { fixed(p, 3) })
}
