//! How the variants of a study compare: paired differences, interquartile means, and who probably does better.

use super::{
    bootstrap::{Estimate, interquartile_mean, probability_of_improvement},
    number::{UNKNOWN, fixed, mean_and_error},
    study::StudyReport,
    study_table::markdown_table,
};

impl StudyReport {
    /// How far the first variant is above each other one, where they can be paired.
    pub(super) fn differences(&self) -> String {
        let variants = self.variants();
        let Some((first, others)) = variants.split_first() else { return String::new() };
        let paired = others.iter().filter_map(|other| Some((*other, self.difference(first, other)?)));
        let rows: Vec<Vec<String>> = paired
            .map(|(other, found)| {
                let words = match (found.is_clear(), found.mean > 0.0) {
                    (false, _) => "no difference that is clear",
                    (true, true) => "clearly above",
                    (true, false) => "clearly below",
                };
                let [levels, seeds] = [found.levels, found.seeds].map(|count| count.to_string());
                vec![other.to_owned(), mean_and_error(found.mean, found.se, 2), levels, seeds, words.to_owned()]
            })
            .collect();
        if rows.is_empty() {
            return String::new();
        }
        let headings = ["other", "difference", "levels", "seeds", &format!("{first} is")];
        format!(
            "The held-out return of **{first}** less that of each other variant, on the same levels and with the same seeds. ± is \
             the standard error over levels and seeds; what is further from 0 than two of them is called clear.\n\n{}\n",
            markdown_table(&headings, rows.into_iter())
        )
    }

    /// Interquartile means, and how probable it is that the first variant does better.
    pub(super) fn intervals(&self) -> String {
        let variants = self.variants();
        let first = variants.first().map_or(Vec::new(), |first| self.level_returns(first));
        let cell = |found: Option<Estimate>| {
            found.map_or(UNKNOWN.to_owned(), |Estimate { value, low, high }| {
                format!("{} [{}, {}]", fixed(value, 2), fixed(low, 2), fixed(high, 2))
            })
        };
        let rows: Vec<Vec<String>> = variants
            .iter()
            .enumerate()
            .filter_map(|(number, variant)| {
                let returns = self.level_returns(variant);
                let mean = interquartile_mean(&returns)?;
                let improvement = (number > 0).then(|| probability_of_improvement(&first, &returns)).flatten();
                Some(vec![(*variant).to_owned(), cell(Some(mean)), cell(improvement)])
            })
            .collect();
        if rows.is_empty() {
            return String::new();
        }
        let above = format!("{} above it", variants[0]);
        format!(
            "The interquartile mean of the held-out returns over levels and seeds, and the probability that a run of **{}** has a \
             higher return on a level than a run of the variant, where equal returns count half. In brackets are 95 % intervals by \
             a bootstrap over seeds and levels.\n\n{}\n",
            variants[0],
            markdown_table(&["variant", "interquartile mean", &above], rows.into_iter())
        )
    }
}
