//! Variants of the corridor game for tests.

/// Implements the methods of [`Game`](playbot::prelude::Game) as the [`Corridor`](crate::Corridor) does, for the
/// `impl Game` of a variant of it. `but build` leaves out [`Game::build`](playbot::prelude::Game::build), and a
/// list has only the named ones.
#[macro_export]
macro_rules! as_corridor {
    () => {
        $crate::as_corridor! { but build }
        $crate::as_corridor! {
            fn build(app: &mut ::bevy::prelude::App, mode: &str);
        }
    };
    (but build) => {
        $crate::as_corridor! {
            fn name() -> &'static str;
            fn version() -> u32;
            fn modes() -> &'static [&'static str];
            fn tick_hz() -> f64;
            fn actions() -> ::playbot::prelude::ActionSpace;
            fn observation() -> ::playbot::prelude::ObservationSpace;
            fn spawn_agent(world: &mut ::bevy::prelude::World, index: u32) -> ::bevy::prelude::Entity;
        }
    };
    ($(fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)?;)+) => {
        $(fn $name(&self, $($argument: $type),*) $(-> $result)? {
            ::playbot::prelude::Game::$name(&$crate::Corridor, $($argument),*)
        })+
    };
}
