//! Dates.

use std::{
    fmt,
    str::FromStr,
    time::{SystemTime, UNIX_EPOCH},
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Seconds of a day.
const DAY: u64 = 24 * 60 * 60;

/// A date, such as `2027-01-31`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Date {
    year: u16,
    month: u8,
    day: u8,
}

/// The text is not a date.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{0}` is not a date: write year, month and day, as in 2027-01-31")]
pub struct DateError(String);

impl Date {
    /// Returns today's date, in universal time.
    pub fn today() -> Self {
        // With a clock before 1970 nothing expires.
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |passed| passed.as_secs());
        Self::of_day(seconds / DAY)
    }

    /// Returns the date this many days after 1970-01-01.
    fn of_day(mut days: u64) -> Self {
        let mut year = 1970;
        while days >= days_of(year) {
            days -= days_of(year);
            year += 1;
        }
        let mut month = 1;
        while days >= u64::from(days_in(year, month)) {
            days -= u64::from(days_in(year, month));
            month += 1;
        }
        Self { year, month, day: days as u8 + 1 }
    }
}

fn days_of(year: u16) -> u64 {
    (1..=12).map(|month| u64::from(days_in(year, month))).sum()
}

fn days_in(year: u16, month: u8) -> u8 {
    let is_leap = year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400);
    match month {
        2 if is_leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

impl FromStr for Date {
    type Err = DateError;

    fn from_str(text: &str) -> Result<Self, DateError> {
        let parse = || {
            let (year, rest) = text.split_once('-')?;
            let (month, day) = rest.split_once('-')?;
            let is_plain = |part: &str, length| part.len() == length && part.bytes().all(|byte| byte.is_ascii_digit());
            if !(is_plain(year, 4) && is_plain(month, 2) && is_plain(day, 2)) {
                return None;
            }
            let date = Self { year: year.parse().ok()?, month: month.parse().ok()?, day: day.parse().ok()? };
            let is_day = (1..=12).contains(&date.month) && (1..=days_in(date.year, date.month)).contains(&date.day);
            is_day.then_some(date)
        };
        parse().ok_or_else(|| DateError(text.to_owned()))
    }
}

impl TryFrom<String> for Date {
    type Error = DateError;

    fn try_from(text: String) -> Result<Self, DateError> {
        text.parse()
    }
}

impl From<Date> for String {
    fn from(date: Date) -> Self {
        date.to_string()
    }
}

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04}-{:02}-{:02}", self.year, self.month, self.day)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_counted_as_the_calendar_has_them() {
        // Checked with `date -u -d @SECONDS`.
        for (days, text) in [(0, "1970-01-01"), (59, "1970-03-01"), (11_016, "2000-02-29"), (20_819, "2027-01-01")] {
            assert_eq!(Date::of_day(days).to_string(), text);
        }
        assert!(Date::today() > "2024-01-01".parse().expect("a day"));
    }

    #[test]
    fn only_days_are_days_and_they_have_an_order() {
        let date = |text: &str| text.parse::<Date>();
        for text in ["2027-02-29", "2027-13-01", "2027-00-10", "2027-1-1", "31.1.2027", "", "+027-01-01", "2027-01-31T"]
        {
            assert_eq!(date(text), Err(DateError(text.to_owned())));
        }
        let (one, other) = (date("2027-01-31").expect("a day"), date("2027-02-01").expect("a day"));
        assert!(one < other && date("2028-02-29").is_ok());
    }
}
