//! Files as older versions wrote them, without checksums.

/// Returns a text of a run or a test without its checksums. It can then be changed and is read like one of an older
/// version.
pub fn unsealed(text: &str) -> String {
    const ENTRY: &str = "\"crc32\":\"";
    const DIGITS: usize = "00000000\"".len();
    let line = |line: &str| {
        let Some((before, after)) = line.split_once(ENTRY) else { return line.to_owned() };
        let after = &after[DIGITS..];
        // First of several entries, or last.
        match after.strip_prefix(',') {
            Some(rest) => format!("{before}{rest}"),
            None => format!("{}{after}", before.trim_end_matches(',')),
        }
    };
    let lines = text.lines().filter(|line| !line.starts_with("// crc32 "));
    lines.map(|text| line(text) + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_go_and_the_rest_stays() {
        assert_eq!(unsealed("{\"crc32\":\"01234567\",\"a\":1}\n"), "{\"a\":1}\n");
        assert_eq!(unsealed("{}\n],\"crc32\":\"01234567\"}\n"), "{}\n]}\n");
        assert_eq!(unsealed("// crc32 01234567\n(a: 1)\n"), "(a: 1)\n");
    }
}
