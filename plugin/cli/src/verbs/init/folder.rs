//! The folder of a game: its `Cargo.toml` and its sources, read as text.

use crate::error::CliError;
use serde::Serialize;
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// The version of Bevy that this program is for.
pub(super) const BEVY: (u32, u32) = (0, 19);

/// A game's package and the folder that gets the bots.
pub(super) struct GameFolder {
    /// The folder that gets `bots`: of the workspace, or of the package.
    pub root: PathBuf,
    /// The `Cargo.toml` there.
    pub root_manifest: GameManifest,
    /// The folder of the package within it, with `/`; empty if it is the same.
    pub package: String,
    /// The `Cargo.toml` of the package.
    pub manifest: GameManifest,
    /// Its dependency on Bevy, with what the workspace says.
    pub bevy: BevyDependency,
}

impl GameFolder {
    /// Finds the package of the game in a folder.
    pub fn find(folder: &Path, wanted: Option<&str>) -> Result<Self, CliError> {
        let file = folder.join("Cargo.toml");
        let Some(root_manifest) = read_manifest(folder)? else {
            return Err(CliError::Usage(format!(
                "{} does not exist: call `playbot init` in the folder of a Bevy game, or name the folder, as in \
                 `playbot init my_game`",
                file.display()
            )));
        };
        let (package, manifest) = Self::choose(folder, &root_manifest, wanted)?;
        if !root_manifest.is_workspace {
            check_not_member(folder)?;
        }
        let Some(mut bevy) = manifest.bevy.clone() else {
            return Err(CliError::Usage(format!(
                "{} does not depend on `bevy`: playbot tests games that are made with Bevy {}.{}",
                folder.join(&package).join("Cargo.toml").display(),
                BEVY.0,
                BEVY.1
            )));
        };
        if let Some(shared) = root_manifest.workspace_bevy.as_ref().filter(|_| bevy.is_inherited) {
            bevy.version.clone_from(&shared.version);
            bevy.features.extend(shared.features.iter().cloned());
        }
        let numbers = bevy.version.as_deref().and_then(major_minor);
        if let (Some(version), Some(numbers)) = (&bevy.version, numbers)
            && numbers != BEVY
        {
            return Err(CliError::Usage(format!(
                "{} has Bevy {version}, and this playbot is for Bevy {}.{}: update the game first",
                folder.join(&package).join("Cargo.toml").display(),
                BEVY.0,
                BEVY.1
            )));
        }
        Ok(Self { root: folder.to_owned(), root_manifest, package, manifest, bevy })
    }

    /// Chooses the package of the game: the one that is named, the root's own, or the only member with Bevy.
    fn choose(folder: &Path, root: &GameManifest, wanted: Option<&str>) -> Result<(String, GameManifest), CliError> {
        let mut all = Vec::new();
        if root.package.is_some() {
            all.push((String::new(), root.clone()));
        }
        for member in members(folder, root) {
            if let Some(manifest) = read_manifest(&folder.join(&member))? {
                all.push((member, manifest));
            }
        }
        let names = |all: &[(String, GameManifest)]| {
            let names: Vec<&str> = all.iter().filter_map(|(_, manifest)| manifest.package.as_deref()).collect();
            names.join(", ")
        };
        let file = folder.join("Cargo.toml");
        if let Some(wanted) = wanted {
            let known = names(&all);
            let found = all.into_iter().find(|(_, manifest)| manifest.package.as_deref() == Some(wanted));
            return found.ok_or_else(|| {
                CliError::Usage(format!("{} has no package `{wanted}`; valid: {known}", file.display()))
            });
        }
        if root.package.is_some() && (root.bevy.is_some() || all.len() == 1) {
            return Ok(all.swap_remove(0));
        }
        // The crate of the bots is no game.
        all.retain(|(_, manifest)| manifest.bevy.is_some() && !manifest.depends_on("playbot"));
        match all.len() {
            1 => Ok(all.swap_remove(0)),
            0 => Err(CliError::Usage(format!(
                "no package of {} depends on `bevy`: playbot tests games that are made with Bevy {}.{}",
                file.display(),
                BEVY.0,
                BEVY.1
            ))),
            _ => Err(CliError::Usage(format!(
                "several packages of {} use Bevy: name the game with --package; valid: {}",
                file.display(),
                names(&all)
            ))),
        }
    }

    /// Returns the name of the package.
    pub fn name(&self) -> &str {
        self.manifest.package.as_deref().unwrap_or("my-game")
    }

    /// Returns the name of the library in Rust.
    pub fn library(&self) -> String {
        self.manifest.library.clone().unwrap_or_else(|| self.name().to_owned()).replace('-', "_")
    }

    /// Returns the file of the library, whether it exists or not.
    pub fn library_file(&self) -> String {
        self.manifest.library_path.clone().unwrap_or_else(|| "src/lib.rs".to_owned())
    }
}

/// Returns the folder of a path, which may be that of the `Cargo.toml` in it.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if path.file_name().is_some_and(|name| name == "Cargo.toml") && !path.is_dir() => {
            if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
        }
        _ => path,
    }
}

pub(super) fn unreadable(path: &Path, error: &io::Error) -> CliError {
    CliError::Io(format!("cannot read {}: {error}", path.display()))
}

/// Reads the `Cargo.toml` of a folder, if there is one.
fn read_manifest(folder: &Path) -> Result<Option<GameManifest>, CliError> {
    let file = folder.join("Cargo.toml");
    match fs::read_to_string(&file) {
        Ok(text) => Ok(Some(GameManifest::read(&text))),
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => Ok(None),
        Err(error) => Err(unreadable(&file, &error)),
    }
}

/// Returns the names in a folder, in their order, and whether each is a folder. Links and hidden names are left out.
fn names_in(folder: &Path) -> Result<Vec<(String, bool)>, CliError> {
    let refused = |error: io::Error| unreadable(folder, &error);
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let (name, kind) = (entry.file_name().to_string_lossy().into_owned(), entry.file_type().map_err(refused)?);
        if !name.starts_with('.') && !kind.is_symlink() {
            names.push((name, kind.is_dir()));
        }
    }
    names.sort();
    Ok(names)
}

/// Returns the folders of a workspace's members. A star at the end of a path stands for each folder there.
fn members(root: &Path, manifest: &GameManifest) -> Vec<String> {
    let mut found = Vec::new();
    for member in &manifest.members {
        match member.strip_suffix('*') {
            Some(folder) => {
                // A folder that cannot be read has no game, as cargo says itself.
                let names = names_in(&root.join(folder)).unwrap_or_default().into_iter();
                found.extend(names.filter(|(_, is_folder)| *is_folder).map(|(name, _)| format!("{folder}{name}")));
            }
            None => found.push(member.clone()),
        }
    }
    found
}

/// Returns true if a folder is among the members of a workspace.
pub(super) fn has_member(members: &[String], folder: &str) -> bool {
    let is_it = |member: &String| match member.trim_start_matches("./").strip_suffix('*') {
        Some(begin) => folder.strip_prefix(begin).is_some_and(|rest| !rest.contains('/')),
        None => member.trim_start_matches("./").trim_end_matches('/') == folder,
    };
    members.iter().any(is_it)
}

/// Refuses a member of a workspace above it, because the bots belong beside all members.
fn check_not_member(folder: &Path) -> Result<(), CliError> {
    let whole = folder.canonicalize().map_err(|error| unreadable(folder, &error))?;
    for above in whole.ancestors().skip(1) {
        let Ok(Some(manifest)) = read_manifest(above) else { continue };
        let inner = whole.strip_prefix(above).unwrap_or(&whole).display().to_string().replace('\\', "/");
        if manifest.is_workspace && has_member(&manifest.members, &inner) {
            let root = above.display();
            return Err(CliError::Usage(format!(
                "{} is a member of the workspace in {root}: write `playbot init {root} --package NAME`, with the name \
                 of its package",
                folder.display()
            )));
        }
    }
    Ok(())
}

/// Reads the sources of a package, in the order of their paths.
pub(super) fn read_sources(package: &Path) -> Result<Vec<SourceText>, CliError> {
    let (mut sources, mut folders) = (Vec::new(), vec!["src".to_owned()]);
    while let Some(folder) = folders.pop() {
        if !package.join(&folder).is_dir() {
            continue;
        }
        for (name, is_folder) in names_in(&package.join(&folder))? {
            let path = format!("{folder}/{name}");
            if is_folder {
                folders.push(path);
            } else if name.ends_with(".rs") {
                let file = package.join(&path);
                let bytes = fs::read(&file).map_err(|error| unreadable(&file, &error))?;
                sources.push(SourceText::new(&path, &String::from_utf8_lossy(&bytes)));
            }
        }
    }
    sources.sort_by(|one, other| one.path.cmp(&other.path));
    Ok(sources)
}

/// A source file of a game.
pub(super) struct SourceText {
    /// Its path in the package, with `/`.
    pub path: String,
    /// Its text; comments are blank.
    pub code: String,
}

impl SourceText {
    /// Creates the source of a text.
    pub fn new(path: &str, text: &str) -> Self {
        Self { path: path.to_owned(), code: without_comments(text) }
    }

    /// Returns the line of an offset.
    pub fn at(&self, name: &str, offset: usize) -> SourceLine {
        let line = self.code[..offset].matches('\n').count() + 1;
        let function = function_around(&self.code[..offset]);
        SourceLine { name: name.to_owned(), file: self.path.clone(), line, function }
    }

    /// Returns the lines that have one of these words, but for imports.
    pub fn lines_with(&self, words: &[&str]) -> Vec<SourceLine> {
        let (mut found, mut begin) = (Vec::new(), 0);
        for line in self.code.split_inclusive('\n') {
            let is_import = line.trim_start().trim_start_matches("pub ").starts_with("use ");
            let word = words.iter().find_map(|word| line.find(word).map(|at| (word.trim(), begin + at)));
            found.extend(word.filter(|_| !is_import).map(|(word, offset)| self.at(word, offset)));
            begin += line.len();
        }
        found
    }
}

/// Returns the name of the function that is open at the end of code, behind that of its type: `HeroPlugin::build`.
fn function_around(code: &str) -> Option<String> {
    let (mut depth, mut function) = (0_u32, None);
    for (at, brace) in code.rmatch_indices(['{', '}']) {
        if brace == "}" {
            depth += 1;
            continue;
        }
        if depth > 0 {
            depth -= 1;
            continue;
        }
        let head = code[..at].rsplit(['{', '}']).next().unwrap_or_default();
        let head = head.rsplit(";\n").next().unwrap_or_default();
        match &function {
            None => {
                let words = head.rmatch_indices("fn ").find(|(at, _)| !head[..*at].ends_with(is_of_name));
                function = words.map(|(at, words)| name(&head[at + words.len()..]).to_owned());
            }
            Some(function) => return Some(type_of(head).map_or(function.clone(), |of| format!("{of}::{function}"))),
        }
    }
    function
}

/// Returns the name of the type behind `impl`.
fn type_of(head: &str) -> Option<&str> {
    let is_impl = |at: &usize| !head[..*at].ends_with(is_of_name) && !head.contains("fn ");
    let at = head.find("impl").filter(is_impl)?;
    let behind = head[at + 4..].trim_start();
    let behind = match behind.split_once(" for ") {
        Some((_, of)) => of,
        None if behind.starts_with('<') => behind.split_once("> ")?.1,
        None => behind,
    };
    let path = behind.trim_start().split(|c| !is_of_name(c) && c != ':').next()?;
    path.rsplit("::").next().filter(|name| !name.is_empty())
}

/// Blanks the comments of a source. Lines keep their numbers.
fn without_comments(text: &str) -> String {
    let (mut code, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(first) = rest.chars().next() {
        let (kept, skipped) = if rest.starts_with("//") {
            (0, rest.find('\n').unwrap_or(rest.len()))
        } else if rest.starts_with("/*") {
            (0, length_of_comment(rest))
        } else if first == '"' {
            (length_of_text(rest), 0)
        } else if first == 'r' && !code.ends_with(is_of_name) {
            (length_of_raw_text(rest).unwrap_or(1), 0)
        } else if rest.starts_with("'\"'") {
            (3, 0)
        } else {
            (first.len_utf8(), 0)
        };
        code.push_str(&rest[..kept]);
        code.extend(rest[kept..kept + skipped].chars().filter(|c| *c == '\n'));
        rest = &rest[kept + skipped..];
    }
    code
}

/// Returns the length of a comment between signs, with those inside it.
fn length_of_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0_u32, 0);
    while at < text.len() {
        let rest = &text.as_bytes()[at..];
        if rest.starts_with(b"/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest.starts_with(b"*/") {
            (depth, at) = (depth.saturating_sub(1), at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += 1;
        }
    }
    text.len()
}

/// Returns the length of a text with its quotes.
fn length_of_text(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '"' if !is_escaped => return at + 1,
            _ => is_escaped = c == '\\' && !is_escaped,
        }
    }
    text.len()
}

/// Returns the length of a raw text, if it is one.
fn length_of_raw_text(text: &str) -> Option<usize> {
    let hashes = text[1..].len() - text[1..].trim_start_matches('#').len();
    let inner = text[1 + hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    Some(inner.find(&end).map_or(text.len(), |at| 2 + hashes + at + end.len()))
}

/// A name with its line in the sources.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SourceLine {
    /// The name.
    pub name: String,
    /// The file, in the package.
    pub file: String,
    /// The line, counted from 1.
    pub line: usize,
    /// The function around it, with its type. It stays true when the code is moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub function: Option<String>,
}

impl SourceLine {
    /// Returns the place for a file that is written: the function, which keeps its name when lines are moved. What is in
    /// `main` is moved into `plugin`, if there is no library yet.
    pub fn place(&self, has_library: bool) -> String {
        match self.function.as_deref() {
            Some("main") if !has_library => " in `plugin`".to_owned(),
            Some(function) => format!(" in `{function}`"),
            None => String::new(),
        }
    }
}

/// Returns true if a name may go on with this.
pub(super) fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Returns the name at the start of a text.
pub(super) fn name(text: &str) -> &str {
    &text[..text.find(|c| !is_of_name(c)).unwrap_or(text.len())]
}

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
    /// Whether it sets how single crates are optimised in some profile.
    pub tunes_crates: bool,
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
            tunes_crates: tables.iter().any(|table| is_of_crates(table)),
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

/// Returns true for the tables of single crates in a profile. Those of `dev` and `test` do not count, because bots are too
/// slow there.
fn is_of_crates(table: &str) -> bool {
    let profile = table.strip_prefix("profile.").and_then(|rest| rest.split_once(".package"));
    profile.is_some_and(|(name, _)| name != "dev" && name != "test")
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
fn major_minor(version: &str) -> Option<(u32, u32)> {
    let mut numbers = version.trim_start_matches(|c: char| !c.is_ascii_digit()).split(['.', '-', ',', ' ']);
    Some((numbers.next()?.parse().ok()?, numbers.next().unwrap_or("0").parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_blank_and_lines_keep_their_numbers() {
        let text = "a // \"b\n/* c /* d */ \n e */ f\nlet g = \"// h\"; // i\nr#\"j // \"k\"# '\"' // l";
        assert_eq!(without_comments(text), "a \n\n f\nlet g = \"// h\"; \nr#\"j // \"k\"# '\"' ");
    }

    #[test]
    fn lines_have_the_function_around_them() {
        let code = "use a::MARK;\nconst A: u32 = MARK;\npub fn plugin(app: &mut App) { app.add(MARK); }\n\
            fn sized(all: [u8; 3]) -> u8 {\n    if all[0] > 0 { one(); }\n    all.iter().map(|x| {\n        MARK\n    })\n}\n\
            impl Plugin for hero::HeroPlugin<T> {\n    fn build(&self) { MARK }\n}\n\
            impl<T: A> Own<T> {\n    fn other() {}\n    pub fn own() { MARK }\n}\nmod inner { fn deep() { MARK } }\nstatic B: u32 = MARK;";
        let source = SourceText::new("src/lib.rs", code);
        let found: Vec<_> = source.lines_with(&["MARK"]).into_iter().map(|at| (at.line, at.function)).collect();
        let names =
            [None, Some("plugin"), Some("sized"), Some("HeroPlugin::build"), Some("Own::own"), Some("deep"), None];
        let lines = [2, 3, 7, 11, 15, 17, 18];
        let expected: Vec<_> = lines.into_iter().zip(names.map(|name| name.map(str::to_owned))).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_place_keeps_its_name_when_the_code_is_moved() {
        let source = SourceText::new("src/main.rs", "const A: u32 = MARK;\nfn main() { MARK }\nfn play() { MARK }");
        let places =
            |has_library| source.lines_with(&["MARK"]).iter().map(|at| at.place(has_library)).collect::<Vec<_>>();
        assert_eq!(places(true), ["", " in `main`", " in `play`"]);
        assert_eq!(places(false), ["", " in `plugin`", " in `play`"]);
    }

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
        for (table, tunes_crates) in [
            ("[profile.release.package]\nbevy_ecs = { opt-level = 3 }", true),
            ("[profile.release.package.bevy_ecs]\nopt-level = 3", true),
            ("[profile.bots.package]", true),
            ("[profile.dev.package.\"*\"]\nopt-level = 3", false),
            ("[profile.release]\nlto = true", false),
        ] {
            assert_eq!(GameManifest::read(table).tunes_crates, tunes_crates, "{table}");
        }
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
