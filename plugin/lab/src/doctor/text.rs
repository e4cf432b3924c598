//! The report for people.

use std::fmt::{self, Display, Formatter};

use super::{
    finding::Finding,
    report::{Comparison, ComparisonReport, Difference, DoctorReport},
    safety::Verdict,
};

impl Display for DoctorReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { game, version, mode, level, ticks, .. } = self;
        writeln!(f, "{game} (version {version}), mode {mode}, level {level}\n")?;
        writeln!(f, "Copies of the game played this level for {ticks} ticks with the same random actions, and were")?;
        writeln!(f, "compared after each tick. When an episode ended, the same level began again.")?;
        for report in &self.comparisons {
            writeln!(f, "  {:<26}{}", report.comparison.describe(), outcome(report))?;
        }
        writeln!(f)?;
        for (number, finding) in self.findings.iter().enumerate() {
            self.write_finding(f, number + 1, finding)?;
        }
        self.write_safety(f)?;
        write!(f, "{}{}", self.observation, self.types)?;
        if let Some(speed) = self.ticks_per_second {
            writeln!(f, "Speed: {speed:.0} ticks per second of one arena in one World")?;
        }
        let end = match self.findings.len() {
            0 => format!("No findings: the same actions played the same game for {ticks} ticks."),
            1 => "1 finding.".to_owned(),
            count => format!("{count} findings."),
        };
        write!(f, "{end}")
    }
}

impl DoctorReport {
    fn write_safety(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { level, seed, ticks, .. } = self;
        writeln!(f, "Safe for")?;
        let verdicts = self.safety.all();
        for (what, verdict) in verdicts {
            writeln!(f, "  {what:<26}{}", in_words(verdict))?;
        }
        if verdicts.iter().any(|(_, verdict)| verdict.safe == Some(true)) {
            let (longer, level, seed) = (ticks.saturating_mul(10), level.wrapping_add(1), seed.wrapping_add(1));
            writeln!(
                f,
                "  \"yes\" means that no difference was found in {ticks} ticks of this one level, not that there"
            )?;
            writeln!(
                f,
                "  is none: `--ticks {longer}` plays longer, `--level {level}` another level, `--seed {seed}` other actions."
            )?;
        }
        Ok(())
    }

    fn write_finding(&self, f: &mut Formatter<'_>, number: usize, finding: &Finding) -> fmt::Result {
        writeln!(f, "{number}. {}", finding.what)?;
        let report = finding.comparison.and_then(|comparison| self.of(comparison));
        if let (Some(difference), Some(report)) = (&finding.difference, report) {
            let (left, right) = report.comparison.sides();
            writeln!(f, "     {left}: {}\n     {right}: {}", difference.left, difference.right)?;
            for other in &report.others {
                writeln!(f, "     in the same tick: {}", in_one_line(other))?;
            }
            match report.effect.as_ref().filter(|effect| *effect != difference) {
                Some(effect) => writeln!(f, "     agents notice it at tick {}: {}", effect.tick, in_one_line(effect))?,
                None if report.effect.is_none() => {
                    writeln!(f, "     agents have noticed nothing of it in {} ticks", report.ticks)?;
                }
                None => {}
            }
        }
        for cause in &finding.causes {
            writeln!(f, "   common cause: {}", cause.kind.describe())?;
            for evidence in &cause.evidence {
                writeln!(f, "     a hint: {evidence}")?;
            }
            writeln!(f, "     what to do: {}", cause.advice)?;
        }
        writeln!(f)
    }
}

fn outcome(report: &ComparisonReport) -> String {
    let unmatched = match report.unmatched {
        0 => String::new(),
        count => format!(" ({count} entities could not be matched, and were left out)"),
    };
    match (&report.skipped, report.difference(), &report.fault) {
        (Some(why), ..) => format!("not compared: {why}"),
        (_, Some(difference), _) => format!("DIFFERS at tick {}{unmatched}", difference.tick),
        (_, _, Some(_)) => format!("ended by a fault at tick {}", report.ticks),
        _ => {
            let episodes = if report.episodes == 1 { "episode" } else { "episodes" };
            format!("no difference in {} ticks, {} {episodes}{unmatched}", report.ticks, report.episodes)
        }
    }
}

/// Returns whether it is safe, with the comparisons.
fn in_words(verdict: &Verdict) -> String {
    let Verdict { safe, why, comparisons } = verdict;
    match safe {
        None => format!("not compared: {why}"),
        Some(false) => format!("NO: {why}"),
        Some(true) => {
            let compared: Vec<_> = comparisons.iter().map(|comparison: &Comparison| comparison.describe()).collect();
            let but = if why.is_empty() { String::new() } else { format!("; {why}") };
            format!("yes (compared: {}){but}", compared.join(", "))
        }
    }
}

fn in_one_line(difference: &Difference) -> String {
    let Difference { name, entity, field, left, right, .. } = difference;
    let of = entity.as_ref().map_or_else(String::new, |entity| format!(" of {entity}"));
    format!("`{name}{field}`{of}: {left} against {right}")
}
