//! The types of components and resources that are compared.

use std::{
    any::TypeId,
    collections::{BTreeMap, BTreeSet},
};

use bevy::{
    ecs::{component::ComponentInfo, reflect::AppTypeRegistry},
    prelude::{ReflectComponent, World},
    reflect::{TypeInfo, TypeRegistration},
};
use serde::Serialize;

use super::{cause::CauseKind, game_copy::GameCopy, scope};

/// The types of the game, by whether they could be compared.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TypesReport {
    /// Components and resources that were compared field by field.
    pub compared: Vec<String>,
    /// Components and resources that were not compared, since they are not reflected. A difference in one of them shows
    /// only later, in observations, rewards and ends of episodes, and in the state hash.
    pub not_reflected: Vec<String>,
    /// Further types without known names, because Bevy is built without its feature `debug`.
    pub unnamed: usize,
    /// Types of fields that are reflected and cannot be compared.
    pub incomparable: Vec<String>,
}

/// One type of component or resource.
pub(super) struct KnownType {
    /// Its path, if it is known.
    pub path: Option<String>,
    /// Its reader, if it is reflected.
    pub reflect: Option<ReflectComponent>,
    /// Whether it belongs to the engine or to the plugin.
    pub engine: bool,
    /// Possible causes of a difference in it, and why.
    pub suspicions: Vec<(CauseKind, String)>,
}

impl KnownType {
    /// Returns whether values of this type are compared.
    pub fn is_compared(&self) -> bool {
        self.reflect.is_some() && self.path.as_deref().is_some_and(scope::is_compared)
    }

    /// Returns the last part of the path.
    pub fn short_name(&self) -> Option<&str> {
        let plain = self.path.as_deref()?.split('<').next()?;
        plain.rsplit("::").next()
    }
}

/// All types so far.
pub(super) struct KnownTypes {
    known: BTreeMap<TypeId, KnownType>,
    /// Types of a World without a game.
    bare: BTreeSet<TypeId>,
}

impl KnownTypes {
    /// Starts with a World without a game, which has only the engine's and the plugin's types.
    pub fn new(bare: &World) -> Self {
        let engine = bare.components().iter_registered().filter_map(ComponentInfo::type_id);
        Self { known: BTreeMap::new(), bare: engine.collect() }
    }

    /// Adds types that are new in a World.
    pub fn learn(&mut self, world: &World) {
        let registry = world.get_resource::<AppTypeRegistry>().map(|registry| registry.read());
        for info in world.components().iter_registered() {
            let Some(id) = info.type_id() else { continue };
            if self.known.contains_key(&id) {
                continue;
            }
            let registration = registry.as_ref().and_then(|registry| registry.get(id));
            let path = registration.map(|known| known.type_info().type_path().to_owned()).or_else(|| named(info));
            let is_engine = self.bare.contains(&id) || path.as_deref().is_some_and(scope::is_engine);
            let known = KnownType {
                path,
                reflect: registration.and_then(|known| known.data::<ReflectComponent>().cloned()),
                engine: is_engine,
                suspicions: registration.map(suspicions).unwrap_or_default(),
            };
            self.known.insert(id, known);
        }
    }

    /// Returns a type by its id.
    pub fn get(&self, id: TypeId) -> Option<&KnownType> {
        self.known.get(&id)
    }

    /// Returns the game's types in a copy, by whether they can be compared.
    pub fn report(&self, copy: &GameCopy, incomparable: &BTreeSet<String>) -> TypesReport {
        let mut report = TypesReport { incomparable: incomparable.iter().cloned().collect(), ..Default::default() };
        for known in copy.present_types().into_iter().filter_map(|id| self.get(id)) {
            match (&known.path, known.is_compared(), known.engine) {
                (Some(path), true, _) => report.compared.push(path.clone()),
                (_, _, true) => {}
                (Some(path), ..) => report.not_reflected.push(path.clone()),
                (None, ..) => report.unnamed += 1,
            }
        }
        report.compared.sort();
        report.not_reflected.sort();
        report
    }

    /// Returns the possible causes of a difference in the types of a copy.
    pub fn suspicions(&self, copy: &GameCopy) -> Vec<(CauseKind, String)> {
        let present = copy.present_types();
        let game = present.into_iter().filter_map(|id| self.get(id)).filter(|known| !known.engine);
        let mut all: Vec<_> = game.flat_map(|known| known.suspicions.clone()).collect();
        all.sort();
        all.dedup();
        all
    }
}

/// Returns the name of a type that is not reflected. Bevy knows it only with its feature `debug`.
fn named(info: &ComponentInfo) -> Option<String> {
    let name = info.name().to_string();
    (!name.starts_with('<')).then_some(name)
}

/// Words in the path of a field's type, and the causes that they point to.
const SIGNS: [(&str, CauseKind); 6] = [
    ("RandomState", CauseKind::HashOrder),
    ("::Instant", CauseKind::WallClock),
    ("SystemTime", CauseKind::WallClock),
    ("Rng", CauseKind::Randomness),
    ("rand::", CauseKind::Randomness),
    ("fastrand", CauseKind::Randomness),
];

fn suspicions(registration: &TypeRegistration) -> Vec<(CauseKind, String)> {
    let info = registration.type_info();
    let fields: Vec<(String, &'static str)> = match info {
        TypeInfo::Struct(parts) => {
            parts.iter().map(|field| (format!(".{}", field.name()), field.type_path())).collect()
        }
        TypeInfo::TupleStruct(parts) => {
            parts.iter().map(|field| (format!(".{}", field.index()), field.type_path())).collect()
        }
        _ => Vec::new(),
    };
    let own = (String::new(), info.type_path());
    let found = fields.into_iter().chain([own]).flat_map(|(field, path)| {
        let signs = SIGNS.iter().filter(move |(sign, _)| path.contains(sign));
        signs.map(move |(_, kind)| (*kind, format!("`{}{field}` is a `{path}`", info.type_path_table().short_path())))
    });
    found.collect()
}
