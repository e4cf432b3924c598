//! Test that all writes of products to a disk go through one module.

use std::fs;

use crate::{
    files::{files, shown},
    packages::workspace,
};

/// What changes a disk. A file is opened by options too, see [`opens_by_itself`], and an image saves itself, see
/// [`saves_an_image`].
const WRITES: [&str; 10] = [
    "fs::write(",
    "File::create",
    "File::options",
    "options.open(",
    "fs::rename",
    "fs::remove_",
    "fs::create_dir",
    "fs::hard_link",
    "fs::copy(",
    "save_to_disk(",
];

/// What a source writes without the module for it; tests at its end may.
fn past_the_module(source: &str) -> Vec<&'static str> {
    let code = source.replace("DiskFile::", "");
    let code =
        ["#[cfg(test)]\n", "#[cfg(all(test"].iter().fold(&*code, |code, tests| code.split(*tests).next().unwrap_or(""));
    let mut found: Vec<_> = WRITES.into_iter().filter(|write| code.contains(*write)).collect();
    found.extend(opens_by_itself(code).then_some("OpenOptions::new() … .open("));
    found.extend(saves_an_image(code).then_some("image … .save("));
    found
}

/// Whether options are opened in the statement that makes them, and not handed to the module.
fn opens_by_itself(code: &str) -> bool {
    let rest_of_statement = |rest: &str| rest.split(';').next().unwrap_or_default().contains(".open(");
    code.split("OpenOptions::new()").skip(1).any(rest_of_statement)
}

/// Whether an image of the crate `image`, which Bevy turns its own into, is saved.
fn saves_an_image(code: &str) -> bool {
    let is_of_images = ["try_into_dynamic", "DynamicImage", "RgbImage", "RgbaImage", "ImageBuffer"];
    is_of_images.iter().any(|name| code.contains(*name))
        && [".save(", ".save_with_format("].iter().any(|save| code.contains(*save))
}

#[test]
fn all_that_is_written_goes_through_one_module() {
    let (workspace, mut faults) = (workspace(), Vec::new());
    let all = ["plugin", "game"].into_iter().flat_map(|folder| files(&workspace.join(folder), ".rs"));
    for file in all {
        let shown = shown(&workspace, &file);
        let is_product = shown.contains("/src/") && !shown.contains("/src/disk/") && !shown.ends_with("/src/disk.rs");
        if is_product && !shown.ends_with("tests.rs") && !shown.ends_with("testing.rs") {
            let source = fs::read_to_string(&file).expect("readable");
            faults.extend(past_the_module(&source).into_iter().map(|write| format!("{shown}: {write}")));
        }
    }
    assert!(
        faults.is_empty(),
        "{} to mend\n{}\npower cuts are tested on what goes through `playbot_learner::disk`: call the functions there\n",
        faults.len(),
        faults.join("\n")
    );
}

#[test]
fn what_is_written_past_the_module_is_found() {
    for (source, found) in [
        ("fs::write(path, text)?;", vec!["fs::write("]),
        ("let file = std::fs::OpenOptions::new().append(true)\n.open(path)?;", vec!["OpenOptions::new() … .open("]),
        ("let mut options = OpenOptions::new();\noptions.open(path)?;", vec!["options.open("]),
        ("File::create_new(path)?; fs::remove_file(path)?;", vec!["File::create", "fs::remove_"]),
        ("image.try_into_dynamic()?.save(path)?;", vec!["image … .save("]),
        ("let file = DiskFile::open(&path, OpenOptions::new().read(true)); args.open(path)?;", vec![]),
        ("DiskFile::create(&path)?; model.save(&path)?;", vec![]),
        ("fn a() {}\n#[cfg(test)]\nmod tests { fs::write(path, text) }", vec![]),
    ] {
        assert_eq!(past_the_module(source), found, "{source}");
    }
}
