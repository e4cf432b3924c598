//! Tests that the rules find what is planted for them.

use std::{fs, path::Path};

use crate::{
    circles::{circles, folders},
    doctests::without_example,
    imports::needs,
    modules::Modules,
};

/// A crate of these files below `src`.
fn modules(files: &[(&str, &str)]) -> (tempfile::TempDir, Modules) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().unwrap_or(Path::new("."))).expect("writable");
        fs::write(file, text).expect("writable");
    }
    let modules = Modules::read(&folder.path().join("lib.rs"));
    (folder, modules)
}

/// All circles, each as the names of its modules.
fn found(files: &[(&str, &str)]) -> Vec<String> {
    let (_folder, modules) = modules(files);
    let needs = needs(&modules);
    let mut found = Vec::new();
    for (folder, edges) in folders(&needs) {
        for circle in circles(&edges) {
            let names = circle.iter().map(|need| need.from[folder.len()..].join("::"));
            found.push(names.collect::<Vec<_>>().join(" "));
        }
    }
    found
}

#[test]
fn a_circle_is_found_however_it_is_written() {
    let lib = ("lib.rs", "mod a; mod b; mod c; pub use c::{C, deep::D};");
    let c = ("c/mod.rs", "pub mod deep; pub struct C;");
    let deep = ("c/deep.rs", "pub struct D;");
    for a in [
        "use crate::b::B;",
        "use crate::{c::C, b::{self, B}};",
        "fn f() -> u8 { crate::b::f() }",
        "use super::b;",
        "fn f() { use crate::b::B; }",
        "pub use crate::b::*;",
        "#[require(crate::b::B)] pub struct A;",
        "pub(crate) fn f(_: &[super::b::B; 2]) {}",
    ] {
        let there = found(&[lib, c, deep, ("a.rs", a), ("b.rs", "use crate::a; pub struct B;")]);
        assert_eq!(there, ["a b"], "{a}");
    }
}

#[test]
fn a_circle_goes_through_re_exports_of_the_root_and_through_others() {
    let lib = ("lib.rs", "mod a; mod b; mod c; pub use c::{C, deep::D};");
    let c = ("c/mod.rs", "pub mod deep; pub use self::deep::D as C;");
    let deep = ("c/deep.rs", "use crate::a::A; pub struct D(A);");
    let there = found(&[lib, c, deep, ("a.rs", "use crate::b::B;"), ("b.rs", "use crate::C;")]);
    assert_eq!(there, ["a b c::deep"]);
}

#[test]
fn tests_comments_strings_and_visibility_make_no_circle() {
    let quiet =
        "// use crate::b;\n/* crate::b::B */ #[cfg(test)] mod tests { use crate::b::B; } #[cfg(test)] use crate::b;
        pub(in crate::b) const A: &str = \"crate::b::B\"; pub struct A2;";
    let there = found(&[("lib.rs", "mod a; mod b;"), ("a.rs", quiet), ("b.rs", "use crate::a::A2; pub struct B;")]);
    assert_eq!(there, [""; 0]);
}

#[test]
fn files_of_a_folder_are_looked_at_too() {
    let files = [
        ("lib.rs", "mod a;"),
        ("a/mod.rs", "mod b; mod c; pub use b::B;"),
        ("a/b.rs", "use super::c::C; pub struct B;"),
        ("a/c.rs", "use crate::a::B; pub struct C;"),
    ];
    assert_eq!(found(&files), ["b c"]);
}

#[test]
fn public_modules_without_an_example_are_found() {
    let shown = "//! ```\n//! f();\n//! ```\npub fn f() {}";
    let (_folder, modules) = modules(&[
        ("lib.rs", "pub mod a; pub mod b; pub mod c; mod d; #[doc(hidden)] pub mod e; pub mod f { pub fn g() {} }"),
        ("a.rs", shown),
        ("b.rs", "//! ```text\n//! f();\n//! ```\npub fn f() {}"),
        ("c/mod.rs", "mod below; pub mod bare;"),
        ("c/below.rs", shown),
        ("c/bare.rs", "pub struct Bare;"),
        ("d.rs", "pub struct Unseen;"),
        ("e.rs", "pub struct Hidden;"),
    ]);
    assert_eq!(without_example(&modules), ["b", "c::bare", "f"]);
}
