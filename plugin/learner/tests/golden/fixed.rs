//! Settings of a case that the library does not offer.

use crate::case::Case;
use serde_json::Value;

impl Case {
    /// Asserts that the setting `name`, if the case has it, is the fixed behaviour of the library. Of texts the
    /// beginning counts.
    pub fn assert_fixed(&self, name: &str, library: impl Into<Value>) {
        let (found, library) = (self.hyper(name), library.into());
        let same = found.is_null() || is_same(found, &library);
        assert!(same, "{}: {name} is {found}, but the library knows only {library}", self.name);
    }
}

fn is_same(found: &Value, library: &Value) -> bool {
    match (found, library) {
        (Value::Array(found), Value::Array(library)) => {
            found.len() == library.len() && found.iter().zip(library).all(|(found, library)| is_same(found, library))
        }
        (Value::String(found), Value::String(library)) => found.starts_with(library.as_str()),
        _ => match (found.as_f64(), library.as_f64()) {
            (Some(found), Some(library)) => (found - library).abs() <= 1e-9 * library.abs(),
            _ => found == library,
        },
    }
}

#[test]
fn a_setting_that_is_not_the_library_s_is_named() {
    let case = Case::load("ppo_loss_gaussian");
    case.assert_fixed("not a setting", 3.0);
    let clip = case.number("clip");
    case.assert_fixed("clip", clip);
    let reported = std::panic::catch_unwind(|| Case::load("ppo_loss_gaussian").assert_fixed("clip", clip + 1.0));
    let text = reported.expect_err("another clip").downcast::<String>().expect("a text");
    assert!(text.starts_with("ppo_loss_gaussian: clip is "), "{text}");
}
