//! Factories of the systems in a game's description, with one system for each World.

use std::{any::type_name, sync::Arc};

use bevy::{
    ecs::system::{BoxedSystem, RunSystemError},
    prelude::*,
};

use bevy_playbot::system_errors;

/// A factory of copies of a system.
pub(super) struct SystemFactory<Out: 'static> {
    name: &'static str,
    make: Arc<dyn Fn() -> BoxedSystem<(), Out> + Send + Sync>,
}

impl<Out: 'static> Clone for SystemFactory<Out> {
    fn clone(&self) -> Self {
        Self { name: self.name, make: self.make.clone() }
    }
}

impl<Out: 'static> SystemFactory<Out> {
    /// Creates a factory of copies of `system`, whose output is converted.
    pub(super) fn new<S, Given, M>(system: S, convert: fn(Given) -> Out) -> Self
    where
        S: IntoSystem<(), Given, M> + Clone + Send + Sync + 'static,
        Given: 'static,
        M: 'static,
    {
        let make = move || -> BoxedSystem<(), Out> {
            Box::new(IntoSystem::into_system(IntoSystem::<(), Given, M>::map(system.clone(), convert)))
        };
        Self { name: type_name::<S>(), make: Arc::new(make) }
    }

    /// Returns the name of the system, for messages.
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    /// Creates a system for one World.
    pub(super) fn make(&self) -> OwnedSystem<Out> {
        OwnedSystem { name: self.name, system: (self.make)(), is_initialized: false }
    }
}

/// A system of one World.
pub(super) struct OwnedSystem<Out: 'static> {
    name: &'static str,
    system: BoxedSystem<(), Out>,
    is_initialized: bool,
}

impl<Out: 'static> OwnedSystem<Out> {
    /// Runs the system; `None` if it is skipped, because an entity that it asks for does not exist.
    ///
    /// # Errors
    ///
    /// The reason why it cannot run, in words.
    pub(super) fn run(&mut self, world: &mut World) -> Result<Option<Out>, String> {
        if !self.is_initialized {
            self.system.initialize(world);
            self.is_initialized = true;
        }
        match self.system.run((), world) {
            Ok(out) => Ok(Some(out)),
            Err(RunSystemError::Skipped(_)) => Ok(None),
            Err(RunSystemError::Failed(error)) => {
                Err(system_errors::explain(&format!("system `{}`", self.name), &error))
            }
        }
    }

    /// Runs the system as [`run`](Self::run) does, where skipping is an error.
    ///
    /// # Errors
    ///
    /// The reason why it cannot run, in words.
    pub(super) fn demand(&mut self, world: &mut World) -> Result<Out, String> {
        let name = self.name;
        self.run(world)?.ok_or_else(|| {
            format!("system `{name}` was skipped: an entity that it asks for does not exist, or there are several")
        })
    }
}
