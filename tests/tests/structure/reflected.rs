//! Test that components, resources and events are known to Bevy's type registry: inspectors show them, and `playbot
//! doctor` names them.

use std::{fs, slice};

use bevy::{
    prelude::*,
    reflect::{ReflectFromReflect, TypeRegistry},
};
use bevy_playbot::headless::headless_app;
// Linked, so that what they register is there.
use playbot as _;
use playbot_games as _;
use playbot_harness as _;
use playbot_mutation as _;
use playbot_test as _;
use playbot_train as _;

use crate::{
    files::{files, shown},
    items::Item,
    modules::Modules,
    packages::{Package, packages, workspace},
};

/// The crates that are looked at. Types of tests, and of games that are not ours, are their own affair.
const CRATES: [&str; 7] = [
    "bevy_playbot",
    "playbot",
    "playbot_games",
    "playbot_harness",
    "playbot_mutation",
    "playbot_test",
    "playbot_train",
];

/// rapier's worlds, of which reflection sees nothing. Without `ReflectComponent` they are among those that
/// `playbot doctor` says it cannot compare; with it they would count as compared.
const CLOSED: [&str; 1] = ["playbot_games::maze2d::physics::MazePhysics"];

/// What a type is to Bevy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Component,
    Resource,
    /// An event or a message.
    Event,
}

impl Kind {
    /// By what an item derives.
    fn of(item: &Item) -> Option<Self> {
        let kinds = [
            ("Resource", Self::Resource),
            ("Component", Self::Component),
            ("Event", Self::Event),
            ("EntityEvent", Self::Event),
            ("Message", Self::Event),
        ];
        kinds.into_iter().find_map(|(name, kind)| derives(item, name).then_some(kind))
    }
}

/// A component, resource or event.
#[derive(Debug, PartialEq, Eq)]
struct Kept {
    /// As the registry calls it.
    path: String,
    name: String,
    kind: Kind,
    is_reflected: bool,
    /// A generic type is registered for each type that it is used with, by name.
    is_generic: bool,
}

fn derives(item: &Item, name: &str) -> bool {
    let lists = item.attributes.iter().filter_map(|attribute| attribute.strip_prefix("derive(")?.strip_suffix(")"));
    lists.flat_map(|list| list.split(',')).any(|derived| derived.rsplit("::").next() == Some(name))
}

/// All components, resources and events of a crate.
fn kept(krate: &str, modules: &Modules) -> Vec<Kept> {
    let mut found = Vec::new();
    for (module, contents) in &modules.0 {
        for item in &contents.items {
            if let Some(kind) = Kind::of(item) {
                let krate = krate.to_owned();
                let parts = [slice::from_ref(&krate), module.as_slice(), slice::from_ref(&item.name)].concat();
                let is_generic = item.body.get(1).is_some_and(|token| token.text == "<");
                let (path, name, is_reflected) = (parts.join("::"), item.name.clone(), derives(item, "Reflect"));
                found.push(Kept { path, name, kind, is_reflected, is_generic });
            }
        }
    }
    found
}

/// Whether some source of the package registers a generic type.
fn registers(package: &Package, name: &str) -> bool {
    let words = format!("register_type::<{name}<");
    files(&package.folder.join("src"), ".rs")
        .iter()
        .any(|file| fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).contains(&words))
}

fn fault(kept: &Kept, package: &Package, registry: &TypeRegistry) -> Option<&'static str> {
    if !kept.is_reflected {
        return Some("does not derive `Reflect`");
    }
    if kept.is_generic {
        return (!registers(package, &kept.name)).then_some("is not registered");
    }
    let Some(known) = registry.get_with_type_path(&kept.path) else { return Some("is not registered") };
    if kept.kind == Kind::Event || CLOSED.contains(&kept.path.as_str()) {
        return None;
    }
    if known.data::<ReflectComponent>().is_none() {
        return Some("has no `#[reflect(Component)]` or `#[reflect(Resource)]`");
    }
    // Bevy's mark of a resource asks that it can be made from its fields.
    let is_unmarked = kept.kind == Kind::Resource && known.data::<ReflectFromReflect>().is_some();
    (is_unmarked && known.data::<ReflectResource>().is_none()).then_some("has no `#[reflect(Resource)]`")
}

/// They can be read by it, too: `#[reflect(Resource)]` brings what `#[reflect(Component)]` does, and a resource that
/// cannot be made from its fields has the latter.
///
/// What does not implement `Reflect` itself is left out with `#[reflect(ignore)]`, or the whole is
/// `#[reflect(opaque)]`.
#[test]
fn components_resources_and_events_are_reflected_and_registered() {
    let app = headless_app();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let (mut faults, mut count) = (Vec::new(), 0);
    for package in packages(&workspace()).iter().filter(|package| CRATES.contains(&package.name.as_str())) {
        let root = package.root().expect("a library");
        for kept in kept(&package.name, &Modules::read(&root)) {
            count += 1;
            if let Some(why) = fault(&kept, package, &registry) {
                faults.push(format!("{}: {} {why}", shown(&workspace(), &package.folder), kept.path));
            }
        }
    }
    assert!(count > 100, "only {count} components, resources and events were found: does the reader still see them?");
    assert!(faults.is_empty(), "{} to mend\n{}\n", faults.len(), faults.join("\n"));
}

#[test]
fn what_is_not_reflected_or_not_registered_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = "#[derive(Component, Clone)] #[require(Transform)] pub struct Bare;
        pub mod inner {
            #[derive(Clone, Resource, bevy::reflect::Reflect)] #[reflect(Resource)] struct Seen(u8);
            #[derive(Resource, Reflect)] struct Many<T: Send>(T);
        }
        #[derive(EntityEvent)] struct Rung { entity: Entity } #[derive(Message, Reflect)] struct Told;
        #[derive(Reflect)] struct Plain; #[cfg(test)] mod tests { #[derive(Component)] struct Tested; }";
    fs::create_dir(folder.path().join("src")).expect("writable");
    fs::write(folder.path().join("src/lib.rs"), source).expect("writable");
    let kept = kept("planted", &Modules::read(&folder.path().join("src/lib.rs")));
    let shown: Vec<_> = kept.iter().map(|kept| (kept.path.as_str(), kept.is_reflected, kept.is_generic)).collect();
    let expected = [
        ("planted::Bare", false, false),
        ("planted::Rung", false, false),
        ("planted::Told", true, false),
        ("planted::inner::Seen", true, false),
        ("planted::inner::Many", true, true),
    ];
    assert_eq!(shown, expected);
    let (name, manifest) = ("planted".to_owned(), String::new());
    let package = Package { name, folder: folder.path().to_owned(), is_published: false, manifest };
    let faults: Vec<_> = kept.iter().map(|kept| fault(kept, &package, &TypeRegistry::new())).collect();
    let (bare, unknown) = (Some("does not derive `Reflect`"), Some("is not registered"));
    assert_eq!(faults, [bare, bare, unknown, unknown, unknown]);
}
