//! The report for people.

use std::fmt::{self, Display, Formatter};

use super::{
    finding::Finding,
    report::{ComparisonReport, Difference, DoctorReport},
    types::TypesReport,
};

/// Most names in a list.
const LISTED: usize = 12;

impl Display for DoctorReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { game, version, mode, seed, ticks, .. } = self;
        writeln!(f, "{game} (version {version}), mode {mode}, level {seed}, random actions for {ticks} ticks\n")?;
        for report in &self.comparisons {
            writeln!(f, "  {:<26}{}", report.comparison.describe(), outcome(report))?;
        }
        writeln!(f)?;
        for (number, finding) in self.findings.iter().enumerate() {
            self.write_finding(f, number + 1, finding)?;
        }
        writeln!(f, "Safe for")?;
        for (what, verdict) in self.safety.all() {
            let word = verdict.safe.map_or("not known", |safe| if safe { "yes" } else { "NO" });
            let why = if verdict.why.is_empty() { String::new() } else { format!(": {}", verdict.why) };
            writeln!(f, "  {what:<26}{word}{why}")?;
        }
        self.write_observation(f)?;
        write_types(f, &self.types)?;
        if let Some(speed) = self.ticks_per_second {
            writeln!(f, "Speed: {speed:.0} ticks per second of one arena in one World")?;
        }
        let end = match self.findings.len() {
            0 => "No findings: the same actions play the same game.".to_owned(),
            1 => "1 finding.".to_owned(),
            count => format!("{count} findings."),
        };
        write!(f, "{end}")
    }
}

impl DoctorReport {
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
            writeln!(f, "   usual cause: {}", cause.kind.describe())?;
            for evidence in &cause.evidence {
                writeln!(f, "     a hint: {evidence}")?;
            }
            writeln!(f, "     what to do: {}", cause.advice)?;
        }
        writeln!(f)
    }

    fn write_observation(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let seen = &self.observation;
        write!(f, "Observation: {} values", seen.values)?;
        match seen.constant.len() {
            0 => writeln!(f, ", all of which changed in {} ticks", seen.ticks),
            count => {
                writeln!(f, ", {count} of which never changed in {} ticks: {}", seen.ticks, listed(&seen.constant))
            }
        }
    }
}

fn outcome(report: &ComparisonReport) -> String {
    let unmatched = match report.unmatched {
        0 => String::new(),
        count => format!(" ({count} entities could not be told apart, and were left out)"),
    };
    match (&report.skipped, report.difference(), &report.fault) {
        (Some(why), ..) => format!("not compared: {why}"),
        (_, Some(difference), _) => format!("DIFFERS at tick {}{unmatched}", difference.tick),
        (_, _, Some(_)) => format!("ended by a fault at tick {}", report.ticks),
        _ => format!("the same for {} ticks{unmatched}", report.ticks),
    }
}

fn in_one_line(difference: &Difference) -> String {
    let Difference { name, entity, field, left, right, .. } = difference;
    let of = entity.as_ref().map_or_else(String::new, |entity| format!(" of {entity}"));
    format!("`{name}{field}`{of}: {left} against {right}")
}

fn write_types(f: &mut Formatter<'_>, types: &TypesReport) -> fmt::Result {
    writeln!(f, "State: {} types of components and resources were compared field by field", types.compared.len())?;
    let hidden = types.not_reflected.len() + types.unnamed;
    if hidden > 0 {
        let names =
            if types.not_reflected.is_empty() { String::new() } else { format!(": {}", listed(&types.not_reflected)) };
        writeln!(
            f,
            "  {hidden} types of the game are not reflected{names}; a difference in them shows only later, in observation, \
             reward, end and state hash. Derive `Reflect` with `#[reflect(Component)]` or `#[reflect(Resource)]` to have \
             it named, or let the state hash depend on it (`StateHash`, or `.state_hash` of a `ForeignGame`)."
        )?;
    }
    if types.unnamed > 0 {
        writeln!(f, "  The names of {} of them are known only to a Bevy with its feature `debug`.", types.unnamed)?;
    }
    if !types.incomparable.is_empty() {
        writeln!(f, "  Values of these types cannot be compared: {}", listed(&types.incomparable))?;
    }
    Ok(())
}

fn listed(names: &[String]) -> String {
    let shown: Vec<_> = names.iter().take(LISTED).map(|name| format!("`{name}`")).collect();
    let more = names.len().saturating_sub(LISTED);
    if more > 0 { format!("{} and {more} more", shown.join(", ")) } else { shown.join(", ") }
}
