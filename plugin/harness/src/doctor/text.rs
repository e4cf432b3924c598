//! The report for people.

use crate::doctor::{
    ComparisonReport, DoctorComparison, DoctorDifference, DoctorFinding, DoctorReport, forget_call,
    game_copy::TypesReport,
    observed::{FullSet, NonFiniteValue, ObservationReport, Verdict},
};
use playbot_report::counted;
use std::{
    fmt,
    fmt::{Display, Formatter},
};

impl Display for DoctorReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { game, version, mode, level, ticks, .. } = self;
        writeln!(f, "{game} (version {version}), mode {mode}, {}\n", self.levels())?;
        let played = if self.further_levels.is_empty() { "this level".to_owned() } else { format!("level {level}") };
        let ticks = counted(u64::from(*ticks), "tick");
        writeln!(f, "Copies of the game played {played} for {ticks} with the same random actions, and were")?;
        writeln!(f, "compared after each tick. When an episode ended, the same level began again.")?;
        self.write_comparisons(f)?;
        writeln!(f)?;
        for (number, finding) in self.findings.iter().enumerate() {
            self.write_finding(f, number + 1, finding)?;
        }
        self.write_notes(f)?;
        self.write_safety(f)?;
        self.without_idle.iter().try_for_each(|problem| writeln!(f, "Actions: {problem}"))?;
        write!(f, "{}{}", self.observation, self.types)?;
        self.write_left_messages(f)?;
        if let Some(steps) = &self.unequal_steps {
            write!(f, "{steps}")?;
        }
        if self.holds_keys {
            writeln!(
                f,
                "Keys: an action that is chosen again holds its keys. `just_pressed` is true in its first tick only,"
            )?;
            writeln!(
                f,
                "  so a game that reads it acts once, however long `chaos` or `explore --sticky` repeat the action."
            )?;
        }
        if let Some(speed) = self.ticks_per_second {
            writeln!(f, "Speed: {speed:.0} ticks per second of one arena in one World")?;
        }
        let end = match self.findings.len() {
            0 => format!("No findings: the same actions played the same game for {ticks}."),
            count => format!("{}.", counted(count as u64, "finding")),
        };
        let further = usize::from(self.without_idle.is_some()) + usize::from(!self.left_messages.is_empty());
        let notes = match self.notes.len() + further {
            0 => String::new(),
            count => format!(" {}.", counted(count as u64, "note")),
        };
        write!(f, "{end}{notes}")
    }
}

impl DoctorReport {
    /// Returns the levels, such as `level 0`, or `levels 0, 3 and 7`.
    fn levels(&self) -> String {
        let Some((last, others)) = self.further_levels.split_last() else { return format!("level {}", self.level) };
        let others: Vec<String> = std::iter::once(&self.level).chain(others).map(u64::to_string).collect();
        format!("levels {} and {last}", others.join(", "))
    }

    fn write_comparisons(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut level = self.level;
        for report in &self.comparisons {
            if report.level != level {
                level = report.level;
                writeln!(f, "Then level {level}, in fewer ways: `--level {level}` alone makes all comparisons on it.")?;
            }
            let title = match report.before {
                Some(before) => format!("after level {before}"),
                None => report.comparison.describe().to_owned(),
            };
            writeln!(f, "  {title:<26}{}", outcome(report))?;
        }
        Ok(())
    }

    fn write_notes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.notes.is_empty() {
            return Ok(());
        }
        writeln!(f, "Notes: state that differs, and that no agent noticed to the end of the episodes: not in what it")?;
        writeln!(f, "observes, not in rewards, ends of episodes or the state hash. They are no findings.")?;
        for note in &self.notes {
            writeln!(f, "  {}", note.what)?;
            if let Some(difference) = &note.difference {
                writeln!(f, "    {} against {}", difference.left, difference.right)?;
            }
            if let Some(cause) = note.causes.first() {
                writeln!(f, "    common cause: {}", cause.kind.describe())?;
            }
        }
        writeln!(f)
    }

    fn write_left_messages(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.left_messages.is_empty() {
            return Ok(());
        }
        writeln!(
            f,
            "Messages: written while a restart takes an episode down, so that systems read them in the next one."
        )?;
        writeln!(f, "  A call in the adapter drops them:")?;
        write_list(f, "    ", self.left_messages.iter().map(|message| forget_call(message)))
    }

    fn write_safety(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { further_levels, seed, ticks, .. } = self;
        writeln!(f, "Safe for")?;
        let verdicts = self.safety.all();
        for (what, verdict) in verdicts {
            writeln!(f, "  {what:<26}{}", in_words(verdict))?;
        }
        if verdicts.iter().any(|(_, verdict)| verdict.safe == Some(true)) {
            let (longer, seed) = (ticks.saturating_mul(10), seed.wrapping_add(1));
            let level =
                self.another_level.map_or_else(String::new, |level| format!("`--level {level}` another level, "));
            let played = if further_levels.is_empty() { "this one level".to_owned() } else { self.levels() };
            let ticks = counted(u64::from(*ticks), "tick");
            writeln!(f, "  \"yes\" means that no difference was found in {ticks} of {played}, not that there")?;
            writeln!(f, "  is none: `--ticks {longer}` plays longer, {level}`--seed {seed}` other actions.")?;
        }
        Ok(())
    }

    fn write_finding(&self, f: &mut Formatter<'_>, number: usize, finding: &DoctorFinding) -> fmt::Result {
        writeln!(f, "{number}. {}", finding.what)?;
        let made = (finding.comparison, finding.level);
        let report = self.comparisons.iter().find(|report| (Some(report.comparison), Some(report.level)) == made);
        if let (Some(difference), Some(report)) = (&finding.difference, report) {
            let (left, right) = report.comparison.sides();
            writeln!(f, "     {left}: {}\n     {right}: {}", difference.left, difference.right)?;
            let others = report.others.iter().map(|other| {
                let is_same_tick = other.tick == difference.tick;
                let when = if is_same_tick { "in the same tick".to_owned() } else { format!("at tick {}", other.tick) };
                format!("{when}: {}", in_one_line(other))
            });
            write_list(f, "     ", others)?;
            match report.effect.as_ref().filter(|effect| *effect != difference) {
                Some(effect) => writeln!(f, "     agents notice it at tick {}: {}", effect.tick, in_one_line(effect))?,
                None if report.effect.is_none() => {
                    writeln!(f, "     agents have noticed nothing of it in {}", ticks(report))?;
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

fn ticks(report: &ComparisonReport) -> String {
    counted(u64::from(report.ticks), "tick")
}

fn outcome(report: &ComparisonReport) -> String {
    let unmatched = match report.unmatched {
        0 => String::new(),
        count => {
            let were = if count == 1 { "was" } else { "were" };
            format!(" ({} could not be matched, and {were} left out)", counted(count as u64, "entity"))
        }
    };
    match (&report.skipped, report.difference(), &report.fault) {
        (Some(why), ..) => format!("not compared: {why}"),
        (_, Some(_), _) if report.is_note() => {
            format!("no difference that agents notice in {}{unmatched}; see the notes", ticks(report))
        }
        (_, Some(difference), _) => format!("DIFFERS at tick {}{unmatched}", difference.tick),
        (_, _, Some(_)) => format!("ended by a fault at tick {}", report.ticks),
        _ => {
            let episodes = counted(u64::from(report.episodes), "episode");
            format!("no difference in {}, {episodes}{unmatched}", ticks(report))
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
            let compared: Vec<_> =
                comparisons.iter().map(|comparison: &DoctorComparison| comparison.describe()).collect();
            let but = if why.is_empty() { String::new() } else { format!("; {why}") };
            format!("yes (compared: {}){but}", compared.join(", "))
        }
    }
}

fn in_one_line(difference: &DoctorDifference) -> String {
    let DoctorDifference { name, entity, field, left, right, .. } = difference;
    let of = entity.as_ref().map_or_else(String::new, |entity| format!(" of {entity}"));
    format!("`{name}{field}`{of}: {left} against {right}")
}

// Lists of observations and of types.

/// Most lines of one list; a longer one ends with the number of further lines.
const LISTED: usize = 8;

impl Display for ObservationReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { values, ticks, constant, unused, .. } = self;
        let (all, in_ticks) = (counted(*values as u64, "value"), counted(u64::from(*ticks), "tick"));
        match constant.len() {
            _ if *ticks == 0 => writeln!(f, "Observation: {all}, none of which was seen")?,
            0 if *unused > 0 => {
                writeln!(
                    f,
                    "Observation: {all}, all of which changed in {in_ticks} but {unused} of slots that stayed empty"
                )?;
            }
            0 => writeln!(f, "Observation: {all}, all of which changed in {in_ticks}")?,
            count => writeln!(f, "Observation: {all}, {count} of which never changed in {in_ticks}")?,
        }
        if let Some(NonFiniteValue { tick, name, value }) = &self.not_finite {
            writeln!(f, "  {:<26}{value} at tick {tick}: not a number that a policy can read", quoted(name))?;
        }
        if let Some((tick, count)) = self.length {
            writeln!(f, "  number of values          {count} at tick {tick}, where its sensor names {values}")?;
        }
        for FullSet { name, slots, ticks: full } in &self.full {
            let (slots, full) = (counted(*slots as u64, "slot"), counted(u64::from(*full), "tick"));
            writeln!(
                f,
                "  {:<26}full in {full}, with {slots}: things beyond the nearest are not observed; more slots show them",
                quoted(name)
            )?;
        }
        let lines = constant.iter().map(|it| format!("{:<26}always {}", quoted(&it.name), it.value));
        write_list(f, "  ", lines)
    }
}

impl Display for TypesReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (compared, were) = (self.compared.len() as u64, if self.compared.len() == 1 { "was" } else { "were" });
        let compared = counted(compared, "type");
        writeln!(f, "State: {compared} of components and resources {were} compared field by field")?;
        let hidden = self.not_reflected.len() + self.unnamed;
        if hidden > 0 {
            let types = counted(hidden as u64, "type");
            let (were, they_are) = if hidden == 1 { ("was", "it is") } else { ("were", "they are") };
            writeln!(f, "  {types} of the game {were} not, since {they_are} not reflected:")?;
            write_list(f, "    ", self.not_reflected.iter().map(|path| quoted(path)))?;
            if self.unnamed > 0 {
                writeln!(f, "    {} whose names are known only to a Bevy with its feature `debug`", self.unnamed)?;
            }
            writeln!(
                f,
                "  A difference in them shows only later, in what agents observe, get and end with, and in the state hash.\n  \
                 Derive `Reflect` with `#[reflect(Component)]` or `#[reflect(Resource)]` to have it found where it begins,\n  \
                 or let the state hash depend on it (`StateHash`, or `.state_hash` of a `ForeignGame`)."
            )?;
        }
        if !self.left_out.is_empty() {
            writeln!(
                f,
                "  left out by default: diagnostics, counters and clocks of engines, which measure the computer"
            )?;
            write_list(f, "    ", self.left_out.iter().map(|path| quoted(path)))?;
            writeln!(f, "  `--no-default-ignores` compares them, too.")?;
        }
        if !self.incomparable.is_empty() {
            writeln!(f, "  Fields of these types cannot be compared:")?;
            write_list(f, "    ", self.incomparable.iter().map(|path| quoted(path)))?;
        }
        Ok(())
    }
}

fn quoted(name: &str) -> String {
    format!("`{name}`")
}

fn write_list(f: &mut Formatter<'_>, indent: &str, lines: impl ExactSizeIterator<Item = String>) -> fmt::Result {
    let more = lines.len().saturating_sub(LISTED);
    for line in lines.take(LISTED) {
        writeln!(f, "{indent}{line}")?;
    }
    if more > 0 { writeln!(f, "{indent}and {more} more") } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::observed::ConstantValue;

    fn constant(count: usize) -> ObservationReport {
        let constant = (0..count).map(|number| ConstantValue { name: format!("wall_{number}"), value: 0.5 }).collect();
        ObservationReport { values: 20, ticks: 300, constant, ..Default::default() }
    }

    #[test]
    fn each_observation_with_a_problem_has_a_line_of_its_own() {
        let value = NonFiniteValue { tick: 7, name: "x".to_owned(), value: "inf".to_owned() };
        let report = ObservationReport { not_finite: Some(value), ..constant(1) };
        let text = report.to_string();
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert_eq!(lines[1][..4], ["`x`", "inf", "at", "tick"], "{text}");
        assert_eq!(lines[2], ["`wall_0`", "always", "0.5"], "{text}");
    }

    #[test]
    fn diagnostics_that_are_left_out_are_named() {
        let path = "avian2d::dynamics::solver::diagnostics::SolverDiagnostics".to_owned();
        let text = TypesReport { left_out: vec![path], ..TypesReport::default() }.to_string();
        for words in ["left out by default", "solver::diagnostics::SolverDiagnostics`\n", "`--no-default-ignores`"] {
            assert!(text.contains(words), "`{words}` is missing in: {text}");
        }
        assert!(!TypesReport::default().to_string().contains("left out"));
    }

    #[test]
    fn values_of_a_game_that_stopped_before_its_first_tick_are_not_judged() {
        let report = ObservationReport { values: 2, ..Default::default() };
        assert_eq!(report.to_string(), "Observation: 2 values, none of which was seen\n");
    }

    #[test]
    fn a_long_list_ends_with_how_many_more_there_are() {
        let text = constant(11).to_string();
        assert!(text.ends_with("`wall_7`                  always 0.5\n  and 3 more\n"), "{text}");
        assert!(!constant(LISTED).to_string().contains("more"));
    }
}
