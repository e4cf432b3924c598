//! One table per struct of settings: key, type, default, range, readers and documentation of each.
//!
//! [`settings!`](crate::settings!) makes the struct of such a table, its defaults and the check of its ranges, and
//! describes its rows as [`Setting`]s. Files, `--set`, warnings and the reference page read those descriptions: a new
//! setting is one new row.

use crate::error::{SettingError, brief_number};
use serde::Serialize;

/// A struct of settings.
pub trait Settings {
    /// Its settings, in the order of its fields.
    const SETTINGS: &'static [Setting];

    /// Checks that each number lies in the range of its setting.
    ///
    /// # Errors
    /// [`SettingError`] names the first number that does not.
    fn check_ranges(&self) -> Result<(), SettingError>;
}

/// One setting, or a section of them.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its path in an experiment, such as `ppo.lr`.
    pub path: &'static str,
    /// The last part of its path in older files, if it differs.
    pub former: Option<&'static str>,
    /// Its type in Rust.
    pub type_name: &'static str,
    /// Writes its default in RON; `None` if it must be given, or is a section.
    pub default: Option<fn() -> String>,
    /// A value in RON, where the default shows too little of the type.
    pub example: Option<&'static str>,
    /// The range of its numbers.
    pub range: Range,
    /// The algorithms that read it; empty if all do.
    pub readers: &'static [Reader],
    /// Its documentation, in Markdown.
    pub doc: &'static str,
    /// The settings in it, if it is a section.
    pub section: Option<&'static [Self]>,
}

impl Setting {
    /// Returns the last part of its path.
    pub fn name(&self) -> &'static str {
        self.path.rsplit('.').next().unwrap_or(self.path)
    }

    /// Returns the path in older files, if it differs.
    pub fn former_path(&self) -> Option<String> {
        let section = self.path.strip_suffix(self.name())?;
        self.former.map(|former| format!("{section}{former}"))
    }

    /// Returns its default, or an example; in RON.
    pub fn sample(&self) -> String {
        self.example.map(str::to_owned).or_else(|| self.default.map(|default| default())).unwrap_or_default()
    }
}

/// An algorithm that reads a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reader {
    /// Name of the algorithm.
    pub algorithm: &'static str,
    /// Path of the setting that must be true for that, if there is one.
    pub switch: Option<&'static str>,
}

impl Reader {
    /// SCORE-PPO.
    pub const SCORE_PPO: Self = Self::of("score-ppo");
    /// PPO without skills.
    pub const PPO: Self = Self::of("ppo");
    /// SCORE-SAC.
    pub const SCORE_SAC: Self = Self::of("score-sac");
    /// SAC without skills.
    pub const SAC: Self = Self::of("sac");
    /// SPiRL with PPO.
    pub const SPIRL_PPO: Self = Self::of("spirl-ppo");
    /// SPiRL with SAC.
    pub const SPIRL_SAC: Self = Self::of("spirl-sac");
    /// RLPD.
    pub const RLPD: Self = Self::of("rlpd");
    /// Behaviour cloning.
    pub const BC: Self = Self::of("bc");
    /// Imitation without skills.
    pub const IMITATION: Self = Self::of("imitation");

    /// SPiRL with PPO, if the decoder learns.
    pub const SPIRL_PPO_DECODER: Self = Self::SPIRL_PPO.with("spirl.learn_decoder");
    /// SPiRL with SAC, if the decoder learns.
    pub const SPIRL_SAC_DECODER: Self = Self::SPIRL_SAC.with("spirl.learn_decoder");

    /// All that use skills.
    pub const WITH_SKILLS: &'static [Self] =
        &[Self::SCORE_PPO, Self::SCORE_SAC, Self::SPIRL_PPO, Self::SPIRL_SAC, Self::BC];

    const fn of(algorithm: &'static str) -> Self {
        Self { algorithm, switch: None }
    }

    /// Returns the same algorithm, if the setting with this path is true.
    #[must_use]
    pub const fn with(self, switch: &'static str) -> Self {
        Self { switch: Some(switch), ..self }
    }
}

/// The range of a setting's numbers, and of all numbers in a list; `None` has no number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Every value of the type is allowed.
    Any,
    /// Whole numbers from 1 to this one.
    Count(u64),
    /// Numbers above 0, up to this one.
    Positive(f64),
    /// Numbers from 0 to this one.
    Weight(f64),
    /// Numbers from the first to the second.
    Within(f64, f64),
    /// Numbers above the first and below the second.
    Between(f64, f64),
    /// Numbers from the first on and below the second.
    Below(f64, f64),
    /// These words; code beside the struct checks them.
    Words(&'static str),
}

impl Range {
    /// Sizes and numbers of things, limited by memory only.
    pub const COUNT: Self = Self::Count(u64::MAX);
    /// Passes and lengths that must come to an end.
    pub const PASSES: Self = Self::Count(1_000_000);
    /// Learning rates and bounds in single precision. Training detects a rate that is far too large.
    pub const RATE: Self = Self::Positive(1e30);
    /// Weights of terms of a loss.
    pub const WEIGHT: Self = Self::Weight(1e6);
    /// Shares, discounts and the like.
    pub const SHARE: Self = Self::Within(0.0, 1.0);

    /// Checks the numbers of a setting's value.
    ///
    /// # Errors
    /// [`SettingError`] with the first number outside the range.
    pub fn check(self, path: &'static str, value: &impl Numbers) -> Result<(), SettingError> {
        match value.numbers().into_iter().find_map(|number| self.fault(number).map(|why| (number, why))) {
            Some((number, why)) => Err(SettingError { path, value: Some(number.to_string()), why }),
            None => Ok(()),
        }
    }

    /// Returns the fault of a number outside the range.
    fn fault(self, number: Number) -> Option<String> {
        let x = match number {
            Number::Whole(n) => n as f64,
            Number::Real(x) => x,
        };
        let within = |least: f64, most: f64| format!("must lie in {least}..{}", brief_number(most));
        match (self, number) {
            (Self::Any | Self::Words(_), _) => None,
            (Self::Count(_), Number::Whole(0)) => Some("must be at least 1".to_owned()),
            (Self::Count(most), Number::Whole(n)) => (n > most).then(|| format!("must be at most {most}")),
            (Self::Count(_), Number::Real(_)) => (x < 1.0).then(|| "must be at least 1".to_owned()),
            // NaN is not above 0, either.
            (Self::Positive(most), _) => match x > 0.0 {
                true => (x > most).then(|| within(0.0, most)),
                false => Some("must be positive".to_owned()),
            },
            (Self::Weight(most), _) => match x >= 0.0 {
                true => (x > most).then(|| within(0.0, most)),
                false => Some("must not be negative".to_owned()),
            },
            (Self::Within(least, most), _) => (!(least..=most).contains(&x)).then(|| within(least, most)),
            (Self::Between(least, most), _) => {
                (!(x > least && x < most)).then(|| format!("must lie between {least} and {most}"))
            }
            (Self::Below(least, most), _) => {
                (!(least..most).contains(&x)).then(|| format!("must be at least {least} and below {most}"))
            }
        }
    }
}

/// Writes the range in the words of the reference page.
impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Any => Ok(()),
            Self::Count(u64::MAX) => write!(f, "at least 1"),
            Self::Count(most) => write!(f, "1 to {most}"),
            Self::Positive(most) => write!(f, "above 0, at most {}", brief_number(most)),
            Self::Weight(most) => write!(f, "0 to {}", brief_number(most)),
            Self::Within(least, most) => write!(f, "{} to {}", brief_number(least), brief_number(most)),
            Self::Between(least, most) => write!(f, "above {least} and below {most}"),
            Self::Below(least, most) => write!(f, "at least {least} and below {most}"),
            Self::Words(words) => f.write_str(words),
        }
    }
}

/// A number in the value of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// A whole number.
    Whole(u64),
    /// A number with a fraction.
    Real(f64),
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Whole(n) => write!(f, "{n}"),
            Self::Real(x) => f.write_str(&brief_number(x)),
        }
    }
}

/// The numbers of a value, for the check of its range.
pub trait Numbers {
    /// Returns the numbers, in order.
    fn numbers(&self) -> Vec<Number>;
}

impl Numbers for f64 {
    fn numbers(&self) -> Vec<Number> {
        vec![Number::Real(*self)]
    }
}

impl Numbers for u32 {
    fn numbers(&self) -> Vec<Number> {
        vec![Number::Whole(u64::from(*self))]
    }
}

impl Numbers for u64 {
    fn numbers(&self) -> Vec<Number> {
        vec![Number::Whole(*self)]
    }
}

impl Numbers for usize {
    fn numbers(&self) -> Vec<Number> {
        vec![Number::Whole(*self as u64)]
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn numbers(&self) -> Vec<Number> {
        self.iter().flat_map(Numbers::numbers).collect()
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn numbers(&self) -> Vec<Number> {
        self.iter().flat_map(Numbers::numbers).collect()
    }
}

/// Returns whether a value has no effect: false, 0, empty or `None`. Such values of newer settings are not written,
/// so that files and studies still find models from before the setting existed.
pub fn is_off<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Returns a value in RON, on one line.
///
/// # Panics
/// A value of a setting can be written.
pub fn text(value: &impl Serialize) -> String {
    let config = ron::ser::PrettyConfig::new().compact_arrays(true).compact_structs(true);
    let text = ron::ser::to_string_pretty(value, config).expect("settings are numbers, names and lists of them");
    // A kind that is called as `None` of an option is marked by RON, and is read without the mark, too.
    if text == "r#None" { "None".to_owned() } else { text }
}

/// Makes a struct of settings from a table. A row has, in this order:
///
/// ```text
/// /// Documentation.
/// field as "key in files" once "older key": type = default, in RANGE, by READERS, such as "example", off "is_off";
/// field: type = default, within "words for a range that code beside the struct checks";
/// ```
///
/// Required are documentation, field and type, and the default in a table of a section. The second form is for the
/// struct of all sections. Its rows name the attributes of serde themselves, and `keys of Type` for a section. A value
/// that is `off` by the named function is not written. Ranges are [`Range`]s, and readers are slices of [`Reader`]s.
/// Without `by` a row has the readers of its table.
#[macro_export]
macro_rules! settings {
    (@key $field:ident) => { stringify!($field) };
    (@key $field:ident $key:literal) => { $key };
    (@or $default:expr;) => { $default };
    (@or $default:expr; $given:expr) => { $given };
    (@range;) => { $crate::settings::Range::Any };
    (@range $range:expr;) => { $range };
    (@range; $words:literal) => { $crate::settings::Range::Words($words) };
    (@check $value:expr, $path:expr;) => {};
    (@check $value:expr, $path:expr; $range:expr) => { $range.check($path, &$value)? };
    (@option) => { None };
    (@option $value:expr) => { Some($value) };
    (@default $type:ty;) => { None };
    (@default $type:ty; $default:expr) => {
        Some(|| {
            let value: $type = $default;
            $crate::settings::text(&value)
        })
    };

    (
        $(#[$meta:meta])*
        pub struct $name:ident in $section:literal, read by $readers:expr;
        $(
            $(#[doc = $doc:literal])+
            $field:ident $(as $key:literal)? $(once $former:literal)? : $type:ty = $default:expr
            $(, in $range:expr)? $(, within $words:literal)? $(, by $by:expr)? $(, such as $example:literal)?
            $(, off $off:literal)? ;
        )+
    ) => {
        $(#[$meta])*
        #[derive(::serde::Serialize, ::serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $(
                $(#[doc = $doc])+
                $(#[serde(rename = $key)])?
                $(#[serde(alias = $former)])?
                $(#[serde(skip_serializing_if = $off)])?
                pub $field: $type,
            )+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)+ }
            }
        }

        impl $crate::settings::Settings for $name {
            const SETTINGS: &'static [$crate::settings::Setting] = &[$(
                $crate::settings::Setting {
                    path: concat!($section, ".", $crate::settings!(@key $field $($key)?)),
                    former: $crate::settings!(@option $($former)?),
                    type_name: stringify!($type),
                    default: $crate::settings!(@default $type; $default),
                    example: $crate::settings!(@option $($example)?),
                    range: $crate::settings!(@range $($range)?; $($words)?),
                    readers: $crate::settings!(@or $readers; $($by)?),
                    doc: concat!($($doc, "\n"),+),
                    section: None,
                },
            )+];

            fn check_ranges(&self) -> Result<(), $crate::SettingError> {
                $($crate::settings!(
                    @check self.$field, concat!($section, ".", $crate::settings!(@key $field $($key)?)); $($range)?
                );)+
                Ok(())
            }
        }
    };

    (
        $(#[$meta:meta])*
        pub struct $name:ident with sections;
        $(
            $(#[doc = $doc:literal])+
            $field:ident : $type:ty $(= $default:expr)?
            $(, in $range:expr)? $(, such as $example:literal)? $(, keys of $inner:ty)? $(, serde $serde:tt)? ;
        )+
    ) => {
        $(#[$meta])*
        #[derive(::serde::Serialize, ::serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[doc = $doc])+
                $(#[serde $serde])?
                pub $field: $type,
            )+
        }

        impl $crate::settings::Settings for $name {
            const SETTINGS: &'static [$crate::settings::Setting] = &[$(
                $crate::settings::Setting {
                    path: stringify!($field),
                    former: None,
                    type_name: stringify!($type),
                    default: $crate::settings!(@default $type; $($default)?),
                    example: $crate::settings!(@option $($example)?),
                    range: $crate::settings!(@range $($range)?;),
                    readers: &[],
                    doc: concat!($($doc, "\n"),+),
                    section: $crate::settings!(@option $(<$inner as $crate::settings::Settings>::SETTINGS)?),
                },
            )+];

            fn check_ranges(&self) -> Result<(), $crate::SettingError> {
                $($crate::settings!(@check self.$field, stringify!($field); $($range)?);)+
                Ok(())
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    settings! {
        /// Settings of a test.
        #[derive(Clone, Debug, PartialEq)]
        pub struct Example in "example", read by &[Reader::PPO];
        /// A rate.
        ///
        /// It has a second paragraph.
        lr: f64 = 0.5, in Range::RATE;
        /// Widths.
        hidden: Vec<usize> = vec![2, 3], in Range::COUNT, by &[];
        /// A name of its own.
        confidence as "alpha" once "a": Option<u64> = None, in Range::Count(9), such as "Some(1)", off "is_off";
        /// A switch.
        on: bool = true;
    }

    #[test]
    fn a_row_makes_field_default_and_description() {
        let [lr, hidden, alpha, on] = Example::SETTINGS else { panic!("four rows") };
        assert_eq!((lr.path, lr.name(), lr.type_name, lr.sample().as_str()), ("example.lr", "lr", "f64", "0.5"));
        assert_eq!((lr.readers, hidden.readers), (&[Reader::PPO][..], &[][..]));
        assert_eq!(lr.doc.trim().lines().next().map(str::trim), Some("A rate."));
        assert_eq!(hidden.sample(), "[2, 3]");
        assert_eq!((alpha.path, alpha.former_path().as_deref()), ("example.alpha", Some("example.a")));
        assert_eq!(alpha.sample(), "Some(1)");
        assert_eq!((on.range, on.sample().as_str()), (Range::Any, "true"));
        let default = Example::default();
        assert_eq!(default, Example { lr: 0.5, hidden: vec![2, 3], confidence: None, on: true });
        let text = serde_json::to_string(&default).expect("plain values");
        assert_eq!(text, r#"{"lr":0.5,"hidden":[2,3],"on":true}"#);
        let older: Example = serde_json::from_str(r#"{"a": 4}"#).expect("an older key");
        assert_eq!(older.confidence, Some(4));
        assert!(serde_json::from_str::<Example>(r#"{"lrr": 4}"#).is_err());
    }

    #[test]
    fn numbers_outside_their_range_are_named() {
        let check = |example: Example| example.check_ranges().map_err(|error| error.to_string());
        assert_eq!(check(Example::default()), Ok(()));
        for (example, words) in [
            (Example { lr: 0.0, ..Example::default() }, "`example.lr` must be positive, but is 0"),
            (Example { lr: f64::NAN, ..Example::default() }, "`example.lr` must be positive, but is NaN"),
            (Example { lr: 1e300, ..Example::default() }, "`example.lr` must lie in 0..1e30, but is 1e300"),
            (Example { hidden: vec![1, 0], ..Example::default() }, "`example.hidden` must be at least 1, but is 0"),
            (Example { confidence: Some(10), ..Example::default() }, "`example.alpha` must be at most 9, but is 10"),
        ] {
            assert_eq!(check(example), Err(words.to_owned()));
        }
        let fault = |range: Range, x: f64| range.fault(Number::Real(x));
        assert_eq!(fault(Range::Between(0.0, 1.0), 1.0).as_deref(), Some("must lie between 0 and 1"));
        assert_eq!(fault(Range::Below(0.0, 1.0), 1.0).as_deref(), Some("must be at least 0 and below 1"));
        assert_eq!(fault(Range::Below(0.0, 1.0), 0.0), None);
        assert_eq!(fault(Range::SHARE, -0.5).as_deref(), Some("must lie in 0..1"));
        assert_eq!(fault(Range::WEIGHT, -0.5).as_deref(), Some("must not be negative"));
    }
}
