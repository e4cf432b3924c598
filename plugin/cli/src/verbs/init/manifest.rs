//! The `Cargo.toml` of a game, read as text.

/// A dependency on Bevy.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct BevyDependency {
    /// The version as it is written; `None` for a path or a revision of git.
    pub version: Option<String>,
    /// The features that are named.
    pub features: Vec<String>,
    /// Whether the workspace says the rest.
    pub is_inherited: bool,
}

/// The parts of a `Cargo.toml` that matter here.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GameManifest {
    /// Name of the package, if there is one.
    pub package: Option<String>,
    /// Name of its library, if it is given.
    pub library: Option<String>,
    /// File of its library, if it is given.
    pub library_path: Option<String>,
    /// Whether there is a table `[workspace]`.
    pub is_workspace: bool,
    /// The members of the workspace, as they are written.
    pub members: Vec<String>,
    /// Names of the dependencies.
    pub dependencies: Vec<String>,
    /// The dependency on Bevy.
    pub bevy: Option<BevyDependency>,
    /// The dependency on Bevy that members inherit.
    pub workspace_bevy: Option<BevyDependency>,
}

impl GameManifest {
    /// Reads the text of a `Cargo.toml`. Lines that are no TOML are passed over, because cargo reports them better.
    pub fn read(text: &str) -> Self {
        let (tables, entries) = entries(text);
        let value = |table: &str, key: &str| {
            let entry = entries.iter().find(|entry| entry.table == table && entry.key == key)?;
            Some(texts(&entry.value))
        };
        let one = |table: &str, key: &str| value(table, key).and_then(|texts| texts.into_iter().next());
        let dependencies = entries.iter().filter_map(|entry| match entry.table.strip_prefix("dependencies") {
            Some("") => entry.key.split('.').next(),
            Some(rest) => rest.strip_prefix('.'),
            None => None,
        });
        let mut dependencies: Vec<String> = dependencies.map(str::to_owned).collect();
        dependencies.sort();
        dependencies.dedup();
        Self {
            package: one("package", "name"),
            library: one("lib", "name"),
            library_path: one("lib", "path"),
            is_workspace: tables.iter().any(|table| table == "workspace" || table.starts_with("workspace.")),
            members: value("workspace", "members").unwrap_or_default(),
            dependencies,
            bevy: bevy(&entries, "dependencies"),
            workspace_bevy: bevy(&entries, "workspace.dependencies"),
        }
    }

    /// Returns true if the package needs this crate.
    pub fn depends_on(&self, name: &str) -> bool {
        self.dependencies.iter().any(|dependency| dependency == name)
    }
}

/// A line `key = value` with its table. A value over several lines is one.
struct Entry {
    table: String,
    key: String,
    value: String,
}

/// Returns the tables and the entries of a text in TOML.
fn entries(text: &str) -> (Vec<String>, Vec<Entry>) {
    let (mut tables, mut found) = (vec![String::new()], Vec::<Entry>::new());
    let mut is_open = false;
    for line in text.lines().map(|line| without_comment(line).trim()) {
        if let Some(last) = found.last_mut().filter(|_| is_open) {
            last.value.push_str(&line.replace('\'', "\""));
            is_open = is_unclosed(&last.value);
        } else if line.starts_with('[') {
            tables.push(line.trim_matches(['[', ']']).replace(['"', ' '], ""));
        } else if let Some((key, value)) = line.split_once('=') {
            let value = value.trim().replace('\'', "\"");
            is_open = is_unclosed(&value);
            let table = tables.last().cloned().unwrap_or_default();
            found.push(Entry { table, key: key.trim().replace('"', ""), value });
        }
    }
    (tables, found)
}

/// Returns a line of TOML up to its comment.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    for (at, c) in line.char_indices() {
        match (c, quote) {
            ('#', None) => return &line[..at],
            ('"' | '\'', None) => quote = Some(c),
            (c, Some(open)) if c == open => quote = None,
            _ => {}
        }
    }
    line
}

/// Returns true if an array or a table goes on in the next line.
fn is_unclosed(value: &str) -> bool {
    let outside = value.split('"').step_by(2);
    let count = |signs: [char; 2]| outside.clone().map(|text| text.matches(signs).count()).sum::<usize>();
    count(['[', '{']) > count([']', '}'])
}

/// Returns the texts of a value: of an array, or of one text.
fn texts(value: &str) -> Vec<String> {
    let within = value.strip_prefix('[').map_or(value, |rest| rest.split(']').next().unwrap_or_default());
    within.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Returns the dependency on Bevy in a table, in any of the forms that TOML has for it.
fn bevy(entries: &[Entry], table: &str) -> Option<BevyDependency> {
    let own = format!("{table}.bevy");
    let parts = entries.iter().filter_map(|entry| {
        if entry.table == own {
            return Some(format!("{} = {}", entry.key, entry.value));
        }
        match entry.key.strip_prefix("bevy").filter(|_| entry.table == table)? {
            "" if entry.value.starts_with('{') => Some(entry.value.trim_matches(['{', '}']).to_owned()),
            "" => Some(format!("version = {}", entry.value)),
            rest => rest.strip_prefix('.').map(|key| format!("{key} = {}", entry.value)),
        }
    });
    let parts: Vec<String> = parts.collect();
    if parts.is_empty() {
        return None;
    }
    let all = parts.join(", ");
    Some(BevyDependency {
        version: value_of(&all, "version").and_then(|value| texts(value).into_iter().next()),
        features: value_of(&all, "features").map(texts).unwrap_or_default(),
        is_inherited: value_of(&all, "workspace").is_some_and(|value| value.starts_with("true")),
    })
}

/// Returns the text from the value of a key on.
fn value_of<'a>(inline: &'a str, key: &str) -> Option<&'a str> {
    inline.match_indices(key).find_map(|(at, _)| {
        let goes_on = inline[..at].ends_with(|c: char| c.is_alphanumeric() || "_-\"".contains(c));
        let rest = inline[at + key.len()..].trim_start().strip_prefix('=')?;
        (!goes_on).then(|| rest.trim_start())
    })
}

/// Returns major and minor number of a version such as `^0.19.1`.
pub(super) fn major_minor(version: &str) -> Option<(u32, u32)> {
    let mut numbers = version.trim_start_matches(|c: char| !c.is_ascii_digit()).split(['.', '-', ',', ' ']);
    Some((numbers.next()?.parse().ok()?, numbers.next().unwrap_or("0").parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manifest_has_its_bevy_in_every_form_that_toml_has() {
        for (text, version, features) in [
            ("[dependencies]\nbevy = \"0.19\" # \"0.18\"", Some("0.19"), &[] as &[&str]),
            ("[dependencies]\nbevy = { version = '0.19.1', features = [\"a\", \"b\"] }", Some("0.19.1"), &["a", "b"]),
            (
                "[dependencies]\nbevy = { default-features = false, features = [\n  \"a\", # why\n  \"b\",\n] }",
                None,
                &["a", "b"],
            ),
            ("[dependencies.bevy]\nversion = \"0.18\"\nfeatures = [\"a\"]", Some("0.18"), &["a"]),
            ("[dependencies]\nbevy.version = \"0.19\"\nbevy.features = [\"a\"]", Some("0.19"), &["a"]),
            ("[dependencies]\nbevy = { git = \"https://example.org/bevy#main\" }", None, &[]),
        ] {
            let found = GameManifest::read(text).bevy.unwrap_or_else(|| panic!("no bevy in {text}"));
            assert_eq!((found.version.as_deref(), found.is_inherited), (version, false), "{text}");
            assert_eq!(found.features, features, "{text}");
        }
        let other = GameManifest::read("[dependencies]\nbevy_rapier2d = \"0.36\"\n[dev-dependencies]\nbevy = \"0.19\"");
        assert_eq!((other.bevy.clone(), other.depends_on("bevy_rapier2d")), (None, true));
    }

    #[test]
    fn a_manifest_has_its_package_its_library_and_its_members() {
        let text = "[package]\nname = \"my-game\"\n[lib]\nname = \"mine\"\npath = \"code/lib.rs\"\n[workspace]\nmembers = [\n  \"a\",\n  \"crates/*\",\n]\n\
            [workspace.dependencies]\nbevy = \"0.19\"\n[dependencies]\nbevy.workspace = true\n";
        let manifest = GameManifest::read(text);
        assert_eq!(manifest.package.as_deref(), Some("my-game"));
        assert_eq!(
            (manifest.library.as_deref(), manifest.library_path.as_deref()),
            (Some("mine"), Some("code/lib.rs"))
        );
        assert!(manifest.is_workspace && manifest.members == ["a", "crates/*"], "{manifest:?}");
        assert!(manifest.bevy.is_some_and(|bevy| bevy.is_inherited));
        assert_eq!(manifest.workspace_bevy.and_then(|bevy| bevy.version).as_deref(), Some("0.19"));
        assert!(!GameManifest::read("[package]\nname = \"a\"").is_workspace);
    }

    #[test]
    fn versions_have_two_numbers_that_count() {
        for (text, numbers) in [
            ("0.19", Some((0, 19))),
            ("^0.19.1", Some((0, 19))),
            ("=0.19.0-rc.1", Some((0, 19))),
            (">=0.18, <0.20", Some((0, 18))),
            ("1", Some((1, 0))),
            ("*", None),
        ] {
            assert_eq!(major_minor(text), numbers, "{text}");
        }
    }
}
