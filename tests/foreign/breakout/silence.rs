// Stand-ins for the sound, without which Bevy is built here, since it needs headers of the system. The build script
// puts them below the game's file.

use silence::{AssetServer, AudioPlayer, AudioSource, PlaybackSettings, stand_ins};

mod silence {
    use bevy::{
        ecs::{lifecycle::HookContext, world::DeferredWorld},
        prelude::*,
    };

    pub fn stand_ins(app: &mut App) {
        app.init_resource::<AssetServer>();
    }

    // The game loads its sound and nothing else. Bevy's server would look for the file and for a loader, and there is
    // neither: the `bevy` package has no assets.
    #[derive(Resource, Default)]
    pub struct AssetServer;

    impl AssetServer {
        pub fn load(&self, _path: &str) -> Handle<AudioSource> {
            Handle::default()
        }
    }

    #[derive(Asset, TypePath)]
    pub struct AudioSource;

    // A sound is over as soon as it begins.
    #[derive(Component)]
    #[component(on_add = end)]
    #[allow(dead_code, reason = "it is not heard")]
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
