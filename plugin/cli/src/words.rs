//! Wording of the contents of files.

/// Describes something with the first few names of its parts, if they have any.
pub fn with_names(what: &str, names: &[String]) -> String {
    const SHOWN: usize = 6;
    if names.is_empty() {
        return what.to_owned();
    }
    let more = if names.len() > SHOWN { ", …" } else { "" };
    format!("{what}: {}{more}", names[..names.len().min(SHOWN)].join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_first_names_are_listed() {
        assert_eq!(with_names("3 values", &[]), "3 values");
        let names: Vec<String> = (0..7).map(|number| format!("x{number}")).collect();
        assert_eq!(with_names("2 values", &names[..2]), "2 values: x0, x1");
        assert_eq!(with_names("7 values", &names), "7 values: x0, x1, x2, x3, x4, x5, …");
    }
}
