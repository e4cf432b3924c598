//! The documents, and the blocks of code in them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde_json::Value;

/// A document, the marker around its block, and the source that holds the block.
pub const SHOWN: [(&str, &str, &str); 5] = [
    ("README.md", "adapter", "tests/tests/documentation/hand_made.rs"),
    ("README.md", "red", "tests/tests/documentation/tutorial.rs"),
    ("docs/tutorial/test-your-levels.md", "hand_made", "tests/tests/documentation/hand_made.rs"),
    ("docs/tutorial/test-your-levels.md", "red", "tests/tests/documentation/tutorial.rs"),
    ("docs/tutorial/train-a-bot.md", "runner", "tests/tests/documentation/runner.rs"),
];

/// Returns the folder of the workspace.
pub fn workspace() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    folder.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
}

/// A document.
pub struct Document {
    /// Its path in the workspace.
    pub path: String,
    pub text: String,
}

/// A block of code.
#[derive(Debug, PartialEq)]
pub struct Block {
    /// Line of the document in which it begins.
    pub line: usize,
    /// Text behind the opening fence.
    pub language: String,
    pub text: String,
}

/// Returns all documents for readers of the repository.
pub fn documents() -> Vec<Document> {
    let crates =
        folders_below("plugin").into_iter().filter(|folder| workspace().join(folder).join("Cargo.toml").exists());
    let folders = ["", "assets", "demos", "game", "tests"].map(str::to_owned).into_iter().chain(crates);
    let folders = folders.chain(folders_below("docs"));
    let documents: Vec<_> = folders.flat_map(|folder| documents_of(&folder)).collect();
    for path in [
        "README.md",
        "CONTRIBUTING.md",
        "docs/README.md",
        "docs/tutorial/test-your-levels.md",
        "docs/results/foreign/table.md",
        "plugin/cli/README.md",
    ] {
        assert!(documents.iter().any(|document| document.path == path), "{path} is missing");
    }
    documents
}

/// Returns a folder, and all folders below it.
fn folders_below(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(workspace().join(folder)).unwrap_or_else(|error| panic!("{folder}: {error}"));
    let entries = entries.map(|entry| entry.expect("readable")).filter(|entry| entry.path().is_dir());
    let mut inner: Vec<_> = entries.map(|entry| format!("{folder}/{}", entry.file_name().to_string_lossy())).collect();
    inner.sort();
    let below = inner.iter().flat_map(|folder| folders_below(folder));
    std::iter::once(folder.to_owned()).chain(below).collect()
}

/// Returns the documents in a folder, but for the list of changes, which describes the past.
fn documents_of(folder: &str) -> Vec<Document> {
    let entries = fs::read_dir(workspace().join(folder)).unwrap_or_else(|error| panic!("{folder}: {error}"));
    let names = entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned());
    let mut names: Vec<_> = names.filter(|name| name.ends_with(".md") && name != "CHANGELOG.md").collect();
    names.sort();
    let path = |name: &String| if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
    names.iter().map(|name| Document { path: path(name), text: read(&path(name)) }).collect()
}

/// Returns a file of the workspace.
pub fn read(path: &str) -> String {
    fs::read_to_string(workspace().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Returns the blocks of code of a text.
pub fn blocks(text: &str) -> Vec<Block> {
    let mut found = Vec::new();
    let mut open: Option<Block> = None;
    for (index, line) in text.lines().enumerate() {
        match (line.trim_start().strip_prefix("```"), &mut open) {
            (Some(_), Some(_)) => found.extend(open.take()),
            (Some(language), None) => {
                open = Some(Block { line: index + 1, language: language.to_owned(), text: String::new() });
            }
            (None, Some(block)) => {
                block.text.push_str(line);
                block.text.push('\n');
            }
            (None, None) => {}
        }
    }
    assert_eq!(open, None, "a block is not closed");
    found
}

#[test]
fn blocks_are_found_with_their_lines() {
    let found = blocks("a\n```sh\nb\nc\n```\nd\n```\ne\n```\n");
    let block = |line, language: &str, text: &str| Block { line, language: language.into(), text: text.into() };
    assert_eq!(found, [block(2, "sh", "b\nc\n"), block(7, "", "e\n")]);
}

/// Every block is checked: Rust by `cargo test --doc` or as an excerpt of a source, the others by the tests beside this
/// one.
#[test]
fn every_block_is_of_a_kind_that_is_checked() {
    let compiled = read("tests/src/documentation.rs");
    for Document { path, text } in documents() {
        for Block { line, language, text: block } in blocks(&text) {
            // The marker above a block: `<!-- name -->`.
            let above = text.lines().nth(line.saturating_sub(2)).unwrap_or_default();
            let marker = above.strip_prefix("<!-- ").and_then(|rest| rest.strip_suffix(" -->")).unwrap_or_default();
            match language.as_str() {
                "sh" | "ron" => {}
                // Programs that a client of a language model starts.
                "json" if block.contains("\"mcpServers\"") => {
                    let servers: Value = serde_json::from_str(&block).expect("JSON");
                    for (_, server) in servers["mcpServers"].as_object().expect("servers") {
                        let args = server["args"].as_array().expect("a list").iter().filter_map(Value::as_str);
                        let checked = playbot::check_usage(std::iter::once("playbot").chain(args));
                        checked.unwrap_or_else(|error| panic!("{path}:{line}: {error}"));
                    }
                }
                // Level files: see `level_files`.
                "json" => assert_eq!(path, "docs/reference/level-formats.md", "line {line} is not read"),
                // Dependencies: see `sources`.
                "toml" => {
                    assert!(block.contains("[dependencies]") || block.contains("-dependencies]"), "{path}:{line}")
                }
                // A workflow of GitHub or a job of GitLab that runs a command or the action, in spaces, as YAML has it.
                "yaml" => {
                    let is_workflow = block.contains("- run: ") || block.contains("- uses: <this repository>@");
                    let runs = block.contains("runs-on:") && is_workflow || block.contains("\n  script: ");
                    assert!(runs && !block.contains('\t'), "{path}:{line}");
                }
                // Output of a command: the command stands above it, and can be called (see `commands`).
                "text" => assert!(
                    !marker.is_empty() || text.lines().take(line - 1).any(|line| line == "```sh"),
                    "{path}:{line}: no command above says where this output is from"
                ),
                "rust" | "rust,no_run" => {
                    let own = path.strip_suffix("README.md").map(|folder| format!("{folder}src/lib.rs"));
                    let own = own.filter(|root| workspace().join(root).exists()).map(|root| read(&root));
                    let is_own = own.is_some_and(|root| root.contains("include_str!(\"../README.md\")"));
                    let is_compiled = is_own || compiled.contains(&format!("include_str!(\"../../{path}\")"));
                    assert!(is_compiled, "{path}:{line} is not compiled: add it to tests/src/documentation.rs");
                }
                // An excerpt of a source that is compiled: see `sources`.
                "rust,ignore" => {
                    let is_shown = SHOWN.iter().any(|(document, name, _)| *document == path && *name == marker);
                    assert!(is_shown, "{path}:{line} is not compiled: add it to `SHOWN`");
                }
                other => panic!("{path}:{line}: blocks of `{other}` are not checked"),
            }
        }
    }
}
