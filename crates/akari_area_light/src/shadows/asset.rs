//! A bake as an asset of Bevy, and the component that gives it to a scene.

use akari_visibility::bake::Bake;
use akari_visibility::container::{Container, FileError};
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use std::sync::Arc;

/// What `akari bake` wrote: the visibility of a static scene. Loaded from `.akari` files.
#[derive(Asset, TypePath, Debug, Clone)]
pub struct VisibilityBake {
    /// Shared with the systems that put it onto the GPU.
    pub bake: Arc<Bake>,
}

impl From<Bake> for VisibilityBake {
    fn from(bake: Bake) -> Self {
        Self {
            bake: Arc::new(bake),
        }
    }
}

/// Area lights throw soft shadows on the meshes of this bake.
///
/// On any entity: the meshes are found by their content and their place in the world, wherever they are in the
/// hierarchy. They have to keep their vertices on the CPU, as meshes do by default
/// ([`RenderAssetUsages::default`](bevy::asset::RenderAssetUsages)), and to stay where they were baked. What else is in the
/// scene may move, and so may every light.
///
/// A glTF scene that Bevy's own loader loads, with what `akari bake scene.glb --out scene.akari` made of it:
///
/// ```no_run
/// # use akari_area_light::shadows::asset::BakedVisibility;
/// # use bevy::prelude::*;
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let scene = GltfAssetLabel::Scene(0).from_asset("scene.glb");
///     commands.spawn(WorldAssetRoot(assets.load(scene)));
///     commands.spawn(BakedVisibility(assets.load("scene.akari")));
/// }
/// ```
#[derive(Component, Debug, Clone, Default, Reflect, Deref, DerefMut)]
#[reflect(Component, Default, Debug, Clone)]
pub struct BakedVisibility(pub Handle<VisibilityBake>);

/// Loads `.akari` files, with all checks of [`Bake::from_container`].
#[derive(Default, TypePath)]
pub struct VisibilityBakeLoader;

/// Why a file is no bake.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// It could not be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// It is damaged, of another version, or a part of a sharded bake.
    #[error(transparent)]
    File(#[from] FileError),
}

impl AssetLoader for VisibilityBakeLoader {
    type Asset = VisibilityBake;
    type Settings = ();
    type Error = LoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        load_context: &mut LoadContext<'_>,
    ) -> Result<VisibilityBake, LoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let container = Container::from_bytes(load_context.path().path(), &bytes)?;
        Ok(Bake::from_container(&container)?.into())
    }

    fn extensions(&self) -> &[&str] {
        &["akari"]
    }
}
