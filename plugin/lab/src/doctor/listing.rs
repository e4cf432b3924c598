//! The report's lists of observations and of types.

use std::fmt::{self, Display, Formatter};

use super::{
    observed::{NonFiniteValue, ObservationReport},
    types::TypesReport,
};

/// Most lines of one list; a longer one ends with the number of further lines.
const LISTED: usize = 8;

impl Display for ObservationReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { values, ticks, constant, .. } = self;
        match constant.len() {
            0 => writeln!(f, "Observation: {values} values, all of which changed in {ticks} ticks")?,
            count => writeln!(f, "Observation: {values} values, {count} of which never changed in {ticks} ticks")?,
        }
        if let Some(NonFiniteValue { tick, name, value }) = &self.not_finite {
            writeln!(f, "  {:<26}{value} at tick {tick}: not a number that a policy can read", quoted(name))?;
        }
        if let Some((tick, count)) = self.length {
            writeln!(f, "  number of values          {count} at tick {tick}, where its sensor names {values}")?;
        }
        let lines = constant.iter().map(|it| format!("{:<26}always {}", quoted(&it.name), it.value));
        write_list(f, "  ", lines)
    }
}

impl Display for TypesReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "State: {} types of components and resources were compared field by field", self.compared.len())?;
        let hidden = self.not_reflected.len() + self.unnamed;
        if hidden > 0 {
            writeln!(f, "  {hidden} types of the game were not, since they are not reflected:")?;
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
    fn a_long_list_ends_with_how_many_more_there_are() {
        let text = constant(11).to_string();
        assert!(text.ends_with("`wall_7`                  always 0.5\n  and 3 more\n"), "{text}");
        assert!(!constant(LISTED).to_string().contains("more"));
    }
}
