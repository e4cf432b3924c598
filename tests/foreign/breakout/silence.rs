// Stand-ins for the sound, with which Bevy is not built here: it needs headers of the system. The build script puts them
// below the game's file.

use silence::{AudioPlayer, AudioSource, PlaybackSettings, stand_ins};

mod silence {
    use bevy::{
        ecs::{lifecycle::HookContext, world::DeferredWorld},
        prelude::*,
    };

    pub fn stand_ins(app: &mut App) {
        app.init_asset::<AudioSource>();
    }

    #[derive(Asset, TypePath)]
    pub struct AudioSource;

    // A sound is over as soon as it begins.
    #[derive(Component)]
    #[component(on_add = end)]
    #[allow(dead_code, reason = "nobody hears it")]
    pub struct AudioPlayer(pub Handle<AudioSource>);

    #[derive(Component)]
    pub struct PlaybackSettings;

    impl PlaybackSettings {
        pub const DESPAWN: Self = Self;
    }

    fn end(mut world: DeferredWorld, context: HookContext) {
        world.commands().entity(context.entity).despawn();
    }
}
