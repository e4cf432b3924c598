//! Systems that fail in a headless World: said in words instead of a panic.
//!
//! Bevy hands errors to a plain function, which has no World. Headless Worlds run their systems on the thread that ticks
//! them, so what the function hears is kept with the thread until the end of the frame.

use std::cell::RefCell;

use bevy::{
    ecs::{
        error::{BevyError, ErrorContext, FallbackErrorHandler, Severity, match_severity},
        system::SystemParamValidationError,
    },
    prelude::*,
};

use crate::known_plugins::{missing_by_type, plugin_of};

/// What Bevy says instead of a name when it is built without its feature `debug`.
const NAMELESS: &str = "<Enable the debug feature";

/// The first failure of a frame.
enum Failure {
    /// A parameter of a system does not exist.
    Missing { context: String, param: String, message: String },
    /// Anything else that Bevy would panic for.
    Other(String),
}

thread_local! {
    static FIRST: RefCell<Option<Failure>> = const { RefCell::new(None) };
}

/// Lets the systems of a World that runs on one thread report errors instead of panicking: see [`take`].
pub fn listen(world: &mut World) {
    world.insert_resource(FallbackErrorHandler(keep));
}

/// Forgets what another World on this thread has left.
pub(crate) fn clear() {
    FIRST.with_borrow_mut(|first| *first = None);
}

fn keep(error: BevyError, context: ErrorContext) {
    if error.severity() != Severity::Panic {
        return match_severity(error, context);
    }
    let failure = Failure::new(format!("{} `{}`", context.kind(), context.name()), &error);
    FIRST.with_borrow_mut(|first| {
        first.get_or_insert(failure);
    });
}

/// The first failure on this thread since the last call, in words.
pub fn take(world: &World) -> Option<String> {
    FIRST.with_borrow_mut(Option::take).map(|failure| failure.describe(world))
}

/// Why a system (or whatever `context` names) could not run, with the name of what is missing and of the plugin that
/// brings it.
pub fn explain(world: &World, context: &str, error: &BevyError) -> String {
    Failure::new(context.to_owned(), error).describe(world)
}

impl Failure {
    fn new(context: String, error: &BevyError) -> Self {
        match error.downcast_ref::<SystemParamValidationError>() {
            Some(invalid) => Self::Missing {
                context,
                param: format!("{}{}", invalid.param.shortname(), invalid.field),
                message: invalid.message.to_string(),
            },
            None => Self::Other(format!("{context} failed: {error}").trim_end().to_owned()),
        }
    }

    fn describe(self, world: &World) -> String {
        match self {
            Self::Missing { context, param, message } if !param.contains(NAMELESS) => {
                describe(&context, &param, &message)
            }
            Self::Missing { context, message, .. } => nameless(world, &context, &message),
            Self::Other(words) => words,
        }
    }
}

/// A resource is missing, and Bevy knows the names.
fn describe(context: &str, param: &str, message: &str) -> String {
    let inner = ["Res<", "ResMut<", "NonSend<", "NonSendMut<"].iter().find_map(|kind| param.strip_prefix(kind));
    let resource = inner.and_then(|inner| inner.strip_suffix('>'));
    if let Some(resource) = resource {
        let whose = match plugin_of(resource) {
            Some(plugin) => format!("{plugin} brings it"),
            None => "insert it, or add the plugin that brings it".to_owned(),
        };
        return format!("{context} needs the resource `{resource}`, which does not exist: {whose}");
    }
    let of_messages = ["MessageReader<", "MessageWriter<"].iter().find_map(|kind| param.strip_prefix(kind));
    match of_messages.and_then(|rest| rest.split_once(">::")).map(|(kind, _)| kind) {
        Some(kind) => {
            format!("{context} needs messages of the type `{kind}`, which nobody has added: `add_message` brings them")
        }
        None => format!("{context} has a parameter `{param}` that does not work: {message}"),
    }
}

/// A resource is missing, and nobody knows its name.
fn nameless(world: &World, context: &str, message: &str) -> String {
    let who = if context.contains(NAMELESS) { "a system" } else { context };
    let missing = missing_by_type(world);
    let which = if missing.is_empty() {
        "none of Bevy's usual ones, so probably one of the game's own".to_owned()
    } else {
        format!("these are asked for and not there: {}", missing.join(", "))
    };
    format!(
        "{who} cannot run, since something that it needs does not exist ({message}); {which}; build with Bevy's \
         feature `debug` to see the names of system and resource"
    )
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::BoxedSystem;

    use super::*;

    #[test]
    fn a_missing_resource_is_named_with_the_plugin_that_brings_it() {
        let text = describe("system `setup`", "ResMut<Assets<ColorMaterial>>", "Resource does not exist");
        assert_eq!(
            text,
            "system `setup` needs the resource `Assets<ColorMaterial>`, which does not exist: `SpriteRenderPlugin` \
             (Bevy's feature `bevy_sprite_render`) brings it"
        );
        let text = describe("system `score`", "Res<Score>", "Resource does not exist");
        assert!(text.contains("`Score`") && text.ends_with("insert it, or add the plugin that brings it"), "{text}");
        let text = describe("system `hear`", "MessageReader<Bang>::messages", "Message not initialized");
        assert!(text.contains("`Bang`") && text.contains("`add_message`"), "{text}");
        let text = describe("system `x`", "Odd", "it is odd");
        assert_eq!(text, "system `x` has a parameter `Odd` that does not work: it is odd");
    }

    #[test]
    fn without_names_the_missing_resources_of_bevy_are_told_by_their_types() {
        let mut world = World::new();
        let text = nameless(&world, "system `<Enable the debug feature to see the name>`", "Resource does not exist");
        assert!(text.starts_with("a system cannot run") && text.contains("probably one of the game's own"), "{text}");
        let mut system: BoxedSystem = Box::new(IntoSystem::into_system(|_: Res<ButtonInput<MouseButton>>| {}));
        system.initialize(&mut world);
        let text = nameless(&world, "system `aim`", "Resource does not exist");
        for part in ["system `aim` cannot run", "`ButtonInput<MouseButton>` (`InputPlugin`)", "feature `debug`"] {
            assert!(text.contains(part), "`{part}` is missing in: {text}");
        }
    }
}
